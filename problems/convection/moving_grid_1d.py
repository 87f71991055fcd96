"""A viscous front on nodes placed after the step, by a speed equation, or before the fluxes.

Burgers' equation with fronts that run, and merge, between falling `levels`; the exact solution is
known.  Four columns with the same number of cells solve it side by side in equal steps:

- fixed: nodes at rest, evenly spaced;
- after: nodes placed after each step; their speed in the fluxes is that of the step before;
- law: an equation for the node speed, integrated together with the flow;
- first: nodes placed first, and the fluxes of the same step use their motion (as in the flow
  solver).

The summary lists error, lost sum and cost of the four (`benchmarks/convection_1d_tables.py`: at
three sizes).  Note: `after` shifts the front, its profile stays smooth, and a single front at one
speed hides the lag (nothing accelerates); orders of grids with bounded neighbours look low because
the bound helps the coarse ones most (`grid.ratio = 1000` shows the second order).
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Literal

import msgspec
import numpy as np

from shockgrid.hydro.convection.columns import DRAWN_BLOCK_HEIGHT
from shockgrid.hydro.convection.fronts import FAMILIES, FrontRace, Placing
from shockgrid.problems.deck import Deck, DeckTable, RunControl, key
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.convection import BurgersFronts
from shockgrid.problems.report import Report, align

WORDS = {
    "fixed": "nodes at rest",
    "after": "placed after the step",
    "law": "by a speed law",
    "first": "placed first",
}
COLOURS = dict(zip(FAMILIES, ("0.3", "C3", "C1", "C0"), strict=True))


class PlacingPart(DeckTable, kw_only=True):
    """How the nodes of the moving columns are placed."""

    merges = True

    strength: key(float, "of the gradient: 2 gives it two thirds of the nodes", ge=0, le=1e9) = 2.0
    ratio: key(float | None, "largest of neighbouring steps. If left out: the default", gt=1) = None
    relaxation: key(float, "fraction of a correction that is applied", ge=1e-12, le=1) = 0.7
    tau: key(float, "relaxation time [s] of the node speed", ge=1e-12, le=1e9) = 0.005
    start: key(Literal["moving", "rest"], "`after`: node speed at t = 0 known, or 0") = "moving"


class MovingGrid1DDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=1.0, cfl=0.5)
    cells: key(int, "cells of each column", ge=16, le=10000) = 160
    viscosity: key(float, "viscosity [m2/s]; the column is 1 m", ge=1e-12, le=10) = 5e-3
    levels: key(tuple[float, ...], "falling values of u [m/s] between fronts") = (1.0, 0.5, 0.0)
    fronts: key(tuple[float, ...], "their places [m] at t = 0", min_length=1) = (0.2, 0.5)
    grid: PlacingPart = PlacingPart()


class MovingGrid1D(Problem):
    Deck = MovingGrid1DDeck
    units: Mapping[str, str] = {f"error_{family}": "m2/s" for family in FAMILIES}

    def __init__(self, deck: MovingGrid1DDeck):
        super().__init__(deck)
        if len(deck.levels) != len(deck.fronts) + 1:
            raise deck.error(
                "levels",
                f"they must be one more than the fronts, of which there are {len(deck.fronts)}",
            )
        rises = any(ahead >= behind for behind, ahead in pairwise(deck.levels))
        if rises:
            raise deck.error("levels", "from front to front u has to fall")
        falls = any(one >= other for one, other in pairwise([0.0, *deck.fronts, 1.0]))
        if falls:
            raise deck.error("fronts", "positions must increase and lie between 0 and 1")
        self.exact = BurgersFronts(deck.viscosity, tuple(deck.levels), tuple(deck.fronts))

    def make_race(self, cells: int) -> FrontRace:
        """The race with another number of cells, at the same part of the stable step."""
        placing = Placing(**msgspec.structs.asdict(self.deck.grid))
        dt = self.deck.run.cfl / (cells * max(abs(u) for u in self.deck.levels))
        return FrontRace(self.exact, cells, dt, self.t_end, placing)

    def plan(self) -> tuple[float, list[BlockPlan]]:
        """End time and the four columns."""
        size = (self.deck.cells, 1)
        return self.t_end, [
            BlockPlan(name, size, (0.0, 0.0), (1.0, DRAWN_BLOCK_HEIGHT)) for name in FAMILIES
        ]

    def build(self) -> FrontRace:
        return self.make_race(self.deck.cells)

    def measure(self, evolution: FrontRace) -> dict[str, float]:
        """Mean errors of the four."""
        return evolution.measure_errors()

    def report(self, run) -> Report:
        """The table of the four families at the end time."""
        history = run.history
        deck = self.deck
        steps = max(1, len(history["t"]) - 1)
        if not run.begun or history["t"][-1] < 0.999999 * self.t_end:
            if not run.begun:
                return Report("")
            return Report(
                "moving-grid-1d: the families are compared at the end time, which is not reached"
            )
        head = (
            f"{len(deck.fronts)} front{'s' * (len(deck.fronts) > 1)}, viscosity {deck.viscosity:g} "
            f"m2/s, {deck.cells} cells, {steps} steps"
        )
        table = [["", "mean |u - exact|", "worst in time", "sum lost", "CPU ms/step"]]
        for family in FAMILIES:
            errors = history[f"error_{family}"]
            total = history[f"total_u_{family}"]
            through = history[f"boundary_u_{family}"]
            lost = abs(total[-1] - total[0] - (through[-1] - through[0]))
            lost /= max(abs(total[-1]), abs(total[0]))  # of u dx beyond what came in
            seconds = float(np.nansum(history[f"seconds_{family}"])) / steps
            numbers = f"{errors[-1]:.2e}", f"{np.nanmax(errors):.2e}", f"{lost:.1e}"
            table.append([WORDS[family], *numbers, f"{1e3 * seconds:.2f}"])
        return Report("\n".join([head, *align(table)]))

    def draw_fronts(self, figure, run_data) -> None:
        """The steepest front at the end with its error, and the ways of the nodes."""
        dump = run_data.dumps[-1]
        figure.set_size_inches(10.0, 7.0)
        grid = figure.add_gridspec(2, 6)
        profile = figure.add_subplot(grid[0, :3])
        wrong = figure.add_subplot(grid[0, 3:])
        fine = np.linspace(0.0, 1.0, 4001)
        exact = self.exact.compute_values(fine, dump.t)
        middle = fine[np.abs(np.diff(exact)).argmax()]
        half = max(20.0 * self.deck.viscosity / np.ptp(exact), 2.0 / self.deck.cells)
        shown = np.abs(fine - middle) < half
        profile.plot(fine[shown], exact[shown], color="0.5", lw=1.5, label="exact")
        for block in dump.blocks:
            x = block.nodes[0, :, 0]
            u = block.cell_fields["u"][:, 0]
            centres = 0.5 * (x[1:] + x[:-1])
            near = np.abs(centres - middle) < half
            style = {"color": COLOURS[block.name], "label": WORDS[block.name]}
            profile.plot(centres[near], u[near], ".", ms=4, **style)
            error = np.abs(u - self.exact.compute_cell_averages(x, dump.t))
            wrong.semilogy(centres, np.maximum(error, 1e-12), ".-", lw=0.5, ms=2.5, **style)
        profile.set_title(f"u [m/s] about the front, t = {dump.t:.3g} s", fontsize="medium")
        wrong.set_title("|u - exact| [m/s]", fontsize="medium")
        wrong.set_ylim(1e-9, 2.0)
        times = [one.t for one in run_data.dumps]
        for k, family in enumerate(FAMILIES[1:]):
            axes = figure.add_subplot(grid[1, 2 * k : 2 * k + 2])
            ways = np.array([one.block(family).nodes[0, :, 0] for one in run_data.dumps])
            axes.plot(ways, times, color="0.2", lw=0.4)
            axes.set_title(f"ways of the nodes, {WORDS[family]}", fontsize="medium")
        for axes in figure.axes:
            axes.set_xlabel("x [m]")
        figure.axes[2].set_ylabel("t [s]")
