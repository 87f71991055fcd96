"""The ED2 grid as a regridder: weight times cell area constant, on moving sides.

The trap: a weight of position knows nothing of the old grid, so a graded block becomes another
grid in the first step.  The weight "own" is 1 over the area of the old cells: the block keeps the
density of nodes that it has, and moves with its sides.

Source: Khakimzyanov & Shokina §2; METHOD §3.2.
"""

from __future__ import annotations

import numpy as np

from regrid.boundary_check import explain_failure
from regrid.carrying import SIDES, check_grids
from regrid.equidistribution2d import iterate_ed2
from regrid.errors import BadInput, RegridFailure
from regrid.quality import compute_corner_areas
from regrid.report import RegridReport, RegridResult
from regrid.spacing import arc_law, equidistribute, solve_ed1
from regrid.transfinite import fill_displacement, transfinite_grid
from regrid.weights import Weight

LEAST_SINE = 0.1  # of a corner: where it is reached the iteration has begun to fold


class EquidistributionRegridder:
    """`weight`: see `regrid.weights`; `smoothing`: passes over what depends on fields.

    `boundary` "given" keeps the sides' nodes to the bit; "equidistributed" places them along the
    sides' polylines with the same weight ([KS] (2.22)), for weights of position or of fields.
    `iterations` and `tolerance` (of the residual over the fluxes) end the iteration.
    """

    def __init__(
        self,
        weight="own",
        boundary: str = "given",
        smoothing: int = 4,
        iterations: int = 40,
        tolerance: float = 1e-8,
        threads: int = 1,
    ):
        if boundary not in ("given", "equidistributed"):
            raise BadInput(
                f"equidistribution: boundary '{boundary}' is neither 'given' nor 'equidistributed'"
            )
        self.weight, self.boundary = Weight(weight, smoothing), boundary
        if self.owns_sides and (self.weight.needs_own or self.weight.needs_sides):
            raise BadInput(
                "equidistribution: equidistributed sides cannot follow 'own' or 'sides', which "
                "come from the sides themselves; give a weight of x, y or of fields"
            )
        self.iterations, self.tolerance = int(iterations), float(tolerance)
        self.threads = threads

    @property
    def owns_sides(self) -> bool:
        """Does it place the sides' nodes itself?"""
        return self.boundary == "equidistributed"

    @property
    def sees_flow(self) -> bool:
        """Does the weight need the fields of the flow?"""
        return self.weight.needs_fields

    def take_step(self, fields, pace: float) -> None:
        """Be told the cells' fields (ni, nj each) before the grid of a step is asked for."""
        self.weight.take_fields(fields)

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid on the sides of `boundary`; raises RegridFailure where no iterate is convex."""
        previous, boundary = check_grids(previous, boundary)
        if self.owns_sides:
            boundary = place_sides(boundary, self.weight, previous)
        old = compute_corner_areas(previous)
        sign = 1.0 if old.sum() >= 0.0 else -1.0
        nodes, start = self._start(previous, boundary, sign)
        try:
            weigh = self.weight.on(previous, boundary)
            found = iterate_ed2(
                nodes, weigh, self.iterations, self.tolerance, least_sine=LEAST_SINE
            )
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


def equidistribute_sides(nodes: np.ndarray, weight) -> np.ndarray:
    """A copy of `nodes` whose sides' nodes lie along the sides' polylines with w ds constant.

    [KS] (2.22): ED1 in arc length, w (a number, a function or a formula of x and y) on the
    polyline.  The block's corners stay; inner nodes are copied as they are.
    """
    return place_sides(nodes, weight if isinstance(weight, Weight) else Weight(weight), nodes)


def place_sides(boundary: np.ndarray, weight: Weight, previous: np.ndarray) -> np.ndarray:
    """As `equidistribute_sides`; a weight that is not `by_position` is that of the cells beside.

    Such a weight is known on the steps of the sides of `previous`; its integral is inverted there.
    """
    placed = np.array(boundary, dtype=np.float64, order="C")
    if not weight.by_position:
        cells = weight.on(previous, boundary)(previous)
    beside = (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1])
    for side, edge in zip(SIDES, beside, strict=True):
        line = np.ascontiguousarray(boundary[side])
        law = arc_law(line)
        if weight.by_position:

            def weight_at(s, line=line, law=law):
                return weight.at_points(np.interp(s, law, line[0]), np.interp(s, law, line[1]))

            wanted = solve_ed1(weight_at, line.shape[1])
        else:
            wanted = equidistribute(law, cells[edge])
        inner = np.array([np.interp(wanted, law, part) for part in line])
        placed[side][:, 1:-1] = inner[:, 1:-1]
    return placed
