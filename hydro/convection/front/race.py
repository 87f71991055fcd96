"""The families of `hydro.convection.front.column` side by side, in equal steps from one start."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from hydro.convection.front.column import FAMILIES, FrontColumn, Placing, measure_gradient
from regrid.errors import Place, RunFailure

FIRST_CORRECTIONS = 60  # at most, of the moving grids to the solution at t = 0
SETTLED = 1e-10  # of the column: nodes that move by less have settled
HEIGHT, APART = 0.08, 0.1  # of the blocks in pictures, one above the other


class Exact(Protocol):
    """What the race starts from and takes at its ends."""

    viscosity: float

    def compute_values(self, x: np.ndarray, t: float) -> np.ndarray: ...

    def compute_cell_averages(self, nodes: np.ndarray, t: float) -> np.ndarray: ...


class FrontBlock:
    """A family as pictures and dumps see it: one row of cells above the other families'."""

    units: Mapping[str, str] = {"u": "m/s", "step": "m"}
    long_names: Mapping[str, str] = {"u": "velocity", "step": "length of the cell"}

    def __init__(self, column: FrontColumn, row: int):
        self.name, self._column, self._row = column.family, column, row

    @property
    def nodes(self) -> np.ndarray:
        low = APART * self._row
        return np.stack(np.meshgrid(self._column.x, np.array([low, low + HEIGHT]), indexing="ij"))

    @property
    def cell_fields(self) -> dict[str, np.ndarray]:
        fields = {"u": self._column.u, "step": np.diff(self._column.x)}
        return {name: np.ascontiguousarray(values[:, None]) for name, values in fields.items()}


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
        self.blocks = [FrontBlock(column, row) for row, column in enumerate(self.columns)]

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
