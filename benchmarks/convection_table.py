"""Errors of the heated cavity against the spectral reference: by size, and by grid.

python benchmarks/convection_table.py sizes [--grid clustered] [--cells 40 80 160]
python benchmarks/convection_table.py grids [--cells 40]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from problems.convection.axis_grid import AxisGrid
from problems.convection.heated_cavity import HeatedCavity, HeatedCavityDeck
from problems.references.cavity import STATES
from regrid.errors import RunFailure

QUANTITIES = ("nusselt", "u_max", "v_max", "nusselt_max")
PLACES = {"u_max": "u_max_y", "v_max": "v_max_x", "nusselt_max": "nusselt_max_y"}
# the number: strength of the clustering, or the bound on neighbouring steps
GRIDS = {
    "uniform": AxisGrid(),
    "clustered 1.5": AxisGrid(kind="clustered", clustering=1.5),
    "clustered 2": AxisGrid(kind="clustered"),
    "clustered 2.5": AxisGrid(kind="clustered", clustering=2.5),
    "polevikov": AxisGrid(kind="polevikov", every=2),
    "polevikov, 1.2": AxisGrid(kind="polevikov", every=2, ratio=1.2),
    "monitor": AxisGrid(kind="monitor", every=2),
    "monitor, 1.2": AxisGrid(kind="monitor", every=2, ratio=1.2),
    "combined": AxisGrid(kind="combined", every=2),
    "combined, 1.2": AxisGrid(kind="combined", every=2, share=0.25, ratio=1.2),
}


def solve(rayleigh: float, cells: int, grid: AxisGrid) -> tuple[dict[str, float], float, int]:
    """(measurements, CPU seconds, iterations) of one steady state."""
    problem = HeatedCavity(HeatedCavityDeck(rayleigh=rayleigh, cells=cells, grid=grid))
    begun = time.process_time()
    evolution = problem.build()
    while evolution.finished is None:
        evolution.advance()
    seconds = time.process_time() - begun
    if evolution.finished != "steady":
        raise RunFailure(evolution.finished)
    found = problem.measure(evolution)
    found["least"] = float(min(axis.widths.min() for axis in evolution.equations.axes))
    found["wall"] = float(evolution.equations.axes[0].widths[0])
    return found, seconds, evolution.step


def print_sizes(name: str, sizes: list[int]) -> None:
    """The table of the reference at several sizes, errors in per cent, observed orders."""
    print(f"grid {name}; errors in per cent, order between sizes, extrapolated from the last two")
    for rayleigh, reference in STATES.items():
        runs = [solve(rayleigh, cells, GRIDS[name])[0] for cells in sizes]
        for quantity in QUANTITIES:
            exact = getattr(reference, quantity)
            values = np.array([run[quantity] for run in runs])
            errors = values / exact - 1.0
            line = f"{rayleigh:6.0e} {quantity:12}" + "".join(f"{v:11.5f}" for v in values)
            line += " |" + "".join(f"{100 * e:+9.4f}" for e in errors) + " |"
            ratios = np.log2(np.abs(errors[:-1] / errors[1:]))
            line += "".join(f"{r:6.2f}" for r in ratios)
            if len(values) > 1:
                ratio = (sizes[-1] / sizes[-2]) ** 2
                limit = values[-1] + (values[-1] - values[-2]) / (ratio - 1.0)
                line += f" | {limit:.5f} {100 * (limit / exact - 1.0):+.4f} %"
            if quantity in PLACES:
                place = PLACES[quantity]
                line += f" | at {runs[-1][place]:.5f} ({getattr(reference, place):.5f})"
            print(line, flush=True)


def print_grids(cells: int) -> None:
    """Errors in per cent of every grid at every Rayleigh number."""
    print(f"{cells} x {cells} cells; errors in per cent")
    for rayleigh, reference in STATES.items():
        print(f"Ra {rayleigh:.0e}         Nu     u max    v max   Nu max   wall step  its  CPU s")
        for name, grid in GRIDS.items():
            try:
                found, seconds, iterations = solve(rayleigh, cells, grid)
            except RunFailure as failure:
                print(f"  {name:16} {failure}")
                continue
            errors = [100 * (found[q] / getattr(reference, q) - 1.0) for q in QUANTITIES]
            line = f"  {name:16}" + "".join(f"{error:+9.3f}" for error in errors)
            print(f"{line} {found['wall']:9.4f} {iterations:5d} {seconds:6.2f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("sizes", "grids"))
    parser.add_argument("--grid", choices=tuple(GRIDS), default="clustered 2")
    parser.add_argument("--cells", type=int, nargs="+", default=None)
    options = parser.parse_args()
    if options.what == "sizes":
        print_sizes(options.grid, options.cells or [40, 80, 160])
    else:
        for size in options.cells or [40]:
            print_grids(size)
