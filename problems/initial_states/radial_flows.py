"""Flows that depend on the radius alone, on grids that do not know it.

Plane: a strip, the radius being x.  Cylindrical: a quarter of the plane.  Spherical: the quarter
between the axis and the plane of symmetry, in axisymmetric flow.  All on a rectangular grid.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from hydro.block import Block
from hydro.boundary.registry import put
from problems.initial_states.rectangular_grids import make_plane_grid
from regrid.measure.corners import compute_centres

Symmetry = Literal["plane", "cylindrical", "spherical"]
STRIP = 4  # cells across the strip of plane flow
POINTS = 6  # for means over a cell, each way


def find_flow_geometry(symmetry: Symmetry) -> str:
    """What the `Simulation` is to be told."""
    return "axisymmetric" if symmetry == "spherical" else "plane"


def make_nodes(symmetry: Symmetry, cells: int, size: float) -> np.ndarray:
    """Nodes (2, cells + 1, n) of the rectangle from the centre to `size` [m]."""
    line = np.linspace(0.0, size, cells + 1)
    return make_plane_grid(line, line[: STRIP + 1] if symmetry == "plane" else line)


def close_inside(block: Block, symmetry: Symmetry) -> list[str]:
    """Put the sides that symmetry closes; returns those that remain."""
    put(block, "i_min", "wall")
    put(block, "j_min", "axis" if symmetry == "spherical" else "wall")
    if symmetry == "plane":
        put(block, "j_max", "wall")
        return ["i_max"]
    return ["i_max", "j_max"]


def compute_radii(symmetry: Symmetry, points: np.ndarray) -> np.ndarray:
    """Radii (...) of points (2, ...)."""
    return np.abs(points[0]) if symmetry == "plane" else np.hypot(*points)


def average(
    symmetry: Symmetry, nodes: np.ndarray, function: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Means over the volumes of the cells (ni, nj) of a function of the radius."""
    a, b, c, d = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
    positions = (np.arange(POINTS) + 0.5) / POINTS
    total, volume = 0.0, 0.0
    for s in positions:
        for q in positions:
            point = (1 - s) * (1 - q) * a + s * (1 - q) * b + s * q * c + (1 - s) * q * d
            weight = point[1] if symmetry == "spherical" else 1.0
            total = total + weight * function(compute_radii(symmetry, point))
            volume = volume + weight
    return total / volume


def measure_error(
    symmetry: Symmetry,
    block: Block,
    function: Callable[[np.ndarray], np.ndarray],
    within: float = np.inf,
) -> float:
    """Relative error of the density, sum |rho - exact| V / sum exact V, over cells in r < within.

    `exact` are the means of the function over the cells.
    """
    exact = average(symmetry, block.nodes, function)
    chosen = compute_radii(symmetry, compute_centres(block.nodes)) < within
    weight = block.volume * chosen
    error = np.abs(block.state[0, 1:-1, 1:-1] - exact)
    return float((error * weight).sum() / (exact * weight).sum())


def draw_radial(axis, block: Block, symmetry: Symmetry, radii, exact) -> None:
    """Density of every cell against its radius, and the exact curve (two arrays)."""
    r = compute_radii(symmetry, compute_centres(block.nodes))
    axis.plot(r.ravel(), block.cell_fields["rho"].ravel(), ".", ms=1.5, color="tab:blue")
    axis.plot(radii, exact, color="k", lw=0.8)
    axis.set_xlabel("r")
    axis.set_ylabel("density, exact in black")
