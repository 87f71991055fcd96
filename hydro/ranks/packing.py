"""Which rank computes which block: the largest first, each to the rank that has the least so far.

Any map gives the same bits; a good one gives every rank as much to do.
"""

from __future__ import annotations

from collections.abc import Sequence


def assign_blocks(costs: Sequence[float], ranks: int) -> list[tuple[int, ...]]:
    """The ranks of each block, its owner first, for blocks of these costs (cells, say).

    A block has one rank here: its owner, who computes all of its inside.  Blocks of the same cost
    go in their order, ranks with the same load likewise.  Raises ValueError for fewer than one
    rank.
    """
    if ranks < 1:
        raise ValueError(f"{ranks} ranks; one at least is needed")
    loads = [0.0] * ranks
    owners: list[tuple[int, ...]] = [(0,)] * len(costs)
    for number in sorted(range(len(costs)), key=lambda n: (-costs[n], n)):
        rank = min(range(ranks), key=lambda r: (loads[r], r))
        loads[rank] += costs[number]
        owners[number] = (rank,)
    return owners


def sum_loads(costs: Sequence[float], places: Sequence[tuple[int, ...]], ranks: int) -> list[float]:
    """What each rank has to do: the sum of the costs of its blocks, shared where they have more."""
    loads = [0.0] * ranks
    for cost, there in zip(costs, places, strict=True):
        for rank in there:
            loads[rank] += cost / len(there)
    return loads
