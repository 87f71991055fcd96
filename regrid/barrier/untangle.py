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
    GA,
    GB,
    GC,
    RIGHT_Q,
    RIGHT_X,
    RIGHT_Y,
    ROWS,
    SPAN,
    V,
    W,
    fill_fading,
    fill_line_edges,
    fill_side_edges,
    smooth_area,
)
from regrid.barrier.side_laws import GROWTH
from regrid.jit import kernel

TERM_1, TERM_2, TERM_3, TERM_4 = (ROWS + k * SPAN for k in range(4))
LEAST_1, LEAST_2, LEAST_3, LEAST_4 = (ROWS + k * SPAN for k in range(4, 8))
ENERGY, LEAST = ROWS + 8 * SPAN, ROWS + 9 * SPAN
ENERGY_ROWS = ROWS + 10 * SPAN


@kernel
def fill_energy(
    nodes, along_i, along_j, blend_i, blend_j, ki, kj, sigma, c, epsilon, lam, spread,
    barrier, first, last, Z,
):  # fmt: skip
    """Smoothed energy and least scaled corner area, one a column of cells, in ENERGY and LEAST.

    `barrier` (ni, nj) is e_c/epsilon of the cells; at `spread` 0 the energy is that of convex
    grids, J itself.  Cells of columns first..last-1; the block's own corners are left out.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    cells = last - first
    quarter = 0.25 * sigma * epsilon
    for l in range(cells + 1):
        Z[V + l] = (first + l) / nj
        Z[W + l] = blend_j[first + l]
    for l in range(cells):
        Z[ENERGY + l] = 0.0
        Z[LEAST + l] = 1e300
    fill_side_edges(nodes, 0, along_j, blend_i, kj, first, cells, Z)
    for i in range(ni):
        for l in range(cells):
            Z[BX + l] = Z[CX + l]
            Z[BY + l] = Z[CY + l]
            Z[B2 + l] = Z[C2 + l]
            Z[GB + l] = Z[GC + l]
        fill_side_edges(nodes, i + 1, along_j, blend_i, kj, first, cells, Z)
        fill_line_edges(nodes, i, along_i, ki, first, cells + 1, Z)
        for l in range(cells):
            ax, ay, a2 = Z[AX + l], Z[AY + l], Z[A2 + l]
            ux, uy, u2 = Z[AX + l + 1], Z[AY + l + 1], Z[A2 + l + 1]
            bx, by, b2 = Z[BX + l], Z[BY + l], Z[B2 + l]
            rx, ry, r2 = Z[CX + l], Z[CY + l], Z[C2 + l]
            d1, d2 = ax * by - ay * bx, ux * by - uy * bx
            d3, d4 = ux * ry - uy * rx, ax * ry - ay * rx
            Z[LEAST_1 + l] = d1
            Z[LEAST_2 + l] = d2
            Z[LEAST_3 + l] = d3
            Z[LEAST_4 + l] = d4
            e2 = spread * spread
            d1, d2 = smooth_area(d1, e2)[0], smooth_area(d2, e2)[0]
            d3, d4 = smooth_area(d3, e2)[0], smooth_area(d4, e2)[0]
            Z[TERM_1 + l] = (a2 + b2) / d1 + lam * (d1 / c + c / d1)
            Z[TERM_2 + l] = (u2 + b2) / d2 + lam * (d2 / c + c / d2)
            Z[TERM_3 + l] = (u2 + r2) / d3 + lam * (d3 / c + c / d3)
            Z[TERM_4 + l] = (a2 + r2) / d4 + lam * (d4 / c + c / d4)
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
        for l in range(cells):
            straight = Z[FX + l] * Z[AX + l] + Z[FY + l] * Z[AY + l]
            side = Z[RIGHT_X + l] * Z[RIGHT_X + l] + Z[RIGHT_Y + l] * Z[RIGHT_Y + l]
            terms = (Z[TERM_1 + l] + Z[TERM_2 + l]) + (Z[TERM_3 + l] + Z[TERM_4 + l])
            m1, m2, m3, m4 = Z[LEAST_1 + l], Z[LEAST_2 + l], Z[LEAST_3 + l], Z[LEAST_4 + l]
            m1 = m1 if m1 < m2 else m2
            m3 = m3 if m3 < m4 else m4
            m1 = m1 if m1 < m3 else m3
            least = Z[LEAST + l]
            # F = q dx and A = g dx: their product over g is q dx².
            straight = straight / Z[GA + l]
            terms *= Z[FADING + l]
            Z[ENERGY + l] += (quarter * parts[l]) * terms + 0.5 * (
                straight + inside * Z[RIGHT_Q + l] * side
            )
            Z[LEAST + l] = m1 if m1 < least else least


FIRST_SPREAD = 0.2  # square root of the .04 in the first e²
LEAST_SPREAD = 1e-6
LAST_SPREADS = (0.2, 0.1, 0.05, 0.02)  # once nothing is folded, in units of c
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
    for factor in LAST_SPREADS:
        spread = factor * work.area_target
        before, worst = work.compute_energy(nodes, spread)
        _step(work, nodes, spread, before, 0.5 * worst)
    return True


def _step(work, nodes, spread, before, least=-np.inf):
    """One Newton step on the smoothed functional, halved until its energy falls.

    Returns the fraction taken, the energy and the least scaled corner area after it.
    """
    work.assemble_smoothed(nodes, spread)
    work.solve(tolerance=0.05, floor=0.0)
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
