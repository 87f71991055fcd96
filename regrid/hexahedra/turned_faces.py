"""Faces that leave no valid grid: turned corners at the block's edges, folded quadrilaterals."""

from __future__ import annotations

import numpy as np

from regrid.hexahedra.face_laws import get_face


def find_turned_edge(nodes: np.ndarray) -> tuple[str, str, tuple[int, int, int]] | None:
    """A corner at the block's twelve edges that no inner node can make positive: faces and node.

    All four nodes of such a corner lie on the boundary.  None where there is no such corner.
    """
    names = "ijk"
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for ends in np.ndindex(2, 2):
            arms = []
            index: list = [-end for end in ends]
            index.insert(axis, slice(None))
            line = nodes[(slice(None), *index)]
            for other, end in zip(others, ends, strict=True):
                inward = index.copy()
                inward[other] = 1 - 3 * end if end else 1
                arm = nodes[(slice(None), *inward)] - line
                arms.append(-arm if end else arm)
            edge = np.diff(line, axis=1)
            for first in (slice(None, -1), slice(1, None)):
                normal = np.cross(arms[0][:, first], arms[1][:, first], axis=0)
                volume = (edge * normal).sum(axis=0) * (-1.0 if axis == 1 else 1.0)
                bad = np.flatnonzero(~(volume > 0.0))
                if bad.size:
                    place = [
                        0 if end == 0 else nodes.shape[o + 1] - 1
                        for o, end in zip(others, ends, strict=True)
                    ]
                    place.insert(axis, int(bad[0]) + (first.start or 0))
                    faces = [
                        f"{names[o]}_{'max' if end else 'min'}"
                        for o, end in zip(others, ends, strict=True)
                    ]
                    return faces[0], faces[1], (place[0], place[1], place[2])
    return None


def find_folded_face(nodes: np.ndarray) -> tuple[str, tuple[int, int, int]] | None:
    """The face node whose four quadrilaterals point most apart, where two of them oppose."""
    worst, found = 0.0, None
    for axis in range(3):
        for end in (0, -1):
            face = get_face(nodes, axis, end)
            if min(face.shape[1:]) < 3:
                continue
            middle = face[:, 1:-1, 1:-1]
            p = (middle - face[:, :-2, 1:-1], face[:, 2:, 1:-1] - middle)
            q = (middle - face[:, 1:-1, :-2], face[:, 1:-1, 2:] - middle)
            normals = [np.cross(a, b, axis=0) for a in p for b in q]
            with np.errstate(invalid="ignore", divide="ignore"):
                normals = [n / np.sqrt((n * n).sum(axis=0)) for n in normals]
            for one in range(4):
                for two in range(one):
                    cosine = (normals[one] * normals[two]).sum(axis=0)
                    cosine = np.where(np.isfinite(cosine), cosine, -1.0)
                    if cosine.min() < worst:
                        worst = float(cosine.min())
                        a, b = np.unravel_index(int(cosine.argmin()), cosine.shape)
                        place = [int(a) + 1, int(b) + 1]
                        place.insert(axis, 0 if end == 0 else nodes.shape[axis + 1] - 1)
                        name = f"{'ijk'[axis]}_{'max' if end else 'min'}"
                        found = (name, (place[0], place[1], place[2]))
    return found
