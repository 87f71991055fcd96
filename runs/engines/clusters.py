"""Workers on other machines: ranks of MPI, workers of a dask scheduler.

Both give an executor of `concurrent.futures`.  They see the same files under the same paths: the
study's folder lies on a file system that all of them have.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, as_completed
from typing import Any, cast

from regrid.errors import BadInput
from runs.engines.protocol import Task

ANSWER = 20.0  # seconds for a scheduler to answer


class Cluster:
    """An executor as an `Engine`: all tasks are handed over at once."""

    def __init__(self, executor: Executor, workers: int):
        self.executor, self.workers = executor, workers

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


@contextlib.contextmanager
def open_dask(address: str) -> Iterator[Cluster]:
    """The workers of the dask scheduler at `address` ("127.0.0.1:8786").

    A task whose worker dies is given to another.  BadInput where dask is missing, nothing answers,
    or a worker computes several tasks in one process, which kernels do not allow.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise BadInput(
            f"--engine dask:// needs dask: pip install 'shockgrid[dask]' ({error})"
        ) from error
    try:
        client = Client(address, timeout=ANSWER)
    except (OSError, ValueError) as error:  # TimeoutError is an OSError
        raise BadInput(f"--engine dask://{address}: no scheduler answers there") from error
    with client:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            raise BadInput(f"--engine dask://{address}: this scheduler has no workers")
        if any(worker["nthreads"] > 1 for worker in workers.values()):
            raise BadInput(
                f"--engine dask://{address}: start the workers with --nthreads 1 "
                "(--nworkers N for more of them)"
            )
        with client.get_executor() as executor:
            yield Cluster(executor, len(workers))
