"""What a grid costs: a term that opens the cells which set the time step.

A cell of a flow is crossed in 1/r, r = c (|l_i| + |l_j|)/V, with its lines through the middle
l_i, l_j, its area V and its sound speed c (theory F7.1): the largest r of all cells sets the step.
Cells are dear where r is above R, 1.05 times the largest r that the laws of the sides ask for.
Theory R4.10:

    P = 2 mu sigma Σ (ln rho + 1/rho - 1)  over cells with rho > 1,
    rho = 2 (c/R)² (|l_i|² + |l_j|²)/V²,

joins the functional, with 2 (|l_i|² + |l_j|²) for (|l_i| + |l_j|)²: rho is smooth and never below
(r/R)².  Straight lines stay where nothing is dear.  The trap: a weight taken from the grid before,
in place of a term of the functional, swings from step to step.
"""

from __future__ import annotations

import numpy as np

from regrid.barrier.area_ratios import SPAN
from regrid.barrier.assembly_rows import (
    CROSS,
    DEARNESS,
    DIAGONAL,
    LEFT,
    LEFT_GX,
    LEFT_GY,
    LOW,
    LOW_GX,
    LOW_GY,
    RIGHT,
    RIGHT_GX,
    RIGHT_GY,
    UP,
    UP_GX,
    UP_GY,
)
from regrid.barrier.side_laws import LENGTH, LENGTH_CHANGE
from regrid.jit import inlined, kernel

MARGIN = 1.05  # of R: cells that wobble with a nearly flat line, by up to 2 %, are not dear


@kernel
def compute_dear_rate(sound, along_i, along_j, blend_i, blend_j, area_target):
    """R [1/s]: 1.05 times the largest c (2 (s_i² + s_j²))^½/(area_target s_i s_j) of all cells.

    `sound` (ni, nj) in m/s; laws, and `area_target`, the mean area of a cell over s_i s_j:
    `BarrierLaw`.
    """
    ni, nj = sound.shape
    columns, rates = np.zeros(nj), np.zeros(nj)
    for j in range(nj):
        columns[j] = 0.5 * (blend_j[j] + blend_j[j + 1])
    for i in range(ni):
        u = 0.5 * (blend_i[i] + blend_i[i + 1])
        length, change, row = along_i[LENGTH, i], along_i[LENGTH_CHANGE, i], sound[i]
        # the largest of each column: a single one would keep the loop from the vectoriser
        for j in range(nj):
            s_i = length + columns[j] * change
            s_j = along_j[LENGTH, j] + u * along_j[LENGTH_CHANGE, j]
            ratio = row[j] / (s_i * s_j)
            square = (s_i * s_i + s_j * s_j) * (ratio * ratio)
            rates[j] = square if square > rates[j] else rates[j]
    most = 0.0
    for j in range(nj):
        most = rates[j] if rates[j] > most else most
    return MARGIN * np.sqrt(2.0 * most) / area_target


@kernel
def fill_dearness(x0, y0, x1, y1, sound, scale, cells, Z):
    """rho of a row of cells, into DEARNESS; `scale` is 2/R²."""
    for col in range(cells):
        ax = 0.5 * ((x1[col] - x0[col]) + (x1[col + 1] - x0[col + 1]))
        ay = 0.5 * ((y1[col] - y0[col]) + (y1[col + 1] - y0[col + 1]))
        bx = 0.5 * ((x0[col + 1] - x0[col]) + (x1[col + 1] - x1[col]))
        by = 0.5 * ((y0[col + 1] - y0[col]) + (y1[col + 1] - y1[col]))
        ratio = sound[col] / (ax * by - ay * bx)
        square = (ax * ax + ay * ay) + (bx * bx + by * by)
        Z[DEARNESS + col] = (scale * square) * (ratio * ratio)


@inlined
def block(stiffness, cross, both, curve, p, g_p, q, g_q, d_p, d_q):
    """One number of the Hessian's blocks; `stiffness` times it, and the square of the gradient."""
    return stiffness * (both * (g_p * g_q) - cross * (p * g_q + g_p * q)) + curve * (d_p * d_q)


@kernel
def add_cost(x0, y0, x1, y1, sound, scale, weight, cells, now, Z):
    """Add gradient and Hessian of P to those of a row of cells (`fill_cell_blocks`).

    Nodes of the two rows beside it, `sound` of its cells, `scale` = 2/R², `weight` = mu sigma.
    The Hessian is positive semidefinite (theory R4.12): of rho, with A = l_i, B = l_j, D = A × B,

        d²rho/dxdy ~ (2 k/D²) (1_xy - (2/D) (x g_y' + g_x y') + 4 (q/D²) g_x g_y'),  x, y in {A, B}

    q = |A|² + |B|², k = scale c², g_x = dD/dx; 4 for 3, without which it would not be.
    """
    fill_dearness(x0, y0, x1, y1, sound, scale, cells, Z)
    for col in range(cells):
        dearness = Z[DEARNESS + col]
        if dearness > 1.0:
            ax = 0.5 * ((x1[col] - x0[col]) + (x1[col + 1] - x0[col + 1]))
            ay = 0.5 * ((y1[col] - y0[col]) + (y1[col + 1] - y0[col + 1]))
            bx = 0.5 * ((x0[col + 1] - x0[col]) + (x1[col + 1] - x1[col]))
            by = 0.5 * ((y0[col + 1] - y0[col]) + (y1[col + 1] - y1[col]))
            inverse = 1.0 / (ax * by - ay * bx)
            ratio = sound[col] * inverse
            twice = (2.0 * scale) * (ratio * ratio)
            share = ((ax * ax + ay * ay) + (bx * bx + by * by)) * inverse
            gax, gay, gbx, gby = by, -bx, -ay, ax
            dax, day = twice * (ax - share * gax), twice * (ay - share * gay)
            dbx, dby = twice * (bx - share * gbx), twice * (by - share * gby)
            part = 1.0 / dearness
            slope = (2.0 * weight) * ((1.0 - part) * part)
            curve = (2.0 * weight) * ((2.0 * part - 1.0) * (part * part))
            curve = curve if curve > 0.0 else 0.0
            h = slope * twice
            cross, both = 2.0 * inverse, (4.0 * share) * inverse
            aa_xx = h + block(h, cross, both, curve, ax, gax, ax, gax, dax, dax)
            aa_xy = block(h, cross, both, curve, ax, gax, ay, gay, dax, day)
            aa_yy = h + block(h, cross, both, curve, ay, gay, ay, gay, day, day)
            bb_xx = h + block(h, cross, both, curve, bx, gbx, bx, gbx, dbx, dbx)
            bb_xy = block(h, cross, both, curve, bx, gbx, by, gby, dbx, dby)
            bb_yy = h + block(h, cross, both, curve, by, gby, by, gby, dby, dby)
            ab_xx = block(h, cross, both, curve, ax, gax, bx, gbx, dax, dbx)
            ab_xy = block(h, cross, both, curve, ax, gax, by, gby, dax, dby)
            ab_yx = block(h, cross, both, curve, ay, gay, bx, gbx, day, dbx)
            ab_yy = block(h, cross, both, curve, ay, gay, by, gby, day, dby)
            # Each of A and B is the mean of the cell's two edges that way.
            half = 0.5 * slope
            Z[LOW_GX + col] += half * dax
            Z[LOW_GY + col] += half * day
            Z[UP_GX + col] += half * dax
            Z[UP_GY + col] += half * day
            Z[LEFT_GX + col] += half * dbx
            Z[LEFT_GY + col] += half * dby
            Z[RIGHT_GX + col] += half * dbx
            Z[RIGHT_GY + col] += half * dby
            less_xx, less_xy, less_yy = (
                0.25 * (aa_xx - bb_xx),
                0.25 * (aa_xy - bb_xy),
                0.25 * (aa_yy - bb_yy),
            )
            odd = 0.25 * (ab_xy - ab_yx)
            Z[LOW + col] -= less_xx
            Z[LOW + SPAN + col] -= less_xy - odd
            Z[LOW + 2 * SPAN + col] -= less_xy + odd
            Z[LOW + 3 * SPAN + col] -= less_yy
            Z[UP + col] -= less_xx
            Z[UP + SPAN + col] -= less_xy + odd
            Z[UP + 2 * SPAN + col] -= less_xy - odd
            Z[UP + 3 * SPAN + col] -= less_yy
            Z[LEFT + col] += less_xx
            Z[LEFT + SPAN + col] += less_xy - odd
            Z[LEFT + 2 * SPAN + col] += less_xy + odd
            Z[LEFT + 3 * SPAN + col] += less_yy
            Z[RIGHT + col] += less_xx
            Z[RIGHT + SPAN + col] += less_xy + odd
            Z[RIGHT + 2 * SPAN + col] += less_xy - odd
            Z[RIGHT + 3 * SPAN + col] += less_yy
            sum_xx, sum_xy, sum_yy = (
                0.25 * (aa_xx + bb_xx),
                0.25 * (aa_xy + bb_xy),
                0.25 * (aa_yy + bb_yy),
            )
            even_xx, even_xy, even_yy = 0.5 * ab_xx, 0.25 * (ab_xy + ab_yx), 0.5 * ab_yy
            now[DIAGONAL + col] -= sum_xx + even_xx
            now[DIAGONAL + SPAN + col] -= sum_xy + even_xy
            now[DIAGONAL + 2 * SPAN + col] -= sum_xy + even_xy
            now[DIAGONAL + 3 * SPAN + col] -= sum_yy + even_yy
            now[CROSS + col] -= sum_xx - even_xx
            now[CROSS + SPAN + col] -= sum_xy - even_xy
            now[CROSS + 2 * SPAN + col] -= sum_xy - even_xy
            now[CROSS + 3 * SPAN + col] -= sum_yy - even_yy


@kernel
def compute_cost(nodes, sound, scale, weight, first, last, Z):
    """P of the cells of columns first..last-1 of a convex grid; `weight` = mu sigma."""
    total = 0.0
    for i in range(sound.shape[0]):
        fill_dearness(
            nodes[0, i, first : last + 1],
            nodes[1, i, first : last + 1],
            nodes[0, i + 1, first : last + 1],
            nodes[1, i + 1, first : last + 1],
            sound[i, first:last],
            scale,
            last - first,
            Z,
        )
        for col in range(last - first):
            dearness = Z[DEARNESS + col]
            dearness = dearness if dearness > 1.0 else 1.0
            total += 2.0 * (np.log(dearness) - (1.0 - 1.0 / dearness))
    return weight * total
