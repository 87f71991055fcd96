"""ED2 on a block by itself, without a regridder: its solution and its residual."""

from __future__ import annotations

import numpy as np

from regrid.equidistribution.areas import Ed2Operator, Equidistributed, iterate_ed2
from regrid.equidistribution.weights import weigh_points
from regrid.measure.corners import compute_centres


def solve_ed2(
    nodes: np.ndarray, weight=1.0, iterations: int = 200, tolerance: float = 1e-10
) -> Equidistributed:
    """Equidistribute `weight` over the block whose sides and first inside are `nodes`."""
    fixed = None if callable(weight) else weigh_points(weight, compute_centres(nodes))
    return iterate_ed2(
        nodes,
        lambda grid: weigh_points(weight, compute_centres(grid)) if fixed is None else fixed,
        iterations,
        tolerance,
    )


def compute_residual(nodes: np.ndarray, weight=1.0) -> np.ndarray:
    """Residual (theory R10.3) at the inner nodes (2, ni-1, nj-1), in steps of the index."""
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    operator = Ed2Operator((nodes.shape[1] - 1, nodes.shape[2] - 1))
    operator.evaluate(nodes, weigh_points(weight, compute_centres(nodes)))
    return operator.residual.copy()
