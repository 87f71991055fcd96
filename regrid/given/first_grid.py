"""The first grid on sides that are given all at once, which no grid was carried to."""

from __future__ import annotations

import numpy as np

from regrid.algebraic.quasi_1d import quasi_1d_grid
from regrid.algebraic.transfinite import transfinite_grid
from regrid.barrier.repair import RepairReport, repair_grid
from regrid.errors import RegridFailure
from regrid.measure.quality import find_bad_cells


def find_start(boundary: np.ndarray) -> tuple[np.ndarray, str]:
    """A valid grid on the sides of `boundary` and words for it; RegridFailure where none is found.

    Transfinite interpolation, untangled where it is folded; else straight lines of a family.
    """
    first = transfinite_grid(boundary)
    try:
        repaired = repair_grid(first)
        return repaired.nodes, f"transfinite interpolation{describe_repair(repaired.report)}"
    except RegridFailure:
        for straight in (quasi_1d_grid(boundary, "i"), quasi_1d_grid(boundary, "j")):
            if len(find_bad_cells(straight)) == 0:
                return straight, "straight lines"
        raise


def describe_repair(report: RepairReport) -> str:
    """What a grid needed, as the end of a sentence."""
    words = f" with {report.bad_cells} bad cells" if report.bad_cells else ""
    if report.projected_nodes:
        words += f", {report.projected_nodes} nodes projected"
    if report.untangled:
        words += ", untangled"
    if report.excluded_corners:
        words += f", {report.excluded_corners} corner triangles left out"
    return words
