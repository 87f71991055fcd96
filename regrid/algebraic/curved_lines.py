"""Lines that take the shape of the sides beside them: means of two lines, turned and scaled.

A line of a family is the mean of the two outer lines of that family, each turned and scaled so that
it ends where the line ends (theory R4.15).  Between straight sides this is the straight line.
The trap: a side that closes on itself has no chord to be turned with.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import kernel

MOST_FOLDED = 0.01  # area turned over, over the whole, at which a grid of curves is of no use


@kernel
def fill_shape(x, y, shape):
    """A line (n,) with its chord as the unit: parts along and across it into `shape` (2, n)."""
    last = x.shape[0] - 1
    chord_x, chord_y = x[last] - x[0], y[last] - y[0]
    scale = 1.0 / (chord_x * chord_x + chord_y * chord_y)
    for k in range(last + 1):
        step_x, step_y = x[k] - x[0], y[k] - y[0]
        shape[0, k] = scale * (step_x * chord_x + step_y * chord_y)
        shape[1, k] = scale * (chord_x * step_y - chord_y * step_x)


@kernel
def fill_curves(sides, share_i, share_j, curve):
    """Fill `curve` (2, ni+1, nj+1) [m] with curved lines between the sides of `sides`, same shape.

    `share_i` times the lines j = const and `share_j` times the lines i = const, where these are not
    0; the sides j_min, j_max or i_min, i_max that they take their shapes from have to be open.
    """
    ni, nj = curve.shape[1] - 1, curve.shape[2] - 1
    x, y = sides
    curve[:] = 0.0
    if share_i > 0.0:
        line, low, high = np.empty((2, ni + 1)), np.empty((2, ni + 1)), np.empty((2, ni + 1))
        for j, shape in ((0, low), (nj, high)):
            for i in range(ni + 1):
                line[0, i], line[1, i] = x[i, j], y[i, j]
            fill_shape(line[0], line[1], shape)
        for i in range(ni + 1):
            for j in range(nj + 1):
                v = j / nj
                along = (1.0 - v) * low[0, i] + v * high[0, i]
                across = (1.0 - v) * low[1, i] + v * high[1, i]
                way_x, way_y = x[ni, j] - x[0, j], y[ni, j] - y[0, j]
                curve[0, i, j] += share_i * (x[0, j] + (along * way_x - across * way_y))
                curve[1, i, j] += share_i * (y[0, j] + (along * way_y + across * way_x))
    if share_j > 0.0:
        low, high = np.empty((2, nj + 1)), np.empty((2, nj + 1))
        fill_shape(x[0], y[0], low)
        fill_shape(x[ni], y[ni], high)
        for i in range(ni + 1):
            u = i / ni
            way_x, way_y = x[i, nj] - x[i, 0], y[i, nj] - y[i, 0]
            for j in range(nj + 1):
                along = (1.0 - u) * low[0, j] + u * high[0, j]
                across = (1.0 - u) * low[1, j] + u * high[1, j]
                curve[0, i, j] += share_j * (x[i, 0] + (along * way_x - across * way_y))
                curve[1, i, j] += share_j * (y[i, 0] + (along * way_y + across * way_x))


@kernel
def fade_curves(curve):
    """Fade a grid of curves that folds, in place; returns the part of it that is left, 1 to 0.

    All of a convex one; nothing where the area of the corner triangles that are turned over is
    MOST_FOLDED of the whole or more, or where it is no number.  Theory R4.16.
    """
    x, y = curve
    right, turned = 0.0, 0.0
    for i in range(x.shape[0] - 1):
        for j in range(x.shape[1] - 1):
            low_x, low_y = x[i + 1, j] - x[i, j], y[i + 1, j] - y[i, j]
            high_x, high_y = x[i + 1, j + 1] - x[i, j + 1], y[i + 1, j + 1] - y[i, j + 1]
            near_x, near_y = x[i, j + 1] - x[i, j], y[i, j + 1] - y[i, j]
            far_x, far_y = x[i + 1, j + 1] - x[i + 1, j], y[i + 1, j + 1] - y[i + 1, j]
            for area in (
                low_x * near_y - low_y * near_x,
                high_x * near_y - high_y * near_x,
                high_x * far_y - high_y * far_x,
                low_x * far_y - low_y * far_x,
            ):
                if area > 0.0:
                    right += area
                else:
                    turned -= area
    whole = abs(right - turned)
    folded = min(right, turned)
    left = 1.0 - folded / (MOST_FOLDED * whole) if folded < MOST_FOLDED * whole else 0.0
    if left < 1.0:
        for k in range(2):
            for i in range(x.shape[0]):
                for j in range(x.shape[1]):
                    curve[k, i, j] *= left
    return left


@kernel(allocates=False)
def take_curve(curve, i, low, count, to_x, to_y, Z):
    """The edges along i of `curve` that lead to its row i, into `Z` from `to_x`, `to_y` on [m].

    Of `count` columns from `low` on.
    """
    x0, y0 = curve[0, i - 1, low : low + count], curve[1, i - 1, low : low + count]
    x1, y1 = curve[0, i, low : low + count], curve[1, i, low : low + count]
    for col in range(count):
        Z[to_x + col] = x1[col] - x0[col]
        Z[to_y + col] = y1[col] - y0[col]


@kernel(allocates=False)
def take_curve_sides(curve, i, low, cells, weight, from_x, from_y, Z):
    """Take the edges along j of row i of `curve`, times those weights, from two rows of `Z`.

    The weights lie in `Z` from `weight` on, the rows from `from_x`, `from_y` on.
    """
    x, y = curve[0, i, low : low + cells + 1], curve[1, i, low : low + cells + 1]
    for col in range(cells):
        q = Z[weight + col]
        Z[from_x + col] -= q * (x[col + 1] - x[col])
        Z[from_y + col] -= q * (y[col + 1] - y[col])
