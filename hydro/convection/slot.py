"""Convection between vertical plates: one column of cells across a tall slot, walls at its ends.

Across the slot blows a uniform through-flow U (suction at one wall, injection at the other); along
it rises v(x), driven by the temperature T(x), so that

    dT/dt + U dT/dx = kappa d2T/dx2
    dv/dt + U dv/dx = nu d2v/dx2 + b (T - T0)

with T given at both walls, v = 0 there, and T0 (the pressure gradient along the slot) such that
the mean of v is the given one: 0 in a slot closed far away.  Both are solved in conservation form
on cells that may move; T and v are means of cells, and

    F = s (T_l + T_r)/2 - kappa A(Pe) (T_r - T_l)/d,      Pe = s d/kappa,  s = U - node speed

is the flux between two neighbours a distance d apart (centres; at a wall, wall and centre).  What
makes the scheme is A:

- exponential  Pe/2 coth(Pe/2): exact where no heat is born between the two points, so that steady
  temperatures are exact at all centres, on any grid, at any Pe (sources below).
- samarskii    R + 1/(1 + R), R = |Pe|/2: without an exponential function; [Polevikov1983] knows it.
- upwind       1 + R: first order only.
- central      1: swings from cell to cell where Pe > 2.

Each but the last has A >= |Pe|/2: its matrix is an M-matrix at any Pe, a maximum principle holds
and no swing can begin.  Each but upwind has A = 1 + O(Pe^2), which is second order.

Note: "no oscillation" is not "resolved".  At Pe = 50 the layer lies inside one cell; T is exact
outside of it, but v of a closed slot is driven by that layer alone and comes out wrong by its own
size everywhere.  A grid that follows the gradient resolves both.

Marched to its steady state on a grid that follows it, a step places the nodes first, by one
correction of the axis after the present T and v, then solves on moving cells, so that the fluxes
know where the nodes go.  Steps are implicit and grow by a factor until nothing changes any more:
the way there is right to first order in time, its end is the steady solution on the settled grid.
`settle_column` is the same without time: a steady solve, a correction, and so on ([Polevikov1983]).
Note: the speed that the grid follows is that of the fluid, through-flow and all (theory R11.3);
a strong through-flow is the same everywhere, and makes Polevikov's grid uniform.

Sources: [Samarskii1977], [Ilin1969], [ScharfetterGummel1969].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from hydro.convection.tensor_grids import compute_neighbour_ratio, correct_axis
from regrid.errors import BadInput

SCHEMES = ("exponential", "samarskii", "upwind", "central")


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
        """Raises BadInput for transport that is not positive, unknown schemes, infinite numbers."""
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
    """The factor A(Pe) of the diffusivity for each of `peclet`, as the module says."""
    half = 0.5 * np.abs(peclet)
    if scheme == "exponential":
        safe = np.maximum(half, 1e-4)  # below that two terms of the series are exact
        return np.where(half < 1e-4, 1.0 + half**2 / 3.0, safe / np.tanh(safe))
    if scheme == "samarskii":
        return half + 1.0 / (1.0 + half)
    return 1.0 + half if scheme == "upwind" else np.ones_like(half)


def assemble_transport(
    x: np.ndarray, speed: np.ndarray, diffusivity: float, scheme: str
) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and wall coefficients of `F[i+1/2] - F[i-1/2]`, net outflow of the cells.

    x (n + 1,) [m]; speed (n + 1,) [m/s] of the fluid past the nodes.  Returns the bands (3, n) in
    the order of scipy's `solve_banded`, and (2,): outflow of the first and the last cell for unit
    values at their walls [m/s].
    """
    distance = measure_distances(x)
    spread = diffusivity * fit_diffusion(scheme, speed * distance / diffusivity) / distance
    from_left, from_right = 0.5 * speed + spread, 0.5 * speed - spread  # F = l T_l + r T_r
    bands = np.zeros((3, x.size - 1))
    bands[0, 1:] = from_right[1:-1]
    bands[1] = from_left[1:] - from_right[:-1]
    bands[2, :-1] = -from_left[1:-1]
    return bands, np.array([-from_left[0], from_right[-1]])


def measure_distances(x: np.ndarray) -> np.ndarray:
    """Distances (n + 1,) between the neighbours of each node: centres, at the ends the walls."""
    centres = 0.5 * (x[1:] + x[:-1])
    return np.diff(np.concatenate([[x[0]], centres, [x[-1]]]))


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

    The nodes go from x_old to x (n + 1,) during the step, and the fluxes are those past nodes that
    move so: a uniform temperature stays uniform to round-off.  `dt` infinite gives the steady state
    on x at once.  First order in time.
    """
    steady = math.isinf(dt)
    speed = column.through_flow - (0.0 if steady else (x - x_old) / dt)
    speed = np.broadcast_to(speed, x.shape)
    now = 0.0 * np.diff(x) if steady else np.diff(x) / dt
    before = now if steady else np.diff(x_old) / dt

    bands, walls = assemble_transport(x, speed, column.diffusivity, column.scheme)
    bands[1] += now
    heat = before * temperature
    heat[[0, -1]] -= walls * np.array(column.temperatures)
    temperature = solve_banded((1, 1), bands, heat)

    # v is linear in T0: one part without it, one for T0 = -1, mixed to have the mean asked for.
    bands, _ = assemble_transport(x, speed, column.viscosity, column.scheme)
    bands[1] += now
    steps = np.diff(x)
    driven = before * velocity + column.buoyancy * temperature * steps
    parts = solve_banded((1, 1), bands, np.stack([driven, steps], axis=1))
    flow, unit = steps @ parts
    lift = (column.mean_speed * (x[-1] - x[0]) - flow) / unit
    velocity = parts[:, 0] + lift * parts[:, 1]
    reference = -lift / column.buoyancy if column.buoyancy != 0.0 else 0.0
    return temperature, velocity, reference


def solve_column(column: Column, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Steady temperature, velocity (n,) and T0 on the axis `x` (n + 1,)."""
    zero = np.zeros(x.size - 1)
    return step_column(column, x, x, zero, zero, math.inf)


def to_nodes(x: np.ndarray, values: np.ndarray, walls: tuple[float, float]) -> np.ndarray:
    """Values (n + 1,) at the nodes: linear between centres, `walls` at the ends."""
    centres = 0.5 * (x[1:] + x[:-1])
    places = np.concatenate([[x[0]], centres, [x[-1]]])
    return np.interp(x, places, np.concatenate([walls[:1], values, walls[1:]]))


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


class RowBlock:
    """A column as pictures and dumps see it: cells one beside the other, one high.

    get_cells: () -> nodes x (n + 1,) [m] and fields by name, (n,) each; described: unit and long
    name of each field; low, high: y of the row [m].
    """

    def __init__(self, name: str, get_cells: Callable, described: Mapping, low, high):
        self.name, self._get_cells, self._ends = name, get_cells, np.array([low, high])
        self.units = {field: unit for field, (unit, _) in described.items()}
        self.long_names = {field: words for field, (_, words) in described.items()}

    @property
    def nodes(self) -> np.ndarray:
        return np.stack(np.meshgrid(self._get_cells()[0], self._ends, indexing="ij"))

    @property
    def cell_fields(self) -> dict[str, np.ndarray]:
        fields = self._get_cells()[1].items()
        return {name: np.ascontiguousarray(values[:, None]) for name, values in fields}


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
