"""Boundary lines: nodes spread anew along a polyline or its spline, between fixed key nodes.

Invariants (theory R9): nodes stay on the curve, a straight line stays straight to round-off, no
node passes another.  The trap: a spline through the whole line would round off a corner, so it
breaks at key nodes; and where the line ends on a wall it must see its own mirror image, between
periodic sides itself, or half a domain with walls differs from the whole one.

Source: [CharakhchyanND] §5, after [Godunov1976].  Crossings: `regrid.measure.crossings`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regrid.errors import BadInput
from regrid.jit import kernel

SHAPES = ("chord", "spline")
FREE_END = (0.0, 0.0)


@kernel
def fill_arc_lengths(line, arc):
    """Arc length (n,) of the polyline `line` (2, n) from its first node."""
    x, y = line[0], line[1]
    arc[0] = 0.0
    for k in range(arc.shape[0] - 1):
        step_x, step_y = x[k + 1] - x[k], y[k + 1] - y[k]
        arc[k + 1] = arc[k] + np.sqrt(step_x * step_x + step_y * step_y)


@kernel
def fill_positions(arc, law, first, last, relax, positions):
    """Arc lengths at which the nodes first..last are wanted; False when they are not increasing.

    Between the two key nodes the wanted place follows `law`; a node goes there by the part `relax`
    (theory R9.1).
    """
    length, span = arc[last] - arc[first], law[last] - law[first]
    positions[first], positions[last] = arc[first], arc[last]
    for k in range(first + 1, last):
        wanted = arc[first] + length * ((law[k] - law[first]) / span)
        positions[k] = arc[k] + relax * (wanted - arc[k])
    increasing = True
    for k in range(first, last):
        increasing = increasing and positions[k + 1] > positions[k]
    return increasing


@kernel
def fill_on_chords(line, arc, positions, first, last, out):
    """Nodes first..last of `out` at arc lengths `places` along the chords of `line`."""
    segment = first
    for k in range(first + 1, last):
        while segment < last - 1 and arc[segment + 1] <= positions[k]:
            segment += 1
        part = (positions[k] - arc[segment]) / (arc[segment + 1] - arc[segment])
        for c in range(2):
            out[c, k] = line[c, segment] + part * (line[c, segment + 1] - line[c, segment])


@kernel
def fill_curvatures(line, arc, first, last, wall_first, wall_last, eliminated, second):
    """Second derivatives (2, n) by arc length of the cubic spline through the nodes first..last.

    A wall is given by its unit normal: there the part of the line along the normal is odd (no
    second derivative), the part along the wall even (no first derivative).  (0, 0) is a free end:
    no second derivative.  The solve runs in the frame of the first wall, where the two parts are
    independent up to the last node; `eliminated` (2, n) is scratch.
    """
    normal_x, normal_y = wall_first
    free_first = normal_x == 0.0 and normal_y == 0.0
    if free_first:
        normal_x = 1.0
    # Part 0 is along the wall's normal, part 1 along the wall.
    h = arc[first + 1] - arc[first]
    step_x = line[0, first + 1] - line[0, first]
    step_y = line[1, first + 1] - line[1, first]
    eliminated[0, first], second[0, first] = 0.0, 0.0
    if free_first:
        eliminated[1, first], second[1, first] = 0.0, 0.0
    else:
        eliminated[1, first] = 0.5
        second[1, first] = 3.0 * (-normal_y * step_x + normal_x * step_y) / (h * h)
    rise_x, rise_y = step_x / h, step_y / h
    for k in range(first + 1, last):
        ahead = arc[k + 1] - arc[k]
        ahead_x = (line[0, k + 1] - line[0, k]) / ahead
        ahead_y = (line[1, k + 1] - line[1, k]) / ahead
        bend_x, bend_y = 6.0 * (ahead_x - rise_x), 6.0 * (ahead_y - rise_y)
        right = (normal_x * bend_x + normal_y * bend_y, -normal_y * bend_x + normal_x * bend_y)
        for c in range(2):
            pivot = 1.0 / (2.0 * (h + ahead) - h * eliminated[c, k - 1])
            eliminated[c, k] = ahead * pivot
            second[c, k] = (right[c] - h * second[c, k - 1]) * pivot
        h, rise_x, rise_y = ahead, ahead_x, ahead_y
    # Last node: n . M = 0 and t . (2 M + M_before) = 6 t . rise / h, in the first wall's frame.
    last_x, last_y = wall_last
    second[0, last], second[1, last] = 0.0, 0.0
    if last_x != 0.0 or last_y != 0.0:
        along_0 = normal_x * -last_y + normal_y * last_x
        along_1 = normal_y * last_y + normal_x * last_x
        slope = (-last_y * rise_x + last_x * rise_y) * (-6.0 / h)
        slope -= along_0 * second[0, last - 1] + along_1 * second[1, last - 1]
        stiff = along_0 * along_0 * (2.0 - eliminated[0, last - 1])
        stiff += along_1 * along_1 * (2.0 - eliminated[1, last - 1])
        second[0, last], second[1, last] = along_0 * slope / stiff, along_1 * slope / stiff
    for k in range(last - 1, first - 1, -1):
        for c in range(2):
            second[c, k] -= eliminated[c, k] * second[c, k + 1]
    for k in range(first, last + 1):
        part_0, part_1 = second[0, k], second[1, k]
        second[0, k] = normal_x * part_0 - normal_y * part_1
        second[1, k] = normal_y * part_0 + normal_x * part_1


@kernel
def fill_closed_curvatures(line, arc, eliminated, second):
    """Second derivatives (2, n) of the periodic spline of a line whose ends are one node.

    It goes on beyond the last node as it does from the first one, which lies at the same place or
    a period before.  The spline between two ends with the second derivative X there is linear in X,
    which follows from the smooth slope at the joined ends.  `eliminated` (2, n) is scratch.
    """
    last = arc.shape[0] - 1
    factor, unit = eliminated[0], eliminated[1]  # of the elimination; the solution for X = 1
    factor[0], unit[0], unit[last] = 0.0, 1.0, 1.0
    h = arc[1] - arc[0]
    end_h = arc[last] - arc[last - 1]
    for k in range(1, last):
        ahead = arc[k + 1] - arc[k]
        pivot = 1.0 / (2.0 * (h + ahead) - h * factor[k - 1])
        factor[k] = ahead * pivot
        unit[k] = -h * unit[k - 1] * pivot
        h = ahead
    for k in range(last - 1, 0, -1):
        unit[k] -= factor[k] * unit[k + 1]
    first_h = arc[1] - arc[0]
    stiff = 2.0 * (first_h + end_h) + (first_h * unit[1] + end_h * unit[last - 1])
    for c in range(2):
        second[c, 0], second[c, last] = 0.0, 0.0
        rise = (line[c, 1] - line[c, 0]) / first_h
        first_rise, h = rise, first_h
        for k in range(1, last):
            ahead = arc[k + 1] - arc[k]
            next_rise = (line[c, k + 1] - line[c, k]) / ahead
            second[c, k] = (6.0 * (next_rise - rise) - h * second[c, k - 1]) * (factor[k] / ahead)
            h, rise = ahead, next_rise
        for k in range(last - 1, 0, -1):
            second[c, k] -= factor[k] * second[c, k + 1]
        right = 6.0 * (first_rise - rise)
        right -= first_h * second[c, 1] + end_h * second[c, last - 1]
        for k in range(last + 1):
            second[c, k] += right / stiff * unit[k]


@kernel
def fill_on_spline(line, arc, positions, second, first, last, out):
    """Nodes first..last of `out` at the parameters `places` of the spline through `line`."""
    segment = first
    for k in range(first + 1, last):
        while segment < last - 1 and arc[segment + 1] <= positions[k]:
            segment += 1
        h = arc[segment + 1] - arc[segment]
        right = (positions[k] - arc[segment]) / h
        left = 1.0 - right
        bend_left = (left * left * left - left) * h * h / 6.0
        bend_right = (right * right * right - right) * h * h / 6.0
        for c in range(2):
            chord = line[c, segment] + right * (line[c, segment + 1] - line[c, segment])
            bend = bend_left * second[c, segment] + bend_right * second[c, segment + 1]
            out[c, k] = chord + bend


@kernel
def fill_redistributed(line, law, keys, spline, relax, closed, wall_first, wall_last, work, out):
    """Nodes of `line` spread anew between the key nodes `keys`; see `redistribute`.

    Returns -1, or the first key node of the segment in which nodes would cross; `work` (6, n) is
    scratch.
    """
    count = line.shape[1]
    arc, positions, eliminated, second = work[0], work[1], work[2:4], work[4:6]
    fill_arc_lengths(line, arc)
    for c in range(2):
        for k in range(count):
            out[c, k] = line[c, k]
    for segment in range(keys.shape[0] - 1):
        first, last = keys[segment], keys[segment + 1]
        if not fill_positions(arc, law, first, last, relax, positions):
            return first
        if spline and closed and keys.shape[0] == 2 and last > 1:
            fill_closed_curvatures(line, arc, eliminated, second)
            fill_on_spline(line, arc, positions, second, first, last, out)
        elif spline and last > first + 1:
            start = wall_first if first == 0 else (0.0, 0.0)
            end = wall_last if last == count - 1 else (0.0, 0.0)
            fill_curvatures(line, arc, first, last, start, end, eliminated, second)
            fill_on_spline(line, arc, positions, second, first, last, out)
        else:
            fill_on_chords(line, arc, positions, first, last, out)
    return -1


def compute_arc_lengths(line: np.ndarray) -> np.ndarray:
    """Arc length (n,) of a polyline (2, n) from its first node."""
    line = np.ascontiguousarray(line, dtype=np.float64)
    arc = np.empty(line.shape[1])
    fill_arc_lengths(line, arc)
    return arc


def redistribute(
    line: np.ndarray,
    law: np.ndarray | None = None,
    keys: Sequence[int] = (),
    shape: str = "chord",
    relax: float = 1.0,
    walls: tuple[tuple[float, float], tuple[float, float]] = (FREE_END, FREE_END),
    closed: bool = False,
) -> np.ndarray:
    """Spread the nodes of a polyline along it by a spacing law; returns the new line (2, n).

    `law` (n,) increases strictly (None: uniform between key nodes); between two key nodes its
    values are scaled to the arc length there.  `keys` are indices of inner nodes that stay; the
    ends always do.  `relax` in 0..1 is the part of the way towards the law.  shape "chord" keeps
    nodes on the polyline, "spline" on the cubic spline by chord length, which breaks at key nodes
    and, at an end with a wall (its unit normal in `walls`), continues its own mirror image.
    `closed`: the last node is the first or its periodic image; a spline without key nodes then goes
    on smoothly from one to the other.

    Raises BadInput for a law that does not increase and for nodes that coincide.
    """
    line = np.ascontiguousarray(line, dtype=np.float64)
    count = line.shape[1]
    law = np.arange(count, dtype=np.float64) if law is None else np.ascontiguousarray(law)
    if law.shape != (count,):
        raise BadInput(f"line: a law of {law.size} values cannot place {count} nodes")
    if shape not in SHAPES:
        raise BadInput(f"line: shape must be one of {', '.join(SHAPES)}, got '{shape}'")
    if not 0.0 <= relax <= 1.0:
        raise BadInput(f"line: relax must lie between 0 and 1, got {relax}")
    ends = np.array(sorted({0, count - 1, *keys}), dtype=np.int64)
    if ends[0] < 0 or ends[-1] >= count:
        raise BadInput(f"line: key nodes must lie between 0 and {count - 1}, got {list(keys)}")
    out, work = np.empty_like(line), np.empty((6, count))
    wall_first, wall_last = ((float(wall[0]), float(wall[1])) for wall in walls)
    failed = fill_redistributed(
        line, law, ends, shape == "spline", float(relax), closed, wall_first, wall_last, work, out
    )
    if failed >= 0:
        raise make_crossing(failed)
    return out


def make_crossing(key: int) -> BadInput:
    """What is wrong where `fill_redistributed` fails after a key node."""
    return BadInput(
        f"line: nodes coincide or the law does not increase after key node {key}; "
        "every node needs a place of its own"
    )
