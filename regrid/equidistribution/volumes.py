"""ED3: grids of a volume with weight times cell volume constant.

    ∂1(g22 g33 w ∂1 x) + ∂2(g11 g33 w ∂2 x) + ∂3(g11 g22 w ∂3 x) = 0      theory R10.5

by the stabilising correction (theory R10.6): in increments it is
`(C + tau L1) C^-1 (C + tau L2) C^-1 (C + tau L3) d = tau R`, R the exact discrete residual, L the
three-point operators of the iterate's own edge coefficients, C their local size.

`equidistribute_block` does the paper's order of work: edges (EDC), faces (EDS), then the volume,
with one weight for all.

The trap: as in two dimensions the whole equation is degenerate where the lagged one is not (see
`regrid.equidistribution.areas`): w times volume becomes constant only where the sides allow a grid
of perpendicular lines.  What stopped the iteration is said, and the valid iterate of least residual
is returned.

Source: [KhakimzyanovShokina1998] §3; theory R10.5, R10.6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from regrid.equidistribution.areas import NAMED_CELLS, Equidistributed, weigh_points
from regrid.equidistribution.curves_and_surfaces import solve_edc, solve_eds
from regrid.equidistribution.volume_rows import (
    LONGEST,
    SCRATCH,
    assemble_on_threads,
    assemble_planes,
    measure_planes,
    sweep_on_threads,
    sweep_serially,
)
from regrid.errors import BadInput, RegridFailure
from regrid.measure.centres import compute_hexahedron_centres
from regrid.measure.hexahedra import compute_least_corner_volumes, find_bad_hexahedra

TAU = 1.0  # at first, of the scaled operators, whose largest eigenvalue is about 4
LEAST_TAU, MOST_TAU = 0.1, 8.0
GROWTH = 1.1  # of tau while the residual falls; it is halved where the residual grows
CHECK = 10  # iterations between two tests of all corners
PATIENCE = 50


class Ed3Operator:
    """The discrete equations on one grid shape, with their arrays and chunks of planes."""

    def __init__(self, shape: tuple[int, int, int], threads: int = 1):
        n1, n2, n3 = shape
        if min(shape) < 2 or n3 > LONGEST:
            raise BadInput(
                f"equidistribution: a volume needs at least 2 cells a direction and at most "
                f"{LONGEST} along the third, got {shape}"
            )
        self.threads = threads = max(1, min(int(threads), n1 - 1, n2 - 1))
        self.bounds = np.linspace(1, n1, threads + 1).astype(np.int64)
        self.lines = np.linspace(0, n2 - 1, threads + 1).astype(np.int64)
        self.residual = np.empty((3, n1 - 1, n2 - 1, n3 - 1))
        self.e1 = np.empty((n1, n2 - 1, n3 - 1))
        self.e2 = np.empty((n1 - 1, n2, n3 - 1))
        self.e3 = np.empty((n1 - 1, n2 - 1, n3))
        # zeros: the sweeps begin with `upper` times nothing, which a NaN there would spoil
        self.scale, self.upper = np.zeros((2, n1 - 1, n2 - 1, n3 - 1))
        self.products, self.sums = np.empty(shape), np.empty((2, n1 - 1))
        self.scratch = np.zeros((threads, SCRATCH))
        self.turned = np.empty((threads, 5, n3, n2 + 7))

    def evaluate(self, nodes: np.ndarray, weight: np.ndarray) -> float:
        """Fill the equations of `nodes`; the residual's root mean square over a typical flux."""
        edges = self.e1, self.e2, self.e3
        if self.threads > 1:
            assemble_on_threads(
                nodes, weight, self.residual, *edges, self.products, self.sums, self.bounds,
                self.scratch,
            )  # fmt: skip
        else:
            last, scratch = self.sums.shape[1] + 1, self.scratch[0]
            assemble_planes(
                nodes, weight, self.residual, *edges, self.products, 1, last, scratch
            )  # fmt: skip
            measure_planes(self.residual, self.e1, 1, last, self.sums, scratch)
        count = self.scale.size
        size, scale = self.sums.sum(axis=1)
        # A flux is about the coefficient times the step, the cube root of the volume.
        step = np.cbrt(abs(self.products.mean() / weight.mean()))
        flux = scale / count * step
        return float(np.sqrt(size / count) / flux) if flux > 0.0 else np.inf

    def measure_spread(self) -> float:
        """Standard deviation of w times volume over its mean."""
        mean = self.products.mean()
        return float(self.products.std() / abs(mean)) if mean != 0.0 else np.inf

    def correct(self, nodes: np.ndarray, tau: float) -> None:
        """One stabilising correction of the inner nodes, after `evaluate`."""
        arrays = self.residual, self.e1, self.e2, self.e3, tau, self.scale, self.upper, nodes
        if self.threads > 1:
            sweep_on_threads(*arrays, self.lines, self.bounds, self.turned)
        else:
            sweep_serially(*arrays, self.turned[0])


def solve_ed3(
    nodes: np.ndarray,
    weight=1.0,
    iterations: int = 100,
    tolerance: float = 1e-10,
    threads: int = 1,
) -> Equidistributed:
    """Equidistribute `weight` over the volume whose six faces and first inside are `nodes`.

    nodes (3, n1+1, n2+1, n3+1); weight: a positive number, an array of the cells, or a function of
    the centres' x, y, z.  tau grows while the residual falls and is halved where it grows.  Raises
    RegridFailure naming cells where no tested iterate has positive corners throughout.
    """
    nodes = np.array(nodes, dtype=np.float64, order="C")
    if nodes.ndim != 4 or nodes.shape[0] != 3 or not np.isfinite(nodes).all():
        raise BadInput(
            f"equidistribution: nodes must be finite, of shape (3, n1+1, n2+1, n3+1); got "
            f"{nodes.shape}"
        )
    operator = Ed3Operator(tuple(n - 1 for n in nodes.shape[1:]), threads)
    values = weigh_points(weight, compute_hexahedron_centres(nodes))
    kept, best, least, stop = nodes.copy(), -1, np.inf, "iterations"
    residuals, spreads, tau = [], [], TAU
    sign = 1.0
    for iteration in range(iterations + 1):
        if iteration > 0 and callable(weight):
            values = weigh_points(weight, compute_hexahedron_centres(nodes))
        residual = operator.evaluate(nodes, values)
        if not np.isfinite(residual):
            stop = "stalled"
            break
        if iteration == 0 and operator.products.sum() < 0.0:
            sign = -1.0
        if residuals:
            tau = min(GROWTH * tau, MOST_TAU) if residual < residuals[-1] else 0.5 * tau
            tau = max(tau, LEAST_TAU)
        residuals.append(residual)
        spreads.append(operator.measure_spread())
        ended = iteration == iterations or residual <= tolerance
        if (ended or iteration % CHECK == 0) and residual < least and is_valid(nodes, sign):
            kept[:] = nodes
            best, least = iteration, residual
        if best >= 0 and residual <= tolerance:
            stop = "converged"
            break
        if best >= 0 and iteration - best >= PATIENCE:
            stop = "stalled"
            break
        if iteration < iterations:
            operator.correct(nodes, tau)
    if best < 0:
        bad = find_bad_hexahedra(nodes if sign > 0.0 else nodes[::-1])
        named = ", ".join(f"({i}, {j}, {k})" for i, j, k in bad[:NAMED_CELLS])
        more = f" and {len(bad) - NAMED_CELLS} more" if len(bad) > NAMED_CELLS else ""
        raise RegridFailure(
            f"cells {named}{more} of the equidistributed volume have corners that are not "
            f"positive after {len(residuals) - 1} iterations"
        )
    return Equidistributed(kept, stop, best, np.array(residuals), np.array(spreads))


def is_valid(nodes: np.ndarray, sign: float = 1.0) -> bool:
    """Whether every cell has eight positive corners, in the orientation `sign`."""
    turned = nodes if sign > 0.0 else np.ascontiguousarray(nodes[::-1])
    return bool((compute_least_corner_volumes(turned) > 0.0).all())


def interpolate_faces(nodes: np.ndarray) -> np.ndarray:
    """A copy of `nodes` (3, ...) with its inside interpolated from the six faces (boolean sum)."""
    found = np.array(nodes, dtype=np.float64, order="C")
    total = np.zeros_like(found)
    ends = [np.s_[:, [0, -1]], np.s_[:, :, [0, -1]], np.s_[..., [0, -1]]]
    blends = []
    for axis in range(3):
        q = np.linspace(0.0, 1.0, found.shape[axis + 1])
        blends.append(np.array([1.0 - q, q]))

    def project(values, axis):
        """Linear interpolation between the two ends along one axis."""
        faces = np.moveaxis(values[ends[axis]], axis + 1, -1)
        return np.moveaxis(faces @ blends[axis], -1, axis + 1)

    first, second, third = (project(found, axis) for axis in range(3))
    pairs = project(first, 1) + project(second, 2) + project(third, 0)
    total = first + second + third - pairs + project(project(first, 1), 2)
    inner = np.s_[:, 1:-1, 1:-1, 1:-1]
    found[inner] = total[inner]
    return found


def equidistribute_block(
    mapping: Callable[[np.ndarray], np.ndarray],
    shape: tuple[int, int, int],
    weight=1.0,
    iterations: int = 100,
    sides: bool = True,
    threads: int = 1,
) -> Equidistributed:
    """Grid of a block: edges, then faces, then the volume, with one weight.

    mapping: p in the unit cube (3, ...) to x (3, ...); shape: cells a direction; weight: a positive
    number or a function of x, y, z.  With `sides` edges (EDC) and faces (EDS) are equidistributed
    too, in the order of theory R10; otherwise they keep equal steps of p.  Raises RegridFailure
    naming the face, or the cells, that fold.
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
    """EDC along one of the twelve edges: the parameter `axis` of its nodes is written."""
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
    """EDS on one of the six faces, begun from its edges: two of its parameters are written."""
    index = [slice(None)] * 3
    index[axis] = end
    face = p[(slice(None), *index)]
    free = [k for k in range(3) if k != axis]
    level = float(-end)

    def surface(pair):
        points = np.empty((3, *pair.shape[1:]))
        points[axis], points[free[0]], points[free[1]] = level, pair[0], pair[1]
        return mapping(points)

    start = interpolate_sides(face[free])
    found = solve_eds(surface, start, weight, iterations)
    face[free[0]], face[free[1]] = found.nodes
    return found


def interpolate_sides(parameters: np.ndarray) -> np.ndarray:
    """A copy of (2, ni+1, nj+1) with its inside interpolated from the four sides (boolean sum)."""
    found = np.array(parameters, dtype=np.float64, order="C")
    u = np.linspace(0.0, 1.0, found.shape[1])[:, None]
    v = np.linspace(0.0, 1.0, found.shape[2])
    low, high, left, right = found[:, :1], found[:, -1:], found[:, :, :1], found[:, :, -1:]
    along, across = (1.0 - u) * low + u * high, (1.0 - v) * left + v * right
    ends = (1.0 - v) * along[:, :, :1] + v * along[:, :, -1:]
    found[:, 1:-1, 1:-1] = (along + across - ends)[:, 1:-1, 1:-1]
    return found
