"""The barrier regridder for blocks of hexahedra: straight lines, and a barrier against folding.

`regrid(previous, boundary)` moves a valid grid to six new faces (theory R14) by Newton steps, if
necessary in parts.  All eight corner tetrahedra of every hexahedron returned have positive volume;
otherwise RegridFailure names face and node.  Note: this is weaker than a positive trilinear
Jacobian everywhere in a cell; `regrid.measure.hexahedra` measures both.

`HexahedraMove.run` and the methods below it define the order of trials; parameters are those of the
plane barrier regridder unless stated otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.hexahedra.faces import (
    Functional,
    check_grids_in_space,
    compute_edge_spacings,
    compute_face_lengths,
    compute_family_weights,
    compute_volume,
    copy_faces,
    explain_failure,
    fill_from_faces,
    find_turned_edge,
    find_unit_in_space,
    move_with_faces,
)
from shockgrid.regrid.hexahedra.functional import (
    HEXAHEDRON_SIZE,
    LONGEST_HEXAHEDRON_ROW,
    ONLY_ENERGY,
    WITH_MATRIX,
    assemble,
    compare_corners,
    fill_product,
    fill_strength,
    halve_steps,
)
from shockgrid.regrid.hexahedra.solve import CoarseBlock, factor_lines, solve, solve_lines
from shockgrid.regrid.protocol import RegridReport, RegridResult

LEAST_RATIO = 0.1  # least ratio of a predicted corner volume to its old value
# the step starts from the moved grid if it keeps this much of every corner
MOVED_GRID_START_RATIO = 0.5
STEP_RATIO = 0.25  # a step on the final faces keeps this much of every corner, node by node,
SMOOTH_RATIO = 0.5  # and is followed by another one if it kept less than this
LEAST_STEP_FRACTION = 1.0 / 64.0  # of a Newton step that would lead uphill
MOST_SHORTENINGS = 40
MOST_NEWTON_STEPS = 6  # Newton steps after the first
MOST_POLISH = 15  # Newton steps after untangling, until the residual is below SETTLED_MOVE cells
SETTLED_MOVE = 0.02
# the solve that extends the faces' motion inward
EXTENSION_TOLERANCE = 0.01
EXTENSION_ITERATIONS = 30
# a residual up to HOVERING_FLOORS floors is solved down to DEEP_SOLVE_FLOORS floors
HOVERING_FLOORS = 1.3
DEEP_SOLVE_FLOORS = 0.2
SMOOTH_FLOOR = 0.3  # floors: a smooth part below this is ignored
ROUND_OFF_STEP = 1e-12
MOST_SETTLING = 60  # Newton steps of a grid that no motion leads to, until the same
MOST_MOTION_HALVINGS = 6  # the motion is divided into at most 2**6 parts
MOST_UNTANGLING = 60  # steps
MOST_RESCUES = 8  # of one regrid, in all parts of its motion
SMOOTHINGS = (0.2, 0.1, 0.05, 0.02)  # e of the last steps of an untangling
LEAST_FALL = 0.1  # of the energy, in the formula for e
LEAST_E2 = 1e-12
STEPS_WITHOUT_DESCENT = 4  # that a step counts for, if the energy did not fall at this e
EVEN_CELL_WEIGHTS = 1e-6  # families whose weights differ by less are ranked by the numbers of cells


@dataclass(frozen=True)
class HexahedraOptions:
    """Parameters of a move; see `BarrierRegridder3D`."""

    epsilon: float = 1e-3
    area_weight: float = 1.0
    strengthening: float = 30.0
    conditional: bool = True
    tolerance: float = 0.05
    floor: float = 1e-3
    max_iterations: int = 16
    newton_steps: int = 1


class Workspace:
    """Work arrays for a block of `cells` (3,), kept because allocation takes time at every call."""

    def __init__(self, cells: tuple[int, ...]):
        nodes = tuple(n + 1 for n in cells)
        self.base, self.trial, self.gradient, self.product, self.z, self.r, self.change = (
            np.zeros((3, *nodes)) for _ in range(7)
        )
        self.blocks = np.zeros((2, 6, *nodes))
        self.strength = np.empty(cells)
        self.planes = np.empty(cells[0])
        self.scratch = np.zeros(HEXAHEDRON_SIZE)
        self.coarse = CoarseBlock(cells)


class HexahedraMove(Workspace):
    """One regrid from `old` to the faces of `boundary`, (3, n1+1, n2+1, n3+1), into `trial`.

    In both i, j, k are oriented like x, y, z; lines along i are the heaviest family of `weights`
    (3).  `trial` and all work arrays are in `space`.
    """

    def __init__(
        self, options: HexahedraOptions, old, boundary, weights, space: Workspace | None = None
    ):
        self.options = options
        self.weights = weights
        self.old = old
        self.faces = boundary
        self.cells = tuple(n - 1 for n in old.shape[1:])
        vars(self).update(vars(space or Workspace(self.cells)))
        self.trial[:] = np.nan  # no values of an earlier call may remain
        self.iterations = 0
        self.rescues = 0
        self.sub_moves = 0
        self.residual = 0.0
        self.error = 0.0
        self.ratio = np.inf
        self.has_moved = False  # whether a Newton step was taken
        self.repairs = False  # whether the old grid is folded
        self.start = "displacement"

    @property
    def inner(self) -> int:
        """Number of free nodes."""
        return math.prod(n - 1 for n in self.cells)

    def report(self) -> RegridReport:
        """The report, after `run`."""
        return RegridReport(
            self.iterations, self.iterations * self.inner, self.sub_moves, self.rescues,
            self.ratio, self.residual, self.start,
        )  # fmt: skip

    def run(self) -> bool:
        """Perform the whole motion, in halves if necessary; True if `trial` is valid."""
        if self._advance():
            return True
        if find_turned_edge(self.faces) is not None:
            return False  # no interior makes that corner positive
        if self.repairs:
            return self._make_from_faces()
        first_grid = self.old.copy()
        last_faces = self.faces.copy()
        for halving in range(1, MOST_MOTION_HALVINGS + 1):
            if self._move_in_parts(first_grid, last_faces, 2**halving):
                return True
        self.old = first_grid
        self.faces = last_faces
        return self._make_from_faces()

    def _move_in_parts(self, first_grid: np.ndarray, last_faces: np.ndarray, parts: int) -> bool:
        """The whole motion in so many equal parts; True where all of them succeed."""
        self.old = first_grid.copy()
        self.ratio = np.inf
        for part in range(1, parts + 1):
            fraction = part / parts
            self.faces = last_faces
            if part < parts:
                self.faces = first_grid + fraction * (last_faces - first_grid)
            if not self._advance():
                return False
            self.old = self.trial.copy()
        self.sub_moves = parts - 1
        self.start = "halved"
        return True

    def _make_from_faces(self) -> bool:
        """A grid for the faces alone, which no motion leads to: the first that steps can settle.

        It starts from the grid interpolated between the faces, unfolded if necessary; where that
        cannot be done, from the displaced grid.  Where none settles, the one closest to it is
        taken.  True if `trial` is valid.
        """
        self.lengths = compute_face_lengths(self.faces, self.weights, self.options.conditional)
        move_with_faces(self.old, self.faces, self.base)
        displaced = self.base.copy()
        interpolated = np.empty_like(self.faces)
        copy_faces(self.faces, interpolated)
        fill_from_faces(interpolated, compute_edge_spacings(self.faces))
        best = displaced
        least_error = np.inf
        self.rescues = 1
        self.sub_moves = 0
        for start in (interpolated, displaced):
            self.trial[:] = start
            self.start = "transfinite"
            if not self._compare(self.trial)[1] > 0.0 and not self._untangle():
                continue
            error = self._settle()
            if error < least_error:
                best = self.trial.copy()
                least_error = error
            if error <= SETTLED_MOVE:
                break
        self.trial[:] = best
        if self.repairs:
            self.old = best
        self.ratio = np.inf
        return self._accept()

    def _settle(self) -> float:
        """Newton steps from the valid `trial`; returns the residual left, in cells."""
        self.residual = 0.0
        for _ in range(MOST_SETTLING):
            base = self.trial.copy()
            ratio = self._newton(base)
            if ratio > SMOOTH_RATIO and self.error <= SETTLED_MOVE:
                break
            if (self.trial == base).all():
                break
        return self.error if self._compare(self.trial)[1] > 0.0 else np.inf

    def _advance(self) -> bool:
        """One part of the motion, from `old` to `faces`; True if `trial` is valid."""
        options = self.options
        self.lengths = compute_face_lengths(self.faces, self.weights, options.conditional)
        if not np.isfinite(self.lengths.scale) or not self.lengths.scale > 0.0:
            return False
        move_with_faces(self.old, self.faces, self.base)
        displaced_ratio, least_volume = self._compare(self.base)
        if self.inner == 0:
            self.trial[:] = self.base
            return self._accept()
        self.rescued = False
        # a Newton step from the displaced grid, or the prediction
        if displaced_ratio > MOVED_GRID_START_RATIO:
            self.trial[:] = self.base
            self.has_moved = False
            ratio = self._newton(self.old)
            if not self.has_moved:
                self.ratio = min(self.ratio, displaced_ratio)
                return least_volume > 0.0
        else:
            self.repairs = not self._compare(self.old)[1] > 0.0
            if self.repairs:
                return False
            predicted_ratio = self._predict(displaced_ratio)
            if predicted_ratio is None:
                return False
            ratio = predicted_ratio
        # more steps while corners lose much, after untangling until it has settled
        for step in range(MOST_POLISH if self.rescued else MOST_NEWTON_STEPS):
            has_settled = not (self.rescued and self.error > SETTLED_MOVE)
            if ratio > SMOOTH_RATIO and has_settled and step >= options.newton_steps - 1:
                break
            ratio = self._newton(self.trial.copy())
        return self._accept()

    def _accept(self) -> bool:
        """Compare the result with the old grid; True if every corner is positive."""
        ratio, least_volume = self._compare(self.trial)
        self.ratio = min(self.ratio, ratio)
        return least_volume > 0.0 and ratio > 0.0

    def _compare(self, nodes: np.ndarray, old: np.ndarray | None = None) -> tuple[float, float]:
        """Least ratio of corner volumes to those of `old`, and least scaled volume."""
        old = self.old if old is None else old
        return compare_corners(nodes, old, self.lengths.inverse, self.cells, self.scratch)

    def functional(self, e2: float) -> Functional:
        """The current functional, its denominators smoothed by e."""
        return Functional(self.lengths, self.strength, self.options.area_weight, e2)

    def assemble_at(self, nodes: np.ndarray, work: int, e2: float = 0.0) -> float:
        """Value of J with the frozen strength, or gradient and factored lines, as `work` says."""
        if work > ONLY_ENERGY:
            self.gradient[:] = 0.0
            self.blocks[:] = 0.0
        functional = self.functional(e2)
        planes = self.planes
        assemble(nodes, functional, work, self.gradient, self.blocks, planes, self.scratch)
        if work == WITH_MATRIX:
            factor_lines(self.blocks)
        return float(self.planes.sum())

    def strengthen(self, nodes: np.ndarray) -> None:
        """Take the barrier's strength in every cell from the corners of a grid."""
        epsilon = self.options.epsilon
        strongest = self.options.strengthening
        fill_strength(nodes, self.lengths.inverse, epsilon, strongest, self.strength, self.scratch)

    def precondition(self, r: np.ndarray) -> np.ndarray:
        """The solution along the lines for the residual `r` (3, nodes)."""
        solve_lines(self.blocks, r, self.z)
        return self.z

    def _solve(self, nodes, change, e2: float = 0.0, extends_motion: bool = False) -> bool:
        """Add the Newton step of `nodes` to `change`; False if not needed; sets `error` in cells.

        It starts with the smooth part (theory R14.11), enough for a residual at the floor.  With
        `extends_motion`, `change` is the faces' motion, which is extended inward.
        """
        options = self.options
        functional = self.functional(e2)

        def multiply(p):
            fill_product(nodes, p, functional, self.product, self.scratch)
            return self.product

        # residual of the grid
        r = np.negative(self.gradient, out=self.r)
        if extends_motion:
            r -= multiply(change)
        scale = self.lengths.scale * self.inner
        first_square = float((r * self.precondition(r)).sum())
        is_finite = np.isfinite(first_square)
        self.error = math.sqrt(max(first_square, 0.0) / scale) if is_finite else np.inf
        # its smooth part
        corrected = False
        if e2 == 0.0:
            if not extends_motion:
                self.residual = max(self.residual, self.error)
            gain = self.coarse.find(nodes, functional, r, self.scratch)
            corrected = gain > (SMOOTH_FLOOR * options.floor) ** 2 * scale
            if corrected:
                self.coarse.add(change)
        is_small = first_square <= options.floor**2 * scale
        if (is_small and not extends_motion and e2 == 0.0) or not is_finite:
            return corrected
        if corrected:
            np.negative(self.gradient, out=r)
            r -= multiply(change)
        # what is left, by conjugate gradients
        hovers = not first_square > (HOVERING_FLOORS * options.floor) ** 2 * scale
        floor = DEEP_SOLVE_FLOORS * options.floor if hovers or corrected else options.floor
        tolerance = EXTENSION_TOLERANCE if extends_motion else options.tolerance
        stop = max(max(floor, ROUND_OFF_STEP) ** 2 * scale, tolerance**2 * first_square)
        most_iterations = EXTENSION_ITERATIONS if extends_motion else options.max_iterations
        iterations, _, _ = solve(multiply, self.precondition, r, change, stop, most_iterations)
        self.iterations += iterations
        return corrected or iterations > 0

    def _newton(self, old: np.ndarray) -> float:
        """`trial` = a Newton step from the valid `trial`, shortened node by node if necessary.

        Returns the smallest ratio of corner volumes to those of `old`.
        """
        base = self.trial.copy()
        self.strengthen(base)
        self.assemble_at(base, WITH_MATRIX)
        change = self.change
        change[:] = 0.0
        if not self._solve(base, change) or not np.isfinite(change).all():
            return 1.0
        self.has_moved = True
        np.add(base, change, out=self.trial)
        ratio = self._compare(self.trial, old)[0]
        return ratio if ratio > STEP_RATIO else self._search(base, change, old)

    def _search(self, base, change, old) -> float:
        """The largest fraction of the step, shortened at corners as well, that decreases J."""
        energy_before = self.assemble_at(base, ONLY_ENERGY)
        fraction = 1.0
        while fraction >= LEAST_STEP_FRACTION:
            steps = np.full(base.shape[1:], fraction)
            for _ in range(MOST_SHORTENINGS):
                np.multiply(change, steps, out=self.trial)
                self.trial += base
                inverse = self.lengths.inverse
                Z = self.scratch
                if not halve_steps(self.trial, base, inverse, STEP_RATIO, steps, Z):
                    if self.assemble_at(self.trial, ONLY_ENERGY) < energy_before:
                        return self._compare(self.trial, old)[0]
                    break
            fraction *= 0.5
        self.trial[:] = base
        return 1.0

    def _predict(self, displaced_ratio: float) -> float | None:
        """Extend the faces' motion inward by the old grid's Hessian, or else by other methods.

        Returns the least ratio of corner volumes, None where no valid grid is found.
        """
        self.strengthen(self.old)
        self.assemble_at(self.old, WITH_MATRIX)
        change = self.base - self.old
        self._solve(self.old, change, extends_motion=True)
        np.add(self.old, change, out=self.trial)
        copy_faces(self.faces, self.trial)
        ratio, least_volume = self._compare(self.trial)
        if ratio > LEAST_RATIO:
            return ratio
        if displaced_ratio > LEAST_RATIO:
            self.trial[:] = self.base
            return self._newton(self.base.copy())
        if not least_volume > self._compare(self.base)[1]:
            self.trial[:] = self.base
        return 0.0 if self._untangle() else None

    def _untangle(self) -> bool:
        """Minimise the functional with smoothed denominators from `trial` (theory R14.10)."""
        options = self.options
        if self.rescues == MOST_RESCUES:
            return False
        self.rescues += 1
        self.rescued = True
        self.start = "untangled"
        self.strength[:] = options.epsilon * options.strengthening
        least_volume = self._compare(self.trial)[1]
        if not np.isfinite(self.trial).all():
            return False
        # steps at falling e until nothing is folded
        e2 = LEAST_E2 + 0.04 * min(0.0, least_volume) ** 2
        steps = 0
        while not least_volume > 0.0:
            if steps >= MOST_UNTANGLING:
                return False
            energy_before, energy = self._smooth_step(e2)
            least_volume = self._compare(self.trial)[1]
            if not energy < energy_before and not least_volume > 0.0:
                steps += STEPS_WITHOUT_DESCENT
            fall = max(LEAST_FALL, 1.0 - energy / energy_before)
            e2 = _choose_next_e2(e2, least_volume, fall)
            steps += 1
        # steps that open what is sharp
        for e in SMOOTHINGS:
            trial_before = self.trial.copy()
            self._smooth_step(e * e)
            new_least_volume = self._compare(self.trial)[1]
            if not new_least_volume > 0.5 * least_volume:
                self.trial[:] = trial_before
            else:
                least_volume = new_least_volume
        return True

    def _smooth_step(self, e2: float) -> tuple[float, float]:
        """A Newton step of the smoothed functional, halved until J falls: J before and after."""
        base = self.trial.copy()
        energy_before = self.assemble_at(base, ONLY_ENERGY, e2)
        self.assemble_at(base, WITH_MATRIX, e2)
        change = np.zeros_like(base)
        self._solve(base, change, e2)
        fraction = 1.0
        while fraction >= LEAST_STEP_FRACTION:
            np.multiply(change, fraction, out=self.trial)
            self.trial += base
            energy = self.assemble_at(self.trial, ONLY_ENERGY, e2)
            if energy < energy_before:
                return energy_before, energy
            fraction *= 0.5
        self.trial[:] = base
        return energy_before, energy_before


def _choose_next_e2(e2: float, least_volume: float, fall: float) -> float:
    """The e² that follows, where the energy fell by the part `fall` (theory R14.10)."""
    root = math.sqrt(least_volume * least_volume + e2)
    chi = 0.5 * (least_volume + root) if least_volume >= 0.0 else 0.5 * e2 / (root - least_volume)
    mu = (1.0 - fall) * chi
    return max(4.0 * mu * (mu - min(least_volume, 0.0)), LEAST_E2)


class BarrierRegridder3D:
    """Straight lines where they fit, a barrier against folding everywhere, in space.

    `epsilon` weighs the barrier; `edge_lengths` is "conditional" or "unit"; `family` "auto", "i",
    "j", "k" or the three weights of the straight lines; `area_weight` is lam of theory R14.1;
    `strengthening` is the largest factor of epsilon in sharp cells; `tolerance`, `floor` (in cells)
    and `max_iterations` end the linear solve; `newton_steps` is the minimum number of Newton steps
    per call.
    """

    # the options that are fields of HexahedraOptions, and their types
    numbers: ClassVar[dict[str, str]] = {
        field.name: str(field.type) for field in fields(HexahedraOptions) if field.type != "bool"
    }

    def __init__(self, edge_lengths: str = "conditional", family="auto", **numbers: float):
        if edge_lengths not in ("conditional", "unit"):
            raise BadInput(
                f"barrier regridder: edge_lengths '{edge_lengths}' is neither 'conditional' "
                "nor 'unit'"
            )
        converted = {
            name: int(value) if self.numbers.get(name) == "int" else float(value)
            for name, value in numbers.items()
        }
        options = HexahedraOptions(conditional=edge_lengths == "conditional", **converted)  # type: ignore[arg-type]
        for name, least in (
            ("epsilon", 0.0),
            ("area_weight", -1e-300),
            ("strengthening", 1.0 - 1e-15),
        ):
            value = getattr(options, name)
            if not least < value < np.inf:
                raise BadInput(
                    f"barrier regridder: {name} {value} must be finite and "
                    + ("1 or more" if name == "strengthening" else "positive")
                )
        self.options = options
        self.family = _take_family(family)
        self._workspaces: dict[tuple[int, ...], Workspace] = {}

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """The grid inside the six faces of `boundary`, near `previous`; both in m.

        Shapes (3, ni+1, nj+1, nk+1); only the faces of `boundary` are read.  Raises BadInput for
        arrays of wrong shape, and RegridFailure, naming face and node, if there is no valid grid or
        none is found.
        """
        previous, boundary = check_grids_in_space(previous, boundary)
        unit = find_unit_in_space(previous)
        if unit != 1.0:  # sixth powers of lengths would not be numbers
            previous = previous / unit
            boundary = boundary / unit
        # in the order of the families' weights, oriented like x, y, z
        weights = compute_family_weights(boundary) if self.family is None else self.family
        order = _order_axes(weights, previous.shape[1:])
        axes = (0, *(axis + 1 for axis in order))
        is_odd = order in ((0, 2, 1), (1, 0, 2), (2, 1, 0))
        mirrored = (compute_volume(previous) < 0.0) != is_odd
        old, faces = (
            np.ascontiguousarray(nodes.transpose(axes)[:: -1 if mirrored else 1])
            for nodes in (previous, boundary)
        )
        if faces.shape[3] - 1 > LONGEST_HEXAHEDRON_ROW:
            raise BadInput(
                f"regrid: a block in space has at most {LONGEST_HEXAHEDRON_ROW} cells a direction"
            )
        cells = tuple(n - 1 for n in faces.shape[1:])
        if cells not in self._workspaces:
            self._workspaces[cells] = Workspace(cells)
        ordered_weights = np.array([weights[axis] for axis in order])
        move = HexahedraMove(self.options, old, faces, ordered_weights, self._workspaces[cells])
        is_valid = compute_volume(faces) > 0.0 and move.run()
        # and back
        axes_back = (0, *(int(axis) + 1 for axis in np.argsort(order)))
        nodes = move.trial[:: -1 if mirrored else 1].transpose(axes_back).copy(order="C")
        if unit != 1.0:
            nodes *= unit
            boundary = boundary * unit
        if not is_valid:
            upright = slice(None, None, -1 if mirrored != is_odd else 1)
            raise explain_failure(boundary[upright], nodes[upright])
        return RegridResult(nodes, move.report())


def _order_axes(weights, shape: tuple[int, ...]) -> tuple[int, int, int]:
    """The indices by decreasing weight of their family; at a tie by increasing number of nodes.

    A tie must not be decided by round-off; the longest rows come last because they run fastest.
    """
    steps = np.round(np.asarray(weights) / EVEN_CELL_WEIGHTS)
    order = sorted(range(3), key=lambda axis: (-steps[axis], shape[axis], axis))
    first = order[0]
    second, third = sorted(order[1:], key=lambda axis: (shape[axis], axis))
    return first, second, third


def _take_family(family) -> np.ndarray | None:
    """The weights (3,) of the families, None for those that the faces imply; else BadInput."""
    if isinstance(family, str) and family == "auto":
        return None
    if isinstance(family, str) and family in ("i", "j", "k"):
        return np.array([float(family == name) for name in "ijk"])
    try:
        weights = np.array([float(k) for k in family])
    except (TypeError, ValueError):
        weights = np.zeros(0)
    if weights.size != 3 or not (weights >= 0.0).all() or not 0.0 < weights.sum() < np.inf:
        raise BadInput(
            f"barrier regridder: family {family!r} must be 'auto', 'i', 'j', 'k' or three "
            "weights >= 0"
        )
    return weights / weights.sum()
