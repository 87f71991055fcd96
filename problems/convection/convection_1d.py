"""Convection between vertical plates with a through-flow, against its exact profiles.

Two plates, hot at x = 0 and cold at x = 1, stand in a slot that is closed far above and below:
the fluid rises along the one and sinks along the other, v = Ra/12 x (1 - x)(1 - 2 x).  Suction and
injection through the plates (`peclet`) blow the heat towards one of them, into a layer of thickness
1/Pe.  `mean_speed` adds a flow along the slot.  The fluid starts at rest, and the run ends when
nothing changes any more.

Scales: width of the slot 1 m, diffusivity 1 m2/s, 1 K between the plates.

The grid may follow the speed as Polevikov's does, gradients, or both (`grid.kind`); the closing
screen compares all of them at three sizes, and the schemes of the through-flow's flux, with the
exact solution.  The trap: Polevikov's grid has its longest steps at the plates, where they fall
with the square root of the number of cells only: v is right to first order on it, not to second.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from hydro.convection.columns import Column, ColumnMarch
from problems.convection.axis_grid import AxisGrid
from problems.convection.convection_1d_report import (
    draw_grids,
    draw_profiles,
    make_summary,
    measure_errors,
)
from problems.deck import Deck, Output, RunControl
from problems.problem import Problem
from problems.references.vertical_plates import VerticalPlates
from regrid.errors import BadInput

LASTING = 50.0  # slowest diffusive times that a run may take: steady long before


class Convection1DDeck(Deck, kw_only=True):
    """Deck of `convection-1d`."""

    output: Output = msgspec.field(default_factory=lambda: Output(dumps=4))
    run: RunControl = msgspec.field(default_factory=RunControl)
    cells: Annotated[int, Meta(ge=3, le=20000, description="cells across the slot")] = 40
    rayleigh: Annotated[
        float, Meta(ge=0, le=1e12, description="Rayleigh number of the slot's width")
    ] = 1e4
    prandtl: Annotated[float, Meta(ge=1e-6, le=1e6, description="viscosity over diffusivity")] = (
        0.71
    )
    peclet: Annotated[
        float,
        Meta(ge=-1e6, le=1e6, description="Péclet number of the through-flow, hot to cold plate"),
    ] = 0.0
    mean_speed: Annotated[
        float,
        Meta(ge=-1e6, le=1e6, description="mean speed along the slot [m/s]; 0: closed far away"),
    ] = 0.0
    scheme: Annotated[
        Literal["exponential", "samarskii", "upwind", "central"],
        Meta(description="of the fluxes; central swings beyond a grid Péclet number of 2"),
    ] = "exponential"
    grid: AxisGrid = msgspec.field(default_factory=AxisGrid)


class Convection1D(Problem):
    """One column of cells."""

    Deck = Convection1DDeck
    units: Mapping[str, str] = {"least_step": "m", "flow": "m2/s", "reference_temperature": "K"}

    def __init__(self, deck: Convection1DDeck):
        super().__init__(deck)
        if deck.rayleigh == 0.0 and deck.mean_speed == 0.0:
            raise BadInput(
                "rayleigh = 0 and mean_speed = 0: nothing would rise or sink; give one of them"
            )
        if not (math.isfinite(deck.mean_speed) and math.isfinite(deck.rayleigh)):
            raise BadInput("rayleigh and mean_speed must be finite numbers")
        self.exact = VerticalPlates(deck.rayleigh, deck.prandtl, deck.peclet, deck.mean_speed)

    def make_column(self, scheme: str | None = None) -> Column:
        """The fluid and its walls, with the deck's scheme or another."""
        deck = self.deck
        return Column(
            viscosity=deck.prandtl,
            diffusivity=1.0,
            buoyancy=deck.rayleigh * deck.prandtl,
            through_flow=deck.peclet,
            mean_speed=deck.mean_speed,
            scheme=scheme or deck.scheme,
        )

    def build(self) -> ColumnMarch:
        deck = self.deck
        t_end = deck.run.t_end or LASTING * max(1.0, 1.0 / deck.prandtl)
        return ColumnMarch(
            self.make_column(),
            deck.grid.make(deck.cells),
            t_end,
            deck.grid.kind,
            deck.grid.every,
            **deck.grid.options(),
        )

    def measure(self, evolution: ColumnMarch) -> dict[str, float]:
        """Errors and swings against the exact steady profiles, at the end only."""
        if evolution.finished is None:
            return dict.fromkeys(("error_T", "error_v", "swings_T", "swings_v"), math.nan)
        return measure_errors(self.exact, evolution.x, evolution.temperature, evolution.velocity)

    def summary(self, history: dict[str, np.ndarray], final) -> str:
        return make_summary(self, history)

    def figures(self):
        return {
            "profiles": functools.partial(draw_profiles, self),
            "grids": functools.partial(draw_grids, self),
        }
