"""The ED2 grid as a regridder: weight times cell area constant, on moving sides.

The trap: a weight of position knows nothing of the old grid, so a graded block becomes another
grid in the first step.  The weight "own" is 1 over the area of the old cells: the block keeps the
density of nodes that it has, and moves with its sides.

Source: Khakimzyanov & Shokina §2; METHOD §3.2.
"""

from __future__ import annotations

import numpy as np

from regrid.boundary_check import explain_failure
from regrid.equidistribution2d import compute_centres, iterate_ed2, weigh_points
from regrid.errors import BadInput, RegridFailure
from regrid.quality import compute_corner_areas
from regrid.report import RegridReport, RegridResult
from regrid.spacing import arc_law, solve_ed1
from regrid.transfinite import fill_displacement, transfinite_grid

SIDES = (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1])


class EquidistributionRegridder:
    """`weight` is "own", a positive number, an array of the cells, or a function of x and y.

    `boundary` "given" keeps the sides' nodes to the bit; "equidistributed" places them along the
    sides' polylines with the same weight ([KS] (2.22); not for "own" or an array).  `iterations`
    and `tolerance` (of the residual over the fluxes) end the iteration.
    """

    def __init__(
        self,
        weight="own",
        boundary: str = "given",
        iterations: int = 40,
        tolerance: float = 1e-8,
        threads: int = 1,
    ):
        if boundary not in ("given", "equidistributed"):
            raise BadInput(
                f"equidistribution: boundary '{boundary}' is neither 'given' nor 'equidistributed'"
            )
        if isinstance(weight, str) and weight != "own":
            raise BadInput(
                f"equidistribution: weight '{weight}' is neither 'own', a number, an array of "
                "the cells nor a function of x and y"
            )
        by_cell = isinstance(weight, str) or np.ndim(weight) > 0
        if boundary == "equidistributed" and by_cell:
            raise BadInput(
                "equidistribution: the sides can follow a number or a function of x and y only"
            )
        self.weight, self.boundary = weight, boundary
        self.iterations, self.tolerance = int(iterations), float(tolerance)
        self.threads = threads

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid on the sides of `boundary`; raises RegridFailure where no iterate is convex."""
        previous = np.ascontiguousarray(previous, dtype=np.float64)
        boundary = np.ascontiguousarray(boundary, dtype=np.float64)
        if previous.shape != boundary.shape or previous.ndim != 3 or previous.shape[0] != 2:
            raise BadInput(
                f"regrid: previous {previous.shape} and boundary {boundary.shape} must both have "
                "shape (2, ni+1, nj+1)"
            )
        if not all(np.isfinite(boundary[side]).all() for side in SIDES):
            raise RegridFailure(explain_failure(boundary))
        if self.boundary == "equidistributed":
            boundary = equidistribute_sides(boundary, self.weight)
        old = compute_corner_areas(previous)
        sign = 1.0 if old.sum() >= 0.0 else -1.0
        nodes, start = self._start(previous, boundary, sign)
        weigh = self._weigh(old)
        try:
            found = iterate_ed2(nodes, weigh, self.iterations, self.tolerance)
        except RegridFailure as failure:
            raise RegridFailure(f"{explain_failure(boundary)}; {failure}") from failure
        inner = (nodes.shape[1] - 2) * (nodes.shape[2] - 2)
        done = found.residuals.size - 1
        return RegridResult(
            nodes=found.nodes,
            report=RegridReport(
                iterations=done,
                node_iterations=done * inner,
                sub_moves=0,
                rescues=0,
                least_corner_ratio=float((compute_corner_areas(found.nodes) / old).min()),
                residual=float(found.residuals[found.best]),
                start=start,
            ),
        )

    def _start(self, previous, boundary, sign):
        """The old grid carried along, where that is convex, else transfinite interpolation."""
        nodes = np.empty_like(previous)
        fill_displacement(previous, boundary, nodes)
        nodes += previous
        for side in SIDES:
            nodes[side] = boundary[side]
        if (sign * compute_corner_areas(nodes) > 0.0).all():
            return nodes, "displacement"
        return transfinite_grid(boundary), "transfinite"

    def _weigh(self, old):
        """The weight as a function of the nodes; "own" from the old corner areas."""
        if callable(self.weight):
            return lambda nodes: weigh_points(self.weight, compute_centres(nodes))
        if isinstance(self.weight, str):
            areas = np.abs((old[0] + old[2]) + (old[1] + old[3]))
            own = areas.mean() / np.maximum(areas, 1e-300)
            return lambda nodes: own
        return lambda nodes: weigh_points(self.weight, compute_centres(nodes))


def equidistribute_sides(nodes: np.ndarray, weight) -> np.ndarray:
    """A copy of `nodes` whose sides' nodes lie along the sides' polylines with w ds constant.

    [KS] (2.22): ED1 in arc length, w (a number or a function of x and y) on the polyline.  The
    block's corners stay; inner nodes are copied as they are.
    """
    placed = np.array(nodes, dtype=np.float64, order="C")
    for side in SIDES:
        line = np.ascontiguousarray(nodes[side])
        law = arc_law(line)

        def weight_at(s, line=line, law=law):
            if not callable(weight):
                return np.full(np.shape(s), float(weight))
            return weight(np.interp(s, law, line[0]), np.interp(s, law, line[1]))

        wanted = solve_ed1(weight_at, line.shape[1])
        inner = np.array([np.interp(wanted, law, part) for part in line])
        placed[side][:, 1:-1] = inner[:, 1:-1]
    return placed
