"""The six faces of a block: the spacing and weights that they define, and checks of their validity.

Edge lengths, weights of the three families and the volume follow from the face nodes alone.  Faces
are called i_min, i_max, j_min, j_max, k_min, k_max.  Their displacement is interpolated: its affine
part exactly, the rest by a Boolean sum.  Faces that allow no valid grid have inverted corners at
the block's edges or folded quadrilaterals.

Source: theory R14.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.faults import check_size, choose_unit, convert_nodes
from shockgrid.regrid.measure.hexahedra import compute_corner_volumes, find_bad_hexahedra

FACES = ("i_min", "i_max", "j_min", "j_max", "k_min", "k_max")
LEAST_LENGTH = 1e-6  # of a family's mean edge
ADDED_FACE_BEND = 1e-3  # added to the curvature measure of a pair of faces
CLOSED_FACE_AREA = (
    1e-12  # of its plane image over its own, of a face that is bent all the way round
)
MOST_FACE_EXCESS = 1e6  # of a face's area over its plane image, as it counts
PLANE_POINTS_RATIO = 1e-12  # of the moments of points: smaller ones are those of a plane


def get_face(nodes: np.ndarray, axis: int, end: int) -> np.ndarray:
    """View (3, n, m) of the face across `axis` (0 to 2) at its low (0) or high (-1) end."""
    return nodes[(slice(None),) * (axis + 1) + (end,)]


def measure_lengths(points: np.ndarray, axis: int) -> np.ndarray:
    """Lengths of the edges of (3, ...) along `axis` of the indices (0 is the first)."""
    step = np.diff(points, axis=axis + 1)
    return np.sqrt((step * step).sum(axis=0))


def compute_edge_spacings(nodes: np.ndarray) -> list[np.ndarray]:
    """Arc-length spacings (2, 2, n+1) of the twelve block edges, four for each direction.

    The first two indices are the low and high ends of the other two directions, in their order.
    An edge of zero length has equal spacing.
    """
    spacings = []
    for axis in range(3):
        n = nodes.shape[axis + 1]
        spacing = np.empty((2, 2, n))
        for ends in np.ndindex(2, 2):
            index: list = [-end for end in ends]
            index.insert(axis, slice(None))
            arc = np.cumsum(measure_lengths(nodes[(slice(None), *index)], 0))
            spacing[ends][0] = 0.0
            spacing[ends][1:] = arc / arc[-1] if arc[-1] > 0.0 else np.linspace(0.0, 1.0, n)[1:]
        spacings.append(spacing)
    return spacings


def measure_bend(face: np.ndarray) -> float:
    """Area of a face (3, n, m) over the magnitude of its vector area, minus one; 0 if it is plane.

    Nodes are smoothed by (1, 2, 1)/4 in both directions, so that noise does not count as curvature.
    """
    smoothed = face.copy()
    smoothed[:, 1:-1] = 0.25 * (face[:, :-2] + 2.0 * face[:, 1:-1] + face[:, 2:])
    half_smoothed = smoothed.copy()
    smoothed[:, :, 1:-1] = 0.25 * (
        half_smoothed[:, :, :-2] + 2.0 * half_smoothed[:, :, 1:-1] + half_smoothed[:, :, 2:]
    )
    areas = _vector_areas(smoothed)
    vector_sum = areas.sum(axis=(1, 2))
    area_sum = np.sqrt((areas * areas).sum(axis=0)).sum()
    plane_area = np.sqrt((vector_sum * vector_sum).sum())
    if not plane_area > CLOSED_FACE_AREA * area_sum:
        return 1.0 / CLOSED_FACE_AREA
    return float(max(0.0, area_sum / plane_area - 1.0))


def _vector_areas(face: np.ndarray) -> np.ndarray:
    """Half the cross product of the diagonals of every quadrilateral (3, n, m)."""
    return 0.5 * np.cross(
        face[:, 1:, 1:] - face[:, :-1, :-1], face[:, :-1, 1:] - face[:, 1:, :-1], axis=0
    )


def compute_family_weights(nodes: np.ndarray) -> np.ndarray:
    """Weights (3,) of the straight lines of each family, with sum 1 (R14.7)."""
    excesses = [
        max(measure_bend(get_face(nodes, axis, end)) for end in (0, -1)) + ADDED_FACE_BEND
        for axis in range(3)
    ]
    squares = np.minimum(excesses, MOST_FACE_EXCESS) ** 2
    return squares / squares.sum()


def compute_volume(nodes: np.ndarray) -> float:
    """Volume inside the six faces, positive if i, j, k are oriented like x, y, z."""
    centre_of_block = nodes[:, [0, -1], :, :][:, :, [0, -1], :][..., [0, -1]].mean(axis=(1, 2, 3))
    total = 0.0
    for axis in range(3):
        for end in (0, -1):
            face = get_face(nodes, axis, end) - centre_of_block[:, None, None]
            face_centres = 0.25 * (
                face[:, 1:, 1:] + face[:, :-1, :-1] + face[:, 1:, :-1] + face[:, :-1, 1:]
            )
            # with this order of diagonals the area of a low face points inwards for axes 0 and 2
            face_volume = float((face_centres * _vector_areas(face)).sum()) / 3.0
            total += face_volume * (1.0 if (end == -1) == (axis != 1) else -1.0)
    return total


class FaceLengths(NamedTuple):
    """Inverse conditional lengths of all edges, weights of lines, and the scale of the barrier.

    `inverse` [1/m]: shapes (n1, n2+1, n3+1), (n1+1, n2, n3+1), (n1+1, n2+1, n3), scaled so that the
    mean corner is 1.  `line_weights` [m]: a quarter of the straight-line weights times their mean
    length, (n2+1, n3+1), (n1+1, n3+1), (n1+1, n2+1).  `scale` [m2] is sigma of theory R14.
    """

    inverse: tuple[np.ndarray, np.ndarray, np.ndarray]
    line_weights: tuple[np.ndarray, np.ndarray, np.ndarray]
    scale: float


class Functional(NamedTuple):
    """Parameters of the functional (R14.1) of a block, apart from its nodes.

    `strength` (n1, n2, n3): weight e of the barrier in every cell; `area_weight`: lam; `e2`: square
    of the smoothing of denominators, 0 if all corners are positive.
    """

    lengths: FaceLengths
    strength: np.ndarray
    area_weight: float
    e2: float = 0.0


def compute_face_lengths(nodes: np.ndarray, weights: np.ndarray, conditional: bool) -> FaceLengths:
    """`FaceLengths` of the faces of `nodes` (3, n1+1, n2+1, n3+1), of positive volume (R14.2)."""
    shape = tuple(n - 1 for n in nodes.shape[1:])
    mean_volume = compute_volume(nodes) / np.prod(shape)
    if conditional:
        spacings = [spacing.mean(axis=(0, 1)) for spacing in compute_edge_spacings(nodes)]
        lengths = [_spread_lengths(nodes, axis, spacings) for axis in range(3)]
    else:
        edge = np.cbrt(mean_volume)
        lengths = [
            np.full([n + (axis != k) for k, n in enumerate(shape)], edge) for axis in range(3)
        ]
    centre_lengths = [_to_centres(length, axis) for axis, length in enumerate(lengths)]
    mean_product = float((centre_lengths[0] * centre_lengths[1] * centre_lengths[2]).mean())
    factor = np.cbrt(mean_volume / mean_product)
    line_weights = tuple(
        np.ascontiguousarray(0.25 * k * factor * length.mean(axis=axis))
        for axis, (k, length) in enumerate(zip(weights, lengths, strict=True))
    )
    inverse = tuple(1.0 / (factor * length) for length in lengths)
    return FaceLengths(inverse, line_weights, float(np.cbrt(mean_volume) ** 2))  # type: ignore[arg-type]


def compute_face_density(nodes: np.ndarray) -> np.ndarray:
    """Cell density (n1, n2, n3) implied by the faces, over its mean: 1 over three lengths.

    Only the faces of `nodes` (3, n1+1, n2+1, n3+1), of positive volume, are read.
    """
    inverse = compute_face_lengths(nodes, np.zeros(3), True).inverse
    density = np.ones([n - 1 for n in nodes.shape[1:]])
    for axis, axis_inverse in enumerate(inverse):
        density /= _to_centres(1.0 / axis_inverse, axis)
    return density / density.mean()


def _spread_lengths(nodes: np.ndarray, axis: int, spacings: list[np.ndarray]) -> np.ndarray:
    """Conditional lengths of all edges along `axis`, from the four faces with such edges."""
    p, q = (k for k in range(3) if k != axis)

    def measure(across: int, end: int) -> np.ndarray:
        along = axis - (axis > across)
        return np.moveaxis(measure_lengths(get_face(nodes, across, end), along), along, 0)

    # arrays (n, across p, across q) in this function
    low_p, high_p, low_q, high_q = (measure(k, end) for k in (p, q) for end in (0, -1))
    u, v = spacings[p][:, None], spacings[q]
    across_p = low_p[:, None, :] + u * (high_p - low_p)[:, None, :]
    across_q = low_q[:, :, None] + v * (high_q - low_q)[:, :, None]
    ends = across_p[:, :, :1] + v * (across_p[:, :, -1:] - across_p[:, :, :1])
    length = across_p + across_q
    length -= ends
    shortest = np.minimum(
        np.minimum(low_p, high_p)[:, None, :], np.minimum(low_q, high_q)[:, :, None]
    )
    longest = np.maximum(
        np.maximum(low_p, high_p)[:, None, :], np.maximum(low_q, high_q)[:, :, None]
    )
    np.clip(length, shortest, longest, out=length)
    np.maximum(length, LEAST_LENGTH * length.mean(), out=length)
    return np.ascontiguousarray(np.moveaxis(length, 0, axis))


def _to_centres(length: np.ndarray, axis: int) -> np.ndarray:
    """Means over the four edges along `axis` of every cell."""
    for k in range(3):
        if k != axis:
            before = (slice(None),) * k
            length = 0.5 * (length[(*before, slice(None, -1))] + length[(*before, slice(1, None))])
    return length


CROSSING_ITERATIONS = 3  # iterations for the intersection of three lines of the unit cube


@kernel(allocates=False)
def mix(spacing, i, u, v):
    """Spacing interpolated between its four edges at the fractions u, v."""
    low = spacing[0, 0, i] + v * (spacing[0, 1, i] - spacing[0, 0, i])
    high = spacing[1, 0, i] + v * (spacing[1, 1, i] - spacing[1, 0, i])
    return low + u * (high - low)


@inlined
def find_position(spacing_i, spacing_j, spacing_k, i, j, k):
    """Position of a node in the unit cube: where lines between the edges' spacings cross."""
    p = 0.25 * (spacing_i[0, 0, i] + spacing_i[0, 1, i] + spacing_i[1, 0, i] + spacing_i[1, 1, i])
    q = 0.25 * (spacing_j[0, 0, j] + spacing_j[0, 1, j] + spacing_j[1, 0, j] + spacing_j[1, 1, j])
    r = 0.25 * (spacing_k[0, 0, k] + spacing_k[0, 1, k] + spacing_k[1, 0, k] + spacing_k[1, 1, k])
    for _ in range(CROSSING_ITERATIONS):
        p, q, r = mix(spacing_i, i, q, r), mix(spacing_j, j, p, r), mix(spacing_k, k, p, q)
    return p, q, r


@inlined
def blend_faces(f, i, j, k, position):
    """Boolean sum of the values `f` on the faces at a node: faces less edges plus corners."""
    n1 = f.shape[0] - 1
    n2 = f.shape[1] - 1
    n3 = f.shape[2] - 1
    p, q, r = position
    a = 1.0 - p
    b = 1.0 - q
    c = 1.0 - r
    faces = (
        (a * f[0, j, k] + p * f[n1, j, k])
        + (b * f[i, 0, k] + q * f[i, n2, k])
        + (c * f[i, j, 0] + r * f[i, j, n3])
    )
    edges = (
        a * (b * f[0, 0, k] + q * f[0, n2, k])
        + p * (b * f[n1, 0, k] + q * f[n1, n2, k])
        + b * (c * f[i, 0, 0] + r * f[i, 0, n3])
        + q * (c * f[i, n2, 0] + r * f[i, n2, n3])
        + c * (a * f[0, j, 0] + p * f[n1, j, 0])
        + r * (a * f[0, j, n3] + p * f[n1, j, n3])
    )
    corners = a * (
        b * (c * f[0, 0, 0] + r * f[0, 0, n3]) + q * (c * f[0, n2, 0] + r * f[0, n2, n3])
    ) + p * (b * (c * f[n1, 0, 0] + r * f[n1, 0, n3]) + q * (c * f[n1, n2, 0] + r * f[n1, n2, n3]))
    return faces - edges + corners


@kernel(allocates=False)
def fill_blended(values, spacing_i, spacing_j, spacing_k, rows):
    """Boolean sum: fill the interior of `values` (m, n1+1, n2+1, n3+1) from its faces (R14.9).

    The spacings (2, 2, n+1) are those of the twelve edges.  `rows` (3, n3+1) is scratch.
    """
    n1 = values.shape[1] - 1
    n2 = values.shape[2] - 1
    n3 = values.shape[3] - 1
    for i in range(1, n1):
        for j in range(1, n2):
            for k in range(1, n3):
                p, q, r = find_position(spacing_i, spacing_j, spacing_k, i, j, k)
                rows[0, k] = p
                rows[1, k] = q
                rows[2, k] = r
            for m in range(values.shape[0]):
                component = values[m]
                for k in range(1, n3):
                    position = (rows[0, k], rows[1, k], rows[2, k])
                    component[i, j, k] = blend_faces(component, i, j, k, position)


def fit_affine(points: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) of an affine displacement of points (3, ...), by least squares.

    For a plane block it is the solution of least norm.
    """
    centred = points.reshape(3, -1)
    moved = displacement.reshape(3, -1)
    centred = centred - centred.mean(axis=1, keepdims=True)
    moved = moved - moved.mean(axis=1, keepdims=True)
    products = centred @ centred.T
    return (moved @ centred.T) @ np.linalg.pinv(products, rcond=PLANE_POINTS_RATIO, hermitian=True)


def gather_faces(nodes: np.ndarray) -> np.ndarray:
    """Nodes (3, count) of the six faces; those on the block's edges appear more than once."""
    return np.concatenate(
        [get_face(nodes, axis, end).reshape(3, -1) for axis in range(3) for end in (0, -1)], axis=1
    )


def copy_faces(source: np.ndarray, target: np.ndarray) -> None:
    """Write the six faces of `source` into `target`; both (m, n1+1, n2+1, n3+1)."""
    for axis in range(3):
        for end in (0, -1):
            get_face(target, axis, end)[:] = get_face(source, axis, end)


def fill_from_faces(nodes: np.ndarray, spacings: Sequence[np.ndarray]) -> None:
    """Interpolate the interior of `nodes` (3, n1+1, n2+1, n3+1) between its faces, in place.

    A Boolean sum; `spacings` as `compute_edge_spacings` gives them.
    """
    fill_blended(nodes, *spacings, np.empty((3, nodes.shape[3])))


def move_with_faces(previous: np.ndarray, boundary: np.ndarray, out: np.ndarray) -> None:
    """Fill `out` with the grid `previous` moved along with the faces of `boundary` (R14.8)."""
    old_faces = gather_faces(previous)
    displacement = gather_faces(boundary) - old_faces
    matrix = fit_affine(old_faces, displacement)
    map = np.eye(3) + matrix
    old_centre = old_faces.mean(axis=1)
    shift = displacement.mean(axis=1) - matrix @ old_centre
    moved = np.einsum("ab,bijk->aijk", map, previous)
    moved += shift[:, None, None, None]
    for axis in range(3):
        for end in (0, -1):
            remaining = get_face(boundary, axis, end) - get_face(moved, axis, end)
            get_face(out, axis, end)[:] = remaining
    fill_from_faces(out, compute_edge_spacings(previous))
    out += moved
    copy_faces(boundary, out)


def check_grids_in_space(previous, boundary) -> tuple[np.ndarray, np.ndarray]:
    """Both as contiguous float64 of one shape (3, ni+1, nj+1, nk+1); otherwise BadInput.

    Inner nodes of `boundary` are ignored.  BadInput also for blocks too small or too large, and for
    those too far from the origin (`regrid.measure.faults.check_size`).
    """
    previous = convert_nodes(previous, "previous", "ijk")
    boundary = convert_nodes(boundary, "boundary", "ijk")
    if previous.shape != boundary.shape:
        raise BadInput(
            f"regrid: previous has shape {previous.shape}, boundary {boundary.shape}; "
            "they must agree"
        )
    if not np.isfinite(previous).all():
        raise BadInput("regrid: the previous grid has nodes that are not finite numbers")
    if not np.isfinite(gather_faces(boundary)).all():
        raise BadInput("regrid: the boundary has nodes that are not finite numbers")
    for nodes, name in ((previous, "previous"), (boundary, "boundary")):
        check_size(gather_faces(nodes), max(nodes.shape[1:]), name)
    return previous, boundary


def find_unit_in_space(nodes: np.ndarray) -> float:
    """`regrid.measure.faults.find_unit` of a grid (3, ni+1, nj+1, nk+1), by its faces."""
    return choose_unit(float(np.ptp(gather_faces(nodes), axis=1).max()))


def find_turned_edge(nodes: np.ndarray) -> tuple[str, str, tuple[int, ...]] | None:
    """Faces and node of an inverted corner at the block's edges, which no inner node can fix.

    All four nodes of such a corner lie on the boundary.  None if there is no such corner.
    """
    with np.errstate(all="ignore"):  # inner nodes are arbitrary
        volumes = compute_corner_volumes(nodes)
    for axis, end, other_end, c in np.ndindex(3, 2, 2, 2):
        across = [k for k in range(3) if k != axis]
        corner = [end, other_end]
        cells = [-end, -other_end]
        node = [(nodes.shape[k + 1] - 1) * e for k, e in zip(across, corner, strict=True)]
        faces = [FACES[2 * k + e] for k, e in zip(across, corner, strict=True)]
        corner.insert(axis, c)
        corner_volumes = volumes[4 * corner[0] + 2 * corner[1] + corner[2]]
        bad_cells = np.flatnonzero(
            ~(corner_volumes[(*cells[:axis], slice(None), *cells[axis:])] > 0.0)
        )
        if bad_cells.size:
            node.insert(axis, int(bad_cells[0]) + c)
            return faces[0], faces[1], tuple(node)
    return None


def find_folded_face(nodes: np.ndarray) -> tuple[str, tuple[int, ...]] | None:
    """The face node whose four quadrilaterals' normals differ most, if two of them oppose."""
    least_cosine = 0.0
    folded = None
    for axis in range(3):
        for end in (0, -1):
            face = get_face(nodes, axis, end)
            if min(face.shape[1:]) < 3:
                continue
            inner = face[:, 1:-1, 1:-1]
            p = (inner - face[:, :-2, 1:-1], face[:, 2:, 1:-1] - inner)
            q = (inner - face[:, 1:-1, :-2], face[:, 1:-1, 2:] - inner)
            normals = [np.cross(a, b, axis=0) for a in p for b in q]
            with np.errstate(invalid="ignore", divide="ignore"):
                normals = [n / np.sqrt((n * n).sum(axis=0)) for n in normals]
            for first, second in combinations(normals, 2):
                cosine = (first * second).sum(axis=0)
                cosine = np.where(np.isfinite(cosine), cosine, -1.0)
                if cosine.min() < least_cosine:
                    least_cosine = float(cosine.min())
                    place = [int(m) + 1 for m in np.unravel_index(cosine.argmin(), cosine.shape)]
                    place.insert(axis, 0 if end == 0 else nodes.shape[axis + 1] - 1)
                    folded = FACES[2 * axis - end], tuple(place)
    return folded


def explain_failure(faces: np.ndarray, trial: np.ndarray) -> RegridFailure:
    """The failure of a move to `faces` with the grid `trial`, i, j, k oriented like x, y, z; it
    names face and node."""
    if not compute_volume(faces) > 0.0:
        return RegridFailure(
            "the six faces enclose no positive volume; they have to turn as those of the grid "
            "before do"
        )
    edge = find_turned_edge(faces)
    if edge is not None:
        side, other_face, node = edge
        return RegridFailure(
            f"node {node}: no corner of positive volume fits between it and face {other_face}",
            side=side,
        )
    folded = find_folded_face(faces)
    if folded is not None:
        side, node = folded
        return RegridFailure(f"node {node}: the face folds back on itself there", side=side)
    bad_cells = find_bad_hexahedra(trial) if np.isfinite(trial).all() else ()
    if not len(bad_cells):
        return RegridFailure("no valid grid was found inside the six faces")
    cell = tuple(map(int, bad_cells[0]))
    gaps = [d for k in range(3) for d in (cell[k], faces.shape[k + 1] - 2 - cell[k])]
    side = FACES[int(np.argmin(gaps))]
    return RegridFailure(f"no valid grid was found; the worst cell is {cell}", side=side)
