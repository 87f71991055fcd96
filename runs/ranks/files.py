"""Dumps that all ranks write together, each what it updates (`runs.store.parts`).

The first rank tells the others that there is a dump, and where; then all do the same.  A rank whose
disk fails tells the others, and the first rank ends the run with its sentence.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hydro.ranks.ranks import Ranks, tell
from hydro.simulation import Simulation
from problems.deck import Output
from problems.evolution import State
from regrid.errors import BadInput
from runs.ranks.world import BEGIN, World
from runs.store.parts import Moment, Share, write_dump_in_parts, write_light_dump_in_parts

WRITE = BEGIN + 1  # told; where to, and the words of the dump, follow


def make_share(comm: Any, ranks: Ranks) -> Share:
    """The rows of blocks that this rank of an mpi4py communicator updates."""
    rows = {ranks[number].name: (first, last) for number, first, last in ranks.pieces}
    return Share(ranks.rank, ranks.size, rows, comm.allgather)


def write_on_ranks(
    world: World,
    path: Path,
    evolution: Any,
    names: tuple[str, str, str],
    besides: State,
    output: Output | None = None,
) -> Moment:
    """Write a dump with all ranks; what its index tells.  For the first rank, between two steps.

    names: problem, text of the deck, unit of time; besides: see `write_dump_in_parts`; output: says
    what is in a light dump, None for a whole one.  Raises BadInput where a disk has refused it.
    """
    ranks = world.ranks
    if ranks is None:
        raise ValueError("the ranks have not begun")
    tell(world.comm, WRITE)
    world.comm.bcast((str(path.absolute()), names, output), root=0)
    with _busy(ranks):
        moment = _write(world.comm, ranks, path, evolution, names, besides, output)
    if moment is None:
        raise ValueError("this is not the first rank")
    return moment


def follow_in_writing(comm: Any, evolution: Simulation, ranks: Ranks) -> None:
    """The part of another rank, when it has heard WRITE."""
    path, names, output = comm.bcast(None, root=0)
    with _busy(ranks), contextlib.suppress(BadInput):  # the first rank tells it
        _write(comm, ranks, Path(path), evolution, names, {}, output)


def _write(
    comm: Any,
    ranks: Ranks,
    path: Path,
    evolution: Any,
    names: tuple[str, str, str],
    besides: State,
    output: Output | None,
) -> Moment | None:
    share = make_share(comm, ranks)
    if output is not None:
        return write_light_dump_in_parts(path, evolution, *names, output, share)
    return write_dump_in_parts(path, evolution, *names, besides, share)


@contextlib.contextmanager
def _busy(ranks: Ranks) -> Iterator[None]:
    """Until they have agreed that it has been written or has failed, all ranks are at it."""
    ranks.busy = True
    try:
        yield
    except BadInput:
        ranks.busy = False
        raise
    ranks.busy = False
