"""Whether the boundary of a block, or a polyline, crosses or touches itself or another one.

A grid whose cells are all convex covers no point twice if and only if its boundary does not cross
itself (theory R5.3): convex cells alone allow two lobes of one grid to lie on each other.  The
boundary is a closed polygon.  A binary tree keeps, for each piece of it, a bounding box and the
half planes x > 0, x < 0, y > 0, y < 0 that hold all of its edges: a piece with one of them runs
in that direction and cannot meet itself.  Signs of triangles are computed with their error bound;
what is in doubt is decided with rational numbers: exact, and cheap enough for every regrid.
Note: touching counts as crossing, except along a cut: two whole opposite sides that are the same
nodes, as in a ring that is closed on itself, or one line twice on one side (`regrid.measure.cuts`).

Polylines are compared in floating point, by boxes of `GROUP_EDGES` segments first, so that a check
of a few hundred nodes costs microseconds; lines of more than 64 groups use wider ones.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import ORIENTATION_ERROR_BOUND, UNDERFLOW, compute_turns
from shockgrid.regrid.measure.cuts import Cuts, find_cut_edges, join_cuts
from shockgrid.regrid.sides import I_MAX, I_MIN, J_MAX, J_MIN, find_node, get_side

LEAF_EDGES = 4  # edges of the smallest pieces
LOW_X, HIGH_X, LOW_Y, HIGH_Y = range(4)  # rows of the boxes
NO_CROSSING = -1
EDGE_WITHOUT_LENGTH = -2
# half planes that a piece's edges may run into
GOES_RIGHT = 1
GOES_LEFT = 2
GOES_UP = 4
GOES_DOWN = 8


@kernel
def fill_boundary(nodes, line):
    """The sides of `nodes` (2, ni+1, nj+1) as one closed polygon, `line` (2, 2 ni + 2 nj + 1).

    i_min, j_max, i_max backwards, j_min backwards; the last node is the first one again.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for c in range(2):
        for j in range(nj):
            line[c, j] = nodes[c, 0, j]
            line[c, nj + ni + j] = nodes[c, ni, nj - j]
        for i in range(ni):
            line[c, nj + i] = nodes[c, i, nj]
            line[c, 2 * nj + ni + i] = nodes[c, ni - i, 0]
        line[c, 2 * (ni + nj)] = line[c, 0]


@kernel
def find_orientation(a_x, a_y, b_x, b_y, c_x, c_y):
    """1 where a, b, c turn left for certain, -1 right, 0 where rounding leaves it open."""
    left, right = (a_x - c_x) * (b_y - c_y), (a_y - c_y) * (b_x - c_x)
    area = left - right
    bound = ORIENTATION_ERROR_BOUND * (abs(left) + abs(right)) + UNDERFLOW
    return (1 if area > bound else 0) - (1 if area < -bound else 0)


@inlined
def are_apart(low_a, high_a, low_b, high_b):
    """Whether two intervals have no point in common."""
    return high_a < low_b or high_b < low_a


@kernel
def may_meet(line, a, b, count, closed):
    """Whether the edges a < b of the polygon may have a point in common that is no node of both."""
    # the edges p-q and r-s, by their boxes
    px, py = line[0, a], line[1, a]
    qx, qy = line[0, a + 1], line[1, a + 1]
    rx, ry = line[0, b], line[1, b]
    sx, sy = line[0, b + 1], line[1, b + 1]
    if are_apart(min(px, qx), max(px, qx), min(rx, sx), max(rx, sx)):
        return False
    if are_apart(min(py, qy), max(py, qy), min(ry, sy), max(ry, sy)):
        return False
    # neighbours meet if, from their common node, both go the same way
    b_follows = b == a + 1 or (closed and qx == rx and qy == ry)
    b_leads = (a == 0 and b == count - 1) or (closed and sx == px and sy == py)
    if b_follows:
        along = (px - qx) * (sx - qx) + (py - qy) * (sy - qy)
        return along > 0.0 and find_orientation(px, py, sx, sy, qx, qy) == 0
    if b_leads:
        along = (qx - px) * (rx - px) + (qy - py) * (ry - py)
        return along > 0.0 and find_orientation(qx, qy, rx, ry, px, py) == 0
    # others if each has the ends of the other on both sides
    if find_orientation(px, py, qx, qy, rx, ry) * find_orientation(px, py, qx, qy, sx, sy) > 0:
        return False
    return find_orientation(rx, ry, sx, sy, px, py) * find_orientation(rx, ry, sx, sy, qx, qy) <= 0


@inlined
def find_half_planes(start_x, start_y, end_x, end_y):
    """The half planes into which an edge runs, as a sum of GOES_RIGHT to GOES_DOWN."""
    along_x = (GOES_RIGHT if end_x > start_x else 0) | (GOES_LEFT if end_x < start_x else 0)
    return along_x | (GOES_UP if end_y > start_y else 0) | (GOES_DOWN if end_y < start_y else 0)


@kernel
def fill_tree(line, leaves, boxes, half_planes, ends):
    """Boxes (4, 2 leaves) and half planes (2 leaves) of pieces; `ends` (2, 2 leaves): first edge,
    one past the last.

    Piece k has the parts 2k and 2k+1; leaves are the last `leaves`, a power of two: those
    beyond the line's edges are empty.  Returns the first edge without length, or -1.
    """
    x, y = line[0], line[1]
    count = line.shape[1] - 1
    first_empty_edge = -1
    # leaves: a few edges each
    for leaf in range(leaves):
        first = min(count, leaf * LEAF_EDGES)
        last = min(count, (leaf + 1) * LEAF_EDGES)
        low_x, low_y = np.inf, np.inf
        high_x, high_y = -np.inf, -np.inf
        # box, and half planes into which all of its edges run
        common = GOES_RIGHT | GOES_LEFT | GOES_UP | GOES_DOWN
        for k in range(first, last):
            low_x, high_x = min(low_x, x[k], x[k + 1]), max(high_x, x[k], x[k + 1])
            low_y, high_y = min(low_y, y[k], y[k + 1]), max(high_y, y[k], y[k + 1])
            edge_half_planes = find_half_planes(x[k], y[k], x[k + 1], y[k + 1])
            common &= edge_half_planes
            if edge_half_planes == 0 and first_empty_edge < 0:
                first_empty_edge = k
        # kept as a leaf
        piece = leaves + leaf
        boxes[LOW_X, piece] = low_x
        boxes[HIGH_X, piece] = high_x
        boxes[LOW_Y, piece] = low_y
        boxes[HIGH_Y, piece] = high_y
        half_planes[piece] = common
        ends[0, piece] = first
        ends[1, piece] = last
    # larger pieces from their two parts
    for piece in range(leaves - 1, 0, -1):
        first = 2 * piece
        second = 2 * piece + 1
        boxes[LOW_X, piece] = min(boxes[LOW_X, first], boxes[LOW_X, second])
        boxes[HIGH_X, piece] = max(boxes[HIGH_X, first], boxes[HIGH_X, second])
        boxes[LOW_Y, piece] = min(boxes[LOW_Y, first], boxes[LOW_Y, second])
        boxes[HIGH_Y, piece] = max(boxes[HIGH_Y, first], boxes[HIGH_Y, second])
        half_planes[piece] = half_planes[first] & half_planes[second]
        ends[0, piece] = ends[0, first]
        ends[1, piece] = ends[1, second]
    return first_empty_edge


@kernel
def are_same_sides(nodes, along_j):
    """Whether two opposite sides of `nodes` are the same nodes: i_min and i_max, or the others."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for c in range(2):
        for k in range((nj if along_j else ni) + 1):
            first = nodes[c, 0, k] if along_j else nodes[c, k, 0]
            if first != (nodes[c, ni, k] if along_j else nodes[c, k, nj]):
                return False
    return True


@kernel
def count_cut_edges(nodes, side):
    """How many edges at either end of a side, by its number, lie on those at the other end.

    All of them where the whole side goes out and back, or where it is the same as the opposite one.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    count = nj if side < J_MIN else ni
    if are_same_sides(nodes, side < J_MIN):
        return count
    for k in range(count + 1):
        i, j = find_node(side, k, 0, ni, nj)
        p, q = find_node(side, count - k, 0, ni, nj)
        if nodes[0, i, j] != nodes[0, p, q] or nodes[1, i, j] != nodes[1, p, q]:
            return max(k - 1, 0)
    return count


@kernel
def is_cut(edge, ni, nj, cuts):
    """Whether the polygon's edge lies on another one; `cuts`: `count_cut_edges` of each side."""
    if edge < nj:
        side, k, count = I_MIN, edge, nj
    elif edge < nj + ni:
        side, k, count = J_MAX, edge - nj, ni
    elif edge < 2 * nj + ni:
        side, k, count = I_MAX, edge - nj - ni, nj
    else:
        side, k, count = J_MIN, edge - 2 * nj - ni, ni
    return k < cuts[side] or k >= count - cuts[side]


@inlined
def push_pairs(first, second, depth, stack):
    """Put the pairs of parts of two pieces, or of one with itself, on the stack; its new depth."""
    if first == second:
        stack[0, depth] = 2 * first
        stack[1, depth] = 2 * first
        stack[0, depth + 1] = 2 * first + 1
        stack[1, depth + 1] = 2 * first + 1
        stack[0, depth + 2] = 2 * first
        stack[1, depth + 2] = 2 * first + 1
        return depth + 3
    for pair in range(4):
        stack[0, depth + pair] = 2 * first + (pair & 1)
        stack[1, depth + pair] = 2 * second + (pair >> 1)
    return depth + 4


@inlined
def can_pieces_meet(first, second, boxes, half_planes, ends):
    """Whether two pieces, or one with itself, may meet, by their boxes and half planes (R5.5)."""
    if first == second:
        return half_planes[first] == 0
    if boxes[LOW_X, first] > boxes[HIGH_X, second] or boxes[LOW_X, second] > boxes[HIGH_X, first]:
        return False
    if boxes[LOW_Y, first] > boxes[HIGH_Y, second] or boxes[LOW_Y, second] > boxes[HIGH_Y, first]:
        return False
    # neighbours that run into one half plane
    are_neighbours = ends[1, first] == ends[0, second]
    return not (are_neighbours and (half_planes[first] & half_planes[second]) != 0)


@kernel
def search_meeting(nodes, line, boxes, half_planes, ends, stack):
    """A pair of edges that may meet, (first, second); (-1, -1) where there is none.

    (-2, k) where edge k has no length.  Scratch: `line` (2, 2 ni + 2 nj + 1), `boxes` (4, 2n),
    `half_planes` (2n,), `ends` (2, 2n) with n leaves, a power of 2 of at least a LEAF_EDGES-th of
    the edges; `stack` (2, 64 * 4).
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    # the boundary and the tree of its pieces
    fill_boundary(nodes, line)
    cuts = (
        count_cut_edges(nodes, I_MIN),
        count_cut_edges(nodes, I_MAX),
        count_cut_edges(nodes, J_MIN),
        count_cut_edges(nodes, J_MAX),
    )
    closed = max(cuts) > 0
    count = line.shape[1] - 1
    leaves = boxes.shape[1] // 2
    edge_without_length = fill_tree(line, leaves, boxes, half_planes, ends)
    if edge_without_length >= 0:
        return EDGE_WITHOUT_LENGTH, edge_without_length
    # pairs of pieces that may meet, from the whole boundary down
    depth = 1
    stack[0, 0] = 1
    stack[1, 0] = 1
    while depth > 0:
        depth -= 1
        first = stack[0, depth]
        second = stack[1, depth]
        if not can_pieces_meet(first, second, boxes, half_planes, ends):
            continue
        if first < leaves:
            depth = push_pairs(first, second, depth, stack)
            continue
        # leaves: edge by edge
        for a in range(ends[0, first], ends[1, first]):
            if closed and is_cut(a, ni, nj, cuts):
                continue
            for b in range(a + 1 if first == second else ends[0, second], ends[1, second]):
                if closed and is_cut(b, ni, nj, cuts):
                    continue
                if may_meet(line, a, b, count, closed):
                    return a, b
    return NO_CROSSING, NO_CROSSING


class BoundaryCheck:
    """The check for blocks of ni × nj cells, with its scratch."""

    def __init__(self, ni: int, nj: int):
        count = 2 * (ni + nj)
        leaves = 1 << max(0, (-(-count // LEAF_EDGES) - 1).bit_length())
        self.scratch = (
            np.empty((2, count + 1)), np.empty((4, 2 * leaves)),
            np.empty(2 * leaves, dtype=np.int64), np.empty((2, 2 * leaves), dtype=np.int64),
            np.empty((2, 256), dtype=np.int64),
        )  # fmt: skip

    def is_simple(self, nodes: np.ndarray, cuts: Cuts = ()) -> bool:
        """Whether the boundary of `nodes` (2, ni+1, nj+1) does not cross or touch itself; exact.

        False as well where two neighbours on it are one point, or a node is not finite.  `cuts`: as
        `find_crossing` takes them.
        """
        return self.is_clear(search_meeting(nodes, *self.scratch)[0], nodes, cuts)

    @staticmethod
    def is_clear(first_edge: int, nodes: np.ndarray, cuts: Cuts = ()) -> bool:
        """`is_simple`, where `search_meeting` has found `first_edge`."""
        if first_edge == EDGE_WITHOUT_LENGTH:
            return False
        return first_edge == NO_CROSSING or find_crossing(nodes, cuts) is None


def walk_boundary(nodes: np.ndarray) -> tuple[np.ndarray, list[tuple[str, int]]]:
    """The boundary polygon (2, n), every node once, and the side and index of each of its nodes."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    positions = [("i_min", j) for j in range(nj)] + [("j_max", i) for i in range(ni)]
    positions += [("i_max", j) for j in range(nj, 0, -1)] + [("j_min", i) for i in range(ni, 0, -1)]
    points = [get_side(nodes, side)[:, k] for side, k in positions]
    return np.array(points).T, positions


def find_crossing(
    nodes: np.ndarray, cuts: Cuts = ()
) -> tuple[tuple[str, int], tuple[str, int]] | None:
    """The first two edges of the boundary that cross or touch, as (side, node) of their starts.

    `nodes` (2, ni+1, nj+1) is read on its sides.  Exact; every pair of edges whose boxes overlap.
    Edges without length are left out: their ends are one node.  So are those of cuts, on both of
    whose sides the block lies: of any line, one that is there twice winds round nothing.  `cuts`:
    besides those that are seen (`find_cut_edges`), a side and two of its nodes each, between which
    the boundary goes out and back.
    """
    cut_edges = find_cut_edges(nodes, cuts)
    if cuts:
        nodes = join_cuts(nodes, cuts)
    # edges with a length, without those of cuts
    line, positions = walk_boundary(nodes)
    next_nodes = np.roll(line, -1, axis=1)
    edges = np.flatnonzero((line != next_nodes).any(axis=0))
    closed = any(marks.any() for marks in cut_edges.values())
    if closed:
        edges = edges[[not _is_cut(cut_edges, *positions[k]) for k in edges]]
    starts, ends = line[:, edges], next_nodes[:, edges]
    first, second = _find_overlapping(starts, ends)
    a = starts[:, first]
    b = ends[:, first]
    c = starts[:, second]
    d = ends[:, second]
    # neighbours, which share a node
    if closed:
        leads, follows = (a == d).all(axis=0), (b == c).all(axis=0)
    else:
        leads, follows = (first == 0) & (second == edges.size - 1), second == first + 1
    meets = _fold_back(b, a, c, leads) | _fold_back(a, b, d, follows)
    # others if each has the ends of the other on both sides
    pairs = np.flatnonzero(~(leads | follows))
    a = a[:, pairs]
    b = b[:, pairs]
    c = c[:, pairs]
    d = d[:, pairs]
    across = compute_turns(a, b, c)[0] * compute_turns(a, b, d)[0] <= 0
    across &= compute_turns(c, d, a)[0] * compute_turns(c, d, b)[0] <= 0
    meets[pairs] |= across
    hits = np.flatnonzero(meets)
    if not hits.size:
        return None
    return positions[edges[first[hits[0]]]], positions[edges[second[hits[0]]]]


def _find_overlapping(starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of edges (2, n) whose boxes overlap: indices of the first and of the second ones."""
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    count = starts.shape[1]
    overlap = np.triu(np.ones((count, count), dtype=bool), 1)
    for k in range(2):
        overlap &= (low[k][:, None] <= high[k]) & (low[k] <= high[k][:, None])
    return np.nonzero(overlap)


def _fold_back(first_end, node, second_end, are_neighbours: np.ndarray) -> np.ndarray:
    """Which pairs of neighbours (n,) go the same way from their common node; points (2, n)."""
    folds = np.zeros(are_neighbours.size, dtype=bool)
    if are_neighbours.any():
        along = ((first_end - node) * (second_end - node)).sum(axis=0)
        pairs = np.flatnonzero(are_neighbours & (along > 0.0))
        turns = compute_turns(first_end[:, pairs], second_end[:, pairs], node[:, pairs])[0]
        folds[pairs] = turns == 0
    return folds


def _is_cut(cut_edges: dict[str, np.ndarray], side: str, node: int) -> bool:
    """Whether the edge that `walk_boundary` takes from a side's node is one of `find_cut_edges`."""
    edge = node if side in ("i_min", "j_max") else node - 1
    return bool(cut_edges[side][edge])


GROUP_EDGES = 12
LEAST_X, MOST_X, LEAST_Y, MOST_Y = range(4)  # rows of the boxes


@kernel
def measure_turn(a_x, a_y, b_x, b_y, c_x, c_y):
    """Twice the signed area of the triangle a, b, c."""
    return (b_x - a_x) * (c_y - a_y) - (b_y - a_y) * (c_x - a_x)


@kernel
def segments_touch(a_x, a_y, b_x, b_y, c_x, c_y, d_x, d_y):
    """Whether the segments a-b and c-d have a point in common."""
    if max(a_x, b_x) < min(c_x, d_x) or max(c_x, d_x) < min(a_x, b_x):
        return False
    if max(a_y, b_y) < min(c_y, d_y) or max(c_y, d_y) < min(a_y, b_y):
        return False
    # With overlapping boxes the two sign tests settle collinear segments as well.
    c_side = measure_turn(a_x, a_y, b_x, b_y, c_x, c_y)
    d_side = measure_turn(a_x, a_y, b_x, b_y, d_x, d_y)
    if (c_side > 0.0 and d_side > 0.0) or (c_side < 0.0 and d_side < 0.0):
        return False
    a_side = measure_turn(c_x, c_y, d_x, d_y, a_x, a_y)
    b_side = measure_turn(c_x, c_y, d_x, d_y, b_x, b_y)
    return not ((a_side > 0.0 and b_side > 0.0) or (a_side < 0.0 and b_side < 0.0))


@kernel
def fill_boxes(line, group, boxes):
    """Bounding boxes (4, groups): least and largest x, then y, of `group` segments each."""
    last = line.shape[1] - 1
    for g in range(boxes.shape[1]):
        for c in range(2):
            low, high = line[c, g * group], line[c, g * group]
            for k in range(g * group + 1, min(last, (g + 1) * group) + 1):
                low, high = min(low, line[c, k]), max(high, line[c, k])
            boxes[2 * c, g] = low
            boxes[2 * c + 1, g] = high


@inlined
def folds_back(line, a, b):
    """Whether segment b of a polyline, which follows a, goes back along it."""
    x, y = line[0], line[1]
    along = (x[b] - x[a]) * (x[b + 1] - x[b]) + (y[b] - y[a]) * (y[b + 1] - y[b])
    turn = measure_turn(x[a], y[a], x[b], y[b], x[b + 1], y[b + 1])
    return turn == 0.0 and along < 0.0


@kernel
def find_touching(line, other_line, is_same_line, group, boxes, other_boxes):
    """First pair of touching segments (index of their first nodes), or (-1, -1).

    Where both are the same line, neighbouring segments are only tested for folding back.
    """
    x, y = line[0], line[1]
    other_x, other_y = other_line[0], other_line[1]
    count = line.shape[1] - 1
    other_count = other_line.shape[1] - 1
    first_a = -1
    first_b = -1
    for g in range(boxes.shape[1]):
        for f in range(g if is_same_line else 0, other_boxes.shape[1]):
            # groups of segments whose boxes are apart
            apart = boxes[LEAST_X, g] > other_boxes[MOST_X, f]
            apart = apart or other_boxes[LEAST_X, f] > boxes[MOST_X, g]
            apart = apart or boxes[LEAST_Y, g] > other_boxes[MOST_Y, f]
            apart = apart or other_boxes[LEAST_Y, f] > boxes[MOST_Y, g]
            if apart:
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                # only pairs before the first one so far
                if first_a >= 0 and a > first_a:
                    break
                for b in range(f * group, min(other_count, (f + 1) * group)):
                    if is_same_line and b <= a:
                        continue
                    if is_same_line and b == a + 1:
                        touches = folds_back(line, a, b)
                    else:
                        touches = segments_touch(
                            x[a], y[a], x[a + 1], y[a + 1],
                            other_x[b], other_y[b], other_x[b + 1], other_y[b + 1],
                        )  # fmt: skip
                    is_earlier = first_a < 0 or a < first_a or (a == first_a and b < first_b)
                    if touches and is_earlier:
                        first_a = a
                        first_b = b
    return first_a, first_b


def find_self_crossing(line: np.ndarray) -> tuple[int, int] | None:
    """First nodes of the first two segments of a polyline (2, n) that cross or touch, or None."""
    line = np.ascontiguousarray(line, dtype=np.float64)
    group = max(GROUP_EDGES, line.shape[1] // 64)
    boxes = np.empty((4, -(-(line.shape[1] - 1) // group)))
    fill_boxes(line, group, boxes)
    first, second = find_touching(line, line, True, group, boxes, boxes)
    return None if first < 0 else (int(first), int(second))
