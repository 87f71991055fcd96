"""A cavity heated from the side: steady convection, compared with a spectral method.

The box is 1 wide and `aspect` high; its left side is hot (1/2), its right side cold (-1/2), floor
and ceiling are adiabatic, all walls are no-slip.  Each side can be changed: `left.flow`,
`left.heat`, `left.value` and so on.  Scales: width 1 m, diffusivity 1 m2/s, difference 1 K, so that
velocities are in kappa/L and the heat through a wall is the Nusselt number.

`method = "steady"` uses Newton's method, one iteration per step; `"time"` integrates from rest.
The grid is clustered at the walls unless `grid.kind` says otherwise: uniform, polevikov (follows
the speed), monitor (follows gradients) or combined.  N cells per side mean (N + 1)² nodes.

Note: Polevikov's grid puts nodes where the speed is large; the step at a wall decreases only as
N^-1/2, so the Nusselt number is better on most other grids.
"""

import math
from collections.abc import Mapping
from typing import Literal

from shockgrid.hydro.convection import measure
from shockgrid.hydro.convection.box import Wall, make_fluid
from shockgrid.hydro.convection.steady import SteadySolver, make_rest
from shockgrid.problems.convection.boxes import SIDES, AxisGrid, BoxProblem, SteadyEvolution
from shockgrid.problems.deck import Deck, DeckTable, Output, RunControl, key
from shockgrid.problems.references.convection import AIR_PRANDTL, STATES, CavityState
from shockgrid.problems.report import Report
from shockgrid.regrid.errors import BadInput

CAVITY_MARCH_TIME = 0.2  # of a march in time: past the swings of the start
STEADY_ITERATIONS = 200
ROWS = {
    "nusselt": "Nu mean, left wall",
    "u_max": "greatest u on x = 1/2",
    "u_max_y": "  at y [m]",
    "v_max": "greatest v on y = 1/2",
    "v_max_x": "  at x [m]",
    "nusselt_max": "greatest Nu, left wall",
    "nusselt_max_y": "  at y [m]",
}


class Side(DeckTable, kw_only=True):
    """One wall of the box."""

    merges = True

    flow: key(Literal["no-slip", "free"], "no-slip or free-slip") = "no-slip"
    heat: key(Literal["isothermal", "adiabatic", "flux"], "condition at the wall") = "adiabatic"
    value: key(float, "temperature of the wall [K], or flux [K m/s]", ge=-1e6, le=1e6) = 0.0

    def make(self, name: str):
        """The wall for the solver; BadInput where heat and value contradict."""
        if self.heat == "adiabatic" and self.value != 0.0:
            raise BadInput(
                f"{name}.value = {self.value:g} contradicts "
                f"{name}.heat = 'adiabatic'; take 'flux' or 'isothermal'"
            )
        quantity = {"flux": "flux", "isothermal": "temperature"}.get(self.heat)
        return Wall(self.flow, **({quantity: self.value} if quantity else {}))


class HeatedCavityDeck(Deck, kw_only=True):
    output: Output = Output(dumps=4)
    run: RunControl = RunControl()
    method: key(Literal["steady", "time"], "Newton's iteration, or a march from rest") = "steady"
    cells: key(int, "cells across the box", ge=3, le=2000) = 40
    cells_up: key(int | None, "cells up. If left out: cells times aspect", ge=3, le=2000) = None
    aspect: key(float, "height over width", ge=0.01, le=100) = 1.0
    rayleigh: key(float, "Rayleigh number of the width", le=1e12) = 1e5
    prandtl: key(float, "viscosity over diffusivity", le=1e6) = AIR_PRANDTL
    tilt: key(float, "of gravity, anticlockwise from down [degrees]", ge=-360, le=360) = 0.0
    left: Side = Side(heat="isothermal", value=0.5)
    right: Side = Side(heat="isothermal", value=-0.5)
    bottom: Side = Side()
    top: Side = Side()
    grid: AxisGrid = AxisGrid(kind="clustered")
    tolerance: key(float, "relative change at which a state is steady", ge=1e-12, le=0.1) = 1e-10
    longest_step: key(float | None, "of the march [s]. If left out: 1/400 of its time", gt=0) = None


class HeatedCavity(BoxProblem):
    Deck = HeatedCavityDeck
    name = "heated-cavity"
    longest_part = 1 / 400
    units: Mapping[str, str] = {
        "u_max": "m/s", "v_max": "m/s", "u_max_y": "m", "v_max_x": "m", "nusselt_max_y": "m",
    }  # fmt: skip

    def __init__(self, deck: HeatedCavityDeck):
        super().__init__(deck)
        self.fluid = make_fluid(deck.rayleigh, deck.prandtl, deck.tilt)
        self.extent = 1.0, deck.aspect
        self.walls = {side: getattr(deck, name).make(name) for side, name in SIDES.items()}
        known = deck.left.heat == "isothermal" and deck.right.heat == "isothermal"
        # the scale of the Nusselt number: the difference of the sides, or 1 K without one
        self.scale = (abs(deck.left.value - deck.right.value) if known else 1.0) or 1.0
        steady = deck.method == "steady"
        self.t_unit = "iterations" if steady else "s"
        self.t_end = deck.run.t_end or float(STEADY_ITERATIONS if steady else CAVITY_MARCH_TIME)

    def build(self):
        deck = self.deck
        equations = self.make_first_equations()
        if deck.method == "steady":
            solver = SteadySolver(equations, self.fluid, deck.grid.control(), deck.tolerance)
            return SteadyEvolution(solver, self.t_end)
        sides = (deck.left, deck.right, deck.bottom, deck.top)
        coldest = min((s.value for s in sides if s.heat == "isothermal"), default=0.0)
        return self.make_march(equations, *make_rest(equations), coldest)

    def measure(self, evolution) -> dict[str, float]:
        """Nusselt numbers and greatest speeds, with their places."""
        equations = evolution.equations
        fluid = evolution.fluid
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
        deck = self.deck
        x, y = self.fluid.buoyancy
        ends = (self.deck.left, self.deck.right)
        same = all((side.heat, side.flow) == ("isothermal", "no-slip") for side in ends)
        same &= math.isclose(ends[0].value - ends[1].value, 1.0)
        same &= deck.top == deck.bottom == Side()
        if not same or deck.aspect != 1.0 or deck.prandtl != AIR_PRANDTL or x != 0.0 or y < 0.0:
            return None
        return STATES.get(deck.rayleigh)

    def report(self, run) -> Report:
        """The quantities of the reference, with its values where there are any."""
        history = run.history
        deck = self.deck
        reference = self.find_reference()
        head = self.describe()
        rows = [
            run.compare(name, getattr(reference, name, math.nan), label)
            for name, label in ROWS.items()
        ]
        if not run.begun:
            return Report(head, rows)
        notes = [] if reference else ["there is no reference for this deck"]
        passes = deck.bottom.heat == deck.top.heat == "adiabatic"
        if passes and history["nusselt"][-1] != 0.0:
            balance = history["nusselt_right"][-1] / history["nusselt"][-1] - 1.0
            notes.append(f"heat out at the right over heat in at the left, less 1: {balance:.1e}")
        notes.append(self.say_lost_volume(run))
        if deck.method == "steady":
            part = run.last("buoyancy")
            change = run.last("change")
            if part < 1.0 or change > deck.tolerance:
                head += (
                    f"\nNOT STEADY: these are iterates at Ra = {part * deck.rayleigh:.3g} that "
                    f"still change by {change:.1e}; more iterations (run.t_end) or method = 'time'"
                )
            notes.append(f"last change of Newton's iteration: {change:.1e}")
        return Report(head, rows, notes)
