"""Boundary lines: spacings, bending, and respacing of nodes between key nodes.

A spacing is an increasing sequence from 0 to 1 that gives the positions of a line's nodes.
Equidistribution (ED1, theory R10.1) makes weight times interval equal on all intervals.  Note: a
weight that is known only at the old nodes must be integrated first, and the integral interpolated
monotonically and inverted; if the weight itself is interpolated, nodes can cross.  A spacing by
turning (theory R9.2) concentrates nodes where a line bends: a segment may turn by TURN, and at
least LEAST_EVEN of the nodes keep the initial spacing.

Respaced nodes (theory R9) stay on the curve, a straight line stays straight to round-off, and no
node passes another.  Note: a spline through a whole line would round off its corners, so it breaks
at key nodes.  At a wall it continues as its mirror image, and between periodic sides periodically;
otherwise half a domain between walls would differ from half of the whole one.

Sources: [KhakimzyanovShokina1998] §1 (ED1), [Polevikov1983] (grids that follow a speed),
[CharakhchyanND] §1, §5, after [Godunov1976].  Crossings: `regrid.measure.crossings`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.roots import find_root

SETTLED_PRODUCT_SPREAD = 1e-9  # relative spread of products that passes for equal
REFINED_STEP_RATIO = 1.15  # of neighbouring steps where a line is refined towards one end
# nodes of a line over those within which steps grow by e towards the far ones
NODES_OF_E_FOLD = 5.0


def uniform_spacing(count: int) -> np.ndarray:
    """`count` equidistant values from 0 to 1."""
    return np.linspace(0.0, 1.0, count)


def arc_spacing(line: np.ndarray) -> np.ndarray:
    """The present spacing of the nodes of a polyline (2, n), by arc length."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=1)))])
    if not arc[-1] > 0.0:
        return uniform_spacing(arc.size)
    spacing = arc / arc[-1]
    spacing[-1] = 1.0
    return spacing


def geometric_spacing(count: int, ratio: float) -> np.ndarray:
    """Spacing of `count` nodes whose steps grow by the factor `ratio` from one to the next."""
    if not ratio > 0.0:
        raise BadInput(f"spacing: the growth ratio of steps must be positive, got {ratio}")
    # Powers of the larger end are kept below 1, so that no spacing overflows.
    powers = np.arange(count - 1) - (count - 2 if ratio > 1.0 else 0)
    steps = np.exp(powers * np.log(ratio))
    spacing = np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])
    spacing[-1] = 1.0
    return spacing


def clustered_spacing(count: int, first: float, at_end: bool = False) -> np.ndarray:
    """Geometric spacing whose first step (last, if `at_end`) is `first` of the line."""
    steps = count - 1
    if not 0.0 < first < 1.0 or steps < 2:
        raise BadInput(
            f"spacing: the first step must be a fraction between 0 and 1 of a line with at least "
            f"2 steps, got {first} of {steps} steps"
        )

    def excess(log_ratio: float) -> float:
        # First step of the spacing, as a logarithm: monotone in the ratio, and exact near 1.
        if abs(log_ratio) < 1e-12:
            return -np.log(steps) - np.log(first)
        growth = np.log(np.expm1(abs(log_ratio)) / -np.expm1(-steps * abs(log_ratio)))
        last = growth - abs(log_ratio)
        return (growth - steps * abs(log_ratio) if log_ratio > 0.0 else last) - np.log(first)

    bound = 1.0
    while excess(bound) > 0.0 or excess(-bound) < 0.0:
        bound *= 2.0
    ratio = find_root(excess, -bound, bound, xtol=1e-15)
    spacing = geometric_spacing(count, float(np.exp(ratio)))
    return (1.0 - spacing)[::-1] if at_end else spacing


@kernel
def fill_grown_spacing(least, length, at_end, spacing):
    """Law (n,) of a line whose steps grow from `least` at one end, as `meeting_laws` says."""
    number = spacing.shape[0] - 1
    step = length / number
    q = max(0.0, 1.0 - NODES_OF_E_FOLD / number)
    total = 0.0
    power = 1.0
    for _ in range(number):
        total += power
        power *= q
    far = (length - least * total) / (number - total)
    grows = step > least * (1.0 + 1e-9)
    power = 1.0
    position = 0.0
    spacing[number if at_end else 0] = 1.0 if at_end else 0.0
    for k in range(1, number):
        position += far - (far - least) * power if grows else step
        power *= q
        if at_end:
            spacing[number - k] = 1.0 - position / length
        else:
            spacing[k] = position / length
    spacing[0 if at_end else number] = 0.0 if at_end else 1.0


@kernel
def fill_refined_spacing(least, length, at_end, spacing):
    """Law (n,) of a line whose steps grow from `least` at one end by REFINED_STEP_RATIO each, then
    are even.

    Falls back on `fill_grown_spacing` where even steps would be shorter, or growing ones too few.
    """
    number = spacing.shape[0] - 1
    # of the growing steps; the step that comes next
    total = 0.0
    last = least
    even = 0.0
    for k in range(number):
        even = (length - total) / (number - k)
        if even <= last:
            break
        total += last
        last *= REFINED_STEP_RATIO
    if even > last or even < least:
        fill_grown_spacing(least, length, at_end, spacing)
        return
    position = 0.0
    step = least
    spacing[number if at_end else 0] = 1.0 if at_end else 0.0
    for k in range(1, number):
        position += min(step, even)
        step *= REFINED_STEP_RATIO
        if at_end:
            spacing[number - k] = 1.0 - position / length
        else:
            spacing[k] = position / length
    spacing[0 if at_end else number] = 0.0 if at_end else 1.0


def meeting_laws(
    counts: tuple[int, int], lengths: tuple[float, float], refinement: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Spacings of two lines end to end whose steps are the same where they meet.

    The line that would have the shorter steps is uniform.  On the other the step k from the
    meeting point is h (1 - (1 - h0/h) q^k): within about a fifth of its nodes the steps grow from
    the shorter line's h0 to h, and stay uniform from there.  counts: nodes of the two lines (at
    least 3); lengths: theirs.  `refinement` makes h0 so many times shorter: above 1 the steps of
    both lines grow, by the factor REFINED_STEP_RATIO from one to the next.
    """
    least = min(lengths[0] / (counts[0] - 1), lengths[1] / (counts[1] - 1)) / refinement
    spacings = np.empty(counts[0]), np.empty(counts[1])
    for end in (0, 1):
        if refinement > 1.0:
            fill_refined_spacing(least, lengths[end], end == 0, spacings[end])
        else:
            fill_grown_spacing(least, lengths[end], end == 0, spacings[end])
    return spacings


def equidistribute(nodes: np.ndarray, weight: np.ndarray, count: int | None = None) -> np.ndarray:
    """New nodes between the ends of `nodes` (n,) with equal integrals of `weight` on their steps.

    `weight` is positive and given at the n nodes, or on the n - 1 steps between them (then the
    integral is inverted exactly).  The integral is interpolated monotonically.
    """
    nodes = np.asarray(nodes, dtype=float)
    weight = np.asarray(weight, dtype=float)
    if weight.size not in (nodes.size, nodes.size - 1) or not (weight > 0.0).all():
        raise BadInput("spacing: a weight must be positive, one value a node or one a step")
    on_steps = weight if weight.size < nodes.size else 0.5 * (weight[1:] + weight[:-1])
    integral = np.concatenate([[0.0], np.cumsum(on_steps * np.abs(np.diff(nodes)))])
    levels = integral[-1] * uniform_spacing(count or nodes.size)
    if weight.size < nodes.size:
        found = np.interp(levels, integral, nodes)
    else:
        from scipy.interpolate import PchipInterpolator  # slow to load

        found = PchipInterpolator(integral, nodes)(levels)
    found[0] = nodes[0]
    found[-1] = nodes[-1]
    return found


def solve_ed1(
    weight: Callable[[np.ndarray], np.ndarray],
    count: int,
    start: float = 0.0,
    end: float = 1.0,
    iterations: int = 200,
    tolerance: float = 1e-14,
) -> np.ndarray:
    """Nodes x with `w[j+1/2] (x[j+1] - x[j])` equal on all steps, w taken at the steps' middles.

    [KhakimzyanovShokina1998] (1.6), theory R10.1.  Raises RegridFailure where no such nodes are
    found (a weight that jumps).
    """
    fine = np.linspace(start, end, 20 * count)
    return equalise_products(
        lambda left, right: weight(0.5 * (left + right)),
        equidistribute(fine, weight(fine), count),
        iterations,
        tolerance,
    )


def correct_polevikov(nodes: np.ndarray, speed: np.ndarray, floor: float = 1e-6) -> np.ndarray:
    """One correction (theory R11.2): steps in proportion to `1 / (|v[i-1]| + |v[i]|)`, ends fixed.

    `speed` is v at the n `nodes`; a convection solver finds it again on the new ones.  A sum below
    the part `floor` of the largest counts as that part, so that stagnant fluid has equal steps.
    """
    nodes = np.asarray(nodes, dtype=float)
    size = np.abs(np.asarray(speed, dtype=float))
    if size.shape != nodes.shape or not np.isfinite(size).all():
        raise BadInput("spacing: a speed must be finite, one value a node")
    sums = size[1:] + size[:-1]
    if not sums.max() > 0.0:
        return np.linspace(nodes[0], nodes[-1], nodes.size)
    spacing = np.concatenate([[0.0], np.cumsum(1.0 / np.maximum(sums, floor * sums.max()))])
    found = nodes[0] + (nodes[-1] - nodes[0]) * (spacing / spacing[-1])
    found[-1] = nodes[-1]
    return found


def solve_polevikov(
    speed: Callable[[np.ndarray], np.ndarray],
    count: int,
    start: float = 0.0,
    end: float = 1.0,
    floor: float = 1e-6,
) -> np.ndarray:
    """Nodes with `(|v[i-1]| + |v[i]|) (x[i] - x[i-1])` equal on all steps (theory R11.1).

    The limit of `correct_polevikov` for a speed known everywhere, found by Newton's method; sums
    below the part `floor` of twice the largest speed count as that part.
    """
    fine = np.linspace(start, end, 20 * count)
    size = np.abs(speed(fine))
    if not size.max() > 0.0:
        return np.linspace(start, end, count)
    least = floor * size.max()
    return equalise_products(
        lambda left, right: np.maximum(np.abs(speed(left)) + np.abs(speed(right)), 2.0 * least),
        equidistribute(fine, np.maximum(size, least), count),
    )


def equalise_products(
    weigh: Callable[[np.ndarray, np.ndarray], np.ndarray],
    nodes: np.ndarray,
    iterations: int = 200,
    tolerance: float = 1e-14,
) -> np.ndarray:
    """Nodes between the ends of `nodes` with `weigh(x[j], x[j+1]) (x[j+1] - x[j])` equal.

    Newton's method on the products, begun from the monotone `nodes`; a step is halved while it
    would let nodes cross or the spread grow.  Raises RegridFailure where it ends above
    SETTLED_PRODUCT_SPREAD.
    """
    x = np.array(nodes, dtype=float)
    if x.size < 3:
        return x
    count = x.size
    width = x[-1] - x[0]
    # Unknown are the inner nodes and the common product: the last column of the matrix.
    matrix = np.zeros((count - 1, count - 1))
    rows = np.arange(count - 2)

    def products(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        return weigh(left, right) * (right - left)

    product = products(x[:-1], x[1:])
    for _ in range(iterations):
        mean = product.mean()
        spread = np.abs(product - mean).max()
        if spread <= tolerance * abs(mean):
            break
        left, right = x[:-1], x[1:]
        small = 1e-6 * (right - left)
        by_left = (products(left + small, right) - products(left - small, right)) / (2.0 * small)
        by_right = (products(left, right + small) - products(left, right - small)) / (2.0 * small)
        matrix[:] = 0.0
        matrix[rows, rows] = by_right[:-1]
        matrix[rows + 1, rows] = by_left[1:]
        matrix[:, -1] = -1.0
        change = np.linalg.solve(matrix, mean - product)[:-1]
        for _ in range(40):
            trial = x.copy()
            trial[1:-1] += change
            trial_product = products(trial[:-1], trial[1:])
            ordered = (np.diff(trial) * width > 0.0).all()
            if ordered and np.abs(trial_product - trial_product.mean()).max() < spread:
                break
            change *= 0.5
        else:
            break
        if np.abs(change).max() < 1e-16 * abs(width):
            break
        x = trial
        product = trial_product
    spread = np.abs(product - product.mean()).max() / abs(product.mean())
    if not spread <= SETTLED_PRODUCT_SPREAD:
        worst = int(np.abs(product - product.mean()).argmax())
        raise RegridFailure(
            f"spacing: equidistribution stalled with products {spread:.1e} apart, worst on the "
            f"step from node {worst}; a smoother weight or more nodes would let it settle"
        )
    return x


TURN = np.radians(10.0)  # that one segment takes where nodes suffice
# least part of the nodes that keep the first spacing: without them, nodes that go to a kink would
# leave the tips of bubbles and spikes to segments many times longer than at first
LEAST_EVEN = 0.5
TURNING_SMOOTHINGS = 3  # of the turning, over neighbouring segments
# up to which a line counts as symmetric: parts of the mean segment, and of a segment that is wanted
SYMMETRIC_SEGMENT = 1e-9
SYMMETRIC_TURNING = 1e-7
ROUNDING_OF_SPACING = 1e-12  # up to which a spacing differs from its image by rounding


@kernel
def fill_turning(line, closed, wall_first, wall_last, wanted):
    """Numbers of segments that each segment's turning needs: wanted (n - 1,); line, ends as
    below."""
    count = line.shape[1]
    edges = count - 1
    # angle by which the line turns at each node
    turn = np.empty(count)
    for k in range(count):
        before = max(k - 1, 0)
        after = min(k, edges - 1)
        if closed and (k == 0 or k == edges):
            before = edges - 1
            after = 0
        ax, ay = line[0, before + 1] - line[0, before], line[1, before + 1] - line[1, before]
        bx, by = line[0, after + 1] - line[0, after], line[1, after + 1] - line[1, after]
        if before == after:  # an end: its mirror image's segment, along and across the normal
            nx, ny = wall_first if k == 0 else wall_last
            along = abs(nx * ax + ny * ay)
            across = abs(nx * ay - ny * ax)
            turn[k] = 2.0 * np.arctan2(across, along)
            if nx == 0.0 and ny == 0.0:
                turn[k] = 0.0
        else:
            turn[k] = abs(np.arctan2(ax * by - ay * bx, ax * bx + ay * by))
    # segments of the angle TURN each, smoothed along the line (R9.2)
    for k in range(edges):
        wanted[k] = 0.5 * (turn[k] + turn[k + 1]) / TURN
    for _ in range(TURNING_SMOOTHINGS):
        start = wanted[0]
        last = wanted[edges - 1]
        before = last if closed else start
        for k in range(edges):
            after = wanted[k + 1] if k + 1 < edges else (start if closed else last)
            here = wanted[k]
            wanted[k] = 0.5 * here + 0.25 * (before + after)
            before = here


@kernel
def fill_turning_spacing(line, first, turning, closed, wall_first, wall_last, shortest, spacing):
    """Spacing (n,) of a line (2, n): places by length from 0 to 1.

    `first` (n,) is the spacing where the line bends no more than it did at first, when it had
    `turning` (n - 1,), see `fill_turning`: a line that only moves along keeps its nodes, so that a
    uniform flow along a bent line stays uniform.  `shortest` [m]: turning asks for no shorter
    segments.  The line is closed (its last node is the first or its periodic image), or ends on
    walls, given by their unit normals, at its own mirror image; (0, 0) is a free end.
    """
    count = line.shape[1]
    edges = count - 1
    arc = np.empty(count)
    wanted = np.empty(edges)
    fill_arc_lengths(line, arc)
    fill_turning(line, closed, wall_first, wall_last, wanted)
    for k in range(edges):
        wanted[k] = max(wanted[k] - turning[k], 0.0)
    total = 0.0
    for k in range(edges):
        wanted[k] = min(wanted[k], (arc[k + 1] - arc[k]) / shortest)
        total += wanted[k]
    even = max(1.0 - total / edges, LEAST_EVEN)
    granted = min(1.0, (1.0 - even) * edges / total) if total > 0.0 else 1.0
    # the number of segments up to node k, and the places where it is whole
    spacing[0] = 0.0
    spacing[edges] = 1.0
    done = 0.0
    following = 1
    place = 0
    before = 0.0
    for k in range(edges):
        reached = arc[k + 1] / arc[edges]
        while place < edges - 1 and first[place + 1] < reached:
            place += 1
        evenly = place + (reached - first[place]) / (first[place + 1] - first[place])
        done += wanted[k]
        after = even * evenly + granted * done
        while following < edges and following <= after:
            part = (following - before) / (after - before)
            spacing[following] = (arc[k] + part * (arc[k + 1] - arc[k])) / arc[edges]
            following += 1
        before = after
    for k in range(following, edges):  # round-off at the end
        spacing[k] = 1.0 - (edges - k) * (1.0 - spacing[following - 1]) / (edges - following + 1)
    even_out_spacing(arc, first, wanted, spacing)


@kernel
def even_out_spacing(arc, first, wanted, spacing):
    """Make a spacing (n,) symmetric where its line is so up to rounding; theory R9.

    arc [m], first spacing (n,), wanted (n - 1,) segments: of the line, see `fill_turning_spacing`.
    Spacings by turning magnify rounding step by step where a line has too few nodes for that.
    """
    edges = arc.shape[0] - 1
    most = SYMMETRIC_SEGMENT * arc[edges] / edges
    for k in range(edges // 2):
        other = edges - 1 - k
        length = arc[k + 1] - arc[k]
        if not abs(length - (arc[other + 1] - arc[other])) <= most:
            return
        if not abs(wanted[k] - wanted[other]) <= SYMMETRIC_TURNING:
            return
        if not abs(first[k] - (1.0 - first[edges - k])) <= SYMMETRIC_SEGMENT / edges:
            return
    departure = 0.0
    for k in range(edges // 2 + 1):
        departure = max(departure, abs(spacing[k] - (1.0 - spacing[edges - k])))
    if departure > ROUNDING_OF_SPACING:
        for k in range(edges // 2 + 1):
            spacing[k] = 0.5 * (spacing[k] + (1.0 - spacing[edges - k]))
            spacing[edges - k] = 1.0 - spacing[k]


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
    eliminated[0, first] = 0.0
    second[0, first] = 0.0
    if free_first:
        eliminated[1, first] = 0.0
        second[1, first] = 0.0
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
        h = ahead
        rise_x = ahead_x
        rise_y = ahead_y
    # Last node: n . M = 0 and t . (2 M + M_before) = 6 t . rise / h, in the first wall's frame.
    last_x, last_y = wall_last
    second[0, last] = 0.0
    second[1, last] = 0.0
    if last_x != 0.0 or last_y != 0.0:
        along_0 = normal_x * -last_y + normal_y * last_x
        along_1 = normal_y * last_y + normal_x * last_x
        slope = (-last_y * rise_x + last_x * rise_y) * (-6.0 / h)
        slope -= along_0 * second[0, last - 1] + along_1 * second[1, last - 1]
        stiff = along_0 * along_0 * (2.0 - eliminated[0, last - 1])
        stiff += along_1 * along_1 * (2.0 - eliminated[1, last - 1])
        second[0, last] = along_0 * slope / stiff
        second[1, last] = along_1 * slope / stiff
    for k in range(last - 1, first - 1, -1):
        for c in range(2):
            second[c, k] -= eliminated[c, k] * second[c, k + 1]
    for k in range(first, last + 1):
        part_0 = second[0, k]
        part_1 = second[1, k]
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
    fill_curvatures(line, arc, 0, last, FREE_END, FREE_END, eliminated, second)
    first_h = arc[1] - arc[0]
    end_h = arc[last] - arc[last - 1]
    slopes = np.empty(2)
    for c in range(2):
        slope = (line[c, 1] - line[c, 0]) / first_h - (line[c, last] - line[c, last - 1]) / end_h
        slopes[c] = 6.0 * slope - first_h * second[c, 1] - end_h * second[c, last - 1]
    # of the elimination; the solution for X = 1
    factor = eliminated[0]
    unit = eliminated[1]
    factor[0] = 0.0
    unit[0] = 1.0
    unit[last] = 1.0
    h = first_h
    for k in range(1, last):
        ahead = arc[k + 1] - arc[k]
        pivot = 1.0 / (2.0 * (h + ahead) - h * factor[k - 1])
        factor[k] = ahead * pivot
        unit[k] = -h * unit[k - 1] * pivot
        h = ahead
    for k in range(last - 1, 0, -1):
        unit[k] -= factor[k] * unit[k + 1]
    stiff = 2.0 * (first_h + end_h) + (first_h * unit[1] + end_h * unit[last - 1])
    for c in range(2):
        for k in range(last + 1):
            second[c, k] += slopes[c] / stiff * unit[k]


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
