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

The kernels are in `regrid.equidistribution.volume_sweeps`.

Source: [KhakimzyanovShokina1998] §3 to §5.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace

import numpy as np

from shockgrid.regrid.equidistribution.areas import Equidistributed, iterate, iterate_ed2
from shockgrid.regrid.equidistribution.volume_sweeps import (
    LONGEST_VOLUME_ROW,
    VOLUME_SCRATCH,
    assemble_on_threads,
    assemble_planes,
    sweep_chunk,
    sweep_first,
    sweep_on_threads,
)
from shockgrid.regrid.equidistribution.weights import weigh_points
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.hexahedra.faces import (
    check_grids_in_space,
    compute_face_density,
    compute_volume,
    copy_faces,
    fill_from_faces,
    find_unit_in_space,
    move_with_faces,
)
from shockgrid.regrid.jit import can_use_threads
from shockgrid.regrid.measure.corners import compute_centres, compute_hexahedron_centres
from shockgrid.regrid.measure.faults import name_cells
from shockgrid.regrid.measure.hexahedra import (
    compute_corner_ratio,
    compute_least_corner_volumes,
    find_bad_hexahedra,
)
from shockgrid.regrid.protocol import RegridReport, RegridResult
from shockgrid.regrid.spacings import equalise_products, equidistribute


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
        move_with_faces(previous, boundary, nodes)
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
