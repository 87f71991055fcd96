"""The faces' displacement carried inside: its affine part exactly, the rest by a boolean sum.

Source: theory R14.8, R14.9.
"""

from __future__ import annotations

import numpy as np

from regrid.hexahedra.face_laws import compute_laws, get_face
from regrid.jit import kernel

CROSSINGS = 3  # passes for the place where three lines of the unit cube meet


@kernel(allocates=False)
def mix(law, i, u, v):
    """The law between its four edges at the part u, v of the way."""
    low = law[0, 0, i] + v * (law[0, 1, i] - law[0, 0, i])
    high = law[1, 0, i] + v * (law[1, 1, i] - law[1, 0, i])
    return low + u * (high - low)


@kernel(allocates=False)
def fill_blended(values, law_i, law_j, law_k, rows):
    """Boolean sum of `values` (m, n1+1, n2+1, n3+1) from its six faces to its inside (R14.9).

    The laws (2, 2, n+1) are those of the twelve edges.  `rows` (3, n3+1) is scratch.
    """
    n1, n2, n3 = values.shape[1] - 1, values.shape[2] - 1, values.shape[3] - 1
    for i in range(1, n1):
        for j in range(1, n2):
            for k in range(1, n3):
                p = 0.25 * (law_i[0, 0, i] + law_i[0, 1, i] + law_i[1, 0, i] + law_i[1, 1, i])
                q = 0.25 * (law_j[0, 0, j] + law_j[0, 1, j] + law_j[1, 0, j] + law_j[1, 1, j])
                r = 0.25 * (law_k[0, 0, k] + law_k[0, 1, k] + law_k[1, 0, k] + law_k[1, 1, k])
                for _ in range(CROSSINGS):
                    p, q, r = mix(law_i, i, q, r), mix(law_j, j, p, r), mix(law_k, k, p, q)
                rows[0, k], rows[1, k], rows[2, k] = p, q, r
            for m in range(values.shape[0]):
                f = values[m]
                for k in range(1, n3):
                    p, q, r = rows[0, k], rows[1, k], rows[2, k]
                    a, b, c = 1.0 - p, 1.0 - q, 1.0 - r
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
                        b * (c * f[0, 0, 0] + r * f[0, 0, n3])
                        + q * (c * f[0, n2, 0] + r * f[0, n2, n3])
                    ) + p * (
                        b * (c * f[n1, 0, 0] + r * f[n1, 0, n3])
                        + q * (c * f[n1, n2, 0] + r * f[n1, n2, n3])
                    )
                    f[i, j, k] = faces - edges + corners


def fit_affine(points: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) of an affine displacement of points (3, ...), by least squares.

    Of a plane block's faces no more than what they show: the solution of least norm.
    """
    there = points.reshape(3, -1)
    moved = displacement.reshape(3, -1)
    there = there - there.mean(axis=1, keepdims=True)
    moved = moved - moved.mean(axis=1, keepdims=True)
    square = there @ there.T
    return (moved @ there.T) @ np.linalg.pinv(square, rcond=1e-12, hermitian=True)


def gather_faces(nodes: np.ndarray) -> np.ndarray:
    """Nodes (3, count) of the six faces; those on the block's edges come twice and more."""
    return np.concatenate(
        [get_face(nodes, axis, end).reshape(3, -1) for axis in range(3) for end in (0, -1)], axis=1
    )


def copy_faces(source: np.ndarray, target: np.ndarray) -> None:
    """Write the six faces of `source` into `target`; both (m, n1+1, n2+1, n3+1)."""
    for axis in range(3):
        for end in (0, -1):
            get_face(target, axis, end)[:] = get_face(source, axis, end)


def carry_faces(previous: np.ndarray, boundary: np.ndarray, out: np.ndarray) -> None:
    """Fill `out` with the grid `previous` moved along with the faces of `boundary` (R14.8)."""
    before = gather_faces(previous)
    displacement = gather_faces(boundary) - before
    matrix = fit_affine(before, displacement)
    whole = np.eye(3) + matrix
    middle = before.mean(axis=1)
    shift = displacement.mean(axis=1) - matrix @ middle
    moved = np.einsum("ab,bijk->aijk", whole, previous)
    moved += shift[:, None, None, None]
    for axis in range(3):
        for end in (0, -1):
            rest = get_face(boundary, axis, end) - get_face(moved, axis, end)
            get_face(out, axis, end)[:] = rest
    fill_blended(out, *compute_laws(previous), np.empty((3, out.shape[3])))
    out += moved
    copy_faces(boundary, out)
