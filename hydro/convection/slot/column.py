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

The trap: "no oscillation" is not "resolved".  At Pe = 50 the layer lies inside one cell; T is exact
outside of it, but v of a closed slot is driven by that layer alone and comes out wrong by its own
size everywhere.  A grid that follows the gradient resolves both.

Sources: [Samarskii1977], [Ilin1969], [ScharfetterGummel1969].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

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
