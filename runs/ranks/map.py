"""Which rank computes which blocks, in words: before a run and in its log."""

from __future__ import annotations

from collections.abc import Sequence

from hydro.ranks.packing import assign_blocks, sum_loads
from problems.size import estimate_memory

MOST_NAMED = 8  # ranks that are told one by one


def describe_map(blocks: Sequence[tuple[str, int]], ranks: int) -> list[str]:
    """Lines on how `ranks` ranks share blocks, given as names and cells: who has which, memory of
    each, how much faster than one.

    The first rank has all blocks in its memory, for the files.  The speed-up is that of the cells
    alone, with nothing else to do and nobody to wait for: no run is faster.
    """
    costs = [float(cells) for _, cells in blocks]
    places = assign_blocks(costs, ranks)
    loads, total = sum_loads(costs, places, ranks), sum(costs)
    lines = []
    for rank in range(min(ranks, MOST_NAMED)):
        names = [name for (name, _), there in zip(blocks, places, strict=True) if rank in there]
        memory = estimate_memory(int(total if rank == 0 else loads[rank])) / 1e6
        words = ", ".join(names) or "nothing"
        lines.append(f"rank {rank}: {words}; {loads[rank]:.0f} cells, about {memory:.0f} MB")
    if ranks > MOST_NAMED:
        lines.append(f"and {ranks - MOST_NAMED} more ranks")
    lines.append(f"at most {total / max(loads):.3g} times as fast as one rank{_advise(loads)}")
    return lines


def _advise(loads: Sequence[float]) -> str:
    idle = sum(load == 0.0 for load in loads)
    if idle:
        return f"; {idle} of {len(loads)} ranks would have nothing to do: a block has one rank"
    return ""


def describe_places(names: Sequence[str], places: Sequence[tuple[int, ...]], ranks: int) -> str:
    """One line for run.log."""
    shares = [
        f"{rank}: {', '.join(n for n, p in zip(names, places, strict=True) if rank in p) or '-'}"
        for rank in range(ranks)
    ]
    return f"shared by {ranks} ranks of MPI; blocks of rank {'; '.join(shares)}"
