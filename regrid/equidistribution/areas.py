"""ED2: grids of a plane block with constant weight times cell area, and their regridder.

    ∂1(w g22 ∂1 x) + ∂2(w g11 ∂2 x) = 0        theory R10.2, nine-point: theory R10.3

w, g11 and g22 are located at cell centres, from cell-averaged differences.  An iteration computes
the exact residual and solves `(C + tau L1) C^-1 (C + tau L2) d = tau R` along lines (the
stabilising correction, three-point operators with the coefficients of the iterate).

Note: lagging the coefficients hides that the full equation is degenerate.  On a grid of spacings
h1, h2 its symbol has the eigenvalues (h2 k1 ± h1 k2)^2, so waves along the cells' diagonals are in
its null space.  If the boundary allows an orthogonal grid with w S constant, the iteration
converges to it; otherwise the residual falls, stalls and may grow again.  The convex iterate of
least residual is therefore kept, and the result states why the iteration stopped.  Where it stalls,
`regrid.variational` with a large weight on the volume gets further: in a square with w = 1 + 10y
and equal spacing on its sides the spread of w S is .48 initially, .30 here and .05 there.

The regridder's default weight "sides" is the node density implied by the sides.  A weight of
position ignores the grading of a block, so the grid changes in the first step; "own", 1 over the
area of the old cells, preserves the grid, including every cell that has become too small.

Source: [KhakimzyanovShokina1998] §2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from shockgrid.regrid.algebraic import begin_grid
from shockgrid.regrid.equidistribution.weights import WeightedRegridder
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.faults import check_grids, explain_failure, find_unit, name_cells
from shockgrid.regrid.measure.quality import (
    SINE,
    compute_corner_areas,
    find_bad_cells,
    measure_rows,
)
from shockgrid.regrid.protocol import RegridReport, RegridResult

COEFFICIENT_I, COEFFICIENT_J, FLUX_I_X, FLUX_I_Y, FLUX_J_X, FLUX_J_Y = range(
    6
)  # rows of the fluxes: w g22, w g11, their products with d1, d2
SCALE, ALONG_I, ALONG_J = range(3)  # rows of the nodes' coefficients
SMALLEST_TAU = 1.0  # for two-cell modes; the largest, for the block's modes, follows from its size
LEAST_CYCLED_TAU = 0.25  # of a step, however often tau has been lowered
LEAST_TAU_FACTOR = 0.01  # by which tau has been lowered, at most
LEAST_DIRECTION_SHARE = 0.05  # of the weaker direction in the coefficients
LEAST_SINE = 0.1  # of a corner: below this the iteration is starting to fold


@dataclass(frozen=True)
class Equidistributed:
    """A grid and its iteration history: one value per iterate, the initial one first.

    `stop` is "converged", "stalled" or "iterations".  `residuals` are root mean squares relative to
    the fluxes, `spreads` standard deviations of w S over its mean, `best` is the iterate returned.
    `faces`: the same for the six faces of a volume, if they were computed first, named by their
    normal axis and its end ("0 low" to "2 high").
    """

    nodes: np.ndarray
    stop: str
    best: int
    residuals: np.ndarray
    spreads: np.ndarray
    faces: Mapping[str, Equidistributed] = field(default_factory=dict)


@kernel
def fill_cell_fluxes(nodes, weight, out, products):
    """Coefficients and fluxes (6, ni, nj) at cell centres, and w times cell area."""
    x, y = nodes[0], nodes[1]
    for i in range(weight.shape[0]):
        for j in range(weight.shape[1]):
            rising_x, rising_y = x[i + 1, j + 1] - x[i, j], y[i + 1, j + 1] - y[i, j]
            falling_x, falling_y = x[i + 1, j] - x[i, j + 1], y[i + 1, j] - y[i, j + 1]
            d1x, d1y = 0.5 * (rising_x + falling_x), 0.5 * (rising_y + falling_y)
            d2x, d2y = 0.5 * (rising_x - falling_x), 0.5 * (rising_y - falling_y)
            a = weight[i, j] * (d2x * d2x + d2y * d2y)
            b = weight[i, j] * (d1x * d1x + d1y * d1y)
            out[COEFFICIENT_I, i, j] = a
            out[COEFFICIENT_J, i, j] = b
            out[FLUX_I_X, i, j] = a * d1x
            out[FLUX_I_Y, i, j] = a * d1y
            out[FLUX_J_X, i, j] = b * d2x
            out[FLUX_J_Y, i, j] = b * d2y
            products[i, j] = weight[i, j] * (d1x * d2y - d1y * d2x)


@kernel
def fill_nodes_equation(flux, residual, coefficients, sums):
    """Residual (2, ni-1, nj-1) of theory R10.3 inside, and three-point coefficients (3, ...).

    Coefficients: the scale C of a node; the edge from node i - 1 to i, stored at node i, along i;
    likewise along j (both with one edge more than inner nodes).  sums (2, ni-1): per row, squares
    of the residual and of the fluxes that make it up.
    """
    ni, nj = flux.shape[1], flux.shape[2]
    # coefficients of edges along i, then along j
    for i in range(ni):
        for j in range(nj - 1):
            coefficients[ALONG_I, i, j] = 0.5 * (
                flux[COEFFICIENT_I, i, j] + flux[COEFFICIENT_I, i, j + 1]
            )
    for i in range(ni - 1):
        for j in range(nj):
            coefficients[ALONG_J, i, j] = 0.5 * (
                flux[COEFFICIENT_J, i, j] + flux[COEFFICIENT_J, i + 1, j]
            )
    for i in range(ni - 1):
        for j in range(nj - 1):
            # scale C of a node, from its four cells
            low_a = flux[COEFFICIENT_I, i, j] + flux[COEFFICIENT_I, i, j + 1]
            low_b = flux[COEFFICIENT_J, i, j] + flux[COEFFICIENT_J, i, j + 1]
            high_a = flux[COEFFICIENT_I, i + 1, j] + flux[COEFFICIENT_I, i + 1, j + 1]
            high_b = flux[COEFFICIENT_J, i + 1, j] + flux[COEFFICIENT_J, i + 1, j + 1]
            coefficients[SCALE, i, j] = 0.125 * ((low_a + high_a) + (low_b + high_b))
        # residual (R10.3)
        for k in range(2):
            for j in range(nj - 1):
                along = (flux[FLUX_I_X + k, i + 1, j] + flux[FLUX_I_X + k, i + 1, j + 1]) - (
                    flux[FLUX_I_X + k, i, j] + flux[FLUX_I_X + k, i, j + 1]
                )
                across = (flux[FLUX_J_X + k, i, j + 1] + flux[FLUX_J_X + k, i + 1, j + 1]) - (
                    flux[FLUX_J_X + k, i, j] + flux[FLUX_J_X + k, i + 1, j]
                )
                residual[k, i, j] = 0.5 * (along + across)
        # squares of the row, for the relative residual
        size = 0.0
        flux_squares = 0.0
        for j in range(nj - 1):
            size += residual[0, i, j] ** 2 + residual[1, i, j] ** 2
            flux_squares += flux[FLUX_I_X, i, j] ** 2 + flux[FLUX_I_Y, i, j] ** 2
            flux_squares += flux[FLUX_J_X, i, j] ** 2 + flux[FLUX_J_Y, i, j] ** 2
        sums[0, i] = size
        sums[1, i] = flux_squares


@kernel
def solve_lines(scale, edge, tau, values, upper):
    """Solve `(C + tau L) d = values` along the first index for all lines at once, in place.

    scale (n, m), edge (n + 1, m), values (2, n, m), upper (n, m) is scratch.
    """
    n, m = scale.shape
    for k in range(n):
        for j in range(m):
            coupling = tau * edge[k, j]
            pivot = scale[k, j] + tau * (edge[k, j] + edge[k + 1, j])
            if k > 0:
                pivot -= coupling * upper[k - 1, j]
                values[0, k, j] += coupling * values[0, k - 1, j]
                values[1, k, j] += coupling * values[1, k - 1, j]
            inverse = 1.0 / pivot
            upper[k, j] = tau * edge[k + 1, j] * inverse
            values[0, k, j] *= inverse
            values[1, k, j] *= inverse
    for k in range(n - 2, -1, -1):
        for j in range(m):
            values[0, k, j] += upper[k, j] * values[0, k + 1, j]
            values[1, k, j] += upper[k, j] * values[1, k + 1, j]


def sweep_both_ways(values, scales, edges, tau: float, nodes: np.ndarray) -> None:
    """Alternating-direction correction of the inner `nodes`: lines along i, then along j.

    values (2, n, m), the residual, is overwritten; scales (n, m) twice, edges (n+1, m) and (m+1,
    n): three-point coefficients along i and along j.
    """
    values *= tau
    solve_lines(scales[0], edges[0], tau, values, np.empty_like(scales[0]))
    values *= scales[1]
    turned, scale = (np.ascontiguousarray(np.swapaxes(a, -1, -2)) for a in (values, scales[1]))
    solve_lines(scale, edges[1], tau, turned, np.empty_like(scale))
    nodes[:, 1:-1, 1:-1] += turned.transpose(0, 2, 1)


def iterate(
    operator, nodes: np.ndarray, weigh: Callable, iterations: int, tolerance: float
) -> Equidistributed:
    """Correct the inner `nodes` in place until the residual is below `tolerance` or stops falling.

    `operator` evaluates the equations (`products`: w times cell size), accepts or rejects iterates,
    chooses tau and makes the correction; an example is `Ed2Operator`.

    Returns the accepted iterate of least residual; `best` is -1 if there was none.
    """
    best = -1
    least_residual = np.inf
    stop = "iterations"
    best_nodes = nodes.copy()
    residuals: list[float] = []
    spreads: list[float] = []
    for iteration in range(iterations + 1):
        # residual of this iterate
        residual = operator.evaluate(nodes, weigh(nodes))
        if not np.isfinite(residual):
            stop = "stalled"
            break
        products = operator.products
        if iteration == 0:
            operator.sign = 1.0 if products.sum() >= 0.0 else -1.0
        residuals.append(residual)
        # how even w times cell size is
        mean = products.mean()
        spreads.append(float(products.std() / abs(mean)) if mean != 0.0 else np.inf)
        # the best valid iterate is kept
        is_last = iteration == iterations or residual <= tolerance
        if residual < least_residual and operator.is_good(nodes, iteration, is_last):
            best = iteration
            least_residual = residual
            best_nodes[:] = nodes
        # ended, or no better for a while
        if best == iteration and residual <= tolerance:
            stop = "converged"
            break
        if best >= 0 and iteration - best >= operator.patience:
            stop = "stalled"
            break
        if iteration < iterations:
            operator.correct(nodes, operator.choose_tau(iteration, residuals))
    return Equidistributed(best_nodes, stop, best, np.array(residuals), np.array(spreads))


class Ed2Operator:
    """ED2 on areas of one shape.

    Iterates with a corner sine below `least_sine` are accepted only if the start was as sharp.
    """

    patience = 100

    def __init__(self, shape: tuple[int, int], least_sine: float = 0.0):
        ni, nj = self.shape = shape
        if min(shape) < 2:
            raise BadInput(f"equidistribution: a block needs at least 2 x 2 cells, got {shape}")
        self.flux = np.empty((6, ni, nj))
        self.products = np.empty((ni, nj))
        self.residual = np.empty((2, ni - 1, nj - 1))
        self.coefficients = np.empty((3, ni, nj))
        self.sums = np.empty((2, ni - 1))
        self.worst = np.empty((4, ni))
        self.bad_cells = np.empty(ni, dtype=np.int64)
        self.rows = np.empty((4, nj))
        self.sign = 1.0
        self.least_sine = least_sine
        self.tau_factor = 1.0

    def evaluate(self, nodes: np.ndarray, weight: np.ndarray) -> float:
        """Evaluate the equations at `nodes`; returns the rms residual over the rms fluxes."""
        fill_cell_fluxes(nodes, weight, self.flux, self.products)
        fill_nodes_equation(self.flux, self.residual, self.coefficients, self.sums)
        size, flux_squares = self.sums.sum(axis=1)
        return float(np.sqrt(size / flux_squares)) if flux_squares > 0.0 else np.inf

    def is_good(self, nodes: np.ndarray, iteration: int, ended: bool) -> bool:
        """Whether an iterate may be returned: convex, and not too sharp."""
        sine = self.measure_sine(nodes)
        if iteration == 0 and sine > 0.0:
            self.least_sine = min(self.least_sine, sine)
        return sine > 0.0 and sine >= self.least_sine

    def choose_tau(self, iteration: int, residuals: list[float]) -> float:
        """The next tau of a cycle; after a cycle that increased the residual, a smaller one."""
        if iteration == 0 or iteration % self.taus.size == 0:
            if iteration > 0:
                worse = residuals[-1] > residuals[-1 - self.taus.size]
                factor = self.tau_factor
                smaller = max(0.25 * factor, LEAST_TAU_FACTOR)
                self.tau_factor = smaller if worse else min(2.0 * factor, 1.0)
            self.taus = choose_taus(self)
        return max(self.tau_factor * self.taus[iteration % self.taus.size], LEAST_CYCLED_TAU)

    def measure_sine(self, nodes: np.ndarray) -> float:
        """Least corner sine; 0 unless every cell is convex and oriented like the start."""
        if self.sign < 0.0:
            nodes = np.ascontiguousarray(nodes[::-1])
        measure_rows(nodes, self.rows, self.worst, self.bad_cells)
        return 0.0 if self.bad_cells.any() else float(np.sqrt(self.worst[SINE].min()))

    def correct(self, nodes: np.ndarray, tau: float) -> None:
        """One alternating-direction correction of the inner nodes, after `evaluate`."""
        n, m = self.residual.shape[1:]
        scale, along_i, along_j = self.coefficients
        scale = np.ascontiguousarray(scale[:n, :m])
        along_i = np.ascontiguousarray(along_i[:, :m])
        edges = along_i, np.ascontiguousarray(along_j[:n].T)
        sweep_both_ways(self.residual, (scale, scale), edges, tau, nodes)


def choose_taus(operator: Ed2Operator) -> np.ndarray:
    """A cycle of tau from the bounds of the scaled three-point operators.

    The largest eigenvalue of L/C is about 4, the smallest about `(pi/n)^2` times the coefficients'
    share; tau covers the range of their inverses in factors of four.
    """
    n = min(operator.shape)
    share = 0.5 * operator.flux[: COEFFICIENT_J + 1].sum(axis=(1, 2))
    weak = max(float(share.min() / share.sum()), LEAST_DIRECTION_SHARE)
    return make_cycle(1.0 / (weak * (np.pi / n) ** 2))


def make_cycle(largest: float) -> np.ndarray:
    """Values of tau from the largest to SMALLEST_TAU, each at least a fourth of the one before."""
    largest = max(4.0 * SMALLEST_TAU, largest)
    count = 1 + int(np.ceil(np.log(largest / SMALLEST_TAU) / np.log(4.0)))
    return np.geomspace(largest, SMALLEST_TAU, count)


def iterate_ed2(
    nodes: np.ndarray,
    weigh: Callable[[np.ndarray], np.ndarray],
    iterations: int = 200,
    tolerance: float = 1e-10,
    least_sine: float = 0.0,
) -> Equidistributed:
    """Iterate theory R10.4 from `nodes` (2, ni+1, nj+1) with fixed sides; `weigh(nodes)` returns w.

    Returns the convex iterate of least residual; one with a corner sine below `least_sine` counts
    only if the start was as sharp.  Raises RegridFailure, naming cells, if no iterate is convex.
    """
    nodes = np.array(nodes, dtype=np.float64, order="C")
    if not np.isfinite(nodes).all():
        raise BadInput("equidistribution: the grid has nodes that are not finite numbers")
    operator = Ed2Operator((nodes.shape[1] - 1, nodes.shape[2] - 1), least_sine)
    solution = iterate(operator, nodes, weigh, iterations, tolerance)
    if solution.best < 0:
        bad_cells = find_bad_cells(nodes if operator.sign > 0.0 else nodes[::-1])
        raise RegridFailure(
            f"cells {name_cells(bad_cells)} of the equidistributed grid are not convex after "
            f"{solution.residuals.size - 1} iterations",
            grid=nodes,
        )
    return solution


class EquidistributionRegridder(WeightedRegridder):
    """`weight`: see `equidistribution.weights`; `smoothing`: passes over field-dependent weights.

    `boundary` "given" leaves the sides' nodes bitwise; "equidistributed" places them along the
    sides' polylines with the same weight (theory R10.9).  `iterations` and `tolerance` (residual
    over fluxes) end the iteration.
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
        self.iterations = int(iterations)
        self.tolerance = float(tolerance)
        self.threads = threads

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid on the sides of `boundary`; raises RegridFailure if no iterate is convex."""
        previous, boundary = check_grids(previous, boundary)
        boundary = self.distribute_sides(previous, boundary)
        # a start on the new sides
        old_areas = compute_corner_areas(previous)
        sign = 1.0 if old_areas.sum() >= 0.0 else -1.0
        nodes, start = begin_grid(previous, boundary, sign)
        # equations in lengths of the grid
        unit = find_unit(nodes)
        try:
            if min(nodes.shape[1:]) < 3:  # no inner node
                solution = accept_sides(nodes, sign)
            else:
                weigh = self.weight.on(previous, boundary)
                solution = iterate_ed2(
                    nodes / unit,
                    lambda grid: weigh(grid * unit),
                    self.iterations,
                    self.tolerance,
                    least_sine=LEAST_SINE,
                )
                solution = replace(solution, nodes=solution.nodes * unit)
        except RegridFailure as failure:
            grid = None if failure.grid is None else failure.grid * unit
            raise explain_failure(
                boundary, nodes[:: int(sign)], also=str(failure), grid=grid
            ) from failure
        # what it took
        inner = (nodes.shape[1] - 2) * (nodes.shape[2] - 2)
        iterations = solution.residuals.size - 1
        ratio = float((compute_corner_areas(solution.nodes) / old_areas).min())
        residual = float(solution.residuals[solution.best])
        report = RegridReport(iterations, iterations * inner, 0, 0, ratio, residual, start)
        return RegridResult(solution.nodes, report)


def accept_sides(nodes: np.ndarray, sign: float) -> Equidistributed:
    """A block one cell wide, whose grid is its sides; raises RegridFailure if it folds."""
    bad = find_bad_cells(nodes if sign > 0.0 else nodes[::-1])
    if len(bad):
        raise RegridFailure(f"cell ({bad[0][0]}, {bad[0][1]}) is not convex")
    return Equidistributed(nodes, "converged", 0, np.zeros(1), np.zeros(1))
