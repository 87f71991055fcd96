"""What a regridder hands back: the new grid, and an account of how it was found."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RegridReport:
    """How one regrid went; every regridder fills every field.

    `iterations` counts linear iterations (newton) or sweeps, `node_iterations` the nodes they
    touched.  `sub_moves` is the number of extra parts the boundary's motion was cut into, `rescues`
    the number of times an untangling was needed.  `least_corner_ratio` is the least new corner area
    relative to the old one at the same corner.  `residual` is the size of the gradient at the
    start, relative to the terms it is made of.  `start` names the grid that was begun from:
    "previous", "displacement", "quasi-1d", "mended" (a prediction whose bad corners were opened,
    theory R5.7), "untangled", "halved".  `exempt_corners` counts corner triangles left out because
    the boundary's own nodes turn them over, `triangles` the block's corners that its sides make
    flat (`regrid.measure.predicates`), `limited_nodes` the nodes whose motion was cut short because
    a corner would have folded or a speed been too high.  `strayed` is how far inner nodes are at
    most from where interpolation of the sides' motion puts them, in
    heights of the old cells, where the regridder knows it; no more than that, at least.
    """

    iterations: int
    node_iterations: int
    sub_moves: int
    rescues: int
    least_corner_ratio: float
    residual: float
    start: str
    exempt_corners: int = 0
    limited_nodes: int = 0
    triangles: int = 0
    strayed: float = math.inf


@dataclass(frozen=True)
class RegridResult:
    """A valid grid on the wanted boundary: `nodes` of shape (2, ni+1, nj+1), and its report.

    `nodes` is a fresh array that belongs to the caller.
    """

    nodes: np.ndarray
    report: RegridReport
