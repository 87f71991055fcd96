"""Does the boundary of a block, or a polyline, cross or touch itself or another one?

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

from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.corners import ORIENTATION_ERROR_BOUND, UNDERFLOW, compute_turns
from shockgrid.regrid.measure.cuts import Cuts, find_cut_edges, join_cuts
from shockgrid.regrid.sides import I_MAX, I_MIN, J_MAX, J_MIN, find_node, get_side

LEAF_EDGES = 4  # edges of the smallest pieces
LOW_X, HIGH_X, LOW_Y, HIGH_Y = range(4)  # rows of the boxes
NO_CROSSING = -1
COINCIDENT_EDGES = -2
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
def find_turn(a_x, a_y, b_x, b_y, c_x, c_y):
    """1 where a, b, c turn left for certain, -1 right, 0 where rounding leaves it open."""
    left, right = (a_x - c_x) * (b_y - c_y), (a_y - c_y) * (b_x - c_x)
    area = left - right
    bound = ORIENTATION_ERROR_BOUND * (abs(left) + abs(right)) + UNDERFLOW
    return (1 if area > bound else 0) - (1 if area < -bound else 0)


@kernel
def may_meet(line, a, b, count, closed):
    """May the edges a < b of the polygon have a point in common that is not a node of both?"""
    x, y = line[0], line[1]
    p = a
    q = a + 1
    r = b
    s = b + 1
    if max(x[p], x[q]) < min(x[r], x[s]) or max(x[r], x[s]) < min(x[p], x[q]):
        return False
    if max(y[p], y[q]) < min(y[r], y[s]) or max(y[r], y[s]) < min(y[p], y[q]):
        return False
    following = b == a + 1 or (closed and x[q] == x[r] and y[q] == y[r])
    leading = (a == 0 and b == count - 1) or (closed and x[s] == x[p] and y[s] == y[p])
    if following or leading:
        # From the common node: do both edges go the same way?
        m, k, n = (q, p, s) if following else (p, q, r)
        along = (x[k] - x[m]) * (x[n] - x[m]) + (y[k] - y[m]) * (y[n] - y[m])
        return along > 0.0 and find_turn(x[k], y[k], x[n], y[n], x[m], y[m]) == 0
    first = find_turn(x[p], y[p], x[q], y[q], x[r], y[r])
    if first * find_turn(x[p], y[p], x[q], y[q], x[s], y[s]) > 0:
        return False
    second = find_turn(x[r], y[r], x[s], y[s], x[p], y[p])
    return second * find_turn(x[r], y[r], x[s], y[s], x[q], y[q]) <= 0


@kernel
def fill_tree(line, leaves, boxes, ways, ends):
    """Boxes (4, 2 leaves), half planes (2 leaves) and first, last edges (2, 2 leaves) of pieces.

    Piece k has the parts 2k and 2k+1; leaves are the last `leaves`.  Returns the first edge without
    length, or -1.
    """
    x, y = line[0], line[1]
    count = line.shape[1] - 1
    short = -1
    # leaves: a few edges each
    for leaf in range(leaves):
        first = min(count, leaf * LEAF_EDGES)
        last = min(count, (leaf + 1) * LEAF_EDGES)
        low_x = np.inf
        low_y = np.inf
        high_x = -np.inf
        high_y = -np.inf
        # box, and half planes into which all of its edges go
        way = 15
        for k in range(first, last):
            low_x, high_x = min(low_x, x[k], x[k + 1]), max(high_x, x[k], x[k + 1])
            low_y, high_y = min(low_y, y[k], y[k + 1]), max(high_y, y[k], y[k + 1])
            here = (GOES_RIGHT if x[k + 1] > x[k] else 0) | (GOES_LEFT if x[k + 1] < x[k] else 0)
            here |= (GOES_UP if y[k + 1] > y[k] else 0) | (GOES_DOWN if y[k + 1] < y[k] else 0)
            way &= here
            if here == 0 and short < 0:
                short = k
        # kept as a leaf
        at = leaves + leaf
        boxes[LOW_X, at] = low_x
        boxes[HIGH_X, at] = high_x
        boxes[LOW_Y, at] = low_y
        boxes[HIGH_Y, at] = high_y
        ways[at] = way
        ends[0, at] = first
        ends[1, at] = last
    # larger pieces from their two parts
    for at in range(leaves - 1, 0, -1):
        one = 2 * at
        two = 2 * at + 1
        boxes[LOW_X, at] = min(boxes[LOW_X, one], boxes[LOW_X, two])
        boxes[HIGH_X, at] = max(boxes[HIGH_X, one], boxes[HIGH_X, two])
        boxes[LOW_Y, at] = min(boxes[LOW_Y, one], boxes[LOW_Y, two])
        boxes[HIGH_Y, at] = max(boxes[HIGH_Y, one], boxes[HIGH_Y, two])
        ways[at] = ways[one] & ways[two]
        ends[0, at], ends[1, at] = ends[0, one], ends[1, two]
    return short


@kernel
def are_one(nodes, along_j):
    """Are two opposite sides of `nodes` the same nodes: i_min and i_max, or the other two?"""
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
    if are_one(nodes, side < J_MIN):
        return count
    for k in range(count + 1):
        i, j = find_node(side, k, 0, ni, nj)
        p, q = find_node(side, count - k, 0, ni, nj)
        if nodes[0, i, j] != nodes[0, p, q] or nodes[1, i, j] != nodes[1, p, q]:
            return max(k - 1, 0)
    return count


@kernel
def is_cut(edge, ni, nj, cuts):
    """Does the polygon's edge lie on another one; `cuts`: `count_cut_edges` of each side."""
    if edge < nj:
        side, k, count = I_MIN, edge, nj
    elif edge < nj + ni:
        side, k, count = J_MAX, edge - nj, ni
    elif edge < 2 * nj + ni:
        side, k, count = I_MAX, edge - nj - ni, nj
    else:
        side, k, count = J_MIN, edge - 2 * nj - ni, ni
    return k < cuts[side] or k >= count - cuts[side]


@kernel
def search_meeting(nodes, line, boxes, ways, ends, stack):
    """A pair of edges that may meet, (first, second); (-1, -1) where there is none.

    (-2, k) where edge k has no length.  Scratch: `line` (2, 2 ni + 2 nj + 1), `boxes` (4, 2n),
    `ways` (2n,), `ends` (2, 2n) with n leaves, a power of 2 of at least a LEAF_EDGES-th of the
    edges; `stack` (2, 64 * 4).
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
    short = fill_tree(line, leaves, boxes, ways, ends)
    if short >= 0:
        return COINCIDENT_EDGES, short
    # pairs of pieces that may meet, from the whole boundary down
    depth = 1
    stack[0, 0] = stack[1, 0] = 1
    while depth > 0:
        depth -= 1
        one = stack[0, depth]
        two = stack[1, depth]
        # a piece with itself: all in one half plane, it cannot meet itself (R5.5)
        if one == two:
            if ways[one] != 0:
                continue
            if one < leaves:
                stack[0, depth] = 2 * one
                stack[1, depth] = 2 * one
                stack[0, depth + 1] = 2 * one + 1
                stack[1, depth + 1] = 2 * one + 1
                stack[0, depth + 2] = 2 * one
                stack[1, depth + 2] = 2 * one + 1
                depth += 3
                continue
        else:
            # two pieces: apart, or neighbours in one half plane
            if boxes[LOW_X, one] > boxes[HIGH_X, two] or boxes[LOW_X, two] > boxes[HIGH_X, one]:
                continue
            if boxes[LOW_Y, one] > boxes[HIGH_Y, two] or boxes[LOW_Y, two] > boxes[HIGH_Y, one]:
                continue
            if ends[1, one] == ends[0, two] and (ways[one] & ways[two]) != 0:
                continue
            if one < leaves:
                for part in range(4):
                    stack[0, depth + part] = 2 * one + (part & 1)
                    stack[1, depth + part] = 2 * two + (part >> 1)
                depth += 4
                continue
        # leaves: edge by edge
        for a in range(ends[0, one], ends[1, one]):
            if closed and is_cut(a, ni, nj, cuts):
                continue
            for b in range(a + 1 if one == two else ends[0, two], ends[1, two]):
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
        """Does the boundary of `nodes` (2, ni+1, nj+1) neither cross nor touch itself?  Exact.

        False as well where two neighbours on it are one point, or a node is not finite.  `cuts`: as
        `find_crossing` takes them.
        """
        return self.is_clear(search_meeting(nodes, *self.scratch)[0], nodes, cuts)

    @staticmethod
    def is_clear(first: int, nodes: np.ndarray, cuts: Cuts = ()) -> bool:
        """`is_simple`, where `search_meeting` has found `first`."""
        if first == COINCIDENT_EDGES:
            return False
        return first == NO_CROSSING or find_crossing(nodes, cuts) is None


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
    cut = find_cut_edges(nodes, cuts)
    if cuts:
        nodes = join_cuts(nodes, cuts)
    # edges with a length, without those of cuts
    line, positions = walk_boundary(nodes)
    following = np.roll(line, -1, axis=1)
    kept = np.flatnonzero((line != following).any(axis=0))
    closed = any(edges.any() for edges in cut.values())
    if closed:
        kept = kept[[not _is_cut(cut, *positions[k]) for k in kept]]
    # pairs whose boxes overlap
    start, end = line[:, kept], following[:, kept]
    low, high = np.minimum(start, end), np.maximum(start, end)
    near = np.triu(np.ones((kept.size, kept.size), dtype=bool), 1)
    for k in range(2):
        near &= (low[k][:, None] <= high[k]) & (low[k] <= high[k][:, None])
    first, second = np.nonzero(near)
    a = start[:, first]
    b = end[:, first]
    c = start[:, second]
    d = end[:, second]
    # neighbours, which share a node
    if closed:
        leads, follows = (a == d).all(axis=0), (b == c).all(axis=0)
    else:
        leads, follows = (first == 0) & (second == kept.size - 1), second == first + 1
    apart = ~(leads | follows)
    # they meet if one folds back on the other
    meets = np.zeros(first.size, dtype=bool)
    for other, one, two in ((leads, b - a, c - d), (follows, a - b, d - c)):
        if other.any():
            at = np.flatnonzero(other & ((one * two).sum(axis=0) > 0.0))
            node, k, n = (a, b, c) if other is leads else (b, a, d)
            meets[at] |= compute_turns(k[:, at], n[:, at], node[:, at])[0] == 0
    # others if each has the ends of the other on both sides
    at = np.flatnonzero(apart)
    a = a[:, at]
    b = b[:, at]
    c = c[:, at]
    d = d[:, at]
    across = compute_turns(a, b, c)[0] * compute_turns(a, b, d)[0] <= 0
    across &= compute_turns(c, d, a)[0] * compute_turns(c, d, b)[0] <= 0
    meets[at] |= across
    hits = np.flatnonzero(meets)
    if not hits.size:
        return None
    return positions[kept[first[hits[0]]]], positions[kept[second[hits[0]]]]


def _is_cut(cut: dict[str, np.ndarray], side: str, node: int) -> bool:
    """Is the edge that `walk_boundary` takes from a side's node one of `find_cut_edges`?"""
    edge = node if side in ("i_min", "j_max") else node - 1
    return bool(cut[side][edge])


GROUP_EDGES = 12
LEAST_X, MOST_X, LEAST_Y, MOST_Y = range(4)  # rows of the boxes


@kernel
def measure_turn(a_x, a_y, b_x, b_y, c_x, c_y):
    """Twice the signed area of the triangle a, b, c."""
    return (b_x - a_x) * (c_y - a_y) - (b_y - a_y) * (c_x - a_x)


@kernel
def segments_touch(a_x, a_y, b_x, b_y, c_x, c_y, d_x, d_y):
    """Do the segments a-b and c-d have a point in common?"""
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


@kernel
def find_touching(line, other, same, group, boxes, other_boxes):
    """First pair of touching segments (index of their first nodes), or (-1, -1).

    With `same` the two lines are one: neighbouring segments are only tested for folding back.
    """
    x = line[0]
    y = line[1]
    u = other[0]
    v = other[1]
    count = line.shape[1] - 1
    other_count = other.shape[1] - 1
    found_a = -1
    found_b = -1
    for g in range(boxes.shape[1]):
        for f in range(g if same else 0, other_boxes.shape[1]):
            # groups of segments whose boxes are apart
            apart = boxes[LEAST_X, g] > other_boxes[MOST_X, f]
            apart = apart or other_boxes[LEAST_X, f] > boxes[MOST_X, g]
            apart = apart or boxes[LEAST_Y, g] > other_boxes[MOST_Y, f]
            apart = apart or other_boxes[LEAST_Y, f] > boxes[MOST_Y, g]
            if apart:
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                # the first pair only
                if found_a >= 0 and a > found_a:
                    break
                for b in range(f * group, min(other_count, (f + 1) * group)):
                    if same and b <= a:
                        continue
                    # neighbours: folding back
                    if same and b == a + 1:
                        back = (x[b] - x[a]) * (x[b + 1] - x[b]) + (y[b] - y[a]) * (y[b + 1] - y[b])
                        turn = measure_turn(x[a], y[a], x[b], y[b], x[b + 1], y[b + 1])
                        touch = turn == 0.0 and back < 0.0
                    else:
                        touch = segments_touch(
                            x[a], y[a], x[a + 1], y[a + 1], u[b], v[b], u[b + 1], v[b + 1]
                        )
                    earlier = found_a < 0 or a < found_a or (a == found_a and b < found_b)
                    if touch and earlier:
                        found_a = a
                        found_b = b
    return found_a, found_b


def find_self_crossing(line: np.ndarray) -> tuple[int, int] | None:
    """First nodes of the first two segments of a polyline (2, n) that cross or touch, or None."""
    line = np.ascontiguousarray(line, dtype=np.float64)
    group = max(GROUP_EDGES, line.shape[1] // 64)
    boxes = np.empty((4, -(-(line.shape[1] - 1) // group)))
    fill_boxes(line, group, boxes)
    first, second = find_touching(line, line, True, group, boxes, boxes)
    return None if first < 0 else (int(first), int(second))
