"""What a block's six faces ask for: lengths of edges, weights of the three families, its volume.

Only nodes of the faces are read.  Faces are called i_min, i_max, j_min, j_max, k_min, k_max.
Source: theory R14.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FACES = ("i_min", "i_max", "j_min", "j_max", "k_min", "k_max")
LEAST_LENGTH = 1e-6  # of a family's mean edge
BEND = 1e-3  # added to the bend of a pair of faces


def get_face(nodes: np.ndarray, axis: int, end: int) -> np.ndarray:
    """View (3, n, m) of the face across `axis` (0 to 2) at its low (0) or high (-1) end."""
    return nodes[(slice(None),) * (axis + 1) + (end,)]


def measure_lengths(points: np.ndarray, axis: int) -> np.ndarray:
    """Lengths of the edges of (3, ...) along `axis` of the indices (0 is the first)."""
    step = np.diff(points, axis=axis + 1)
    return np.sqrt((step * step).sum(axis=0))


def compute_laws(nodes: np.ndarray) -> list[np.ndarray]:
    """Arc-length laws (2, 2, n+1) of the twelve block edges: of each direction the four of it.

    The first two indices are the low and high ends of the other two directions, in their order.
    An edge of no length has equal steps.
    """
    laws = []
    for axis in range(3):
        n = nodes.shape[axis + 1]
        law = np.empty((2, 2, n))
        for ends in np.ndindex(2, 2):
            index: list = [-end for end in ends]
            index.insert(axis, slice(None))
            arc = np.cumsum(measure_lengths(nodes[(slice(None), *index)], 0))
            law[ends][0] = 0.0
            law[ends][1:] = arc / arc[-1] if arc[-1] > 0.0 else np.linspace(0.0, 1.0, n)[1:]
        laws.append(law)
    return laws


def measure_bend(face: np.ndarray) -> float:
    """Area of a face (3, n, m) over the size of its vector area, less one; 0 where it is plane.

    Of nodes smoothed by (1, 2, 1)/4 both ways, so that noise is no bend.
    """
    smooth = face.copy()
    smooth[:, 1:-1] = 0.25 * (face[:, :-2] + 2.0 * face[:, 1:-1] + face[:, 2:])
    once = smooth.copy()
    smooth[:, :, 1:-1] = 0.25 * (once[:, :, :-2] + 2.0 * once[:, :, 1:-1] + once[:, :, 2:])
    area = _vector_areas(smooth)
    total = area.sum(axis=(1, 2))
    size = np.sqrt((area * area).sum(axis=0)).sum()
    whole = np.sqrt((total * total).sum())
    return float(max(0.0, size / whole - 1.0)) if whole > 1e-12 * size else 1e12


def _vector_areas(face: np.ndarray) -> np.ndarray:
    """Half the cross product of the diagonals of every quadrilateral (3, n, m)."""
    return 0.5 * np.cross(
        face[:, 1:, 1:] - face[:, :-1, :-1], face[:, :-1, 1:] - face[:, 1:, :-1], axis=0
    )


def compute_family_weights(nodes: np.ndarray) -> np.ndarray:
    """Weights (3), of sum 1, of the straight lines of each family (R14.7)."""
    bends = [
        max(measure_bend(get_face(nodes, axis, end)) for end in (0, -1)) + BEND for axis in range(3)
    ]
    squares = np.minimum(bends, 1e6) ** 2
    return squares / squares.sum()


def compute_volume(nodes: np.ndarray) -> float:
    """Volume inside the six faces, signed as i, j, k turn like x, y, z."""
    middle = nodes[:, [0, -1], :, :][:, :, [0, -1], :][..., [0, -1]].mean(axis=(1, 2, 3))
    total = 0.0
    for axis in range(3):
        for end in (0, -1):
            face = get_face(nodes, axis, end) - middle[:, None, None]
            centre = 0.25 * (
                face[:, 1:, 1:] + face[:, :-1, :-1] + face[:, 1:, :-1] + face[:, :-1, 1:]
            )
            # the diagonals turn so that the area of a low face points inwards for axes 0 and 2
            part = float((centre * _vector_areas(face)).sum()) / 3.0
            total += part * (1.0 if (end == -1) == (axis != 1) else -1.0)
    return total


@dataclass(frozen=True)
class FaceLaws:
    """Inverse conditional lengths of all edges, weights of lines, and the scale of the barrier.

    `inverse` [1/m]: shapes (n1, n2+1, n3+1), (n1+1, n2, n3+1), (n1+1, n2+1, n3), scaled so that the
    mean corner is 1.  `ways` [m]: a quarter of the straight lines' weights times their mean
    length, (n2+1, n3+1), (n1+1, n3+1), (n1+1, n2+1).  `scale` [m2] is sigma of theory R14.
    """

    inverse: tuple[np.ndarray, np.ndarray, np.ndarray]
    ways: tuple[np.ndarray, np.ndarray, np.ndarray]
    scale: float


def compute_face_laws(nodes: np.ndarray, weights: np.ndarray, conditional: bool) -> FaceLaws:
    """The laws of the faces of `nodes` (3, n1+1, n2+1, n3+1), of positive volume (R14.2)."""
    shape = tuple(n - 1 for n in nodes.shape[1:])
    mean_volume = compute_volume(nodes) / np.prod(shape)
    if conditional:
        laws = [law.mean(axis=(0, 1)) for law in compute_laws(nodes)]
        lengths = [_spread_lengths(nodes, axis, laws) for axis in range(3)]
    else:
        edge = np.cbrt(mean_volume)
        lengths = [
            np.full([n + (axis != k) for k, n in enumerate(shape)], edge) for axis in range(3)
        ]
    at_centre = [_to_centres(length, axis) for axis, length in enumerate(lengths)]
    wanted = float((at_centre[0] * at_centre[1] * at_centre[2]).mean())
    factor = np.cbrt(mean_volume / wanted)
    ways = tuple(
        np.ascontiguousarray(0.25 * k * factor * length.mean(axis=axis))
        for axis, (k, length) in enumerate(zip(weights, lengths, strict=True))
    )
    inverse = tuple(1.0 / (factor * length) for length in lengths)
    return FaceLaws(inverse, ways, float(np.cbrt(mean_volume) ** 2))  # type: ignore[arg-type]


def compute_face_density(nodes: np.ndarray) -> np.ndarray:
    """Density of cells (n1, n2, n3) that the faces ask for, over its mean: 1 over three lengths.

    Of `nodes` (3, n1+1, n2+1, n3+1), of positive volume, the faces alone are read.
    """
    inverse = compute_face_laws(nodes, np.zeros(3), True).inverse
    density = np.ones([n - 1 for n in nodes.shape[1:]])
    for axis, each in enumerate(inverse):
        density /= _to_centres(1.0 / each, axis)
    return density / density.mean()


def _spread_lengths(nodes: np.ndarray, axis: int, laws: list[np.ndarray]) -> np.ndarray:
    """Conditional lengths of all edges along `axis`, by the four faces that have such edges."""
    p, q = (k for k in range(3) if k != axis)
    # arrays (n, across p, across q) while they are made
    low_p, high_p = (
        np.moveaxis(
            measure_lengths(get_face(nodes, p, end), axis - (axis > p)), axis - (axis > p), 0
        )
        for end in (0, -1)
    )
    low_q, high_q = (
        np.moveaxis(
            measure_lengths(get_face(nodes, q, end), axis - (axis > q)), axis - (axis > q), 0
        )
        for end in (0, -1)
    )
    u, v = laws[p][:, None], laws[q]
    across_p = low_p[:, None, :] + u * (high_p - low_p)[:, None, :]
    across_q = low_q[:, :, None] + v * (high_q - low_q)[:, :, None]
    ends = across_p[:, :, :1] + v * (across_p[:, :, -1:] - across_p[:, :, :1])
    length = across_p + across_q
    length -= ends
    least = np.minimum(np.minimum(low_p, high_p)[:, None, :], np.minimum(low_q, high_q)[:, :, None])
    most = np.maximum(np.maximum(low_p, high_p)[:, None, :], np.maximum(low_q, high_q)[:, :, None])
    np.clip(length, least, most, out=length)
    np.maximum(length, LEAST_LENGTH * length.mean(), out=length)
    return np.ascontiguousarray(np.moveaxis(length, 0, axis))


def _to_centres(length: np.ndarray, axis: int) -> np.ndarray:
    """Means over the four edges along `axis` of every cell."""
    for k in range(3):
        if k != axis:
            low = [slice(None)] * 3
            high = [slice(None)] * 3
            low[k], high[k] = slice(None, -1), slice(1, None)
            length = 0.5 * (length[tuple(low)] + length[tuple(high)])
    return length
