"""The mushroom's line on finer grids, or smoothed less: how far apart, how long, how much it turns.

    python benchmarks/line_convergence.py --cells 64 128 256 --kct 14.7
    python benchmarks/line_convergence.py --cells 128 --thickness 0.04 0.02 0.01 0.005
    python benchmarks/line_convergence.py --runs out/64 out/128     # runs made before, their ends

Grids are compared at one thickness; without a smallest scale there is nothing to converge to.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import shockgrid as sg
from shockgrid.regrid.measure.quality import measure_turns

POINTS = 50_001  # on the curve through the nodes


def draw_curve(nodes: np.ndarray) -> np.ndarray:
    """Points (POINTS, 2) of the spline through nodes (2, n), even along it."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(nodes, axis=1)))))
    return CubicSpline(along, nodes.T)(np.linspace(0.0, along[-1], POINTS))


def measure_distance(one: np.ndarray, other: np.ndarray) -> float:
    """Largest distance of a point of either curve from the other curve [m]."""
    there = cKDTree(one).query(other[::10])[0].max()
    return float(max(there, cKDTree(other).query(one[::10])[0].max()))


def main() -> None:
    """Print one row a grid."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cells", type=int, nargs="+", default=[32, 64, 128])
    parser.add_argument("--thickness", type=float, nargs="+", default=[0.02])
    parser.add_argument("--kct", type=float, default=14.7)
    parser.add_argument("--runs", nargs="*", default=[])
    options = parser.parse_args()
    columns = "run", "half the extent", "length over width", "turn in all [deg]"
    print(" | ".join((*columns, "from the one before [m]", "ratio")))
    before = None
    last = None
    with tempfile.TemporaryDirectory() as place:
        runs: list[tuple[str, Callable[[], Any]]] = [
            (run, partial(sg.open, run)) for run in options.runs
        ]
        for cells, thickness in () if runs else product(options.cells, options.thickness):
            deck = {"cells": cells, "kct_end": options.kct, "line": {"thickness": thickness}}
            home = f"{place}/{cells}-{thickness}"
            call = partial(sg.run, "interface-instability-mushroom", home, **deck)
            runs.append((f"{cells} cells, thickness {thickness:g}", call))
        for name, get in runs:
            line = get().interface()
            nodes = np.stack((line.x, line.y))
            curve = draw_curve(nodes)
            length = np.hypot(*np.diff(curve, axis=0).T).sum()
            turn = np.degrees(np.abs(measure_turns(nodes)).sum())
            row = f"{name} | {0.5 * np.ptp(line.x):.4f} | {length / np.ptp(curve[:, 1]):.4f}"
            row += f" | {turn:.0f}"
            if before is not None:
                distance = measure_distance(before, curve)
                row += f" | {distance:.5f}" + (f" | {last / distance:.2f}" if last else "")
                last = distance
            print(row, flush=True)
            before = curve


if __name__ == "__main__":
    main()
