"""One way to have many tasks computed, whatever computes them: `open_engine`.

A task is a function of a module, its arguments are pickled: the same function must be importable
where it is computed.  Results come as they are ready, each with the number of its task; a task that
raises gives its exception in place of a result, so that one failure does not end the others.

Note: with MPI every rank runs the whole program.  All but the first get None from
`open_engine`, after the others' work is done, and have nothing to do themselves.
"""

from __future__ import annotations

import collections
import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    as_completed,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol, cast

from shockgrid.hydro.workers import count_processors
from shockgrid.regrid.errors import BadInput

Task = Callable[[Any], Any]


class Engine(Protocol):
    """What computes tasks; `workers`: how many at once."""

    workers: int

    def compute(self, task: Task, arguments: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """Yield (number of the argument, result or exception), in the order in which they end."""
        ...


MOST_TASK_DEATHS = 3  # of its process, after which a task is given up


class WorkerDied(Exception):
    """The process of a task died, again and again."""


def _begin_worker(started) -> None:
    """In a new worker: say so, leave Ctrl-C to the tasks, and watch for the end of the parent."""
    started.set()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class Processes:
    """`workers` processes as an `Engine`, to be used in a `with` statement.

    Each is a pool of its own, so that a process that dies breaks no other's pool and takes one
    task with it, which is known.
    """

    def __init__(self, workers: int):
        if multiprocessing.parent_process() is not None:
            raise BadInput(
                "processes are started while a worker process reads the script; "
                'put what starts them under if __name__ == "__main__":'
            )
        self.workers = workers
        self._context = multiprocessing.get_context("spawn")
        self._started = self._context.Event()
        self._before = set(multiprocessing.active_children())
        self._pools: list[ProcessPoolExecutor] = []
        self._idle: list[ProcessPoolExecutor] = []

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, kind, error, trace) -> None:
        """End the workers; where something went wrong, ask what they compute to stop first."""
        if kind is not None:
            for child in set(multiprocessing.active_children()) - self._before:
                child.terminate()
        for pool in self._pools:
            pool.shutdown(wait=True, cancel_futures=True)

    def compute(self, task: Task, arguments: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As `Engine.compute`; a task whose process died MOST_TASK_DEATHS times gives a
        WorkerDied."""
        waiting = collections.deque(range(len(arguments)))
        deaths: collections.Counter[int] = collections.Counter()
        running: dict[Future, tuple[int, ProcessPoolExecutor]] = {}
        while waiting or running:
            while waiting and len(running) < self.workers:
                future, pool = self._submit(task, arguments[waiting[0]])
                running[future] = waiting.popleft(), pool
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                number, pool = running.pop(future)
                error = future.exception()
                if not isinstance(error, BrokenProcessPool):
                    self._idle.append(pool)
                elif not self._started.is_set():
                    raise BadInput(
                        "the worker processes end before they begin; in a script, put what starts "
                        'them under if __name__ == "__main__":'
                    )
                else:
                    deaths[number] += 1
                    if deaths[number] < MOST_TASK_DEATHS:
                        waiting.append(number)
                        continue
                    error = WorkerDied(
                        f"its process died {MOST_TASK_DEATHS} times (out of memory?)"
                    )
                yield number, future.result() if error is None else error

    def _submit(self, task: Task, argument: Any) -> tuple[Future, ProcessPoolExecutor]:
        """Hand a task to an idle process or a new one."""
        while self._idle:
            pool = self._idle.pop()
            with contextlib.suppress(BrokenProcessPool):  # it has died idle
                return pool.submit(task, argument), pool
        pool = ProcessPoolExecutor(1, self._context, _begin_worker, (self._started,))
        self._pools.append(pool)
        return pool.submit(task, argument), pool


class Cluster:
    """An executor as an `Engine`: all tasks are handed over at once."""

    def __init__(self, executor: Executor, workers: int):
        self.executor = executor
        self.workers = workers

    def compute(self, task: Task, arguments: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As `Engine.compute`; a task whose workers died gives the executor's exception."""
        numbers = {self.executor.submit(task, one): n for n, one in enumerate(arguments)}
        try:
            for future in as_completed(numbers):
                error = future.exception()
                yield numbers[future], future.result() if error is None else error
        except BaseException:
            for future in numbers:
                future.cancel()
            raise


@contextlib.contextmanager
def open_mpi() -> Iterator[Cluster | None]:
    """The ranks of MPI but the first, which gets the engine; the others get None in the end.

    Started as `mpiexec -n N shockgrid ...`.  BadInput where mpi4py is missing.
    """
    try:
        from mpi4py import MPI
        from mpi4py.futures import MPICommExecutor
    except (ImportError, RuntimeError) as error:  # RuntimeError: no MPI library
        raise BadInput(
            f"--engine mpi needs mpi4py and an MPI library: pip install 'shockgrid[mpi]' ({error})"
        ) from error
    with MPICommExecutor(MPI.COMM_WORLD, root=0) as executor:
        workers = max(1, MPI.COMM_WORLD.size - 1)
        yield None if executor is None else Cluster(cast(Executor, executor), workers)


class InTurn:
    """All tasks one after another in this process."""

    workers = 1

    def compute(self, task: Task, arguments: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As `Engine.compute`."""
        for number, argument in enumerate(arguments):
            try:
                result = task(argument)
            except Exception as error:
                result = error
            yield number, result


@contextlib.contextmanager
def open_engine(
    engine: str | Executor = "processes", jobs: int | None = None
) -> Iterator[Engine | None]:
    """The engine called "processes" or "mpi", or that of an executor, with `jobs` workers.

    jobs: left out, one a processor, or one of an executor.  None on the ranks of MPI that only
    compute.  BadInput for an unknown name, for `jobs` with MPI, and where mpi4py is missing.
    """
    if isinstance(engine, Executor):
        yield Cluster(engine, jobs or 1)
    elif engine == "processes":
        jobs = jobs or count_processors()
        with contextlib.nullcontext(InTurn()) if jobs == 1 else Processes(jobs) as opened:
            yield opened
    elif engine != "mpi":
        raise BadInput(f"--engine {engine!r}: there are processes and mpi")
    elif jobs is not None:
        raise BadInput("--jobs needs --engine processes; mpi has its own workers")
    else:
        with open_mpi() as opened:
            yield opened
