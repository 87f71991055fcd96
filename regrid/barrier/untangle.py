"""Untangling: the barrier with a smoothed denominator, sharpened until every corner is positive.

    phi_chi = (|a|² + |b|²)/chi(D),   chi(D) = ½ (D + sqrt(D² + e²))

has no pole, so the minimisation may start from a folded grid.  As e decreases, the minimiser
unfolds (theory R5.1, after [Garanzha1999]).  Steps are Newton steps with backtracking on the energy
at fixed e.  Note: the barrier must outweigh the straight-line terms while cells are folded, so it
has its greatest weight everywhere.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from shockgrid.regrid.barrier.assembly import (
    ASSEMBLY_ROWS,
    FADING_ROW,
    FAR_EDGE_X,
    FAR_EDGE_Y,
    FAR_Q,
    LINE_FORCE_X,
    LINE_FORCE_Y,
    LINE_Q,
    begin_block,
    ease_row,
    fill_fading,
    fill_row_edges,
    store_block,
    take_block,
    take_scaled_edges,
)
from shockgrid.regrid.barrier.functional import (
    cell_value,
    corner_value,
    find_least,
    find_mid_lines,
    has_cell_terms,
    prepare_corners,
    smooth_area,
    take_cell_coefficients,
    take_corner_coefficients,
    take_corner_weight,
    without_cell_terms,
)
from shockgrid.regrid.barrier.side_inputs import GROWTH, LENGTH, LENGTH_CHANGE, STEP_CHANGE
from shockgrid.regrid.barrier.step_control import CHUNK_SPAN, NO_LIMIT
from shockgrid.regrid.barrier.tuning import DEFAULT, Tuning
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.quality import take_edges
from shockgrid.regrid.sides import copy_sides

FIRST_SPREAD_PART = 0.2  # e of the first step, over the worst D
LEAST_SPREAD = 1e-6  # of e where the grid needs no long way to unfold
LEAST_FREE_SPREAD = 1e-10  # of e where nothing near is known of the grid (R5.4)
LEAST_GAIN = 0.1  # of the energy in a step, in the formula for e (R5.2)
UNTANGLING_ITERATIONS = 16  # of the linear solve of a step of (R5.2)
FREE_ITERATIONS = 200  # of one of (R5.4)
# steps of (R5.4) at one e, which end when a step gains less
ROUND_STEPS = 8
ROUND_GAIN = 0.02
MOST_STEP_HALVINGS_AT_SPREAD = 12
WIDE_SPREAD_FACTOR = 10.0  # e over the worst D of a nearly harmonic map
# Scratch behind that of the assembly: values and D of the corners, and sums of the columns.
VALUE_1, VALUE_2, VALUE_3, VALUE_4 = (ASSEMBLY_ROWS + k * CHUNK_SPAN for k in range(4))
AREA_1, AREA_2, AREA_3, AREA_4 = (ASSEMBLY_ROWS + k * CHUNK_SPAN for k in range(4, 8))
ENERGY_ROW = ASSEMBLY_ROWS + 8 * CHUNK_SPAN
LEAST_AREA_ROW = ASSEMBLY_ROWS + 9 * CHUNK_SPAN
ENERGY_SIZE = ASSEMBLY_ROWS + 10 * CHUNK_SPAN


@inlined
def fill_corner_values(coefficients, spread, cells, Z):
    """Smoothed values and D of the four corners of a row of cells, by `CornerCoefficients`."""
    e2 = spread * spread
    for col in range(cells):
        areas, squares = prepare_corners(*take_scaled_edges(col, Z))
        store_block(areas, AREA_1, col, Z)
        d1, d2, d3, d4 = areas
        low, up, near, far = squares
        values = (
            corner_value(low + near, smooth_area(d1, e2)[0], coefficients),
            corner_value(up + near, smooth_area(d2, e2)[0], coefficients),
            corner_value(up + far, smooth_area(d3, e2)[0], coefficients),
            corner_value(low + far, smooth_area(d4, e2)[0], coefficients),
        )
        store_block(values, VALUE_1, col, Z)


@inlined
def drop_block_corners(i, first, last, shape, Z):
    """Leave the block's own corners out in row i of the cells of columns first..last-1."""
    ni, nj = shape
    if i == 0 or i == ni - 1:
        if first == 0:
            corner = 0 if i == 0 else 3 * CHUNK_SPAN
            Z[VALUE_1 + corner] = 0.0
            Z[AREA_1 + corner] = NO_LIMIT
        if last == nj:
            corner = (CHUNK_SPAN if i == 0 else 2 * CHUNK_SPAN) + last - first - 1
            Z[VALUE_1 + corner] = 0.0
            Z[AREA_1 + corner] = NO_LIMIT


@inlined
def add_line_energy(col, is_inside, Z):
    """Energy of the straight lines of a cell: its low edge and, where `is_inside`, its far one.

    The force F along i is q times the edge's departure, so that F²/q is the energy.
    """
    force_x, force_y = Z[LINE_FORCE_X + col], Z[LINE_FORCE_Y + col]
    edge_x, edge_y = Z[FAR_EDGE_X + col], Z[FAR_EDGE_Y + col]
    force_square = force_x * force_x + force_y * force_y
    edge_square = edge_x * edge_x + edge_y * edge_y
    line = force_square / Z[LINE_Q + col] if Z[LINE_Q + col] > 0.0 else 0.0
    return 0.5 * (line + is_inside * Z[FAR_Q + col] * edge_square)


@inlined
def add_row_energy(weight, barrier_row, is_inside, cells, Z):
    """Add the energy of a row of cells to that of its columns, and keep the least D of each.

    `weight`: that of a corner; `barrier_row`: e_c/epsilon of the cells; `is_inside`: 1.0 if the
    second row of nodes is not a side, else 0.0.
    """
    for col in range(cells):
        value_1, value_2, value_3, value_4 = take_block(Z, VALUE_1, col)
        corners = (value_1 + value_2) + (value_3 + value_4)
        corners *= Z[FADING_ROW + col]
        lines = add_line_energy(col, is_inside, Z)
        Z[ENERGY_ROW + col] += (weight * barrier_row[col]) * corners + lines
        area_1, area_2, area_3, area_4 = take_block(Z, AREA_1, col)
        area = find_least(area_1, area_2, area_3, area_4)
        least = Z[LEAST_AREA_ROW + col]
        Z[LEAST_AREA_ROW + col] = area if area < least else least


@inlined
def add_cell_values(nodes, i, inputs, first, cells, Z):
    """Add the values of the terms of cells in row i to the energy of its columns."""
    coefficients = take_cell_coefficients(inputs)
    x0 = nodes[0, i]
    y0 = nodes[1, i]
    x1 = nodes[0, i + 1]
    y1 = nodes[1, i + 1]
    for col in range(cells):
        j = first + col
        low, up, near, far = take_edges(x0, y0, x1, y1, j)
        a, b = find_mid_lines(low, up, near, far)
        Z[ENERGY_ROW + col] += cell_value(a, b, inputs.sound[i, j], coefficients)


@kernel
def fill_energy(nodes, inputs, spread, barrier, first, last, Z):
    """Smoothed energy and least scaled corner area of columns, in ENERGY_ROW and LEAST_AREA_ROW.

    `barrier` (ni, nj) is e_c/epsilon of the cells; at `spread` 0 the energy is that of convex
    grids, J itself.  Cells of columns first..last-1; the block's own corners are left out.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    cells = last - first
    coefficients = take_corner_coefficients(inputs)
    weight = take_corner_weight(inputs)
    for col in range(cells):
        Z[ENERGY_ROW + col] = 0.0
        Z[LEAST_AREA_ROW + col] = NO_LIMIT
    begin_block(nodes, inputs, first, cells, Z)
    for i in range(ni):
        fill_row_edges(nodes, i, inputs, first, cells, Z)
        fill_corner_values(coefficients, spread, cells, Z)
        drop_block_corners(i, first, last, (ni, nj), Z)
        fill_fading(inputs.along_i[GROWTH, i], cells, Z)
        if inputs.keeps_spacing:
            ease_row(inputs.ease, i, first, cells, Z)
        is_inside = 1.0 if i < ni - 1 else 0.0
        add_row_energy(weight, barrier[i, first:last], is_inside, cells, Z)
        if spread == 0.0 and has_cell_terms(inputs):
            add_cell_values(nodes, i, inputs, first, cells, Z)


class StoppingCriterion(NamedTuple):
    """When the linear solve of a step ends: its residual over the first, and most iterations."""

    tolerance: float
    iterations: int


class Step(NamedTuple):
    """A Newton step at fixed e: the fraction taken, energy and least scaled area after it."""

    fraction: float
    energy: float
    least_area: float


def untangle(work, nodes, tuning: Tuning = DEFAULT) -> bool:
    """Unfold `nodes`, an array of the workspace, in place; True when all corners are positive."""
    inputs = work.inputs
    criterion = StoppingCriterion(tuning.untangle_tolerance, UNTANGLING_ITERATIONS)
    work.inputs = inputs._replace(epsilon=tuning.untangle_barrier * inputs.epsilon)
    last_spread = _lower_spread(work, nodes, 1, LEAST_SPREAD, tuning.untangle_steps, criterion)
    # more steps open what is sharp; none may halve the least scaled area
    if last_spread is not None:
        for factor in tuning.last_spreads:
            spread = factor * work.area_target
            energy, least_area = work.compute_energy(nodes, spread)
            _step(work, nodes, spread, energy, criterion, 0.5 * least_area)
    work.inputs = inputs
    return last_spread is not None


class Unfolding(Enum):
    """How a grid is unfolded that is far from any known one (theory R5.4).

    STRAIGHT: with straight lines, by `untangle`; GRADED: without them, every edge with the length
    that the sides ask for; EVEN: with two lengths for all.  GRADED_SPREAD and EVEN_SPREAD begin
    with a nearly harmonic map.
    """

    STRAIGHT = 0
    GRADED_SPREAD = 1
    GRADED = 2
    EVEN = 3
    EVEN_SPREAD = 4


def unfold(work, nodes, tuning: Tuning, unfolding: Unfolding) -> bool:
    """Unfold `nodes` (2, ni+1, nj+1) in place, their sides set first; True where that is done."""
    copy_sides(work.sides, nodes)
    if unfolding is Unfolding.STRAIGHT:
        return untangle(work, nodes, tuning)
    # the functional without straight lines
    inputs = work.inputs
    area_target = work.area_target
    graded = unfolding in (Unfolding.GRADED, Unfolding.GRADED_SPREAD)
    work.inputs = make_graded_inputs(work) if graded else make_even_inputs(work)
    work.area_target = 1.0
    criterion = StoppingCriterion(tuning.exact_tolerance, FREE_ITERATIONS)
    # a nearly harmonic map at first
    if unfolding in (Unfolding.GRADED_SPREAD, Unfolding.EVEN_SPREAD):
        spread = WIDE_SPREAD_FACTOR * max(1.0, -work.compute_least_area(nodes))
        energy = work.compute_energy(nodes, spread)[0]
        for _ in range(ROUND_STEPS):
            energy = _step(work, nodes, spread, energy, criterion).energy
    last_spread = _lower_spread(
        work, nodes, ROUND_STEPS, LEAST_FREE_SPREAD, tuning.free_steps, criterion
    )
    work.inputs = inputs
    work.area_target = area_target
    return last_spread is not None


def make_even_inputs(work):
    """The inputs of (R5.4): two lengths for the whole block, no straight lines, a mean D of 1."""
    mean_edges = [
        sum(np.hypot(*np.diff(side, axis=1)).sum() for side in sides) / count
        for sides, count in (
            ((work.sides[:, :, 0], work.sides[:, :, -1]), work.ni),
            ((work.sides[:, 0], work.sides[:, -1]), work.nj),
        )
    ]
    scale = np.sqrt(work.sigma / (mean_edges[0] * mean_edges[1]))
    along = [np.ones_like(work.along_i), np.ones_like(work.along_j)]
    for table, length in zip(along, mean_edges, strict=True):
        table[LENGTH] = scale * length
        table[[LENGTH_CHANGE, STEP_CHANGE]] = 0.0
    return without_cell_terms(work.inputs)._replace(
        along_i=along[0], along_j=along[1], ki=0.0, kj=0.0, curved=False, keeps_spacing=False,
        area_target=1.0, epsilon=1.0, area_weight=1.0,
    )  # fmt: skip


def make_graded_inputs(work):
    """The same with the conditional lengths of all edges, scaled so that D is 1 in the mean."""
    scale = np.sqrt(work.inputs.area_target)
    along = [np.array(table) for table in (work.along_i, work.along_j)]
    for table in along:
        table[[LENGTH, LENGTH_CHANGE]] *= scale
        table[GROWTH] = 1.0
    return without_cell_terms(work.inputs)._replace(
        along_i=along[0], along_j=along[1], ki=0.0, kj=0.0, curved=False, departs=False,
        area_target=1.0, epsilon=1.0, area_weight=1.0,
    )  # fmt: skip


def _lower_spread(
    work,
    nodes,
    round_steps: int,
    least_spread: float,
    most_steps: int,
    criterion: StoppingCriterion,
) -> float | None:
    """Steps at falling e until `nodes` has no fold: the last e, or None where one stays."""
    least_area = work.compute_least_area(nodes)
    if not np.isfinite(least_area):
        return None
    spread = float(np.hypot(least_spread, FIRST_SPREAD_PART * min(least_area, 0.0)))
    steps = 0
    while least_area <= 0.0:
        # a round of steps at one e
        first_energy, _ = work.compute_energy(nodes, spread)
        energy = first_energy
        for _ in range(round_steps):
            if steps == most_steps:
                return None
            energy_before = energy
            fraction, energy, least_area = _step(work, nodes, spread, energy_before, criterion)
            steps += 1
            settled = energy > (1.0 - ROUND_GAIN) * energy_before
            if least_area > 0.0 or fraction == 0.0 or settled:
                break
        # the next e (R5.2)
        if least_area <= 0.0:
            if energy == first_energy and spread <= least_spread:
                return None
            gain = max(LEAST_GAIN, 1.0 - energy / first_energy)
            spread = max(least_spread, _choose_next_spread(spread, least_area, gain))
    return spread


def _choose_next_spread(spread: float, least_area: float, gain: float) -> float:
    """The e that follows `spread` where the energy fell by the part `gain` (R5.2)."""
    chi = 0.5 * (least_area + np.hypot(least_area, spread))
    if least_area < 0.0:
        chi = 0.5 * spread**2 / (np.hypot(least_area, spread) - least_area)
    mu = (1.0 - gain) * chi
    return 2.0 * float(np.sqrt(mu * (mu - least_area)))


def _step(
    work,
    nodes,
    spread: float,
    energy_before: float,
    criterion: StoppingCriterion,
    floor: float = -np.inf,
) -> Step:
    """One Newton step on the smoothed functional, halved until its energy falls.

    The least scaled corner area after it must not be below `floor`.
    """
    work.assemble_smoothed(nodes, spread)
    work.solve(tolerance=criterion.tolerance, floor=0.0, most=criterion.iterations)
    fraction = 1.0
    trial = work.trial
    for _ in range(MOST_STEP_HALVINGS_AT_SPREAD):
        np.multiply(work.change, fraction, out=trial)
        trial += nodes
        energy, least_area = work.compute_energy(trial, spread)
        if energy < energy_before and least_area >= floor:
            nodes[:] = trial
            return Step(fraction, energy, least_area)
        fraction *= 0.5
    return Step(0.0, *work.compute_energy(nodes, spread))
