"""A fluid heated from below, in a square box or in a layer: onset, growth and steady rolls.

The fluid lies between a hot floor (1/2) and a cold ceiling (-1/2), 1 above it.  `shape = "box"` has
side walls at a distance `width`, adiabatic or conducting; `shape = "layer"` has periodic sides, by
default a critical wavelength apart.  The run starts from the fluid at rest with its fastest
disturbance, of `amplitude` K; above the onset it grows into rolls, below it decays.  A layer has
its rolls at any position, and rolls may turn either way: the disturbance used is the part of
exp(x/width + y) that grows at the largest rate (`stability.filter_disturbance`), so that every
computer starts from the same one.

The summary compares the Rayleigh number of the onset, bracketed by the sign of the largest growth
rate of the discrete equations, with linear theory, and the growth in time with the eigenvalue.
Scales: height 1 m, diffusivity 1 m2/s, difference 1 K.

Note: near the onset everything is slow.  At one per cent above it a disturbance takes several
diffusive times to grow by a factor e.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from problems.convection.heated_cavity import AxisGrid
from problems.deck import Deck, Output, RunControl, key
from problems.problem import BlockPlan, Problem, Report, Row
from problems.references.convection import (
    BOX_ONSETS,
    FREE_LAYER_ONSET,
    FREE_LAYER_WAVENUMBER,
    LAYER_ONSET,
    LAYER_WAVENUMBER,
    PRANDTL,
)
from regrid.errors import BadInput

if TYPE_CHECKING:
    from hydro.convection.equations import Equations

TIME = 1.5
LONGEST_PART = 1 / 600  # of the time, in one step


class RayleighBenardDeck(Deck, kw_only=True):
    output: Output = msgspec.field(default_factory=lambda: Output(dumps=6))
    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=TIME))
    shape: key(Literal["box", "layer"], "side walls, or periodic sides") = "box"
    sides: key(Literal["adiabatic", "conducting"], "side walls of a box") = "adiabatic"
    walls: key(Literal["no-slip", "free"], "floor and ceiling hold the fluid, or not") = "no-slip"
    cells: key(int, "cells across", ge=3, le=2000) = 40
    cells_up: key(int, "cells up", ge=3, le=2000) = 40
    width: key(float, "over the height; left out: 1, layer: critical", ge=0.01, le=100) | None = (
        None
    )
    rayleigh: key(float, "Rayleigh number of the height", le=1e12) = 5000.0
    prandtl: key(float, "viscosity over diffusivity", le=1e6) = PRANDTL
    tilt: key(float, "of gravity, anticlockwise from down [degrees]", gt=-90, lt=90) = 0.0
    amplitude: key(float, "of the first disturbance of the temperature [K]", gt=0, le=1) = 1e-3
    onset: key(bool, "search for the onset at the end") = True
    grid: AxisGrid = msgspec.field(default_factory=AxisGrid)
    longest_step: key(float, "of the march [s]; left out: 1/600 of its time", gt=0) | None = None


def conduct(y: np.ndarray) -> np.ndarray:
    """Temperature at rest, on conducting side walls."""
    return 0.5 - y


class RayleighBenard(Problem):
    """One box, or one period of a layer."""

    Deck = RayleighBenardDeck
    units: Mapping[str, str] = {"kinetic_energy": "m4/s2", "growth": "1/s", "u_max": "m/s"}
    scale = 1.0  # of the Nusselt number

    def __init__(self, deck: RayleighBenardDeck):
        super().__init__(deck)
        from hydro.convection.box import make_fluid

        if deck.shape == "layer" and deck.sides != "adiabatic":
            raise BadInput(
                f"sides = {deck.sides!r} contradicts shape = 'layer', whose sides are periodic; "
                "leave sides out or take shape = 'box'"
            )
        self.fluid = make_fluid(deck.rayleigh, deck.prandtl, deck.tilt)
        free = deck.walls == "free"
        self.critical = FREE_LAYER_WAVENUMBER if free else LAYER_WAVENUMBER
        usual = 1.0 if deck.shape == "box" else 2.0 * math.pi / self.critical
        self.width = deck.width or usual

    @property
    def t_end(self) -> float:
        return self.deck.run.t_end or TIME

    def plan(self):
        size = self.deck.cells, self.deck.cells_up
        return self.t_end, [BlockPlan("box", size, (0.0, 0.0), (self.width, 1.0))]

    def make_equations(self, x: np.ndarray, y: np.ndarray) -> Equations:
        """The discrete equations on nodes x, y."""
        from hydro.convection.box import PERIODIC, adiabatic, isothermal
        from hydro.convection.equations import Equations

        deck = self.deck
        side = PERIODIC
        if deck.shape == "box":
            side = adiabatic() if deck.sides == "adiabatic" else isothermal(conduct)
        walls = {"i_min": side, "i_max": side}
        walls |= {"j_min": isothermal(0.5, deck.walls), "j_max": isothermal(-0.5, deck.walls)}
        return Equations(x, y, walls)

    def make_first_equations(self) -> Equations:
        """The equations on the first grid."""
        deck = self.deck
        return self.make_equations(
            deck.grid.make(deck.cells, 0.0, self.width), deck.grid.make(deck.cells_up)
        )

    def build(self):
        from hydro.convection.march import March
        from hydro.convection.measure import compute_growth, solve_rest
        from hydro.convection.steady import GridControl
        from problems.convection.boxes import TimeEvolution

        deck = self.deck
        equations = self.make_first_equations()
        grid = GridControl(deck.grid.kind, deck.grid.every, options=deck.grid.options())
        psi, temperature = solve_rest(equations, self.fluid)
        _, flow, heat = compute_growth(equations, self.fluid, psi, temperature)
        march = March(
            equations,
            self.fluid,
            psi + deck.amplitude * flow,
            temperature + deck.amplitude * heat,
            cfl=deck.run.cfl,
            longest=deck.longest_step or LONGEST_PART * (deck.run.t_set_up or self.t_end),
        )
        return TimeEvolution("box", march, grid, self.t_end, coldest=-0.5)

    def measure(self, evolution) -> dict[str, float]:
        """Nusselt numbers of floor and ceiling, kinetic energy, greatest velocity across."""
        from hydro.convection import measure

        equations = evolution.equations
        state = (equations, evolution.fluid, evolution.temperature)
        return {
            "nusselt": measure.compute_mean_nusselt(*state, "j_min"),
            "nusselt_top": -measure.compute_mean_nusselt(*state, "j_max"),
            "kinetic_energy": measure.measure_energy(equations, evolution.psi),
            "u_max": float(np.abs(equations.compute_velocities(evolution.psi)[0]).max()),
        }

    def find_onset_reference(self) -> float | None:
        """Ra of the onset by linear theory; None where there is none for this deck."""
        deck = self.deck
        if deck.tilt != 0.0:
            return None
        if deck.shape == "layer":
            critical = math.isclose(self.width * self.critical, 2.0 * math.pi, rel_tol=1e-3)
            onset = FREE_LAYER_ONSET if deck.walls == "free" else LAYER_ONSET
            return onset if critical else None
        if self.width != 1.0 or deck.walls == "free":
            return None
        return BOX_ONSETS[deck.sides]

    def report(self, history, final=None) -> Report:
        from problems.convection.boxes import report_benard

        onset = self.find_onset_reference()
        rows = [] if onset is None else [Row("onset", theory=onset)]
        return Report((lambda: str(report_benard(self, history))) if history else "", rows)

    def figures(self):
        from problems.convection import boxes as pictures

        return {
            "flow": functools.partial(pictures.draw_flow, self),
            "nusselt": functools.partial(pictures.draw_nusselt, self, ("j_min", "j_max")),
            "growth": functools.partial(pictures.draw_growth, self),
            "grid": pictures.draw_grid,
        }
