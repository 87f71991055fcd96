"""A viscous front on nodes placed after the step, by a speed law, or before the fluxes.

Burgers' equation with fronts that run, and merge, between falling `levels`; the exact solution is
known.  Four columns of as many cells solve it side by side in equal steps:

- fixed: nodes at rest, evenly spaced;
- after: nodes placed after each step; their speed in the fluxes is that of the step before;
- law: nodes follow a law for their speed, integrated together with the flow;
- first: nodes placed first, the fluxes of the same step know where they go (as in the flow solver).

The closing screen has error, order, lost sum and cost of the four at three sizes.  The traps:
`after` shifts the front, its profile stays smooth, and a single front at one speed hides the lag
(nothing speeds up); and orders of grids with bounded neighbours look low because the bound helps
the coarse ones most (`grid.ratio = 1000` shows the second order).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from hydro.convection.columns import FAMILIES, HEIGHT, FrontRace, Placing
from problems.convection.moving_grid_1d_report import draw_errors, draw_fronts, make_summary
from problems.deck import Deck, DeckTable, RunControl
from problems.problem import BlockPlan, Problem
from problems.references.burgers_fronts import BurgersFronts
from regrid.errors import BadInput


class PlacingPart(DeckTable, kw_only=True):
    """How the nodes of the moving columns are placed."""

    merges = True

    strength: Annotated[
        float, Meta(ge=0, description="of the gradient: 2 gives two thirds of the nodes to it")
    ] = 2.0
    ratio: (
        Annotated[float, Meta(gt=1, description="most of neighbouring steps; left out: usual")]
        | None
    ) = None
    relaxation: Annotated[
        float, Meta(gt=0, le=1, description="part of a correction that is made")
    ] = 0.7
    tau: Annotated[float, Meta(gt=0, description="time [s] in which the speed law follows")] = 0.005
    start: Annotated[
        Literal["moving", "rest"],
        Meta(description="nodes placed after the step: their speed at t = 0 known, or none"),
    ] = "moving"


class MovingGrid1DDeck(Deck, kw_only=True):
    """Deck of `moving-grid-1d`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=1.0, cfl=0.5))
    cells: Annotated[int, Meta(ge=16, le=10000, description="cells of each column")] = 160
    viscosity: Annotated[
        float, Meta(gt=0, le=10, description="viscosity [m2/s]; the column is 1 m")
    ] = 5e-3
    levels: Annotated[
        list[float], Meta(description="falling values of u [m/s] before and after the fronts")
    ] = msgspec.field(default_factory=lambda: [1.0, 0.5, 0.0])
    fronts: Annotated[
        list[float], Meta(description="places [m] of the fronts between the levels at t = 0")
    ] = msgspec.field(default_factory=lambda: [0.2, 0.5])
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
            raise BadInput(f"fronts = {deck.fronts}: places have to rise and lie between 0 and 1")
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

    def summary(self, history: Mapping[str, np.ndarray], final) -> str:
        return make_summary(self, history)

    def figures(self):
        return {
            "fronts": functools.partial(draw_fronts, self),
            "errors": functools.partial(draw_errors, self),
        }
