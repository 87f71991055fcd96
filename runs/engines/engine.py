"""One way to have many tasks computed, whatever computes them: `open_engine`.

A task is a function of a module, its arguments are pickled: the same function must be importable
where it is computed.  Results come as they are ready, each with the number of its task; a task that
raises gives its exception in place of a result, so that one failure does not end the others.

The trap: with MPI every rank runs the whole program.  All but the first get None from
`open_engine`, after the others' work is done, and have nothing to do themselves.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

from hydro.workers import count_processors
from regrid.errors import BadInput
from runs.engines.protocol import Engine, Task

ENGINES = ("processes", "mpi", "dask://ADDRESS")


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
def open_engine(name: str = "processes", jobs: int | None = None) -> Iterator[Engine | None]:
    """The engine `name`, one of ENGINES, with `jobs` workers (None: one a processor).

    None on the ranks of MPI that only compute.  BadInput for an unknown name, for `jobs` where the
    engine brings its own workers, and where a package or a scheduler is missing.
    """
    kind, _, address = name.partition("://")
    if kind == "processes" and not address:
        from runs.engines.processes import Processes

        jobs = jobs or count_processors()
        if jobs == 1:
            yield InTurn()
            return
        with Processes(jobs) as processes:
            yield processes
        return
    if name != "mpi" and not (kind == "dask" and address):
        raise BadInput(f"--engine {name!r}: there are {', '.join(ENGINES)}")
    if jobs is not None:
        raise BadInput(f"--jobs goes with --engine processes; {name} brings its own workers")
    from runs.engines.clusters import open_dask, open_mpi

    with open_mpi() if name == "mpi" else open_dask(address) as engine:
        yield engine
