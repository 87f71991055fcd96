"""One grid laid over another: what each new cell takes from the old cells that it overlaps.

Each new cell is cut by the old cells around the place where the last one was found, and from there
by their neighbours for as long as they overlap it; so the cost is that of the overlaps alone.
The traps: a new cell at a side may reach beyond the old grid, and one that lies outside whole has
no overlap at all; both are told by how much of the cell is covered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydro.remap.polygons import MOST_CORNERS, compute_cell_moments, cut_polygon, measure_polygon
from hydro.remap.slopes import MEAN, SLOPE_X, SLOPE_Y
from regrid.jit import compiled_once, kernel

LEAST_GAP = 1e-9  # part of a cell that may stay uncovered before the old grid is searched for it


@compiled_once
def cut_by_cell(work, nodes, i, j, x, y):
    """Cut the quadrilateral in (x, y) by the cell i, j: corners, and which edges it crosses.

    The result lies in the rows 0 and 1 of `work` (4, MOST_CORNERS).  Edges count from j_min on,
    anticlockwise.
    """
    n = 4
    for k in range(4):
        work[0, k], work[1, k] = x[k], y[k]
    ax, ay = nodes[0, i, j], nodes[1, i, j]
    bx, by = nodes[0, i + 1, j], nodes[1, i + 1, j]
    cx, cy = nodes[0, i + 1, j + 1], nodes[1, i + 1, j + 1]
    dx, dy = nodes[0, i, j + 1], nodes[1, i, j + 1]
    n, below = cut_polygon(work[0], work[1], n, work[2], work[3], ax, ay, bx - ax, by - ay)
    if n < 3:
        return 0, below, False, False, False
    n, right = cut_polygon(work[2], work[3], n, work[0], work[1], bx, by, cx - bx, cy - by)
    if n < 3:
        return 0, below, right, False, False
    n, above = cut_polygon(work[0], work[1], n, work[2], work[3], cx, cy, dx - cx, dy - cy)
    if n < 3:
        return 0, below, right, above, False
    n, left = cut_polygon(work[2], work[3], n, work[0], work[1], dx, dy, ax - dx, ay - dy)
    return n, below, right, above, left


@compiled_once
def find_cell(nodes, i, j, x, y, most):
    """Walk from the cell i, j to the one that holds the point, or to the side that is in the way.

    Each move goes through an edge that the point lies beyond, at most `most` times.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for _ in range(most):
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
def take_overlaps(
    waiting, x, y, here, nodes, centres, fields, curved, mark, marks, queue, work, taken, covered,
    used,
):  # fmt: skip
    """Cut the new cell (x, y) by the cells in `queue` and by their neighbours that it reaches.

    Adds to `taken` (n,), `covered` (3,) and `used` (ni, nj, 3); `here` (2,): the new cell's centre.
    """
    ni, nj = centres.shape[1], centres.shape[2]
    while waiting > 0:
        waiting -= 1
        i, j = queue[waiting] // nj, queue[waiting] % nj
        n, below, right, above, left = cut_by_cell(work, nodes, i, j, x, y)
        if n < 3:
            continue
        about_x, about_y = centres[0, i, j], centres[1, i, j]
        volume, moment_x, moment_y = measure_polygon(work[0], work[1], n, curved, about_x, about_y)
        if not volume > 0.0:
            continue
        for q in range(taken.shape[0]):
            taken[q] += fields[i, j, q, MEAN] * volume + (
                fields[i, j, q, SLOPE_X] * moment_x + fields[i, j, q, SLOPE_Y] * moment_y
            )
        used[i, j, 0] += volume
        used[i, j, 1] += moment_x
        used[i, j, 2] += moment_y
        covered[0] += volume
        covered[1] += moment_x + (about_x - here[0]) * volume
        covered[2] += moment_y + (about_y - here[1]) * volume
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
def queue_missed(nodes, x, y, every, mark, marks, queue):
    """Queue cells of the sides, or `every` cell, whose box meets that of a new cell."""
    ni, nj = marks.shape
    low_x, high_x = min(x[0], x[1], x[2], x[3]), max(x[0], x[1], x[2], x[3])
    low_y, high_y = min(y[0], y[1], y[2], y[3]), max(y[0], y[1], y[2], y[3])
    waiting = 0
    for i in range(ni):
        step = 1 if every or i == 0 or i == ni - 1 or nj == 1 else nj - 1
        for j in range(0, nj, step):
            if marks[i, j] == mark:
                continue
            ax, bx = nodes[0, i, j], nodes[0, i + 1, j]
            cx, dx = nodes[0, i + 1, j + 1], nodes[0, i, j + 1]
            if min(ax, bx, cx, dx) > high_x or max(ax, bx, cx, dx) < low_x:
                continue
            ay, by = nodes[1, i, j], nodes[1, i + 1, j]
            cy, dy = nodes[1, i + 1, j + 1], nodes[1, i, j + 1]
            if min(ay, by, cy, dy) > high_y or max(ay, by, cy, dy) < low_y:
                continue
            marks[i, j] = mark
            queue[waiting] = i * nj + j
            waiting += 1
    return waiting


@kernel
def fill_overlaps(
    nodes, centres, fields, new_nodes, new_volumes, new_centres, curved, least_gap, marks, queue,
    work, taken, covered, used,
):  # fmt: skip
    """What all new cells take from the linear `fields` (ni, nj, n, 3) of the old ones.

    Fills `taken` (mi, mj, n), and `covered` (mi, mj, 3), `used` (ni, nj, 3): volume and first
    moments about the cell's own centre of what is covered of each new cell, and used of each old
    one.  marks (ni, nj), queue (ni * nj,), work (4, MOST_CORNERS): scratch.
    """
    ni, nj = centres.shape[1], centres.shape[2]
    most = 4 * (ni + nj)
    x, y, here = np.empty(4), np.empty(4), np.empty(2)
    marks[:, :], taken[:, :, :], covered[:, :, :], used[:, :, :] = -1, 0.0, 0.0, 0.0
    row_i, row_j = 0, 0
    for i in range(taken.shape[0]):
        at_i, at_j = row_i, row_j
        for j in range(taken.shape[1]):
            mark = i * taken.shape[1] + j
            x[0], y[0] = new_nodes[0, i, j], new_nodes[1, i, j]
            x[1], y[1] = new_nodes[0, i + 1, j], new_nodes[1, i + 1, j]
            x[2], y[2] = new_nodes[0, i + 1, j + 1], new_nodes[1, i + 1, j + 1]
            x[3], y[3] = new_nodes[0, i, j + 1], new_nodes[1, i, j + 1]
            here[0], here[1] = new_centres[0, i, j], new_centres[1, i, j]
            at_i, at_j = find_cell(nodes, at_i, at_j, here[0], here[1], most)
            if j == 0:
                row_i, row_j = at_i, at_j
            queue[0], marks[at_i, at_j] = at_i * nj + at_j, mark
            take_overlaps(
                1, x, y, here, nodes, centres, fields, curved, mark, marks, queue, work,
                taken[i, j], covered[i, j], used,
            )  # fmt: skip
            if covered[i, j, 0] < (1.0 - least_gap) * new_volumes[i, j]:
                every = covered[i, j, 0] == 0.0
                waiting = queue_missed(nodes, x, y, every, mark, marks, queue)
                take_overlaps(
                    waiting, x, y, here, nodes, centres, fields, curved, mark, marks, queue, work,
                    taken[i, j], covered[i, j], used,
                )  # fmt: skip


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


def lay_over(
    nodes: np.ndarray,
    centres: np.ndarray,
    fields: np.ndarray,
    new_nodes: np.ndarray,
    curved: bool,
) -> Overlay:
    """Lay a grid `new_nodes` (2, mi+1, mj+1) over `nodes` (2, ni+1, nj+1), both [m], convex.

    centres (2, ni, nj): of volume; fields (ni, nj, n, 3): `hydro.remap.slopes`; curved: y is the
    distance from an axis, volumes are per radian.
    """
    ni, nj, count, _ = fields.shape
    new_nodes = np.ascontiguousarray(new_nodes, dtype=np.float64)
    volumes, new_centres = compute_cell_moments(new_nodes, curved)
    taken, covered = np.empty((*volumes.shape, count)), np.empty((*volumes.shape, 3))
    used = np.empty((ni, nj, 3))
    fill_overlaps(
        np.ascontiguousarray(nodes, dtype=np.float64), centres, fields, new_nodes, volumes,
        new_centres, curved, LEAST_GAP, np.empty((ni, nj), dtype=np.int64),
        np.empty(ni * nj, dtype=np.int64), np.empty((4, MOST_CORNERS)), taken, covered, used,
    )  # fmt: skip
    return Overlay(taken, covered, used, volumes, new_centres)
