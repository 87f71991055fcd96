"""Bringing a state from one tensor grid of a box to another, and to the nodes of its own.

The stream function is interpolated as it stands: mass stays conserved on any grid.  Of the
temperature the double integral from a corner is interpolated, and differenced again, so that the
heat in the box stays the same to round-off.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from hydro.convection.box.axis import Axis
from hydro.convection.box.equations import Equations
from hydro.convection.box.walls import PAIRS


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
    """Values at all nodes, both ends of a periodic axis among them, on those of `new`."""
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
    """Values on the nodes with the first ones of a periodic axis once more at its end."""
    for k, axis in enumerate(equations.axes):
        if axis.periodic:
            values = np.concatenate([values, np.take(values, [0], axis=k)], axis=k)
    return values


def compute_nodal_fields(
    equations: Equations, psi: np.ndarray, temperature: np.ndarray, diffusivity: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u, v [m/s] and temperature [K] at the nodes, each (nx + 1, ny + 1), the walls' own there."""
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
    """Velocity along a wall: 0, or None where the fluid is free."""
    return None if equations.walls[side].flow == "free" else 0.0


def wall_values(
    equations: Equations, side: str, heat: np.ndarray, diffusivity: float, k: int
) -> np.ndarray | float | None:
    """Temperature of a wall at the places of `heat` along it; None in a periodic axis."""
    own, cross = equations.axes[k], equations.axes[1 - k]
    if own.periodic:
        return 0.0
    along = cross.centres
    if heat.shape[1 - k] != cross.cells:  # already on the nodes along the wall
        along = cross.nodes[: cross.node_count]
    temperature, flux = equations.walls[side].sample(along)
    if temperature is not None:
        return temperature
    end = 0 if side.endswith("min") else -1
    return np.take(heat, end, axis=k) + flux / diffusivity * own.distances[end]


def to_nodes(axis: Axis, values: np.ndarray, k: int, low, high) -> np.ndarray:
    """Cell values along direction k on its nodes, linear between; at walls `low`, `high`, or the
    nearest value where that is None."""
    cells = np.moveaxis(values, k, 0)
    nodal = axis.interpolate_to_nodes() @ cells
    if not axis.periodic:
        nodal[0] = cells[0] if low is None else low
        nodal[-1] = cells[-1] if high is None else high
    return np.moveaxis(nodal, 0, k)
