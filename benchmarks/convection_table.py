"""Errors of the heated cavity against the spectral reference: by size, and by grid.

python benchmarks/convection_table.py sizes [--grid clustered] [--cells 40 80 160]
python benchmarks/convection_table.py grids [--cells 40]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from result_tables import Tables

from shockgrid.problems.convection.heated_cavity import AxisGrid, HeatedCavity, HeatedCavityDeck
from shockgrid.problems.references.convection import STATES
from shockgrid.regrid.errors import RunFailure

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


def add_sizes(tables: Tables, name: str, sizes: list[int]) -> None:
    """The reference at several sizes: errors in per cent, observed orders, Richardson's limit."""
    for rayleigh, reference in STATES.items():
        runs = [solve(rayleigh, cells, GRIDS[name])[0] for cells in sizes]
        for quantity in QUANTITIES:
            exact = getattr(reference, quantity)
            values = np.array([run[quantity] for run in runs])
            errors = values / exact - 1.0
            orders = np.log2(np.abs(errors[:-1] / errors[1:]))
            row = {f"{n + 1}², %": 100.0 * float(e) for n, e in zip(sizes, errors, strict=True)}
            if len(values) > 1:
                ratio = (sizes[-1] / sizes[-2]) ** 2
                limit = values[-1] + (values[-1] - values[-2]) / (ratio - 1.0)
                row["order"] = ", ".join(f"{order:.2f}" for order in orders)
                row["extrapolated"] = f"{limit:.5f}"
                row["error, %"] = 100.0 * float(limit / exact - 1.0)
            if quantity in PLACES:
                place = PLACES[quantity]
                row["at (reference)"] = f"{runs[-1][place]:.5f} ({getattr(reference, place):.5f})"
            else:
                row["at (reference)"] = ""
            tables.add("convection-sizes", Ra=f"{rayleigh:.0e}", quantity=quantity, **row)


def add_grids(tables: Tables, cells: int) -> None:
    """Errors in per cent of every grid at every Rayleigh number."""
    for rayleigh, reference in STATES.items():
        for name, grid in GRIDS.items():
            try:
                found, seconds, iterations = solve(rayleigh, cells, grid)
            except RunFailure as failure:
                print(f"Ra {rayleigh:.0e}, {name}: {failure}")
                continue
            errors = {
                f"{quantity}, %": 100.0 * (found[quantity] / getattr(reference, quantity) - 1.0)
                for quantity in QUANTITIES
            }
            row = {"nodes": f"{cells + 1}²", **errors, "wall step": found["wall"]}
            row |= {"iterations": iterations, "CPU s": seconds}
            tables.add("convection-grids", Ra=f"{rayleigh:.0e}", grid=name, **row)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("sizes", "grids"))
    parser.add_argument("--grid", choices=tuple(GRIDS), default="clustered 2")
    parser.add_argument("--cells", type=int, nargs="+", default=None)
    tables = Tables(parser)
    options = tables.options
    if options.what == "sizes":
        add_sizes(tables, options.grid, options.cells or [40, 80, 160])
    else:
        for size in options.cells or [40]:
            add_grids(tables, size)
    tables.write()


if __name__ == "__main__":
    main()
