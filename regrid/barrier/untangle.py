"""Untangling: the barrier with a smoothed denominator, sharpened until every corner is positive.

    phi_chi = (|a|² + |b|²)/chi(D),   chi(D) = ½ (D + sqrt(D² + e²))

has no pole, so the minimisation may start from a folded grid.  As e decreases, the minimiser
unfolds (theory R5.1, after [Garanzha1999]).  Steps are Newton steps with backtracking on the energy
at fixed e.  Note: the barrier must outweigh the straight-line terms while cells are folded, so it
has its greatest weight everywhere.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from shockgrid.regrid.barrier import assembly as at
from shockgrid.regrid.barrier.functional import (
    cell_value,
    corner_value,
    find_least,
    find_mid_lines,
    has_cell_terms,
    prepare_corners,
    smooth_area,
    take_cell_numbers,
    take_corner_weight,
)
from shockgrid.regrid.barrier.side_laws import GROWTH, LENGTH, LENGTH_CHANGE, STEP_CHANGE
from shockgrid.regrid.barrier.step_control import CHUNK_SPAN
from shockgrid.regrid.barrier.tuning import DEFAULT, Tuning
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.quality import take_edges
from shockgrid.regrid.sides import copy_sides

TERM_1, TERM_2, TERM_3, TERM_4 = (at.ASSEMBLY_ROWS + k * CHUNK_SPAN for k in range(4))
LEAST_1, LEAST_2, LEAST_3, LEAST_4 = (at.ASSEMBLY_ROWS + k * CHUNK_SPAN for k in range(4, 8))
ENERGY_ROW = at.ASSEMBLY_ROWS + 8 * CHUNK_SPAN
LEAST_AREA_ROW = at.ASSEMBLY_ROWS + 9 * CHUNK_SPAN
ENERGY_ROWS = at.ASSEMBLY_ROWS + 10 * CHUNK_SPAN


@kernel
def fill_energy(nodes, law, spread, barrier, first, last, Z):
    """Smoothed energy and least scaled corner area of columns, in ENERGY_ROW and LEAST_AREA_ROW.

    `barrier` (ni, nj) is e_c/epsilon of the cells; at `spread` 0 the energy is that of convex
    grids, J itself.  Cells of columns first..last-1; the block's own corners are left out.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    cells = last - first
    laws = at.LineLaws(law.along_i, law.along_j, law.blend_i, law.bend, law.way, law.ki, law.kj)
    c = law.area_target
    lam = law.area_weight
    quarter = take_corner_weight(law)
    for col in range(cells):
        Z[ENERGY_ROW + col] = 0.0
        Z[LEAST_AREA_ROW + col] = 1e300
    at.begin_columns(nodes, law.along_j, law.blend_i, law.blend_j, law.kj, first, cells, Z)
    if law.given:
        at.keep_side_lengths(law.shares_j, 0, first, cells, Z)
    for i in range(ni):
        at.begin_row(nodes, i, laws, first, cells, Z)
        if law.given:
            at.keep_side_lengths(law.shares_j, i + 1, first, cells, Z)
            at.keep_line_lengths(law.shares_i, i, first, cells + 1, Z)
        if law.curved:
            at.bend_sides(law.curve, i + 1, first, cells, Z)
            at.bend_lines(law.curve, i, first, cells + 1, Z)
        for col in range(cells):
            corners, squares = prepare_corners(*at.take_scaled_edges(col, Z))
            d1, d2, d3, d4 = corners
            a2, u2, b2, r2 = squares
            Z[LEAST_1 + col] = d1
            Z[LEAST_2 + col] = d2
            Z[LEAST_3 + col] = d3
            Z[LEAST_4 + col] = d4
            e2 = spread * spread
            d1 = smooth_area(d1, e2)[0]
            d2 = smooth_area(d2, e2)[0]
            d3 = smooth_area(d3, e2)[0]
            d4 = smooth_area(d4, e2)[0]
            Z[TERM_1 + col] = corner_value(a2 + b2, d1, c, lam)
            Z[TERM_2 + col] = corner_value(u2 + b2, d2, c, lam)
            Z[TERM_3 + col] = corner_value(u2 + r2, d3, c, lam)
            Z[TERM_4 + col] = corner_value(a2 + r2, d4, c, lam)
        if i == 0 or i == ni - 1:
            if first == 0:
                corner = 0 if i == 0 else 3 * CHUNK_SPAN
                Z[TERM_1 + corner] = 0.0
                Z[LEAST_1 + corner] = 1e300
            if last == nj:
                corner = (CHUNK_SPAN if i == 0 else 2 * CHUNK_SPAN) + cells - 1
                Z[TERM_1 + corner] = 0.0
                Z[LEAST_1 + corner] = 1e300
        inside = 1.0 if i < ni - 1 else 0.0
        at.fill_fading(law.along_i[GROWTH, i], cells, Z)
        if law.given:
            at.ease_row(law.ease, i, first, cells, Z)
        parts = barrier[i, first:last]
        for col in range(cells):
            straight = Z[at.FX + col] * Z[at.FX + col] + Z[at.FY + col] * Z[at.FY + col]
            side = (
                Z[at.RIGHT_X + col] * Z[at.RIGHT_X + col]
                + Z[at.RIGHT_Y + col] * Z[at.RIGHT_Y + col]
            )
            terms = (Z[TERM_1 + col] + Z[TERM_2 + col]) + (Z[TERM_3 + col] + Z[TERM_4 + col])
            here = find_least(
                Z[LEAST_1 + col], Z[LEAST_2 + col], Z[LEAST_3 + col], Z[LEAST_4 + col]
            )
            least = Z[LEAST_AREA_ROW + col]
            straight = straight / Z[at.QA + col] if Z[at.QA + col] > 0.0 else 0.0  # F = q dx
            terms *= Z[at.FADING_ROW + col]
            Z[ENERGY_ROW + col] += (quarter * parts[col]) * terms + 0.5 * (
                straight + inside * Z[at.RIGHT_Q + col] * side
            )
            Z[LEAST_AREA_ROW + col] = here if here < least else least
        if spread == 0.0 and has_cell_terms(law):
            x0 = nodes[0, i]
            y0 = nodes[1, i]
            x1 = nodes[0, i + 1]
            y1 = nodes[1, i + 1]
            numbers = take_cell_numbers(law)
            for col in range(cells):
                j = first + col
                low, up, near, far = take_edges(x0, y0, x1, y1, j)
                a, b = find_mid_lines(low, up, near, far)
                Z[ENERGY_ROW + col] += cell_value(a, b, law.sound[i, j], numbers)


FIRST_PART = 0.2  # e of the first step, over the worst D
LEAST_SPREAD = 1e-6  # of a grid that need not unfold from anywhere
LEAST_GAIN = 0.1  # of the energy in a step, in the law of e (R5.2)
LEAST_FREE_SPREAD = 1e-10
# of (R5.4) at one e; it ends when a step gains less
ROUND_STEPS = 8
ROUND_GAIN = 0.02
FREE_SOLVE = 200  # iterations of one step of (R5.4)
WIDE_BARRIER_FACTOR = 10.0  # e over the worst D of a nearly harmonic map


def untangle(work, nodes, tuning: Tuning = DEFAULT) -> bool:
    """Unfold `nodes`, an array of the workspace, in place; True when all corners are positive."""
    law = work.law
    solve = (tuning.untangle_tolerance, 16)
    work.law = law._replace(epsilon=tuning.untangle_barrier * law.epsilon)
    found = _lower(work, nodes, 1, LEAST_SPREAD, tuning.untangle_steps, solve)
    for factor in tuning.last_spreads if found is not None else ():
        # they open what is sharp; none may halve the least scaled area
        spread = factor * work.area_target
        before, worst = work.compute_energy(nodes, spread)
        _step(work, nodes, spread, before, solve, 0.5 * worst)
    work.law = law
    return found is not None


class Unfolding(Enum):
    """How a grid is unfolded that nothing near is known of (theory R5.4).

    STRAIGHT: with straight lines, by `untangle`; GRADED: without them, every edge with the length
    that the sides ask for; EVEN: with two lengths for all.  With SPREAD the grid is a nearly
    harmonic map at first.
    """

    STRAIGHT = 0
    GRADED_SPREAD = 1
    GRADED = 2
    EVEN = 3
    EVEN_SPREAD = 4


def unfold(work, nodes, tuning: Tuning, way: Unfolding) -> bool:
    """Unfold `nodes` (2, ni+1, nj+1) in place, their sides set first; True where that is done."""
    copy_sides(work.sides, nodes)
    if way is Unfolding.STRAIGHT:
        return untangle(work, nodes, tuning)
    law = work.law
    area_target = work.area_target
    graded = way in (Unfolding.GRADED, Unfolding.GRADED_SPREAD)
    work.law = make_graded_law(work) if graded else make_even_law(work)
    work.area_target = 1.0
    solve = tuning.exact_tolerance, FREE_SOLVE
    if way in (Unfolding.GRADED_SPREAD, Unfolding.EVEN_SPREAD):
        spread = WIDE_BARRIER_FACTOR * max(1.0, -work.compute_energy(nodes, 1.0)[1])
        energy = work.compute_energy(nodes, spread)[0]
        for _ in range(ROUND_STEPS):
            energy = _step(work, nodes, spread, energy, solve)[1]
    found = _lower(work, nodes, ROUND_STEPS, LEAST_FREE_SPREAD, tuning.free_steps, solve)
    work.law = law
    work.area_target = area_target
    return found is not None


def make_even_law(work):
    """The law of (R5.4): two lengths for the whole block, no straight lines; D is 1 in the mean."""
    mean = [
        sum(np.hypot(*np.diff(side, axis=1)).sum() for side in sides) / count
        for sides, count in (
            ((work.sides[:, :, 0], work.sides[:, :, -1]), work.ni),
            ((work.sides[:, 0], work.sides[:, -1]), work.nj),
        )
    ]
    scale = np.sqrt(work.sigma / (mean[0] * mean[1]))
    along = [np.ones_like(work.along_i), np.ones_like(work.along_j)]
    for laws, length in zip(along, mean, strict=True):
        laws[LENGTH] = scale * length
        laws[[LENGTH_CHANGE, STEP_CHANGE]] = 0.0
    return work.law._replace(
        along_i=along[0], along_j=along[1], ki=0.0, kj=0.0, curved=False, given=False,
        area_target=1.0, epsilon=1.0, area_weight=1.0, cost_weight=0.0,
    )  # fmt: skip


def make_graded_law(work):
    """The same with the conditional lengths of all edges, scaled so that D is 1 in the mean."""
    scale = np.sqrt(work.law.area_target)
    along = [np.array(laws) for laws in (work.along_i, work.along_j)]
    for laws in along:
        laws[[LENGTH, LENGTH_CHANGE]] *= scale
        laws[GROWTH] = 1.0
    return work.law._replace(
        along_i=along[0], along_j=along[1], ki=0.0, kj=0.0, curved=False, bent=False,
        area_target=1.0, epsilon=1.0, area_weight=1.0, cost_weight=0.0,
    )  # fmt: skip


def _lower(work, nodes, round_steps: int, least: float, most: int, solve) -> float | None:
    """Steps at falling e until `nodes` has no fold: the last e, or None where one stays."""
    worst = work.compute_energy(nodes, 1.0)[1]
    if not np.isfinite(worst):
        return None
    spread = float(np.hypot(least, FIRST_PART * min(worst, 0.0)))
    steps = 0
    while worst <= 0.0:
        first, _ = work.compute_energy(nodes, spread)
        after = first
        for _ in range(round_steps):
            if steps == most:
                return None
            before = after
            fraction, after, worst = _step(work, nodes, spread, before, solve)
            steps += 1
            if worst > 0.0 or fraction == 0.0 or after > (1.0 - ROUND_GAIN) * before:
                break
        if worst <= 0.0:
            if after == first and spread <= least:
                return None
            gain = max(LEAST_GAIN, 1.0 - after / first)
            chi = 0.5 * (worst + np.hypot(worst, spread))
            if worst < 0.0:
                chi = 0.5 * spread**2 / (np.hypot(worst, spread) - worst)
            mu = (1.0 - gain) * chi
            spread = max(least, 2.0 * float(np.sqrt(mu * (mu - worst))))
    return spread


def _step(work, nodes, spread, before, solve, least=-np.inf):
    """One Newton step on the smoothed functional, halved until its energy falls.

    `solve`: tolerance and iterations.  Returns the fraction taken, the energy and the least scaled
    corner area after it, which must not be below `least`.
    """
    work.assemble_smoothed(nodes, spread)
    work.solve(tolerance=solve[0], floor=0.0, most=solve[1])
    fraction = 1.0
    trial = work.trial
    for _ in range(12):
        np.multiply(work.change, fraction, out=trial)
        trial += nodes
        energy, worst = work.compute_energy(trial, spread)
        if energy < before and worst >= least:
            nodes[:] = trial
            return fraction, energy, worst
        fraction *= 0.5
    return 0.0, *work.compute_energy(nodes, spread)
