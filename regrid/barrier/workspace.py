"""Arrays and kernel calls of one barrier regrid.

A workspace transforms a block to its own frame, in which the lines j = const are the straight-line
family of larger weight and corner areas are positive.  It exchanges i and j, and x and y, as
needed, so a transposed or mirrored block goes through bitwise the same arithmetic.  No result
depends on what a previous call left in it.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numba
import numpy as np

from shockgrid.regrid.algebraic import SideMotion, fill_curves
from shockgrid.regrid.barrier.assembly import (
    NODE_ROW_SIZE,
    assemble_barrier,
    assemble_on_threads,
    assemble_smoothed,
)
from shockgrid.regrid.barrier.coarse_nodes import CoarseCorrection
from shockgrid.regrid.barrier.functional import has_cell_terms
from shockgrid.regrid.barrier.given_spacing import GivenSpacing, SideLengths, find_given_spacing
from shockgrid.regrid.barrier.line_cg import fill_product, solve_serial, solve_threaded
from shockgrid.regrid.barrier.residual_estimate import (
    ASPECT,
    COSECANT,
    LEAST_SCALED,
    MOST_SHRUNK,
    RESIDUAL_SIZE,
    STRAYED,
    check_residual_serial,
    check_residual_threaded,
)
from shockgrid.regrid.barrier.side_inputs import BarrierInputs, prepare, weigh_curves
from shockgrid.regrid.barrier.step_control import (
    CHUNK_SPAN,
    MOST_CHUNK_NODES,
    UPRIGHT,
    measure_corners,
)
from shockgrid.regrid.barrier.tuning import DEFAULT, Tuning
from shockgrid.regrid.barrier.untangle import ENERGY_ROW, ENERGY_SIZE, LEAST_AREA_ROW, fill_energy
from shockgrid.regrid.jit import can_use_threads
from shockgrid.regrid.measure.corners import BLOCK_CORNERS
from shockgrid.regrid.measure.crossings import BoundaryCheck
from shockgrid.regrid.measure.quality import compute_scaled_jacobians
from shockgrid.regrid.sides import copy_sides, get_sides
from shockgrid.regrid.symmetry import Symmetry, find_symmetry
from shockgrid.regrid.work_arrays import Carver, count_numbers, share_memory

VECTORS = ("solution", "r", "z", "p", "p_old", "product")  # of the solve
LEAST_SPACING_DEPARTURE = 1e-12  # departures of spacings below it are round-off
LEAST_CHUNK_COLUMNS = 8  # a thread is not worth starting for fewer
NUMBERS_PER_VECTOR = 8  # numbers in a cache line, and in the longest vectors of a processor
MOST_SOLVE_ITERATIONS = 16


def load_grid(nodes, out, transposed: bool, mirrored: bool, inside: bool) -> None:
    """Copy a grid (2, ni+1, nj+1), or only its sides, into the workspace's frame."""
    view = nodes.transpose(0, 2, 1) if transposed else nodes
    view = view[::-1] if mirrored else view
    if inside:
        out[:] = view
    else:
        copy_sides(view, out)


def find_spacing_departure(first_grid: np.ndarray) -> np.ndarray:
    """How far the lines j = const of a grid depart from the spacing that the outer two give; R4.9.

    first_grid: (2, ni+1, nj+1) [m]; (ni+1, nj+1), parts of the line's length.
    """
    # positions of the nodes on their lines, from 0 to 1
    positions = np.zeros(first_grid.shape[1:])
    for i in range(positions.shape[0] - 1):
        edges = np.hypot(*(first_grid[:, i + 1] - first_grid[:, i]))
        np.add(positions[i], edges, out=positions[i + 1])
    positions /= positions[-1].copy()
    # less those interpolated between the outer lines
    departure = positions
    column = np.arange(departure.shape[1]) / (departure.shape[1] - 1)
    for row in departure:
        row -= row[0] * (1.0 - column) + row[-1] * column
    departure[:, [0, -1]] = 0.0
    departure[[0, -1]] = 0.0
    return departure


def has_departures(spacing_departure: np.ndarray) -> bool:
    """Whether departures (ni+1, nj+1) of `find_spacing_departure` exceed round-off anywhere."""
    most = max(spacing_departure.max(), -spacing_departure.min())
    return bool(most > LEAST_SPACING_DEPARTURE)


class Workspace:
    """Grids, spacings, matrix and vectors of a block of ni × nj cells in the workspace's frame.

    With `shared`, its large arrays lie in the memory that all regrids of a thread share: `take`
    places them there.
    """

    inputs: Any  # `BarrierInputs`
    old_array: np.ndarray
    sides_array: np.ndarray
    base_array: np.ndarray
    trial_array: np.ndarray
    sound_array: np.ndarray
    curve: np.ndarray
    gradient: np.ndarray
    solution: np.ndarray
    r: np.ndarray
    z: np.ndarray
    p: np.ndarray
    p_old: np.ndarray
    product: np.ndarray
    H: np.ndarray

    def __init__(
        self,
        ni: int,
        nj: int,
        threads: int,
        tuning: Tuning = DEFAULT,
        shared: bool = False,
    ):
        self.ni = ni
        self.nj = nj
        self.threads = threads
        self.tuning = tuning
        self.shape = (2, ni + 1, nj + 1)
        # what is taken from the sides
        self.along_i, self.along_j = np.zeros((5, ni)), np.zeros((5, nj))
        self.blend_i, self.blend_j = np.zeros(ni + 1), np.zeros(nj + 1)
        self.departs = False
        self.spacing_departure = np.zeros((ni + 1, nj + 1))
        self.chords = np.zeros((2, nj + 1))
        self.most_departure = np.zeros(nj + 1)
        self.motion_tables = (
            np.zeros((6, ni + 1)), np.zeros((6, nj + 1)), np.zeros((2, 5)), np.zeros((2, nj + 1)),
            np.zeros(nj + 1),
        )  # fmt: skip
        self.boundary_check = BoundaryCheck(ni, nj)
        self.least_limiting_rate = 0.0
        self.symmetry: Symmetry | None = None
        self.spacing: GivenSpacing | None = None
        self.no_shares = np.zeros((2, 1, 1))
        self.coarse = CoarseCorrection(ni, nj, tuning)
        self._cut_columns(threads)
        self._list_arrays()
        # its own memory, or that of the thread
        self.shared = shared
        self.is_clean = not shared
        self._memory = np.zeros(0)
        if not shared:
            self._place_arrays(np.zeros(self.size))
            self.sound_array[:] = 1.0
            self.use_arrays()

    def _cut_columns(self, threads: int) -> None:
        """Divide the columns of inner nodes, and those of cells, among threads and scratches."""
        inner = self.nj - 1
        chunks = max(1, min(threads, inner // LEAST_CHUNK_COLUMNS), -(-inner // MOST_CHUNK_NODES))
        self.columns = 1 + np.arange(chunks + 1, dtype=np.int64) * inner // chunks
        self.cell_columns = np.arange(chunks + 1, dtype=np.int64) * self.nj // chunks
        # Vectors of the solve have columns of zeros behind the last one, so that its loops run over
        # whole vectors of the processor: a few columns more would take as long as the others.
        self.whole_columns = self.columns.copy()
        self.whole_columns[-1] += -(self.nj - self.columns[-2]) % NUMBERS_PER_VECTOR
        self.extremes = np.zeros((chunks, 5))
        shape = chunks, max(ENERGY_SIZE, RESIDUAL_SIZE)
        self.scratch = Carver(np.zeros(count_numbers(*shape))).cut(*shape)

    def _list_arrays(self) -> None:
        """Name the arrays of the block's size, with shape and the column that begins a cache line.

        `size` is how many numbers they need together.
        """
        chunks = self.columns.size - 1
        columns = int(self.whole_columns[-1]) + 1
        vector_shape = (2, self.ni + 1, -(-columns // NUMBERS_PER_VECTOR) * NUMBERS_PER_VECTOR)
        self.totals = np.zeros(vector_shape[2])
        grids = ("old_array", "sides_array", "base_array", "trial_array")
        self.arrays = {
            **dict.fromkeys(grids, (self.shape, 0)),
            "sound_array": ((self.ni, self.nj), 0),
            "coarse_memory": ((self.coarse.size,), 0),
            "gradient": (self.shape, 0),
            **dict.fromkeys(VECTORS, (vector_shape, 1)),
            "H": ((chunks, (self.ni + 1) * NODE_ROW_SIZE), 0),
            "curve": (self.shape, 0),
        }
        self.size = sum(count_numbers(*shape) for shape, _ in self.arrays.values())

    def _place_arrays(self, memory: np.ndarray) -> None:
        """Make the large arrays views of `memory` (`size` or more,), one behind the other.

        In memory that other regrids of the thread may use too, nothing of them is kept.
        """
        if memory is self._memory:
            return
        self._memory = memory
        carver = Carver(memory)
        for name, (shape, column) in self.arrays.items():
            setattr(self, name, carver.cut(*shape, column=column))
        self.coarse.take_arrays(self.coarse_memory)
        self.change = self.solution[:, :, : self.nj + 1]
        self.shortening = self.p.reshape(-1)[: math.prod(self.shape)].reshape(self.shape)

    def _clear(self) -> None:
        """Set zeros where the solve expects them: another regrid may have used the memory."""
        for vector in (self.r, self.z, self.p_old):
            vector[:] = 0.0
        for side in get_sides(self.gradient):
            side[:] = 0.0
        rows = self.H.reshape(self.columns.size - 1, self.ni + 1, -1, CHUNK_SPAN)
        rows[:, 0] = 0.0
        chunk_start = self.columns[-2] - 1
        rows[-1, :, :, self.columns[-1] - chunk_start : self.whole_columns[-1] - chunk_start] = 0.0
        self.is_clean = True

    @functools.cached_property
    def even_barrier(self) -> np.ndarray:
        """Strengths (ni, nj) of a barrier that has the same weight everywhere."""
        return np.ones((self.ni, self.nj))

    def use_arrays(self) -> None:
        """Let all grids be arrays of the workspace, whose contents may be anything."""
        self.old = self.old_array
        self.sides = self.sides_array
        self.sound = self.sound_array
        self.base = self.base_array
        self.trial = self.trial_array
        self.frame = UPRIGHT
        # the old grid, the one to fill, and the frame of both, if that is not the workspace's
        self.framed_grids: tuple[np.ndarray, np.ndarray] | None = None

    def take(
        self, previous, boundary, transposed, mirrored, sound=None, into=None, first_grid=None
    ) -> None:
        """Take up the grid before, (2, ni+1, nj+1) in its own frame, and the new sides.

        `sound` (ni, nj) [m/s], where speeds of sound are given; without a grid before sides alone.
        In the workspace's own frame they are read where they are, and `base` is the array `into`,
        a new one without it; else the residual check reads the grid before where it is
        (`load_old`).  `first_grid`: the grid whose spacing is kept.
        """
        if self.shared:
            self._place_arrays(share_memory(self.size))
            self.is_clean = False
        self.use_arrays()
        self.into = np.empty(boundary.shape) if into is None else into
        if not (transposed or mirrored):
            self.base = self.into
            self.sides = boundary
            self.old = boundary if previous is None else previous
        else:
            self.frame = transposed, mirrored
            load_grid(boundary, self.sides, *self.frame, inside=False)
            if previous is not None:
                load_grid(previous, self.old, *self.frame, inside=False)
                self.framed_grids = (previous, self.into)
        if sound is not None:
            self.sound = np.ascontiguousarray(sound.T) if transposed else sound
        self.spacing = None
        if first_grid is not None:
            framed = np.empty(self.shape)
            load_grid(first_grid, framed, transposed, mirrored, inside=True)
            self.spacing = find_given_spacing(framed)

    def load_old(self) -> None:
        """Copy the grid before to `old`, and the displaced one to `base`, if a residual check has
        them in another frame."""
        if self.framed_grids is not None:
            load_grid(self.framed_grids[0], self.old, *self.frame, inside=True)
            load_grid(self.into, self.base, *self.frame, inside=True)
            self.framed_grids = None

    def copy_to_arrays(self, old: np.ndarray, sides: np.ndarray) -> None:
        """Let `old` and `sides` be copies of these grids that may be written to."""
        self.old = self.old_array
        self.sides = self.sides_array
        self.old[:] = old
        self.sides[:] = sides

    def give(self) -> np.ndarray:
        """The grid `trial` in the block's own frame, to keep: the array given for it or a new one.

        The residual check has already written it there if nothing else was needed.
        """
        if self.framed_grids is None and self.trial is not self.into:
            transposed, mirrored = self.frame
            source = self.trial[::-1] if mirrored else self.trial
            self.into[:] = source.transpose(0, 2, 1) if transposed else source
        return self.into

    def begin(
        self,
        conditional: bool,
        ki: float,
        kj: float,
        tuning: Tuning | None = None,
        cost: bool = False,
        curved: bool = False,
    ) -> None:
        """Take the spacings from `sides`, and the weights of the functional's terms.

        `cost` needs the cells' sound speeds in `sound`; `least_limiting_rate` [1/s] is the least R
        of theory R4.11; `tuning` where it is not the workspace's own.  With `curved`, where both
        pairs of sides bend, lines take their shapes and the barrier is no weaker than (R4.17) has
        it.
        """
        tuning = tuning or self.tuning
        epsilon = float(tuning.epsilon)
        # lines that take the shapes of the sides (R4.16), with the least epsilon of (R4.17)
        is_curved = False
        if curved:
            share_i, share_j, least_epsilon = weigh_curves(
                self.sides, tuning.open_side, tuning.closed_side, tuning.curved_barrier,
                tuning.half_barrier,
            )  # fmt: skip
            is_curved = share_i + share_j > 0.0
            if is_curved:
                fill_curves(self.sides, share_i, share_j, self.curve)
                epsilon = max(epsilon, least_epsilon)
        weights = tuning.get_weights(epsilon, 1.0, cost)
        inputs = self._gather_inputs(weights, float(ki), float(kj), is_curved)
        # all that follows from the sides alone
        self.symmetry = None
        self.motion = SideMotion(self.sides, *self.motion_tables)
        self.side_numbers = prepare.entry(
            self.old, inputs, self.motion, conditional,
            (float(tuning.cost_margin), float(self.least_limiting_rate)),
            self.boundary_check.scratch,
        )  # fmt: skip
        self.sigma = self.side_numbers.sigma
        self.area_target = self.side_numbers.area_target
        cost_scale = self.side_numbers.cost_scale
        # the spacing that is kept instead
        if self.spacing is not None:
            sides = SideLengths(self.along_i, self.along_j, self.blend_i, self.blend_j)
            self.area_target = self.sigma / self.spacing.compute_mean_area(sides)
            if has_cell_terms(inputs):
                rate = self.spacing.compute_limiting_rate(sides, self.sound, self.area_target)
                rate = max(tuning.cost_margin * rate, self.least_limiting_rate)
                cost_scale = 2.0 / (rate * rate)
        self.inputs = inputs._replace(
            sigma=self.sigma, area_target=self.area_target, cost_scale=cost_scale
        )
        self.iterations = 0

    def _gather_inputs(self, weights, ki: float, kj: float, is_curved: bool) -> Any:
        """The `BarrierInputs` of the block, whose numbers `prepare` finds."""
        no_shares = (self.no_shares, self.no_shares, self.no_shares[0])
        shares_i, shares_j, ease = no_shares if self.spacing is None else self.spacing
        return BarrierInputs(
            *weights,
            along_i=self.along_i,
            along_j=self.along_j,
            blend_i=self.blend_i,
            blend_j=self.blend_j,
            departs=self.departs,
            spacing_departure=self.spacing_departure,
            most_departure=self.most_departure,
            chords=self.chords,
            keeps_spacing=self.spacing is not None,
            shares_i=shares_i,
            shares_j=shares_j,
            ease=ease,
            curve=self.curve,
            curved=is_curved,
            ki=ki,
            kj=kj,
            sigma=0.0,
            area_target=0.0,
            sound=self.sound,
            cost_scale=0.0,
        )

    @property
    def is_simple(self) -> bool:
        """Whether the sides enclose an area without crossing or touching, apart from detected cuts
        (`find_cut_edges`)."""
        numbers = self.side_numbers
        return numbers.area > 0.0 and self.boundary_check.is_clear(numbers.meeting, self.sides)

    def keep_departure(self, spacing_departure: np.ndarray) -> None:
        """Keep the spacing that each line j = const has, by its departure (ni+1, nj+1) from the
        sides' (`find_spacing_departure`)."""
        self.most_departure[:] = np.maximum(
            spacing_departure.max(axis=0), -spacing_departure.min(axis=0)
        )
        self.departs = has_departures(spacing_departure)
        if self.departs:
            self.spacing_departure = spacing_departure

    def check_displaced_grid(self) -> tuple[float, float, float]:
        """Move `old` along with its sides (R6.5) into `base`, and estimate its residual.

        Returns the least ratio of its corner areas to the old ones, 0 unless all areas are positive
        numbers; an estimate of its residual in cells, infinite then, and where a spacing is kept;
        how far inner nodes are from interpolated positions at most, in old cell heights.
        """
        check_residual = check_residual_serial
        if self._set_threads():
            check_residual = check_residual_threaded
        grids = (self.old, self.base)
        frame = UPRIGHT
        if self.framed_grids is not None:
            grids = self.framed_grids
            frame = self.frame
        total, self.marks = check_residual.entry(
            self.base, grids, frame, self.inputs, self.motion,
            (self.coarse.starts_i, self.coarse.sums), self.totals,
            (self.columns, self.extremes, self.scratch),
        )  # fmt: skip
        extremes = self.extremes[0]
        is_convex = extremes[LEAST_SCALED] > 0.0
        shrunk = extremes[MOST_SHRUNK]
        if not (is_convex and shrunk > 0.0 and total >= 0.0):
            self.load_old()
            ratio = self.compare_corners(self.base, self.old) if is_convex else 0.0
            return ratio, math.inf, math.inf
        if self.spacing is not None:  # the estimate knows of the sides' lengths alone
            return float(1.0 / shrunk), math.inf, math.inf
        inner = (self.ni - 1) * (self.nj - 1)
        residual = math.sqrt(total / (self.sigma * inner))
        return float(1.0 / shrunk), residual, float(extremes[STRAYED])

    def get_quality(self) -> tuple[float, float, int, int] | None:
        """What `measure_worst` says of the grid checked last, if all its corners are positive."""
        cosecant = self.extremes[0, COSECANT]
        aspect = self.extremes[0, ASPECT]
        if self.marks or not cosecant < math.inf:
            return None
        return math.sqrt(1.0 / cosecant), math.sqrt(aspect), 0, 0

    def assemble(self, nodes) -> None:
        """Gradient and Hessian of the functional on a convex grid."""
        if not self.is_clean:
            self._clear()
        if self._set_threads():
            assemble_on_threads(
                nodes, self.inputs, self.columns, self.H, self.gradient, self.scratch
            )
        else:
            self._assemble_chunks(assemble_barrier.entry, nodes, 0.0)

    def assemble_smoothed(self, nodes, spread: float) -> None:
        """The same for the smoothed denominator on any grid."""
        if not self.is_clean:
            self._clear()
        self._assemble_chunks(assemble_smoothed, nodes, spread)

    def _assemble_chunks(self, assemble, nodes, spread) -> None:
        for c in range(self.columns.size - 1):
            first = self.columns[c]
            last = self.columns[c + 1]
            assemble(
                nodes, self.inputs, spread, first, last, self.H[c], self.gradient, self.scratch[c]
            )

    def _set_threads(self) -> bool:
        """Whether the chunks are to be computed on threads; as many are set then."""
        if self.threads == 1 or not can_use_threads():
            return False
        numba.set_num_threads(min(self.threads, numba.config.NUMBA_NUM_THREADS))
        return True

    def solve(
        self, tolerance: float, floor: float, most: int = MOST_SOLVE_ITERATIONS, guess=None
    ) -> tuple[int, float, float]:
        """Fill `change` with the solution of `H change = -gradient`, that of the last assembly.

        Returns iterations, first and last residual.  Without `guess` the boundary stays; with it,
        its boundary values are kept and its inside is where the iteration begins.
        """
        # right-hand side
        right = self.r[:, :, : self.nj + 1]
        self.solution[:] = 0.0
        if guess is None:
            np.negative(self.gradient, out=right)
        else:
            self.change[:] = guess
            for c in range(self.columns.size - 1):
                fill_product(
                    (self.solution, self.z, self.z), -1.0, self.whole_columns[c],
                    self.whole_columns[c + 1], self.H[c], self.product, self.totals,
                    self.scratch[c],
                )  # fmt: skip
            np.add(self.gradient, self.product[:, :, : self.nj + 1], out=right)
            np.negative(right, out=right)
        solve = solve_serial
        if self._set_threads():
            solve = solve_threaded
        iterations, first, last, _ = solve.entry(
            self.whole_columns, self.H, (self.solution, self.r, self.z),
            (self.p, self.p_old, self.product), self.totals,
            (float(tolerance), float(floor), int(most)), self.scratch,
        )  # fmt: skip
        self.iterations += iterations
        if self.symmetry is not None:
            self._even_out_change(guess)
        return iterations, first, last

    def find_symmetry(self) -> None:
        """Find how `old` and its displaced grid in `base` are symmetric: solutions will be, too."""
        if self.spacing is not None:
            return  # it need not be symmetric
        cell_values = [self.sound] if has_cell_terms(self.inputs) else []
        departure = self.spacing_departure if self.departs else None
        self.symmetry = find_symmetry(self.old, self.base, cell_values, departure)

    def _even_out_change(self, guess) -> None:
        """Leave the symmetric part of what a solve has added to `guess` in `change`."""
        if guess is None:
            self.symmetry.even_out(self.change)
        else:
            added = self.change - guess
            self.symmetry.even_out(added)
            np.add(guess, added, out=self.change)

    def compare_corners(self, trial, old) -> float:
        """Least ratio of corner areas of `trial` to `old`; 0 unless all are positive numbers."""
        least = np.inf
        for c in range(self.cell_columns.size - 1):
            ratio, area = measure_corners(
                trial, old, self.cell_columns[c], self.cell_columns[c + 1], self.scratch[c]
            )
            least = min(least, ratio if area > 0.0 else 0.0)
        return max(least, 0.0)

    def compute_barrier(self, nodes) -> np.ndarray:
        """e_c/epsilon (ni, nj) of the cells of a convex grid, as `assemble` weighs them there."""
        sines = compute_scaled_jacobians(nodes)
        for corner, i, j in BLOCK_CORNERS:
            sines[corner, i, j] = 1.0
        inputs = self.inputs
        with np.errstate(divide="ignore"):
            return np.clip(inputs.least_sine / sines.min(axis=0), 1.0, inputs.strengthening)

    def compute_energy(self, nodes, spread: float, barrier=None) -> tuple[float, float]:
        """Smoothed energy, and least scaled corner area; `barrier` as `compute_barrier` gives it.

        Without it the barrier has the same weight everywhere.  At `spread` 0 the energy is
        J itself, and not finite where a cell is not convex.
        """
        barrier = self.even_barrier if barrier is None else barrier
        energy = 0.0
        least = np.inf
        for c in range(self.cell_columns.size - 1):
            first = self.cell_columns[c]
            last = self.cell_columns[c + 1]
            rows = self.scratch[c]
            count = last - first
            fill_energy(nodes, self.inputs, spread, barrier, first, last, rows)
            energy += float(rows[ENERGY_ROW : ENERGY_ROW + count].sum())
            least = min(least, float(rows[LEAST_AREA_ROW : LEAST_AREA_ROW + count].min()))
        return energy, least

    def compute_least_area(self, nodes) -> float:
        """Least scaled corner area D of a grid, which may be folded."""
        return self.compute_energy(nodes, 1.0)[1]
