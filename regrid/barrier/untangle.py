"""Untangling: the barrier on a smoothed denominator, pulled tight until every corner is positive.

    phi_chi = (|a|² + |b|²)/chi(D),   chi(D) = ½ (D + sqrt(D² + e²))

has no pole, so that it may begin from a folded grid; as e shrinks its minimiser unfolds (theory
R5.1, after [Garanzha1999]).  Steps are Newton steps with backtracking on the energy at fixed e.
The trap: the barrier must outweigh the straight-line terms while cells are folded, so that here it
carries its greatest weight everywhere.
"""

from __future__ import annotations

import numpy as np

from regrid.barrier.assembly import (
    SPAN,
    smooth_area,
)
from regrid.barrier.assembly_rows import (
    A2,
    AX,
    AY,
    B2,
    BX,
    BY,
    C2,
    CX,
    CY,
    FADING,
    FX,
    FY,
    QA,
    RIGHT_Q,
    RIGHT_X,
    RIGHT_Y,
    ROWS,
    begin_columns,
    begin_row,
    bend_lines,
    bend_sides,
    fill_fading,
)
from regrid.barrier.side_laws import GROWTH
from regrid.jit import kernel

TERM_1, TERM_2, TERM_3, TERM_4 = (ROWS + k * SPAN for k in range(4))
LEAST_1, LEAST_2, LEAST_3, LEAST_4 = (ROWS + k * SPAN for k in range(4, 8))
ENERGY, LEAST = ROWS + 8 * SPAN, ROWS + 9 * SPAN
ENERGY_ROWS = ROWS + 10 * SPAN


@kernel
def fill_energy(nodes, law, spread, barrier, first, last, Z):
    """Smoothed energy and least scaled corner area, one a column of cells, in ENERGY and LEAST.

    `barrier` (ni, nj) is e_c/epsilon of the cells; at `spread` 0 the energy is that of convex
    grids, J itself.  Cells of columns first..last-1; the block's own corners are left out.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    cells = last - first
    along_i, along_j, blend_i, ki, kj = law.along_i, law.along_j, law.blend_i, law.ki, law.kj
    c, lam, quarter = law.area_target, law.area_weight, 0.25 * law.sigma * law.epsilon
    for col in range(cells):
        Z[ENERGY + col] = 0.0
        Z[LEAST + col] = 1e300
    begin_columns(nodes, along_j, blend_i, law.blend_j, kj, first, cells, Z)
    for i in range(ni):
        begin_row(nodes, i, along_i, along_j, blend_i, law.bend, law.way, ki, kj, first, cells, Z)
        if law.curved:
            bend_sides(law.curve, i + 1, first, cells, Z)
            bend_lines(law.curve, i, first, cells + 1, Z)
        for col in range(cells):
            ax, ay, a2 = Z[AX + col], Z[AY + col], Z[A2 + col]
            ux, uy, u2 = Z[AX + col + 1], Z[AY + col + 1], Z[A2 + col + 1]
            bx, by, b2 = Z[BX + col], Z[BY + col], Z[B2 + col]
            rx, ry, r2 = Z[CX + col], Z[CY + col], Z[C2 + col]
            d1, d2 = ax * by - ay * bx, ux * by - uy * bx
            d3, d4 = ux * ry - uy * rx, ax * ry - ay * rx
            Z[LEAST_1 + col] = d1
            Z[LEAST_2 + col] = d2
            Z[LEAST_3 + col] = d3
            Z[LEAST_4 + col] = d4
            e2 = spread * spread
            d1, d2 = smooth_area(d1, e2)[0], smooth_area(d2, e2)[0]
            d3, d4 = smooth_area(d3, e2)[0], smooth_area(d4, e2)[0]
            Z[TERM_1 + col] = (a2 + b2) / d1 + lam * (d1 / c + c / d1)
            Z[TERM_2 + col] = (u2 + b2) / d2 + lam * (d2 / c + c / d2)
            Z[TERM_3 + col] = (u2 + r2) / d3 + lam * (d3 / c + c / d3)
            Z[TERM_4 + col] = (a2 + r2) / d4 + lam * (d4 / c + c / d4)
        if i == 0 or i == ni - 1:
            if first == 0:
                corner = 0 if i == 0 else 3 * SPAN
                Z[TERM_1 + corner] = 0.0
                Z[LEAST_1 + corner] = 1e300
            if last == nj:
                corner = (SPAN if i == 0 else 2 * SPAN) + cells - 1
                Z[TERM_1 + corner] = 0.0
                Z[LEAST_1 + corner] = 1e300
        inside = 1.0 if i < ni - 1 else 0.0
        fill_fading(along_i[GROWTH, i], cells, Z)
        parts = barrier[i, first:last]
        for col in range(cells):
            straight = Z[FX + col] * Z[FX + col] + Z[FY + col] * Z[FY + col]
            side = Z[RIGHT_X + col] * Z[RIGHT_X + col] + Z[RIGHT_Y + col] * Z[RIGHT_Y + col]
            terms = (Z[TERM_1 + col] + Z[TERM_2 + col]) + (Z[TERM_3 + col] + Z[TERM_4 + col])
            m1, m2, m3, m4 = Z[LEAST_1 + col], Z[LEAST_2 + col], Z[LEAST_3 + col], Z[LEAST_4 + col]
            m1 = m1 if m1 < m2 else m2
            m3 = m3 if m3 < m4 else m4
            m1 = m1 if m1 < m3 else m3
            least = Z[LEAST + col]
            straight = straight / Z[QA + col] if Z[QA + col] > 0.0 else 0.0  # F = q dx
            terms *= Z[FADING + col]
            Z[ENERGY + col] += (quarter * parts[col]) * terms + 0.5 * (
                straight + inside * Z[RIGHT_Q + col] * side
            )
            Z[LEAST + col] = m1 if m1 < least else least


FIRST_SPREAD = 0.2  # square root of the .04 in the first e²
LEAST_SPREAD = 1e-6
LAST_SPREADS = (0.2, 0.1, 0.05, 0.02)  # once nothing is folded, in units of c
TOLERANCE = 0.2  # of a step's solve
MOST_STEPS = 60  # a block that needs more has stalled


def untangle(work, nodes) -> bool:
    """Unfold `nodes`, an array of the workspace, in place; True when all corners are positive."""
    worst = work.compute_energy(nodes, 1.0)[1]
    if not np.isfinite(worst):
        return False
    spread = float(np.sqrt(LEAST_SPREAD**2 + FIRST_SPREAD**2 * min(worst, 0.0) ** 2))
    steps = 0
    while worst <= 0.0:
        if steps == MOST_STEPS:
            return False
        before, _ = work.compute_energy(nodes, spread)
        fraction, after, worst = _step(work, nodes, spread, before)
        steps += 1
        if fraction == 0.0 and spread <= LEAST_SPREAD:
            return False
        if worst <= 0.0:
            gain = max(0.1, 1.0 - after / before)
            chi = 0.5 * (worst + np.hypot(worst, spread))
            if worst < 0.0:
                chi = 0.5 * spread**2 / (np.hypot(worst, spread) - worst)
            mu = (1.0 - gain) * chi
            spread = max(LEAST_SPREAD, 2.0 * float(np.sqrt(mu * (mu - worst))))
    pull_tight(work, nodes, LAST_SPREADS)
    return True


def pull_tight(work, nodes, spreads) -> None:
    """A step of each of the `spreads`, in units of c, on the convex grid `nodes`, in place.

    They open what is sharp; none may halve the least scaled corner area.
    """
    for factor in spreads:
        spread = factor * work.area_target
        before, worst = work.compute_energy(nodes, spread)
        _step(work, nodes, spread, before, 0.5 * worst)


def _step(work, nodes, spread, before, least=-np.inf):
    """One Newton step on the smoothed functional, halved until its energy falls.

    Returns the fraction taken, the energy and the least scaled corner area after it.
    """
    work.assemble_smoothed(nodes, spread)
    work.solve(tolerance=TOLERANCE, floor=0.0)
    fraction, trial = 1.0, work.trial
    for _ in range(12):
        np.multiply(work.change, fraction, out=trial)
        trial += nodes
        energy, worst = work.compute_energy(trial, spread)
        if energy < before and worst >= least:
            nodes[:] = trial
            return fraction, energy, worst
        fraction *= 0.5
    return 0.0, *work.compute_energy(nodes, spread)
