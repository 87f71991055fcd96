"""Regridders without a barrier: grids written down from the boundary, then checked.

They are quick and honest: a grid with a bad cell is not returned, the failure names the cells.
The trap: "displacement" accumulates, its grid depends on all boundaries since the first, the other
two on the present boundary alone.
"""

from __future__ import annotations

import numpy as np

from regrid.algebraic.quasi_1d import quasi_1d_grid
from regrid.algebraic.transfinite import fill_displacement, transfinite_grid
from regrid.errors import BadInput
from regrid.measure.failure_words import check_grids, explain_failure
from regrid.measure.fixed_corners import BLOCK_CORNERS
from regrid.measure.quality import compute_corner_areas
from regrid.report import RegridReport, RegridResult
from regrid.sides import copy_sides

NAMED_CELLS = 4


class AlgebraicRegridder:
    """Base: `make_nodes` makes a grid, `regrid` proves it convex or raises RegridFailure."""

    start = ""

    def __init__(self, threads: int = 1):
        self.threads = threads

    def make_nodes(self, previous: np.ndarray, boundary: np.ndarray) -> np.ndarray:
        """New nodes (2, ni+1, nj+1) on the sides of `boundary`; may be folded."""
        raise NotImplementedError

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid on the sides of `boundary`; raises RegridFailure naming cells that are not convex.

        Both arrays have shape (2, ni+1, nj+1); only the four sides of `boundary` are read.
        """
        previous, boundary = check_grids(previous, boundary)
        nodes = self.make_nodes(previous, boundary)
        old, new = compute_corner_areas(previous), compute_corner_areas(nodes)
        sign = 1.0 if old.sum() >= 0.0 else -1.0
        forced = [corner for corner in BLOCK_CORNERS if not sign * new[corner] > 0.0]
        for corner in forced:
            old[corner] = new[corner] = sign
        bad = np.argwhere(~(sign * new > 0.0).all(axis=0))
        if len(bad) or not np.isfinite(nodes).all():
            named = ", ".join(f"({i}, {j})" for i, j in bad[:NAMED_CELLS])
            more = f" and {len(bad) - NAMED_CELLS} more" if len(bad) > NAMED_CELLS else ""
            also = f"cells {named}{more} of the {self.start} grid are not convex"
            raise explain_failure(boundary, nodes[:: int(sign)], also=also, grid=nodes)
        return RegridResult(
            nodes=nodes,
            report=RegridReport(
                iterations=0,
                node_iterations=0,
                sub_moves=0,
                rescues=0,
                least_corner_ratio=float((new / old).min()),
                residual=0.0,
                start=self.start,
                exempt_corners=len(forced),
            ),
        )


class QuasiOneDimensionalRegridder(AlgebraicRegridder):
    """Straight lines of one family: `family` "i" (lines j = const), "j", or "auto".

    "auto" takes the family that starts on the sides with the larger arc relative to its chord.
    """

    start = "quasi-1d"

    def __init__(self, family: str = "auto", threads: int = 1):
        super().__init__(threads)
        if family not in ("auto", "i", "j"):
            raise BadInput(f"quasi-1d: family must be 'auto', 'i' or 'j', got '{family}'")
        self.family = family

    def make_nodes(self, previous, boundary):
        family = self.family
        if family == "auto":
            bends = [
                max(compute_arc_excess(boundary[:, 0]), compute_arc_excess(boundary[:, -1])),
                max(compute_arc_excess(boundary[:, :, 0]), compute_arc_excess(boundary[:, :, -1])),
            ]
            family = "j" if bends[1] > bends[0] else "i"
        return quasi_1d_grid(boundary, family)


class TransfiniteRegridder(AlgebraicRegridder):
    """Transfinite interpolation of the boundary's nodes, blended by the sides' own laws.

    Theory R6.4.
    """

    start = "transfinite"

    def make_nodes(self, previous, boundary):
        return transfinite_grid(boundary)


class DisplacementRegridder(AlgebraicRegridder):
    """The old grid moved by the interpolated displacement of its boundary.

    Theory R6.5.
    """

    start = "displacement"

    def make_nodes(self, previous, boundary):
        displacement = np.empty_like(previous)
        fill_displacement(previous, boundary, displacement)
        nodes = previous + displacement
        copy_sides(boundary, nodes)
        return nodes


def compute_arc_excess(line: np.ndarray) -> float:
    """Arc length over chord of a polyline (2, n), less one."""
    chord = np.hypot(*(line[:, -1] - line[:, 0]))
    return float(np.hypot(*np.diff(line, axis=1)).sum() / max(chord, 1e-300) - 1.0)
