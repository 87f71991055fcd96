"""The moved grid, and is it good enough as it is?  One pass over the rows of a block.

The old grid moved along with its sides (theory R6.5), its corner areas against the old ones, an
estimate of the residual, and the grid's quality.  If the gradient is small the Newton step is
skipped; assembling the Hessian costs several times more.  The residual is g' M^-1 g, M the 2 × 2
blocks of the Hessian along the lines j = const (`regrid.barrier.line_cg`).  Here M is replaced by a
scalar tridiagonal matrix: what the straight lines give it, q = k/t an edge, and half the trace of
the Hessian's blocks that the corners give to an edge a and to an edge b
(`regrid.barrier.functional`), without the coupling of a and b, which is of either sign at the two
sides of a line.  The sum Σ y²/p, with the pivots p and the forward eliminated gradient y, goes
along with the rows.  It is within a third of the residual where cells are not very sharp, and
nearly it where straight lines rule.

Everything a row of cells yields goes into ONE flat scratch array at constant offsets
(otherwise nothing here vectorises).
"""

from __future__ import annotations

import numpy as np
from numba import prange

from regrid.algebraic import fill_moved_row, take_curve, take_curve_sides
from regrid.barrier.coarse_nodes import end_stretch
from regrid.barrier.functional import cell_rate, corner_slope, cost_slope, fade, weigh
from regrid.barrier.line_cg import add_columns
from regrid.barrier.side_laws import GROWTH, LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE
from regrid.barrier.step_control import EDGE_X, EDGE_Y, NOTHING, SPAN, fill_areas
from regrid.jit import inlined, kernel
from regrid.measure.corners import mark_triangles

# Scratch: one row each.  Edges as they are (X, Y), their inverse conditional lengths (G) and their
# weights as parts of straight lines (Q): along i, along j of the near and of the far row of nodes.
# The first two rows are those of `fill_areas`.
(
    _, _, OLD_1, OLD_2, OLD_3, OLD_4, SOUND, V, BEND, TURN_X, TURN_Y,
    LINE_X, LINE_Y, LINE_G, LINE_Q, NEAR_X, NEAR_Y, NEAR_G, NEAR_Q, FAR_X, FAR_Y, FAR_G, FAR_Q,
    LOW_X, LOW_Y, LOW_Q, UP_X, UP_Y, UP_Q, SIDE_X, SIDE_Y, SIDE_Q, RIGHT_X, RIGHT_Y, RIGHT_Q,
    FLUX_X, FLUX_Y, PIVOT, PART_X, PART_Y, PASSED, SUM,
    SHRUNK, LEAST_AREA, SHARPEST, LONG, SHORT, OLD_AREA, LONG_LINE, LONG_SIDE, LIMITING,
    WHOLE_X, WHOLE_Y, NEAR_SUM_I, NEAR_SUM_J, FAR_SUM_I, FAR_SUM_J, PAST_X, PAST_Y,
) = (k * SPAN for k in range(59))  # fmt: skip
LOOK_ROWS = 59 * SPAN
OWN = -NOTHING
# What a look finds in a chunk of columns, and in the block: the most that a corner has shrunk, the
# least scaled corner area, how far nodes are from interpolated places, the largest squared inverse
# sine of a corner and the largest squared aspect ratio.
MOST_SHRUNK, LEAST_SCALED, STRAYED, COSECANT, ASPECT = range(5)


@kernel(allocates=False)
def begin(nodes, low, cells, Z):
    """Sums and extremes of nothing, before the first row of cells."""
    nj = nodes.shape[2] - 1
    for k in range(0, LOOK_ROWS, SPAN):
        for col in range(SPAN):
            Z[k + col] = 0.0
    for col in range(cells):
        Z[LEAST_AREA + col] = Z[OLD_AREA + col] = NOTHING
        Z[SHORT + col] = 1.0
    for col in range(cells + 1):
        Z[V + col] = (low + col) / nj


@inlined
def take_line_edges(nodes, i, law, low, count, Z):
    """The edges along i between node rows i and i + 1."""
    x0, y0 = nodes[0, i, low : low + count], nodes[1, i, low : low + count]
    x1, y1 = nodes[0, i + 1, low : low + count], nodes[1, i + 1, low : low + count]
    length, length_change = law.along_i[LENGTH, i], law.along_i[LENGTH_CHANGE, i]
    step, step_change = law.along_i[STEP, i], law.along_i[STEP_CHANGE, i]
    blend, ki = law.blend_j[low : low + count], law.ki
    for col in range(count):
        s, t = length + blend[col] * length_change, step + Z[V + col] * step_change
        inverse = 1.0 / (s * t)
        Z[LINE_G + col] = t * inverse
        Z[LINE_Q + col] = ki * (s * inverse)
        Z[LINE_X + col] = x1[col] - x0[col]
        Z[LINE_Y + col] = y1[col] - y0[col]


@inlined
def take_turn(law, i, low, count, Z):
    """What lines that keep laws of their own depart by along the edges that lead to row i."""
    row, way_x, way_y = law.bend[i, low:], law.way[0, low:], law.way[1, low:]
    for col in range(count):
        turn = row[col] - Z[BEND + col]
        Z[TURN_X + col] = turn * way_x[col]
        Z[TURN_Y + col] = turn * way_y[col]
    for col in range(count):
        Z[BEND + col] = row[col]


@inlined
def take_side_edges(nodes, i, law, low, cells, Z):
    """The edges along j of node row i into the far rows; the far ones become near."""
    x, y = nodes[0, i, low : low + cells + 1], nodes[1, i, low : low + cells + 1]
    columns = slice(low, low + cells)
    length, length_change = law.along_j[LENGTH, columns], law.along_j[LENGTH_CHANGE, columns]
    step, step_change = law.along_j[STEP, columns], law.along_j[STEP_CHANGE, columns]
    u, blend, kj = i / (nodes.shape[1] - 1), law.blend_i[i], law.kj
    for col in range(cells):
        Z[NEAR_X + col] = Z[FAR_X + col]
        Z[NEAR_Y + col] = Z[FAR_Y + col]
        Z[NEAR_G + col] = Z[FAR_G + col]
        Z[NEAR_Q + col] = Z[FAR_Q + col]
        s, t = length[col] + blend * length_change[col], step[col] + u * step_change[col]
        inverse = 1.0 / (s * t)
        Z[FAR_G + col] = t * inverse
        Z[FAR_Q + col] = kj * (s * inverse)
        Z[FAR_X + col] = x[col + 1] - x[col]
        Z[FAR_Y + col] = y[col + 1] - y[col]


@inlined
def take_cell(col, numbers, Z):
    """What the four corners of a cell give to gradient and matrix along its edges; its quality.

    A corner of the block's own has OWN for its old area; it enters neither the areas that are
    compared nor the weight, and has its area from `given`.
    """
    full, growth, least_sine, most, lam_c, flat, rate, given = numbers
    ax, ay, ux, uy = Z[LINE_X + col], Z[LINE_Y + col], Z[LINE_X + col + 1], Z[LINE_Y + col + 1]
    bx, by, rx, ry = Z[NEAR_X + col], Z[NEAR_Y + col], Z[FAR_X + col], Z[FAR_Y + col]
    ga, gu, gb, gr = Z[LINE_G + col], Z[LINE_G + col + 1], Z[NEAR_G + col], Z[FAR_G + col]
    a1, a2 = ax * by - ay * bx, ux * by - uy * bx
    a3, a4 = ux * ry - uy * rx, ax * ry - ay * rx
    h1, h2, h3, h4 = ga * gb, gu * gb, gu * gr, ga * gr
    d1, d2, d3, d4 = h1 * a1, h2 * a2, h3 * a3, h4 * a4
    o1, o2, o3, o4 = Z[OLD_1 + col], Z[OLD_2 + col], Z[OLD_3 + col], Z[OLD_4 + col]
    d1, d2 = d1 if o1 > OWN else given, d2 if o2 > OWN else given
    d3, d4 = d3 if o3 > OWN else given, d4 if o4 > OWN else given
    # One division for the four corners and the fading; where it overflows nothing is a number.
    low, up, across = d1 * d2, d3 * d4, gb + gr
    both = 1.0 / ((low * up) * across)
    ratio = (ga + gu) * (both * (low * up))
    both *= across
    low, up = both * up, both * low
    i1, i2, i3, i4 = low * d2, low * d1, up * d4, up * d3
    d1, d3 = d1 if d1 < d2 else d2, d3 if d3 < d4 else d4
    d1, d2 = d1 if d1 < d3 else d3, Z[LEAST_AREA + col]
    Z[LEAST_AREA + col] = d1 if d1 < d2 else d2
    pa, pu, pb, pr = ax * ax + ay * ay, ux * ux + uy * uy, bx * bx + by * by, rx * rx + ry * ry
    pa, pu, pb, pr = (ga * ga) * pa, (gu * gu) * pu, (gb * gb) * pb, (gr * gr) * pr
    j1, j2, j3, j4 = i1 * i1, i2 * i2, i3 * i3, i4 * i4
    c1, c2 = (pa * pb) * j1 if o1 > OWN else 0.0, (pu * pb) * j2 if o2 > OWN else 0.0
    c3, c4 = (pu * pr) * j3 if o3 > OWN else 0.0, (pa * pr) * j4 if o4 > OWN else 0.0
    # What the corners had before, over what they have.
    o1, o2, o3, o4 = o1 * (h1 * i1), o2 * (h2 * i2), o3 * (h3 * i3), o4 * (h4 * i4)
    o1, o3 = o1 if o1 > o2 else o2, o3 if o3 > o4 else o4
    o1, o2 = o1 if o1 > o3 else o3, Z[SHRUNK + col]
    Z[SHRUNK + col] = o1 if o1 > o2 else o2
    c1, c3 = c1 if c1 > c2 else c2, c3 if c3 > c4 else c4
    c1, c2 = c1 if c1 > c3 else c3, Z[SHARPEST + col]
    Z[SHARPEST + col] = c1 if c1 > c2 else c2
    weight = (full * weigh(c1, least_sine, most)) * fade(ratio, growth)
    # Mid-lines, twice over: aspect ratio as a fraction, and does the cell limit the step?
    mx, my, nx, ny = ax + ux, ay + uy, bx + rx, by + ry
    m2, n2 = mx * mx + my * my, nx * nx + ny * ny
    longer, shorter = m2 if m2 > n2 else n2, n2 if m2 > n2 else m2
    long, short = Z[LONG + col], Z[SHORT + col]
    more = longer * short > long * shorter
    Z[LONG + col], Z[SHORT + col] = longer if more else long, shorter if more else short
    area = (a1 + a3) + (a2 + a4)
    Z[LIMITING + col] = (rate * (m2 + n2)) * (Z[SOUND + col] * Z[SOUND + col]) - area * area
    k1, s1 = corner_slope(pa + pb, i1, lam_c, flat)
    k2, s2 = corner_slope(pu + pb, i2, lam_c, flat)
    k3, s3 = corner_slope(pu + pr, i3, lam_c, flat)
    k4, s4 = corner_slope(pa + pr, i4, lam_c, flat)
    k1, k2, k3, k4 = k1 * (weight * h1), k2 * (weight * h2), k3 * (weight * h3), k4 * (weight * h4)
    w = weight * (ga * ga)
    t = (w + w) * (i1 + i4)
    Z[LOW_Q + col] = w * (s1 * pb + s4 * pr)
    Z[LOW_X + col] = t * ax + (k1 * by + k4 * ry)
    Z[LOW_Y + col] = t * ay - (k1 * bx + k4 * rx)
    w = weight * (gu * gu)
    t = (w + w) * (i2 + i3)
    Z[UP_Q + col] = w * (s2 * pb + s3 * pr)
    Z[UP_X + col] = t * ux + (k2 * by + k3 * ry)
    Z[UP_Y + col] = t * uy - (k2 * bx + k3 * rx)
    w, q = weight * (gb * gb), Z[NEAR_Q + col]
    t = (w + w) * (i1 + i2)
    Z[SIDE_Q + col] = (q + Z[RIGHT_Q + col]) + w * (s1 * pa + s2 * pu)
    Z[SIDE_X + col] = (q * bx + Z[RIGHT_X + col]) + (t * bx - (k1 * ay + k2 * uy))
    Z[SIDE_Y + col] = (q * by + Z[RIGHT_Y + col]) + (t * by + (k1 * ax + k2 * ux))
    w = weight * (gr * gr)
    t = (w + w) * (i3 + i4)
    Z[RIGHT_Q + col] = w * (s3 * pu + s4 * pa)
    Z[RIGHT_X + col] = t * rx - (k4 * ay + k3 * uy)
    Z[RIGHT_Y + col] = t * ry + (k4 * ax + k3 * ux)


@kernel(allocates=False)
def take_row_of_cells(numbers, count, Z):
    """`take_cell` for the first `count` cells."""
    for col in range(count):
        take_cell(col, numbers, Z)


@inlined
def take_cells(old, i, law, bent, low, cells, Z):
    """`take_cell` for row i of cells.

    Whole vectors of columns, as in `add_row`: what lies behind the last cell stays by itself.
    """
    ni, nj, high = old.shape[1] - 1, old.shape[2] - 1, low + cells + 1
    fill_areas(
        old[0, i, low:high], old[1, i, low:high], old[0, i + 1, low:high], old[1, i + 1, low:high],
        OLD_1, cells, Z,
    )  # fmt: skip
    if bent:
        measure_old(old[0, i, low:high], old[1, i, low:high], cells, Z)
    if i == 0 or i == ni - 1:
        if low == 0:
            Z[OLD_1 if i == 0 else OLD_4] = OWN
        if low + cells == nj:
            Z[(OLD_2 if i == 0 else OLD_3) + cells - 1] = OWN
    with_cost = law.cost_weight > 0.0
    if with_cost:
        sound = law.sound[i, low : low + cells]
        for col in range(cells):
            Z[SOUND + col] = sound[col]
    numbers = (
        0.25 * law.sigma * law.epsilon, law.along_i[GROWTH, i], law.least_sine, law.strengthening,
        law.area_weight * law.area_target, law.area_weight / law.area_target, 4.0 * law.cost_scale,
        law.area_target,
    )  # fmt: skip
    take_row_of_cells(numbers, (cells + 7) // 8 * 8, Z)
    if with_cost:
        limiting = 0
        for col in range(cells):
            limiting += 1 if Z[LIMITING + col] > 0.0 else 0
        if limiting > 0:
            add_limiting_shares(law.cost_scale, law.cost_weight * law.sigma, cells, Z)


@kernel(allocates=False)
def measure_old(x, y, cells, Z):
    """Least old corner area and longest old edges by columns, squared, for the way nodes stray."""
    for col in range(cells):
        a1, a2 = Z[OLD_1 + col], Z[OLD_2 + col]
        a3, a4 = Z[OLD_3 + col], Z[OLD_4 + col]
        a1, a3 = a1 if a1 < a2 else a2, a3 if a3 < a4 else a4
        a1, a2 = a1 if a1 < a3 else a3, Z[OLD_AREA + col]
        Z[OLD_AREA + col] = a1 if a1 < a2 else a2
        line = Z[EDGE_X + col] * Z[EDGE_X + col] + Z[EDGE_Y + col] * Z[EDGE_Y + col]
        longest = Z[LONG_LINE + col]
        Z[LONG_LINE + col] = line if line > longest else longest
    measure_old_sides(x, y, cells, Z)


@kernel(allocates=False)
def measure_old_sides(x, y, cells, Z):
    """Longest old edges along j of a row of nodes, squared, by columns."""
    for col in range(cells):
        dx, dy = x[col + 1] - x[col], y[col + 1] - y[col]
        side, longest = dx * dx + dy * dy, Z[LONG_SIDE + col]
        Z[LONG_SIDE + col] = side if side > longest else longest


@kernel(allocates=False)
def add_limiting_shares(scale, weight, cells, Z):
    """What cells that limit the step give along edges: gradient of P, half the trace of its blocks.

    `scale` = 2/R², `weight` = mu sigma: see `cost_slope`.
    """
    for col in range(cells):
        if Z[LIMITING + col] > 0.0:
            ax = 0.5 * (Z[LINE_X + col] + Z[LINE_X + col + 1])
            ay = 0.5 * (Z[LINE_Y + col] + Z[LINE_Y + col + 1])
            bx = 0.5 * (Z[NEAR_X + col] + Z[FAR_X + col])
            by = 0.5 * (Z[NEAR_Y + col] + Z[FAR_Y + col])
            rho = cell_rate(ax, ay, bx, by, Z[SOUND + col], scale)
            first, curve, dax, day, dbx, dby, twice, share, inverse = cost_slope(
                ax, ay, bx, by, rho, Z[SOUND + col], scale, weight
            )
            half, h, both = 0.5 * first, first * twice, (4.0 * share) * inverse
            # half the traces of the blocks AA and BB, a quarter of them for each edge
            stiff_a = h * (both * (bx * bx + by * by) - 2.0) + curve * (dax * dax + day * day)
            stiff_b = h * (both * (ax * ax + ay * ay) - 2.0) + curve * (dbx * dbx + dby * dby)
            stiff_a, stiff_b = 0.125 * stiff_a, 0.125 * stiff_b
            for edge, stiff, dx, dy in (
                (LOW_X, stiff_a, dax, day), (UP_X, stiff_a, dax, day),
                (SIDE_X, stiff_b, dbx, dby), (RIGHT_X, stiff_b, dbx, dby),
            ):  # fmt: skip
                Z[edge + col] += half * dx
                Z[edge + SPAN + col] += half * dy
                Z[edge + 2 * SPAN + col] += stiff


@kernel(allocates=False)
def add_row(cells, Z):
    """Gradient at a row of nodes, one row of the elimination, and its part of the sum.

    Whole vectors of columns: those behind the last inner node are rubbish and stay by themselves.
    """
    for col in range(1, 1 + (cells + 6) // 8 * 8):
        q, last_q = Z[LINE_Q + col], Z[PASSED + col]
        flux_x = q * (Z[LINE_X + col] - Z[TURN_X + col]) + (Z[LOW_X + col] + Z[UP_X + col - 1])
        flux_y = q * (Z[LINE_Y + col] - Z[TURN_Y + col]) + (Z[LOW_Y + col] + Z[UP_Y + col - 1])
        q += Z[LOW_Q + col] + Z[UP_Q + col - 1]
        x = (Z[FLUX_X + col] - flux_x) + (Z[SIDE_X + col - 1] - Z[SIDE_X + col])
        y = (Z[FLUX_Y + col] - flux_y) + (Z[SIDE_Y + col - 1] - Z[SIDE_Y + col])
        Z[WHOLE_X + col] = x
        Z[WHOLE_Y + col] = y
        factor = last_q * Z[PIVOT + col]
        x += factor * Z[PART_X + col]
        y += factor * Z[PART_Y + col]
        pivot = 1.0 / (((last_q + q) + (Z[SIDE_Q + col - 1] + Z[SIDE_Q + col])) - factor * last_q)
        Z[FLUX_X + col] = flux_x
        Z[FLUX_Y + col] = flux_y
        Z[PART_X + col] = x
        Z[PART_Y + col] = y
        Z[PIVOT + col] = pivot
        Z[PASSED + col] = q
        Z[SUM + col] += pivot * (x * x + y * y)


@kernel(allocates=False)
def add_to_stretch(w, cells, Z):
    """The row added last into sums over its stretch of lines, `w` the part of it that lies behind.

    The gradient along the lines through a node (theory R4.13).  Whole vectors of columns, as in
    `add_row`.
    """
    for col in range(1, 1 + (cells + 6) // 8 * 8):
        x, y = 0.5 * Z[WHOLE_X + col], 0.5 * Z[WHOLE_Y + col]
        along_i = x * (Z[PAST_X + col] + Z[LINE_X + col]) + y * (Z[PAST_Y + col] + Z[LINE_Y + col])
        along_j = x * (Z[NEAR_X + col - 1] + Z[NEAR_X + col])
        along_j += y * (Z[NEAR_Y + col - 1] + Z[NEAR_Y + col])
        Z[NEAR_SUM_I + col] += (1.0 - w) * along_i
        Z[NEAR_SUM_J + col] += (1.0 - w) * along_j
        Z[FAR_SUM_I + col] += w * along_i
        Z[FAR_SUM_J + col] += w * along_j


@kernel(allocates=False)
def keep_line_edges(cells, Z):
    """The edges along i taken last, which the next ones are to follow."""
    for col in range(cells):
        Z[PAST_X + col] = Z[LINE_X + col]
        Z[PAST_Y + col] = Z[LINE_Y + col]


@kernel(allocates=False)
def estimate_residual(nodes, old, law, motion, moves, stretches, totals, chunk):
    """Estimate of the residual r·z of `nodes` in a chunk's node columns into `totals` (nj+1).

    `chunk`: its first column and the one after its last, found and scratch.  Into found (5,), for
    all cells that have a corner at these columns, what the names above say; corners are compared
    with those of `old`.  Way strayed: the most that `motion.reach` (nj+1), a distance a column [m],
    is over the old cells' heights there, taken as the column's least area over its longest edge.

    Both grids (2, ni+1, nj+1); where `moves`, `nodes` is written first, row by row, from `old` and
    its sides' motion (`fill_moved_row`).  Columns are inner ones; where lines are not `law.bent`
    nothing strays.  `stretches`: starts, the first node row of each stretch of lines, and the last
    one, and sums (2, stretches + 1, nj+1), which gets the sums over them at these columns
    (`regrid.barrier.coarse_nodes`).
    """
    (starts, sums), (first, last, found, Z) = stretches, chunk
    bent = law.bent
    ni = nodes.shape[1] - 1
    low, cells = first - 1, last - first + 1
    count, stretch = starts.shape[0] - 1, 0
    begin(nodes, low, cells, Z)
    for i in range(-1, ni):
        if moves:
            fill_moved_row(old, i + 1, motion, law.bend, bent, low, cells + 1, nodes)
        take_side_edges(nodes, i + 1, law, low, cells, Z)
        if i < 0:
            continue
        if count > 1:
            keep_line_edges(cells + 1, Z)
        take_line_edges(nodes, i, law, low, cells + 1, Z)
        if bent:
            take_turn(law, i + 1, low, cells + 1, Z)
        if law.curved:
            take_curve(law.curve, i + 1, low, cells + 1, TURN_X, TURN_Y, Z)
        take_cells(old, i, law, bent, low, cells, Z)
        if law.curved:
            take_curve_sides(law.curve, i, low, cells, NEAR_Q, SIDE_X, SIDE_Y, Z)
        add_row(cells, Z)
        if i == 0:
            # These were no inner nodes: only the flux and the coupling to the next row are kept.
            for col in range(1, cells):
                Z[PIVOT + col] = Z[PART_X + col] = Z[PART_Y + col] = Z[SUM + col] = 0.0
                Z[WHOLE_X + col] = Z[WHOLE_Y + col] = 0.0
        if count > 1:
            here, end = starts[stretch], starts[stretch + 1]
            add_to_stretch((i - here) / (end - here), cells, Z)
            if i + 1 == end:
                end_stretch(stretch, low, cells, Z[NEAR_SUM_I:LOOK_ROWS], SPAN, sums)
                stretch += 1
    for col in range(1, cells):
        totals[low + col] = Z[SUM + col]
    found[MOST_SHRUNK], found[LEAST_SCALED], found[STRAYED] = 0.0, NOTHING, 0.0
    found[COSECANT], found[ASPECT] = 0.0, 0.0
    for col in range(cells):
        found[MOST_SHRUNK] = max(found[MOST_SHRUNK], Z[SHRUNK + col])
        found[LEAST_SCALED] = min(found[LEAST_SCALED], Z[LEAST_AREA + col])
        found[COSECANT] = max(found[COSECANT], Z[SHARPEST + col])
        found[ASPECT] = max(found[ASPECT], Z[LONG + col] / Z[SHORT + col])
    if bent:
        measure_old_sides(old[0, ni, low:], old[1, ni, low:], cells, Z)
        for col in range(1, cells):
            longest = max(Z[LONG_LINE + col], Z[LONG_SIDE + col - 1], Z[LONG_SIDE + col])
            height = min(Z[OLD_AREA + col - 1], Z[OLD_AREA + col]) / np.sqrt(longest)
            found[STRAYED] = max(found[STRAYED], motion.reach[low + col] / height)


@inlined
def add_own_corners(nodes, cosecant):
    """The largest squared inverse sine, own corners too; inf where one turns over."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    x, y = nodes
    for corner in range(4):
        i, j = ni if corner >= 2 else 0, nj if corner == 1 or corner == 2 else 0
        k, m = ni - 1 if corner >= 2 else 1, nj - 1 if corner == 1 or corner == 2 else 1
        ax, ay, bx, by = x[k, j] - x[i, j], y[k, j] - y[i, j], x[i, m] - x[i, j], y[i, m] - y[i, j]
        area = ax * by - ay * bx if corner == 0 or corner == 2 else bx * ay - by * ax
        squares = (ax * ax + ay * ay) * (bx * bx + by * by)
        here = squares / (area * area) if area > 0.0 else np.inf
        cosecant = here if here > cosecant else cosecant
    return cosecant


def make_look(parallel):
    """The residual check of a whole block, over its column chunks in turn or on threads."""

    @kernel(parallel=parallel)
    def look(nodes, old, law, motion, moves, stretches, totals, chunks):
        """Estimate of the residual r·z, and marks of triangles at the block's corners.

        `chunks`: their first node columns (chunks + 1), found (chunks, 5) and scratch (chunks,
        LOOK_ROWS or more); found[0] then has what all found.  The sum goes over columns in order.
        """
        columns, found, scratch = chunks
        count = columns.shape[0] - 1
        for c in prange(count):
            estimate_residual(
                nodes, old, law, motion, moves, stretches, totals,
                (columns[c], columns[c + 1], found[c], scratch[c]),
            )  # fmt: skip
        for c in range(1, count):
            found[0, LEAST_SCALED] = min(found[0, LEAST_SCALED], found[c, LEAST_SCALED])
            for k in (MOST_SHRUNK, STRAYED, COSECANT, ASPECT):
                found[0, k] = max(found[0, k], found[c, k])
        found[0, COSECANT] = add_own_corners(nodes, found[0, COSECANT])
        marks = mark_triangles(nodes, scratch[0, :4])
        return add_columns(totals, columns[0], columns[count]), marks

    return look


look_serial = make_look(False)
look_threaded = make_look(True)
