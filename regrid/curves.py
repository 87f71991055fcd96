"""Boundary lines: bending, and respacing of nodes between key nodes.

A spacing (`regrid.spacings`) gives the positions of a line's nodes.  A spacing by turning (theory
R9.2) concentrates nodes where a line bends: a segment may turn by SEGMENT_TURN, and at least
LEAST_EVEN_SHARE of the nodes keep the initial spacing.

Respaced nodes (theory R9) stay on the curve, a straight line stays straight to round-off, and no
node passes another.  Note: a spline through a whole line would round off its corners, so it breaks
at key nodes.  At a wall it continues as its mirror image, and between periodic sides periodically;
otherwise half a domain between walls would differ from half of the whole one.

Source: [CharakhchyanND] §1, §5, after [Godunov1976].  Crossings: `regrid.measure.crossings`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined, kernel

SEGMENT_TURN = np.radians(10.0)  # that one segment takes where nodes suffice
# least part of the nodes that keep the first spacing: without them, nodes that go to a kink would
# leave the tips of bubbles and spikes to segments many times longer than at first
LEAST_EVEN_SHARE = 0.5
TURNING_SMOOTHINGS = 3  # of the turning, over neighbouring segments
# up to which a line counts as symmetric: parts of the mean segment, and of a segment that is wanted
SYMMETRIC_SEGMENT = 1e-9
SYMMETRIC_TURNING = 1e-7
ROUNDING_OF_SPACING = 1e-12  # up to which a spacing differs from its image by rounding
SHAPES = ("chord", "spline")
FREE_END = (0.0, 0.0)


@inlined
def take_segment(line, k):
    """Segment k of a polyline (2, n): x and y."""
    return line[0, k + 1] - line[0, k], line[1, k + 1] - line[1, k]


@inlined
def measure_end_turn(segment, normal):
    """Angle by which a line turns at a wall: to its mirror image; 0 at a free end.

    From the parts of the end's segment along and across the wall's normal.
    """
    x, y = segment
    normal_x, normal_y = normal
    if normal_x == 0.0 and normal_y == 0.0:
        return 0.0
    along = abs(normal_x * x + normal_y * y)
    across = abs(normal_x * y - normal_y * x)
    return 2.0 * np.arctan2(across, along)


@kernel
def fill_turns(line, closed, wall_first, wall_last, turns):
    """Angles (n,) by which a line turns at its nodes; line, ends as in `fill_turning_spacing`."""
    edges = turns.shape[0] - 1
    for k in range(edges + 1):
        is_end = k == 0 or k == edges
        if is_end and not closed:
            segment = take_segment(line, 0 if k == 0 else edges - 1)
            turns[k] = measure_end_turn(segment, wall_first if k == 0 else wall_last)
            continue
        ax, ay = take_segment(line, edges - 1 if is_end else k - 1)
        bx, by = take_segment(line, 0 if is_end else k)
        turns[k] = abs(np.arctan2(ax * by - ay * bx, ax * bx + ay * by))


@kernel
def fill_turning(line, closed, wall_first, wall_last, wanted):
    """Numbers of segments that each segment's turning needs: wanted (n - 1,).

    Line and ends as in `fill_turning_spacing`.
    """
    edges = line.shape[1] - 1
    turns = np.empty(edges + 1)
    fill_turns(line, closed, wall_first, wall_last, turns)
    # segments of the angle SEGMENT_TURN each
    for k in range(edges):
        wanted[k] = 0.5 * (turns[k] + turns[k + 1]) / SEGMENT_TURN
    # smoothed along the line (R9.2)
    for _ in range(TURNING_SMOOTHINGS):
        first = wanted[0]
        last = wanted[edges - 1]
        before = last if closed else first
        for k in range(edges):
            after = wanted[k + 1] if k + 1 < edges else (first if closed else last)
            unsmoothed = wanted[k]
            wanted[k] = 0.5 * unsmoothed + 0.25 * (before + after)
            before = unsmoothed


@kernel
def fill_turning_spacing(
    line, first_spacing, turning, closed, wall_first, wall_last, shortest, spacing
):
    """Spacing (n,) of a line (2, n): positions by length from 0 to 1.

    `first_spacing` (n,) is the spacing where the line bends no more than it did at first, when it
    had `turning` (n - 1,), see `fill_turning`: a line that only moves along keeps its nodes, so
    that a uniform flow along a bent line stays uniform.  `shortest` [m]: turning asks for no
    shorter segments.  The line is closed (its last node is the first or its periodic image), or
    ends on walls, given by their unit normals, at its mirror image; (0, 0) is a free end.
    """
    count = line.shape[1]
    edges = count - 1
    arc = np.empty(count)
    # segments that each one's turning needs, and the share of them that it receives
    wanted = np.empty(edges)
    fill_arc_lengths(line, arc)
    fill_turning(line, closed, wall_first, wall_last, wanted)
    total = 0.0
    for k in range(edges):
        wanted[k] = max(wanted[k] - turning[k], 0.0)
        wanted[k] = min(wanted[k], (arc[k + 1] - arc[k]) / shortest)
        total += wanted[k]
    even_share = max(1.0 - total / edges, LEAST_EVEN_SHARE)
    granted_share = min(1.0, (1.0 - even_share) * edges / total) if total > 0.0 else 1.0
    # the number of segments up to node k is its level; a node lies wherever that is whole
    spacing[0] = 0.0
    spacing[edges] = 1.0
    turning_so_far = 0.0
    next_node = 1
    even_node = 0
    level_before = 0.0
    for k in range(edges):
        position = arc[k + 1] / arc[edges]
        while even_node < edges - 1 and first_spacing[even_node + 1] < position:
            even_node += 1
        interval = first_spacing[even_node + 1] - first_spacing[even_node]
        even_level = even_node + (position - first_spacing[even_node]) / interval
        turning_so_far += wanted[k]
        level_after = even_share * even_level + granted_share * turning_so_far
        while next_node < edges and next_node <= level_after:
            fraction = (next_node - level_before) / (level_after - level_before)
            spacing[next_node] = (arc[k] + fraction * (arc[k + 1] - arc[k])) / arc[edges]
            next_node += 1
        level_before = level_after
    # nodes that round-off leaves over at the end
    for k in range(next_node, edges):
        spacing[k] = 1.0 - (edges - k) * (1.0 - spacing[next_node - 1]) / (edges - next_node + 1)
    even_out_spacing(arc, first_spacing, wanted, spacing)


@kernel
def even_out_spacing(arc, first_spacing, wanted, spacing):
    """Make a spacing (n,) symmetric where its line is so up to rounding; theory R9.

    arc [m], first spacing (n,), wanted (n - 1,) segments: of the line, see `fill_turning_spacing`.
    Spacings by turning magnify rounding step by step where a line has too few nodes for its turns.
    """
    # comparisons are negated so that a line with a NaN does not count as symmetric
    edges = arc.shape[0] - 1
    tolerance = SYMMETRIC_SEGMENT * arc[edges] / edges
    for k in range(edges // 2):
        mirrored = edges - 1 - k
        length = arc[k + 1] - arc[k]
        if not abs(length - (arc[mirrored + 1] - arc[mirrored])) <= tolerance:
            return
        if not abs(wanted[k] - wanted[mirrored]) <= SYMMETRIC_TURNING:
            return
        mirrored_position = 1.0 - first_spacing[edges - k]
        if not abs(first_spacing[k] - mirrored_position) <= SYMMETRIC_SEGMENT / edges:
            return
    # the mean of the spacing and its mirror image
    departure = 0.0
    for k in range(edges // 2 + 1):
        departure = max(departure, abs(spacing[k] - (1.0 - spacing[edges - k])))
    if departure > ROUNDING_OF_SPACING:
        for k in range(edges // 2 + 1):
            spacing[k] = 0.5 * (spacing[k] + (1.0 - spacing[edges - k]))
            spacing[edges - k] = 1.0 - spacing[k]


@kernel
def fill_arc_lengths(line, arc):
    """Arc length (n,) of the polyline `line` (2, n) from its first node."""
    x, y = line[0], line[1]
    arc[0] = 0.0
    for k in range(arc.shape[0] - 1):
        step_x, step_y = x[k + 1] - x[k], y[k + 1] - y[k]
        arc[k + 1] = arc[k] + np.sqrt(step_x * step_x + step_y * step_y)


@kernel
def fill_positions(arc, spacing, first, last, relax, positions):
    """Arc lengths at which the nodes first..last are wanted; False when they are not increasing.

    Between the two key nodes the wanted place follows `spacing`; a node goes there by the part
    `relax` (theory R9.1).
    """
    length = arc[last] - arc[first]
    span = spacing[last] - spacing[first]
    positions[first] = arc[first]
    positions[last] = arc[last]
    for k in range(first + 1, last):
        wanted = arc[first] + length * ((spacing[k] - spacing[first]) / span)
        positions[k] = arc[k] + relax * (wanted - arc[k])
    increasing = True
    for k in range(first, last):
        increasing = increasing and positions[k + 1] > positions[k]
    return increasing


@inlined
def begin_curvatures(line, arc, first, normal, is_free, eliminated, second):
    """First row of the elimination of `fill_curvatures`; returns the slope of the first segment."""
    normal_x, normal_y = normal
    h = arc[first + 1] - arc[first]
    step_x = line[0, first + 1] - line[0, first]
    step_y = line[1, first + 1] - line[1, first]
    # component 0 is along the wall's normal, component 1 along the wall
    eliminated[0, first] = 0.0
    second[0, first] = 0.0
    if is_free:
        eliminated[1, first] = 0.0
        second[1, first] = 0.0
    else:
        eliminated[1, first] = 0.5
        second[1, first] = 3.0 * (-normal_y * step_x + normal_x * step_y) / (h * h)
    return step_x / h, step_y / h


@inlined
def end_curvatures(last, h, slope, normal, wall_last, eliminated, second):
    """Second derivative at the last node, in the first wall's frame; 0 at a free end.

    There n . M = 0 and t . (2 M + M_before) = 6 t . slope / h, with normal n and tangent t of its
    wall.
    """
    normal_x, normal_y = normal
    slope_x, slope_y = slope
    last_x, last_y = wall_last
    second[0, last] = 0.0
    second[1, last] = 0.0
    if last_x != 0.0 or last_y != 0.0:
        # the tangent in this frame
        along_0 = normal_x * -last_y + normal_y * last_x
        along_1 = normal_y * last_y + normal_x * last_x
        right_side = (-last_y * slope_x + last_x * slope_y) * (-6.0 / h)
        right_side -= along_0 * second[0, last - 1] + along_1 * second[1, last - 1]
        stiffness = along_0 * along_0 * (2.0 - eliminated[0, last - 1])
        stiffness += along_1 * along_1 * (2.0 - eliminated[1, last - 1])
        second[0, last] = along_0 * right_side / stiffness
        second[1, last] = along_1 * right_side / stiffness


@kernel
def fill_curvatures(line, arc, first, last, wall_first, wall_last, eliminated, second):
    """Second derivatives (2, n) by arc length of the cubic spline through the nodes first..last.

    A wall is given by its unit normal: there the component of the line along the normal is odd (no
    second derivative), the component along the wall even (no first derivative).  (0, 0) is a free
    end: no second derivative.  The solve runs in the frame of the first wall, where the two
    components are independent up to the last node; `eliminated` (2, n) is scratch.
    """
    normal_x, normal_y = wall_first
    is_free = normal_x == 0.0 and normal_y == 0.0
    if is_free:
        normal_x = 1.0
    normal = (normal_x, normal_y)
    slope_x, slope_y = begin_curvatures(line, arc, first, normal, is_free, eliminated, second)
    # forward
    h = arc[first + 1] - arc[first]
    for k in range(first + 1, last):
        next_h = arc[k + 1] - arc[k]
        next_x = (line[0, k + 1] - line[0, k]) / next_h
        next_y = (line[1, k + 1] - line[1, k]) / next_h
        jump_x, jump_y = 6.0 * (next_x - slope_x), 6.0 * (next_y - slope_y)
        right_side = (normal_x * jump_x + normal_y * jump_y, -normal_y * jump_x + normal_x * jump_y)
        for c in range(2):
            pivot = 1.0 / (2.0 * (h + next_h) - h * eliminated[c, k - 1])
            eliminated[c, k] = next_h * pivot
            second[c, k] = (right_side[c] - h * second[c, k - 1]) * pivot
        h = next_h
        slope_x = next_x
        slope_y = next_y
    end_curvatures(last, h, (slope_x, slope_y), normal, wall_last, eliminated, second)
    # backward, and from the wall's frame to x and y
    for k in range(last - 1, first - 1, -1):
        for c in range(2):
            second[c, k] -= eliminated[c, k] * second[c, k + 1]
    for k in range(first, last + 1):
        along_normal = second[0, k]
        along_wall = second[1, k]
        second[0, k] = normal_x * along_normal - normal_y * along_wall
        second[1, k] = normal_y * along_normal + normal_x * along_wall


@kernel
def fill_closed_curvatures(line, arc, eliminated, second):
    """Second derivatives (2, n) of the periodic spline of a line whose ends are one node.

    It goes on beyond the last node as it does from the first one, which lies at the same place or
    a period before.  The spline between two ends with the second derivative X there is linear in X,
    which follows from the smooth slope at the joined ends.  `eliminated` (2, n) is scratch.
    """
    last = arc.shape[0] - 1
    fill_curvatures(line, arc, 0, last, FREE_END, FREE_END, eliminated, second)
    first_h = arc[1] - arc[0]
    end_h = arc[last] - arc[last - 1]
    slopes = np.empty(2)
    for c in range(2):
        slope = (line[c, 1] - line[c, 0]) / first_h - (line[c, last] - line[c, last - 1]) / end_h
        slopes[c] = 6.0 * slope - first_h * second[c, 1] - end_h * second[c, last - 1]
    # of the elimination; the solution for X = 1
    factors = eliminated[0]
    unit_solution = eliminated[1]
    factors[0] = 0.0
    unit_solution[0] = 1.0
    unit_solution[last] = 1.0
    h = first_h
    for k in range(1, last):
        ahead = arc[k + 1] - arc[k]
        pivot = 1.0 / (2.0 * (h + ahead) - h * factors[k - 1])
        factors[k] = ahead * pivot
        unit_solution[k] = -h * unit_solution[k - 1] * pivot
        h = ahead
    for k in range(last - 1, 0, -1):
        unit_solution[k] -= factors[k] * unit_solution[k + 1]
    stiff = 2.0 * (first_h + end_h) + (first_h * unit_solution[1] + end_h * unit_solution[last - 1])
    for c in range(2):
        for k in range(last + 1):
            second[c, k] += slopes[c] / stiff * unit_solution[k]


@kernel
def fill_on_spline(line, arc, positions, second, first, last, out):
    """Nodes first..last of `out` at the arc lengths `positions` of the spline through `line`."""
    segment = first
    for k in range(first + 1, last):
        while segment < last - 1 and arc[segment + 1] <= positions[k]:
            segment += 1
        h = arc[segment + 1] - arc[segment]
        right = (positions[k] - arc[segment]) / h
        left = 1.0 - right
        weight_left = (left * left * left - left) * h * h / 6.0
        weight_right = (right * right * right - right) * h * h / 6.0
        for c in range(2):
            chord = line[c, segment] + right * (line[c, segment + 1] - line[c, segment])
            departure = weight_left * second[c, segment] + weight_right * second[c, segment + 1]
            out[c, k] = chord + departure


@kernel
def fill_redistributed(line, target, keys, spline, closed, walls, work, out):
    """Nodes of `line` redistributed between the key nodes `keys`; see `redistribute`.

    target: a spacing (n,) and the fraction of the way to it that nodes go; walls: their normals
    at both ends; `work` (6, n) is scratch.  Returns -1, or the first key node of the segment in
    which nodes would cross.
    """
    spacing, relax = target
    wall_first, wall_last = walls
    count = line.shape[1]
    arc = work[0]
    positions = work[1]
    eliminated = work[2:4]
    second = work[4:6]
    # nodes stay where nothing moves them
    fill_arc_lengths(line, arc)
    for c in range(2):
        for k in range(count):
            out[c, k] = line[c, k]
    for segment in range(keys.shape[0] - 1):
        first = keys[segment]
        last = keys[segment + 1]
        # wanted arc lengths between two key nodes (R9.1)
        if not fill_positions(arc, spacing, first, last, relax, positions):
            return first
        # places there: on a periodic spline, one between key nodes, or chords
        if spline and closed and keys.shape[0] == 2 and last > 1:
            fill_closed_curvatures(line, arc, eliminated, second)
            fill_on_spline(line, arc, positions, second, first, last, out)
        elif spline and last > first + 1:
            start = wall_first if first == 0 else (0.0, 0.0)
            end = wall_last if last == count - 1 else (0.0, 0.0)
            fill_curvatures(line, arc, first, last, start, end, eliminated, second)
            fill_on_spline(line, arc, positions, second, first, last, out)
        else:
            second[:, first : last + 1] = 0.0  # chords
            fill_on_spline(line, arc, positions, second, first, last, out)
    return -1


def compute_arc_lengths(line: np.ndarray) -> np.ndarray:
    """Arc length (n,) of a polyline (2, n) from its first node."""
    line = np.ascontiguousarray(line, dtype=np.float64)
    arc = np.empty(line.shape[1])
    fill_arc_lengths(line, arc)
    return arc


def redistribute(
    line: np.ndarray,
    spacing: np.ndarray | None = None,
    keys: Sequence[int] = (),
    shape: str = "chord",
    relax: float = 1.0,
    walls: tuple[tuple[float, float], tuple[float, float]] = (FREE_END, FREE_END),
    closed: bool = False,
) -> np.ndarray:
    """Respace the nodes of a polyline along it; returns the new line (2, n).

    `spacing` (n,) increases strictly (None: uniform between key nodes); between two key nodes its
    values are scaled to the arc length there.  `keys` are indices of inner nodes that stay; the
    ends always do.  `relax` in 0..1 is the fraction of the way to the spacing.  shape "chord" keeps
    nodes on the polyline, "spline" on the cubic spline by chord length, which breaks at key nodes
    and, at an end with a wall (its unit normal in `walls`), continues its own mirror image.
    `closed`: the last node is the first or its periodic image; a spline without key nodes then goes
    on smoothly from one to the other.

    Raises BadInput for a spacing that does not increase and for nodes that coincide.
    """
    line = np.ascontiguousarray(line, dtype=np.float64)
    count = line.shape[1]
    spacing = (
        np.arange(count, dtype=np.float64) if spacing is None else np.ascontiguousarray(spacing)
    )
    if spacing.shape != (count,):
        raise BadInput(f"line: a spacing of {spacing.size} values cannot place {count} nodes")
    if shape not in SHAPES:
        raise BadInput(f"line: shape must be one of {', '.join(SHAPES)}, got '{shape}'")
    if not 0.0 <= relax <= 1.0:
        raise BadInput(f"line: relax must lie between 0 and 1, got {relax}")
    ends = np.array(sorted({0, count - 1, *keys}), dtype=np.int64)
    if ends[0] < 0 or ends[-1] >= count:
        raise BadInput(f"line: key nodes must lie between 0 and {count - 1}, got {list(keys)}")
    out = np.empty_like(line)
    work = np.empty((6, count))
    wall_first, wall_last = ((float(wall[0]), float(wall[1])) for wall in walls)
    target = spacing, float(relax)
    normals = wall_first, wall_last
    failed = fill_redistributed(line, target, ends, shape == "spline", closed, normals, work, out)
    if failed >= 0:
        raise make_crossing(failed)
    return out


def make_crossing(key: int) -> BadInput:
    """What is wrong where `fill_redistributed` fails after a key node."""
    return BadInput(
        f"line: nodes coincide or the spacing does not increase after key node {key}; "
        "every node needs its own position"
    )
