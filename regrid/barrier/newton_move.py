"""One move of the barrier regridder: from a valid grid to new sides, by Newton steps or in parts.

The order of trials stands in `NewtonMove`: the moved grid as it is, a shortened Newton step, a
linear prediction, mended or untangled where it folds, the motion in parts, a map without folds
from any start.  It knows the regridder's numbers by `BarrierOptions` alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from regrid.algebraic import fill_quasi_1d
from regrid.barrier.corner_springs import MENDED, mend
from regrid.barrier.side_laws import compute_stiffness
from regrid.barrier.untangle import pull_tight, untangle
from regrid.barrier.workspace import Workspace
from regrid.measure.corners import count_triangles, count_turned_corners, find_folded_cells
from regrid.measure.faults import find_impossible
from regrid.mending.step_shortening import shorten_steps
from regrid.protocol import RegridReport
from regrid.sides import copy_sides, get_sides
from regrid.unfolding.unfold import unfold_grid

LEAST_RATIO = 0.1  # a predicted corner area may not be below this part of its old value
START_RATIO = 0.5  # the moved grid is where the step begins if it keeps this much of every corner
STEP_RATIO = 0.25  # a step on the final boundary keeps this much of every corner, node by node,
SMOOTH_RATIO = 0.5  # and is followed by another one where it kept less than this
LEAST_PART = 1.0 / 64.0  # of a Newton step that would lead uphill
CREEP_RATIO = 0.2  # a part of the motion keeps this much of every corner
MOST_STEPS = 6  # Newton steps after the first
MOST_POLISH = 15  # Newton steps after mending or untangling; they stop at a residual of SETTLED
SETTLED = 0.005  # cells
MENDED_SPREADS = (0.1, 0.02)  # of the two steps that open the sharp corners of a mended grid
NEAR = 0.04  # residual in cells up to which sharp cells are stiffer: farther off they open slowly
LOST = 0.5  # first residual, in cells at the sides, from which the straight-line grid is tried
MOST_CREEPS = 8  # parts in which the linear prediction is followed and renewed
FAR = 6.0  # a boundary that moved by more cells than this is untangled rather than followed
FAR_TOLERANCE, FAR_ITERATIONS = 0.01, 30  # the solve that carries the boundary's motion inside
HOVER = 1.3  # floors up to which a step's residual may begin so that its solve goes down to
DEEP = 0.25  # this part of the floor: it is what small motions left, and the next ones need none
SMOOTH_FLOOR = 0.03  # smooth errors, in cells, that a large block is left with
MOST_SMOOTH = 2.0  # cells that a correction goes at most,
SMOOTH_PART = 0.25  # and this part of the way that the grid is moved: else sharp cells would swing
ROUND_OFF = 1e-12  # residual, in cells, that nothing can improve
DOUBTFUL = 1e-6  # least ratio up to which the signs of corners are computed exactly
MOST_HALVINGS = 6  # the boundary's motion is cut into no more than 2**6 parts


@dataclass(frozen=True)
class BarrierOptions:
    """Numbers of a barrier regridder that a move needs; their meaning: `BarrierRegridder`."""

    epsilon: float
    area_weight: float
    strengthening: float
    conditional: bool
    tolerance: float
    floor: float
    max_iterations: int
    newton_steps: int
    cost_weight: float


class NewtonMove:
    """One regrid in the workspace's frame: from `work.old` to `work.sides`, into `work.trial`."""

    def __init__(
        self,
        options: BarrierOptions,
        work: Workspace,
        ki: float,
        kj: float,
        knows_sound: bool = False,
        curved: bool = False,
    ):
        self.options, self.work, self.ki, self.kj = options, work, ki, kj
        self.knows_sound, self.curved = knows_sound, curved
        self.iterations = self.rescues = self.sub_moves = 0
        self.residual = 0.0
        self.broken = False
        self.ratio = np.inf
        self.start = "displacement"
        self.strayed = np.inf
        self.exempt = count_turned_corners(work.sides)

    def report(self) -> RegridReport:
        inner = (self.work.ni - 1) * (self.work.nj - 1)
        return RegridReport(
            iterations=self.iterations,
            node_iterations=self.iterations * inner,
            sub_moves=self.sub_moves,
            rescues=self.rescues,
            least_corner_ratio=self.ratio,
            residual=self.residual,
            start=self.start,
            exempt_corners=self.exempt,
            triangles=count_triangles(self.work.trial),
            strayed=self.strayed,
        )

    def is_settled(self) -> bool:
        """Look at the grid moved along: True when it is `work.trial` and needs nothing more."""
        work = self.work
        self._begin()
        if work.ni == 1 or work.nj == 1:
            return False
        self.moved_ratio, self.estimate, strayed = work.look(work.base, work.old)
        if self.moved_ratio > START_RATIO and self._correct_smooth_error():
            strayed = np.inf
        if not (self.moved_ratio > START_RATIO and self.estimate <= self._get_floor()):
            return False
        self.residual = max(self.residual, self.estimate)
        self.strayed = strayed
        work.base, work.trial = work.trial, work.base
        return self._accept(self.moved_ratio)

    def _correct_smooth_error(self) -> bool:
        """Take from the moved grid what its look saw of smooth errors; False where that is little.

        The look's sums are those of `work.base`.  A correction that costs corners is not taken.
        """
        work = self.work
        size = work.coarse.find(work.base, work.law, SMOOTH_FLOOR)
        if not SMOOTH_FLOOR < size < np.inf:
            return False
        moved = max(work.displacement.max(), -work.displacement.min()) / math.sqrt(work.sigma)
        most = min(MOST_SMOOTH, SMOOTH_PART * moved)
        work.coarse.add(work.base, work.trial, min(1.0, most / size))
        ratio = work.compare_corners(work.trial, work.old)
        if not ratio > min(self.moved_ratio, SMOOTH_RATIO):
            return False
        work.base, work.trial = work.trial, work.base
        self.moved_ratio = ratio
        return True

    def run(self) -> bool:
        """Go the whole way where `is_settled` has said no, in halves if need be.

        True when `work.trial` is valid.
        """
        work = self.work
        if self._advance():
            return True
        begin, end = work.old.copy(), work.sides.copy()
        work.own_grids()
        for halving in range(1, MOST_HALVINGS + 1):
            parts = 2**halving
            work.old[:] = begin
            self.ratio = np.inf
            for part in range(1, parts + 1):
                t = part / parts
                for now, then, there in zip(
                    get_sides(work.sides), get_sides(begin), get_sides(end), strict=True
                ):
                    now[:] = there if part == parts else then + t * (there - then)
                if not (self.is_settled() or self._advance()):
                    break
                work.old[:] = work.trial
            else:
                self.sub_moves = parts - 1
                self.start, self.strayed = "halved", np.inf
                return True
        work.old[:], work.sides[:] = begin, end
        return self._unfold()

    def _unfold(self) -> bool:
        """The last resort (theory R5.4), where the boundary alone does not forbid a grid."""
        work = self.work
        if work.ni == 1 or work.nj == 1 or find_impossible(work.sides) is not None:
            return False
        self._begin()
        found = unfold_grid([work.base], work.sides)
        if found is None:
            return False
        self.ratio, self.broken, self.sub_moves = np.inf, False, 0
        self.rescues += 1
        self.rescued, self.start, self.strayed = True, "untangled", np.inf
        work.trial[:] = found
        for _ in range(MOST_POLISH):
            work.base[:] = work.trial
            ratio = self._newton(work.base, work.base)
            if self.broken or (ratio > SMOOTH_RATIO and self.error <= SETTLED):
                break
        ratio = work.compare_corners(work.trial, work.old)
        if not self.broken and self._accept(ratio):
            return True
        self.broken = False
        work.trial[:] = found
        return self._accept(work.compare_corners(found, work.old))

    def _begin(self) -> None:
        """Laws of the part's sides, and the old grid moved along with them into `work.base`."""
        options = self.options
        self.work.begin(
            options.conditional,
            self.ki,
            self.kj,
            options.epsilon,
            options.area_weight,
            options.strengthening,
            options.cost_weight if self.knows_sound else 0.0,
            self.curved,
        )
        self.work.carry_sides(self.work.old)

    def _advance(self) -> bool:
        """One part of the motion, `work.old` to `work.sides`, from the grid moved along.

        True when `work.trial` is valid.
        """
        work, options = self.work, self.options
        if work.ni == 1 or work.nj == 1:
            work.trial[:] = work.base
            return self._accept(work.compare_corners(work.trial, work.old))
        self.rescued = self.mended = False
        moved_ratio, estimate = self.moved_ratio, self.estimate
        stiffness = compute_stiffness(work.old, work.sides) if estimate <= NEAR else 1.0
        if stiffness > 1.0:
            work.law = work.law._replace(stiffness=stiffness)
        if moved_ratio > START_RATIO:
            done = self.iterations
            ratio = self._newton(work.base, work.old, deep=estimate < HOVER * options.floor)
            if self.iterations == done:
                ratio = moved_ratio
            if self.error > self._get_lost():
                ratio = self._straighten(ratio)
            if self.broken:
                if not self._rescue():
                    return False
                ratio = 0.0
        else:
            ratio = self._predict(moved_ratio)
            if ratio is None:
                return False
        against_old = moved_ratio > START_RATIO and self.start == "displacement"
        begun_afresh = self.rescued or self.mended
        extra = MOST_POLISH if begun_afresh else MOST_STEPS
        for step in range(extra):
            smooth = ratio > SMOOTH_RATIO and not (begun_afresh and self.error > SETTLED)
            if smooth and step >= options.newton_steps - 1:
                break
            work.base[:] = work.trial
            ratio = self._newton(work.base, work.base)
            against_old = False
        return self._accept(ratio if against_old else work.compare_corners(work.trial, work.old))

    def _get_floor(self) -> float:
        """Residual, in cells, up to which the moved grid is taken as it is."""
        return min(max(self.options.floor, ROUND_OFF), self._get_lost())

    def _get_lost(self) -> float:
        """Residual in cells from which the straight-line grid is tried.

        What a left-behind inside leaves is at the sides: judged against their length.
        """
        inner, around = (self.work.ni - 1) * (self.work.nj - 1), self.work.ni + self.work.nj
        return LOST / math.sqrt(inner / around)

    def _straighten(self, ratio: float) -> float:
        """Begin from the straight-line grid instead, where that is valid and much nearer."""
        work, error, broken = self.work, self.error, self.broken
        kept = work.trial.copy()
        fill_quasi_1d(work.sides, work.base)
        if work.compare_corners(work.base, work.old) > 0.0:
            straight = self._newton(work.base, work.base)
            if not self.broken and self.error < 0.5 * error:
                self.start = "quasi-1d"
                return straight
        work.trial[:] = kept
        self.broken = broken
        return ratio

    def _predict(self, moved_ratio: float) -> float | None:
        """Carry the boundary's motion inside by the Hessian of the old grid, then by what works.

        Returns the least ratio of the step that led to `work.trial`, None where nothing did.
        """
        work = self.work
        work.assemble(work.old)
        far = np.abs(work.displacement).max()
        self._solve(work.displacement)
        np.add(work.old, work.change, out=work.trial)
        copy_sides(work.sides, work.trial)
        ratio = work.compare_corners(work.trial, work.old)
        if ratio > LEAST_RATIO:
            return ratio
        if moved_ratio > LEAST_RATIO:
            return self._newton(work.base, work.base)
        if far < FAR * np.sqrt(work.sigma):
            predicted = work.trial.copy()
            if self._mend() or self._rescue():
                return 0.0
            work.trial[:] = predicted
            if self._creep():
                return 0.0
            work.trial[:] = predicted
        return 0.0 if self._rescue() else None

    def _mend(self) -> bool:
        """Open the bad corners of the prediction in `work.trial` by springs (theory R5.7).

        True when every corner keeps MENDED of its old area.  The matrix at hand is the old grid's.
        """
        work = self.work
        stored = work.store()
        self.iterations += mend(stored, self.options.floor)
        if stored is not work:
            work.trial[:] = stored.trial
            work.iterations += stored.iterations
        self.mended = work.compare_corners(work.trial, work.old) > MENDED
        if self.mended:
            work.base[:] = work.trial
            pull_tight(work, work.base, MENDED_SPREADS)
            work.trial[:] = work.base
            self.start = "mended"
        return self.mended

    def _creep(self) -> bool:
        """Follow the linear prediction as far as it is valid, renew it there, up to the end."""
        work, parts = self.work, 0
        here = work.old.copy()
        while parts < MOST_CREEPS:
            t = 1.0
            while t > 0.1:
                np.multiply(work.change, t, out=work.trial)
                work.trial += here
                if t == 1.0:
                    copy_sides(work.sides, work.trial)
                if work.compare_corners(work.trial, here) > CREEP_RATIO:
                    break
                t *= 0.5
            else:
                return False
            if t == 1.0:
                self.sub_moves += parts
                self.start = "halved"
                return True
            parts += 1
            here[:] = work.trial
            work.carry_sides(here)
            work.assemble(here)
            self._solve(work.displacement)
        return False

    def _newton(self, base, old, deep: bool = False) -> float:
        """`work.trial` = a Newton step from the valid `base`, shortened node by node if need be.

        Returns the least ratio of corner areas to those of `old`; those of `base` must be above
        STEP_RATIO of them.
        """
        work = self.work
        work.assemble(base)
        if self._solve(None, deep) == 0:
            work.trial[:] = base
            return 0.0 if self.broken else 1.0
        np.add(base, work.change, out=work.trial)
        ratio = work.compare_corners(work.trial, old)
        return ratio if ratio > STEP_RATIO else self._search(base, old)

    def _search(self, base, old) -> float:
        """The longest part of the step, shortened at its corners too, that makes J less.

        Far from the minimum the steps of Newton's method lead uphill, and what is shortened at
        the corners alone leaves each of them a quarter of its area, step after step.
        """
        work = self.work
        barrier = work.compute_barrier(base)
        before, _ = work.compute_energy(base, 0.0, barrier)
        part = 1.0
        while part >= LEAST_PART:
            np.multiply(work.change, part, out=work.trial)
            work.trial += base
            shorten_steps(base, work.trial, old, STEP_RATIO, work.shortening)
            if work.compute_energy(work.trial, 0.0, barrier)[0] < before:
                return work.compare_corners(work.trial, old)
            part *= 0.5
        work.trial[:] = base
        return work.compare_corners(base, old)

    def _solve(self, guess, deep: bool = False) -> int:
        """Fill `work.change`; the iterations done, and `error`, the first residual in cells.

        It goes down to the floor, or to DEEP floors where `deep`.
        `broken` where the line solve overflows, since corners are too sharp for it: its residual
        is then not finite, negative or nothing at all, and no sign of a minimum.
        """
        work, options = self.work, self.options
        scale = work.sigma * (work.ni - 1) * (work.nj - 1)
        floor = max((DEEP if deep else 1.0) * options.floor, ROUND_OFF) ** 2 * scale
        if guess is None:
            done, first, last = work.solve(options.tolerance, floor, options.max_iterations)
        else:
            done, first, last = work.solve(FAR_TOLERANCE, floor, FAR_ITERATIONS, guess)
        self.iterations += done
        self.broken = not (first >= -floor and np.isfinite(first) and np.isfinite(last))
        self.broken |= first == 0.0 and bool(work.r.any())
        if self.broken:
            self.error = np.inf
            return done
        self.error = float(np.sqrt(max(first, 0.0) / scale))
        self.residual = max(self.residual, self.error)
        return done

    def _accept(self, ratio: float) -> bool:
        """Report the least ratio; True when `work.trial` is valid."""
        self.ratio = min(self.ratio, ratio)
        if not ratio > 0.0 or self.broken:
            return False
        return ratio > DOUBTFUL or not find_folded_cells(self.work.trial).size

    def _rescue(self) -> bool:
        """Untangle the better of the moved grid and the trial into `work.trial`."""
        work = self.work
        self.rescues += 1
        self.rescued = True
        self.start = "untangled"
        worst = work.compute_energy(work.trial, 1.0)[1]
        moved = work.compute_energy(work.base, 1.0)[1]
        if moved < worst:
            work.base[:] = work.trial
        if not untangle(work, work.base):
            return False
        work.trial[:] = work.base
        return True
