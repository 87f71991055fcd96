"""Transfinite interpolation of grids and of boundary displacements into a block.

The blending functions are the sides' own arc-length spacing laws, carried into the block so that
line i is the straight line, in the unit square, between its places on the sides j_min and j_max,
and line j likewise: lines of one family never cross, whatever the two laws, and nothing depends
on which family is called i.  The trap: only the four sides of the values are read.

Source: [ProkopovND] (6.1), transfinite interpolation; theory R6.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import kernel

# Rows of the scratch: along j, the law on i_min, its change towards i_max, the values on i_min
# and their change towards i_max; then, along i, the same for the sides j_min and j_max.
LAW, LAW_CHANGE, VALUE_X, VALUE_Y, CHANGE_X, CHANGE_Y = range(6)


@kernel
def fill_arc_law(x, y, law):
    """Spacing law 0..1 by arc length of the polyline x, y; uniform where the line has no length."""
    last = law.shape[0] - 1
    law[0] = 0.0
    for k in range(last):
        step_x, step_y = x[k + 1] - x[k], y[k + 1] - y[k]
        law[k + 1] = law[k] + np.sqrt(step_x * step_x + step_y * step_y)
    total = law[last]
    for k in range(1, last):
        law[k] = law[k] / total if total > 0.0 else k / last
    law[last] = 1.0


@kernel
def fill_blend(along_i, along_j, corners, mean_x, mean_y, out):
    """Boolean sum (theory R6.4) of the sides' values into the inner nodes; rows as named above."""
    (corner_00x, corner_0mx, corner_n0x, corner_nmx) = corners[0]
    (corner_00y, corner_0my, corner_n0y, corner_nmy) = corners[1]
    for i in range(1, out.shape[1] - 1):
        start, turn = along_i[LAW, i], along_i[LAW_CHANGE, i]
        low_x, low_y = along_i[VALUE_X, i], along_i[VALUE_Y, i]
        rise_x, rise_y = along_i[CHANGE_X, i], along_i[CHANGE_Y, i]
        row_x, row_y = out[0, i], out[1, i]
        for j in range(1, out.shape[2] - 1):
            bend = along_j[LAW_CHANGE, j]
            blend_i = (start + along_j[LAW, j] * turn) / (1.0 - turn * bend)
            blend_j = along_j[LAW, j] + blend_i * bend
            # Corner terms of the boolean sum, folded into the part that runs along j.
            under_x = low_x - corner_00x - blend_i * (corner_n0x - corner_00x)
            under_y = low_y - corner_00y - blend_i * (corner_n0y - corner_00y)
            over_x = low_x + rise_x - corner_0mx - blend_i * (corner_nmx - corner_0mx)
            over_y = low_y + rise_y - corner_0my - blend_i * (corner_nmy - corner_0my)
            side_x = along_j[VALUE_X, j] + blend_i * along_j[CHANGE_X, j]
            side_y = along_j[VALUE_Y, j] + blend_i * along_j[CHANGE_Y, j]
            row_x[j] = mean_x + (side_x + (under_x + blend_j * (over_x - under_x)))
            row_y[j] = mean_y + (side_y + (under_y + blend_j * (over_y - under_y)))


@kernel
def fill_from_sides(laws_of, out):
    """Interpolate the values on the four sides of `out` to its inner nodes.

    `laws_of` (2, ni+1, nj+1) is a grid whose sides give the spacing laws; the sides of `out`
    (same shape) are left as they are.
    """
    ni, nj = out.shape[1] - 1, out.shape[2] - 1
    along_i, along_j = np.empty((6, ni + 1)), np.empty((6, nj + 1))
    # The mean is symmetric in the corners, so that a mirrored or transposed block gets the same
    # bits, and is the value itself where all agree: a block moved bodily keeps its shape.
    mean_x = 0.25 * ((out[0, 0, 0] + out[0, ni, nj]) + (out[0, 0, nj] + out[0, ni, 0]))
    mean_y = 0.25 * ((out[1, 0, 0] + out[1, ni, nj]) + (out[1, 0, nj] + out[1, ni, 0]))
    # The value rows first hold the sides of the grid, for the laws.
    for j, law in ((0, LAW), (nj, LAW_CHANGE)):
        for i in range(ni + 1):
            along_i[VALUE_X, i], along_i[VALUE_Y, i] = laws_of[0, i, j], laws_of[1, i, j]
        fill_arc_law(along_i[VALUE_X], along_i[VALUE_Y], along_i[law])
    for i, law in ((0, LAW), (ni, LAW_CHANGE)):
        fill_arc_law(laws_of[0, i], laws_of[1, i], along_j[law])
    for i in range(ni + 1):
        along_i[LAW_CHANGE, i] -= along_i[LAW, i]
        along_i[VALUE_X, i], along_i[VALUE_Y, i] = out[0, i, 0] - mean_x, out[1, i, 0] - mean_y
        along_i[CHANGE_X, i] = out[0, i, nj] - out[0, i, 0]
        along_i[CHANGE_Y, i] = out[1, i, nj] - out[1, i, 0]
    for j in range(nj + 1):
        along_j[LAW_CHANGE, j] -= along_j[LAW, j]
        along_j[VALUE_X, j], along_j[VALUE_Y, j] = out[0, 0, j] - mean_x, out[1, 0, j] - mean_y
        along_j[CHANGE_X, j] = out[0, ni, j] - out[0, 0, j]
        along_j[CHANGE_Y, j] = out[1, ni, j] - out[1, 0, j]
    low, high = along_j[VALUE_X : VALUE_Y + 1], along_j[CHANGE_X : CHANGE_Y + 1]
    corners = (
        (low[0, 0], low[0, nj], low[0, 0] + high[0, 0], low[0, nj] + high[0, nj]),
        (low[1, 0], low[1, nj], low[1, 0] + high[1, 0], low[1, nj] + high[1, nj]),
    )
    fill_blend(along_i, along_j, corners, mean_x, mean_y, out)


@kernel
def fill_displacement(previous, boundary, out):
    """Carry the boundary's displacement `boundary - previous` into the block, by the old laws.

    `out` (2, ni+1, nj+1) is written everywhere; equal displacements on all sides come out as they
    are, and a displacement that is affine along a graded rectangle is affine inside.
    """
    ni, nj = out.shape[1] - 1, out.shape[2] - 1
    for k in range(2):
        for i in range(ni + 1):
            out[k, i, 0] = boundary[k, i, 0] - previous[k, i, 0]
            out[k, i, nj] = boundary[k, i, nj] - previous[k, i, nj]
        for j in range(nj + 1):
            out[k, 0, j] = boundary[k, 0, j] - previous[k, 0, j]
            out[k, ni, j] = boundary[k, ni, j] - previous[k, ni, j]
    fill_from_sides(previous, out)


@kernel
def fill_moved(old, sides, bend, most_bend, bent, displacement, base, reach):
    """Move a grid: `base = old + displacement`, with the sides of `sides`; (2, ni+1, nj+1), in m.

    Lines j = const that keep spacing laws of their own (theory R4.9) take their part of the change
    of their way from i_min to i_max: where `bent`, `displacement` is given `bend` (ni+1, nj+1)
    times that change first; `reach` (nj+1) is the most that this is on each line, with
    `most_bend` (nj+1), the most of `bend` there.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    turn = np.zeros((2, nj + 1))
    if bent:
        for k in range(2):
            for j in range(nj + 1):
                way = sides[k, ni, j] - sides[k, 0, j]
                turn[k, j] = way - (old[k, ni, j] - old[k, 0, j])
        for j in range(nj + 1):
            square = turn[0, j] * turn[0, j] + turn[1, j] * turn[1, j]
            reach[j] = most_bend[j] * np.sqrt(square)
    for k in range(2):
        turned = turn[k]
        for i in range(ni + 1):
            row, here, moved = displacement[k, i], old[k, i], base[k, i]
            if bent:
                part = bend[i]
                for j in range(nj + 1):
                    row[j] += part[j] * turned[j]
            for j in range(nj + 1):
                moved[j] = here[j] + row[j]
            moved[0], moved[nj] = sides[k, i, 0], sides[k, i, nj]
        for j in range(nj + 1):
            base[k, 0, j], base[k, ni, j] = sides[k, 0, j], sides[k, ni, j]


def transfinite_grid(boundary: np.ndarray) -> np.ndarray:
    """Grid between four sides by transfinite interpolation of their nodes.

    `boundary` (2, ni+1, nj+1) is read on its sides only.  The result may be folded where the
    sides bend strongly: check it with `regrid.measure.quality`.
    """
    nodes = np.array(boundary, dtype=np.float64, order="C")
    fill_from_sides(nodes, nodes)
    return nodes
