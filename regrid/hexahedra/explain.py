"""Why a block of hexahedra has no grid: the face and node that are to blame, in a sentence."""

from __future__ import annotations

import numpy as np

from regrid.errors import RegridFailure
from regrid.hexahedra.face_laws import FACES, compute_volume
from regrid.hexahedra.turned_faces import find_folded_face, find_turned_edge
from regrid.measure.hexahedra import find_bad_hexahedra


def explain_failure(faces: np.ndarray, trial: np.ndarray, order) -> RegridFailure:
    """The failure of a move to `faces` with the grid `trial`; `order`: the caller's axis of each.

    Names face and node in the caller's indices.
    """
    back = np.argsort(order)
    turned = np.ascontiguousarray(faces.transpose(0, *(back + 1)))
    if len(set(map(int, order))) == 3 and tuple(order) in ((0, 2, 1), (1, 0, 2), (2, 1, 0)):
        turned = np.ascontiguousarray(turned[::-1])
    if not compute_volume(turned) > 0.0:
        return RegridFailure(
            "the six faces enclose no positive volume; they have to turn as those of the grid "
            "before do"
        )
    edge = find_turned_edge(turned)
    if edge is not None:
        side, other, node = edge
        return RegridFailure(
            f"node {node}: no corner of positive volume fits between it and face {other}", side=side
        )
    folded = find_folded_face(turned)
    if folded is not None:
        side, node = folded
        return RegridFailure(f"node {node}: the face folds back on itself there", side=side)
    if np.isfinite(trial).all():
        bad = find_bad_hexahedra(trial)
        if len(bad):
            cell = [0, 0, 0]
            for axis, index in zip(order, bad[0], strict=True):
                cell[axis] = int(index)
            gaps = [d for k in range(3) for d in (cell[k], turned.shape[k + 1] - 2 - cell[k])]
            side = FACES[int(np.argmin(gaps))]
            return RegridFailure(
                f"no valid grid was found; the worst cell is {tuple(cell)}", side=side
            )
    return RegridFailure("no valid grid was found inside the six faces")
