"""A cavity heated from the side: steady convection, compared with a spectral method.

The box is 1 wide and `aspect` high; its left side is hot (1/2), its right side cold (-1/2), floor
and ceiling are adiabatic, all walls are no-slip.  Each side can be changed: `left.flow`,
`left.heat`, `left.value` and so on.  Scales: width 1 m, diffusivity 1 m2/s, difference 1 K, so that
velocities are in kappa/L and the heat through a wall is the Nusselt number.

`method = "steady"` uses Newton's method, one iteration per step; `"time"` integrates from rest.
The grid is clustered at the walls unless `grid.kind` says otherwise: uniform, polevikov (follows
the speed), monitor (follows gradients) or combined.  N cells a side have (N + 1)² nodes.

Note: Polevikov's grid puts nodes where the speed is large; the step at a wall decreases only as
N^-1/2, so the Nusselt number is better on most other grids.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np

from problems.deck import Deck, DeckTable, Output, RunControl, key
from problems.problem import BlockPlan, Problem
from problems.references.convection import PRANDTL, STATES, CavityState
from regrid.errors import BadInput

if TYPE_CHECKING:
    from hydro.convection.box import Fluid
    from hydro.convection.equations import Equations


AxisKind = Literal["uniform", "clustered", "polevikov", "monitor", "combined"]


class AxisGrid(DeckTable, kw_only=True):
    """Where the nodes of an axis lie, and after what they move."""

    merges = True

    kind: key(
        AxisKind,
        "uniform; clustered at walls; polevikov: after the speed; monitor: after "
        "gradients; combined: after both",
    ) = "uniform"
    every: key(int, "steps between corrections of the grid", ge=1, le=2**63 - 1) = 1
    relaxation: key(float, "fraction of a correction that is applied", gt=0, le=1) = 0.7
    ratio: key(float, "largest ratio of neighbouring steps; left out: the default", gt=1) | None = (
        None
    )
    floor: key(float, "least speed, as a fraction of the largest", gt=0, lt=1) = 0.02
    strength: key(float, "of the gradient against the uniform grid in the monitor", ge=0) = 1.0
    share: key(float, "of polevikov's density of nodes in the combined one", ge=0, le=1) = 0.5
    walls: key(Literal["both", "low", "high"], "where a clustered grid is dense") = "both"
    clustering: key(float, "strength of a clustered grid's tanh spacing", gt=0, le=20) = 2.0

    def make(self, n: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
        """The first axis of n steps, shape (n + 1,)."""
        from hydro.convection.tensor_grids import make_axis  # scipy is slow to load

        return make_axis(self.kind, n, low, high, walls=self.walls, clustering=self.clustering)

    def options(self) -> dict[str, Any]:
        """What `correct_axis` needs besides the kind."""
        names = ("floor", "ratio", "strength", "share", "relaxation")
        return {name: getattr(self, name) for name in names}


TIME = 0.2  # of a march in time: past the swings of the start
LONGEST_PART = 1 / 400  # of the time, in one step
STEADY_ITERATIONS = 200


class Side(DeckTable, kw_only=True):
    """One wall of the box."""

    merges = True

    flow: key(Literal["no-slip", "free"], "no-slip or free-slip") = "no-slip"
    heat: key(Literal["isothermal", "adiabatic", "flux"], "thermal condition at the wall") = (
        "adiabatic"
    )
    value: key(
        float,
        "temperature [K] of an isothermal wall, or flux into the fluid [K m/s]",
        ge=-1e6,
        le=1e6,
    ) = 0.0

    def make(self, name: str):
        """The wall for the solver; BadInput where heat and value contradict."""
        from hydro.convection.box import Wall

        if self.heat == "adiabatic":
            if self.value != 0.0:
                raise BadInput(
                    f"{name}.value = {self.value:g} contradicts {name}.heat = 'adiabatic'; "
                    "take heat = 'flux' or 'isothermal'"
                )
            return Wall(self.flow)
        if self.heat == "flux":
            return Wall(self.flow, flux=self.value)
        return Wall(self.flow, temperature=self.value)


class HeatedCavityDeck(Deck, kw_only=True):
    """Deck of `heated-cavity`."""

    output: Output = msgspec.field(default_factory=lambda: Output(dumps=4))
    run: RunControl = msgspec.field(default_factory=RunControl)
    method: key(Literal["steady", "time"], "Newton's iteration, or a march from rest") = "steady"
    cells: key(int, "cells across the box", ge=3, le=2000) = 40
    cells_up: key(int, "cells up; left out: cells times aspect", ge=3, le=2000) | None = None
    aspect: key(float, "height over width", ge=0.01, le=100) = 1.0
    rayleigh: key(float, "Rayleigh number of the width", le=1e12) = 1e5
    prandtl: key(float, "viscosity over diffusivity", le=1e6) = PRANDTL
    tilt: key(
        float, "gravity turned anticlockwise from straight down [degrees]", ge=-360, le=360
    ) = 0.0
    gravity: key(list[float], "its direction x, y", min_length=2, max_length=2) | None = None
    left: Side = msgspec.field(default_factory=lambda: Side(heat="isothermal", value=0.5))
    right: Side = msgspec.field(default_factory=lambda: Side(heat="isothermal", value=-0.5))
    bottom: Side = msgspec.field(default_factory=Side)
    top: Side = msgspec.field(default_factory=Side)
    grid: AxisGrid = msgspec.field(default_factory=lambda: AxisGrid(kind="clustered"))
    tolerance: key(float, "relative change at which a state is steady", gt=0, le=0.1) = 1e-10
    longest_step: key(float, "of the march [s]; left out: 1/400 of its time", gt=0) | None = None


class HeatedCavity(Problem):
    """One box."""

    Deck = HeatedCavityDeck
    name = "heated-cavity"
    units: Mapping[str, str] = {
        "u_max": "m/s", "v_max": "m/s", "u_max_y": "m", "v_max_x": "m", "nusselt_max_y": "m",
    }  # fmt: skip

    def __init__(self, deck: HeatedCavityDeck):
        super().__init__(deck)
        self.fluid = self.make_fluid()
        self.walls = self.make_walls()
        known = deck.left.heat == "isothermal" and deck.right.heat == "isothermal"
        # the scale of the Nusselt number: the difference of the sides, or 1 K without one
        self.scale = abs(deck.left.value - deck.right.value) if known else 1.0
        self.scale = self.scale or 1.0

    def make_fluid(self) -> Fluid:
        """The fluid of the deck's numbers; BadInput for a bad one."""
        from hydro.convection.box import make_fluid

        deck = self.deck
        if deck.gravity is not None and deck.tilt != 0.0:
            raise BadInput(
                f"tilt = {deck.tilt:g} and gravity are both given; leave one of them out"
            )
        direction = None if deck.gravity is None else tuple(deck.gravity)
        return make_fluid(deck.rayleigh, deck.prandtl, deck.tilt, direction)

    def make_walls(self):
        """The four walls by the solver's names."""
        deck = self.deck
        return {
            "i_min": deck.left.make("left"),
            "i_max": deck.right.make("right"),
            "j_min": deck.bottom.make("bottom"),
            "j_max": deck.top.make("top"),
        }

    @property
    def size(self) -> tuple[int, int]:
        """Cells across and up."""
        deck = self.deck
        return deck.cells, deck.cells_up or max(3, round(deck.cells * deck.aspect))

    def plan(self) -> tuple[float, list[BlockPlan]]:
        """Time, or most iterations, and the box."""
        return self.t_end, [BlockPlan("box", self.size, (0.0, 0.0), (1.0, self.deck.aspect))]

    @property
    def t_end(self) -> float:
        default = float(STEADY_ITERATIONS) if self.deck.method == "steady" else TIME
        return self.deck.run.t_end or default

    @property
    def t_unit(self) -> str:
        return "iterations" if self.deck.method == "steady" else "s"

    def make_equations(self, x: np.ndarray, y: np.ndarray) -> Equations:
        """The discrete equations on nodes x, y."""
        from hydro.convection.equations import Equations

        return Equations(x, y, self.walls)

    def build(self):
        from hydro.convection.march import March
        from hydro.convection.steady import GridControl, SteadySolver, make_rest
        from problems.convection.boxes import SteadyEvolution, TimeEvolution

        deck = self.deck
        across, up = self.size
        equations = self.make_equations(
            deck.grid.make(across), deck.grid.make(up, 0.0, deck.aspect)
        )
        grid = GridControl(deck.grid.kind, deck.grid.every, options=deck.grid.options())
        if deck.method == "steady":
            solver = SteadySolver(equations, self.fluid, grid, deck.tolerance)
            return SteadyEvolution("box", solver, self.t_end)
        longest = deck.longest_step or LONGEST_PART * (deck.run.t_set_up or self.t_end)
        march = March(
            equations, self.fluid, *make_rest(equations), cfl=deck.run.cfl, longest=longest
        )
        sides = (deck.left, deck.right, deck.bottom, deck.top)
        coldest = min((s.value for s in sides if s.heat == "isothermal"), default=0.0)
        return TimeEvolution("box", march, grid, self.t_end, coldest)

    def measure(self, evolution) -> dict[str, float]:
        """Nusselt numbers and greatest speeds, with their places."""
        from hydro.convection import measure

        equations, fluid = evolution.equations, evolution.fluid
        state = (equations, fluid, evolution.temperature)
        peak, position = measure.find_nusselt_maximum(*state, "i_min", self.scale)
        u, y = measure.find_greatest_speed(equations, evolution.psi, 0)
        v, x = measure.find_greatest_speed(equations, evolution.psi, 1)
        return {
            "nusselt": measure.compute_mean_nusselt(*state, "i_min", self.scale),
            "nusselt_right": -measure.compute_mean_nusselt(*state, "i_max", self.scale),
            "nusselt_max": peak,
            "nusselt_max_y": position,
            "u_max": u,
            "u_max_y": y,
            "v_max": v,
            "v_max_x": x,
        }

    def find_reference(self) -> CavityState | None:
        """The reference of this deck; None where there is none for it."""
        deck, usual = self.deck, HeatedCavityDeck()
        same = all(getattr(deck, name) == getattr(usual, name) for name in ("top", "bottom"))
        same = same and deck.left.heat == deck.right.heat == "isothermal"
        same = same and deck.left.flow == deck.right.flow == "no-slip"
        same = same and math.isclose(deck.left.value - deck.right.value, 1.0)
        x, y = self.fluid.buoyancy
        if not same or deck.aspect != 1.0 or deck.prandtl != PRANDTL or x != 0.0 or y < 0.0:
            return None
        return STATES.get(deck.rayleigh)

    def report(self, history, final=None):
        from problems.convection.boxes import report_cavity

        return report_cavity(self, history)

    def figures(self):
        from problems.convection import boxes as pictures

        return {
            "flow": functools.partial(pictures.draw_flow, self),
            "nusselt": functools.partial(pictures.draw_nusselt, self, ("i_min", "i_max")),
            "grid": pictures.draw_grid,
        }
