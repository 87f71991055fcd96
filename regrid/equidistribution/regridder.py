"""The ED2 grid as a regridder: weight times cell area constant, on moving sides.

The trap: a weight of position knows nothing of how a block is graded, so that it becomes
another grid in the first step.  The default "sides" is the density of nodes that the sides ask for;
"own", 1 over the area of the old cells, keeps what there is, and with it every cell that has once
become too small.

Source: [KhakimzyanovShokina1998] §2; theory R10.2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from regrid.algebraic.transfinite import fill_displacement, transfinite_grid
from regrid.equidistribution.areas import Equidistributed, iterate_ed2
from regrid.equidistribution.weighted_sides import WeightedRegridder
from regrid.errors import RegridFailure
from regrid.measure.failure_words import check_grids, explain_failure
from regrid.measure.given_grids import find_unit
from regrid.measure.quality import compute_corner_areas, find_bad_cells
from regrid.report import RegridReport, RegridResult
from regrid.sides import copy_sides

LEAST_SINE = 0.1  # of a corner: where it is reached the iteration has begun to fold


class EquidistributionRegridder(WeightedRegridder):
    """`weight`: see `equidistribution.weights`; `smoothing`: passes over what depends on fields.

    `boundary` "given" keeps the sides' nodes to the bit; "equidistributed" places them along the
    sides' polylines with the same weight (theory R10.9).  `iterations` and `tolerance` (of the
    residual over the fluxes) end the iteration.
    """

    name = "equidistribution"

    def __init__(
        self,
        weight="sides",
        boundary: str = "given",
        smoothing: int = 4,
        iterations: int = 40,
        tolerance: float = 1e-8,
        threads: int = 1,
    ):
        super().__init__(weight, boundary, smoothing)
        self.iterations, self.tolerance = int(iterations), float(tolerance)
        self.threads = threads

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid on the sides of `boundary`; raises RegridFailure where no iterate is convex."""
        previous, boundary = check_grids(previous, boundary)
        boundary = self.distribute_sides(previous, boundary)
        old = compute_corner_areas(previous)
        sign = 1.0 if old.sum() >= 0.0 else -1.0
        nodes, start = self._start(previous, boundary, sign)
        unit = find_unit(nodes)
        try:
            if min(nodes.shape[1:]) < 3:  # no inner node
                found = accept_sides(nodes, sign)
            else:
                weigh = self.weight.on(previous, boundary)
                found = iterate_ed2(
                    nodes / unit,
                    lambda grid: weigh(grid * unit),
                    self.iterations,
                    self.tolerance,
                    least_sine=LEAST_SINE,
                )
                found = replace(found, nodes=found.nodes * unit)
        except RegridFailure as failure:
            grid = None if failure.grid is None else failure.grid * unit
            raise explain_failure(
                boundary, nodes[:: int(sign)], also=str(failure), grid=grid
            ) from failure
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
        copy_sides(boundary, nodes)
        if (sign * compute_corner_areas(nodes) > 0.0).all():
            return nodes, "displacement"
        return transfinite_grid(boundary), "transfinite"


def accept_sides(nodes: np.ndarray, sign: float) -> Equidistributed:
    """A block one cell wide, whose grid is its sides; raises RegridFailure where it folds."""
    bad = find_bad_cells(nodes if sign > 0.0 else nodes[::-1])
    if len(bad):
        raise RegridFailure(f"cell ({bad[0][0]}, {bad[0][1]}) is not convex")
    return Equidistributed(nodes, "converged", 0, np.zeros(1), np.zeros(1))
