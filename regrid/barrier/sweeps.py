"""The paper's own iteration, sweep by sweep: the reference beside the Newton step.

    1 laws, lengths, sigma from the new boundary      4 tau halved where corners fall too low
    2 a convex start, out of a chain of starts         5 the next sweep on what is still active
    3 direction D along all lines at once

From a convex grid every iterate is convex.  The trap: with eps = 1e-2 an iteration leaves the
factor of theory R3.7 of a shifted grid's error: the start decides, not the sweeps.

Source: [CharakhchyanND] §2-4; theory R1, R2, R3.
Its kernels: `regrid.barrier.sweep_kernels`.
"""

from __future__ import annotations

import numpy as np

from regrid.algebraic import fill_displacement, fill_quasi_1d
from regrid.barrier import sweep_kernels as steps
from regrid.barrier.side_laws import SIGMA, fill_family_weights, fill_laws
from regrid.barrier.sweep_kernels import KEPT, ROWS, fill_directions
from regrid.barrier.tuning import Tuning
from regrid.barrier.untangle import untangle
from regrid.barrier.workspace import Workspace
from regrid.errors import BadInput
from regrid.measure.corners import count_turned_corners
from regrid.measure.faults import check_grids, explain_failure
from regrid.protocol import RegridReport, RegridResult
from regrid.sides import compute_area, copy_sides, get_sides

FUNCTIONALS = ("regularised", "ivanenko-charakhchyan")
STARTS = ("displacement", "previous", "quasi-1d")
MOST_HALVINGS = 10  # of the boundary's motion, one inside the other
MOST_TAU_ROUNDS = 400
PARABOLA_RANGE = (0.05, 2.0)


class Sweeps:
    """Charakhch'yan's iteration as a regridder.

    `epsilon` weighs the barrier against the straight lines; `functional` "ivanenko-charakhchyan"
    is I alone with all edge lengths 1, the method it is compared with.  At most `sweeps` sweeps are
    made, while some node's relative residual exceeds `tolerance` (0: all of them, on all nodes).
    tau_s is 1 in the first `plain_sweeps` ones, then set by a parabola.  `floor` is the least new
    corner area relative to the old one (0: the paper's plain convexity).  `start` is the grid that
    is tried first.  `family` is "i" (lines j = const straight), "j", "auto", or two weights of
    which the larger counts.
    """

    def __init__(
        self,
        epsilon: float = 1e-2,
        edge_lengths: str = "conditional",
        functional: str = "regularised",
        sweeps: int = 15,
        tolerance: float = 1e-3,
        plain_sweeps: int = 4,
        floor: float = 0.1,
        start: str = "displacement",
        family="auto",
        threads: int = 1,
    ):
        for word, value, known in (
            ("edge_lengths", edge_lengths, ("conditional", "unit")),
            ("functional", functional, FUNCTIONALS),
            ("start", start, STARTS),
        ):
            if value not in known:
                raise BadInput(f"sweeps: {word} '{value}' is none of {', '.join(known)}")
        self.alone = functional == "ivanenko-charakhchyan"
        if not (epsilon >= 0.0 and (epsilon > 0.0 or not self.alone)):
            raise BadInput(f"sweeps: epsilon {epsilon} must not be negative")
        if not 0.0 <= floor < 1.0:
            raise BadInput(f"sweeps: floor {floor} must lie in 0..1, below 1")
        self.epsilon, self.floor, self.start = float(epsilon), float(floor), start
        self.conditional = edge_lengths == "conditional" and not self.alone
        self.sweeps, self.plain_sweeps = int(sweeps), int(plain_sweeps)
        self.tolerance = float(tolerance)
        self.family = family
        self._blocks: dict[tuple[int, int], _Block] = {}

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """The grid inside `boundary` (2, ni+1, nj+1; only its sides are read), near `previous`.

        Raises RegridFailure, naming side and nodes, when no start is convex.
        """
        previous, boundary = check_grids(previous, boundary)
        transposed = self._family_of(boundary) == "j"
        mirrored = (compute_area(previous) < 0.0) != transposed
        block = self._block(previous.shape, transposed)
        view = _framed(boundary, transposed, mirrored)
        old = np.ascontiguousarray(_framed(previous, transposed, mirrored))
        wanted = old.copy()
        copy_sides(view, wanted)
        block.begin(self)
        if not (compute_area(wanted) > 0.0 and block.move(old, wanted, MOST_HALVINGS)):
            raise explain_failure(boundary)
        nodes = np.empty(previous.shape)
        found = block.nodes[::-1] if mirrored else block.nodes
        nodes[:] = found.transpose(0, 2, 1) if transposed else found
        return RegridResult(nodes, block.report())

    def _family_of(self, boundary) -> str:
        if self.family in ("i", "j"):
            return self.family
        weights = np.empty(2)
        if self.family == "auto":
            fill_family_weights(boundary, weights)
        else:
            weights[:] = self.family
        return "j" if weights[1] > weights[0] else "i"

    def _block(self, shape, transposed) -> _Block:
        ni, nj = shape[1] - 1, shape[2] - 1
        key = (nj, ni) if transposed else (ni, nj)
        if key not in self._blocks:
            self._blocks[key] = _Block(*key)
        return self._blocks[key]


class _Block:
    """Arrays of one block in the frame where the lines j = const are the straight family."""

    def __init__(self, ni: int, nj: int):
        self.ni, self.nj = ni, nj
        shape = (2, ni + 1, nj + 1)
        for name in ("nodes", "trial", "direction", "other_direction"):
            setattr(self, name, np.zeros(shape))
        self.tau, self.marked = np.ones(shape[1:]), np.zeros(shape[1:])
        self.floors, self.row = np.zeros((4, ni, nj)), np.zeros(nj)
        self.laws_i, self.laws_j, self.scalars = np.zeros((4, ni)), np.zeros((4, nj)), np.zeros(4)
        self.kept, self.scratch = np.zeros((ni + 1) * KEPT), np.zeros(ROWS)
        self.per_line, self.other_lines = np.zeros((3, nj + 1)), np.zeros((3, nj + 1))
        self.boxes, self.next_boxes = (np.zeros((nj + 1, 4), dtype=np.int64) for _ in range(2))
        self.count = 0
        self.workspace: Workspace | None = None

    def begin(self, options: Sweeps) -> None:
        self.options = options
        self.sweeps = self.node_sweeps = self.sub_moves = self.rescues = 0
        self.ratio, self.residual, self.start = np.inf, 0.0, options.start

    def report(self) -> RegridReport:
        return RegridReport(
            iterations=self.sweeps,
            node_iterations=self.node_sweeps,
            sub_moves=self.sub_moves,
            rescues=self.rescues,
            least_corner_ratio=float(self.ratio),
            residual=self.residual,
            start=self.start,
            exempt_corners=self.exempt,
        )

    def move(self, old, wanted, halvings: int) -> bool:
        """From the grid `old` to the sides of `wanted`, in halves if need be; into `self.nodes`."""
        if self._advance(old, wanted):
            return True
        if halvings == 0:
            return False
        half = old.copy()
        for target, a, b in zip(get_sides(half), get_sides(old), get_sides(wanted), strict=True):
            target[:] = 0.5 * (a + b)
        if not self.move(old, half, halvings - 1):
            return False
        self.sub_moves += 1
        middle = self.nodes.copy()
        # A failure here means that the boundary itself is at fault: few more halves are tried.
        if not self.move(middle, wanted, halvings - 1):
            return False
        self.start = "halved"
        return True

    def _advance(self, old, wanted) -> bool:
        options = self.options
        fill_laws(wanted, int(options.conditional), self.laws_i, self.laws_j, self.scalars)
        sigma = float(self.scalars[SIGMA])
        self.pull = 0.0 if options.alone else 1.0
        self.weight = 0.25 * sigma * (1.0 if options.alone else options.epsilon)
        steps.fill_floors(old, options.floor, self.floors)
        self.exempt = count_turned_corners(wanted)
        if not self._begin_from_convex(old, wanted):
            return False
        if self.ni > 1 and self.nj > 1 and self.weight + self.pull > 0.0:
            self._iterate(sigma)
        area, ratio = steps.measure_least_corners(self.nodes, old, self.floors)
        self.ratio = min(self.ratio, float(ratio))
        return area > 0.0

    def _begin_from_convex(self, old, wanted) -> bool:
        """The chain of starts: two passes, the first one asks for the floor as well."""
        grids = {}
        order = [self.options.start, *(s for s in STARTS if s != self.options.start)]
        for strict in (True, False):
            for start in order:
                if start not in grids:
                    grids[start] = self._make_start(start, old, wanted)
                area, ratio = steps.measure_least_corners(grids[start], old, self.floors)
                if area > 0.0 and (ratio > self.options.floor or not strict):
                    self.nodes[:] = grids[start]
                    if start != self.options.start:
                        self.start = start
                    return True
        grid = grids["displacement"]
        if self._untangle(old, grid):
            area, _ = steps.measure_least_corners(grid, old, self.floors)
            if area > 0.0:
                self.nodes[:] = grid
                self.rescues += 1
                self.start = "untangled"
                return True
        return False

    def _make_start(self, start, old, wanted):
        grid = np.empty_like(old)
        if start == "displacement":
            fill_displacement(old, wanted, grid)
            grid += old
        elif start == "previous":
            grid[:] = old
        else:
            fill_quasi_1d(wanted, grid)
        copy_sides(wanted, grid)
        return grid

    def _untangle(self, old, grid) -> bool:
        if min(self.ni, self.nj) < 2:
            return False
        if self.workspace is None:
            self.workspace = Workspace(self.ni, self.nj, 1)
        work = self.workspace
        work.old[:], work.sides[:] = old, grid
        work.begin(
            self.options.conditional, 1.0, 0.0, Tuning(epsilon=max(self.options.epsilon, 1e-4))
        )
        return bool(untangle(work, grid)) and bool(np.isfinite(grid).all())

    def _iterate(self, sigma: float) -> None:
        options = self.options
        whole = self.count = steps.fill_whole_block(self.ni, self.nj, self.boxes)
        # Outside the boxes the trial grid is the grid, before and after every sweep.
        self.trial[:] = self.nodes
        self.tau[:] = 1.0
        self.halved = False
        inner = (self.ni - 1) * (self.nj - 1)
        is_whole = True
        for sweep in range(options.sweeps):
            total, active = self._direct(self.nodes, self.direction, self.per_line)
            if sweep == 0:
                self.residual = max(self.residual, float(np.sqrt(total / (sigma * inner))))
            if active == 0:
                if is_whole:
                    return
                # The subset has converged: look once at all nodes again.
                self.count = steps.fill_whole_block(self.ni, self.nj, self.boxes)
                is_whole = True
                continue
            self.sweeps += 1
            self.node_sweeps += int(steps.count_box_nodes(self.boxes, self.count))
            share = 1.0
            self._try(share)
            if sweep >= options.plain_sweeps:
                share = self._share_by_parabola(total)
                self._try(share)
            steps.copy_boxes(self.trial, self.boxes, self.count, self.nodes)
            if options.tolerance > 0.0:
                self.count, is_whole = self._next_boxes(inner, whole)

    def _direct(self, nodes, direction, per_line):
        return fill_directions(
            nodes,
            self.laws_i,
            self.laws_j,
            self.pull,
            self.weight,
            self.options.tolerance**2,
            self.boxes,
            self.count,
            self.kept,
            self.scratch,
            direction,
            per_line,
        )

    def _next_boxes(self, inner: int, whole: int) -> tuple[int, bool]:
        count = steps.fill_active_boxes(
            self.ni, self.nj, self.per_line, self.boxes, self.count, self.next_boxes
        )
        if steps.count_box_nodes(self.next_boxes, count) == inner:
            return steps.fill_whole_block(self.ni, self.nj, self.boxes), True
        self.boxes, self.next_boxes = self.next_boxes, self.boxes
        return count, False

    def _try(self, share: float) -> None:
        """Trial grid with tau_s = `share`; tau0 halved node by node until it is convex."""
        arguments = (self.nodes, self.direction, self.tau, share, self.boxes, self.count)
        if self.halved:
            self.tau[:] = 1.0
            self.halved = False
        steps.fill_trial(*arguments, self.trial)
        if steps.check_floors(self.trial, self.floors, self.boxes, self.count, self.row):
            return
        self.halved = True
        for _ in range(MOST_TAU_ROUNDS):
            failing = steps.halve_taus(
                self.nodes, self.trial, self.floors, self.boxes, self.count, self.tau, self.marked
            )
            if failing == 0:
                return
            steps.fill_trial(*arguments, self.trial)
        steps.copy_boxes(self.nodes, self.boxes, self.count, self.trial)

    def _share_by_parabola(self, at_zero: float) -> float:
        """tau_s where the parabola through sum |R|² at 0, ½ and 1 is least; `trial` is at 1."""
        at_one, _ = self._direct(self.trial, self.other_direction, self.other_lines)
        self._try(0.5)
        at_half, _ = self._direct(self.trial, self.other_direction, self.other_lines)
        bend = 2.0 * (at_one + at_zero - 2.0 * at_half)
        slope = 4.0 * at_half - 3.0 * at_zero - at_one
        if not bend > 0.0:
            return 1.0 if at_one < at_half else 0.5
        low, high = PARABOLA_RANGE
        return min(high, max(low, -0.5 * slope / bend))


def _framed(nodes, transposed: bool, mirrored: bool):
    view = nodes.transpose(0, 2, 1) if transposed else nodes
    return view[::-1] if mirrored else view
