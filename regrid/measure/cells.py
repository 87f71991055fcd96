"""Points and curves in the cells of a grid: which cell holds a point, how a curve cuts cells.

A point's cell is found by a walk: from the last one through the side that the point is farthest
beyond.  A walk may end at a bay of the outline; there the outline says whether the point is inside,
and all cells are looked through.  The place between four centres (means of a cell's nodes) solves
the bilinear map by Newton's method, so that what is interpolated with it is exact for linear fields
on any grid.  Half a cell along the sides lies beyond the outermost centres: there the same map goes
on, and parts are below 0 or above 1.  Note: the map of four centres may fold where a grid is
sheared to the utmost; the point then gets the place of its cell's own centre.

A curve is x = f(y), piecewise linear between points of ascending y and straight on beyond them
with the end values (a plane front is one point), or y = f(x) with `along="x"`.  Green's theorem
gives the area of a cell on the side of smaller x as the sum over its edges of the integral of
min(x, f(y)) dy, which is exact edge by edge: two cells take the same number from the edge they
share, so that the parts of a grid add up to the whole to round-off.  f must be single-valued; a
curve that turns back is refused.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import compiled_once, inlined, kernel
from shockgrid.regrid.sides import I_MIN, J_MAX, compute_area, find_node

# of the block: what `find_places` says of a point
OUTSIDE_BLOCK = 0
INSIDE_BLOCK = 1
BESIDE_BLOCK = 2
ON_EDGE = 1e-12  # of a cell: so far beyond a side counts as inside
MOST_ITERATIONS = 30
MOST_QUADS = 12  # that are tried around the cell
CONVERGED_DISTANCE = 1e-14  # of the distance between centres
ROUND_OFF_DISTANCE = (
    1e3 * CONVERGED_DISTANCE
)  # of the same, that an iteration which stops falling has left
FARTHEST_PART = 1e3  # of a cell: an iteration so far away does not come back
LARGEST_NUMBER = 1e300  # coordinates beyond are no place
UNIT_PARTS = 1e-12


@compiled_once
def _compute_excess(nodes, i, j, side, x, y):
    """Distance of a point beyond a side of a cell, over the side's length; > 0 is beyond.

    Sides are those of a grid whose cells go anticlockwise.
    """
    start = 1 if side == I_MIN or side == J_MAX else 0  # the cell is on the left of its edges
    di, dj = find_node(side, start, 0, 1, 1)
    ax, ay = nodes[0, i + di, j + dj], nodes[1, i + di, j + dj]
    di, dj = find_node(side, 1 - start, 0, 1, 1)
    dx, dy = nodes[0, i + di, j + dj] - ax, nodes[1, i + di, j + dj] - ay
    length2 = dx * dx + dy * dy
    if length2 == 0.0:  # a side of no length bounds nothing
        return -1.0
    return (dy * (x - ax) - dx * (y - ay)) / length2


@compiled_once
def _is_in_cell(nodes, i, j, sign, x, y):
    """Whether a point is in a cell or on its edge."""
    for side in range(4):
        if sign * _compute_excess(nodes, i, j, side, x, y) > ON_EDGE:
            return False
    return True


@compiled_once
def _crosses(xa, ya, xb, yb, x, y):
    """Whether the ray from a point towards larger x crosses the segment a-b."""
    if (ya > y) == (yb > y):
        return False
    return x < xa + (y - ya) / (yb - ya) * (xb - xa)


@compiled_once
def _is_in_outline(nodes, x, y):
    """Whether a point is inside the polygon of the block's sides."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    inside = False
    u, v = nodes[0], nodes[1]
    for i in range(ni):
        for j in (0, nj):
            if _crosses(u[i, j], v[i, j], u[i + 1, j], v[i + 1, j], x, y):
                inside = not inside
    for j in range(nj):
        for i in (0, ni):
            if _crosses(u[i, j], v[i, j], u[i, j + 1], v[i, j + 1], x, y):
                inside = not inside
    return inside


@compiled_once
def _walk(nodes, i, j, sign, x, y):
    """Cell in which a walk from cell (i, j) ends, and whether the point is in it."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for _ in range(4 * (ni + nj) + 16):
        # the side that the point is farthest beyond, but none of the block's
        largest_excess = 0.0
        next_side = -1
        is_beyond = False
        for side in range(4):
            excess = sign * _compute_excess(nodes, i, j, side, x, y)
            if excess > ON_EDGE:
                is_beyond = True
                ends = (i == 0, i == ni - 1, j == 0, j == nj - 1)
                if not ends[side] and excess > largest_excess:
                    largest_excess = excess
                    next_side = side
        # arrived, or stuck at the block's side
        if not is_beyond:
            return i, j, True
        if next_side < 0:
            return i, j, False
        # on to the next cell
        if next_side == 0:
            i -= 1
        elif next_side == 1:
            i += 1
        elif next_side == 2:
            j -= 1
        else:
            j += 1
    return i, j, False


@compiled_once
def _compute_centre(nodes, a, b):
    """Centre of cell (a, b); with one cell in a direction that of the same cell beside it."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    i, j = min(a, ni - 1), min(b, nj - 1)
    x = y = 0.0
    for c in range(2):
        value = 0.25 * (
            (nodes[c, i, j] + nodes[c, i + 1, j + 1]) + (nodes[c, i + 1, j] + nodes[c, i, j + 1])
        )
        if a >= ni:
            value += 0.5 * (
                (nodes[c, i + 1, j] + nodes[c, i + 1, j + 1])
                - (nodes[c, i, j] + nodes[c, i, j + 1])
            )
        if b >= nj:
            value += 0.5 * (
                (nodes[c, i, j + 1] + nodes[c, i + 1, j + 1])
                - (nodes[c, i, j] + nodes[c, i + 1, j])
            )
        if c == 0:
            x = value
        else:
            y = value
    return x, y


@compiled_once
def _solve_quad(nodes, a, b, x, y):
    """Parts s, t of the way from centre (a, b) to (a+1, b+1), and whether they are found."""
    # bilinear map of the four centres
    x00, y00 = _compute_centre(nodes, a, b)
    x10, y10 = _compute_centre(nodes, a + 1, b)
    x01, y01 = _compute_centre(nodes, a, b + 1)
    x11, y11 = _compute_centre(nodes, a + 1, b + 1)
    xs = x10 - x00
    ys = y10 - y00
    xt = x01 - x00
    yt = y01 - y00
    xst, yst = (x11 - x01) - xs, (y11 - y01) - ys
    scale = abs(xs) + abs(ys) + abs(xt) + abs(yt)
    s = t = 0.5
    least_residual = -1.0
    best_s = best_t = 0.5
    # Newton's method for its inverse; the best place is kept
    for _ in range(MOST_ITERATIONS):
        rx = x - x00 - s * xs - t * xt - s * t * xst
        ry = y - y00 - s * ys - t * yt - s * t * yst
        size = abs(rx) + abs(ry)
        if least_residual < 0.0 or size < least_residual:
            least_residual = size
            best_s = s
            best_t = t
        elif size <= ROUND_OFF_DISTANCE * scale:
            break  # round-off
        ds_x, ds_y = xs + t * xst, ys + t * yst
        dt_x, dt_y = xt + s * xst, yt + s * yst
        determinant = ds_x * dt_y - dt_x * ds_y
        if determinant == 0.0 or size == 0.0:
            break
        s += (rx * dt_y - dt_x * ry) / determinant
        t += (ds_x * ry - rx * ds_y) / determinant
        if not (abs(s) < FARTHEST_PART and abs(t) < FARTHEST_PART):
            break
    return best_s, best_t, least_residual <= ROUND_OFF_DISTANCE * scale


@compiled_once
def _find_quad(nodes, i, j, x, y):
    """Quad (a, b) of centres around a point near cell (i, j), parts s, t in it, and success."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    last_a = max(ni - 2, 0)
    last_b = max(nj - 2, 0)
    # the first quad near the cell
    a = min(i, last_a)
    b = min(j, last_b)
    s = t = 0.0
    # from quad to quad until s and t lie within one
    for _ in range(MOST_QUADS):
        s, t, converged = _solve_quad(nodes, a, b, x, y)
        if not converged:
            break
        next_a = a
        next_b = b
        if s < -UNIT_PARTS:
            next_a = max(a - 1, 0)
        elif s > 1.0 + UNIT_PARTS:
            next_a = min(a + 1, last_a)
        if t < -UNIT_PARTS:
            next_b = max(b - 1, 0)
        elif t > 1.0 + UNIT_PARTS:
            next_b = min(b + 1, last_b)
        if next_a == a and next_b == b:
            if abs(a + s - i) <= 2.0 and abs(b + t - j) <= 2.0:
                return a, b, s, t, True
            break
        a = next_a
        b = next_b
    a = min(i, last_a)
    b = min(j, last_b)
    return a, b, float(i - a), float(j - b), False


@kernel
def find_places(nodes, points, reach, cells, quads, parts, where):
    """Find each point in the grid of one block.

    nodes (2, ni+1, nj+1), points (2, n) [m]; `reach`: how far beyond the block's sides a point may
    lie, in cells; cells (2, n): where walks begin, and the cells found; quads (2, n): the lower of
    the four centres around each point, parts (2, n) of the way to the others (with one cell in a
    direction there is no other: the part means nothing); where (n,): OUTSIDE_BLOCK, INSIDE_BLOCK or
    BESIDE_BLOCK.  Of a point OUTSIDE_BLOCK nothing else is written.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    sign = 1.0 if compute_area(nodes) >= 0.0 else -1.0
    for k in range(points.shape[1]):
        x, y = points[0, k], points[1, k]
        where[k] = OUTSIDE_BLOCK
        if not (abs(x) < LARGEST_NUMBER and abs(y) < LARGEST_NUMBER):  # nor for nan
            continue
        # the cell with the point: by a walk, else one after another
        i, j = min(max(cells[0, k], 0), ni - 1), min(max(cells[1, k], 0), nj - 1)
        i, j, is_inside = _walk(nodes, i, j, sign, x, y)
        if not is_inside and _is_in_outline(nodes, x, y):
            for cell in range(ni * nj):
                if _is_in_cell(nodes, cell // nj, cell % nj, sign, x, y):
                    i = cell // nj
                    j = cell % nj
                    is_inside = True
                    break
        if not is_inside and reach <= 0.0:
            continue
        # the quad of centres around it
        a, b, s, t, has_place = _find_quad(nodes, i, j, x, y)
        # beside the block, within reach?
        if not is_inside:
            low = -0.5 - reach
            high_i = ni - 0.5 + reach
            high_j = nj - 0.5 + reach
            if not (has_place and low <= a + s <= high_i and low <= b + t <= high_j):
                continue
        where[k] = INSIDE_BLOCK if is_inside else BESIDE_BLOCK
        cells[0, k] = i
        cells[1, k] = j
        quads[0, k] = a
        quads[1, k] = b
        parts[0, k] = s
        parts[1, k] = t


@compiled_once
def _count_below(ascending, value, or_equal):
    """How many of the ascending numbers are below a value, or equal to it.

    numpy's own search would make cached code load half of numba with it.
    """
    low, high = 0, ascending.size
    while low < high:
        middle = (low + high) // 2
        if ascending[middle] < value or (or_equal and ascending[middle] == value):
            low = middle + 1
        else:
            high = middle
    return low


@inlined
def _integrate_smaller(x0, x1, f0, f1, dy):
    """Integral over a length dy of the smaller of two linear functions."""
    d0 = x0 - f0
    d1 = x1 - f1
    crossed = d0 * d1 < 0.0
    share = d0 / (d0 - d1) if crossed else 0.5
    over = 0.5 * max(d0, 0.0) * share + 0.5 * max(d1, 0.0) * (1.0 - share)
    whole = 0.5 * (max(d0, 0.0) + max(d1, 0.0))
    return dy * (0.5 * (x0 + x1) - (over if crossed else whole))


@kernel
def _integrate_edge(xa, ya, xb, yb, curve_x, curve_y):
    """Integral of min(x, f(y)) dy along the straight edge from (xa, ya) to (xb, yb)."""
    # upwards
    sign = 1.0
    if yb < ya:
        xa, ya, xb, yb = xb, yb, xa, ya
        sign = -1.0
    length = yb - ya
    if length == 0.0:
        return 0.0
    slope = (xb - xa) / length
    count = curve_y.size
    piece = _count_below(curve_y, ya, True)
    total = 0.0
    y0 = ya
    x0 = xa
    # piece by piece of the curve, which is constant beyond its ends
    while y0 < yb:
        y1 = yb
        if piece < count and curve_y[piece] < yb:
            y1 = curve_y[piece]
        x1 = xb if y1 == yb else xa + slope * (y1 - ya)
        if piece == 0:
            f0 = f1 = curve_x[0]
        elif piece == count:
            f0 = f1 = curve_x[count - 1]
        else:
            run = curve_y[piece] - curve_y[piece - 1]
            rise = curve_x[piece] - curve_x[piece - 1]
            f0 = curve_x[piece - 1] + rise * ((y0 - curve_y[piece - 1]) / run)
            f1 = curve_x[piece - 1] + rise * ((y1 - curve_y[piece - 1]) / run)
        total += _integrate_smaller(x0, x1, f0, f1, y1 - y0)
        y0 = y1
        x0 = x1
        piece += 1
    return sign * total


@kernel
def _fill_side_areas(x, y, curve_x, curve_y, below, whole):
    """Area of each cell on the side of smaller x, and its whole area (both signed alike)."""
    ni, nj = whole.shape
    for i in range(ni):
        for j in range(nj):
            ring_x = (x[i, j], x[i + 1, j], x[i + 1, j + 1], x[i, j + 1])
            ring_y = (y[i, j], y[i + 1, j], y[i + 1, j + 1], y[i, j + 1])
            # integrals around the cell
            cell_area = 0.0
            side_area = 0.0
            for corner in range(4):
                next_corner = (corner + 1) % 4
                ax, ay = ring_x[corner], ring_y[corner]
                bx, by = ring_x[next_corner], ring_y[next_corner]
                cell_area += 0.5 * (ax + bx) * (by - ay)
                side_area += _integrate_edge(ax, ay, bx, by, curve_x, curve_y)
            # a cell wholly on one side: exactly 0 or all of it
            least_x = min(ring_x)
            most_x = max(ring_x)
            least_y = min(ring_y)
            most_y = max(ring_y)
            first_point = max(0, _count_below(curve_y, least_y, True) - 1)
            last_point = min(curve_y.size - 1, _count_below(curve_y, most_y, False))
            least_curve = curve_x[first_point]
            most_curve = curve_x[first_point]
            for k in range(first_point, last_point + 1):
                least_curve = min(least_curve, curve_x[k])
                most_curve = max(most_curve, curve_x[k])
            if most_x <= least_curve:
                side_area = cell_area
            elif least_x >= most_curve:
                side_area = 0.0
            below[i, j] = side_area
            whole[i, j] = cell_area


def compute_area_fractions(nodes: np.ndarray, curve, along: str = "y") -> np.ndarray:
    """Fraction of each cell's area at smaller x than the curve x = f(y).

    nodes: (2, ni+1, nj+1), valid grid, either orientation.  curve: (2, n) points (x, y) with
    ascending y, or a number for the plane x = that.  With `along="x"` the curve is y = f(x), its
    points (x, y) have ascending x, and the fraction is that at smaller y.  Returns (ni, nj) in
    [0, 1]: exactly 0 or 1 in cells that the curve does not come near.  Raises BadInput for points
    that do not ascend.
    """
    if along not in ("x", "y"):
        raise BadInput(f"area fractions: along is {along!r}; it must be 'x' or 'y'")
    x, y = np.ascontiguousarray(nodes, dtype=float)
    if np.ndim(curve) == 0:
        points = np.full((2, 1), float(curve))
    else:
        points = np.array(curve, dtype=float)
    if along == "x":
        x, y = y, x
        points = points[::-1]
    curve_x, curve_y = np.ascontiguousarray(points[0]), np.ascontiguousarray(points[1])
    if not np.all(np.isfinite(points)) or np.any(np.diff(curve_y) <= 0.0):
        raise BadInput(
            f"area fractions: the curve's points must be finite and ascend in {along}; "
            "a curve that turns back is not a function"
        )
    below, whole = np.empty((2, x.shape[0] - 1, x.shape[1] - 1))
    _fill_side_areas(x, y, curve_x, curve_y, below, whole)
    return np.clip(below / whole, 0.0, 1.0)
