"""A column between vertical plates marched to its steady state, on a grid that follows it.

A step places the nodes first, by one correction of the axis after the present T and v, then
solves on moving cells (`column.step_column`), so that the fluxes know where the nodes go.  Steps
are implicit and grow by a factor until nothing changes any more: the way there is right to first
order in time, its end is the steady solution on the settled grid.

`settle_column` is the same without time: a steady solve, a correction, and so on ([Polevikov1983]).

The trap: the speed that the grid follows is that of the fluid, through-flow and all (theory R11.3);
a strong through-flow is the same everywhere, and makes Polevikov's grid uniform.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hydro.convection.slot.column import (
    Column,
    compute_wall_fluxes,
    solve_column,
    step_column,
    to_nodes,
)
from hydro.convection.tensor_grids import compute_neighbour_ratio, correct_axis

SETTLED = 1e-12  # relative change in a time L^2/kappa below which nothing changes
RESTING = 2e-14  # of the axis: nodes that move by less, steady solve after solve, have settled
GROWTH = 1.25  # of dt from step to step
FIRST = 1e-4  # first dt over L^2/kappa
LONGEST = 0.01  # of the whole time: the grid needs steps to settle, however long they are


def make_profile(column: Column, kind: str, x: np.ndarray, temperature, velocity):
    """What `correct_axis` follows in the column: speed, gradient on the steps, or both.

    The gradient is the sum of those of T and v, each over its own range.
    """
    v = to_nodes(x, velocity, (0.0, 0.0))
    speed = np.hypot(v, column.through_flow)
    if kind not in ("monitor", "combined"):
        return speed
    steep = np.zeros(x.size - 1)
    for values in (v, to_nodes(x, temperature, column.temperatures)):
        extent = np.ptp(values)
        if extent > 0.0:
            steep += np.abs(np.diff(values) / np.diff(x)) / extent
    return steep if kind == "monitor" else (speed, steep)


def settle_column(
    column: Column, kind: str, x: np.ndarray, corrections: int = 200, **options
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Axis, T, v at the end of steady solves and corrections in turn, and how many those were.

    options: those of `correct_axis`.  Ends when no node moves by more than RESTING of the axis.
    """
    count = 0
    while count < corrections:
        count += 1
        temperature, velocity, _ = solve_column(column, x)
        profile = make_profile(column, kind, x, temperature, velocity)
        old, x = x, correct_axis(kind, x, profile, **options)
        if np.abs(x - old).max() <= RESTING * (x[-1] - x[0]):
            break
    temperature, velocity, _ = solve_column(column, x)
    return x, temperature, velocity, count


class ColumnBlock:
    """The column as pictures and dumps see it: cells one beside the other, one high."""

    name = "column"
    units: Mapping[str, str] = {"T": "K", "v": "m/s", "peclet": "1"}
    long_names: Mapping[str, str] = {
        "T": "temperature",
        "v": "velocity along the plates",
        "peclet": "grid Péclet number of the through-flow",
    }

    def __init__(self, march: ColumnMarch):
        self._march = march

    @property
    def nodes(self) -> np.ndarray:
        x = self._march.x
        height = 0.2 * (x[-1] - x[0])
        return np.stack(np.meshgrid(x, np.array([0.0, height]), indexing="ij"))

    @property
    def cell_fields(self) -> dict[str, np.ndarray]:
        march = self._march
        peclet = abs(march.column.through_flow) * np.diff(march.x) / march.column.diffusivity
        fields = {"T": march.temperature, "v": march.velocity, "peclet": peclet}
        return {name: np.ascontiguousarray(values[:, None]) for name, values in fields.items()}


class ColumnMarch:
    """An Evolution: fluid at rest at the mean temperature between plates that are suddenly hot."""

    def __init__(
        self,
        column: Column,
        x: np.ndarray,
        t_end: float,
        kind: str = "uniform",
        every: int = 1,
        **options,
    ):
        """`x` (n + 1,) [m] the first axis, `kind`, `every`, `options`: how it is corrected."""
        self.column, self.kind, self.every, self.options = column, kind, every, options
        self.t, self.step, self.t_end = 0.0, 0, t_end
        self.x = np.array(x, dtype=float)
        self.temperature = np.full(x.size - 1, 0.5 * sum(column.temperatures))
        self.velocity = np.zeros(x.size - 1)
        self.reference = self.heat_in = 0.0
        self.still = False
        self.dt = FIRST * (x[-1] - x[0]) ** 2 / column.diffusivity
        self.blocks = [ColumnBlock(self)]

    @property
    def finished(self) -> str | None:
        if self.still:
            return "steady"
        return "t_end reached" if self.t >= self.t_end else None

    def start_row(self) -> dict[str, float]:
        return self._totals()

    def advance(self) -> dict[str, float | str]:
        column, dt = self.column, self.dt
        limit = "growth" if dt < LONGEST * self.t_end else "longest"
        if self.t + dt >= self.t_end * (1.0 - 1e-12):
            dt, limit = self.t_end - self.t, "end"
        x, corrected = self.x, self.step % self.every == 0
        if corrected:
            profile = make_profile(column, self.kind, x, self.temperature, self.velocity)
            x = correct_axis(self.kind, x, profile, **self.options)
        temperature, velocity, self.reference = step_column(
            column, self.x, x, self.temperature, self.velocity, dt
        )
        sizes = (x[-1] - x[0], np.ptp(column.temperatures) or 1.0, np.abs(velocity).max() or 1.0)
        changes = (x - self.x, temperature - self.temperature, velocity - self.velocity)
        change = max(
            float(np.abs(one).max()) / size for one, size in zip(changes, sizes, strict=True)
        )
        # in a diffusive time, not in a step: short steps change little, steady or not
        change *= (x[-1] - x[0]) ** 2 / column.diffusivity / dt
        self.x, self.temperature, self.velocity = x, temperature, velocity
        inward, outward = compute_wall_fluxes(
            x, temperature, column.temperatures, column, column.diffusivity
        )
        self.heat_in += dt * (inward - outward)
        self.t = self.t_end if limit == "end" else self.t + dt
        self.step += 1
        self.dt = min(GROWTH * self.dt, LONGEST * self.t_end)
        self.still = corrected and change < SETTLED
        return {
            "t": self.t,
            "dt": dt,
            "dt_limit": limit,
            **self._totals(),
            "change": change,
            "flow": float(velocity @ np.diff(x)),
            "nusselt": 0.5 * (inward + outward) / column.diffusivity,
            "reference_temperature": self.reference,
            "least_step": float(np.diff(x).min()),
            "neighbour_ratio": compute_neighbour_ratio(x),
        }

    def _totals(self) -> dict[str, float]:
        # heat above that of the colder wall: the sum of T itself is zero in a symmetric slot
        above = self.temperature - min(self.column.temperatures)
        return {
            "total_heat": float(above @ np.diff(self.x)),
            "boundary_heat": self.heat_in,
        }

    def get_state(self) -> dict[str, np.ndarray | float | int]:
        return {
            "t": self.t,
            "step": self.step,
            "dt": self.dt,
            "x": self.x,
            "T": self.temperature,
            "v": self.velocity,
            "reference": self.reference,
            "heat_in": self.heat_in,
            "still": int(self.still),
        }

    def set_state(self, state) -> None:
        self.t, self.step, self.dt = float(state["t"]), int(state["step"]), float(state["dt"])
        self.x, self.temperature, self.velocity = (
            np.array(state[name], dtype=float) for name in ("x", "T", "v")
        )
        self.reference, self.heat_in = float(state["reference"]), float(state["heat_in"])
        self.still = bool(state["still"])
