"""Bodies that touch at the start but for rounding, or but for the chords of a curve.

The nodes of two lines that stand for one curve lie off each other's chords by as much as the curve
does, and coordinates are rounded.  Such nodes are laid on the other line before the first step.
What overlaps further is refused.  Theory F16, "Bodies that touch at the start".
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.links import LARGEST_CLOSED_GAP, Link
from shockgrid.hydro.motion.overlaps import ADVICE
from shockgrid.hydro.sliding.contact import SlidingContact
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import SIDE_NAMES, get_sides

ON_LINE_DISTANCE = 1e-6  # of a face's length: closer than this a node lies on the other line
# of the smaller of a face's length and its cell's depth
LARGEST_CLOSED_OVERLAP = 1e-2
# a curve is estimated from the nodes of its line
BULGE_MARGIN = 1.1
LARGEST_CLOSED_BULGE = 0.25


def measure_curvatures(line: np.ndarray) -> np.ndarray:
    """Curvature (m,) [1/m] of the curve for which each face of a line (2, m + 1) stands.

    Above 0 where it lies to the right of the face.  Where the estimates at both nodes differ, as
    beside a corner, it is the smaller one; 0 where their signs do.
    """
    faces = np.diff(line, axis=1)
    if faces.shape[1] < 2:
        return np.zeros(faces.shape[1])
    lengths = np.hypot(*faces)
    cross = faces[0, :-1] * faces[1, 1:] - faces[1, :-1] * faces[0, 1:]
    across = np.hypot(*(faces[:, :-1] + faces[:, 1:]))
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.nan_to_num(2.0 * cross / (lengths[:-1] * lengths[1:] * across))
    at_nodes = np.concatenate([inner[:1], inner, inner[-1:]])
    if inner.size > 1:
        at_nodes[0] = inner[1]
        at_nodes[-1] = inner[-2]
    before = at_nodes[:-1]
    after = at_nodes[1:]
    smaller = np.where(np.abs(before) < np.abs(after), before, after)
    return np.where(before * after > 0.0, smaller, 0.0)


def find_nearest(
    line: np.ndarray, curvatures: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of points (2, n): the face of a line that is nearest, the part of it where the foot lies, how
    far the point is in front of the line, and how far the line's curve is there [m]."""
    start = line[:, :-1]
    steps = np.diff(line, axis=1)
    square = np.maximum((steps * steps).sum(axis=0), np.finfo(float).tiny)
    away = points[:, :, None] - start[:, None, :]
    fraction = np.clip((away * steps[:, None, :]).sum(axis=0) / square, 0.0, 1.0)
    miss = away - fraction * steps[:, None, :]
    distance = np.hypot(*miss)
    face = distance.argmin(axis=1)
    rows = np.arange(points.shape[1])
    fraction = fraction[rows, face]
    in_front = away[0, rows, face] * steps[1, face] - away[1, rows, face] * steps[0, face] >= 0.0
    height = np.where(in_front, 1.0, -1.0) * distance[rows, face]
    bulge = 0.5 * curvatures[face] * fraction * (1.0 - fraction) * square[face]
    return face, fraction, height, bulge


def measure_sizes(line: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """At each node of a line (2, n): the least of its faces' lengths and its cells' depth [m]."""
    lengths = np.hypot(*np.diff(line, axis=1))
    lengths[lengths == 0.0] = np.inf  # of a side that is a point
    shorter = np.minimum(np.append(lengths, np.inf), np.append(np.inf, lengths))
    return np.minimum(shorter, np.hypot(*(inner - line)))


def fill_normals(block: Block) -> None:
    """Fill the rim's normals, but for their directions, which no step has filled yet."""
    for side in SIDE_NAMES:
        first, count = block.side_faces(side)
        x, y = np.diff(block.side_line(side, block.nodes), axis=1)
        block.rim.nx[first : first + count] = y
        block.rim.ny[first : first + count] = -x


def find_lying(
    points: np.ndarray, sizes: np.ndarray, line: np.ndarray, line_sizes: np.ndarray
) -> np.ndarray:
    """Positions (n,) on a line of the points (2, n) that lie on its curve or, but for rounding, on
    the line; -1.0 for others, and for those so near to the line that they are its pins."""
    positions = np.full(points.shape[1], -1.0)
    reach = float(line_sizes.max())
    low = line.min(axis=1, keepdims=True) - reach
    high = line.max(axis=1, keepdims=True) + reach
    near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=0))
    if near.size == 0:
        return positions
    curvatures = measure_curvatures(line)
    face, fraction, height, bulge = find_nearest(line, curvatures, points[:, near])
    size = np.minimum(sizes[near], np.minimum(line_sizes[face], line_sizes[face + 1]))
    is_on = np.abs(height) <= ON_LINE_DISTANCE * np.hypot(*np.diff(line, axis=1))[face]
    bulge = np.clip(BULGE_MARGIN * bulge, -LARGEST_CLOSED_BULGE * size, LARGEST_CLOSED_BULGE * size)
    least = np.minimum(bulge, 0.0) - LARGEST_CLOSED_OVERLAP * size
    farthest = np.maximum(bulge, 0.0) + LARGEST_CLOSED_GAP * size
    lies = (height >= least) & (height <= farthest) & ~is_on
    positions[near[lies]] = (face + fraction)[lies]
    return positions


def find_lying_on_plane(points: np.ndarray, sizes: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Positions (n,) on a plane of the points that lie on it but for rounding, else -1.0.

    face (2, 2): a face of the plane, which goes on beyond it.
    """
    x, y = points - face[:, :1]
    along_x, along_y = face[:, 1] - face[:, 0]
    length = np.hypot(along_x, along_y)
    height = (x * along_y - y * along_x) / length
    lies = (height >= -LARGEST_CLOSED_OVERLAP * sizes) & (height <= LARGEST_CLOSED_GAP * sizes)
    lies &= np.abs(height) > ON_LINE_DISTANCE * sizes
    return np.where(lies, (x * along_x + y * along_y) / length**2, -1.0)


def check_overlaps(blocks: Sequence[Block], links: Sequence[Link | SlidingContact]) -> None:
    """Raise BadInput where a node of a block lies in another one without a link to it, further than
    is closed at the start."""
    linked = [{id(segment.block) for segment in link.segments} for link in links]
    for block, other_block in itertools.combinations(blocks, 2):
        if any({id(block), id(other_block)} <= pair for pair in linked):
            continue
        for inner, outer in ((block, other_block), (other_block, block)):
            _check_overlap(inner, outer)


def _check_overlap(block: Block, around: Block) -> None:
    points, sizes, own_bulges = _add_middles(*_trace(block))
    line, line_sizes, curvatures = _trace(around)
    inside = _find_inside(points, line)
    if inside.size == 0:
        return
    closed_line = np.append(line, line[:, :1], axis=1)
    face, _, height, bulge = find_nearest(closed_line, curvatures, points[:, inside])
    bulge = np.maximum(np.abs(bulge), own_bulges[inside])
    size = np.minimum(line_sizes[face], np.roll(line_sizes, -1)[face])
    size = np.minimum(sizes[inside], size)
    depth = np.abs(height)
    closed = np.minimum(BULGE_MARGIN * bulge, LARGEST_CLOSED_BULGE * size)
    closed += LARGEST_CLOSED_OVERLAP * size
    worst = int((depth - closed).argmax())
    if depth[worst] > closed[worst]:
        x, y = points[:, inside[worst]]
        raise BadInput(
            f"block {block.name!r} is {depth[worst]:.3g} m inside block {around.name!r} at "
            f"x = {x:.6g} m, y = {y:.6g} m: {ADVICE}; overlaps of up to {closed[worst]:.1g} m "
            "there, of rounded coordinates, are closed at the start"
        )


def _add_middles(line: np.ndarray, sizes: np.ndarray, curvatures: np.ndarray) -> tuple:
    """Nodes and middles of the faces of a closed outline, their sizes, and how far the curve is."""
    following = np.roll(line, -1, axis=1)
    points = np.concatenate([line, 0.5 * (line + following)], axis=1)
    sizes = np.concatenate([sizes, np.minimum(sizes, np.roll(sizes, -1))])
    bulges = 0.125 * np.abs(curvatures) * ((following - line) ** 2).sum(axis=0)
    return points, sizes, np.concatenate([np.zeros_like(bulges), bulges])


def _find_inside(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Numbers of the points (2, n) inside a closed outline (2, m), by the even-odd rule."""
    low = outline.min(axis=1, keepdims=True)
    high = outline.max(axis=1, keepdims=True)
    near = np.flatnonzero(((points > low) & (points < high)).all(axis=0))
    x, y = points[:, near, None]
    x_start, y_start = outline[:, None, :]
    x_stop, y_stop = np.roll(outline, -1, axis=1)[:, None, :]
    passes = (y_start > y) != (y_stop > y)
    rise = np.where(passes, y_stop - y_start, 1.0)
    crossing = x_start + (y - y_start) / rise * (x_stop - x_start)
    return near[(passes & (crossing > x)).sum(axis=1) % 2 == 1]


def _trace(block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The outline of a block, each corner once: nodes (2, n), their sizes, curvatures of faces."""
    inner = block.nodes.copy()
    inner[:, 0], inner[:, -1] = block.nodes[:, 1], block.nodes[:, -2]
    inner[:, :, 0], inner[:, :, -1] = inner[:, :, 1], inner[:, :, -2]
    pieces = []
    for number, line in enumerate(get_sides(block.nodes)):
        line_inner = get_sides(inner)[number]
        pieces.append((line, measure_sizes(line, line_inner), measure_curvatures(line)))
    i_min, i_max, j_min, j_max = pieces
    order = j_min, i_max, _turn(j_max), _turn(i_min)
    line = np.concatenate([piece[0][:, :-1] for piece in order], axis=1)
    sizes = np.concatenate([piece[1][:-1] for piece in order])
    curvatures = np.concatenate([piece[2] for piece in order])
    return line, sizes, curvatures


def _turn(piece: tuple[np.ndarray, np.ndarray, np.ndarray]) -> tuple:
    line, sizes, curvatures = piece
    return line[:, ::-1], sizes[::-1], -curvatures[::-1]
