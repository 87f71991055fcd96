"""Winslow's and Thompson's grids: smooth lines, from Laplace's equations for xi(x, y), eta(x, y).

    alpha (x_xixi + P x_xi) - 2 beta x_xieta + gamma (x_etaeta + Q x_eta) = 0
    alpha = |x_eta|^2, beta = x_xi . x_eta, gamma = |x_xi|^2                  theory R12.3

P = Q = 0 is Winslow's grid ("none"), whose lines are attracted to sides that bulge into the block.
Thompson's control functions are taken from the sides ("sides"): with the spacings s of the two
sides, interpolated linearly across the block, `x_xixi + P x_xi` is `delta(delta x / s)` over the
mean of 1/s, so that a graded rectangle is an exact solution.

Note: the maximum principle that keeps such grids from folding holds for the differential
equations.  The discrete grids fold at strongly bent sides, and such grids are not returned.

Lines are solved along i, then along j, with lagged coefficients and a cycle of tau.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.algebraic import begin_grid
from shockgrid.regrid.equidistribution.areas import make_cycle, sweep_both_ways
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.faults import check_grids, explain_failure, find_unit, name_cells
from shockgrid.regrid.measure.quality import compute_corner_areas
from shockgrid.regrid.protocol import RegridReport, RegridResult


@kernel
def fill_equation(nodes, steps_i, steps_j, residual, scale_i, scale_j, sums):
    """Residual over alpha (2, n, m) of the inner nodes, and their local scales in both directions.

    steps_i (n + 1, m), steps_j (n, m + 1): inverse wanted steps of the edges.  scale_i is C/alpha',
    scale_j is C/gamma' (C the mean of alpha and gamma, a prime: over the mean inverse step).
    sums (2, n): per row, squares of the residual and of the terms' size.
    """
    x, y = nodes[0], nodes[1]
    for i in range(residual.shape[1]):
        residual_squares = 0.0
        term_squares = 0.0
        for j in range(residual.shape[2]):
            p = i + 1
            q = j + 1
            # metric at the node (R12.3)
            x1, y1 = 0.5 * (x[p + 1, q] - x[p - 1, q]), 0.5 * (y[p + 1, q] - y[p - 1, q])
            x2, y2 = 0.5 * (x[p, q + 1] - x[p, q - 1]), 0.5 * (y[p, q + 1] - y[p, q - 1])
            alpha = x2 * x2 + y2 * y2
            gamma = x1 * x1 + y1 * y1
            beta = x1 * x2 + y1 * y2
            # wanted steps on either side of it
            low, high = steps_i[i, j], steps_i[i + 1, j]
            left, right = steps_j[i, j], steps_j[i, j + 1]
            a = 2.0 * alpha / (low + high)
            c = 2.0 * gamma / (left + right)
            # differences along both lines and across
            cross_x = (x[p + 1, q + 1] + x[p - 1, q - 1]) - (x[p + 1, q - 1] + x[p - 1, q + 1])
            cross_y = (y[p + 1, q + 1] + y[p - 1, q - 1]) - (y[p + 1, q - 1] + y[p - 1, q + 1])
            along_x = high * (x[p + 1, q] - x[p, q]) - low * (x[p, q] - x[p - 1, q])
            along_y = high * (y[p + 1, q] - y[p, q]) - low * (y[p, q] - y[p - 1, q])
            across_x = right * (x[p, q + 1] - x[p, q]) - left * (x[p, q] - x[p, q - 1])
            across_y = right * (y[p, q + 1] - y[p, q]) - left * (y[p, q] - y[p, q - 1])
            # residual over alpha, scales of both directions
            rx = (a * along_x + c * across_x) - 0.5 * beta * cross_x
            ry = (a * along_y + c * across_y) - 0.5 * beta * cross_y
            scale = 0.5 * (alpha + gamma)
            residual[0, i, j] = rx / a
            residual[1, i, j] = ry / a
            scale_i[i, j], scale_j[i, j] = scale / a, scale / c
            residual_squares += rx * rx + ry * ry
            term_squares += alpha * gamma * (alpha + gamma)
        sums[0, i] = residual_squares
        sums[1, i] = term_squares


def compute_inverse_steps(sides: np.ndarray, control: str) -> tuple[np.ndarray, np.ndarray]:
    """Inverse wanted steps of the inner lines' edges, along i (ni, nj-1) and along j (nj, ni-1)."""
    inverse = []
    for grid in (sides, sides.transpose(0, 2, 1)):
        n = grid.shape[1] - 1
        m = grid.shape[2] - 1
        if control == "none":
            inverse.append(np.ones((n, m - 1)))
            continue
        low, high = (np.hypot(*np.diff(line, axis=1)) for line in (grid[:, :, 0], grid[:, :, -1]))
        place = np.linspace(0.0, 1.0, m + 1)[1:-1]
        steps = np.outer(low / low.sum(), 1.0 - place) + np.outer(high / high.sum(), place)
        inverse.append(1.0 / (n * steps))
    return inverse[0], inverse[1]


class WinslowRegridder:
    """Smooth grid on the sides given; `control` "sides" (Thompson) or "none" (Winslow).

    `iterations` and `tolerance` (of the residual over its terms) end the iteration.
    """

    def __init__(
        self,
        control: str = "sides",
        iterations: int = 100,
        tolerance: float = 1e-8,
        threads: int = 1,
    ):
        if control not in ("sides", "none"):
            raise BadInput(f"winslow: control '{control}' is neither 'sides' nor 'none'")
        self.control = control
        self.iterations = int(iterations)
        self.tolerance = float(tolerance)
        self.threads = threads

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid on the sides of `boundary`; raises RegridFailure naming non-convex cells."""
        previous, boundary = check_grids(previous, boundary)
        old_areas = compute_corner_areas(previous)
        sign = 1.0 if old_areas.sum() >= 0.0 else -1.0
        nodes, start = begin_grid(previous, boundary, sign)
        iterations_done = 0
        residual = 0.0
        if min(nodes.shape[1:]) > 2:
            unit = find_unit(nodes)
            nodes /= unit
            iterations_done, residual = iterate_winslow(
                nodes, self.control, self.iterations, self.tolerance
            )
            nodes *= unit
        new_areas = compute_corner_areas(nodes)
        bad_cells = np.argwhere(~(sign * new_areas > 0.0).all(axis=0))
        if len(bad_cells) or not np.isfinite(nodes).all():
            also = f"cells {name_cells(bad_cells)} of the winslow grid are not convex"
            raise explain_failure(boundary, nodes[:: int(sign)], also=also, grid=nodes)
        inner = (nodes.shape[1] - 2) * (nodes.shape[2] - 2)
        ratio = float((new_areas / old_areas).min())
        return RegridResult(
            nodes,
            RegridReport(iterations_done, iterations_done * inner, 0, 0, ratio, residual, start),
        )


def iterate_winslow(
    nodes: np.ndarray, control: str = "sides", iterations: int = 100, tolerance: float = 1e-8
) -> tuple[int, float]:
    """Move the inner `nodes` (2, ni+1, nj+1) to the solution; iterations done, last residual."""
    inner_i = nodes.shape[1] - 2
    inner_j = nodes.shape[2] - 2
    steps_i, steps_j = compute_inverse_steps(nodes, control)
    across = np.ascontiguousarray(steps_j.T)
    residual = np.empty((2, inner_i, inner_j))
    sums = np.empty((2, inner_i))
    scale_i, scale_j = np.empty((2, inner_i, inner_j))
    taus = make_cycle((min(inner_i, inner_j) / np.pi) ** 2)
    for iteration in range(iterations + 1):
        fill_equation(nodes, steps_i, across, residual, scale_i, scale_j, sums)
        size, term_squares = sums.sum(axis=1)
        error = float(np.sqrt(size / term_squares)) if term_squares > 0.0 else np.inf
        if error <= tolerance or iteration == iterations or not np.isfinite(error):
            break
        tau = float(taus[iteration % taus.size])
        sweep_both_ways(residual, (scale_i, scale_j), (steps_i, steps_j), tau, nodes)
    return iteration, error
