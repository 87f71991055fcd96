"""Corners against the first line: what the option `corner_weight` of the barrier changes.

Two marches of sheared blocks: the gap between two bodies that pass one another, and the ring round
a gear that turns by one tooth; side nodes move with the bodies.  Sines and gaps are those of each
step's grid: the smallest corner sine, and the largest distance of the first line over that of
straight lines (theory R1.6).

    python tests/oracles/corners.py [--weights 1,3,10,30,100,300] [--steps 80]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.measure.quality import compute_scaled_jacobians, measure_first_line_gap

PASSING_CELLS = 48, 24
GEAR_CELLS = 96, 16
TEETH = 8


def make_passing(part: float) -> np.ndarray:
    """Two bodies on opposite walls of a channel go from x = 0.6 to 1.4 and back, at `part`."""
    along, across = (np.linspace(0.0, 1.0, count + 1) for count in PASSING_CELLS)
    lines = []
    for wall, start, end in ((0.0, 0.6, 1.4), (1.0, 1.4, 0.6)):
        centre = start + part * (end - start)
        x = np.interp(2.0 * along, [0.0, start - 0.25, start + 0.25, 2.0],
                      [0.0, centre - 0.25, centre + 0.25, 2.0])  # fmt: skip
        height = 0.45 * np.exp(-np.log(2.0) * ((x - centre) / 0.15) ** 4)
        lines.append(np.array((x, abs(wall - height))))
    low, high = (line[:, :, None] for line in lines)
    return low + across * (high - low)


def make_gear(part: float) -> np.ndarray:
    """A ring round a gear of eight teeth that has turned by `part` of a tooth; it is closed."""
    angle = -2.0 * np.pi * np.linspace(0.0, 1.0, GEAR_CELLS[0] + 1)
    across = np.linspace(0.0, 1.0, GEAR_CELLS[1] + 1)
    radius = 0.5 * (1.0 - 0.25 * np.tanh(3.0 * np.sin(TEETH * angle)))
    turned = angle - 2.0 * np.pi * part / TEETH
    inner = np.array((radius * np.cos(turned), radius * np.sin(turned)))[:, :, None]
    outer = np.array((np.cos(angle), np.sin(angle)))[:, :, None]
    ring = inner + across * (outer - inner)
    ring[:, -1] = ring[:, 0]
    return ring


SHAPES = {"two bodies passing": make_passing, "gear": make_gear}


def march(make, steps: int, weight: float) -> dict[str, float]:
    """Figures of a march of `make` (part) in equal steps."""
    regridder = BarrierRegridder(corner_weight=weight)
    nodes = make(0.0)
    sines = []
    gaps = []
    iterations = 0
    for step in range(1, steps + 1):
        found = regridder.regrid(nodes, make(step / steps))
        nodes = found.nodes
        iterations += found.report.iterations
        sines.append(compute_scaled_jacobians(nodes).min())
        gaps.append(max(measure_first_line_gap(nodes, side) for side in ("j_min", "j_max")))
    return {
        "corner sine, mean": float(np.exp(np.log(sines).mean())),
        "corner sine, smallest": float(min(sines)),
        "first line gap, mean": float(np.mean(gaps)),
        "first line gap, largest": float(max(gaps)),
        "iterations a step": iterations / steps,
    }


def main() -> None:
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    from benchmarks.result_tables import Tables

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weights", default="1,3,10,30,100,300")
    parser.add_argument("--steps", type=int, default=80)
    tables = Tables(parser)
    for name, make in SHAPES.items():
        for weight in map(float, tables.options.weights.split(",")):
            figures = march(make, tables.options.steps, weight)
            tables.add("corners", march=name, corner_weight=f"{weight:g}", **figures)
    tables.write()


if __name__ == "__main__":
    main()
