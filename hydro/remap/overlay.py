"""One grid laid over another: polygons, limited linear fields, and what each new cell takes.

Each new cell is cut by the old cells around the place where the last one was found, and from there
by their neighbours for as long as they overlap it; so the cost is that of the overlaps alone.
Note: a new cell at a side may reach beyond the old grid, and one that lies outside whole has
no overlap at all; how much of each cell is covered says both.

A convex polygon lies in the first `n` entries of two rows, anticlockwise; cut by the four edges of
a convex cell one after the other it becomes the overlap of both [SutherlandHodgman1974].  Moments
are exact: volume per depth or per radian, and first moments about a given point.  A corner on the
line itself is no crossing, or identical grids would get slivers of round-off.

Linear fields are exact for linear data and make no new extremes.  Gradients are least squares over
the cells around; the limiter is that of the corners [Kuzmin2010]: at each corner a field stays
between the least and the greatest mean of the cells that meet there.  On a side only the inner
cells meet, and a linear field would be flattened; there cells are thought beyond the side in which
the last two means go on, where they do so evenly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.regrid.jit import compiled_once, kernel

MOST_CORNERS = 16  # of a quadrilateral cut by four lines, with room for corners that coincide
STEEPEST_CONTINUATION = 3.0  # times the difference before it: how far means go on beyond a side
MEAN, SLOPE_X, SLOPE_Y = range(3)  # last index of linear fields (ni, nj, quantities, 3)
LEAST_GAP = 1e-9  # part of a cell that may stay uncovered before the old grid is searched for it


@compiled_once
def cut_polygon(x, y, n, out_x, out_y, line):
    """The part of a polygon to the left of a line, into `out`; returns the number of corners and
    whether any was cut off.

    line: a point on it and its direction.
    """
    from_x, from_y, direction_x, direction_y = line
    count = 0
    outside = False
    before_x, before_y = x[n - 1], y[n - 1]
    height_before = direction_x * (before_y - from_y) - direction_y * (before_x - from_x)
    for k in range(n):
        here_x, here_y = x[k], y[k]
        height = direction_x * (here_y - from_y) - direction_y * (here_x - from_x)
        if (height_before < 0.0 and height > 0.0) or (height_before > 0.0 and height < 0.0):
            fraction = height_before / (height_before - height)
            out_x[count] = before_x + fraction * (here_x - before_x)
            out_y[count] = before_y + fraction * (here_y - before_y)
            count += 1
        if height >= 0.0:
            out_x[count], out_y[count] = here_x, here_y
            count += 1
        else:
            outside = True
        before_x = here_x
        before_y = here_y
        height_before = height
    return count, outside


@compiled_once
def measure_polygon(x, y, n, curved, about_x, about_y):
    """Volume of a polygon and its first moments about a point, per depth or, `curved`, per radian.

    The sums run over triangles with the polygon's first corner: theory F12.2.
    """
    volume = 0.0
    moment_x = 0.0
    moment_y = 0.0
    first_x, first_y = x[0], y[0]
    for k in range(1, n - 1):
        ax, ay = x[k] - first_x, y[k] - first_y
        bx, by = x[k + 1] - first_x, y[k + 1] - first_y
        area = 0.5 * (ax * by - ay * bx)
        if curved:
            triangle_volume = area * (first_y + (ay + by) / 3.0)  # the mean radius
            volume += triangle_volume
            radii = 3.0 * first_y + ay + by
            a_y = first_y + ay
            b_y = first_y + by
            twelfth = area / 12.0
            moment_x += twelfth * ((ax + bx) * radii + ax * a_y + bx * b_y)
            moment_y += twelfth * ((ay + by) * radii + ay * a_y + by * b_y)
        else:
            volume += area
            moment_x += area * (ax + bx) / 3.0
            moment_y += area * (ay + by) / 3.0
    moment_x += (first_x - about_x) * volume
    moment_y += (first_y - about_y) * volume
    return volume, moment_x, moment_y


@compiled_once
def read_corners(nodes, i, j, x, y):
    """The corners of the cell i, j into the rows x, y (4,), anticlockwise from its own node."""
    x[0], y[0] = nodes[0, i, j], nodes[1, i, j]
    x[1], y[1] = nodes[0, i + 1, j], nodes[1, i + 1, j]
    x[2], y[2] = nodes[0, i + 1, j + 1], nodes[1, i + 1, j + 1]
    x[3], y[3] = nodes[0, i, j + 1], nodes[1, i, j + 1]


@kernel
def fill_cell_moments(nodes, curved, volumes, centres):
    """Volumes (ni, nj) of the cells of `nodes` (2, ni+1, nj+1) and their centres (2, ni, nj)."""
    x, y = np.empty(4), np.empty(4)
    for i in range(volumes.shape[0]):
        for j in range(volumes.shape[1]):
            read_corners(nodes, i, j, x, y)
            volume, moment_x, moment_y = measure_polygon(x, y, 4, curved, x[0], y[0])
            volumes[i, j] = volume
            centres[0, i, j] = x[0] + moment_x / volume
            centres[1, i, j] = y[0] + moment_y / volume


def compute_cell_moments(nodes: np.ndarray, curved: bool) -> tuple[np.ndarray, np.ndarray]:
    """Volumes (ni, nj) [m², or m³ per radian] and centres of volume (2, ni, nj) [m] of cells.

    nodes (2, ni+1, nj+1) [m]; curved: y is the distance from an axis.
    """
    ni, nj = (size - 1 for size in nodes.shape[1:])
    volumes = np.empty((ni, nj))
    centres = np.empty((2, ni, nj))
    fill_cell_moments(np.ascontiguousarray(nodes, dtype=np.float64), curved, volumes, centres)
    return volumes, centres


def continue_beyond_sides(means: np.ndarray) -> np.ndarray:
    """Means (n, ni + 2, nj + 2) with a layer of cells around, theory F12.3.

    There the last two means of (n, ni, nj) go on evenly, but by no more than STEEPEST_CONTINUATION
    times the difference before that, and not at all after an extreme: a jump that ends at a side
    stays one.
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
    step = np.minimum(np.abs(rise), STEEPEST_CONTINUATION * np.abs(before))
    return means[0] + np.where(rise * before > 0.0, np.sign(rise) * step, 0.0)


@kernel
def fill_linear_fields(means, nodes, centres, least, greatest, fields):
    """Means and limited slopes, theory F12.3, into `fields` (ni, nj, n, 3).

    means (n, ni, nj), centres (2, ni, nj) of volume; least, greatest (n, ni+1, nj+1) of
    the means of the four cells around each node, beyond the sides too.
    """
    count, ni, nj = means.shape
    for i in range(ni):
        for j in range(nj):
            x, y = centres[0, i, j], centres[1, i, j]
            # least squares over the cells around: normal equations of the slopes
            xx = 0.0
            xy = 0.0
            yy = 0.0
            for q in range(count):
                fields[i, j, q, SLOPE_X] = 0.0
                fields[i, j, q, SLOPE_Y] = 0.0
            for other_i in range(max(i - 1, 0), min(i + 2, ni)):
                for other_j in range(max(j - 1, 0), min(j + 2, nj)):
                    if other_i == i and other_j == j:
                        continue
                    offset_x, offset_y = (
                        centres[0, other_i, other_j] - x,
                        centres[1, other_i, other_j] - y,
                    )
                    weight = 1.0 / (offset_x * offset_x + offset_y * offset_y)
                    xx += weight * offset_x * offset_x
                    xy += weight * offset_x * offset_y
                    yy += weight * offset_y * offset_y
                    for q in range(count):
                        rise = weight * (means[q, other_i, other_j] - means[q, i, j])
                        fields[i, j, q, SLOPE_X] += rise * offset_x
                        fields[i, j, q, SLOPE_Y] += rise * offset_y
            # solved; then lessened until no corner is beyond the means around it (F12.3)
            inverse = 1.0 / (xx * yy - xy * xy)
            for q in range(count):
                mean = means[q, i, j]
                right_x, right_y = fields[i, j, q, SLOPE_X], fields[i, j, q, SLOPE_Y]
                slope_x = (yy * right_x - xy * right_y) * inverse
                slope_y = (xx * right_y - xy * right_x) * inverse
                limit = 1.0
                for a in range(2):
                    for b in range(2):
                        other_i = i + a
                        other_j = j + b
                        change = slope_x * (nodes[0, other_i, other_j] - x) + slope_y * (
                            nodes[1, other_i, other_j] - y
                        )
                        if change > 0.0:
                            limit = min(limit, (greatest[q, other_i, other_j] - mean) / change)
                        elif change < 0.0:
                            limit = min(limit, (least[q, other_i, other_j] - mean) / change)
                fields[i, j, q, MEAN] = mean
                fields[i, j, q, SLOPE_X] = limit * slope_x
                fields[i, j, q, SLOPE_Y] = limit * slope_y


def make_linear_fields(means: np.ndarray, nodes: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Limited linear fields (ni, nj, n, 3): mean and slopes along x and y of each quantity.

    means (n, ni, nj) of cells of `nodes` (2, ni+1, nj+1) with the centres of volume (2, ni, nj).
    """
    means = np.ascontiguousarray(means, dtype=np.float64)
    count, ni, nj = means.shape
    wide = continue_beyond_sides(means)
    around = wide[:, :-1, :-1], wide[:, 1:, :-1], wide[:, 1:, 1:], wide[:, :-1, 1:]
    least = np.minimum.reduce(around)
    greatest = np.maximum.reduce(around)
    fields = np.empty((ni, nj, count, 3))
    fill_linear_fields(means, np.ascontiguousarray(nodes), centres, least, greatest, fields)
    return fields


@compiled_once
def cut_by_cell(work, nodes, i, j, x, y):
    """Cut the quadrilateral in (x, y) by the cell i, j: corners, and which edges it crosses.

    The result lies in the rows 0 and 1 of `work` (4, MOST_CORNERS).  Edges count from j_min on,
    anticlockwise.
    """
    n = 4
    for k in range(4):
        work[0, k] = x[k]
        work[1, k] = y[k]
    ax, ay = nodes[0, i, j], nodes[1, i, j]
    bx, by = nodes[0, i + 1, j], nodes[1, i + 1, j]
    cx, cy = nodes[0, i + 1, j + 1], nodes[1, i + 1, j + 1]
    dx, dy = nodes[0, i, j + 1], nodes[1, i, j + 1]
    n, below = cut_polygon(work[0], work[1], n, work[2], work[3], (ax, ay, bx - ax, by - ay))
    if n < 3:
        return 0, below, False, False, False
    n, right = cut_polygon(work[2], work[3], n, work[0], work[1], (bx, by, cx - bx, cy - by))
    if n < 3:
        return 0, below, right, False, False
    n, above = cut_polygon(work[0], work[1], n, work[2], work[3], (cx, cy, dx - cx, dy - cy))
    if n < 3:
        return 0, below, right, above, False
    n, left = cut_polygon(work[2], work[3], n, work[0], work[1], (dx, dy, ax - dx, ay - dy))
    return n, below, right, above, left


@compiled_once
def locate_point(nodes, i, j, x, y, most_moves):
    """Walk from the cell i, j to the one that holds the point, or to the side that is in the way.

    Each move goes through an edge that the point lies beyond, at most `most_moves` times.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for _ in range(most_moves):
        ax, ay = nodes[0, i, j], nodes[1, i, j]
        bx, by = nodes[0, i + 1, j], nodes[1, i + 1, j]
        cx, cy = nodes[0, i + 1, j + 1], nodes[1, i + 1, j + 1]
        dx, dy = nodes[0, i, j + 1], nodes[1, i, j + 1]
        if j > 0 and (bx - ax) * (y - ay) < (by - ay) * (x - ax):
            j -= 1
        elif i < ni - 1 and (cx - bx) * (y - by) < (cy - by) * (x - bx):
            i += 1
        elif j < nj - 1 and (dx - cx) * (y - cy) < (dy - cy) * (x - cx):
            j += 1
        elif i > 0 and (ax - dx) * (y - dy) < (ay - dy) * (x - dx):
            i -= 1
        else:
            return i, j
    return i, j


@compiled_once
def take_overlaps(waiting, cell, old, curved, mark, scratch, out):
    """Cut a new cell by the cells in the queue and by their neighbours that it reaches.

    cell: its corners x, y (4,) and centre `centre` (2,); old: nodes, centres and fields of the old
    grid; adds to `out`: taken (n,), covered (3,) and used (ni, nj, 3).
    """
    x, y, centre = cell
    nodes, centres, fields = old
    marks, queue, work = scratch
    taken, covered, used = out
    ni, nj = centres.shape[1], centres.shape[2]
    while waiting > 0:
        waiting -= 1
        i, j = queue[waiting] // nj, queue[waiting] % nj
        # what the old cell and the new one have in common
        n, below, right, above, left = cut_by_cell(work, nodes, i, j, x, y)
        if n < 3:
            continue
        about_x, about_y = centres[0, i, j], centres[1, i, j]
        volume, moment_x, moment_y = measure_polygon(work[0], work[1], n, curved, about_x, about_y)
        if not volume > 0.0:
            continue
        # its content by the old cell's linear field (theory F12.1)
        for q in range(taken.shape[0]):
            taken[q] += fields[i, j, q, MEAN] * volume + (
                fields[i, j, q, SLOPE_X] * moment_x + fields[i, j, q, SLOPE_Y] * moment_y
            )
        # its volume and first moments, of the old cell and of the new one
        used[i, j, 0] += volume
        used[i, j, 1] += moment_x
        used[i, j, 2] += moment_y
        covered[0] += volume
        covered[1] += moment_x + (about_x - centre[0]) * volume
        covered[2] += moment_y + (about_y - centre[1]) * volume
        # the new cell goes on into the neighbours across the edges that it crosses
        if below and j > 0 and marks[i, j - 1] != mark:
            marks[i, j - 1] = mark
            queue[waiting] = i * nj + j - 1
            waiting += 1
        if right and i < ni - 1 and marks[i + 1, j] != mark:
            marks[i + 1, j] = mark
            queue[waiting] = (i + 1) * nj + j
            waiting += 1
        if above and j < nj - 1 and marks[i, j + 1] != mark:
            marks[i, j + 1] = mark
            queue[waiting] = i * nj + j + 1
            waiting += 1
        if left and i > 0 and marks[i - 1, j] != mark:
            marks[i - 1, j] = mark
            queue[waiting] = (i - 1) * nj + j
            waiting += 1


@compiled_once
def queue_missed(nodes, x, y, all_cells, mark, marks, queue):
    """Queue cells of the sides, or `all_cells` cell, whose box meets that of a new cell."""
    ni, nj = marks.shape
    low_x, high_x = min(x[0], x[1], x[2], x[3]), max(x[0], x[1], x[2], x[3])
    low_y, high_y = min(y[0], y[1], y[2], y[3]), max(y[0], y[1], y[2], y[3])
    waiting = 0
    for i in range(ni):
        step = 1 if all_cells or i == 0 or i == ni - 1 or nj == 1 else nj - 1
        for j in range(0, nj, step):
            if marks[i, j] == mark:
                continue
            ax = nodes[0, i, j]
            bx = nodes[0, i + 1, j]
            cx = nodes[0, i + 1, j + 1]
            dx = nodes[0, i, j + 1]
            if min(ax, bx, cx, dx) > high_x or max(ax, bx, cx, dx) < low_x:
                continue
            ay = nodes[1, i, j]
            by = nodes[1, i + 1, j]
            cy = nodes[1, i + 1, j + 1]
            dy = nodes[1, i, j + 1]
            if min(ay, by, cy, dy) > high_y or max(ay, by, cy, dy) < low_y:
                continue
            marks[i, j] = mark
            queue[waiting] = i * nj + j
            waiting += 1
    return waiting


@kernel
def fill_overlaps(old, new, curved, least_gap, scratch, out):
    """What all new cells take from the linear fields (ni, nj, n, 3) of the old ones.

    old: nodes, centres, fields; new: nodes, volumes, centres.  Fills `out`: taken (mi, mj, n), and
    covered (mi, mj, 3), used (ni, nj, 3): volume and first moments about the cell's own centre of
    what is covered of each new cell, and used of each old one.  scratch: marks (ni, nj), queue
    (ni * nj,), work (4, MOST_CORNERS).
    """
    nodes, centres, _ = old
    new_nodes, new_volumes, new_centres = new
    marks, queue, _ = scratch
    taken, covered, used = out
    ni, nj = centres.shape[1], centres.shape[2]
    most_moves = 4 * (ni + nj)
    x = np.empty(4)
    y = np.empty(4)
    centre = np.empty(2)
    marks[:, :] = -1
    taken[:, :, :] = 0.0
    covered[:, :, :] = 0.0
    used[:, :, :] = 0.0
    # each new cell: start in the old cell at its centre, near that of the cell before
    row_i, row_j = 0, 0
    for i in range(taken.shape[0]):
        at_i, at_j = row_i, row_j
        for j in range(taken.shape[1]):
            mark = i * taken.shape[1] + j
            read_corners(new_nodes, i, j, x, y)
            centre[0] = new_centres[0, i, j]
            centre[1] = new_centres[1, i, j]
            at_i, at_j = locate_point(nodes, at_i, at_j, centre[0], centre[1], most_moves)
            if j == 0:
                row_i, row_j = at_i, at_j
            queue[0] = at_i * nj + at_j
            marks[at_i, at_j] = mark
            cell = (x, y, centre)
            taken_by_cell = (taken[i, j], covered[i, j], used)
            take_overlaps(1, cell, old, curved, mark, scratch, taken_by_cell)
            # parts that a walk over edges does not reach, such as beside a curved side
            if covered[i, j, 0] < (1.0 - least_gap) * new_volumes[i, j]:
                is_uncovered = covered[i, j, 0] == 0.0
                waiting = queue_missed(nodes, x, y, is_uncovered, mark, marks, queue)
                take_overlaps(waiting, cell, old, curved, mark, scratch, taken_by_cell)


@dataclass(frozen=True)
class Overlay:
    """What the cells (mi, mj) of a new grid take from the linear fields of an old one (ni, nj).

    taken (mi, mj, n): integrals of each quantity over the covered part of every new cell;
    covered (mi, mj, 3), used (ni, nj, 3): volume, and first moments about the cell's own centre, of
    what is covered of new cells and used of old ones; volumes (mi, mj), centres (2, mi, mj) of
    the new cells.
    """

    taken: np.ndarray
    covered: np.ndarray
    used: np.ndarray
    volumes: np.ndarray
    centres: np.ndarray


def overlay_grids(
    nodes: np.ndarray,
    centres: np.ndarray,
    fields: np.ndarray,
    new_nodes: np.ndarray,
    curved: bool,
) -> Overlay:
    """Lay a grid `new_nodes` (2, mi+1, mj+1) over `nodes` (2, ni+1, nj+1), both [m], convex.

    centres (2, ni, nj): of volume; fields (ni, nj, n, 3): mean of n quantities in each cell, and
    their slopes in x and y; curved: y is the distance from an axis, volumes are per radian.
    """
    ni, nj, count, _ = fields.shape
    new_nodes = np.ascontiguousarray(new_nodes, dtype=np.float64)
    volumes, new_centres = compute_cell_moments(new_nodes, curved)
    taken = np.empty((*volumes.shape, count))
    covered = np.empty((*volumes.shape, 3))
    used = np.empty((ni, nj, 3))
    old = np.ascontiguousarray(nodes, dtype=np.float64), centres, fields
    marks = np.empty((ni, nj), dtype=np.int64)
    queue = np.empty(ni * nj, dtype=np.int64)
    scratch = (marks, queue, np.empty((4, MOST_CORNERS)))
    out = (taken, covered, used)
    fill_overlaps(old, (new_nodes, volumes, new_centres), curved, LEAST_GAP, scratch, out)
    return Overlay(taken, covered, used, volumes, new_centres)
