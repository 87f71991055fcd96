"""What one reads off a convecting box: Nusselt numbers, greatest speeds and their places.

Values between grid points come from cubic splines through the discrete solution and what is known
on the walls.  Splines are of fourth order, so that the places and values of extremes have the
error of the solution and hardly any of their own.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from hydro.convection.box.equations import Equations
from hydro.convection.box.fluid import Fluid
from hydro.convection.box.transfer import slip
from hydro.convection.box.walls import PAIRS, SIDES


def compute_local_nusselt(
    equations: Equations,
    fluid: Fluid,
    temperature: np.ndarray,
    side: str,
    scale: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """(places, Nusselt numbers) (cells,) along a wall: heat that enters the fluid, per length, over
    kappa times `scale` (temperature difference over distance of the walls)."""
    k = SIDES.index(side) // 2
    cross = equations.axes[1 - k]
    heat = equations.compute_wall_heat(fluid, temperature, side)
    return cross.centres, heat / cross.widths / (fluid.diffusivity * scale)


def compute_mean_nusselt(
    equations: Equations,
    fluid: Fluid,
    temperature: np.ndarray,
    side: str,
    scale: float = 1.0,
) -> float:
    """Mean of the local Nusselt number over a wall."""
    length = equations.axes[1 - SIDES.index(side) // 2].length
    heat = equations.compute_wall_heat(fluid, temperature, side)
    return float(heat.sum() / (fluid.diffusivity * scale * length))


def find_maximum(places: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """(value, place) of the maximum of the cubic spline through points; an end may be it."""
    spline = CubicSpline(places, values)
    roots = spline.derivative().roots(discontinuity=False, extrapolate=False)
    candidates = np.concatenate([roots[np.isfinite(roots)], places[[0, -1]]])
    found = spline(candidates)
    best = int(np.argmax(found))
    return float(found[best]), float(candidates[best])


def find_nusselt_maximum(
    equations: Equations,
    fluid: Fluid,
    temperature: np.ndarray,
    side: str,
    scale: float = 1.0,
) -> tuple[float, float]:
    """(value, place) of the greatest local Nusselt number on a wall.

    Beside an adiabatic wall the flux has no slope along the wall: it is continued as its own mirror
    image there, so that a maximum near the corner is not cut.
    """
    k = SIDES.index(side) // 2
    places, values = compute_local_nusselt(equations, fluid, temperature, side, scale)
    ends = equations.axes[1 - k].nodes[[0, -1]]
    low, high = (equations.walls[s] for s in PAIRS[1 - k])
    whole, heights = places, values
    if low.temperature is None and low.flux is None and low.flow != "periodic":
        whole, heights = (
            np.append(2 * ends[0] - places[2::-1], whole),
            np.append(values[2::-1], heights),
        )
    if high.temperature is None and high.flux is None and high.flow != "periodic":
        whole = np.append(whole, 2 * ends[1] - places[:-4:-1])
        heights = np.append(heights, values[:-4:-1])
    spline = CubicSpline(whole, heights)
    roots = spline.derivative().roots(discontinuity=False, extrapolate=False)
    roots = roots[np.isfinite(roots) & (roots >= ends[0]) & (roots <= ends[1])]
    candidates = np.concatenate([roots, places[[0, -1]]])
    best = int(np.argmax(spline(candidates)))
    return float(spline(candidates[best])), float(candidates[best])


def extract_middle(
    equations: Equations, psi: np.ndarray, component: int
) -> tuple[np.ndarray, np.ndarray]:
    """(places, velocities) of `component` (0: u, 1: v) along the middle line across it.

    Of u along x = middle, of v along y = middle; where a wall that holds the fluid ends the line,
    its zero is among the points.
    """
    values = equations.compute_velocities(psi)[component]
    own, cross = equations.axes[component], equations.axes[1 - component]
    values = values if component == 0 else values.T
    middle = 0.5 * (own.nodes[0] + own.nodes[-1])
    nodes = own.nodes[: own.node_count]
    line = CubicSpline(nodes, values, axis=0)(middle)
    places = cross.centres
    for end, side in ((0, PAIRS[1 - component][0]), (-1, PAIRS[1 - component][1])):
        if not cross.periodic and slip(equations, side) == 0.0:
            at = 0 if end == 0 else places.size
            places = np.insert(places, at, cross.nodes[end])
            line = np.insert(line, at, 0.0)
    return places, line


def find_greatest_speed(
    equations: Equations, psi: np.ndarray, component: int
) -> tuple[float, float]:
    """(value, place) of the greatest u on x = middle (0) or v on y = middle (1)."""
    return find_maximum(*extract_middle(equations, psi, component))


def measure_energy(equations: Equations, psi: np.ndarray) -> float:
    """Kinetic energy over density, integral of |u|²/2 [m4/s2]."""
    momentum = equations.momentum
    velocity = (momentum.curl @ psi) / momentum.lengths
    return float(0.5 * (velocity**2 * momentum.lengths * momentum.reaches).sum())
