"""Spacings, conditional lengths and family weights, all computed from the four sides of a block.

The functional depends on the boundary only through these.  Every edge has a conditional length and
an interval of the spacing, both interpolated linearly between the two opposite sides (theory R1.2,
R2.3).  The two families of straight lines have weights (theory R4.5).  The sweeps of the paper
interpolate lengths by line number, the Newton step by relative distance (`fill_blends`, theory
R2.4).  Note: exchanging the two families changes the whole grid.  The bend of a side is therefore
measured on smoothed, thinned-out nodes, so that noise in the node spacing on a flat side has no
effect.
"""

from __future__ import annotations

from collections import namedtuple
from typing import NamedTuple

import numpy as np

from shockgrid.regrid.algebraic import prepare_motion
from shockgrid.regrid.barrier.functional import has_cell_terms
from shockgrid.regrid.barrier.tuning import Weights
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.corners import count_turned_corners
from shockgrid.regrid.measure.crossings import search_meeting
from shockgrid.regrid.sides import J_MIN, SIDE_NAMES, compute_area, find_node

# Rows of the laws along i (one column an edge of the sides j_min and j_max) and along j; GROWTH is
# for the workspace alone: up to which length over the shortest one the barrier fades.
LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE, GROWTH = range(5)


class SideLaw(NamedTuple):
    """What the barrier functional knows from the sides (theory R4.1), as kernels take it.

    The laws of the sides `along_i` (5, ni) and `along_j` (5, nj), rows as named above, in m and
    without unit; where lines lie between opposite sides, `blend_i` (ni+1) and `blend_j` (nj+1);
    `bend` (ni+1, nj+1), where `bent` not zero, by how much each line's own spacing law departs from
    the interpolated one,
    `most_bend` (nj+1), the most of it on each line, and the `way` (2, nj+1) that it is a part of,
    from i_min to i_max in m;
    `shares_i` (2, ni, nj+1), `shares_j` (2, ni+1, nj) and `ease` (ni, nj), where a spacing is
    `given`, of its `GivenSpacing`;
    `curve` (2, ni+1, nj+1), the grid in m that lines are drawn to, times its weight, read where
    `curved` (`regrid.algebraic`);
    the weights `ki`, `kj` of the two families of straight lines; `sigma`, the mean area of a cell
    in m²; `area_target`, the mean c of D; for the cost of cells (R4.10) `sound` (ni, nj) in m/s and
    `cost_scale` = 2/R² in s².
    """

    along_i: np.ndarray
    along_j: np.ndarray
    blend_i: np.ndarray
    blend_j: np.ndarray
    bent: bool
    bend: np.ndarray
    most_bend: np.ndarray
    way: np.ndarray
    given: bool
    shares_i: np.ndarray
    shares_j: np.ndarray
    ease: np.ndarray
    curve: np.ndarray
    curved: bool
    ki: float
    kj: float
    sigma: float
    area_target: float
    sound: np.ndarray
    cost_scale: float


# All that the functional knows besides the nodes: the `Weights` as they are in this block, and a
# `SideLaw`.  Flat: loops on threads take no tuple inside another one.
BarrierLaw = namedtuple("BarrierLaw", (*Weights._fields, *SideLaw._fields))  # type: ignore[misc]


COARSE_EDGES = 32  # a side's bend is measured on no more edges than about this many
ADDED_SIDE_BEND = 0.001  # bend that every side is taken to have, so that flat blocks weigh evenly
STRAIGHT_SIDE_BEND = 1e-6  # bend up to which a pair of sides is straight
SHORTEST_CONDITIONAL_LENGTH = 1e-6  # shortest conditional length, relative to the side's mean edge


@kernel
def fill_edge_lengths(x, y, out):
    """Lengths of the edges of the polyline x, y."""
    for k in range(out.shape[0]):
        step_x, step_y = x[k + 1] - x[k], y[k + 1] - y[k]
        out[k] = np.sqrt(step_x * step_x + step_y * step_y)


@kernel
def compute_bend(x, y):
    """Arc over chord less one of a side, on nodes smoothed by (1, 2, 1)/4 and thinned out.

    The nodes kept are the same ones counted from either end.
    """
    last = x.shape[0] - 1
    stride = max(1, last // COARSE_EDGES)
    edges = (last + stride - 1) // stride
    if last % 2 == 1 and edges % 2 == 0:
        edges += 1  # no node lies in the middle of an odd number of edges
    arc = 0.0
    old_x = x[0]
    old_y = y[0]
    for edge in range(1, edges + 1):
        k = edge * last // edges if 2 * edge <= edges else last - (edges - edge) * last // edges
        new_x, new_y = x[k], y[k]
        if k < last:
            new_x = 0.25 * (x[k - 1] + x[k + 1]) + 0.5 * x[k]
            new_y = 0.25 * (y[k - 1] + y[k + 1]) + 0.5 * y[k]
        step_x, step_y = new_x - old_x, new_y - old_y
        arc += np.sqrt(step_x * step_x + step_y * step_y)
        old_x, old_y = new_x, new_y
    chord_x, chord_y = x[last] - x[0], y[last] - y[0]
    chord = max(np.sqrt(chord_x * chord_x + chord_y * chord_y), 1e-3 * arc)
    return arc / chord - 1.0 if arc > 0.0 else 0.0


@kernel
def compute_stiffness(old, sides, stiffest, slow, fast):
    """How much stiffer the matrix takes sharp cells' corners to be than their frozen weights say.

    `stiffest` where the sides of `old` come to `sides` (2, ni+1, nj+1) by less than `slow` cells, 1
    from `fast` cells on: there cells are squeezed step after step and have to open at once.  The
    motion is the farthest node's beyond that of the corners' mean, the cell the mean edge of
    the side where that is least.  Theory R4.18.
    """
    ni, nj = sides.shape[1] - 1, sides.shape[2] - 1
    # the block's own motion: that of its corners
    mean = np.empty(2)
    for k in range(2):
        now = sides[k]
        then = old[k]
        mean[k] = 0.25 * (
            ((now[0, 0] - then[0, 0]) + (now[ni, nj] - then[ni, nj]))
            + ((now[0, nj] - then[0, nj]) + (now[ni, 0] - then[ni, 0]))
        )
    # the farthest node beside it, and the mean edge of the shortest side
    farthest = 0.0
    shortest = np.inf
    for side in range(len(SIDE_NAMES)):
        count = nj if side < J_MIN else ni
        length = 0.0
        last_x, last_y = 0.0, 0.0
        for k in range(count + 1):
            i, j = find_node(side, k, 0, ni, nj)
            x, y = sides[0, i, j], sides[1, i, j]
            way_x, way_y = x - old[0, i, j] - mean[0], y - old[1, i, j] - mean[1]
            farthest = max(farthest, way_x * way_x + way_y * way_y)
            if k > 0:
                length += np.sqrt((x - last_x) * (x - last_x) + (y - last_y) * (y - last_y))
            last_x, last_y = x, y
        if length > 0.0:
            shortest = min(shortest, length / count)
    # 1 below `slow`, 0 from `fast` on (R4.18)
    part = (fast - np.sqrt(farthest) / shortest) / (fast - slow)
    return 1.0 + (stiffest - 1.0) * min(1.0, max(0.0, part))


@kernel
def measure_bends(sides):
    """The larger bend of the sides i_min, i_max, where lines j = const start; of j_min, j_max."""
    x, y = sides
    ni, nj = x.shape[0] - 1, x.shape[1] - 1
    line_x, line_y = np.empty(ni + 1), np.empty(ni + 1)
    bend_i = max(compute_bend(x[0], y[0]), compute_bend(x[ni], y[ni]))
    bend_j = 0.0
    for j in (0, nj):
        for i in range(ni + 1):
            line_x[i], line_y[i] = x[i, j], y[i, j]
        bend_j = max(bend_j, compute_bend(line_x, line_y))
    return bend_i, bend_j


@kernel
def weigh_curves(sides, open_side, closed_side, barrier, half_barrier):
    """Shares of curved lines j = const and i = const, 0 and 0 where a pair of sides is straight.

    And the epsilon that the barrier has at least.  A family whose outer lines close on themselves
    has no share.  Theory R4.16, R4.17; the numbers are those of `Tuning`.
    """
    bend_i, bend_j = measure_bends(sides)
    less = min(bend_i, bend_j)
    more = max(bend_i, bend_j)
    if not less > STRAIGHT_SIDE_BEND:
        return 0.0, 0.0, 0.0
    range_of = open_side - closed_side
    open_i = min(1.0, max(0.0, (1.0 / (1.0 + bend_i) - closed_side) / range_of))
    open_j = min(1.0, max(0.0, (1.0 / (1.0 + bend_j) - closed_side) / range_of))
    # lines j = const start on the sides i_min, i_max and have the shapes of j_min, j_max
    share_i = (bend_i + ADDED_SIDE_BEND) * (bend_i + ADDED_SIDE_BEND) * open_j
    share_j = (bend_j + ADDED_SIDE_BEND) * (bend_j + ADDED_SIDE_BEND) * open_i
    both = share_i + share_j
    if not both > 0.0:
        return 0.0, 0.0, 0.0
    part = max(open_i, open_j)
    weight = part * less / (less + ADDED_SIDE_BEND)
    alike = part * less / more
    alike *= alike
    least = barrier * alike / (alike + half_barrier * half_barrier)
    return weight * share_i / both, weight * share_j / both, least


@kernel
def fill_family_weights(sides, weights):
    """Weights of the two straight-line families, `ki = c_i²/(c_i² + c_j²)`, `kj = 1 - ki`.

    c_i is the larger bend of the sides i_min and i_max, where the lines j = const start.
    Theory R4.5.
    """
    bend_i, bend_j = measure_bends(sides)
    bend_i += ADDED_SIDE_BEND
    bend_j += ADDED_SIDE_BEND
    both = bend_i * bend_i + bend_j * bend_j
    weights[0] = bend_i * bend_i / both
    weights[1] = bend_j * bend_j / both


@kernel
def fill_pair(low, high, laws):
    """Laws between two opposite sides from their edge lengths: value on the first, and change."""
    count = low.shape[0]
    sum_low, sum_high = 0.0, 0.0
    for k in range(count):
        sum_low += low[k]
        sum_high += high[k]
    mean_low, mean_high = sum_low / count, sum_high / count
    mean_low = mean_low if mean_low > 0.0 else mean_high
    mean_high = mean_high if mean_high > 0.0 else mean_low
    for k in range(count):
        first = max(low[k], SHORTEST_CONDITIONAL_LENGTH * mean_low)
        second = max(high[k], SHORTEST_CONDITIONAL_LENGTH * mean_high)
        laws[LENGTH, k] = first
        laws[LENGTH_CHANGE, k] = second - first
        laws[STEP, k] = first / mean_low
        laws[STEP_CHANGE, k] = second / mean_high - first / mean_low


@kernel
def fill_laws(sides, conditional, along_i, along_j, blend_i, blend_j):
    """Laws along i and j of the block with these sides, where its lines lie; its mean cell area.

    `along_i` (5, ni), `along_j` (5, nj), rows as named above; a step of 1 is a uniform law.
    `conditional` 0 gives every edge the same length: [IvanenkoCharakhchyan1988].  `blend_i` (ni+1),
    `blend_j` (nj+1), 0 to 1: the mean of the arc-length laws of the two sides that a line ends on:
    a part of the way, not of the count of lines, so that a side is felt as far into a graded block
    as into an even one.
    """
    x, y = sides
    ni, nj = x.shape[0] - 1, x.shape[1] - 1
    low, high = np.empty(ni), np.empty(ni)
    for i in range(ni):
        step_x, step_y = x[i + 1, 0] - x[i, 0], y[i + 1, 0] - y[i, 0]
        low[i] = np.sqrt(step_x * step_x + step_y * step_y)
        step_x, step_y = x[i + 1, nj] - x[i, nj], y[i + 1, nj] - y[i, nj]
        high[i] = np.sqrt(step_x * step_x + step_y * step_y)
    fill_pair(low, high, along_i)
    fill_mean_law(low, high, blend_i)
    low, high = np.empty(nj), np.empty(nj)
    fill_edge_lengths(x[0], y[0], low)
    fill_edge_lengths(x[ni], y[ni], high)
    fill_pair(low, high, along_j)
    fill_mean_law(low, high, blend_j)
    sigma = abs(compute_area(sides)) / (ni * nj)
    if not conditional:
        for laws in (along_i, along_j):
            for k in range(laws.shape[1]):
                laws[LENGTH, k] = np.sqrt(sigma)
                laws[LENGTH_CHANGE, k] = 0.0
    return sigma


@kernel
def fill_growth(laws, heavier):
    """Mean conditional length of every edge over the shortest of them, towards 1 by `heavier`.

    `heavier` is by how much the family of these edges outweighs the other one, 0 to 1: at a tie
    neither family fades the barrier, and which of the two is taken for the heavier is no matter.
    """
    heavier = max(heavier, 0.0)
    shortest = laws[LENGTH, 0] + 0.5 * laws[LENGTH_CHANGE, 0]
    for k in range(laws.shape[1]):
        laws[GROWTH, k] = laws[LENGTH, k] + 0.5 * laws[LENGTH_CHANGE, k]
        shortest = min(shortest, laws[GROWTH, k])
    for k in range(laws.shape[1]):
        laws[GROWTH, k] = 1.0 + heavier * (laws[GROWTH, k] / shortest - 1.0)


@kernel
def fill_mean_law(low, high, law):
    """Mean of the arc-length laws of two lines with these edges."""
    count = low.shape[0]
    sum_low, sum_high = 0.0, 0.0
    for k in range(count):
        sum_low += low[k]
        sum_high += high[k]
    scale_low = 0.5 / sum_low if sum_low > 0.0 else 0.0
    scale_high = 0.5 / sum_high if sum_high > 0.0 else 0.0
    law[0] = 0.0
    for k in range(count):
        law[k + 1] = law[k] + (low[k] * scale_low + high[k] * scale_high)
    scale = 1.0 / law[count] if law[count] > 0.0 else 0.0
    for k in range(1, count + 1):
        law[k] *= scale
    law[count] = 1.0


@kernel
def compute_mean_area(along_i, along_j, blend_i, blend_j):
    """Mean over the cells of the product of the two conditional lengths at the cell's centre."""
    ni, nj = along_i.shape[1], along_j.shape[1]
    i_flat = 0.0
    i_slope = 0.0
    i_moment = 0.0
    i_both = 0.0
    for i in range(ni):
        u = 0.5 * (blend_i[i] + blend_i[i + 1])
        i_flat += along_i[LENGTH, i]
        i_slope += along_i[LENGTH_CHANGE, i]
        i_moment += along_i[LENGTH, i] * u
        i_both += along_i[LENGTH_CHANGE, i] * u
    total = 0.0
    for j in range(nj):
        v = 0.5 * (blend_j[j] + blend_j[j + 1])
        total += along_j[LENGTH, j] * (i_flat + v * i_slope)
        total += along_j[LENGTH_CHANGE, j] * (i_moment + v * i_both)
    return total / (ni * nj)


@kernel
def compute_limiting_rate(sound, along_i, along_j, blend_i, blend_j, area_target, margin):
    """R [1/s]: `margin` times the largest c (2 (s_i² + s_j²))^½/(area_target s_i s_j) of all cells.

    `sound` (ni, nj) in m/s; laws, and `area_target`, the mean area of a cell over s_i s_j:
    `BarrierLaw`.
    """
    ni, nj = sound.shape
    columns = np.zeros(nj)
    rates = np.zeros(nj)
    for j in range(nj):
        columns[j] = 0.5 * (blend_j[j] + blend_j[j + 1])
    for i in range(ni):
        u = 0.5 * (blend_i[i] + blend_i[i + 1])
        length = along_i[LENGTH, i]
        change = along_i[LENGTH_CHANGE, i]
        row = sound[i]
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
    return margin * np.sqrt(2.0 * most) / area_target


class Block(NamedTuple):
    """What `prepare` finds of a block's sides: the area inside them, corners that they turn over,
    two of their edges that may meet (`search_meeting`), and numbers of a `BarrierLaw`."""

    area: float
    turned: int
    meeting: int
    sigma: float
    area_target: float
    cost_scale: float


@kernel
def prepare(old, law, motion, conditional, limits, check):
    """All that a regrid takes from the sides: laws, the motion of the sides, the checks.

    `law` is a `BarrierLaw` whose arrays are filled, but for curved lines, `motion` a `SideMotion`
    from the grid `old`; `limits`: the margin of R and the least R; `check`: the scratch of
    `search_meeting`.
    """
    sides = motion.sides
    prepare_motion(old, motion, law.most_bend, law.bent)
    along_i = law.along_i
    along_j = law.along_j
    blend_i = law.blend_i
    blend_j = law.blend_j
    sigma = fill_laws(sides, conditional, along_i, along_j, blend_i, blend_j)
    fill_growth(along_i, law.ki - law.kj)
    if law.bent:
        for k in range(2):
            for j in range(sides.shape[2]):
                law.way[k, j] = sides[k, -1, j] - sides[k, 0, j]
    area_target = sigma / compute_mean_area(along_i, along_j, blend_i, blend_j)
    scale = 0.0
    if has_cell_terms(law):
        rate = compute_limiting_rate(
            law.sound, along_i, along_j, blend_i, blend_j, area_target, limits[0]
        )
        rate = max(rate, limits[1])
        scale = 2.0 / (rate * rate) if rate > 0.0 else 0.0
    line, boxes, ways, ends, stack = check
    meeting, _ = search_meeting(sides, line, boxes, ways, ends, stack)
    return Block(
        compute_area(sides), count_turned_corners(sides), meeting, sigma, area_target, scale
    )
