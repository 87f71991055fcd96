"""Where polylines cross themselves or each other.

Touching counts as crossing: a side whose nodes touch bounds no valid cell.  Segments are compared
by boxes of `GROUP` segments first, so that a check of a few hundred nodes costs microseconds and
can be made at every step.  Lines of more than 64 groups use wider ones.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import kernel

GROUP = 12
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
            boxes[2 * c, g], boxes[2 * c + 1, g] = low, high


@kernel
def find_touching(line, other, same, group, boxes, other_boxes):
    """First pair of touching segments (index of their first nodes), or (-1, -1).

    With `same` the two lines are one: neighbouring segments are only tested for folding back.
    """
    x, y, u, v = line[0], line[1], other[0], other[1]
    count, other_count = line.shape[1] - 1, other.shape[1] - 1
    found_a, found_b = -1, -1
    for g in range(boxes.shape[1]):
        for f in range(g if same else 0, other_boxes.shape[1]):
            apart = boxes[LEAST_X, g] > other_boxes[MOST_X, f]
            apart = apart or other_boxes[LEAST_X, f] > boxes[MOST_X, g]
            apart = apart or boxes[LEAST_Y, g] > other_boxes[MOST_Y, f]
            apart = apart or other_boxes[LEAST_Y, f] > boxes[MOST_Y, g]
            if apart:
                continue
            for a in range(g * group, min(count, (g + 1) * group)):
                if found_a >= 0 and a > found_a:
                    break
                for b in range(f * group, min(other_count, (f + 1) * group)):
                    if same and b <= a:
                        continue
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
                        found_a, found_b = a, b
    return found_a, found_b


def _boxes_of(line: np.ndarray, group: int) -> np.ndarray:
    boxes = np.empty((4, -(-(line.shape[1] - 1) // group)))
    fill_boxes(line, group, boxes)
    return boxes


def find_self_crossing(line: np.ndarray) -> tuple[int, int] | None:
    """First nodes of the first two segments of a polyline (2, n) that cross or touch, or None."""
    line = np.ascontiguousarray(line, dtype=np.float64)
    group = max(GROUP, line.shape[1] // 64)
    boxes = _boxes_of(line, group)
    first, second = find_touching(line, line, True, group, boxes, boxes)
    return None if first < 0 else (int(first), int(second))


def find_crossing(line: np.ndarray, other: np.ndarray) -> tuple[int, int] | None:
    """First nodes of the first segments of two polylines that cross or touch, or None."""
    line = np.ascontiguousarray(line, dtype=np.float64)
    other = np.ascontiguousarray(other, dtype=np.float64)
    group = max(GROUP, line.shape[1] // 64, other.shape[1] // 64)
    boxes, other_boxes = _boxes_of(line, group), _boxes_of(other, group)
    first, second = find_touching(line, other, False, group, boxes, other_boxes)
    return None if first < 0 else (int(first), int(second))
