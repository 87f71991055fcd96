"""The paper's own iteration by sweeps, as a reference for the Newton step.

    R = u + eps sigma dI/dr                                             theory R3.2
    R[i] + A[i] D[i] - q[i] D[i+1] - q[i-1] D[i-1] = 0                  theory R3.3

    1 spacing, lengths, sigma of the new boundary      4 tau halved where corners get too small
    2 a convex start, out of a chain of starts         5 the next sweep on all active nodes
    3 direction D along all lines at once

A has the node's own 2 × 2 Hessian of I, whose corners are those of `regrid.barrier.functional`.
From a convex grid every iterate is convex.  Note: with eps = 1e-2 an iteration reduces the error of
a shifted grid only by the factor of theory R3.7: the start determines the result, not the sweeps.

The size g of the terms in delta is the root of the sum of squares of the forces that the cells'
edges exert on a node: rotation invariant like the paper's (which is not printed), one root per
node.

The kernels are in `regrid.barrier.sweep_kernels`; they run over boxes of active nodes.  A corner
may already be below its floor (if the start was squeezed); it then must not lose more than half of
its area, otherwise no tau would be admissible.

Source: [CharakhchyanND] §2-4; theory R1, R2, R3.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.algebraic import displaced_grid, fill_quasi_1d
from shockgrid.regrid.barrier.side_inputs import (
    fill_family_weights,
    fill_spacings,
)
from shockgrid.regrid.barrier.sweep_kernels import (
    KEPT_LENGTH,
    MOST_CHUNK_LINES,
    SWEEP_SIZE,
    fill_active_boxes,
    fill_directions,
)
from shockgrid.regrid.barrier.tuning import Tuning
from shockgrid.regrid.barrier.untangle import untangle
from shockgrid.regrid.barrier.workspace import Workspace
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.corners import (
    BLOCK_CORNERS,
    TRIANGLES,
    count_turned_corners,
)
from shockgrid.regrid.measure.faults import check_grids, explain_failure
from shockgrid.regrid.measure.quality import compute_corner_areas, find_areas, take_edges
from shockgrid.regrid.protocol import RegridReport, RegridResult
from shockgrid.regrid.sides import compute_area, copy_sides, get_sides

FUNCTIONALS = ("regularised", "ivanenko-charakhchyan")
STARTS = ("displacement", "previous", "quasi-1d")
MOST_BOUNDARY_HALVINGS = 10  # nested, of the boundary's motion
MOST_TAU_ROUNDS = 400
LEAST_SWEEP_TAU = 0.5**20
KEPT_AREA_PART = 0.5  # of a corner that is below its floor already
# least new corner area relative to the old one; the paper has 0, plain convexity
LEAST_AREA_PART = 0.1
LEAST_UNTANGLING_EPSILON = 1e-4  # weight of the barrier while a grid is untangled, at least
PARABOLA_RANGE = (0.05, 2.0)  # of tau_s where a parabola gives it


def cut_block(ni: int, nj: int) -> np.ndarray:
    """Boxes (n, 4) of all inner nodes, of equal width."""
    count = -(-(nj - 1) // MOST_CHUNK_LINES)
    ends = 1 + (nj - 1) * np.arange(count + 1) // count
    first_rows = np.ones_like(ends[1:])
    return np.ascontiguousarray(
        np.stack([ends[:-1], ends[1:], first_rows, ni * first_rows], axis=1)
    )


def count_nodes(boxes: np.ndarray) -> int:
    """Number of nodes in boxes (n, 4)."""
    return int(((boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2])).sum())


class Sweeps:
    """Charakhch'yan's iteration as a regridder.

    `epsilon` weighs the barrier against the straight lines; `functional` "ivanenko-charakhchyan" is
    I alone with all edge lengths 1, the paper's method for comparison.  At most `sweeps` sweeps are
    made while some node's relative residual exceeds `tolerance` (0: all of them, on all nodes).
    tau_s is 1 in the first `plain_sweeps` sweeps, then set by a parabola.  `start` is the grid
    tried first.  `family` is "i" (lines j = const straight), "j", "auto", or two weights, the
    larger of which determines it.
    """

    def __init__(
        self,
        epsilon: float = 1e-2,
        edge_lengths: str = "conditional",
        functional: str = "regularised",
        sweeps: int = 15,
        tolerance: float = 1e-3,
        plain_sweeps: int = 4,
        start: str = "displacement",
        family="auto",
    ):
        for option, value, choices in (
            ("edge_lengths", edge_lengths, ("conditional", "unit")),
            ("functional", functional, FUNCTIONALS),
            ("start", start, STARTS),
        ):
            if value not in choices:
                raise BadInput(f"sweeps: {option} '{value}' is none of {', '.join(choices)}")
        self.without_lines = functional == "ivanenko-charakhchyan"
        if not (epsilon >= 0.0 and (epsilon > 0.0 or not self.without_lines)):
            raise BadInput(f"sweeps: epsilon {epsilon} must not be negative")
        self.epsilon = float(epsilon)
        self.floor = LEAST_AREA_PART
        self.start = start
        self.conditional = edge_lengths == "conditional" and not self.without_lines
        self.sweeps = int(sweeps)
        self.plain_sweeps = int(plain_sweeps)
        self.tolerance = float(tolerance)
        self.family = family
        self._works: dict[tuple[int, int], _SweepWork] = {}

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """The grid inside `boundary` (2, ni+1, nj+1; only its sides are read), near `previous`.

        Raises RegridFailure, naming side and nodes, if no start is convex.
        """
        previous, boundary = check_grids(previous, boundary)
        # in the frame where the lines j = const are the straight family
        transposed = self._choose_family(boundary) == "j"
        mirrored = (compute_area(previous) < 0.0) != transposed
        old = np.ascontiguousarray(_view_framed(previous, transposed, mirrored))
        wanted = old.copy()
        copy_sides(_view_framed(boundary, transposed, mirrored), wanted)
        work = self._work(previous.shape, transposed)
        work.begin(self)
        if not (compute_area(wanted) > 0.0 and work.move(old, wanted, MOST_BOUNDARY_HALVINGS)):
            raise explain_failure(boundary)
        # and back
        nodes = np.empty(previous.shape)
        upright = work.nodes[::-1] if mirrored else work.nodes
        nodes[:] = upright.transpose(0, 2, 1) if transposed else upright
        return RegridResult(nodes, work.report())

    def _choose_family(self, boundary) -> str:
        """The family of straight lines: "i" for the lines j = const, or "j"."""
        if self.family in ("i", "j"):
            return self.family
        weights = np.empty(2)
        if self.family == "auto":
            fill_family_weights(boundary, weights)
        else:
            weights[:] = self.family
        return "j" if weights[1] > weights[0] else "i"

    def _work(self, shape, transposed) -> _SweepWork:
        """The arrays for blocks of this shape."""
        ni, nj = shape[1] - 1, shape[2] - 1
        cells = (nj, ni) if transposed else (ni, nj)
        if cells not in self._works:
            self._works[cells] = _SweepWork(*cells)
        return self._works[cells]


class _SweepWork:
    """Arrays of one block in the frame where the lines j = const are the straight family."""

    def __init__(self, ni: int, nj: int):
        self.ni, self.nj = ni, nj
        shape = (2, ni + 1, nj + 1)
        self.nodes, self.trial, self.direction, self.other_direction = np.zeros((4, *shape))
        self.tau = np.ones(shape[1:])
        self.along_i, self.along_j = np.zeros((4, ni)), np.zeros((4, nj))
        self.blends = np.zeros(ni + 1), np.zeros(nj + 1)
        self.kept = np.zeros((ni + 1) * KEPT_LENGTH)
        self.scratch = np.zeros(SWEEP_SIZE)
        self.per_line, self.other_lines = np.zeros((2, 3, nj + 1))
        self.workspace: Workspace | None = None
        self.exempt_corners = 0

    def begin(self, options: Sweeps) -> None:
        """Take the options of a regrid, and count anew."""
        self.options = options
        self.sweeps_made = 0
        self.node_sweeps = 0
        self.sub_moves = 0
        self.rescues = 0
        self.ratio = np.inf
        self.residual = 0.0
        self.start = options.start

    def report(self) -> RegridReport:
        """What the regrid took."""
        return RegridReport(
            iterations=self.sweeps_made,
            node_iterations=self.node_sweeps,
            sub_moves=self.sub_moves,
            rescues=self.rescues,
            least_corner_ratio=float(self.ratio),
            residual=self.residual,
            start=self.start,
            exempt_corners=self.exempt_corners,
        )

    def move(self, old, wanted, halvings: int) -> bool:
        """Move `old` to the sides of `wanted`, in halves if necessary, into `self.nodes`."""
        if self._advance(old, wanted):
            return True
        if halvings == 0:
            return False
        half = old.copy()
        for half_side, old_side, wanted_side in zip(
            get_sides(half), get_sides(old), get_sides(wanted), strict=True
        ):
            half_side[:] = 0.5 * (old_side + wanted_side)
        if not self.move(old, half, halvings - 1):
            return False
        self.sub_moves += 1
        middle = self.nodes.copy()
        if not self.move(middle, wanted, halvings - 1):
            return False
        self.start = "halved"
        return True

    def _advance(self, old, wanted) -> bool:
        """Move `old` to the sides of `wanted` at once, into `self.nodes`; False if that fails."""
        options = self.options
        sigma = fill_spacings(wanted, options.conditional, self.along_i, self.along_j, *self.blends)
        self.pull = 0.0 if options.without_lines else 1.0
        self.weight = 0.25 * sigma * (1.0 if options.without_lines else options.epsilon)
        self.floors = fill_floors(old, options.floor)
        self.exempt_corners = count_turned_corners(wanted)
        if not self._begin_from_convex(old, wanted):
            return False
        if self.ni > 1 and self.nj > 1 and self.weight + self.pull > 0.0:
            self._iterate(sigma)
        area, ratio = self._measure(self.nodes, old)
        self.ratio = min(self.ratio, ratio)
        return area > 0.0

    def _measure(self, nodes, old) -> tuple[float, float]:
        """Least corner area, and least ratio to that of `old`, without the block's corners."""
        counted = self.floors >= 0.0
        if not counted.any():
            return np.inf, np.inf
        new = compute_corner_areas(nodes)[counted]
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(new.min()), float((new / compute_corner_areas(old)[counted]).min())

    def _begin_from_convex(self, old, wanted) -> bool:
        """Begin from the first convex grid of a chain of starts; False where none is convex.

        In two passes, of which the first also requires the floor.
        """
        grids = {}
        order = [self.options.start, *(start for start in STARTS if start != self.options.start)]
        for strict in (True, False):
            for start in order:
                if start not in grids:
                    grids[start] = self._make_start(start, old, wanted)
                area, ratio = self._measure(grids[start], old)
                if area > 0.0 and (ratio > self.options.floor or not strict):
                    self.nodes[:] = grids[start]
                    if start != self.options.start:
                        self.start = start
                    return True
        grid = grids["displacement"]
        if self._untangle(old, grid) and self._measure(grid, old)[0] > 0.0:
            self.nodes[:] = grid
            self.rescues += 1
            self.start = "untangled"
            return True
        return False

    def _make_start(self, start, old, wanted) -> np.ndarray:
        """A grid on the sides of `wanted`, which may be folded, by its name in STARTS."""
        if start == "displacement":
            return displaced_grid(old, wanted)
        grid = old.copy()
        if start == "quasi-1d":
            fill_quasi_1d(wanted, grid)
        copy_sides(wanted, grid)
        return grid

    def _untangle(self, old, grid) -> bool:
        """Unfold `grid` in place, with the barrier's straight lines; True where that succeeds."""
        if min(self.ni, self.nj) < 2:
            return False
        if self.workspace is None:
            self.workspace = Workspace(self.ni, self.nj, 1)
        work = self.workspace
        work.old[:] = old
        work.sides[:] = grid
        work.begin(
            self.options.conditional,
            1.0,
            0.0,
            Tuning(epsilon=max(self.options.epsilon, LEAST_UNTANGLING_EPSILON)),
        )
        return bool(untangle(work, grid)) and bool(np.isfinite(grid).all())

    def _iterate(self, sigma: float) -> None:
        """Sweeps from the convex `self.nodes`, first on all of them, then on those still active."""
        options = self.options
        all_boxes = cut_block(self.ni, self.nj)
        self.boxes = all_boxes
        is_whole = True
        # Outside the boxes the trial grid is the grid, before and after every sweep.
        self.trial[:] = self.nodes
        self.halved = True
        inner = (self.ni - 1) * (self.nj - 1)
        for sweep in range(options.sweeps):
            total, active = self._direct(self.nodes, self.direction, self.per_line)
            if sweep == 0:
                self.residual = max(self.residual, float(np.sqrt(total / (sigma * inner))))
            if active == 0:
                if is_whole:
                    return
                # the subset has converged: check all nodes once more
                self.boxes = all_boxes
                is_whole = True
                continue
            self.sweeps_made += 1
            self.node_sweeps += count_nodes(self.boxes)
            self._try_step(1.0)
            if sweep >= options.plain_sweeps:
                self._try_step(self._choose_tau_s(total))
            for j0, j1, i0, i1 in self.boxes:
                self.nodes[:, i0:i1, j0:j1] = self.trial[:, i0:i1, j0:j1]
            if options.tolerance > 0.0:
                boxes = np.empty((self.nj + 1, 4), dtype=np.int64)
                count = fill_active_boxes(self.ni, self.nj, self.per_line, self.boxes, boxes)
                is_whole = count_nodes(boxes[:count]) == inner
                self.boxes = all_boxes if is_whole else boxes[:count]

    def _direct(self, nodes, direction, per_line) -> tuple[float, int]:
        """Fill `direction` in the boxes; returns sum |R|² and the number of active lines."""
        return fill_directions(
            nodes, (self.along_i, self.along_j),
            (self.pull, self.weight, self.options.tolerance**2), self.boxes, self.kept,
            self.scratch, direction, per_line,
        )  # fmt: skip

    def _try_step(self, tau_s: float) -> None:
        """Trial grid with `tau_s`; tau0 halved node by node until it is convex."""
        if self.halved:
            self.tau[:] = 1.0
        self.halved = False
        areas_before = None
        for _ in range(MOST_TAU_ROUNDS):
            if try_step(
                self.nodes, self.direction, self.tau, tau_s, self.boxes, self.floors, self.trial
            ):
                return
            self.halved = True
            if areas_before is None:
                areas_before = compute_corner_areas(self.nodes)
            areas = compute_corner_areas(self.trial)
            if not halve_taus(areas, areas_before, self.floors, self.tau):
                return
        self.trial[:] = self.nodes

    def _choose_tau_s(self, at_zero: float) -> float:
        """tau_s at the minimum of the parabola through sum |R|² at 0, ½ and 1; `trial` is at 1."""
        at_one, _ = self._direct(self.trial, self.other_direction, self.other_lines)
        self._try_step(0.5)
        at_half, _ = self._direct(self.trial, self.other_direction, self.other_lines)
        curvature = 2.0 * (at_one + at_zero - 2.0 * at_half)
        slope = 4.0 * at_half - 3.0 * at_zero - at_one
        if not curvature > 0.0:
            return 1.0 if at_one < at_half else 0.5
        low, high = PARABOLA_RANGE
        return min(high, max(low, -0.5 * slope / curvature))


@kernel
def try_step(nodes, direction, tau, tau_s, boxes, floors, trial):
    """Trial nodes `r + tau_s tau D` in boxes; True if all corners of their cells exceed floors."""
    for b in range(boxes.shape[0]):
        first_line = boxes[b, 0]
        stop_line = boxes[b, 1]
        for k in range(2):
            for i in range(boxes[b, 2], boxes[b, 3]):
                # slices, because an index of unknown sign keeps the loop from vectorising
                row = nodes[k, i, first_line:stop_line]
                row_direction = direction[k, i, first_line:stop_line]
                row_trial = trial[k, i, first_line:stop_line]
                row_tau = tau[i, first_line:stop_line]
                for col in range(stop_line - first_line):
                    row_trial[col] = row[col] + tau_s * row_tau[col] * row_direction[col]
    # corners of the cells in and around the boxes
    failing = 0
    for b in range(boxes.shape[0]):
        first = boxes[b, 0] - 1
        stop = boxes[b, 1]
        for i in range(boxes[b, 2] - 1, boxes[b, 3]):
            x0, y0 = trial[0, i, first : stop + 1], trial[1, i, first : stop + 1]
            x1, y1 = trial[0, i + 1, first : stop + 1], trial[1, i + 1, first : stop + 1]
            least = floors[:, i, first:stop]
            for col in range(stop - first):
                area_1, area_2, area_3, area_4 = find_areas(*take_edges(x0, y0, x1, y1, col))
                is_good = (0.5 * area_1 > least[0, col]) & (0.5 * area_2 > least[1, col])
                is_good &= (0.5 * area_3 > least[2, col]) & (0.5 * area_4 > least[3, col])
                failing += 0 if is_good else 1
    return failing == 0


def fill_floors(old: np.ndarray, ratio: float) -> np.ndarray:
    """Least corner areas (4, ni, nj) allowed in a trial grid: `ratio` times those of `old`.

    The block's own corners have boundary nodes only, hence no floor.
    """
    floors = ratio * np.maximum(0.0, compute_corner_areas(old))
    for corner in BLOCK_CORNERS:
        floors[corner] = -np.inf
    return floors


def halve_taus(areas, areas_before, floors, tau) -> bool:
    """Halve `tau` at the nodes of corner triangles (4, n, m) that are too small; True if any are.

    Too small is below the floor and below KEPT_AREA_PART of the area before, or not positive.
    """
    too_small = ~(areas > floors) & (floors >= 0.0)
    too_small &= ~((areas > np.minimum(floors, KEPT_AREA_PART * areas_before)) & (areas > 0.0))
    if not too_small.any():
        return False
    marked = np.zeros(tau.shape, dtype=bool)
    for triangle, cells in zip(TRIANGLES, too_small, strict=True):
        for i, j in triangle:
            marked[i : i + cells.shape[0], j : j + cells.shape[1]] |= cells
    tau[marked] = np.where(tau[marked] > LEAST_SWEEP_TAU, 0.5 * tau[marked], 0.0)
    return True


def _view_framed(nodes, transposed: bool, mirrored: bool) -> np.ndarray:
    """A view of a grid with i and j exchanged, and x and y, as wanted."""
    view = nodes.transpose(0, 2, 1) if transposed else nodes
    return view[::-1] if mirrored else view
