"""Columns of cells whose nodes may move: the slot between vertical plates.

A uniform through-flow U crosses it (suction at one wall, injection at the other); the
flow v(x) along it is driven by the temperature T(x):

    dT/dt + U dT/dx = kappa d2T/dx2
    dv/dt + U dv/dx = nu d2v/dx2 + b (T - T0)

with T given at both walls, v = 0 there, and T0 (the pressure gradient along the slot) such that the
mean of v has a given value.  T and v are cell averages, and

    F = s (T_l + T_r)/2 - kappa A(Pe) (T_r - T_l)/d,      Pe = s d/kappa,  s = U - node speed

is the flux between two neighbours a distance d apart (centres, or wall and centre).  A is
`exponential` Pe/2 coth(Pe/2), exact without heat sources between the two points; `samarskii` R +
1/(1 + R), R = |Pe|/2, as in [Polevikov1983]; `upwind` 1 + R, first order only; `central` 1, which
oscillates from cell to cell for Pe > 2.  All but the last have A >= |Pe|/2: the matrix is an
M-matrix at any Pe, so no oscillations arise.

Note: "no oscillation" is not "resolved".  At Pe = 50 the layer lies inside one cell; T is exact
outside it, but v in a closed slot is driven by that layer alone and has an error of order one
everywhere.  A grid that follows the gradient resolves both.  The speed that a grid follows is that
of the fluid including the through-flow (theory R11.3); a strong through-flow makes the grid
uniform.

On the way to the steady state, each step first moves the nodes by one correction of the axis, then
solves on the moving cells.  Steps are implicit and grow until the solution is steady;
`settle_column` instead alternates steady solves and corrections ([Polevikov1983]).

Sources: [Samarskii1977], [Ilin1969], [ScharfetterGummel1969]; [AndersonTannehillPletcher1984]
§10.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from shockgrid.hydro.convection.tensor_grids import (
    compute_neighbour_ratio,
    correct_axis,
)
from shockgrid.regrid.errors import BadInput

SCHEMES = ("exponential", "samarskii", "upwind", "central")
STEADY_CHANGE = 1e-12  # relative change in a time L^2/kappa below which the state is steady
RESTING_NODE_MOVE = 2e-14  # of the axis: nodes that move by less between steady solves have settled
COLUMN_STEP_GROWTH = 1.25  # of dt from step to step
FIRST_STEP_PART = 1e-4  # first dt over L^2/kappa
LONGEST_STEP_PART = 0.01  # of the whole time: the grid needs a number of steps to settle
# of the blocks in pictures, one above the other
DRAWN_BLOCK_HEIGHT = 0.08
DRAWN_BLOCK_GAP = 0.1


@dataclass(frozen=True)
class Column:
    """The fluid, the walls and the scheme; SI units.

    viscosity nu, diffusivity kappa [m2/s]; buoyancy b = gravity times expansion [m/s2/K], 0: none;
    through_flow U [m/s], positive from the first wall to the second; temperatures of the two walls
    [K]; mean_speed of v [m/s].
    """

    viscosity: float
    diffusivity: float
    buoyancy: float
    through_flow: float = 0.0
    temperatures: tuple[float, float] = (0.5, -0.5)
    mean_speed: float = 0.0
    scheme: str = "exponential"

    def __post_init__(self):
        """Raises BadInput for nu or kappa not positive, unknown schemes, infinite numbers."""
        for name in ("viscosity", "diffusivity"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise BadInput(f"the fluid's {name} is {value:g}; it must be positive")
        numbers = (self.buoyancy, self.through_flow, self.mean_speed, *self.temperatures)
        if not np.isfinite(numbers).all():
            raise BadInput("buoyancy, through-flow, mean speed and wall temperatures are numbers")
        if self.scheme not in SCHEMES:
            raise BadInput(f"there is no scheme {self.scheme!r}; there are: {', '.join(SCHEMES)}")


def fit_diffusion(scheme: str, peclet: np.ndarray) -> np.ndarray:
    """The factor A(Pe) of the diffusivity for each of `peclet`; see the module."""
    half = 0.5 * np.abs(peclet)
    if scheme == "exponential":
        safe = np.maximum(half, 1e-4)  # below it two terms of the series are exact
        return np.where(half < 1e-4, 1.0 + half**2 / 3.0, safe / np.tanh(safe))
    if scheme == "samarskii":
        return half + 1.0 / (1.0 + half)
    return 1.0 + half if scheme == "upwind" else np.ones_like(half)


def assemble_transport(
    x: np.ndarray, speed: np.ndarray, diffusivity: float, scheme: str
) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and wall coefficients of `F[i+1/2] - F[i-1/2]`, net outflow of the cells.

    x (n + 1,) [m]; speed (n + 1,) [m/s] of the fluid past the nodes.  Returns the bands (3, n) in
    the order of scipy's `solve_banded`, and the outflow (2,) of the first and the last cell for
    unit wall values [m/s].
    """
    distance = measure_distances(x)
    spread = diffusivity * fit_diffusion(scheme, speed * distance / diffusivity) / distance
    # the flux is from_left times the value on the left plus from_right times that on the right
    from_left = 0.5 * speed + spread
    from_right = 0.5 * speed - spread
    return make_bands(from_left, from_right), np.array([-from_left[0], from_right[-1]])


def make_bands(by_left, by_right, sizes=0.0) -> np.ndarray:
    """Bands (3, n) for `solve_banded` of sizes + the net outflow of n cells, whose n + 1 fluxes
    have these derivatives with respect to the values on their left and right."""
    bands = np.zeros((3, by_left.size - 1))
    bands[0, 1:] = by_right[1:-1]
    bands[2, :-1] = -by_left[1:-1]
    bands[1] = sizes + by_left[1:] - by_right[:-1]
    return bands


def measure_distances(x: np.ndarray) -> np.ndarray:
    """Distances (n + 1,) between the cell centres (or walls) on either side of each node."""
    return np.diff(get_places(x))


def get_places(x: np.ndarray) -> np.ndarray:
    """Cell centres with both walls as ends (n + 2,)."""
    return enclose(0.5 * (x[1:] + x[:-1]), x[[0, -1]])


def enclose(values: np.ndarray, ends) -> np.ndarray:
    """Cell values (n,) with those at the two ends added (n + 2,)."""
    return np.concatenate([ends[:1], values, ends[1:]])


def compute_wall_fluxes(
    x: np.ndarray,
    values: np.ndarray,
    walls: tuple[float, float],
    column: Column,
    diffusivity: float,
) -> tuple[float, float]:
    """Fluxes F through the first and the last node, positive along x [value m/s]."""
    half = 0.5 * np.diff(x)[[0, -1]]
    factor = fit_diffusion(column.scheme, column.through_flow * half / diffusivity)
    spread = diffusivity * factor / half
    mean = 0.5 * column.through_flow * (values[[0, -1]] + np.array(walls))
    return (
        float(mean[0] - spread[0] * (values[0] - walls[0])),
        float(mean[1] - spread[1] * (walls[1] - values[-1])),
    )


def step_column(
    column: Column,
    x_old: np.ndarray,
    x: np.ndarray,
    temperature: np.ndarray,
    velocity: np.ndarray,
    dt: float,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Temperature [K], velocity [m/s] (n,) and T0 [K] after an implicit step of `dt` [s].

    The nodes move from x_old to x (n + 1,) during the step, and the fluxes are relative to them, so
    a uniform temperature stays uniform to round-off.  An infinite `dt` gives the steady state on x.
    First order in time.
    """
    steady = math.isinf(dt)
    speed = column.through_flow - (0.0 if steady else (x - x_old) / dt)
    speed = np.broadcast_to(speed, x.shape)
    inverse_times = 0.0 * np.diff(x) if steady else np.diff(x) / dt
    inverse_times_old = inverse_times if steady else np.diff(x_old) / dt

    bands, walls = assemble_transport(x, speed, column.diffusivity, column.scheme)
    bands[1] += inverse_times
    heat = inverse_times_old * temperature
    heat[[0, -1]] -= walls * np.array(column.temperatures)
    temperature = solve_banded((1, 1), bands, heat)

    # v is linear in T0: one part without it, one for T0 = -1, combined for the given mean.
    bands, _ = assemble_transport(x, speed, column.viscosity, column.scheme)
    bands[1] += inverse_times
    steps = np.diff(x)
    forced = inverse_times_old * velocity + column.buoyancy * temperature * steps
    velocities = solve_banded((1, 1), bands, np.stack([forced, steps], axis=1))
    forced_mean, lift_mean = steps @ velocities
    lift = (column.mean_speed * (x[-1] - x[0]) - forced_mean) / lift_mean
    velocity = velocities[:, 0] + lift * velocities[:, 1]
    reference = -lift / column.buoyancy if column.buoyancy != 0.0 else 0.0
    return temperature, velocity, reference


def solve_column(column: Column, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Steady temperature, velocity (n,) and T0 on the axis `x` (n + 1,)."""
    zero = np.zeros(x.size - 1)
    return step_column(column, x, x, zero, zero, math.inf)


def to_nodes(x: np.ndarray, values: np.ndarray, walls: tuple[float, float]) -> np.ndarray:
    """Values (n + 1,) at the nodes: linear between centres, `walls` at the ends."""
    return np.interp(x, get_places(x), enclose(values, walls))


def make_profile(column: Column, kind: str, x: np.ndarray, temperature, velocity):
    """Profile for `correct_axis` in the column: speed, gradient on the steps, or both.

    The gradient is the sum of those of T and v, each divided by its range.
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
    """Axis, T and v after alternating steady solves and corrections, and the number of these.

    options: those of `correct_axis`.  Ends when no node moves by more than RESTING_NODE_MOVE of the
    axis.
    """
    count = 0
    while count < corrections:
        count += 1
        temperature, velocity, _ = solve_column(column, x)
        profile = make_profile(column, kind, x, temperature, velocity)
        old = x
        x = correct_axis(kind, x, profile, **options)
        if np.abs(x - old).max() <= RESTING_NODE_MOVE * (x[-1] - x[0]):
            break
    temperature, velocity, _ = solve_column(column, x)
    return x, temperature, velocity, count


class RowBlock:
    """A column as pictures and dumps read it: a row of cells, one cell high.

    get_cells: () -> nodes x (n + 1,) [m] and fields by name, (n,) each; described: unit and long
    name of each field; low, high: y of the row [m].
    """

    def __init__(self, name: str, get_cells: Callable, described: Mapping, low, high):
        self.name = name
        self._get_cells = get_cells
        self._ends = np.array([low, high])
        self.units = {field: unit for field, (unit, _) in described.items()}
        self.long_names = {field: description for field, (_, description) in described.items()}

    @property
    def nodes(self) -> np.ndarray:
        return np.stack(np.meshgrid(self._get_cells()[0], self._ends, indexing="ij"))

    @property
    def cell_fields(self) -> dict[str, np.ndarray]:
        fields = self._get_cells()[1].items()
        return {name: np.ascontiguousarray(values[:, None]) for name, values in fields}


class ColumnMarch:
    """An Evolution: fluid at rest at the mean temperature between plates heated suddenly."""

    def __init__(
        self,
        column: Column,
        x: np.ndarray,
        t_end: float,
        kind: str = "uniform",
        every: int = 1,
        **options,
    ):
        """x (n + 1,) [m]: the initial axis; `kind`, `every`, `options`: how it is corrected."""
        self.column = column
        self.kind = kind
        self.every = every
        self.options = options
        self.t = 0.0
        self.step = 0
        self.t_end = t_end
        self.x = np.array(x, dtype=float)
        self.temperature = np.full(x.size - 1, 0.5 * sum(column.temperatures))
        self.velocity = np.zeros(x.size - 1)
        self.reference = self.heat_in = 0.0
        self.still = False
        self.dt = FIRST_STEP_PART * (x[-1] - x[0]) ** 2 / column.diffusivity
        described = {
            "T": ("K", "temperature"),
            "v": ("m/s", "velocity along the plates"),
            "peclet": ("1", "grid Péclet number of the through-flow"),
        }
        height = 0.2 * (x[-1] - x[0])
        self.blocks = [RowBlock("column", self._get_cells, described, 0.0, height)]

    def _get_cells(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        peclet = abs(self.column.through_flow) * np.diff(self.x) / self.column.diffusivity
        return self.x, {"T": self.temperature, "v": self.velocity, "peclet": peclet}

    @property
    def finished(self) -> str | None:
        if self.still:
            return "steady"
        return "t_end reached" if self.t >= self.t_end else None

    def start_row(self) -> dict[str, float]:
        return self._totals()

    def advance(self) -> dict[str, float | str]:
        column = self.column
        dt = self.dt
        limit = "growth" if dt < LONGEST_STEP_PART * self.t_end else "longest"
        if self.t + dt >= self.t_end * (1.0 - 1e-12):
            dt = self.t_end - self.t
            limit = "end"
        x = self.x
        corrected = self.step % self.every == 0
        if corrected:
            profile = make_profile(column, self.kind, x, self.temperature, self.velocity)
            x = correct_axis(self.kind, x, profile, **self.options)
        temperature, velocity, self.reference = step_column(
            column, self.x, x, self.temperature, self.velocity, dt
        )
        sizes = (x[-1] - x[0], np.ptp(column.temperatures) or 1.0, np.abs(velocity).max() or 1.0)
        changes = (x - self.x, temperature - self.temperature, velocity - self.velocity)
        change = max(
            float(np.abs(difference).max()) / size
            for difference, size in zip(changes, sizes, strict=True)
        )
        # per diffusive time, not per step: short steps change little even if unsteady
        change *= (x[-1] - x[0]) ** 2 / column.diffusivity / dt
        self.x = x
        self.temperature = temperature
        self.velocity = velocity
        inward, outward = compute_wall_fluxes(
            x, temperature, column.temperatures, column, column.diffusivity
        )
        self.heat_in += dt * (inward - outward)
        self.t = self.t_end if limit == "end" else self.t + dt
        self.step += 1
        self.dt = min(COLUMN_STEP_GROWTH * self.dt, LONGEST_STEP_PART * self.t_end)
        self.still = corrected and change < STEADY_CHANGE
        return {
            **{"t": self.t, "dt": dt, "dt_limit": limit, **self._totals(), "change": change},
            "flow": float(velocity @ np.diff(x)),
            "nusselt": 0.5 * (inward + outward) / column.diffusivity,
            "reference_temperature": self.reference,
            "least_step": float(np.diff(x).min()),
            "neighbour_ratio": compute_neighbour_ratio(x),
        }

    def _totals(self) -> dict[str, float]:
        # heat above that of the colder wall: the sum of T itself is zero in a symmetric slot
        above = self.temperature - min(self.column.temperatures)
        return {"total_heat": float(above @ np.diff(self.x)), "boundary_heat": self.heat_in}

    def get_state(self) -> dict[str, np.ndarray | float | int]:
        state = {name: getattr(self, name) for name in ("t", "step", "dt", "x", "reference")}
        state |= {"T": self.temperature, "v": self.velocity}
        return state | {"heat_in": self.heat_in, "still": int(self.still)}

    def set_state(self, state) -> None:
        self.t = float(state["t"])
        self.step = int(state["step"])
        self.dt = float(state["dt"])
        self.x, self.temperature, self.velocity = (
            np.array(state[name], dtype=float) for name in ("x", "T", "v")
        )
        self.reference = float(state["reference"])
        self.heat_in = float(state["heat_in"])
        self.still = bool(state["still"])
