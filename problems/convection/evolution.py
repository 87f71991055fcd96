"""Convecting boxes as `runs` sees them: towards a steady state, or in time.

A steady run counts Newton iterations as its steps, and as its time as well.  The trap: what its
history shows before the end are iterates, most of them at a smaller Rayleigh number than the
deck's; the column `buoyancy` says what part of the wanted one has been reached.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hydro.convection.box import Fluid
from hydro.convection.equations import Equations
from hydro.convection.march import March
from hydro.convection.steady import GridControl, SteadySolver, expand_nodes

MOST_ITERATIONS = 200
LARGEST_SHIFT = 0.1  # of a node in one step of the time march, in its shorter neighbouring step


class ConvectionBlock:
    """The box with its present grid and state."""

    units: Mapping[str, str] = {"T": "K", "u": "m/s", "v": "m/s", "psi": "m2/s"}
    long_names: Mapping[str, str] = {"T": "temperature", "psi": "stream function"}

    def __init__(self, name: str, equations: Equations, psi: np.ndarray, temperature: np.ndarray):
        self.name, self.equations = name, equations
        self.psi, self.temperature = psi, temperature
        x, y = (axis.nodes for axis in equations.axes)
        self.nodes = np.array(np.meshgrid(x, y, indexing="ij"))

    @property
    def cell_fields(self) -> dict[str, np.ndarray]:
        """Temperature, and velocities as means of the cells' faces."""
        means = []
        for k, part in enumerate(self.equations.compute_velocities(self.psi)):
            axis = self.equations.axes[k]
            means.append(np.moveaxis(axis.average_to_cells() @ np.moveaxis(part, k, 0), 0, k))
        heat = self.temperature.reshape(self.equations.shape)
        return {"T": heat, "u": means[0], "v": means[1]}

    @property
    def node_fields(self) -> dict[str, np.ndarray]:
        return {"psi": expand_nodes(self.equations, self.psi)}


def measure_mass(equations: Equations, psi: np.ndarray) -> float:
    """Largest volume that is lost or made in a cell, relative to the largest flux."""
    largest = float(np.abs(equations.momentum.curl @ psi).max())
    return float(np.abs(equations.compute_divergence(psi)).max()) / (largest or 1.0)


class SteadyEvolution:
    """Newton's iterations towards a steady state."""

    def __init__(self, name: str, solver: SteadySolver, most: int = MOST_ITERATIONS):
        self.name, self.solver = name, solver
        self.t_end = float(most)

    @property
    def fluid(self) -> Fluid:
        """The fluid of the present stage."""
        return self.solver.fluid

    @property
    def equations(self) -> Equations:
        return self.solver.equations

    @property
    def psi(self) -> np.ndarray:
        return self.solver.psi

    @property
    def temperature(self) -> np.ndarray:
        return self.solver.temperature

    @property
    def step(self) -> int:
        return self.solver.iterations

    @property
    def t(self) -> float:
        return float(self.solver.iterations)

    @property
    def finished(self) -> str | None:
        if self.solver.converged:
            return "steady"
        return f"all {self.t_end:g} iterations made" if self.t >= self.t_end else None

    @property
    def missed(self) -> str:
        """What a run that ends now has not reached."""
        return "" if self.solver.converged else "not steady"

    @property
    def blocks(self) -> list[ConvectionBlock]:
        return [ConvectionBlock(self.name, self.equations, self.psi, self.temperature)]

    def advance(self) -> dict[str, float | int | str]:
        """One Newton step; RunFailure where it fails."""
        before = self.step
        while self.step == before:  # an iteration taken back is not a step
            self.solver.iterate()
        solver = self.solver
        shift = solver.grid_shift if math.isfinite(solver.grid_shift) else 0.0
        return {
            "t": self.t,
            "dt": 1.0,
            "dt_limit": "newton",
            "buoyancy": 10.0**solver.exponent,
            "change": solver.change,
            "residual": solver.residual,
            "mass_residual": measure_mass(self.equations, self.psi),
            "grid_corrections": solver.corrections,
            "grid_shift": shift,
        }

    def get_state(self):
        return self.solver.get_state()

    def set_state(self, state) -> None:
        self.solver.set_state(state)


class TimeEvolution:
    """The time march; the grid may move towards the one its solution asks for."""

    def __init__(
        self, name: str, march: March, grid: GridControl, t_end: float, coldest: float = 0.0
    ):
        """`coldest` [K]: heat is counted from there, so that its total is no small difference."""
        self.name, self.march, self.grid, self.t_end = name, march, grid, t_end
        self.coldest = coldest

    @property
    def fluid(self) -> Fluid:
        return self.march.fluid

    @property
    def equations(self) -> Equations:
        return self.march.equations

    @property
    def psi(self) -> np.ndarray:
        return self.march.level.psi

    @property
    def temperature(self) -> np.ndarray:
        return self.march.level.temperature

    @property
    def step(self) -> int:
        return self.march.step

    @property
    def t(self) -> float:
        return self.march.t

    @property
    def finished(self) -> str | None:
        return "t_end reached" if self.t >= self.t_end else None

    @property
    def blocks(self) -> list[ConvectionBlock]:
        return [ConvectionBlock(self.name, self.equations, self.psi, self.temperature)]

    def start_row(self) -> dict[str, float]:
        return self._totals()

    def _totals(self) -> dict[str, float]:
        level = self.march.level
        content = float((level.equations.areas * (level.temperature - self.coldest)).sum())
        return {"total_heat": content, "boundary_heat": level.entered}

    def advance(self) -> dict[str, float | int | str]:
        """One step in time; RunFailure where it fails."""
        march = self.march
        remaining = self.t_end - march.t
        dt = march.choose_step(remaining)
        axes = self._move_grid()
        last = dt == remaining
        shift = 0.0
        if axes is not None:
            shift = max(
                float(np.abs(new - axis.nodes).max()) * axis.cells / axis.length
                for new, axis in zip(axes, self.equations.axes, strict=True)
            )
        march.advance(dt, axes)
        if last:
            march.t = self.t_end
        return {
            "t": self.t,
            "dt": dt,
            "dt_limit": march.limit,
            **self._totals(),
            "mass_residual": measure_mass(self.equations, self.psi),
            "grid_shift": shift,
        }

    def _move_grid(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Axes nearer to those that the solution asks for; None where the grid stays."""
        moving = self.grid.follows and self.step % self.grid.every == 0
        if not moving or not np.any(self.psi):
            return None
        wanted = self.grid.correct(self.equations, self.fluid, self.psi, self.temperature)
        axes = []
        for new, axis in zip(wanted, self.equations.axes, strict=True):
            shift = new - axis.nodes
            room = np.minimum(axis.widths[1:], axis.widths[:-1])
            fastest = float((np.abs(shift[1:-1]) / room).max())
            axes.append(axis.nodes + min(1.0, LARGEST_SHIFT / max(fastest, 1e-300)) * shift)
        return tuple(axes)

    def get_state(self):
        return self.march.get_state()

    def set_state(self, state) -> None:
        self.march.set_state(state)
