"""Steady convection: Newton's iteration in stages of growing buoyancy, on an adaptive grid.

Every call of `iterate` is one Newton step with a sparse direct solution.  From rest, buoyancy grows
by factors of ten; a stage that does not converge is retried with half the factor (in the
logarithm).  At full buoyancy the grid is corrected every few iterations, as in [Polevikov1983], the
state is transferred to the new grid, and the iteration continues.  Note: a fluid heated from below
that starts at rest stays there, however unstable that is.

Between grids the stream function itself is interpolated, so mass is conserved on any grid.  For the
temperature the double integral from a corner is interpolated and differenced again, so the heat in
the box is conserved to round-off.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from shockgrid.hydro.convection.box import PAIRS, Axis, Fluid, fixes_temperature
from shockgrid.hydro.convection.equations import Equations, Factors
from shockgrid.hydro.convection.tensor_grids import check_kind, correct_tensor_grid
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.regrid.sides import SIDE_NAMES

FIRST_RAYLEIGH = 1e4  # Newton's iteration converges from rest up to here
ROUGH_STAGE_CHANGE = 1e-3  # change at which a stage before the last counts as converged
LONGEST_STAGE = 15  # iterations
LEAST_FACTOR = 1e-3  # of a stage, in the decimal logarithm
LEAST_CAUTION = 1e-3  # least fraction of a grid correction
GRID_CORRECTION_CHANGE = 1e-2  # change at which the grid is corrected
# of the solver's state
COUNTERS = ("iterations", "stage_iterations", "corrections")
NUMBERS = ("change", "stage_best", "grid_shift", "residual", "exponent", "factor", "caution")


def transfer(
    old: Equations, new: Equations, psi: np.ndarray, temperature: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(psi, temperature) on the grid of `new`, by cubic splines along both directions."""
    nodal = interpolate_nodes(old, new, expand_nodes(old, psi))
    heat = np.zeros(tuple(axis.cells + 1 for axis in old.axes))
    areas = old.areas.reshape(old.shape)
    heat[1:, 1:] = (areas * temperature.reshape(old.shape)).cumsum(axis=0).cumsum(axis=1)
    heat = interpolate_nodes(old, new, heat)
    content = np.diff(np.diff(heat, axis=0), axis=1)
    return restrict_nodes(new, nodal), content.ravel() / new.areas


def interpolate_nodes(old: Equations, new: Equations, values: np.ndarray) -> np.ndarray:
    """Values at all nodes, with both ends of a periodic axis, interpolated to those of `new`."""
    for k in (0, 1):
        values = CubicSpline(old.axes[k].nodes, values, axis=k)(new.axes[k].nodes)
    return values


def expand_nodes(equations: Equations, psi: np.ndarray) -> np.ndarray:
    """The stream function at all nodes, shape (nx + 1, ny + 1)."""
    shape = tuple(axis.node_count for axis in equations.axes)
    values = (equations.free @ psi).reshape(shape)
    return close_ends(equations, values)


def restrict_nodes(equations: Equations, values: np.ndarray) -> np.ndarray:
    """The unknowns (free,) of a stream function at all nodes (nx + 1, ny + 1)."""
    inside = values[tuple(slice(axis.node_count) for axis in equations.axes)].ravel()
    count = np.asarray(equations.free.sum(axis=0)).ravel()
    return (equations.free.T @ inside) / count


def close_ends(equations: Equations, values: np.ndarray) -> np.ndarray:
    """Values on the nodes, with the first ones of a periodic axis repeated at its end."""
    for k, axis in enumerate(equations.axes):
        if axis.periodic:
            values = np.concatenate([values, np.take(values, [0], axis=k)], axis=k)
    return values


def compute_nodal_fields(
    equations: Equations, psi: np.ndarray, temperature: np.ndarray, diffusivity: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u, v [m/s] and temperature [K] at the nodes, each (nx + 1, ny + 1), with the wall values."""
    u, v = equations.compute_velocities(psi)
    across, up = equations.axes
    u = to_nodes(up, u, 1, *(slip(equations, side) for side in PAIRS[1]))
    v = to_nodes(across, v, 0, *(slip(equations, side) for side in PAIRS[0]))
    heat = temperature.reshape(equations.shape)
    for k, sides in enumerate(PAIRS):
        ends = [wall_values(equations, side, heat, diffusivity, k) for side in sides]
        heat = to_nodes(equations.axes[k], heat, k, *ends)
    return (*(close_ends(equations, field) for field in (u, v, heat)),)


def slip(equations: Equations, side: str) -> float | None:
    """Velocity along a wall: 0, or None for a free one."""
    return None if equations.walls[side].flow == "free" else 0.0


def wall_values(
    equations: Equations, side: str, heat: np.ndarray, diffusivity: float, k: int
) -> np.ndarray | float:
    """Temperature of a wall at the points of `heat` along it; 0 for a periodic axis."""
    axis = equations.axes[k]
    cross = equations.axes[1 - k]
    if axis.periodic:
        return 0.0
    along = cross.centres
    if heat.shape[1 - k] != cross.cells:  # already on the nodes along the wall
        along = cross.nodes[: cross.node_count]
    temperature, flux = equations.walls[side].sample(along)
    if temperature is not None:
        return temperature
    end = 0 if side.endswith("min") else -1
    return np.take(heat, end, axis=k) + flux / diffusivity * axis.distances[end]


def to_nodes(axis: Axis, values: np.ndarray, k: int, low, high) -> np.ndarray:
    """Cell values along direction k interpolated linearly to its nodes; at walls `low`, `high`, or
    the nearest value if that is None."""
    cells = np.moveaxis(values, k, 0)
    nodal = axis.interpolate_to_nodes() @ cells
    if not axis.periodic:
        nodal[0] = cells[0] if low is None else low
        nodal[-1] = cells[-1] if high is None else high
    return np.moveaxis(nodal, 0, k)


@dataclass(frozen=True)
class GridControl:
    """How the grid adapts: kind of `tensor_grids`, and iterations or steps between corrections.

    `tolerance`: largest shift of a node, in mean spacings, at which the grid counts as settled.
    """

    kind: str = "uniform"
    every: int = 1
    tolerance: float = 1e-8
    options: Mapping[str, float | None] = field(default_factory=dict)

    def __post_init__(self):
        """Raises BadInput for an unknown kind or numbers out of range."""
        check_kind(self.kind)
        if self.every < 1:
            raise BadInput(f"a grid is corrected every {self.every} iterations; take 1 or more")

    @property
    def follows(self) -> bool:
        """Whether the grid depends on the solution."""
        return self.kind not in ("uniform", "clustered")

    def correct(
        self, equations: Equations, fluid: Fluid, psi: np.ndarray, temperature: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Both axes after one correction by the current solution."""
        across, up = (axis.nodes for axis in equations.axes)
        u, v, heat = compute_nodal_fields(equations, psi, temperature, fluid.diffusivity)
        return correct_tensor_grid(self.kind, across, up, u, v, heat, **self.options)


def sample_walls(equations: Equations):
    """(direction across it, temperature or None, flux) of every wall, at the cells along it."""
    for k, pair in enumerate(PAIRS):
        for side in pair:
            yield k, *equations.walls[side].sample(equations.axes[1 - k].centres)


def measure_difference(equations: Equations, fluid: Fluid) -> float:
    """Range of the walls' temperatures [K], or that which the largest given flux would cause."""
    known = []
    for k, temperature, flux in sample_walls(equations):
        if temperature is not None:
            known += [temperature.min(), temperature.max()]
        elif np.any(flux):
            known += [0.0, np.abs(flux).max() * equations.axes[k].length / fluid.diffusivity]
    return float(np.ptp(known)) if known else 0.0


def make_rest(equations: Equations) -> tuple[np.ndarray, np.ndarray]:
    """(psi, temperature) of a fluid at rest at the mean temperature of the isothermal walls."""
    psi, temperature = (np.zeros(size) for size in equations.sizes)
    means = [value.mean() for _, value, _ in sample_walls(equations) if value is not None]
    return psi, temperature + (float(np.mean(means)) if means else 0.0)


class SteadySolver:
    """Solver of a steady state: `equations`, `psi`, `temperature` are the current iterate."""

    def __init__(
        self,
        equations: Equations,
        fluid: Fluid,
        grid: GridControl | None = None,
        tolerance: float = 1e-10,
        start: tuple[np.ndarray, np.ndarray] | None = None,
    ):
        """Begin from rest, or at full buoyancy from `start` (psi, temperature).

        `tolerance`: relative change of the state at which it is steady.  Raises BadInput if the
        walls do not fix the temperature, so that no steady state is determined.
        """
        check_steady(equations)
        self.equations = equations
        self.target = fluid
        self.tolerance = tolerance
        self.grid = grid or GridControl()
        self.difference = measure_difference(equations, fluid) or 1.0
        self.iterations = self.stage_iterations = self.corrections = 0
        self.change = self.stage_best = self.grid_shift = math.inf
        self.residual = math.inf
        height = equations.axes[1].length
        rayleigh = fluid.compute_rayleigh(height, self.difference)
        # buoyancy is 10**exponent of the full one
        self.exponent = 0.0
        self.factor = 1.0
        if start is None:
            self.psi, self.temperature = make_rest(equations)
            if rayleigh > FIRST_RAYLEIGH:
                decades = math.ceil(math.log10(rayleigh / FIRST_RAYLEIGH) - 1e-9)
                self.exponent = -float(decades)
        else:
            self.psi, self.temperature = (np.array(values, dtype=np.float64) for values in start)
        self.good = (self.exponent, self.psi, self.temperature)
        self.before_correction: tuple | None = None  # equations, psi, temperature
        self.caution = 1.0  # fraction of each grid correction that is applied

    @property
    def fluid(self) -> Fluid:
        """The fluid of the current stage."""
        scale = 10.0**self.exponent
        wanted = self.target
        x, y = wanted.buoyancy
        return Fluid(wanted.viscosity, wanted.diffusivity, (scale * x, scale * y))

    @property
    def converged(self) -> bool:
        """Whether the state is steady at full buoyancy, and the grid settled."""
        settled = not self.grid.follows or self.grid_shift <= self.grid.tolerance
        return self.exponent == 0.0 and self.change <= self.tolerance and settled

    def iterate(self) -> None:
        """One Newton step, preceded by a grid correction if one is due.

        Raises RunFailure if no stage, however short, converges.
        """
        if self._is_correction_due():
            self._correct_grid()
        present = self.fluid, self.psi, self.temperature
        try:
            residual = self.equations.compute_residual(*present)
            jacobian = self.equations.compute_jacobian(*present)
            step = -Factors(jacobian, "Jacobian of the steady state").solve(
                np.concatenate(residual)
            )
        except RunFailure:
            if self.iterations == 0:
                raise
            self._take_back()
            return
        by_psi, by_temperature = np.split(step, self.equations.sizes[:1])
        self.psi = self.psi + by_psi
        self.temperature = self.temperature + by_temperature
        # a flow weaker than the diffusivity is scaled with that: at rest psi is pure round-off
        flow = max(float(np.abs(self.psi).max()), self.target.diffusivity)
        self.change = max(
            float(np.abs(by_psi).max()) / flow,
            float(np.abs(by_temperature).max()) / self.difference,
        )
        self.residual = float(np.abs(residual[1]).sum())
        self.residual /= self.target.diffusivity * self.difference
        self.iterations += 1
        self.stage_iterations += 1
        self.judge_stage()

    def judge_stage(self) -> None:
        """Go to the next stage, or back to the last good one."""
        self.stage_best = min(self.stage_best, self.change)
        if self.exponent < 0.0 and self.change <= ROUGH_STAGE_CHANGE:
            self.good = (self.exponent, self.psi, self.temperature)
            self.exponent = min(0.0, self.exponent + self.factor)
            self._begin_stage()
        elif not math.isfinite(self.change) or self.change > 1e3 * max(self.stage_best, 1.0):
            self._take_back()
        elif self.stage_iterations >= LONGEST_STAGE and self.change > ROUGH_STAGE_CHANGE:
            self._take_back()

    def _begin_stage(self) -> None:
        self.stage_iterations = 0
        self.stage_best = math.inf

    def _take_back(self) -> None:
        """Return to the last state that converged and take a shorter step from it."""
        if self.before_correction is not None:
            self._take_correction_back()
            return
        before, self.psi, self.temperature = self.good
        if before == self.exponent:  # the first stage itself: less buoyancy
            self.exponent = before - 1.0
            self.good = (self.exponent, self.psi, self.temperature)
        else:
            self.factor = 0.5 * (self.exponent - before)
            self.exponent = before + self.factor
        if self.factor < LEAST_FACTOR or self.exponent < -15.0:
            raise RunFailure(
                f"convection: no steady state was found beyond {10.0**before:.3g} of the buoyancy "
                "requested; it may not exist or be unsteady: march in time, or use more cells",
                cause="not-steady",
            )
        self._begin_stage()

    def _take_correction_back(self) -> None:
        """Return to the grid before the last correction, and halve all further ones."""
        self.equations, self.psi, self.temperature = self.before_correction
        self.caution *= 0.5
        if self.caution < LEAST_CAUTION:
            raise RunFailure(
                f"convection: the iteration diverges on every {self.grid.kind} grid near this one; "
                "take more cells",
                cause="not-steady",
            )
        self.change = self.residual = math.inf
        self._begin_stage()

    def _is_correction_due(self) -> bool:
        if not self.grid.follows or self.exponent < 0.0 or self.change > GRID_CORRECTION_CHANGE:
            return False
        return self.stage_iterations >= self.grid.every or not self.corrections

    def _correct_grid(self) -> None:
        """One correction of both axes; the state is transferred to the new grid."""
        old = self.equations
        wanted = self.grid.correct(old, self.target, self.psi, self.temperature)
        axes = [
            axis.nodes + self.caution * (new - axis.nodes)
            for axis, new in zip(old.axes, wanted, strict=True)
        ]
        self.before_correction = (old, self.psi, self.temperature)
        self.grid_shift = max(
            float(np.abs(new - axis.nodes).max()) * axis.cells / axis.length
            for new, axis in zip(axes, old.axes, strict=True)
        )
        self.corrections += 1
        self._begin_stage()
        if self.grid_shift == 0.0:
            return
        self.equations = Equations(*axes, old.walls)
        self.psi, self.temperature = transfer(old, self.equations, self.psi, self.temperature)

    def get_state(self) -> dict[str, np.ndarray | float | int]:
        """All that the next iteration depends on."""
        levels = {
            "now": (self.equations, self.psi, self.temperature),
            "good": (self.equations, *self.good[1:]),
            "before": self.before_correction or (self.equations, self.psi, self.temperature),
        }
        state: dict[str, np.ndarray | float | int] = {
            name: getattr(self, name) for name in (*COUNTERS, *NUMBERS)
        }
        state |= {"good_exponent": self.good[0], "corrected": int(bool(self.before_correction))}
        for name, (equations, psi, temperature) in levels.items():
            x, y = (axis.nodes for axis in equations.axes)
            state |= {f"{name}/x": x, f"{name}/y": y}
            state |= {f"{name}/psi": psi, f"{name}/temperature": temperature}
        return state

    def set_state(self, state: Mapping[str, np.ndarray | float | int]) -> None:
        """Restore a state of `get_state`."""
        walls = self.equations.walls
        for name in COUNTERS:
            setattr(self, name, int(state[name]))
        for name in NUMBERS:
            setattr(self, name, float(state[name]))
        levels = {}
        for name in ("now", "good", "before"):
            equations = Equations(state[f"{name}/x"], state[f"{name}/y"], walls)
            stored = (
                np.array(state[f"{name}/{name_of_field}"])
                for name_of_field in ("psi", "temperature")
            )
            levels[name] = (equations, *stored)
        self.equations, self.psi, self.temperature = levels["now"]
        self.good = (float(state["good_exponent"]), *levels["good"][1:])
        self.before_correction = levels["before"] if state["corrected"] else None

    def solve(self, most: int = 200) -> int:
        """Iterate until converged; returns the iterations.  Raises RunFailure after `most`."""
        while not self.converged:
            if self.iterations >= most:
                raise RunFailure(
                    f"convection: after {most} iterations the state still changes by "
                    f"{self.change:.1e}, the grid by {self.grid_shift:.1e} of a step",
                    cause="not-steady",
                )
            self.iterate()
        return self.iterations


def check_steady(equations: Equations) -> None:
    """Raise BadInput if the walls fix no temperature, so that no steady state is determined."""
    if fixes_temperature(equations.walls):
        return
    flows = (flux @ equations.axes[1 - k].widths for k, _, flux in sample_walls(equations))
    entering = float(sum(flows))
    if entering != 0.0:
        raise BadInput(
            f"the walls let {entering:.3g} K m2/s of heat in and none out, which no steady state "
            "can; make one wall isothermal or balance the fluxes"
        )
    raise BadInput(
        "no wall is isothermal, so that the steady temperature is fixed nowhere; make one so, "
        f"of {', '.join(SIDE_NAMES)}"
    )
