"""What it means physically that a certain cell sets the time step, told from the grid around it.

A cell sets the step because waves cross it quickly: it is hot, or it is thin.  A thin one is thin
for a reason that can be seen: it lies at a key node, at a line that curls up, in a neck between two
stretches of a line, in a film at a wall or on the axis, at a sharp bend, ...  The rules stand in
`classify`, the first that holds being told.

The trap: only the block of the cell is looked at.  A film between two blocks is a block itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

NEAR = 2  # cells: so near to a key node or a side is at it
CLOSE = 0.25  # of the way along the boundary: points of it that are nearer than this are close
CURLED = 1.25 * math.pi  # turn of a line that is more than that of a finger
BENT = 0.5  # turn at a node of a line [radians] that is sharp
THIN = 0.3  # of the usual width of the block
NARROW = 0.1  # of the root of the block's area: what is wider is no neck and no film

WORDS = {
    "hot": "fast waves: the material is hot or moves fast, the cell is no thinner than others",
    "crushed": "crushed: all cells of the block have become thin",
    "stretching": "stretching: nodes of a line part fast",
    "touch": "touch: bodies come to touch, node by node",
    "tension": "tension: the shortest capillary waves of a line are fast",
    "corner": "corner: at a key node, where lines meet",
    "sliding": "sliding contact: in the first cells beside it",
    "roll": "roll: a line curls up beside the cell",
    "neck": "neck: two stretches of a line come close",
    "film-wall": "film: a line closes on a wall",
    "film-axis": "film: a line closes on the axis",
    "bend": "bend: a line is sharply bent at the cell",
    "line": "line: the first cells beside an interface or a surface are squeezed",
    "thin": "thin block: its sides have come near to each other",
    "axis": "axis: in the first cells beside the axis",
    "wall": "wall: in the first cells beside a wall",
    "inside": "inside: cells away from all lines are squeezed",
}


@dataclass(frozen=True)
class Stretch:
    """A part of a block's side: faces start..stop - 1; does it go with the flow?"""

    side: str
    start: int
    stop: int
    kind: str
    moves: bool


def classify(nodes: np.ndarray, i: int, j: int, stretches: Sequence[Stretch]) -> str:
    """The name in WORDS for cell (i, j) of a block with nodes (2, ni + 1, nj + 1) [m]."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    away = {"i_min": i, "i_max": ni - 1 - i, "j_min": j, "j_max": nj - 1 - j}
    along = {"i_min": j, "i_max": j, "j_min": i, "j_max": i}
    beside = [
        stretch
        for stretch in sorted(stretches, key=lambda stretch: away[stretch.side])
        if away[stretch.side] < NEAR and stretch.start <= along[stretch.side] < stretch.stop
    ]
    if _is_at_key_node(away, along, stretches):
        return "corner"
    if any(stretch.kind == "sliding" for stretch in beside):
        return "sliding"
    for stretch in beside:
        if stretch.moves:
            return _look_along(nodes, stretch, along[stretch.side], stretches)
    if _is_thin(nodes, i, j):
        return "thin"
    for kind in ("axis", "wall"):
        if any(stretch.kind == kind for stretch in beside):
            return kind
    return "inside"


def _is_at_key_node(away, along, stretches) -> bool:
    """Does a moving line end within NEAR cells of the cell?"""
    for stretch in stretches:
        if not stretch.moves or away[stretch.side] >= NEAR:
            continue
        k = along[stretch.side]
        ends = (stretch.start, stretch.stop - 1)
        if stretch.stop - stretch.start > 2 * NEAR and min(abs(k - end) for end in ends) < NEAR:
            if stretch.start <= k < stretch.stop:
                return True
    return False


def _look_along(nodes, stretch: Stretch, k: int, stretches: Sequence[Stretch]) -> str:
    """What the boundary of the block does near face `k` of a moving stretch."""
    points, owners = walk_perimeter(nodes, stretches)
    side = _find_start(stretch.side, nodes) + _count_along(stretch, k, nodes)
    count = points.shape[1]
    here = 0.5 * (points[:, side % count] + points[:, (side + 1) % count])
    lengths = np.hypot(*(np.roll(points, -1, axis=1) - points))
    total, arc = lengths.sum(), np.concatenate([[0.0], lengths.cumsum()[:-1]])
    place = arc[side % count] + 0.5 * lengths[side % count]
    middles = 0.5 * (points + np.roll(points, -1, axis=1))
    way = np.abs(arc + 0.5 * lengths - place)
    way = np.minimum(way, total - way)
    chord = np.hypot(*(middles - here[:, None]))
    line = stretch_line(nodes, stretch)
    turn = compute_turns(line)
    mine = k - stretch.start
    if _is_curled(turn, mine):
        return "roll"
    far = way > 4.0 * np.maximum(lengths[side % count], np.median(lengths))
    x, y = points
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    near = far & (chord < CLOSE * way) & (chord < NARROW * math.sqrt(area))
    # a side that leads away from the line's end is never close, however near its end
    if near.any():
        other = owners[int(np.argmin(np.where(near, chord / np.maximum(way, 1e-300), np.inf)))]
        if other is not None and other.kind == "axis":
            return "film-axis"
        if other is not None and not other.moves and other.kind in ("wall", "piston"):
            return "film-wall"
        if other is not None and other.moves:
            return "neck"
    nearby = turn[max(mine - NEAR, 0) : mine + NEAR]
    if nearby.size and np.abs(nearby).max() > BENT:
        return "bend"
    return "line"


def _is_curled(turn: np.ndarray, k: int) -> bool:
    """Does the line turn by more than CURLED, one way, over a part that has face `k` in it?"""
    if not turn.size:
        return False
    angle = np.concatenate([[0.0], np.cumsum(turn), [turn.sum()]])  # of face 0, 1, ..., the last
    angle = angle[: turn.size + 1]
    k = min(max(k, 0), angle.size - 1)
    return bool(np.abs(angle - angle[k]).max() > CURLED or np.ptp(angle) > 1.5 * CURLED)


def _is_thin(nodes: np.ndarray, i: int, j: int) -> bool:
    """Is the block far narrower at the cell than it is elsewhere, in either direction?"""
    middle_j = 0.5 * (nodes[:, :, 1:] + nodes[:, :, :-1])
    middle_i = 0.5 * (nodes[:, 1:, :] + nodes[:, :-1, :])
    across_i = np.hypot(*np.diff(middle_j, axis=1)).sum(axis=0)  # (nj,)
    across_j = np.hypot(*np.diff(middle_i, axis=2)).sum(axis=1)  # (ni,)
    return bool(
        across_i[j] < THIN * np.median(across_i) or across_j[i] < THIN * np.median(across_j)
    )


def stretch_line(nodes: np.ndarray, stretch: Stretch) -> np.ndarray:
    """The nodes (2, n + 1) of a stretch."""
    side = {
        "i_min": nodes[:, 0, :],
        "i_max": nodes[:, -1, :],
        "j_min": nodes[:, :, 0],
        "j_max": nodes[:, :, -1],
    }[stretch.side]
    return side[:, stretch.start : stretch.stop + 1]


def compute_turns(line: np.ndarray) -> np.ndarray:
    """Angle [radians] by which a line (2, n) turns at each of its inner nodes, (n - 2,)."""
    dx, dy = np.diff(line, axis=1)
    return np.arctan2(dx[:-1] * dy[1:] - dy[:-1] * dx[1:], dx[:-1] * dx[1:] + dy[:-1] * dy[1:])


def walk_perimeter(
    nodes: np.ndarray, stretches: Sequence[Stretch]
) -> tuple[np.ndarray, list[Stretch | None]]:
    """Nodes (2, n) once around a block, and the stretch of the face that follows each."""
    rounds = [
        ("j_min", nodes[:, :-1, 0]),
        ("i_max", nodes[:, -1, :-1]),
        ("j_max", nodes[:, :0:-1, -1]),
        ("i_min", nodes[:, 0, :0:-1]),
    ]
    owners: list[Stretch | None] = []
    for side, line in rounds:
        count = line.shape[1]
        faces: list[Stretch | None] = [None] * count
        for stretch in stretches:
            if stretch.side == side:
                for face in range(stretch.start, stretch.stop):
                    faces[face] = stretch
        owners += faces if side in ("j_min", "i_max") else faces[::-1]
    return np.concatenate([line for _, line in rounds], axis=1), owners


def _find_start(side: str, nodes: np.ndarray) -> int:
    """Number of the first face of a side on the way around."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    return {"j_min": 0, "i_max": ni, "j_max": ni + nj, "i_min": 2 * ni + nj}[side]


def _count_along(stretch: Stretch, k: int, nodes: np.ndarray) -> int:
    """How many faces of its side lie before face `k` on the way around."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    return {"j_min": k, "i_max": k, "j_max": ni - 1 - k, "i_min": nj - 1 - k}[stretch.side]
