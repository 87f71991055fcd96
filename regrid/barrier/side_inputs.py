"""Spacings, conditional lengths and family weights, all computed from the four sides of a block.

The functional depends on the boundary only through these.  Every edge has a conditional length and
a step of the spacing, both interpolated linearly between the two opposite sides (theory R1.2,
R2.3).  The two families of straight lines have weights (theory R4.5).  The sweeps of the paper
interpolate lengths by line number, the Newton step by relative distance (`fill_mean_spacing`,
theory R2.4).  Note: exchanging the two families changes the whole grid.  How far a side is bent,
its arc over its chord less one, is therefore measured on smoothed, thinned-out nodes, so that noise
in the node spacing on a flat side has no effect.
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

# Rows of the tables of edges along i (one column an edge of the sides j_min and j_max) and along j:
# conditional length and step of the edge on the first of the two sides, and their changes to the
# second.  GROWTH is for the workspace alone: up to which length over the shortest one the barrier
# fades.
LENGTH, LENGTH_CHANGE, STEP, STEP_CHANGE, GROWTH = range(5)


class SideInputs(NamedTuple):
    """What the barrier functional knows from the sides (theory R4.1), as kernels take it.

    `along_i` (5, ni) and `along_j` (5, nj): tables of edges, rows as named above, lengths in m;
    `blend_i` (ni+1) and `blend_j` (nj+1): where lines lie between opposite sides, from 0 to 1;
    `departs`: whether lines j = const have spacings other than the sides'; `spacing_departure`
    (ni+1, nj+1), by how much, `most_departure` (nj+1), the most of it on each line, and `chords`
    (2, nj+1), the lines' ways from i_min to i_max in m, of which it is a part;
    `keeps_spacing`: whether the spacing of a first grid is kept; `shares_i` (2, ni, nj+1),
    `shares_j` (2, ni+1, nj) and `ease` (ni, nj) are then those of its `GivenSpacing`;
    `curve` (2, ni+1, nj+1): the grid in m that lines are drawn to, times its weight, read where
    `curved` (`regrid.algebraic`);
    `ki`, `kj`: weights of the two families of straight lines; `sigma`: the mean area of a cell in
    m²; `area_target`: the mean c of D; for the cost of cells (R4.10) `sound` (ni, nj) in m/s and
    `cost_scale` = 2/R² in s².
    """

    along_i: np.ndarray
    along_j: np.ndarray
    blend_i: np.ndarray
    blend_j: np.ndarray
    departs: bool
    spacing_departure: np.ndarray
    most_departure: np.ndarray
    chords: np.ndarray
    keeps_spacing: bool
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


# All that the functional knows besides the nodes: the `Weights` as they are in this block, and
# `SideInputs`.  Flat: loops on threads take no tuple inside another one.
BarrierInputs = namedtuple(  # type: ignore[misc]
    "BarrierInputs", (*Weights._fields, *SideInputs._fields)
)


COARSE_EDGES = 32  # a side's arc is measured on no more edges than about this many
# arc excess that every side is taken to have, so that flat blocks weigh evenly
ADDED_ARC_EXCESS = 0.001
STRAIGHT_ARC_EXCESS = 1e-6  # up to which a pair of sides is straight
LEAST_CHORD = 1e-3  # over the arc, of a side that nearly closes
SHORTEST_CONDITIONAL_LENGTH = 1e-6  # shortest conditional length, relative to the side's mean edge


@kernel
def fill_edge_lengths(x, y, out):
    """Lengths of the edges of the polyline x, y."""
    for k in range(out.shape[0]):
        step_x, step_y = x[k + 1] - x[k], y[k + 1] - y[k]
        out[k] = np.sqrt(step_x * step_x + step_y * step_y)


@kernel
def compute_arc_excess(x, y):
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
    chord = max(np.sqrt(chord_x * chord_x + chord_y * chord_y), LEAST_CHORD * arc)
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
        new_values = sides[k]
        old_values = old[k]
        mean[k] = 0.25 * (
            ((new_values[0, 0] - old_values[0, 0]) + (new_values[ni, nj] - old_values[ni, nj]))
            + ((new_values[0, nj] - old_values[0, nj]) + (new_values[ni, 0] - old_values[ni, 0]))
        )
    # the node that moves farthest beyond it, and the mean edge of the shortest side
    farthest_square = 0.0
    shortest = np.inf
    for side in range(len(SIDE_NAMES)):
        count = nj if side < J_MIN else ni
        length = 0.0
        last_x, last_y = 0.0, 0.0
        for k in range(count + 1):
            i, j = find_node(side, k, 0, ni, nj)
            x, y = sides[0, i, j], sides[1, i, j]
            move_x, move_y = x - old[0, i, j] - mean[0], y - old[1, i, j] - mean[1]
            farthest_square = max(farthest_square, move_x * move_x + move_y * move_y)
            if k > 0:
                length += np.sqrt((x - last_x) * (x - last_x) + (y - last_y) * (y - last_y))
            last_x, last_y = x, y
        if length > 0.0:
            shortest = min(shortest, length / count)
    # 1 below `slow`, 0 from `fast` on (R4.18)
    stiff_part = (fast - np.sqrt(farthest_square) / shortest) / (fast - slow)
    return 1.0 + (stiffest - 1.0) * min(1.0, max(0.0, stiff_part))


@kernel
def measure_arc_excesses(sides):
    """The larger arc excess of i_min and i_max, where lines j = const start; of j_min and j_max."""
    x, y = sides
    ni, nj = x.shape[0] - 1, x.shape[1] - 1
    line_x, line_y = np.empty(ni + 1), np.empty(ni + 1)
    excess_i = max(compute_arc_excess(x[0], y[0]), compute_arc_excess(x[ni], y[ni]))
    excess_j = 0.0
    for j in (0, nj):
        for i in range(ni + 1):
            line_x[i], line_y[i] = x[i, j], y[i, j]
        excess_j = max(excess_j, compute_arc_excess(line_x, line_y))
    return excess_i, excess_j


@kernel
def weigh_curves(sides, open_side, closed_side, barrier, half_barrier):
    """Shares of curved lines j = const and i = const, 0 and 0 where a pair of sides is straight.

    And the epsilon that the barrier has at least.  A family whose outer lines close on themselves
    has no share.  Theory R4.16, R4.17; the numbers are those of `Tuning`.
    """
    excess_i, excess_j = measure_arc_excesses(sides)
    smaller_excess = min(excess_i, excess_j)
    larger_excess = max(excess_i, excess_j)
    if not smaller_excess > STRAIGHT_ARC_EXCESS:
        return 0.0, 0.0, 0.0
    # how open the sides are: 1 from the chord over arc `open_side` on, 0 up to `closed_side`
    width = open_side - closed_side
    open_i = min(1.0, max(0.0, (1.0 / (1.0 + excess_i) - closed_side) / width))
    open_j = min(1.0, max(0.0, (1.0 / (1.0 + excess_j) - closed_side) / width))
    # lines j = const start on the sides i_min, i_max and have the shapes of j_min, j_max
    share_i = (excess_i + ADDED_ARC_EXCESS) * (excess_i + ADDED_ARC_EXCESS) * open_j
    share_j = (excess_j + ADDED_ARC_EXCESS) * (excess_j + ADDED_ARC_EXCESS) * open_i
    both = share_i + share_j
    if not both > 0.0:
        return 0.0, 0.0, 0.0
    most_open = max(open_i, open_j)
    weight = most_open * smaller_excess / (smaller_excess + ADDED_ARC_EXCESS)
    # the barrier, by how much alike the two pairs bend
    likeness = most_open * smaller_excess / larger_excess
    likeness *= likeness
    least_epsilon = barrier * likeness / (likeness + half_barrier * half_barrier)
    return weight * share_i / both, weight * share_j / both, least_epsilon


@kernel
def fill_family_weights(sides, weights):
    """Weights of the two straight-line families, `ki = c_i²/(c_i² + c_j²)`, `kj = 1 - ki`.

    c_i is the larger arc excess of the sides i_min and i_max, where the lines j = const start.
    Theory R4.5.
    """
    excess_i, excess_j = measure_arc_excesses(sides)
    excess_i += ADDED_ARC_EXCESS
    excess_j += ADDED_ARC_EXCESS
    both = excess_i * excess_i + excess_j * excess_j
    weights[0] = excess_i * excess_i / both
    weights[1] = excess_j * excess_j / both


@kernel
def fill_edge_table(low, high, table):
    """Conditional lengths and steps of the edges between two opposite sides, from their edges.

    `low`, `high`: edge lengths on the two sides; `table`: rows as named above.
    """
    count = low.shape[0]
    sum_low, sum_high = 0.0, 0.0
    for k in range(count):
        sum_low += low[k]
        sum_high += high[k]
    mean_low, mean_high = sum_low / count, sum_high / count
    mean_low = mean_low if mean_low > 0.0 else mean_high
    mean_high = mean_high if mean_high > 0.0 else mean_low
    for k in range(count):
        first_length = max(low[k], SHORTEST_CONDITIONAL_LENGTH * mean_low)
        second_length = max(high[k], SHORTEST_CONDITIONAL_LENGTH * mean_high)
        table[LENGTH, k] = first_length
        table[LENGTH_CHANGE, k] = second_length - first_length
        table[STEP, k] = first_length / mean_low
        table[STEP_CHANGE, k] = second_length / mean_high - first_length / mean_low


@kernel
def fill_spacings(sides, conditional, along_i, along_j, blend_i, blend_j):
    """Tables of the edges of a block with these sides, where its lines lie; its mean cell area.

    `along_i` (5, ni), `along_j` (5, nj), rows as named above; a step of 1 is a uniform spacing.
    `conditional` 0 gives every edge the same length: [IvanenkoCharakhchyan1988].  `blend_i` (ni+1),
    `blend_j` (nj+1), 0 to 1: the mean of the arc-length spacings of the two sides that a line ends
    on: a part of the distance, not of the count of lines, so that a side is felt as far into a
    graded block as into an even one.
    """
    x, y = sides
    ni, nj = x.shape[0] - 1, x.shape[1] - 1
    # edges along i, of the sides j_min and j_max
    low, high = np.empty(ni), np.empty(ni)
    for i in range(ni):
        step_x, step_y = x[i + 1, 0] - x[i, 0], y[i + 1, 0] - y[i, 0]
        low[i] = np.sqrt(step_x * step_x + step_y * step_y)
        step_x, step_y = x[i + 1, nj] - x[i, nj], y[i + 1, nj] - y[i, nj]
        high[i] = np.sqrt(step_x * step_x + step_y * step_y)
    fill_edge_table(low, high, along_i)
    fill_mean_spacing(low, high, blend_i)
    # edges along j, of the sides i_min and i_max
    low, high = np.empty(nj), np.empty(nj)
    fill_edge_lengths(x[0], y[0], low)
    fill_edge_lengths(x[ni], y[ni], high)
    fill_edge_table(low, high, along_j)
    fill_mean_spacing(low, high, blend_j)
    sigma = abs(compute_area(sides)) / (ni * nj)
    if not conditional:
        for table in (along_i, along_j):
            for k in range(table.shape[1]):
                table[LENGTH, k] = np.sqrt(sigma)
                table[LENGTH_CHANGE, k] = 0.0
    return sigma


@kernel
def fill_growth(table, heavier):
    """Mean conditional length of every edge over the shortest of them, towards 1 by `heavier`.

    `heavier` is by how much the family of these edges outweighs the other one, 0 to 1: at a tie
    neither family fades the barrier, and which of the two is taken for the heavier is no matter.
    """
    heavier = max(heavier, 0.0)
    shortest = table[LENGTH, 0] + 0.5 * table[LENGTH_CHANGE, 0]
    for k in range(table.shape[1]):
        table[GROWTH, k] = table[LENGTH, k] + 0.5 * table[LENGTH_CHANGE, k]
        shortest = min(shortest, table[GROWTH, k])
    for k in range(table.shape[1]):
        table[GROWTH, k] = 1.0 + heavier * (table[GROWTH, k] / shortest - 1.0)


@kernel
def fill_mean_spacing(low, high, spacing):
    """Mean of the arc-length spacings of two lines with these edges, from 0 to 1."""
    count = low.shape[0]
    sum_low, sum_high = 0.0, 0.0
    for k in range(count):
        sum_low += low[k]
        sum_high += high[k]
    scale_low = 0.5 / sum_low if sum_low > 0.0 else 0.0
    scale_high = 0.5 / sum_high if sum_high > 0.0 else 0.0
    spacing[0] = 0.0
    for k in range(count):
        spacing[k + 1] = spacing[k] + (low[k] * scale_low + high[k] * scale_high)
    scale = 1.0 / spacing[count] if spacing[count] > 0.0 else 0.0
    for k in range(1, count + 1):
        spacing[k] *= scale
    spacing[count] = 1.0


@kernel
def compute_mean_area(along_i, along_j, blend_i, blend_j):
    """Mean over the cells of the product of the two conditional lengths at the cell's centre."""
    ni, nj = along_i.shape[1], along_j.shape[1]
    # sums over i, so that a sum over j is left: lengths, changes, and both times the blend
    sum_length = 0.0
    sum_change = 0.0
    sum_length_blend = 0.0
    sum_change_blend = 0.0
    for i in range(ni):
        u = 0.5 * (blend_i[i] + blend_i[i + 1])
        sum_length += along_i[LENGTH, i]
        sum_change += along_i[LENGTH_CHANGE, i]
        sum_length_blend += along_i[LENGTH, i] * u
        sum_change_blend += along_i[LENGTH_CHANGE, i] * u
    total = 0.0
    for j in range(nj):
        v = 0.5 * (blend_j[j] + blend_j[j + 1])
        total += along_j[LENGTH, j] * (sum_length + v * sum_change)
        total += along_j[LENGTH_CHANGE, j] * (sum_length_blend + v * sum_change_blend)
    return total / (ni * nj)


@kernel
def compute_limiting_rate(sound, along_i, along_j, blend_i, blend_j, area_target, margin):
    """R [1/s]: `margin` times the largest c (2 (s_i² + s_j²))^½/(area_target s_i s_j) of all cells.

    `sound` (ni, nj) in m/s; the tables of edges, and `area_target`, the mean area of a cell over
    s_i s_j, as in `BarrierInputs`.
    """
    ni, nj = sound.shape
    places_j = np.zeros(nj)
    rates = np.zeros(nj)
    for j in range(nj):
        places_j[j] = 0.5 * (blend_j[j] + blend_j[j + 1])
    for i in range(ni):
        place_i = 0.5 * (blend_i[i] + blend_i[i + 1])
        length = along_i[LENGTH, i]
        change = along_i[LENGTH_CHANGE, i]
        sound_row = sound[i]
        # the largest of each column: a single one would keep the loop from the vectoriser
        for j in range(nj):
            s_i = length + places_j[j] * change
            s_j = along_j[LENGTH, j] + place_i * along_j[LENGTH_CHANGE, j]
            ratio = sound_row[j] / (s_i * s_j)
            square = (s_i * s_i + s_j * s_j) * (ratio * ratio)
            rates[j] = square if square > rates[j] else rates[j]
    most = 0.0
    for j in range(nj):
        most = rates[j] if rates[j] > most else most
    return margin * np.sqrt(2.0 * most) / area_target


class SideNumbers(NamedTuple):
    """Numbers that `prepare` finds of a block's sides.

    The `area` inside them, the number of corners that they turn over, two of their edges that may
    meet (`search_meeting`), and numbers of `BarrierInputs`.
    """

    area: float
    turned_corners: int
    meeting: int
    sigma: float
    area_target: float
    cost_scale: float


@kernel
def prepare(old, inputs, motion, conditional, rate_limits, check):
    """All that a regrid takes from the sides: spacings, the motion of the sides, the checks.

    `inputs` are `BarrierInputs` whose arrays are filled, but for curved lines, `motion` is a
    `SideMotion` from the grid `old`; `rate_limits`: the margin of R and the least R; `check`: the
    scratch of `search_meeting`.
    """
    sides = motion.sides
    prepare_motion(old, motion, inputs.most_departure, inputs.departs)
    along_i = inputs.along_i
    along_j = inputs.along_j
    blend_i = inputs.blend_i
    blend_j = inputs.blend_j
    # spacings and mean areas
    sigma = fill_spacings(sides, conditional, along_i, along_j, blend_i, blend_j)
    fill_growth(along_i, inputs.ki - inputs.kj)
    if inputs.departs:
        for k in range(2):
            for j in range(sides.shape[2]):
                inputs.chords[k, j] = sides[k, -1, j] - sides[k, 0, j]
    area_target = sigma / compute_mean_area(along_i, along_j, blend_i, blend_j)
    # the rate of cells that limit the time step
    cost_scale = 0.0
    if has_cell_terms(inputs):
        margin, least_rate = rate_limits
        rate = compute_limiting_rate(
            inputs.sound, along_i, along_j, blend_i, blend_j, area_target, margin
        )
        rate = max(rate, least_rate)
        cost_scale = 2.0 / (rate * rate) if rate > 0.0 else 0.0
    # do the sides meet?
    line, boxes, half_planes, ends, stack = check
    meeting, _ = search_meeting(sides, line, boxes, half_planes, ends, stack)
    turned_corners = count_turned_corners(sides)
    area = compute_area(sides)
    return SideNumbers(area, turned_corners, meeting, sigma, area_target, cost_scale)
