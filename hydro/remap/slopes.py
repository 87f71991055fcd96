"""Limited linear fields in the cells of a grid: exact for linear data, without new extremes.

Gradients are least squares over the cells around; the limiter is that of the corners [Kuzmin2010]:
at each corner a field stays between the least and the greatest mean of the cells that meet there.
The trap: on a side only the inner cells meet, and a linear field would be flattened; there cells
are thought beyond the side in which the last two means go on, where they do so evenly.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import kernel

STEEPEST = 3.0  # times the difference before it: how far means go on beyond a side
MEAN, SLOPE_X, SLOPE_Y = range(3)  # last index of linear fields (ni, nj, quantities, 3)


def continue_beyond_sides(means: np.ndarray) -> np.ndarray:
    """Means (n, ni + 2, nj + 2) with a layer of cells around, theory F12.3.

    There the last two means of (n, ni, nj) go on evenly, but by no more than STEEPEST times the
    difference before that, and not at all after an extreme: a jump that ends at a side stays one.
    """
    for axis in (1, 2):
        first = _continue_line(np.moveaxis(means, axis, 0))
        last = _continue_line(np.moveaxis(means, axis, 0)[::-1])
        means = np.concatenate(
            [np.expand_dims(first, axis), means, np.expand_dims(last, axis)], axis=axis
        )
    return means


def _continue_line(means: np.ndarray) -> np.ndarray:
    """What comes before means [0], [1], ..., from the first three, or two where there are two."""
    rise = means[0] - means[1]
    before = means[1] - means[2] if len(means) > 2 else rise
    least = np.minimum(np.abs(rise), STEEPEST * np.abs(before))
    return means[0] + np.where(rise * before > 0.0, np.sign(rise) * least, 0.0)


@kernel
def fill_bounds(means, least, greatest):
    """Least and greatest (n, ni+1, nj+1) of the four `means` (n, ni+2, nj+2) around each node."""
    for q in range(least.shape[0]):
        for i in range(least.shape[1]):
            for j in range(least.shape[2]):
                a, b = means[q, i, j], means[q, i + 1, j]
                c, d = means[q, i + 1, j + 1], means[q, i, j + 1]
                least[q, i, j], greatest[q, i, j] = min(a, b, c, d), max(a, b, c, d)


@kernel
def fill_linear_fields(means, nodes, centres, least, greatest, fields):
    """Means and limited slopes, theory F12.3, into `fields` (ni, nj, n, 3).

    means (n, ni, nj), centres (2, ni, nj) of volume; least, greatest: of `fill_bounds`.
    """
    count, ni, nj = means.shape
    for i in range(ni):
        for j in range(nj):
            x, y = centres[0, i, j], centres[1, i, j]
            xx, xy, yy = 0.0, 0.0, 0.0
            for q in range(count):
                fields[i, j, q, SLOPE_X], fields[i, j, q, SLOPE_Y] = 0.0, 0.0
            for k in range(max(i - 1, 0), min(i + 2, ni)):
                for m in range(max(j - 1, 0), min(j + 2, nj)):
                    if k == i and m == j:
                        continue
                    way_x, way_y = centres[0, k, m] - x, centres[1, k, m] - y
                    weight = 1.0 / (way_x * way_x + way_y * way_y)
                    xx += weight * way_x * way_x
                    xy += weight * way_x * way_y
                    yy += weight * way_y * way_y
                    for q in range(count):
                        rise = weight * (means[q, k, m] - means[q, i, j])
                        fields[i, j, q, SLOPE_X] += rise * way_x
                        fields[i, j, q, SLOPE_Y] += rise * way_y
            inverse = 1.0 / (xx * yy - xy * xy)
            for q in range(count):
                mean = means[q, i, j]
                right_x, right_y = fields[i, j, q, SLOPE_X], fields[i, j, q, SLOPE_Y]
                slope_x = (yy * right_x - xy * right_y) * inverse
                slope_y = (xx * right_y - xy * right_x) * inverse
                limit = 1.0
                for a in range(2):
                    for b in range(2):
                        k, m = i + a, j + b
                        change = slope_x * (nodes[0, k, m] - x) + slope_y * (nodes[1, k, m] - y)
                        if change > 0.0:
                            limit = min(limit, (greatest[q, k, m] - mean) / change)
                        elif change < 0.0:
                            limit = min(limit, (least[q, k, m] - mean) / change)
                fields[i, j, q, MEAN] = mean
                fields[i, j, q, SLOPE_X] = limit * slope_x
                fields[i, j, q, SLOPE_Y] = limit * slope_y


def make_linear_fields(means: np.ndarray, nodes: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Limited linear fields (ni, nj, n, 3): mean and slopes along x and y of each quantity.

    means (n, ni, nj) of cells of `nodes` (2, ni+1, nj+1) with the centres of volume (2, ni, nj).
    """
    means = np.ascontiguousarray(means, dtype=np.float64)
    count, ni, nj = means.shape
    least, greatest = np.empty((2, count, ni + 1, nj + 1))
    fields = np.empty((ni, nj, count, 3))
    fill_bounds(continue_beyond_sides(means), least, greatest)
    fill_linear_fields(means, np.ascontiguousarray(nodes), centres, least, greatest, fields)
    return fields
