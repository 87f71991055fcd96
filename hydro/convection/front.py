"""A viscous front on nodes that move: one step of Burgers' equation, and three ways to place nodes.

    du/dt + d(u^2/2)/dx = nu d2u/dx2

on cells between nodes that go from x_old to x_new at constant speeds s during the step.  u are
means of cells; the flux past a node between neighbours l, r a distance d apart is

    G = (l^2 + r^2)/4 - s (l + r)/2 - nu A(Pe) (r - l)/d,      Pe = ((l + r)/2 - s) d/nu

with the exponential A of `hydro.convection.slot`: what goes by is carried by the speed
*past* the node, so nodes that go with a front see no convection there at all.  In time it is the
L-stable SDIRK method of order 2, (1, gamma = 1 - 1/sqrt 2), its first stage on the grid at t +
gamma dt; the swept volumes are those of the same step, so uniform u stays uniform and the sum of u
is kept to round-off (GCL).

The three families of theory R13, and nodes at rest beside them:

- after: nodes are placed after the step by what came out of it.  The speed in the step's fluxes is
  the backward difference of the last two placements: it lags, and where the placement differs from
  where that speed led, it carries u along.  Harmless while nodes go on as they went; whenever they
  speed up, start or turn, the equations are wrong by a shift, and the sum of u is not kept.
- law: a law for the speed of the nodes, integrated together with the flow; no lag in the equations.
  Here `tau W s_qq + (w x_q)_q = 0`, the equidistribution residual smoothed (theory R13.2),
  W the largest w; the nodes themselves lag behind their best places by about tau.
- first: nodes are placed first, by what is known, and the fluxes of the same step use where they
  go.  No lag in the equations, and the best places of the step before.

Note: the error of `after` is not roughness but a shift of the whole front; look at the sum.

`FrontRace` runs the families side by side, in equal steps from one start.

Sources: [AndersonTannehillPletcher1984] §10.4; [HuangRenRussell1994]; SDIRK: [Alexander1977].
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import solve_banded

from hydro.convection.slot import RowBlock, fit_diffusion, measure_distances
from hydro.convection.tensor_grids import correct_axis, weigh_gradient
from regrid.errors import Place, RunFailure

FAMILIES = ("fixed", "after", "law", "first")
GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
NEWTON = 30  # iterations at most; four are usual
LEAST = 0.2  # of a step's length: what the lagging speed may leave of it

Ends = Callable[[float], np.ndarray]


@dataclass(frozen=True)
class Step:
    """Means u (n,), what came in through the ends (sum of u dx), Newton iterations."""

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
    """G (n + 1,) past the nodes and its derivatives by the values on their left and right."""
    values = np.concatenate([ends[:1], u, ends[1:]])
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
    """One step of `dt` from `t` while the nodes (n + 1,) go from x_old to x_new; u (n,).

    ends: t -> u at both ends (2,), which stay where they are.  Raises RunFailure where Newton's
    method does not settle.
    """
    speed = (x_new - x_old) / dt
    before, stage_flux, through, iterations = np.diff(x_old) * u, 0.0, 0.0, 0
    tolerance = 1e-14 * float(np.abs(before).max()) + 1e-300
    bands = np.zeros((3, u.size))
    for place, earlier in ((GAMMA, 0.0), (1.0, 1.0 - GAMMA)):
        x = x_new if place == 1.0 else x_old + place * (x_new - x_old)
        sizes, outside = np.diff(x), ends(t + place * dt)
        values = np.concatenate([outside[:1], u, outside[1:]])
        past = 0.5 * (values[:-1] + values[1:]) - speed
        factor = fit_diffusion("exponential", past * measure_distances(x) / viscosity)
        for _ in range(NEWTON):
            flux, by_left, by_right = compute_fluxes(x, u, outside, speed, viscosity, factor)
            residual = sizes * u - before
            residual += dt * (earlier * stage_flux + GAMMA * np.diff(flux))
            if np.abs(residual).max() <= tolerance:
                break
            iterations += 1
            weight = GAMMA * dt
            bands[0, 1:] = weight * by_right[1:-1]
            bands[1] = sizes + weight * (by_left[1:] - by_right[:-1])
            bands[2, :-1] = -weight * by_left[1:-1]
            u = u - solve_banded((1, 1), bands, residual)
        else:
            worst = int(np.abs(residual).argmax())
            raise RunFailure(
                f"cell {worst}, t = {t:.4g} s: the implicit step did not settle in {NEWTON} "
                "iterations; a smaller cfl would let it",
                cause="implicit-step",
                place=Place("", (worst, 0)),  # who calls knows the column's name
            )
        stage_flux = np.diff(flux)
        through += (GAMMA if place == 1.0 else 1.0 - GAMMA) * dt * float(flux[0] - flux[-1])
    return Step(u, through, iterations)


def measure_gradient(x: np.ndarray, u: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Size of du/dx on the cells (n,): the mean of the differences at their two nodes."""
    values = np.concatenate([ends[:1], u, ends[1:]])
    at_nodes = np.abs(np.diff(values) / measure_distances(x))
    return 0.5 * (at_nodes[1:] + at_nodes[:-1])


def move_by_law(
    x: np.ndarray, steep: np.ndarray, dt: float, tau: float, strength: float
) -> np.ndarray:
    """Nodes after `dt` at the speeds s of `tau W s_qq + (w x_q)_q = 0`, w of the gradient `steep`.

    Implicit in x, with w as it was: `(w + r) h_new - r h_old` is the same C on all steps h, r =
    tau W/dt, so that the sum of steps gives C, and positive steps stay positive.
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
    """Nodes that go on as they went from `last` to `x`, all slower if a cell would close."""
    steps, change = np.diff(x), np.diff(x - last)
    closing = float((change / steps).min())
    part = 1.0 if closing >= LEAST - 1.0 else (LEAST - 1.0) / closing
    return x + part * (x - last)


@dataclass(frozen=True)
class Placing:
    """How the nodes of the moving families are placed.

    strength of the monitor, bound on the ratio of neighbours (None: usual), part of a correction
    made, tau of the law [s]; start: whether `after` knows the speeds of its nodes at t = 0
    ("moving") or begins from "rest".
    """

    strength: float = 2.0
    ratio: float | None = None
    relaxation: float = 0.7
    tau: float = 0.005
    start: str = "moving"

    def correct(self, x: np.ndarray, steep: np.ndarray) -> np.ndarray:
        """The axis after one correction by the gradient `steep` (n,)."""
        return correct_axis(
            "monitor",
            x,
            steep,
            strength=self.strength,
            ratio=self.ratio,
            relaxation=self.relaxation,
        )


class FrontColumn:
    """One family's grid and solution: x (n + 1,), u (n,), and what it needs of the past."""

    def __init__(self, family: str, x: np.ndarray, u: np.ndarray):
        self.family, self.x, self.u = family, x, u
        self.last = x.copy()  # where the nodes were a step ago
        self.through = 0.0  # sum of u dx that came in so far
        self.iterations = 0

    def get_cells(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Nodes and fields, for pictures and dumps."""
        return self.x, {"u": self.u, "step": np.diff(self.x)}

    def advance(self, placing: Placing, viscosity: float, t: float, dt: float, ends: Ends) -> None:
        """One step of `dt` from `t`, nodes placed as the family does."""
        x = self.x
        if self.family == "fixed":
            target = x
        elif self.family == "after":
            target = follow_last_move(x, self.last)
        else:
            steep = measure_gradient(x, self.u, ends(t))
            if self.family == "law":
                target = move_by_law(x, steep, dt, placing.tau, placing.strength)
            else:
                target = placing.correct(x, steep)
        step = step_front(x, target, self.u, viscosity, t, dt, ends)
        self.u, self.iterations = step.u, step.iterations
        self.through += step.through
        self.last, self.x = x, target
        if self.family == "after":
            self.x = placing.correct(target, measure_gradient(target, self.u, ends(t + dt)))


FIRST_CORRECTIONS = 60  # at most, of the moving grids to the solution at t = 0
SETTLED = 1e-10  # of the column: nodes that move by less have settled
HEIGHT, APART = 0.08, 0.1  # of the blocks in pictures, one above the other


class Exact(Protocol):
    """What the race starts from and takes at its ends."""

    viscosity: float

    def compute_values(self, x: np.ndarray, t: float) -> np.ndarray: ...

    def compute_cell_averages(self, nodes: np.ndarray, t: float) -> np.ndarray: ...


class FrontRace:
    """An Evolution of four columns with `cells` cells from 0 to 1, steps of `dt` [s]."""

    def __init__(
        self, exact: Exact, cells: int, dt: float, t_end: float, placing: Placing | None = None
    ):
        self.exact, self.placing = exact, placing or Placing()
        self.t, self.step, self.t_end = 0.0, 0, t_end
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
            RowBlock(one.family, one.get_cells, described, APART * row, APART * row + HEIGHT)
            for row, one in enumerate(self.columns)
        ]

    def _place(self, x: np.ndarray, t: float) -> np.ndarray:
        """The moving families' axis for the exact solution at t, found from the axis x."""
        for _ in range(FIRST_CORRECTIONS):
            means = self.exact.compute_cell_averages(x, t)
            last, x = x, self.placing.correct(x, measure_gradient(x, means, self.ends(t)))
            if np.abs(x - last).max() < SETTLED:
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
        dt, row = after - self.t, {}
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
        self.t, self.step = after, self.step + 1
        iterations = {f"iterations_{one.family}": one.iterations for one in self.columns}
        return {
            "t": self.t,
            "dt": dt,
            "dt_limit": "cfl",
            **self._totals(),
            **iterations,
            **row,
        }

    def _time(self, step: int) -> float:
        return self.t_end * (step / self.steps)

    def _totals(self) -> dict[str, float]:
        """Sums of u dx, and what came in through the ends by the fluxes of the steps."""
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
        self.t, self.step = float(state["t"]), int(state["step"])
        for column in self.columns:
            for name in ("x", "last", "u"):
                setattr(column, name, np.array(state[f"{column.family}/{name}"], dtype=float))
            column.through = float(state[f"{column.family}/through"])
            column.iterations = int(state[f"{column.family}/iterations"])
