"""CPU seconds of convection: to a steady state from rest, and a step in time.

python benchmarks/bench_convection.py [--rounds 3]

One core (set OMP_NUM_THREADS=1 to be sure).  Steady: the heated cavity from rest to a change of
1e-10 of itself, all stages of buoyancy included.  In time: a step on a grid at rest and one on
a grid that moves in every step.
"""

from __future__ import annotations

import argparse
import time

from result_tables import Tables

from shockgrid.problems.convection.heated_cavity import AxisGrid, HeatedCavity, HeatedCavityDeck
from shockgrid.problems.deck import RunControl

STEADY = ((1e6, 40), (1e6, 80), (1e7, 80), (1e6, 160))
STEPS = 20


def time_steady(rayleigh: float, cells: int) -> tuple[float, int]:
    """(CPU seconds, iterations) to the steady state."""
    begun = time.process_time()
    evolution = HeatedCavity(HeatedCavityDeck(rayleigh=rayleigh, cells=cells)).build()
    while evolution.finished is None:
        evolution.advance()
    return time.process_time() - begun, evolution.step


def time_step(kind: str, cells: int) -> float:
    """CPU seconds of a step in time."""
    grid = AxisGrid(kind=kind)
    deck = HeatedCavityDeck(method="time", cells=cells, grid=grid, run=RunControl(t_end=0.05))
    evolution = HeatedCavity(deck).build()
    for _ in range(5):
        evolution.advance()
    begun = time.process_time()
    for _ in range(STEPS):
        evolution.advance()
    return (time.process_time() - begun) / STEPS


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=3)
    tables = Tables(parser)
    rounds = tables.options.rounds
    for rayleigh, cells in STEADY:
        seconds, iterations = min(time_steady(rayleigh, cells) for _ in range(rounds))
        tables.add(
            "convection-steady",
            Ra=f"{rayleigh:.0e}",
            nodes=f"{cells + 1}²",
            iterations=iterations,
            **{"CPU s": seconds},
        )
    for kind, words in (("clustered", "at rest"), ("combined", "moving")):
        for cells in (40, 80):
            seconds = min(time_step(kind, cells) for _ in range(rounds))
            tables.add(
                "convection-step", grid=words, nodes=f"{cells + 1}²", **{"CPU ms": 1e3 * seconds}
            )
    tables.write()
