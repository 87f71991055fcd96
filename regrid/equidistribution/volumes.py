"""ED3: grids of a volume with constant weight times cell volume, faces and edges first.

    ∂1(g22 g33 w ∂1 x) + ∂2(g11 g33 w ∂2 x) + ∂3(g11 g22 w ∂3 x) = 0      theory R10.5

by the stabilising correction (theory R10.6), in increments `(C + tau L1) C^-1 (C + tau L2) C^-1
(C + tau L3) d = tau R`, with R the exact discrete residual, L the three-point operators with the
iterate's edge coefficients, and C their local size.

EDC, a curve f(p) in the plane or in space:    ∂(w |f'(p)| ∂p/∂q)/∂q = 0          theory R10.7
EDS, a surface f(p1, p2):  ∂1(W g~22 ∂1 p) + ∂2(W g~11 ∂2 p) = 0,  W = w J/J~     theory R10.8

g~ and J~ are those of p(q), J is the area of a surface cell.  Both act on the parameters, so the
nodes stay on the curve or surface.  EDC is solved as w times chord, by Newton's method; EDS is ED2
in the plane of the parameters, with W in place of w, and inherits its limits.  The paper prints
W = w sqrt(g22 g33)/J~, which equals this only for orthogonal grids.  With the area itself, a plane
with Cartesian parameters has W = w on every grid: EDS is then ED2 term by term, as the paper says.

`equidistribute_block` follows the paper's order: edges (EDC), faces (EDS), then the volume, all
with one weight.  The regridder's default weight "sides" is the node density implied by the faces
(theory R10.10, with three lengths).

Note: as in two dimensions the full equation is degenerate although the lagged one is not (see
`regrid.equidistribution.areas`): w times volume becomes constant only if the sides allow an
orthogonal grid.  The result states why the iteration stopped and is the valid iterate of least
residual.

Rows run along the contiguous third index.  A row of cells is computed in one flat scratch array at
constant offsets and reduced to the contributions to its nodes; a plane of cells contributes to the
two adjacent planes of nodes, lower plane first, so results are bitwise independent of the division
into chunks of planes.  Rows longer than VOLUME_SPAN do not fit the scratch.

Source: [KhakimzyanovShokina1998] §3 to §5.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace

import numpy as np
from numba import prange

from shockgrid.regrid.curves import equalise_products, equidistribute
from shockgrid.regrid.equidistribution.areas import Equidistributed, iterate, iterate_ed2
from shockgrid.regrid.equidistribution.weights import weigh_points
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.hexahedra.faces import (
    carry_faces,
    check_grids_in_space,
    compute_face_density,
    compute_volume,
    copy_faces,
    fill_from_faces,
    find_unit_in_space,
)
from shockgrid.regrid.hexahedra.functional import cross, dot
from shockgrid.regrid.jit import can_use_threads, inlined, kernel
from shockgrid.regrid.measure.corners import compute_centres, compute_hexahedron_centres
from shockgrid.regrid.measure.faults import name_cells
from shockgrid.regrid.measure.hexahedra import (
    compute_corner_ratio,
    compute_least_corner_volumes,
    find_bad_hexahedra,
)
from shockgrid.regrid.protocol import RegridReport, RegridResult


def solve_edc(
    curve: Callable[[np.ndarray], np.ndarray],
    weight,
    count: int,
    start: float = 0.0,
    end: float = 1.0,
) -> np.ndarray:
    """Parameters p (count,) with `w |x[j+1] - x[j]|` equal on all steps (theory R10.7).

    curve: p (n,) to points (2, n) or (3, n); weight: a positive number or a function of the
    coordinates, evaluated at the curve's points in the middle of the intervals of p.  Raises
    RegridFailure if no such nodes are found.
    """
    if count < 2:
        raise BadInput(f"equidistribution: a curve needs at least 2 nodes, got {count}")

    def weigh(left, right):
        chord = np.sqrt(((curve(right) - curve(left)) ** 2).sum(axis=0))
        return weigh_points(weight, curve(0.5 * (left + right))) * chord / np.abs(right - left)

    fine = np.linspace(start, end, 20 * count + 1)
    return equalise_products(weigh, equidistribute(fine, weigh(fine[:-1], fine[1:]), count))


def compute_surface_areas(points: np.ndarray) -> np.ndarray:
    """Areas (ni, nj) of surface cells by their mid-lines; points (3, ni+1, nj+1)."""
    rising_diagonal = points[:, 1:, 1:] - points[:, :-1, :-1]
    falling_diagonal = points[:, 1:, :-1] - points[:, :-1, 1:]
    mid_i = 0.5 * (rising_diagonal + falling_diagonal)
    mid_j = 0.5 * (rising_diagonal - falling_diagonal)
    normal = np.cross(mid_i, mid_j, axis=0)
    return np.sqrt((normal**2).sum(axis=0))


def compute_parameter_areas(parameters: np.ndarray) -> np.ndarray:
    """Signed areas J~ (ni, nj) of the cells in the plane of the parameters (2, ni+1, nj+1)."""
    rising_diagonal = parameters[:, 1:, 1:] - parameters[:, :-1, :-1]
    falling_diagonal = parameters[:, 1:, :-1] - parameters[:, :-1, 1:]
    return 0.5 * (
        rising_diagonal[1] * falling_diagonal[0] - rising_diagonal[0] * falling_diagonal[1]
    )


def weigh_surface(surface, weight, parameters: np.ndarray) -> np.ndarray:
    """W = w J/J~ at the cells (ni, nj): the weight of ED2 in the plane of the parameters.

    The weight is evaluated at the mean of a cell's four nodes in space.
    """
    points = surface(parameters)
    parameter_areas = np.abs(compute_parameter_areas(parameters))
    ratio = compute_surface_areas(points) / np.maximum(
        parameter_areas, 1e-12 * parameter_areas.mean()
    )
    # A collapsed cell on the surface still needs a positive coefficient.
    return weigh_points(weight, compute_centres(points)) * np.maximum(ratio, 1e-12 * ratio.mean())


def solve_eds(
    surface: Callable[[np.ndarray], np.ndarray],
    parameters: np.ndarray,
    weight=1.0,
    iterations: int = 200,
    tolerance: float = 1e-10,
) -> Equidistributed:
    """Parameters of a grid on `surface` with weight times cell area constant.

    surface: p (2, ...) to points (3, ...); parameters (2, ni+1, nj+1): the initial grid, whose
    sides are fixed; weight: a positive number or a function of x, y, z.  The result's nodes are
    parameters, its spreads those of w times area on the surface.
    """
    return iterate_ed2(
        parameters,
        lambda grid: weigh_surface(surface, weight, grid),
        iterations,
        tolerance,
    )


VOLUME_SPAN = 520  # longest row and its padding
LONGEST_VOLUME_ROW = 512
# Rows of the scratch: differences of x, y, z along the three directions at cell centres; three
# coefficients; w J; sums over neighbours along k of this row of cells, also of the first two
# coefficients; the same for the row before, and the third coefficient there.
D, A, WV, K, KA, L, LA, LC = (k * VOLUME_SPAN for k in (0, 9, 12, 13, 22, 24, 33, 35))
VOLUME_SCRATCH = 36 * VOLUME_SPAN
# rows of a plane's lines along k, transposed, after the right-hand sides
SCALE_ROW = 3
EDGE_ROW = 4


@inlined
def difference_row(x, i, j, n, Z, start):
    """Cell-centred differences of one coordinate along a row of cells (theory R10.5)."""
    r00 = x[i, j]
    r01 = x[i, j + 1]
    r10 = x[i + 1, j]
    r11 = x[i + 1, j + 1]
    for k in range(n):
        sum_00 = r00[k] + r00[k + 1]
        sum_01 = r01[k] + r01[k + 1]
        sum_10 = r10[k] + r10[k + 1]
        sum_11 = r11[k] + r11[k + 1]
        Z[start + k] = 0.25 * ((sum_11 + sum_10) - (sum_01 + sum_00))
        Z[start + 3 * VOLUME_SPAN + k] = 0.25 * ((sum_11 + sum_01) - (sum_10 + sum_00))
        next_sum = (r00[k + 1] + r11[k + 1]) + (r01[k + 1] + r10[k + 1])
        Z[start + 6 * VOLUME_SPAN + k] = 0.25 * (next_sum - ((r00[k] + r11[k]) + (r01[k] + r10[k])))


@inlined
def weigh_row(weight, n, Z):
    """Coefficients w g22 g33, w g11 g33, w g11 g22 and w J along a row of cells."""
    for k in range(n):
        a = (Z[D + k], Z[D + VOLUME_SPAN + k], Z[D + 2 * VOLUME_SPAN + k])
        b = (Z[D + 3 * VOLUME_SPAN + k], Z[D + 4 * VOLUME_SPAN + k], Z[D + 5 * VOLUME_SPAN + k])
        c = (Z[D + 6 * VOLUME_SPAN + k], Z[D + 7 * VOLUME_SPAN + k], Z[D + 8 * VOLUME_SPAN + k])
        g11 = dot(a, a)
        g22 = dot(b, b)
        g33 = dot(c, c)
        cell_weight = weight[k]
        Z[A + k] = cell_weight * (g22 * g33)
        Z[A + VOLUME_SPAN + k] = cell_weight * (g11 * g33)
        Z[A + 2 * VOLUME_SPAN + k] = cell_weight * (g11 * g22)
        Z[WV + k] = cell_weight * dot(a, cross(b, c))


@inlined
def sum_row(n, Z):
    """Sums (along k, differences) over neighbours along k, at inner nodes 1..n-1 in 0..n-2."""
    for direction in range(3):
        factor = A + direction * VOLUME_SPAN
        sign = -1.0 if direction == 2 else 1.0
        a = Z[factor : factor + n]
        for row in range(
            3 * direction * VOLUME_SPAN, 3 * (direction + 1) * VOLUME_SPAN, VOLUME_SPAN
        ):
            d = Z[D + row : D + row + n]
            total = Z[K + row : K + row + n]
            for k in range(n - 1):
                total[k] = a[k + 1] * d[k + 1] + sign * (a[k] * d[k])
        if direction < 2:
            total = Z[KA + direction * VOLUME_SPAN : KA + direction * VOLUME_SPAN + n]
            for k in range(n - 1):
                total[k] = a[k] + a[k + 1]


@inlined
def scatter_row(adds_to_lower, stores_in_upper, lower, upper, n, Z, component):
    """Contribution of a row to the residual: added to the nodes below in i, stored at those above.

    c: VOLUME_SPAN times the index of the component.
    """
    for k in range(n - 1):
        across = Z[K + 3 * VOLUME_SPAN + component + k] - Z[L + 3 * VOLUME_SPAN + component + k]
        across += Z[K + 6 * VOLUME_SPAN + component + k] + Z[L + 6 * VOLUME_SPAN + component + k]
        along = Z[K + component + k] + Z[L + component + k]
        if adds_to_lower:
            lower[k] += 0.25 * (across + along)
        if stores_in_upper:
            upper[k] = 0.25 * (across - along)


@inlined
def scatter_edges(adds_to_lower, stores_in_upper, lower, upper, n, Z, first_row, second_row):
    """Add a quarter of two rows of coefficients to the edges of the planes below and above."""
    for k in range(n):
        quarter_sum = 0.25 * (Z[first_row + k] + Z[second_row + k])
        if adds_to_lower:
            lower[k] += quarter_sum
        if stores_in_upper:
            upper[k] = quarter_sum


@kernel
def assemble_planes(nodes, weight, residual, edges, products, first, last, Z):
    """Residual of (3.16) and edge coefficients of the planes of nodes first..last-1 (inner: 1..).

    nodes (3, n1+1, n2+1, n3+1), weight and products (w J) (n1, n2, n3), residual (3, n1-1, n2-1,
    n3-1); edges (n1, n2-1, n3-1), (n1-1, n2, n3-1), (n1-1, n2-1, n3): means of the coefficients
    of the four cells around an edge.  Z is scratch.
    """
    e1, e2, e3 = edges
    n1, n2, n = weight.shape
    for i in range(first - 1, last):
        adds_to_lower, stores_in_upper = i >= first, i + 1 < last
        is_own_row = adds_to_lower or first == 1
        low, high = max(i - 1, 0), min(i, n1 - 2)
        for j in range(n2):
            for c in range(3):
                difference_row(nodes[c], i, j, n, Z, D + c * VOLUME_SPAN)
            weigh_row(weight[i, j], n, Z)
            sum_row(n, Z)
            if is_own_row:
                row = products[i, j]
                for k in range(n):
                    row[k] = Z[WV + k]
            total = Z[KA + VOLUME_SPAN : KA + 2 * VOLUME_SPAN]
            for k in range(n - 1):
                if adds_to_lower:
                    e2[low, j, k] += 0.25 * total[k]
                if stores_in_upper:
                    e2[high, j, k] = 0.25 * total[k]
            if j > 0:
                if is_own_row:
                    scatter_edges(False, True, e1[i, j - 1], e1[i, j - 1], n - 1, Z, KA, LA)
                lower, upper = e3[low, j - 1], e3[high, j - 1]
                scatter_edges(
                    adds_to_lower, stores_in_upper, lower, upper, n, Z, A + 2 * VOLUME_SPAN, LC
                )
                for c in range(3):
                    lower, upper = residual[c, low, j - 1], residual[c, high, j - 1]
                    scatter_row(adds_to_lower, stores_in_upper, lower, upper, n, Z, c * VOLUME_SPAN)
            # this row's sums become those of the previous row
            for offset in range(0, L - K, VOLUME_SPAN):
                for k in range(n):
                    Z[L + offset + k] = Z[K + offset + k]
            for k in range(n):
                Z[LC + k] = Z[A + 2 * VOLUME_SPAN + k]


@inlined
def eliminate(lines, lines_before, edges, scales, fixed_weight, tau, link, factors):
    """One elimination step along adjacent lines: (scale + tau L) d = weight times `lines`.

    `lines` and `lines_before` are x, y, z of this node and of the previous one; `edges` its low and
    high edge; `factors` the elimination factors of the previous node and of this one, which may
    share memory with `scales`; the weight is `fixed_weight` or, where that is 0, the scale; `link`
    is 0 at the first node, otherwise tau.
    """
    low_edge, high_edge = edges
    factor_before, factor_here = factors
    x, y, z = lines
    x_before, y_before, z_before = lines_before
    for k in range(scales.shape[0]):
        scale = scales[k]
        coupling = link * low_edge[k]
        inverse = 1.0 / (scale + tau * (low_edge[k] + high_edge[k]) - coupling * factor_before[k])
        weight = fixed_weight if fixed_weight > 0.0 else scale
        factor_here[k] = tau * high_edge[k] * inverse
        x[k] = (weight * x[k] + coupling * x_before[k]) * inverse
        y[k] = (weight * y[k] + coupling * y_before[k]) * inverse
        z[k] = (weight * z[k] + coupling * z_before[k]) * inverse


@kernel
def sweep_first(residual, edges, tau, work, start, stop):
    """Solve `(C + tau L1) d = tau R` along i for the lines start..stop-1 of j, into `residual`.

    work (2, ...), like two residuals: the scale C, a sixth of the six edges' sum, is written; then
    scratch.
    """
    e1, e2, e3 = edges
    scale = work[0]
    factor_rows = work[1]
    n = residual.shape[1]
    m = residual.shape[3]
    # forward along i: all lines of the planes together
    for i in range(n):
        i_before = max(i - 1, 0)
        link = tau if i > 0 else 0.0
        for j in range(start, stop):
            edge_i = e1[i, j]
            next_edge_i = e1[i + 1, j]
            edge_j = e2[i, j]
            next_edge_j = e2[i, j + 1]
            edge_k = e3[i, j]
            scale_row = scale[i, j]
            for k in range(m):
                scale_row[k] = (
                    (edge_i[k] + next_edge_i[k])
                    + (edge_j[k] + next_edge_j[k])
                    + (edge_k[k] + edge_k[k + 1])
                ) * (1.0 / 6.0)
            lines = residual[0, i, j], residual[1, i, j], residual[2, i, j]
            lines_before = (
                residual[0, i_before, j],
                residual[1, i_before, j],
                residual[2, i_before, j],
            )
            eliminate(
                lines,
                lines_before,
                (edge_i, next_edge_i),
                scale_row,
                tau,
                tau,
                link,
                (factor_rows[i_before, j], factor_rows[i, j]),
            )
    # backward
    for i in range(n - 2, -1, -1):
        for j in range(start, stop):
            for edge_j in range(3):
                row = residual[edge_j, i, j]
                row_after = residual[edge_j, i + 1, j]
                factors = factor_rows[i, j]
                for k in range(m):
                    row[k] += factors[k] * row_after[k]


@inlined
def add_next_rows(planes, factors, k, n):
    """Backward substitution: add to n numbers of row k their factors times those of the next row.

    planes: of x, y and z.
    """
    row_factors = factors[k]
    for plane in planes:
        row = plane[k]
        next_row = plane[k + 1]
        for j in range(n):
            row[j] += row_factors[j] * next_row[j]


@inlined
def sweep_along_j(planes, edges, scale, tau, upper):
    """Solve `(C + tau L2) d = C d` in the planes of x, y, z, forward, then backward along j."""
    x, y, z = planes
    n, m = x.shape
    for j in range(n):
        before = max(j - 1, 0)
        link = tau if j > 0 else 0.0
        lines = (x[j], y[j], z[j])
        lines_before = (x[before], y[before], z[before])
        line_edges = (edges[j], edges[j + 1])
        factors = (upper[before], upper[j])
        eliminate(lines, lines_before, line_edges, scale[j], 0.0, tau, link, factors)
    for j in range(n - 2, -1, -1):
        add_next_rows(planes, upper, j, m)


@inlined
def transpose_lines(planes, edges, scale, turned):
    """Transpose lines along k of the planes of x, y, z, their scales and edges into `turned`."""
    x, y, z = planes
    n, m = x.shape
    for j in range(n):
        row_x = x[j]
        row_y = y[j]
        row_z = z[j]
        scale_row = scale[j]
        edge_row = edges[j]
        for k in range(m):
            turned[0, k, j] = row_x[k]
            turned[1, k, j] = row_y[k]
            turned[2, k, j] = row_z[k]
            turned[SCALE_ROW, k, j] = scale_row[k]
            turned[EDGE_ROW, k, j] = edge_row[k]
        turned[EDGE_ROW, m, j] = edge_row[m]


@inlined
def sweep_along_k(turned, n, m, tau):
    """Solve `(C + tau L3) d = C d` for m transposed lines of n numbers; scales become factors."""
    for k in range(m):
        before = max(k - 1, 0)
        link = tau if k > 0 else 0.0
        lines = turned[0, k, :n], turned[1, k, :n], turned[2, k, :n]
        lines_before = (turned[0, before, :n], turned[1, before, :n], turned[2, before, :n])
        scale_row = turned[SCALE_ROW, k, :n]
        line_edges = turned[EDGE_ROW, k, :n], turned[EDGE_ROW, k + 1, :n]
        factors = (turned[SCALE_ROW, before, :n], scale_row)
        eliminate(lines, lines_before, line_edges, scale_row, 0.0, tau, link, factors)
    for k in range(m - 2, -1, -1):
        add_next_rows((turned[0], turned[1], turned[2]), turned[SCALE_ROW], k, n)


@kernel
def sweep_plane(residual, edges, tau, work, nodes, i, turned):
    """Solve `(C + tau L2) d = C d`, then `(C + tau L3) d = C d` in plane i; add d to the nodes.

    turned (5, n3, n2 + 8): the lines along k, transposed so that all are solved together.
    """
    planes = (residual[0, i], residual[1, i], residual[2, i])
    scale = work[0, i]
    n = residual.shape[2]
    m = residual.shape[3]
    sweep_along_j(planes, edges[1][i], scale, tau, work[1, i])
    transpose_lines(planes, edges[2][i], scale, turned)
    sweep_along_k(turned, n, m, tau)
    # added to the nodes
    for c in range(3):
        for j in range(n):
            row = nodes[c, i + 1, j + 1]
            for k in range(m):
                row[k + 1] += turned[c, k, j]


@kernel(parallel=True)
def assemble_on_threads(nodes, weight, residual, edges, products, bounds, Z):
    """`assemble_planes` for all chunks; bounds: their first inner planes."""
    for t in prange(bounds.shape[0] - 1):
        assemble_planes(nodes, weight, residual, edges, products, bounds[t], bounds[t + 1], Z[t])


@kernel
def sweep_chunk(residual, edges, tau, work, nodes, first, last, turned):
    """The sweeps along j and k in the planes of nodes first..last-1."""
    for i in range(first - 1, last - 1):
        sweep_plane(residual, edges, tau, work, nodes, i, turned)


@kernel(parallel=True)
def sweep_on_threads(residual, edges, tau, work, nodes, lines, bounds, turned):
    """The three sweeps: lines along i in chunks of j, then planes in chunks of i."""
    for t in prange(lines.shape[0] - 1):
        sweep_first(residual, edges, tau, work, lines[t], lines[t + 1])
    for t in prange(bounds.shape[0] - 1):
        sweep_chunk(residual, edges, tau, work, nodes, bounds[t], bounds[t + 1], turned[t])


FIRST_TAU = 1.0  # initial value, for the scaled operators with largest eigenvalue of about 4
LEAST_TAU = 0.1
MOST_TAU = 8.0
TAU_GROWTH = 1.1  # of tau while the residual falls; tau is halved when the residual grows
ITERATIONS_PER_CHECK = 10  # iterations between two tests of all corners


class Ed3Operator:
    """ED3 on volumes of one shape, with chunks of planes."""

    patience = 50
    sign = 1.0

    def __init__(self, shape: tuple[int, int, int], threads: int = 1):
        n1, n2, n3 = shape
        if min(shape) < 2 or n3 > LONGEST_VOLUME_ROW:
            raise BadInput(
                f"equidistribution: a volume needs at least 2 cells a direction and at most "
                f"{LONGEST_VOLUME_ROW} along the third, got {shape}"
            )
        self.threads = threads = max(1, min(int(threads), n1 - 1, n2 - 1))
        self.bounds = np.linspace(1, n1, threads + 1).astype(np.int64)
        self.lines = np.linspace(0, n2 - 1, threads + 1).astype(np.int64)
        self.residual = np.empty((3, n1 - 1, n2 - 1, n3 - 1))
        self.edges = (
            np.empty((n1, n2 - 1, n3 - 1)), np.empty((n1 - 1, n2, n3 - 1)),
            np.empty((n1 - 1, n2 - 1, n3)),
        )  # fmt: skip
        # zeros: the sweeps start with scratch times zero, which would keep a NaN
        self.work = np.zeros((2, n1 - 1, n2 - 1, n3 - 1))
        self.products = np.empty(shape)
        self.scratch = np.zeros((threads, VOLUME_SCRATCH))
        self.turned = np.empty((threads, 5, n3, n2 + 7))

    def evaluate(self, nodes: np.ndarray, weight: np.ndarray) -> float:
        """Evaluate the equations at `nodes`; returns the rms residual over a typical flux."""
        arrays = nodes, weight, self.residual, self.edges, self.products
        if self.threads > 1 and can_use_threads():
            assemble_on_threads(*arrays, self.bounds, self.scratch)
        else:
            assemble_planes(*arrays, *self.bounds, self.scratch[0])
        count = self.work[0].size
        size = float(np.einsum("cijk,cijk->", self.residual, self.residual))
        # A flux is about the coefficient times the spacing, the cube root of the volume.
        step = np.cbrt(abs(self.products.mean() / weight.mean()))
        flux = float(self.edges[0][1:].sum()) / count * step
        return float(np.sqrt(size / count) / flux) if flux > 0.0 else np.inf

    def is_good(self, nodes: np.ndarray, iteration: int, ended: bool) -> bool:
        """Whether an iterate may be returned; tested now and then, and at the end."""
        return (ended or iteration % ITERATIONS_PER_CHECK == 0) and is_valid(nodes, self.sign)

    def choose_tau(self, iteration: int, residuals: list[float]) -> float:
        """A larger tau while the residual falls, half of it where that grew."""
        if iteration == 0:
            self.tau = FIRST_TAU
        else:
            fell = residuals[-1] < residuals[-2]
            self.tau = max(
                min(TAU_GROWTH * self.tau, MOST_TAU) if fell else 0.5 * self.tau, LEAST_TAU
            )
        return self.tau

    def correct(self, nodes: np.ndarray, tau: float) -> None:
        """One stabilising correction of the inner nodes, after `evaluate`."""
        arrays = self.residual, self.edges, tau, self.work
        if self.threads > 1 and can_use_threads():
            sweep_on_threads(*arrays, nodes, self.lines, self.bounds, self.turned)
        else:
            sweep_first(*arrays, *self.lines)
            sweep_chunk(*arrays, nodes, *self.bounds, self.turned[0])


def solve_ed3(
    nodes: np.ndarray,
    weight=1.0,
    iterations: int = 100,
    tolerance: float = 1e-10,
    threads: int = 1,
) -> Equidistributed:
    """Equidistribute `weight` over a volume with the faces and the initial interior of `nodes`.

    nodes (3, n1+1, n2+1, n3+1); weight: a positive number, an array of the cells, or a function of
    the centres' x, y, z.  tau grows while the residual falls and is halved when it grows.  Raises
    RegridFailure, naming cells, if no tested iterate is valid.
    """
    nodes = np.array(nodes, dtype=np.float64, order="C")
    if nodes.ndim != 4 or nodes.shape[0] != 3 or not np.isfinite(nodes).all():
        raise BadInput(
            f"equidistribution: nodes must be finite, of shape (3, n1+1, n2+1, n3+1); got "
            f"{nodes.shape}"
        )
    operator = Ed3Operator(tuple(n - 1 for n in nodes.shape[1:]), threads)
    values = weigh_points(weight, compute_hexahedron_centres(nodes))

    def weigh(grid):
        return (
            weigh_points(weight, compute_hexahedron_centres(grid)) if callable(weight) else values
        )

    solution = iterate(operator, nodes, weigh, iterations, tolerance)
    if solution.best < 0:
        bad_cells = find_bad_hexahedra(nodes if operator.sign > 0.0 else nodes[::-1])
        raise RegridFailure(
            f"cells {name_cells(bad_cells)} of the equidistributed volume have corners that are "
            f"not positive after {solution.residuals.size - 1} iterations"
        )
    return solution


def is_valid(nodes: np.ndarray, sign: float = 1.0) -> bool:
    """Whether every cell has eight positive corners in the orientation `sign`."""
    turned = nodes if sign > 0.0 else np.ascontiguousarray(nodes[::-1])
    return bool((compute_least_corner_volumes(turned) > 0.0).all())


def interpolate_faces(nodes: np.ndarray) -> np.ndarray:
    """A copy of `nodes` (3, ...), its interior interpolated from the six faces (Boolean sum)."""
    interpolated = np.array(nodes, dtype=np.float64, order="C")
    spacings = [np.tile(np.linspace(0.0, 1.0, n), (2, 2, 1)) for n in interpolated.shape[1:]]
    fill_from_faces(interpolated, spacings)
    return interpolated


def equidistribute_block(
    mapping: Callable[[np.ndarray], np.ndarray],
    shape: tuple[int, int, int],
    weight=1.0,
    iterations: int = 100,
    sides: bool = True,
    threads: int = 1,
) -> Equidistributed:
    """Grid of a block: edges, then faces, then the volume, with one weight.

    mapping: p in the unit cube (3, ...) to x (3, ...); shape: cells per direction; weight: a
    positive number or a function of x, y, z.  With `sides`, edges (EDC) and faces (EDS) are
    equidistributed first, as in theory R10; otherwise they have equal spacing in p.  Raises
    RegridFailure, naming the face or the cells that fold.
    """
    p = np.array(np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in shape), indexing="ij"))
    faces: dict[str, Equidistributed] = {}
    if sides:
        for axis in range(3):
            for ends in np.ndindex(2, 2):
                _place_edge(mapping, weight, p, axis, ends)
        for axis in range(3):
            for end in (0, -1):
                name = f"{axis} {'high' if end else 'low'}"
                try:
                    faces[name] = _place_face(mapping, weight, p, axis, end, iterations)
                except RegridFailure as failure:
                    raise RegridFailure(f"face {name}: {failure}", grid=failure.grid) from failure
        p = interpolate_faces(p)
    return replace(solve_ed3(mapping(p), weight, iterations, threads=threads), faces=faces)


def _place_edge(mapping, weight, p, axis, ends) -> None:
    """EDC along one of the twelve edges; writes the parameter `axis` of its nodes."""
    index = [-end for end in ends]
    index.insert(axis, slice(None))
    line = p[(slice(None), *index)]
    corner = line[:, :1].copy()

    def curve(s):
        points = np.repeat(corner, np.size(s), axis=1)
        points[axis] = s
        return mapping(points)

    line[axis] = solve_edc(curve, weight, line.shape[1])


def _place_face(mapping, weight, p, axis, end, iterations) -> Equidistributed:
    """EDS on one of the six faces, starting from its edges; writes two of its parameters."""
    index = [slice(None)] * 3
    index[axis] = end
    face = p[(slice(None), *index)]
    free = [k for k in range(3) if k != axis]
    level = float(-end)

    def surface(pair):
        points = np.empty((3, *pair.shape[1:]))
        points[axis] = level
        points[free[0]] = pair[0]
        points[free[1]] = pair[1]
        return mapping(points)

    start = interpolate_sides(face[free])
    solution = solve_eds(surface, start, weight, iterations)
    face[free[0]], face[free[1]] = solution.nodes
    return solution


def interpolate_sides(parameters: np.ndarray) -> np.ndarray:
    """A copy of (2, ni+1, nj+1), its interior interpolated from the sides (Boolean sum)."""
    interpolated = np.array(parameters, dtype=np.float64, order="C")
    u = np.linspace(0.0, 1.0, interpolated.shape[1])[:, None]
    v = np.linspace(0.0, 1.0, interpolated.shape[2])
    low = interpolated[:, :1]
    high = interpolated[:, -1:]
    near = interpolated[:, :, :1]
    far = interpolated[:, :, -1:]
    between_i = (1.0 - u) * low + u * high
    between_j = (1.0 - v) * near + v * far
    ends = (1.0 - v) * between_i[:, :, :1] + v * between_i[:, :, -1:]
    interpolated[:, 1:-1, 1:-1] = (between_i + between_j - ends)[:, 1:-1, 1:-1]
    return interpolated


class EquidistributionRegridder3D:
    """`weight`: "sides", a positive number, cells' values (ni, nj, nk), or a function of x, y, z.

    `iterations` and `tolerance` (residual over fluxes) end the iteration.
    """

    def __init__(self, weight="sides", iterations: int = 40, tolerance: float = 1e-8):
        if isinstance(weight, str) and weight != "sides":
            raise BadInput(
                f"equidistribution: weight '{weight}' in space must be 'sides', a number, an "
                "array of the cells or a function of x, y, z"
            )
        self.weight = weight
        self.iterations = int(iterations)
        self.tolerance = float(tolerance)

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid inside the six faces of `boundary`; both (3, ni+1, nj+1, nk+1) in m.

        Raises BadInput for arrays of wrong shape, and RegridFailure, naming cells, if no iterate
        has only positive corners.
        """
        previous, boundary = check_grids_in_space(previous, boundary)
        unit = find_unit_in_space(previous)
        if unit != 1.0:  # sixth powers of lengths would not be numbers
            return self._regrid_in(unit, previous, boundary)
        sign = 1.0 if compute_volume(previous) >= 0.0 else -1.0
        nodes = np.empty_like(previous)
        start = "displacement"
        carry_faces(previous, boundary, nodes)
        if not is_valid(nodes, sign):
            copy_faces(boundary, nodes)
            nodes = interpolate_faces(nodes)
            start = "transfinite"
        if min(nodes.shape[1:]) < 3:
            if not is_valid(nodes, sign):
                raise RegridFailure("the faces of a block one cell wide fold it")
            return RegridResult(nodes, self._report(0, 0.0, previous, nodes, start))
        weight = self.weight
        if isinstance(weight, str):
            weight = compute_face_density(boundary if sign > 0.0 else boundary[::-1])
        solution = solve_ed3(nodes, weight, self.iterations, self.tolerance)
        iterations = solution.residuals.size - 1
        residual = float(solution.residuals[solution.best])
        return RegridResult(
            solution.nodes, self._report(iterations, residual, previous, solution.nodes, start)
        )

    def _regrid_in(self, unit: float, previous, boundary) -> RegridResult:
        """`regrid` with lengths measured in `unit` [m]."""
        weight = self.weight
        scaled_regridder = copy(self)
        if callable(weight):
            scaled_regridder.weight = lambda *place: weight(
                *(unit * coordinate for coordinate in place)
            )
        result = scaled_regridder.regrid(previous / unit, boundary / unit)
        return replace(result, nodes=result.nodes * unit)

    @staticmethod
    def _report(iterations: int, residual: float, previous, nodes, start: str) -> RegridReport:
        inner = int(np.prod([n - 2 for n in nodes.shape[1:]]))
        ratio = compute_corner_ratio(nodes, previous)
        return RegridReport(iterations, iterations * inner, 0, 0, ratio, residual, start)
