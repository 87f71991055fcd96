"""Grids and schemes of `convection-1d`, the families of `moving-grid-1d`, each at three sizes.

python benchmarks/convection_1d_tables.py [--picture FILE] [--json docs/results/convection-1d.json]
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from result_tables import Tables

from shockgrid.hydro.convection import columns
from shockgrid.hydro.convection.fronts import FAMILIES
from shockgrid.hydro.convection.tensor_grids import KINDS, compute_grid_reynolds, make_axis
from shockgrid.problems.convection.convection_1d import Convection1D, measure_errors
from shockgrid.problems.convection.moving_grid_1d import WORDS
from shockgrid.runs.deck.reading import read_deck

SIZES = (1, 2, 4)  # times the deck's cells
PARTS = (4, 2, 1)  # of the deck's cells
GRIDS = {kind: (kind, {}) for kind in KINDS}  # name -> kind and what differs from the deck's grid
GRIDS["combined, 1/4"] = ("combined", {"share": 0.25})


def settle_grid(problem: Convection1D, name: str, cells: int) -> tuple[np.ndarray, dict]:
    """Axis and errors of the grid `name` of GRIDS with so many cells, settled; `reynolds` is
    the largest grid Reynolds number of its steps, through-flow included."""
    grid = problem.deck.grid
    kind, change = GRIDS[name]
    column = problem.make_column()
    first = make_axis(kind, cells, walls=grid.walls, clustering=grid.clustering)
    x, *found = columns.settle_column(column, kind, first, **{**grid.options(), **change})[:3]
    speed = np.hypot(columns.to_nodes(x, found[1], (0.0, 0.0)), column.through_flow)
    reynolds = float(compute_grid_reynolds(x, speed, column.viscosity).max())
    return x, measure_errors(problem.exact, x, *found) | {"reynolds": reynolds}


def add_grids(tables: Tables, deck: str) -> None:
    problem = read_deck(deck, ()).make_problem()
    counts = [size * problem.deck.cells for size in SIZES]
    for name in GRIDS:
        axes, found = zip(*(settle_grid(problem, name, count) for count in counts), strict=True)
        errors = [row["error_v"] for row in found]
        last = found[-1]
        row = {f"error of v, {n} cells": f"{e:.2e}" for n, e in zip(counts, errors, strict=True)}
        row["order"] = f"{math.log2(errors[-2] / errors[-1]):.2f}"
        row |= {"of T there": f"{last['error_T']:.1e}", "most grid Re": f"{last['reynolds']:.3g}"}
        row["shortest step"] = f"{np.diff(axes[-1]).min():.2e}"
        tables.add(f"grids of {deck}", **{"grid, settled": name}, **row)


def add_schemes(tables: Tables, deck: str) -> None:
    problem = read_deck(deck, ()).make_problem()
    for scheme in columns.SCHEMES:
        x = make_axis("uniform", problem.deck.cells)
        solution = columns.solve_column(problem.make_column(scheme), x)[:2]
        found = measure_errors(problem.exact, x, *solution)
        row = {"error of T": f"{found['error_T']:.1e}", "of v": f"{found['error_v']:.1e}"}
        turns = {f"turns too many of {q}": f"{found[f'swings_{q}']:.0f}" for q in "Tv"}
        tables.add(f"schemes of {deck}", scheme=scheme, **row, **turns)


def add_families(tables: Tables, deck: str) -> None:
    problem = read_deck(deck, ()).make_problem()
    counts = [problem.deck.cells // part for part in PARTS]
    errors = {}
    seconds = dict.fromkeys(FAMILIES, 0.0)
    for count in counts:
        race = problem.make_race(count)
        steps = 0
        while race.finished is None:
            row = race.advance()
            steps = steps + 1
            if count == counts[-1]:
                seconds = {name: seconds[name] + row[f"seconds_{name}"] for name in FAMILIES}
        errors[count] = race.measure_errors()
    for family in FAMILIES:
        found = [errors[count][f"error_{family}"] for count in counts]
        row = {f"{n} cells": f"{e:.2e}" for n, e in zip(counts, found, strict=True)}
        row["order"] = f"{math.log2(found[-2] / found[-1]):.2f}"
        row["CPU ms/step"] = f"{1e3 * seconds[family] / steps:.2f}"
        tables.add(f"families of {deck}", **{"mean error of u": WORDS[family]}, **row)


def draw_grids(path: str) -> None:
    """Steps of all kinds of grid, settled, and how their error of v falls with the cells."""
    from shockgrid.runs.pictures.command import new_figure

    problem = read_deck("convection-1d", ()).make_problem()
    cells = problem.deck.cells
    figure = new_figure()
    figure.set_size_inches(9.0, 4.2)
    steps, errors = figure.subplots(1, 2)
    counts = np.array([max(3, int(size * cells)) for size in (0.5, *SIZES)])
    for name in GRIDS:
        axes, found = zip(*(settle_grid(problem, name, int(n)) for n in counts), strict=True)
        x = axes[1]
        found = [row["error_v"] for row in found]
        steps.plot(0.5 * (x[1:] + x[:-1]), np.diff(x), ".-", ms=3, lw=0.7, label=name)
        errors.loglog(counts, found, "o-", ms=3, lw=0.9, label=name)
    for order, style in ((1, ":"), (2, "--")):
        base = found[0] * (counts[0] / counts) ** order
        errors.loglog(counts, base, style, color="0.5", lw=0.8, label=f"order {order}")
    steps.set_yscale("log")
    steps.set_xlabel("x [m]")
    steps.set_title(f"steps of {cells} cells [m]", fontsize="medium")
    errors.set_xticks(counts, [str(count) for count in counts])
    errors.xaxis.set_minor_formatter("")
    errors.set_xlabel("cells")
    errors.set_title("largest error of v over its largest", fontsize="medium")
    errors.legend(fontsize="x-small")
    figure.savefig(path, dpi=140)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--picture", metavar="FILE", help="draw the grids of convection-1d, too")
    tables = Tables(parser)
    for deck in ("convection-1d", "convection-1d-layer"):
        add_grids(tables, deck)
    add_schemes(tables, "convection-1d-layer")
    for deck in ("moving-grid-1d", "moving-grid-1d-front", "moving-grid-1d-start"):
        add_families(tables, deck)
    if tables.options.picture:
        draw_grids(tables.options.picture)
    tables.write()


if __name__ == "__main__":
    main()
