"""One move of the barrier regridder: from a valid grid to new sides.

    1 the displaced grid (R6.5), if necessary after a correction of its smooth errors (R4.13)
    2 Newton steps from it, shortened where corners would lose too much area (R4.8)
    3 if it lost too much itself: the motion of the sides extended by the old grid's Hessian
    4 if that folds: the same extension followed in parts, each as far as it is valid
    5 if that takes too many: untangling (R5.1)
    6 half of the motion of the sides at a time
    7 a grid made from the sides alone (R5.4); if the old grid is folded, this is all

If all of this fails, the error names side and nodes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from shockgrid.regrid.algebraic import (
    fill_displacement,
    fill_quasi_1d,
    quasi_1d_grid,
    transfinite_grid,
)
from shockgrid.regrid.barrier.side_laws import compute_stiffness
from shockgrid.regrid.barrier.step_control import shorten_steps
from shockgrid.regrid.barrier.tuning import Tuning
from shockgrid.regrid.barrier.untangle import Unfolding, unfold, untangle
from shockgrid.regrid.barrier.workspace import Workspace
from shockgrid.regrid.measure.corners import count_triangles, find_folded_cells
from shockgrid.regrid.measure.faults import find_impossible
from shockgrid.regrid.protocol import RegridReport
from shockgrid.regrid.sides import copy_sides, get_sides

ROUND_OFF_RESIDUAL = 1e-12  # residual, in cells, that cannot be improved
DOUBTFUL_CORNER_RATIO = 1e-6  # least ratio up to which the signs of corners are computed exactly
SLOW_SIDE_FRACTION = 0.3  # of `fast_sides`: slower sides count as at rest
LEAST_PART = 1.0 / 64.0  # of a Newton step that would lead uphill
LEAST_FOLLOWED_PART = 1.0 / 8.0  # of a predicted motion: shorter ones are not worth a solve


class Folded(Exception):
    """A grid has to be untangled, and how the block is looked at was not chosen for that."""


class NewtonMove:
    """One regrid in the workspace's frame: from `work.old` to `work.sides`, into `work.trial`.

    `untangles`: False lets it raise `Folded` where it would untangle; `repairs`: the old grid is
    folded.  `begin` (ki, kj and other arguments of `Workspace.begin`) are used at the start of each
    part.
    """

    def __init__(
        self,
        tuning: Tuning,
        work: Workspace,
        untangles: bool = True,
        repairs: bool = False,
        **begin,
    ):
        self.tuning = tuning
        self.work = work
        self.untangles = untangles
        self.repairs = repairs
        self.arguments = begin
        self.iterations = self.rescues = self.sub_moves = 0
        self.residual = 0.0
        self.broken = False
        self.ratio = np.inf
        self.start = "displacement"
        self.estimate = self.strayed = np.inf
        self.quality: tuple[float, float, int, int] | None = None
        self.triangles = -1  # unknown
        self._begin()
        self.exempt = work.block.turned

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
            triangles=count_triangles(self.work.trial) if self.triangles < 0 else self.triangles,
            strayed=self.strayed if self.strayed < np.inf else None,
            quality=self.quality,
        )

    def is_settled(self) -> bool:
        """Check the residual of the displaced grid: True if that is `work.trial` and final."""
        work = self.work
        tuning = self.tuning
        if work.ni == 1 or work.nj == 1:
            work.load_old()
            copy_sides(work.sides, work.base)
            return False
        self.moved_ratio, self.estimate, strayed = work.look()
        corrected = False
        if self.moved_ratio > tuning.start_ratio and self._correct_smooth_error():
            strayed = np.inf
            corrected = True
        good = self.estimate <= min(
            max(tuning.idle * tuning.floor, ROUND_OFF_RESIDUAL), self._get_lost()
        )
        if not (self.moved_ratio > tuning.start_ratio and good):
            return False
        self.residual = max(self.residual, self.estimate)
        self.strayed = strayed
        if not corrected:
            self.quality = work.get_quality()
            self.triangles = work.marks.bit_count()
        if self.moved_ratio <= DOUBTFUL_CORNER_RATIO:  # all of the grid will be read
            work.load_old()
        work.base, work.trial = work.trial, work.base
        return self._accept(self.moved_ratio)

    def _correct_smooth_error(self) -> bool:
        """Remove the smooth errors found by the residual check of the displaced grid; False if they
        are small.

        The sums are those of `work.base`.  A correction that shrinks corners is rejected.
        """
        work = self.work
        tuning = self.tuning
        if self.estimate * max(work.ni, work.nj) ** 2 < tuning.smooth_floor:
            return False  # n cells long, an error of d cells leaves a residual of some d (pi / n)²
        if work.spacing is not None:
            return False  # the sums are those of the sides' lengths
        if work.coarse.able:
            work.load_old()
        size = work.coarse.find(work.base, work.law, tuning.smooth_floor)
        if not tuning.smooth_floor < size < np.inf:
            return False
        moved = float(np.abs(work.base - work.old).max()) / math.sqrt(work.sigma)
        work.coarse.add(work.base, work.trial, min(1.0, tuning.smooth_part * moved / size))
        ratio = work.compare_corners(work.trial, work.old)
        if not ratio > min(self.moved_ratio, tuning.start_ratio):
            return False
        work.base, work.trial = work.trial, work.base
        self.moved_ratio = ratio
        return True

    def run(self) -> bool:
        """Perform the whole move if `is_settled` returned False, in halves if necessary.

        True when `work.trial` is valid.
        """
        work = self.work
        work.load_old()
        if work.sides is not work.own_sides:  # the displaced grid may share its array
            copy_sides(work.sides, work.own_sides)
            work.sides = work.own_sides
        if self.repairs:
            return self._make_anew()
        if self._advance():
            return True
        begin = work.old.copy()
        end = work.sides.copy()
        for halving in range(1, self.tuning.most_halvings + 1):
            parts = 2**halving
            work.keep_own(begin, end)
            self.ratio = np.inf
            for part in range(1, parts + 1):
                t = part / parts
                for now, then, there in zip(
                    get_sides(work.sides), get_sides(begin), get_sides(end), strict=True
                ):
                    now[:] = there if part == parts else then + t * (there - then)
                self._begin()
                if not (self.is_settled() or self._advance()):
                    break
                work.old[:] = work.trial
            else:
                self.sub_moves = parts - 1
                self.start = "halved"
                self.strayed = np.inf
                return True
        work.keep_own(begin, end)
        return self._make_anew()

    def _make_anew(self) -> bool:
        """A grid for the sides alone, which no motion leads to: the first that steps can settle.

        Where none settles, the one closest to it is taken (theory R5.4).
        """
        self._check_look()
        work = self.work
        if work.ni == 1 or work.nj == 1:
            return False
        self.rescues += 1
        self.sub_moves = 0
        self.residual = 0.0
        self.strayed = np.inf
        broken = self.broken
        self._begin()
        work.look()
        displaced = work.base.copy()
        best: np.ndarray | None = None
        least = np.inf
        possible: bool | None = None
        for start, nodes, way in self._list_beginnings(displaced):
            if way is None:
                if find_folded_cells(nodes).size:
                    continue
            else:
                if possible is None:
                    possible = best is not None or find_impossible(work.sides) is None
                self._begin()
                if not (possible and unfold(work, nodes, self.tuning, way)):
                    continue
            error = self._settle(nodes)
            if best is None or error < least:
                best = work.trial.copy()
                least = error
                self.start = start
            if error <= self.tuning.settled:
                break
        if best is None:
            work.trial[:] = displaced
            self.broken = broken
            return False
        work.trial[:] = best
        return self._accept_anew()

    def _list_beginnings(
        self, displaced: np.ndarray
    ) -> Iterator[tuple[str, np.ndarray, Unfolding | None]]:
        """Grids (2, ni+1, nj+1) to begin with, their names, and how they are unfolded if at all."""
        work = self.work
        straight = transfinite_grid(work.sides)
        yield "transfinite", straight, None
        yield "quasi-1d", quasi_1d_grid(work.sides, "i"), None
        yield "quasi-1d", quasi_1d_grid(work.sides, "j"), None
        for nodes, way in (
            (straight, Unfolding.STRAIGHT),
            (straight, Unfolding.GRADED_SPREAD),
            (straight, Unfolding.GRADED),
            (displaced, Unfolding.GRADED),
            (displaced, Unfolding.EVEN),
            (straight, Unfolding.EVEN),
            (straight, Unfolding.EVEN_SPREAD),
        ):
            yield "untangled", nodes.copy(), way

    def _settle(self, nodes: np.ndarray) -> float:
        """Steps from valid nodes (2, ni+1, nj+1) into `work.trial`; the residual left, in cells.

        Where the steps fail, the nodes themselves and infinity.
        """
        work = self.work
        work.trial[:] = nodes
        self.broken = False
        self.quality = None
        self.triangles = -1
        self._polish(0.0, self.tuning.most_settling)
        if self.broken or find_folded_cells(work.trial).size:
            self.broken = False
            work.trial[:] = nodes
            return np.inf
        return self.error

    def _accept_anew(self) -> bool:
        """`_accept` of `work.trial`, against itself where the grid before is folded."""
        work = self.work
        old = work.trial if self.repairs else work.old
        self.ratio = np.inf
        return self._accept(work.compare_corners(work.trial, old))

    def _check_look(self) -> None:
        if not self.untangles:
            raise Folded

    def _begin(self) -> None:
        """Spacing of the part's sides, and their motion."""
        self.broken = False
        self.work.begin(**self.arguments)

    def _advance(self) -> bool:
        """One part of the motion, `work.old` to `work.sides`, starting from the displaced grid.

        True when `work.trial` is valid.
        """
        work = self.work
        tuning = self.tuning
        self.quality = None
        self.triangles = -1
        if work.ni == 1 or work.nj == 1:
            work.trial[:] = work.base
            return self._accept(work.compare_corners(work.trial, work.old))
        slow = SLOW_SIDE_FRACTION * tuning.fast_sides
        fast = tuning.fast_sides
        stiffness = compute_stiffness(work.old, work.sides, tuning.stiffness, slow, fast)
        work.law = work.law._replace(stiffness=stiffness)
        work.find_symmetry()
        moved = self.moved_ratio > tuning.start_ratio
        folded = False
        if moved:
            done = self.iterations
            ratio = self._newton(work.base, work.old)
            if self.iterations == done:
                ratio = self.moved_ratio
            if self.error > self._get_lost():
                ratio = self._straighten(ratio)
            folded = self.broken
        else:
            ratio = self._predict()
            folded = ratio == 0.0
        if folded:
            self._check_look()
            if not ((not moved and self._follow()) or self._untangle()):
                return False
            ratio = 0.0
        settles = folded or work.spacing is not None  # a grid from elsewhere may be far from it
        steps = self._polish(ratio, tuning.most_polish if settles else tuning.more_steps, settles)
        if steps > 0 or self.start != "displacement" or not moved:
            ratio = work.compare_corners(work.trial, work.old)
        return self._accept(ratio)

    def _get_lost(self) -> float:
        """Residual in cells from which the straight-line grid is tried.

        An interior that lags behind leaves its residual at the sides: relative to their length.
        """
        inner = (self.work.ni - 1) * (self.work.nj - 1)
        around = self.work.ni + self.work.nj
        return self.tuning.lost / math.sqrt(inner / around)

    def _straighten(self, ratio: float) -> float:
        """Start from the straight-line grid instead, if that is valid and much closer."""
        work = self.work
        error = self.error
        broken = self.broken
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

    def _polish(self, ratio: float, most: int, afresh: bool = True) -> int:
        """Newton steps from `work.trial` while the last kept too small a fraction `ratio` of a
        corner; returns their number.

        After a fold (`afresh`) also until the residual is below `settled`, below the floor
        where a spacing is given.
        """
        work = self.work
        tuning = self.tuning
        settled = tuning.settled if work.spacing is None else tuning.floor
        for step in range(most):
            good = ratio > tuning.start_ratio
            if afresh:
                good = good and self.error <= settled
            if good and step >= tuning.newton_steps - 1:
                return step
            work.base[:] = work.trial
            ratio = self._newton(work.base, work.base)
            if self.broken:
                return step + 1
        return most

    def _predict(self) -> float:
        """Extend the boundary's motion inward by the Hessian of the old grid.

        Returns the least corner ratio of the step to `work.trial`, 0 if that is not valid.
        """
        work = self.work
        least = self.tuning.step_ratio
        work.assemble(work.old)
        self._solve(work.base - work.old)
        np.add(work.old, work.change, out=work.trial)
        copy_sides(work.sides, work.trial)
        ratio = work.compare_corners(work.trial, work.old)
        if ratio > least:
            return ratio
        return self._newton(work.base, work.base) if self.moved_ratio > least else 0.0

    def _follow(self) -> bool:
        """Follow the prediction as far as it keeps enough of every corner, renew it there, and so
        on to the new sides.

        True when that is `work.trial`; after too many parts it is the first prediction again.
        """
        work = self.work
        predicted = work.trial.copy()
        here = work.old.copy()
        left = np.empty_like(here)
        for _ in range(self.tuning.most_parts):
            part = self._go_along(here)
            if part == 1.0:
                self.start = "followed"
                return True
            if part == 0.0:
                break
            here[:] = work.trial
            fill_displacement(here, work.sides, left)
            work.assemble(here)
            self._solve(left)
            if self.broken:
                break
        work.trial[:] = predicted
        return False

    def _go_along(self, here: np.ndarray) -> float:
        """`work.trial` = a part of `work.change` away from a valid grid, by which no corner loses
        too much; returns the part, 0 where even a short one would."""
        work = self.work
        part = 1.0
        while part >= LEAST_FOLLOWED_PART:
            np.multiply(work.change, part, out=work.trial)
            work.trial += here
            if part == 1.0:
                copy_sides(work.sides, work.trial)
            if work.compare_corners(work.trial, here) > self.tuning.step_ratio:
                return part
            part *= 0.5
        return 0.0

    def _newton(self, base, old) -> float:
        """`work.trial` = a Newton step from the valid `base`, shortened node by node if necessary.

        Returns the least ratio of corner areas to those of `old`; those of `base` must exceed
        `step_ratio` times them.
        """
        work = self.work
        work.assemble(base)
        if self._solve(None) == 0:
            work.trial[:] = base
            return 0.0 if self.broken else 1.0
        np.add(base, work.change, out=work.trial)
        ratio = work.compare_corners(work.trial, old)
        return ratio if ratio > self.tuning.step_ratio else self._search(base, old)

    def _search(self, base, old) -> float:
        """The largest fraction of the step, shortened at corners as well, that decreases J.

        Far from the minimum Newton steps may lead uphill, and shortening at the corners alone
        leaves each of them a quarter of its area, step after step.
        """
        work = self.work
        barrier = work.compute_barrier(base)
        before, _ = work.compute_energy(base, 0.0, barrier)
        part = 1.0
        while part >= LEAST_PART:
            np.multiply(work.change, part, out=work.trial)
            work.trial += base
            shorten_steps(base, work.trial, old, self.tuning.step_ratio, work.shortening)
            if work.compute_energy(work.trial, 0.0, barrier)[0] < before:
                return work.compare_corners(work.trial, old)
            part *= 0.5
        work.trial[:] = base
        return work.compare_corners(base, old)

    def _solve(self, guess) -> int:
        """Fill `work.change`; returns the iterations, sets `error`, the initial residual in cells.

        Sets `broken` if the line solve overflows because corners are too sharp: a residual that is
        not finite, negative or zero does not indicate a minimum.
        """
        work = self.work
        tuning = self.tuning
        scale = work.sigma * (work.ni - 1) * (work.nj - 1)
        floor = max(tuning.floor, ROUND_OFF_RESIDUAL) ** 2 * scale
        if guess is None:
            done, first, last = work.solve(tuning.tolerance, floor, tuning.max_iterations)
        else:
            done, first, last = work.solve(
                tuning.exact_tolerance, floor, tuning.predict_iterations, guess
            )
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
        return ratio > DOUBTFUL_CORNER_RATIO or not find_folded_cells(self.work.trial).size

    def _untangle(self) -> bool:
        """Untangle the better of the displaced grid and the trial into `work.trial`."""
        work = self.work
        self.rescues += 1
        self.start = "untangled"
        worst = work.compute_energy(work.trial, 1.0)[1]
        moved = work.compute_energy(work.base, 1.0)[1]
        if moved < worst:
            work.base[:] = work.trial
        if not untangle(work, work.base, self.tuning):
            return False
        work.trial[:] = work.base
        return True
