"""A viscous front on cells whose nodes may move.

Burgers' equation du/dt + d(u^2/2)/dx = nu d2u/dx2, with the flux past a node between l
and r

    G = (l^2 + r^2)/4 - s (l + r)/2 - nu A(Pe) (r - l)/d,      Pe = ((l + r)/2 - s) d/nu

with s the speed of the node: nodes that move with a front have no convective flux.  The time
integrator is the L-stable SDIRK method of order 2 (gamma = 1 - 1/sqrt 2), with its first stage on
the grid at t + gamma dt; uniform u stays uniform and the sum of u is conserved to round-off (GCL).
`FrontRace` runs the three families of theory R13 and fixed nodes side by side:

- after: nodes are placed after the step, from its result; the speed in the fluxes is the backward
  difference of the last two placements.  Whenever nodes accelerate, the equations have an error
  that shifts the whole front, and the sum of u is not conserved.
- law: a moving-mesh equation, `tau W s_qq + (w x_q)_q = 0` (theory R13.2) with W the largest w, is
  integrated together with the flow; the nodes lag behind their optimum by about tau.
- first: nodes are placed first, from the known solution, and the fluxes of the same step use their
  motion: no lag in the equations, and nodes at the optimum of the previous step.

Sources: [HuangRenRussell1994]; SDIRK: [Alexander1977].
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import solve_banded

from shockgrid.hydro.convection.columns import (
    DRAWN_BLOCK_GAP,
    DRAWN_BLOCK_HEIGHT,
    RowBlock,
    enclose,
    fit_diffusion,
    make_bands,
    measure_distances,
)
from shockgrid.hydro.convection.tensor_grids import (
    correct_axis,
    weigh_gradient,
)
from shockgrid.regrid.errors import Place, RunFailure

FAMILIES = ("fixed", "after", "law", "first")
SDIRK_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
MOST_NEWTON_ITERATIONS = 30  # iterations at most; four are typical
LEAST_CELL_SHRINKAGE = 0.2  # of a cell's length: the lagging speed may shrink it to that
FIRST_CORRECTIONS = 60  # at most, of the moving grids for the solution at t = 0
PLACED_NODE_MOVE = 1e-10  # of the column: nodes that move by less have settled
Ends = Callable[[float], np.ndarray]


@dataclass(frozen=True)
class Step:
    """Cell averages u (n,), inflow through the ends (sum of u dx), Newton iterations."""

    u: np.ndarray
    through: float
    iterations: int


def compute_fluxes(
    x: np.ndarray,
    u: np.ndarray,
    ends: np.ndarray,
    speed: np.ndarray,
    viscosity: float,
    factor: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """G (n + 1,) past the nodes and its derivatives by the left and right values."""
    values = enclose(u, ends)
    left, right = values[:-1], values[1:]
    spread = viscosity * factor / measure_distances(x)
    flux = 0.25 * (left**2 + right**2) - 0.5 * speed * (left + right) - spread * (right - left)
    return flux, 0.5 * (left - speed) + spread, 0.5 * (right - speed) - spread


def step_front(
    x_old: np.ndarray,
    x_new: np.ndarray,
    u: np.ndarray,
    viscosity: float,
    t: float,
    dt: float,
    ends: Ends,
) -> Step:
    """One step of `dt` from `t` while the nodes (n + 1,) move from x_old to x_new; u (n,).

    ends: t -> u at both ends (2,), which are fixed.  Raises RunFailure if Newton's method does not
    converge.
    """
    # what the cells hold at the start; their nodes move evenly
    speed = (x_new - x_old) / dt
    before = np.diff(x_old) * u
    stage_flux = 0.0
    through = 0.0
    iterations = 0
    tolerance = 1e-14 * float(np.abs(before).max()) + 1e-300
    # two implicit stages, each by Newton's method
    for place, earlier in ((SDIRK_GAMMA, 0.0), (1.0, 1.0 - SDIRK_GAMMA)):
        x = x_new if place == 1.0 else x_old + place * (x_new - x_old)
        sizes = np.diff(x)
        outside = ends(t + place * dt)
        values = enclose(u, outside)
        past = 0.5 * (values[:-1] + values[1:]) - speed
        factor = fit_diffusion("exponential", past * measure_distances(x) / viscosity)
        # until the residual is round-off
        for _ in range(MOST_NEWTON_ITERATIONS):
            flux, by_left, by_right = compute_fluxes(x, u, outside, speed, viscosity, factor)
            residual = sizes * u - before
            residual += dt * (earlier * stage_flux + SDIRK_GAMMA * np.diff(flux))
            if np.abs(residual).max() <= tolerance:
                break
            iterations += 1
            weight = SDIRK_GAMMA * dt
            u = u - solve_banded(
                (1, 1), make_bands(weight * by_left, weight * by_right, sizes), residual
            )
        else:
            worst = int(np.abs(residual).argmax())
            raise RunFailure(
                f"cell {worst}, t = {t:.4g} s: the implicit step did not settle in "
                f"{MOST_NEWTON_ITERATIONS} iterations; a smaller cfl would let it",
                cause="implicit-step",
                place=Place("", (worst, 0)),  # the caller knows the column's name
            )
        # the flux of this stage, also in the next one
        stage_flux = np.diff(flux)
        through += (
            (SDIRK_GAMMA if place == 1.0 else 1.0 - SDIRK_GAMMA) * dt * float(flux[0] - flux[-1])
        )
    return Step(u, through, iterations)


def measure_gradient(x: np.ndarray, u: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """|du/dx| in the cells (n,): the mean of the differences at their two nodes."""
    at_nodes = np.abs(np.diff(enclose(u, ends)) / measure_distances(x))
    return 0.5 * (at_nodes[1:] + at_nodes[:-1])


def move_by_equation(
    x: np.ndarray, steep: np.ndarray, dt: float, tau: float, strength: float
) -> np.ndarray:
    """Nodes after `dt` at speeds s: `tau W s_qq + (w x_q)_q = 0`, w from the gradient `steep`.

    Implicit in x, with w lagged: with r = tau W/dt, `(w + r) h_new - r h_old` is the same C for all
    spacings h.  The sum of the spacings gives C, and positive spacings stay positive.
    """
    weight = weigh_gradient(x, steep, strength)
    inertia = tau / dt * weight.max()
    kept = inertia * np.diff(x) / (weight + inertia)
    room = (x[-1] - x[0] - kept.sum()) / (1.0 / (weight + inertia)).sum()
    steps = room / (weight + inertia) + kept
    placed = x[0] + np.append(0.0, np.cumsum(steps))
    placed[-1] = x[-1]
    return placed


def follow_last_move(x: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Nodes that continue their motion from `last` to `x`, all slower if a cell would collapse."""
    steps = np.diff(x)
    change = np.diff(x - last)
    closing = float((change / steps).min())
    followed_fraction = (
        1.0 if closing >= LEAST_CELL_SHRINKAGE - 1.0 else (LEAST_CELL_SHRINKAGE - 1.0) / closing
    )
    return x + followed_fraction * (x - last)


@dataclass(frozen=True)
class Placing:
    """How the nodes of the moving families are placed.

    Strength of the monitor, bound on the ratio of neighbours (None: default), fraction of a
    correction applied, tau of the mesh equation [s]; start: whether `after` knows the speeds of its
    nodes at t = 0 ("moving") or begins from "rest".
    """

    strength: float = 2.0
    ratio: float | None = None
    relaxation: float = 0.7
    tau: float = 0.005
    start: str = "moving"

    def correct(self, x: np.ndarray, steep: np.ndarray) -> np.ndarray:
        """The axis after one correction by the gradient `steep` (n,)."""
        options = {"strength": self.strength, "ratio": self.ratio, "relaxation": self.relaxation}
        return correct_axis("monitor", x, steep, **options)


class FrontColumn:
    """One family's grid and solution: x (n + 1,), u (n,), and the history that it needs."""

    def __init__(self, family: str, x: np.ndarray, u: np.ndarray):
        self.family = family
        self.x = x
        self.u = u
        self.last = x.copy()  # the nodes a step ago
        self.through = 0.0  # inflow (sum of u dx) so far
        self.iterations = 0

    def get_cells(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Nodes and fields, for pictures and dumps."""
        return self.x, {"u": self.u, "step": np.diff(self.x)}

    def advance(self, placing: Placing, viscosity: float, t: float, dt: float, ends: Ends) -> None:
        """One step of `dt` from `t`, with the family's placement of nodes."""
        x = self.x
        if self.family == "fixed":
            target = x
        elif self.family == "after":
            target = follow_last_move(x, self.last)
        else:
            steep = measure_gradient(x, self.u, ends(t))
            if self.family == "law":
                target = move_by_equation(x, steep, dt, placing.tau, placing.strength)
            else:
                target = placing.correct(x, steep)
        step = step_front(x, target, self.u, viscosity, t, dt, ends)
        self.u = step.u
        self.iterations = step.iterations
        self.through += step.through
        self.last = x
        self.x = target
        if self.family == "after":
            self.x = placing.correct(target, measure_gradient(target, self.u, ends(t + dt)))


class Exact(Protocol):
    """The race's initial and boundary values."""

    viscosity: float

    def compute_values(self, x: np.ndarray, t: float) -> np.ndarray: ...

    def compute_cell_averages(self, nodes: np.ndarray, t: float) -> np.ndarray: ...


class FrontRace:
    """An Evolution of four columns with `cells` cells from 0 to 1, steps of `dt` [s]."""

    def __init__(
        self, exact: Exact, cells: int, dt: float, t_end: float, placing: Placing | None = None
    ):
        self.exact = exact
        self.placing = placing or Placing()
        self.t = 0.0
        self.step = 0
        self.t_end = t_end
        self.steps = max(1, int(np.ceil(t_end / dt * (1.0 - 1e-12))))
        resting = np.linspace(0.0, 1.0, cells + 1)
        moving = self._place(resting, 0.0)
        self.columns = []
        for family in FAMILIES:
            x = resting if family == "fixed" else moving
            self.columns.append(FrontColumn(family, x.copy(), exact.compute_cell_averages(x, 0.0)))
            if family == "after" and self.placing.start == "moving":
                self.columns[-1].last = self._place(x, -self.t_end / self.steps)
        described = {"u": ("m/s", "velocity"), "step": ("m", "length of the cell")}
        self.blocks = [
            RowBlock(
                one.family,
                one.get_cells,
                described,
                DRAWN_BLOCK_GAP * row,
                DRAWN_BLOCK_GAP * row + DRAWN_BLOCK_HEIGHT,
            )
            for row, one in enumerate(self.columns)
        ]

    def _place(self, x: np.ndarray, t: float) -> np.ndarray:
        """Axis of the moving families for the exact solution at t, starting from the axis x."""
        for _ in range(FIRST_CORRECTIONS):
            means = self.exact.compute_cell_averages(x, t)
            last = x
            x = self.placing.correct(x, measure_gradient(x, means, self.ends(t)))
            if np.abs(x - last).max() < PLACED_NODE_MOVE:
                break
        return x

    def ends(self, t: float) -> np.ndarray:
        """u at both ends at time t."""
        return self.exact.compute_values(np.array([0.0, 1.0]), t)

    @property
    def finished(self) -> str | None:
        return "t_end reached" if self.step >= self.steps else None

    def start_row(self) -> dict[str, float]:
        return self._totals()

    def advance(self) -> dict[str, float | int | str]:
        after = self.t_end if self.step + 1 == self.steps else self._time(self.step + 1)
        dt = after - self.t
        row = {}
        for column in self.columns:
            begun = time.thread_time()
            try:
                column.advance(self.placing, self.exact.viscosity, self.t, dt, self.ends)
            except RunFailure as failure:
                raise RunFailure(
                    f"block '{column.family}', {failure}",
                    cause=failure.cause,
                    place=Place(column.family, failure.place.cell) if failure.place else None,
                ) from failure
            row[f"seconds_{column.family}"] = time.thread_time() - begun
        self.t = after
        self.step = self.step + 1
        iterations = {f"iterations_{one.family}": one.iterations for one in self.columns}
        return {"t": self.t, "dt": dt, "dt_limit": "cfl", **self._totals(), **iterations, **row}

    def _time(self, step: int) -> float:
        return self.t_end * (step / self.steps)

    def _totals(self) -> dict[str, float]:
        """Sums of u dx, and the inflow through the ends from the fluxes of the steps."""
        totals = {}
        for column in self.columns:
            totals[f"total_u_{column.family}"] = float(column.u @ np.diff(column.x))
            totals[f"boundary_u_{column.family}"] = column.through
        return totals

    def measure_errors(self) -> dict[str, float]:
        """Mean |u - exact| over the column [m2/s] for each family."""
        errors = {}
        for column in self.columns:
            wrong = column.u - self.exact.compute_cell_averages(column.x, self.t)
            errors[f"error_{column.family}"] = float(np.abs(wrong) @ np.diff(column.x))
        return errors

    def get_state(self) -> dict[str, np.ndarray | float | int]:
        state: dict[str, np.ndarray | float | int] = {"t": self.t, "step": self.step}
        for column in self.columns:
            for name in ("x", "last", "u", "through", "iterations"):
                state[f"{column.family}/{name}"] = getattr(column, name)
        return state

    def set_state(self, state) -> None:
        self.t = float(state["t"])
        self.step = int(state["step"])
        for column in self.columns:
            for name in ("x", "last", "u"):
                setattr(column, name, np.array(state[f"{column.family}/{name}"], dtype=float))
            column.through = float(state[f"{column.family}/through"])
            column.iterations = int(state[f"{column.family}/iterations"])
