"""One move of the barrier regridder: from a valid grid to new sides.  What is tried, in order:

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
from typing import NamedTuple

import numpy as np

from shockgrid.regrid.algebraic import (
    fill_displacement,
    fill_quasi_1d,
    quasi_1d_grid,
    transfinite_grid,
)
from shockgrid.regrid.barrier.side_inputs import compute_stiffness
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
LEAST_STEP_FRACTION = 1.0 / 64.0  # of a Newton step that would lead uphill
# of a predicted motion: shorter ones are not worth a solve
LEAST_FOLLOWED_FRACTION = 1.0 / 8.0


class Folded(Exception):
    """A grid has to be untangled, and the block's orientation was not chosen for that."""


class StartingGrid(NamedTuple):
    """A grid to begin with: its name for the report, and how it is unfolded, if at all."""

    name: str
    nodes: np.ndarray
    unfolding: Unfolding | None


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
        # what the report says
        self.iterations = 0
        self.rescues = 0
        self.sub_moves = 0
        self.residual = 0.0
        self.ratio = np.inf
        self.start = "displacement"
        self.strayed = np.inf
        self.quality: tuple[float, float, int, int] | None = None
        self.triangles = -1  # unknown
        # of the displaced grid: least ratio of its corners to the old ones, estimated residual
        self.displaced_ratio = 0.0
        self.estimate = np.inf
        # of the last solve: residual of the grid it began with, whether it failed
        self.error = np.inf
        self.solve_failed = False
        self._begin()
        self.exempt_corners = work.side_numbers.turned_corners

    def report(self) -> RegridReport:
        """What the move took, and the quality of its grid."""
        inner = (self.work.ni - 1) * (self.work.nj - 1)
        return RegridReport(
            iterations=self.iterations,
            node_iterations=self.iterations * inner,
            sub_moves=self.sub_moves,
            rescues=self.rescues,
            least_corner_ratio=self.ratio,
            residual=self.residual,
            start=self.start,
            exempt_corners=self.exempt_corners,
            triangles=count_triangles(self.work.trial) if self.triangles < 0 else self.triangles,
            strayed=self.strayed if self.strayed < np.inf else None,
            quality=self.quality,
        )

    def try_displaced_grid(self) -> bool:
        """Displace the old grid with its sides, and correct its smooth errors.

        True if its residual is small then: it is `work.trial`.
        """
        work = self.work
        tuning = self.tuning
        if work.ni == 1 or work.nj == 1:
            work.load_old()
            copy_sides(work.sides, work.base)
            return False
        self.displaced_ratio, self.estimate, strayed = work.check_displaced_grid()
        corrected = False
        if self.displaced_ratio > tuning.start_ratio and self._correct_smooth_error():
            strayed = np.inf
            corrected = True
        accepted = max(tuning.idle * tuning.floor, ROUND_OFF_RESIDUAL)
        is_small = self.estimate <= min(accepted, self._find_lost_residual())
        if not (self.displaced_ratio > tuning.start_ratio and is_small):
            return False
        self.residual = max(self.residual, self.estimate)
        self.strayed = strayed
        if not corrected:
            self.quality = work.get_quality()
            self.triangles = work.marks.bit_count()
        if self.displaced_ratio <= DOUBTFUL_CORNER_RATIO:  # all of the grid will be read
            work.load_old()
        work.base, work.trial = work.trial, work.base
        return self._accept(self.displaced_ratio)

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
        if work.coarse.is_possible:
            work.load_old()
        size = work.coarse.find(work.base, work.inputs, tuning.smooth_floor)
        if not tuning.smooth_floor < size < np.inf:
            return False
        moved = float(np.abs(work.base - work.old).max()) / math.sqrt(work.sigma)
        work.coarse.add(work.base, work.trial, min(1.0, tuning.smooth_part * moved / size))
        ratio = work.compare_corners(work.trial, work.old)
        if not ratio > min(self.displaced_ratio, tuning.start_ratio):
            return False
        work.base, work.trial = work.trial, work.base
        self.displaced_ratio = ratio
        return True

    def run(self) -> bool:
        """Perform the whole move if `try_displaced_grid` returned False, in halves if necessary.

        True when `work.trial` is valid.
        """
        work = self.work
        work.load_old()
        if work.sides is not work.sides_array:  # the displaced grid may share its array
            copy_sides(work.sides, work.sides_array)
            work.sides = work.sides_array
        if self.repairs:
            return self._make_from_sides()
        if self._advance():
            return True
        first_grid = work.old.copy()
        last_sides = work.sides.copy()
        for halving in range(1, self.tuning.most_halvings + 1):
            if self._move_in_parts(first_grid, last_sides, 2**halving):
                return True
        work.copy_to_arrays(first_grid, last_sides)
        return self._make_from_sides()

    def _move_in_parts(self, first_grid: np.ndarray, last_sides: np.ndarray, parts: int) -> bool:
        """The whole move in so many equal parts of the sides' motion; True where all succeed."""
        work = self.work
        work.copy_to_arrays(first_grid, last_sides)
        self.ratio = np.inf
        for part in range(1, parts + 1):
            fraction = part / parts
            for side, first, last in zip(
                get_sides(work.sides), get_sides(first_grid), get_sides(last_sides), strict=True
            ):
                side[:] = last if part == parts else first + fraction * (last - first)
            self._begin()
            if not (self.try_displaced_grid() or self._advance()):
                return False
            work.old[:] = work.trial
        self.sub_moves = parts - 1
        self.start = "halved"
        self.strayed = np.inf
        return True

    def _make_from_sides(self) -> bool:
        """A grid for the sides alone, which no motion leads to: the first that steps can settle.

        Where none settles, the one closest to it is taken (theory R5.4).
        """
        self._require_orientation()
        work = self.work
        if work.ni == 1 or work.nj == 1:
            return False
        self.rescues += 1
        self.sub_moves = 0
        self.residual = 0.0
        self.strayed = np.inf
        failed_before = self.solve_failed
        self._begin()
        work.check_displaced_grid()
        displaced = work.base.copy()
        # the grid that comes closest to settling
        best: np.ndarray | None = None
        least_error = np.inf
        can_exist: bool | None = None
        for start in self._list_starting_grids(displaced):
            if start.unfolding is None:
                if find_folded_cells(start.nodes).size:
                    continue
            else:
                if can_exist is None:
                    can_exist = best is not None or find_impossible(work.sides) is None
                self._begin()
                if not (can_exist and unfold(work, start.nodes, self.tuning, start.unfolding)):
                    continue
            error = self._settle(start.nodes)
            if best is None or error < least_error:
                best = work.trial.copy()
                least_error = error
                self.start = start.name
            if error <= self.tuning.settled:
                break
        if best is None:
            work.trial[:] = displaced
            self.solve_failed = failed_before
            return False
        work.trial[:] = best
        return self._accept_from_sides()

    def _list_starting_grids(self, displaced: np.ndarray) -> Iterator[StartingGrid]:
        """Grids (2, ni+1, nj+1) to begin with, in the order of the table in theory R5."""
        work = self.work
        transfinite = transfinite_grid(work.sides)
        yield StartingGrid("transfinite", transfinite, None)
        yield StartingGrid("quasi-1d", quasi_1d_grid(work.sides, "i"), None)
        yield StartingGrid("quasi-1d", quasi_1d_grid(work.sides, "j"), None)
        for nodes, unfolding in (
            (transfinite, Unfolding.STRAIGHT),
            (transfinite, Unfolding.GRADED_SPREAD),
            (transfinite, Unfolding.GRADED),
            (displaced, Unfolding.GRADED),
            (displaced, Unfolding.EVEN),
            (transfinite, Unfolding.EVEN),
            (transfinite, Unfolding.EVEN_SPREAD),
        ):
            yield StartingGrid("untangled", nodes.copy(), unfolding)

    def _settle(self, nodes: np.ndarray) -> float:
        """Steps from valid nodes (2, ni+1, nj+1) into `work.trial`; the residual left, in cells.

        Where the steps fail, the nodes themselves and infinity.
        """
        work = self.work
        work.trial[:] = nodes
        self.solve_failed = False
        self.quality = None
        self.triangles = -1
        self._polish(0.0, self.tuning.most_settling)
        if self.solve_failed or find_folded_cells(work.trial).size:
            self.solve_failed = False
            work.trial[:] = nodes
            return np.inf
        return self.error

    def _accept_from_sides(self) -> bool:
        """`_accept` of `work.trial`, against itself where the grid before is folded."""
        work = self.work
        old = work.trial if self.repairs else work.old
        self.ratio = np.inf
        return self._accept(work.compare_corners(work.trial, old))

    def _require_orientation(self) -> None:
        """Raise `Folded` unless the block's orientation was chosen for untangling."""
        if not self.untangles:
            raise Folded

    def _begin(self) -> None:
        """Spacing of the part's sides, and their motion."""
        self.solve_failed = False
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
        work.inputs = work.inputs._replace(stiffness=stiffness)
        work.find_symmetry()
        # a Newton step from the displaced grid, or the prediction
        can_start = self.displaced_ratio > tuning.start_ratio
        if can_start:
            iterations_before = self.iterations
            ratio = self._newton(work.base, work.old)
            if self.iterations == iterations_before:
                ratio = self.displaced_ratio
            if self.error > self._find_lost_residual():
                ratio = self._straighten(ratio)
            is_folded = self.solve_failed
        else:
            ratio = self._predict()
            is_folded = ratio == 0.0
        # unfolded if necessary
        if is_folded:
            self._require_orientation()
            if not ((not can_start and self._follow()) or self._untangle()):
                return False
            ratio = 0.0
        # more steps: a grid from elsewhere may be far from the minimum
        settles = is_folded or work.spacing is not None
        most_steps = tuning.most_polish if settles else tuning.more_steps
        steps = self._polish(ratio, most_steps, settles)
        if steps > 0 or self.start != "displacement" or not can_start:
            ratio = work.compare_corners(work.trial, work.old)
        return self._accept(ratio)

    def _find_lost_residual(self) -> float:
        """Residual in cells from which the straight-line grid is tried.

        An interior that lags behind leaves its residual at the sides: relative to their length.
        """
        inner_nodes = (self.work.ni - 1) * (self.work.nj - 1)
        side_cells = self.work.ni + self.work.nj
        return self.tuning.lost / math.sqrt(inner_nodes / side_cells)

    def _straighten(self, ratio: float) -> float:
        """Start from the straight-line grid instead, if that is valid and much closer."""
        work = self.work
        error = self.error
        failed_before = self.solve_failed
        trial_before = work.trial.copy()
        fill_quasi_1d(work.sides, work.base)
        if work.compare_corners(work.base, work.old) > 0.0:
            straight_ratio = self._newton(work.base, work.base)
            if not self.solve_failed and self.error < 0.5 * error:
                self.start = "quasi-1d"
                return straight_ratio
        work.trial[:] = trial_before
        self.solve_failed = failed_before
        return ratio

    def _polish(self, ratio: float, most_steps: int, settles: bool = True) -> int:
        """Newton steps from `work.trial` while the last kept too small a fraction `ratio` of a
        corner; returns their number.

        If the grid `settles`, also until the residual is below `settled`, below the floor where a
        spacing is kept.
        """
        work = self.work
        tuning = self.tuning
        settled = tuning.settled if work.spacing is None else tuning.floor
        for step in range(most_steps):
            is_good = ratio > tuning.start_ratio
            if settles:
                is_good = is_good and self.error <= settled
            if is_good and step >= tuning.newton_steps - 1:
                return step
            work.base[:] = work.trial
            ratio = self._newton(work.base, work.base)
            if self.solve_failed:
                return step + 1
        return most_steps

    def _predict(self) -> float:
        """Extend the boundary's motion inward by the Hessian of the old grid.

        Returns the least corner ratio of the step to `work.trial`, 0 if that is not valid.
        """
        work = self.work
        step_ratio = self.tuning.step_ratio
        work.assemble(work.old)
        self._solve(work.base - work.old)
        np.add(work.old, work.change, out=work.trial)
        copy_sides(work.sides, work.trial)
        ratio = work.compare_corners(work.trial, work.old)
        if ratio > step_ratio:
            return ratio
        return self._newton(work.base, work.base) if self.displaced_ratio > step_ratio else 0.0

    def _follow(self) -> bool:
        """Follow the prediction as far as it keeps enough of every corner, renew it there, and so
        on to the new sides.

        True when that is `work.trial`; after too many parts it is the first prediction again.
        """
        work = self.work
        predicted = work.trial.copy()
        reached = work.old.copy()
        remaining = np.empty_like(reached)
        for _ in range(self.tuning.most_parts):
            fraction = self._go_along(reached)
            if fraction == 1.0:
                self.start = "followed"
                return True
            if fraction == 0.0:
                break
            reached[:] = work.trial
            fill_displacement(reached, work.sides, remaining)
            work.assemble(reached)
            self._solve(remaining)
            if self.solve_failed:
                break
        work.trial[:] = predicted
        return False

    def _go_along(self, reached: np.ndarray) -> float:
        """`work.trial` = a fraction of `work.change` away from a valid grid, by which no corner
        loses too much; returns the fraction, 0 where even a small one would."""
        work = self.work
        fraction = 1.0
        while fraction >= LEAST_FOLLOWED_FRACTION:
            np.multiply(work.change, fraction, out=work.trial)
            work.trial += reached
            if fraction == 1.0:
                copy_sides(work.sides, work.trial)
            if work.compare_corners(work.trial, reached) > self.tuning.step_ratio:
                return fraction
            fraction *= 0.5
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
            return 0.0 if self.solve_failed else 1.0
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
        energy_before, _ = work.compute_energy(base, 0.0, barrier)
        fraction = 1.0
        while fraction >= LEAST_STEP_FRACTION:
            np.multiply(work.change, fraction, out=work.trial)
            work.trial += base
            shorten_steps(base, work.trial, old, self.tuning.step_ratio, work.shortening)
            if work.compute_energy(work.trial, 0.0, barrier)[0] < energy_before:
                return work.compare_corners(work.trial, old)
            fraction *= 0.5
        work.trial[:] = base
        return work.compare_corners(base, old)

    def _solve(self, guess) -> int:
        """Fill `work.change`; returns the iterations, sets `error`, the initial residual in cells.

        Sets `solve_failed` if the line solve overflows because corners are too sharp: a residual
        that is not finite, negative or zero does not indicate a minimum.
        """
        work = self.work
        tuning = self.tuning
        scale = work.sigma * (work.ni - 1) * (work.nj - 1)
        floor = max(tuning.floor, ROUND_OFF_RESIDUAL) ** 2 * scale
        if guess is None:
            iterations, first, last = work.solve(tuning.tolerance, floor, tuning.max_iterations)
        else:
            iterations, first, last = work.solve(
                tuning.exact_tolerance, floor, tuning.predict_iterations, guess
            )
        self.iterations += iterations
        is_valid = first >= -floor and np.isfinite(first) and np.isfinite(last)
        self.solve_failed = not is_valid
        self.solve_failed |= first == 0.0 and bool(work.r.any())
        if self.solve_failed:
            self.error = np.inf
            return iterations
        self.error = float(np.sqrt(max(first, 0.0) / scale))
        self.residual = max(self.residual, self.error)
        return iterations

    def _accept(self, ratio: float) -> bool:
        """Report the least ratio; True when `work.trial` is valid."""
        self.ratio = min(self.ratio, ratio)
        if not ratio > 0.0 or self.solve_failed:
            return False
        return ratio > DOUBTFUL_CORNER_RATIO or not find_folded_cells(self.work.trial).size

    def _untangle(self) -> bool:
        """Untangle the better of the displaced grid and the trial into `work.trial`."""
        work = self.work
        self.rescues += 1
        self.start = "untangled"
        trial_least_area = work.compute_least_area(work.trial)
        displaced_least_area = work.compute_least_area(work.base)
        if displaced_least_area < trial_least_area:
            work.base[:] = work.trial
        if not untangle(work, work.base, self.tuning):
            return False
        work.trial[:] = work.base
        return True
