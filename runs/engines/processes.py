"""Processes of this machine, made anew when one of them dies.

They are spawned, not forked: threads of kernels do not survive a fork.  A process that is killed
takes its pool with it (`BrokenProcessPool`); what was being computed is computed again in a new
pool, and what was being computed at two deaths is computed alone, so that the guilty task is told
from those beside it: with three deaths it has failed.  A worker ends with the process that made it,
however that ends.
"""

from __future__ import annotations

import collections
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from regrid.errors import BadInput
from runs.engines.protocol import Task

SUSPECT, GUILTY = 2, 3  # deaths from which a task is computed alone, and given up


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
    """A pool of `workers` processes as an `Engine`; to be used in a `with` statement."""

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
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, kind, error, trace) -> None:
        """End the workers; where something went wrong, ask what they compute to stop first."""
        if self._pool is None:
            return
        if kind is not None:
            for child in set(multiprocessing.active_children()) - self._before:
                child.terminate()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def compute(self, task: Task, arguments: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As `Engine.compute`; a task whose process died GUILTY times gives a WorkerDied."""
        waiting = collections.deque(range(len(arguments)))
        deaths: collections.Counter[int] = collections.Counter()
        running: dict[Future, int] = {}
        while waiting or running:
            lost = self._submit(task, arguments, waiting, running, deaths)
            if running:
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    number, error = running[future], future.exception()
                    if isinstance(error, BrokenProcessPool):
                        lost = True
                        continue
                    del running[future]
                    yield number, future.result() if error is None else error
            if lost:
                yield from self._take_back(waiting, running, deaths)

    def _submit(self, task, arguments, waiting, running, deaths) -> bool:
        """Fill the pool: no more than it computes at once, suspects alone; True: it is broken."""
        while waiting and len(running) < self.workers:
            alone = deaths[waiting[0]] >= SUSPECT
            if running and (alone or any(deaths[n] >= SUSPECT for n in running.values())):
                return False
            if self._pool is None:
                self._pool = ProcessPoolExecutor(
                    self.workers, self._context, _begin_worker, (self._started,)
                )
            try:
                future = self._pool.submit(task, arguments[waiting[0]])
            except BrokenProcessPool:
                return True
            running[future] = waiting.popleft()
        return False

    def _take_back(self, waiting, running, deaths) -> Iterator[tuple[int, Any]]:
        """After a death: all that was running waits again, or has failed; the pool is given up."""
        if not self._started.is_set():
            raise BadInput(
                "the worker processes end before they begin; in a script, put what starts them "
                'under if __name__ == "__main__":'
            )
        wait(running)
        for future, number in list(running.items()):
            del running[future]
            error = future.exception()
            if not isinstance(error, BrokenProcessPool):  # it ended before the death
                yield number, future.result() if error is None else error
                continue
            deaths[number] += 1
            if deaths[number] >= GUILTY:
                yield number, WorkerDied(f"its process died {GUILTY} times (out of memory?)")
            elif deaths[number] >= SUSPECT:
                waiting.append(number)  # after those that are under no suspicion
            else:
                waiting.appendleft(number)
        if self._pool is not None:
            self._pool.shutdown(wait=True)
            self._pool = None
