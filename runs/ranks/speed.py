"""How much faster than one rank a step is on several, by the model of docs/scaling.md.

The costs in rank_costs.json are those that `benchmarks/bench_mpi.py` has fitted to one machine, its
cores to themselves (docs/results/mpi.json).  Another machine is slower or faster in all of them
more or less alike, which a ratio of two steps does not show.

The trap: messages are those within a machine; a network adds its latency and bandwidth.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from hydro.ranks.cutting import Shares
from hydro.ranks.messages import CELLS_DEEP, NODES_DEEP

COSTS = Path(__file__).with_name("rank_costs.json")
FACE_BYTES = 8 * (2 * NODES_DEEP + 5 * CELLS_DEEP)  # that a face of a side stands for in a step


@functools.cache
def read_costs() -> Mapping[str, float]:
    """Seconds of a cell, a node's iteration, a face, a message, ...: letters in docs/scaling.md.

    `iterations` and `messages` are numbers: of a node and of a step.
    """
    return json.loads(COSTS.read_text("utf-8"))


def foretell_speed(cells: Sequence[tuple[int, int]], shares: Shares, ranks: int) -> float:
    """The time of a step on one rank over that on `ranks`, of blocks with these cells (ni, nj).

    A cut block is regridded by its home alone; what goes between its bands is left out.
    """
    cost = read_costs()
    faces = sum(2 * (ni + nj) for ni, nj in cells)
    alike = cost["face"] * faces + cost["block"] * len(cells) + cost["step"] + cost["record"]
    own = [0.0] * ranks
    for (ni, nj), there, bounds in zip(cells, shares.places, shares.bounds, strict=True):
        nodes = (ni + 1) * (nj + 1)
        own[there[0]] += cost["iteration"] * cost["iterations"] * nodes
        for rank, first, last in zip(there, bounds, bounds[1:], strict=False):
            own[rank] += cost["own_block"] + cost["cell"] * (last - first) * nj
    whole = len(cells) * cost["own_block"] + sum(
        cost["iteration"] * cost["iterations"] * (ni + 1) * (nj + 1) + cost["cell"] * ni * nj
        for ni, nj in cells
    )
    messages = cost["message"] * cost["messages"] + cost["byte"] * FACE_BYTES * faces
    return (whole + alike) / (max(own) + alike + (messages if ranks > 1 else 0.0))
