"""A viscous front on nodes placed after the step, by a speed equation, or before the fluxes.

Burgers' equation with fronts that run, and merge, between falling `levels`; the exact solution is
known.  Four columns with the same number of cells solve it side by side in equal steps:

- fixed: nodes at rest, evenly spaced;
- after: nodes placed after each step; their speed in the fluxes is that of the step before;
- law: an equation for the node speed, integrated together with the flow;
- first: nodes placed first, and the fluxes of the same step use their motion (as in the flow
  solver).

The summary lists error, order, lost sum and cost of the four at three sizes.  Note: `after` shifts
the front, its profile stays smooth, and a single front at one speed hides the lag (nothing
accelerates); orders of grids with bounded neighbours look low because the bound helps the coarse
ones most (`grid.ratio = 1000` shows the second order).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Literal

import msgspec
import numpy as np

from hydro.convection.columns import FAMILIES, HEIGHT, FrontRace, Placing
from problems.deck import Deck, DeckTable, RunControl, key
from problems.problem import BlockPlan, Problem, Report
from problems.references.convection import BurgersFronts
from regrid.errors import BadInput

WORDS = {
    "fixed": "nodes at rest",
    "after": "placed after the step",
    "law": "by a speed law",
    "first": "placed first",
}
PARTS = (4, 2)  # of the deck's cells, run again for the summary


def march(problem, cells: int) -> dict[str, dict[str, float]]:
    """Error, lost part of the sum and CPU seconds of each family after a whole run."""
    race = problem.make_race(cells)
    start = race.start_row()
    seconds = dict.fromkeys(FAMILIES, 0.0)
    while race.finished is None:
        row = race.advance()
        for family in FAMILIES:
            seconds[family] += row[f"seconds_{family}"]
    errors = race.measure_errors()
    return {
        family: {
            "error": errors[f"error_{family}"],
            "lost": find_loss(family, start, row),
            "seconds": seconds[family],
        }
        for family in FAMILIES
    }


def find_loss(family: str, start, end) -> float:
    """Change of the sum of u dx beyond what came in, over its largest size."""
    total, through = f"total_u_{family}", f"boundary_u_{family}"
    change = end[total] - start[total] - (end[through] - start[through])
    return abs(change) / max(abs(end[total]), abs(start[total]))


def make_summary(problem, history) -> str:
    """The table of the four families at a quarter, a half and all of the cells."""
    deck = problem.deck
    if history["t"][-1] < 0.999999 * (deck.run.t_end or 1.0):
        return "moving-grid-1d: the families are compared at the end time, which was not reached"
    rows = {name: np.asarray(values) for name, values in history.items()}
    start = {name: values[0] for name, values in rows.items() if values.dtype.kind == "f"}
    end = {name: values[-1] for name, values in rows.items() if values.dtype.kind == "f"}
    counts = sorted({max(16, deck.cells // part) for part in PARTS} - {deck.cells})
    coarse = [march(problem, count) for count in counts]
    counts.append(deck.cells)
    steps = int(rows["step"][-1])
    fronts = f"{len(deck.fronts)} front" + "s" * (len(deck.fronts) > 1)
    lines = [
        f"{fronts}, viscosity {deck.viscosity:g} m2/s, {steps} steps; mean |u - exact| on",
        f"  {'':22}"
        + "".join(f"{count:>10d}" for count in counts)
        + "   order  worst in time   sum lost   CPU ms/step",
    ]
    for family in FAMILIES:
        errors = [one[family]["error"] for one in coarse] + [end[f"error_{family}"]]
        order = math.nan
        if len(errors) > 1:
            order = math.log2(errors[-2] / errors[-1]) / math.log2(counts[-1] / counts[-2])
        seconds = float(np.nansum(rows[f"seconds_{family}"]))
        lines.append(
            f"  {WORDS[family]:22}"
            + "".join(f"{error:10.2e}" for error in errors)
            + f"{order:8.2f}{np.nanmax(rows[f'error_{family}']):15.2e}"
            + f"{find_loss(family, start, end):11.1e}{1e3 * seconds / max(1, steps):14.2f}"
        )
    return "\n".join(lines)


def draw_fronts(problem, figure, run_data) -> None:
    """u about the steepest front at the end, its error, and the ways of the nodes."""
    dump = run_data.dumps[-1]
    figure.set_size_inches(10.0, 7.0)
    grid = figure.add_gridspec(2, 6)
    profile, wrong = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3:])
    fine = np.linspace(0.0, 1.0, 4001)
    exact = problem.exact.compute_values(fine, dump.t)
    middle = fine[np.abs(np.diff(exact)).argmax()]
    half = max(20.0 * problem.deck.viscosity / np.ptp(exact), 2.0 / problem.deck.cells)
    shown = np.abs(fine - middle) < half
    profile.plot(fine[shown], exact[shown], color="0.5", lw=1.5, label="exact")
    for block, colour in zip(dump.blocks, ("0.3", "C3", "C1", "C0"), strict=True):
        x, u = block.nodes[0, :, 0], block.cell_fields["u"][:, 0]
        centres = 0.5 * (x[1:] + x[:-1])
        near = np.abs(centres - middle) < half
        style = {"ms": 4, "color": colour, "label": WORDS[block.name]}
        profile.plot(centres[near], u[near], ".", **style)
        error = np.abs(u - problem.exact.compute_cell_averages(x, dump.t))
        wrong.semilogy(centres, np.maximum(error, 1e-12), ".-", lw=0.5, **(style | {"ms": 2.5}))
    profile.set_title(f"u [m/s] about the front, t = {dump.t:.3g} s", fontsize="medium")
    profile.legend(fontsize="small")
    wrong.set_title("|u - exact| [m/s]", fontsize="medium")
    wrong.set_ylim(1e-9, 2.0)
    for axes in (profile, wrong):
        axes.set_xlabel("x [m]")
    for k, family in enumerate(FAMILIES[1:]):
        axes = figure.add_subplot(grid[1, 2 * k : 2 * k + 2])
        ways = np.array([one.block(family).nodes[0, :, 0] for one in run_data.dumps])
        times = [one.t for one in run_data.dumps]
        axes.plot(ways, times, color="0.2", lw=0.4)
        axes.set_title(f"ways of the nodes, {WORDS[family]}", fontsize="medium")
        axes.set_xlabel("x [m]")
    figure.axes[2].set_ylabel("t [s]")


def draw_errors(problem, figure, run_data) -> None:
    """Errors over time, and error against cost at several sizes."""
    figure.set_size_inches(9.0, 4.2)
    over_time, over_cost = figure.subplots(1, 2)
    history = run_data.history
    counts = sorted({max(16, int(part * problem.deck.cells)) for part in (0.125, 0.25, 0.5, 1)})
    runs = [march(problem, count) for count in counts]
    for family, colour in zip(FAMILIES, ("0.3", "C3", "C1", "C0"), strict=True):
        over_time.semilogy(
            history["t"], history[f"error_{family}"], color=colour, lw=1.0, label=WORDS[family]
        )
        over_cost.loglog(
            [one[family]["seconds"] for one in runs],
            [one[family]["error"] for one in runs],
            "o-",
            ms=3.5,
            lw=0.9,
            color=colour,
        )
    over_time.set_xlabel("t [s]")
    over_time.set_title(f"mean |u - exact|, {problem.deck.cells} cells", fontsize="medium")
    over_time.legend(fontsize="small")
    over_cost.xaxis.set_minor_formatter("")
    over_cost.set_xlabel("CPU seconds of the run")
    over_cost.set_title(
        f"mean |u - exact| at the end, {counts[0]} to {counts[-1]} cells", fontsize="medium"
    )


class PlacingPart(DeckTable, kw_only=True):
    """How the nodes of the moving columns are placed."""

    merges = True

    strength: key(float, "of the gradient: 2 gives two thirds of the nodes to it", ge=0) = 2.0
    ratio: key(float, "largest ratio of neighbouring steps; left out: the default", gt=1) | None = (
        None
    )
    relaxation: key(float, "fraction of a correction that is applied", gt=0, le=1) = 0.7
    tau: key(float, "relaxation time [s] of the node speed", gt=0) = 0.005
    start: key(
        Literal["moving", "rest"],
        "nodes placed after the step: their speed at t = 0 known, or none",
    ) = "moving"


class MovingGrid1DDeck(Deck, kw_only=True):
    """Deck of `moving-grid-1d`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=1.0, cfl=0.5))
    cells: key(int, "cells of each column", ge=16, le=10000) = 160
    viscosity: key(float, "viscosity [m2/s]; the column is 1 m", gt=0, le=10) = 5e-3
    levels: key(list[float], "falling values of u [m/s] before and after the fronts") = (
        msgspec.field(default_factory=lambda: [1.0, 0.5, 0.0])
    )
    fronts: key(list[float], "places [m] of the fronts between the levels at t = 0") = (
        msgspec.field(default_factory=lambda: [0.2, 0.5])
    )
    grid: PlacingPart = msgspec.field(default_factory=PlacingPart)


class MovingGrid1D(Problem):
    """Four columns, one front or more."""

    Deck = MovingGrid1DDeck
    units: Mapping[str, str] = {f"error_{family}": "m2/s" for family in FAMILIES}

    def __init__(self, deck: MovingGrid1DDeck):
        super().__init__(deck)
        if len(deck.levels) != len(deck.fronts) + 1 or len(deck.levels) < 2:
            raise BadInput(
                f"{len(deck.levels)} levels need {max(1, len(deck.levels) - 1)} fronts between "
                f"them, at least one, got {len(deck.fronts)}"
            )
        if not all(math.isfinite(u) for u in deck.levels) or any(
            ahead >= behind for behind, ahead in pairwise(deck.levels)
        ):
            raise BadInput(f"levels = {deck.levels}: from front to front u has to fall")
        positions = [0.0, *deck.fronts, 1.0]
        if not all(one < other for one, other in pairwise(positions)):
            raise BadInput(
                f"fronts = {deck.fronts}: positions must increase and lie between 0 and 1"
            )
        self.exact = BurgersFronts(deck.viscosity, tuple(deck.levels), tuple(deck.fronts))

    def make_race(self, cells: int) -> FrontRace:
        """The race with another number of cells, at the same part of the stable step."""
        deck = self.deck
        fastest = max(abs(u) for u in deck.levels)
        placing = Placing(
            strength=deck.grid.strength,
            ratio=deck.grid.ratio,
            relaxation=deck.grid.relaxation,
            tau=deck.grid.tau,
            start=deck.grid.start,
        )
        dt = deck.run.cfl / (cells * fastest)
        return FrontRace(self.exact, cells, dt, deck.run.t_end or 1.0, placing)

    def plan(self) -> tuple[float, list[BlockPlan]]:
        """End time and the four columns."""
        size = (self.deck.cells, 1)
        plans = [BlockPlan(name, size, (0.0, 0.0), (1.0, HEIGHT)) for name in FAMILIES]
        return self.deck.run.t_end or 1.0, plans

    def build(self) -> FrontRace:
        return self.make_race(self.deck.cells)

    def measure(self, evolution: FrontRace) -> dict[str, float]:
        """Mean errors of the four."""
        return evolution.measure_errors()

    def report(self, history, final=None) -> Report:
        return Report(lambda: make_summary(self, history))

    def figures(self):
        return {
            "fronts": functools.partial(draw_fronts, self),
            "errors": functools.partial(draw_errors, self),
        }
