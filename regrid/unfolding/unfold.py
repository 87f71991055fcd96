"""A grid without folds on given sides, by continuation in the smoothing of the energy.

At each e the energy (theory R5.4) goes down by Newton steps, solved exactly; then e falls by
the law R5.2, which reaches a grid without folds in finitely many rounds if each of them lowers the
energy enough.  Several starts are tried: a hard boundary may hold one of them at a fold that
another never makes.

The trap: dear.  A step solves with a band as wide as the shorter side: n w² for n inner nodes.  It
is for what has failed otherwise.
"""

from __future__ import annotations

import math

import numpy as np

from regrid.algebraic import transfinite_grid
from regrid.sides import compute_area, copy_sides
from regrid.unfolding.energy import assemble, measure_energy, solve_band

FIRST_PART = 0.2  # e of the first round, over the worst D
LEAST_SPREAD = 1e-10
LEAST_GAIN = 0.1  # of the energy in a round, in the law of e
ROUND_STEPS = 8  # Newton steps of a round; it ends when one gains less than ROUND_GAIN
ROUND_GAIN = 0.02
MOST_STEPS = 160  # of one start, twice what the hardest grids took that were found
BUDGET = 6e9  # operations of all steps together: a few seconds
LEAST_STEPS = 30  # blocks so large that fewer are allowed are not tried
POLISH = 6  # Newton steps at e = 0 once nothing is folded
DAMPING = 1e-9  # of the Hessian's largest diagonal element
MOST_HALVINGS = 20


class Unfolder:
    """Scratch and steps for a block in the frame where areas are positive, nj <= ni."""

    def __init__(self, ni: int, nj: int, h_i: float, h_j: float):
        size, self.width = 2 * (ni - 1) * (nj - 1), 2 * nj + 1
        self.gradient, self.column = np.empty(size), np.empty(self.width + 1)
        self.band = np.empty((size, self.width + 1))  # takes memory only once it is written to
        self.trial = np.empty((2, ni + 1, nj + 1))
        self.h_i, self.h_j = h_i, h_j
        self.steps_left = int(BUDGET / (size * self.width**2))

    def measure(self, nodes, spread):
        """Energy and least scaled corner area."""
        return measure_energy(nodes, self.h_i, self.h_j, spread)

    def step(self, nodes, spread, before, least=-math.inf) -> tuple[float, float]:
        """One Newton step on `nodes`, in place, halved until the energy falls below `before`.

        Returns the energy and the least corner area, which may not fall to `least`; `before` and
        NaN where no part of the step would do.
        """
        self.steps_left -= 1
        assemble(nodes, self.h_i, self.h_j, spread, self.band, self.gradient)
        self.band[:, -1] += DAMPING * self.band[:, -1].max()
        change = -self.gradient
        if not solve_band(self.band, change, self.column):
            return before, math.nan
        move = change.reshape(nodes.shape[1] - 2, nodes.shape[2] - 2, 2).transpose(2, 0, 1)
        part = 1.0
        for _ in range(MOST_HALVINGS):
            np.copyto(self.trial, nodes)
            self.trial[:, 1:-1, 1:-1] += part * move
            energy, worst = self.measure(self.trial, spread)
            if energy < before and worst > least:
                nodes[:] = self.trial
                return energy, worst
            part *= 0.5
        return before, math.nan

    def unfold(self, nodes) -> bool:
        """Unfold `nodes` in place; True where every corner triangle is positive."""
        worst = self.measure(nodes, 1.0)[1]
        spread = math.hypot(1e-3, FIRST_PART * min(worst, 0.0))
        least_left = max(0, self.steps_left - MOST_STEPS)
        while not worst > 0.0 and self.steps_left > least_left:
            first, worst = self.measure(nodes, spread)
            energy = first
            for _ in range(ROUND_STEPS):
                before = energy
                energy, now = self.step(nodes, spread, before)
                worst = worst if math.isnan(now) else now
                if worst > 0.0 or math.isnan(now) or energy > (1.0 - ROUND_GAIN) * before:
                    break
            gain = max(LEAST_GAIN, 1.0 - energy / first)
            root = math.hypot(worst, spread)
            chi = 0.5 * spread**2 / (root - worst) if worst < 0.0 else 0.5 * (worst + root)
            mu = (1.0 - gain) * chi
            fallen = max(LEAST_SPREAD, 2.0 * math.sqrt(mu * max(0.0, mu - worst)))
            if fallen >= spread and spread == LEAST_SPREAD:
                break
            spread = min(spread, fallen)
        if not worst > 0.0:
            return False
        energy = self.measure(nodes, 0.0)[0]
        for _ in range(POLISH):
            before = energy
            energy, now = self.step(nodes, 0.0, before, 0.0)
            if math.isnan(now) or energy > (1.0 - ROUND_GAIN) * before:
                break
        return True


def unfold_grid(starts: list[np.ndarray], boundary: np.ndarray) -> np.ndarray | None:
    """A grid (2, ni+1, nj+1) of convex cells on the sides of `boundary`, or None.

    `starts`: grids whose inside is begun from, one after the other; transfinite interpolation and
    a nearly harmonic map follow.  The corners of the block are not looked at.  `boundary` goes
    round like i, j (positive area), with 2 × 2 cells at least.
    """
    turned = boundary.shape[2] > boundary.shape[1]
    sides = _turn(boundary) if turned else boundary
    ni, nj = sides.shape[1] - 1, sides.shape[2] - 1
    along_i = sum(np.hypot(*np.diff(sides[:, :, k], axis=1)).sum() for k in (0, -1)) / ni
    along_j = sum(np.hypot(*np.diff(sides[:, k], axis=1)).sum() for k in (0, -1)) / nj
    scale = math.sqrt(compute_area(sides) / (ni * nj * along_i * along_j))
    unfolder = Unfolder(ni, nj, scale * along_i, scale * along_j)
    if unfolder.steps_left < LEAST_STEPS:
        return None
    straight = transfinite_grid(np.ascontiguousarray(sides))
    for start in [*(_turn(start) if turned else start for start in starts), straight, None]:
        nodes = straight.copy() if start is None else np.array(start, order="C")
        if not np.isfinite(nodes).all():
            continue
        copy_sides(sides, nodes)
        if start is None:
            spread = 10.0 * max(1.0, -unfolder.measure(nodes, 1.0)[1])
            energy = unfolder.measure(nodes, spread)[0]
            for _ in range(ROUND_STEPS):
                energy, _ = unfolder.step(nodes, spread, energy)
        if unfolder.unfold(nodes):
            return np.ascontiguousarray(_turn(nodes) if turned else nodes)
    return None


def _turn(nodes):
    """i and j, x and y exchanged: areas keep their sign."""
    return np.ascontiguousarray(nodes.transpose(0, 2, 1)[::-1])
