"""The model at ranks that no machine here has: named cases, and where more ranks stop to gain.

STRONG: so many cells in eight square blocks, which are cut in strips where there are more ranks.
WEAK: a square block of so many cells on every rank.  Each is computed twice: as the ranks work now,
all perimeters on every rank, and as if a rank had those of its own blocks and their neighbours
alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.mpi_scaling.cases import Timing
from benchmarks.mpi_scaling.model import (
    LEAST_GAIN,
    Costs,
    Load,
    Network,
    find_crossover,
    keep_neighbours,
    load_strong,
    load_weak,
    predict,
)

STRONG_CELLS = 10_000_000
STRONG_BLOCKS = 8
WEAK_CELLS = 10_000
MOST_RANKS = 1000
SHOWN = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)
NEIGHBOURS = ", own and neighbours' perimeters"


def project(costs: Costs, mushroom: Timing, two: Timing) -> dict[str, Any]:
    """Rows of both cases at `SHOWN` ranks, crossovers, and the numbers that are assumed.

    mushroom: the run whose iterations of the regridder are taken; two: one whose messages are.
    """
    network = Network()
    steps = mushroom.steps
    iterations = float(np.mean(steps["node_iterations"]) / np.mean(steps["nodes"]))
    calls = two.counts["calls"]

    def strong(ranks: int) -> Load:
        return load_strong(ranks, STRONG_CELLS, STRONG_BLOCKS, iterations, calls)

    def weak(ranks: int) -> Load:
        return load_weak(ranks, WEAK_CELLS, iterations, calls)

    def time(load: Load) -> float:
        return sum(predict(costs, load, network).values())

    cases = {
        "strong": (strong, True),
        f"strong{NEIGHBOURS}": (lambda ranks: keep_neighbours(strong(ranks)), True),
        "weak": (weak, False),
        f"weak{NEIGHBOURS}": (lambda ranks: keep_neighbours(weak(ranks)), False),
    }
    found: dict[str, Any] = {}
    for name, (make, is_strong) in cases.items():
        first = time(make(1))

        def gain(ranks: int, make=make, is_strong=is_strong, first=first) -> float:
            return first / time(make(ranks)) / (ranks if is_strong else 1.0)

        found[name] = {
            "rows": [
                {
                    "ranks": ranks,
                    **predict(costs, make(ranks), network),
                    "step": time(make(ranks)),
                    "efficiency": gain(ranks),
                }
                for ranks in SHOWN
            ],
            "crossover": find_crossover(gain, MOST_RANKS),
        }
    assumed = {
        "latency": network.latency,
        "bandwidth": network.bandwidth,
        "messages per step": calls,
        "iterations per node and step": iterations,
        "strong cells": STRONG_CELLS,
        "strong blocks": STRONG_BLOCKS,
        "weak cells per rank": WEAK_CELLS,
        "least efficiency": LEAST_GAIN,
    }
    return {"cases": found, "assumed": assumed}
