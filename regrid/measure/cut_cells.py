"""How much of each cell lies on either side of a curve: exact areas, for filling cut cells.

The curve is x = f(y), piecewise linear between points of ascending y and straight on beyond them
with the end values (a plane front is one point), or y = f(x) with `along="x"`.  Green's theorem
gives the area of a cell on the side of smaller x as the sum over its edges of the integral of
min(x, f(y)) dy, which is exact edge by edge: two cells take the same number from the edge they
share, so that the parts of a grid add up to the whole to round-off.  The trap: f must be
single-valued; a curve that turns back is refused.
"""

from __future__ import annotations

import numpy as np

from regrid.errors import BadInput
from regrid.jit import compiled_once, inlined, kernel


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
    y0, x0 = ya, xa
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
        y0, x0 = y1, x1
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
            area = 0.0
            side = 0.0
            for a in range(4):
                b = (a + 1) % 4
                area += 0.5 * (ring_x[a] + ring_x[b]) * (ring_y[b] - ring_y[a])
                side += _integrate_edge(
                    ring_x[a], ring_y[a], ring_x[b], ring_y[b], curve_x, curve_y
                )
            low = min(ring_x)
            high = max(ring_x)
            bottom = min(ring_y)
            top = max(ring_y)
            first = max(0, _count_below(curve_y, bottom, True) - 1)
            last = min(curve_y.size - 1, _count_below(curve_y, top, False))
            least = curve_x[first]
            most = curve_x[first]
            for k in range(first, last + 1):
                least = min(least, curve_x[k])
                most = max(most, curve_x[k])
            if high <= least:
                side = area
            elif low >= most:
                side = 0.0
            below[i, j] = side
            whole[i, j] = area


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
