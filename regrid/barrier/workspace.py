"""Arrays and kernel calls of one barrier regrid, kept between calls so that nothing is allocated.

A workspace sees a block in its own frame: lines j = const are the heavier straight-line family,
and corner areas are positive.  It gets there by exchanging i and j, x and y, so that a block given
transposed or mirrored runs through the same arithmetic, bit for bit.  Nothing in it survives
from call to call that a result could depend on.
"""

from __future__ import annotations

import functools
import math

import numba
import numpy as np

from regrid.algebraic import fade_curves, fill_curves, fill_displacement, fill_moved
from regrid.barrier.area_ratios import WIDEST, measure_corners
from regrid.barrier.assembly import (
    LEAST_SINE,
    MOST_BARRIER,
    assemble_barrier,
    assemble_on_threads,
    assemble_smoothed,
)
from regrid.barrier.assembly_rows import (
    NODE_ROWS,
)
from regrid.barrier.line_cg import (
    fill_product,
    solve_serial,
    solve_threaded,
)
from regrid.barrier.residual_estimate import LOOK_ROWS, look_serial, look_threaded
from regrid.barrier.side_laws import (
    SIGMA,
    BarrierLaw,
    compute_mean_area,
    fill_blends,
    fill_growth,
    fill_laws,
    weigh_curves,
)
from regrid.barrier.step_cost import compute_cost, compute_dear_rate
from regrid.barrier.untangle import ENERGY, ENERGY_ROWS, LEAST, fill_energy
from regrid.coarse.correction import LEAST_CELLS, CoarseCorrection
from regrid.large.lent_arrays import LINE, view_aligned
from regrid.measure.corners import BLOCK_CORNERS
from regrid.measure.crossings import BoundaryCheck
from regrid.measure.quality import compute_scaled_jacobians
from regrid.sides import copy_sides

LEAST_BEND = 1e-12  # departures of laws below it are round-off


def make_aligned(*shape: int, column: int = 0) -> np.ndarray:
    """Zeros, the last of `shape` a multiple of 8; a line of the cache begins at `column`."""
    return view_aligned(np.zeros(math.prod(shape) + LINE // 8), shape, column)


def load_grid(nodes, out, transposed: bool, mirrored: bool, inside: bool) -> None:
    """Copy a grid (2, ni+1, nj+1), or only its sides, into the workspace's frame."""
    view = nodes.transpose(0, 2, 1) if transposed else nodes
    view = view[::-1] if mirrored else view
    if inside:
        out[:] = view
    else:
        copy_sides(view, out)


def find_bend(first: np.ndarray) -> np.ndarray:
    """How far the lines j = const of a grid depart from the law that the outer two give; R4.9.

    first: (2, ni+1, nj+1) [m]; (ni+1, nj+1), parts of the line's length.
    """
    laws = np.zeros(first.shape[1:])
    for i in range(laws.shape[0] - 1):
        np.add(laws[i], np.hypot(*(first[:, i + 1] - first[:, i])), out=laws[i + 1])
    laws /= laws[-1].copy()
    part = np.arange(laws.shape[1]) / (laws.shape[1] - 1)
    for law in laws:
        law -= law[0] * (1.0 - part) + law[-1] * part
    laws[:, [0, -1]] = 0.0
    laws[[0, -1]] = 0.0
    return laws


def is_bent(bend: np.ndarray) -> bool:
    """Are departures (ni+1, nj+1) of `find_bend` more than round-off anywhere?"""
    return bool(max(bend.max(), -bend.min()) > LEAST_BEND)


class Workspace:
    """Grids, laws, matrix and vectors of a block of ni × nj cells in the workspace's frame."""

    def __init__(self, ni: int, nj: int, threads: int, coarse_from: float = LEAST_CELLS):
        self.ni, self.nj, self.threads = ni, nj, threads
        self.shape = (2, ni + 1, nj + 1)
        self.along_i, self.along_j = np.zeros((5, ni)), np.zeros((5, nj))
        self.blend_i, self.blend_j = np.zeros(ni + 1), np.zeros(nj + 1)
        self.bent = False
        self.way, self.reach = np.zeros((2, nj + 1)), np.zeros(nj + 1)
        self.most_bend = np.zeros(nj + 1)
        self.block = np.zeros(1)
        self.boundary_check = BoundaryCheck(ni, nj)
        inner = nj - 1
        chunks = max(1, min(threads, inner // 8), -(-inner // WIDEST))
        self.columns = 1 + np.arange(chunks + 1, dtype=np.int64) * inner // chunks
        self.cell_columns = np.arange(chunks + 1, dtype=np.int64) * nj // chunks
        # Vectors of the solve have columns of zeros behind the last one, so that its loops run over
        # whole vectors of the processor: a rest of a few columns would take as long as the others.
        self.whole_columns = self.columns.copy()
        self.whole_columns[-1] += -(nj - self.columns[-2]) % 8
        self.vector = (2, ni + 1, -(-(int(self.whole_columns[-1]) + 1) // 8) * 8)
        self.scratch = make_aligned(chunks, max(ENERGY_ROWS, LOOK_ROWS))
        self.least = np.zeros((chunks, 3))
        self.least_dear_rate = 0.0
        self.coarse_from = coarse_from
        self.make_arrays()

    def make_arrays(self) -> None:
        """Grids, vectors and matrix: all that is of the block's size."""
        ni, nj, shape, vector = self.ni, self.nj, self.shape, self.vector
        self.coarse = CoarseCorrection(ni, nj, self.coarse_from)
        self.bend = np.zeros((ni + 1, nj + 1))
        self.curve = np.zeros(shape)  # no memory until lines are curved
        self.old, self.sides, self.displacement = (np.zeros(shape) for _ in range(3))
        self.base, self.trial, self.shortening = (np.zeros(shape) for _ in range(3))
        self.solution, self.r, self.z, self.p, self.p_old, self.product = (
            make_aligned(*vector, column=1) for _ in range(6)
        )
        self.gradient, self.totals = np.zeros(shape), np.zeros(vector[2])
        self.change = self.solution[:, :, : nj + 1]
        self.H = make_aligned(self.columns.size - 1, (ni + 1) * NODE_ROWS)
        self.sound = np.ones((ni, nj))

    @functools.cached_property
    def full_barrier(self) -> np.ndarray:
        """Parts (ni, nj) of a barrier that has its greatest weight everywhere."""
        return np.full((self.ni, self.nj), MOST_BARRIER)

    def take(self, previous, boundary, transposed, mirrored, sound=None, spare=None) -> None:
        """Take up the grid before, (2, ni+1, nj+1) in its own frame, and the new sides.

        `sound` (ni, nj) [m/s], where speeds of sound are given; `spare` (n,): memory to work in, of
        use where a block has no grids of its own.
        """
        if transposed:
            previous, boundary = previous.transpose(0, 2, 1), boundary.transpose(0, 2, 1)
        if mirrored:
            previous, boundary = previous[::-1], boundary[::-1]
        self.old[:] = previous
        copy_sides(boundary, self.sides)
        if sound is not None:
            self.sound[:] = sound.T if transposed else sound

    def take_sides(self, boundary, transposed: bool, mirrored: bool) -> None:
        """Take up new sides alone."""
        load_grid(boundary, self.sides, transposed, mirrored, inside=False)

    def take_sound(self, sound, transposed: bool) -> None:
        """Take up sound speeds (ni, nj) [m/s], given in the block's own frame."""
        self.sound[:] = sound.T if transposed else sound

    def own_grids(self) -> None:
        """Make `old` and `sides` arrays that may be written to: here they are."""

    def give(self, transposed: bool, mirrored: bool) -> np.ndarray:
        """The grid `trial` in the block's own frame, to keep."""
        source = self.trial[::-1] if mirrored else self.trial
        return np.array(source.transpose(0, 2, 1) if transposed else source, order="C")

    def empty(self) -> None:
        """Hold no array that was given or lent: here there is none."""

    def begin(
        self,
        conditional: bool,
        ki: float,
        kj: float,
        epsilon: float,
        area_weight: float,
        strengthening: float = MOST_BARRIER,
        cost_weight: float = 0.0,
        curved: bool = False,
    ) -> None:
        """Take the laws from `sides`, and the weights of the functional's terms.

        A `cost_weight` needs the cells' sound speeds in `sound`; `least_dear_rate` [1/s] is the
        least R of theory R4.11.  With `curved`, where both pairs of sides bend, lines take their
        shapes and the barrier is no weaker than (R4.17) has it.
        """
        fill_laws(self.sides, 1 if conditional else 0, self.along_i, self.along_j, self.block)
        fill_growth(self.along_i, ki - kj)
        fill_blends(self.sides, self.blend_i, self.blend_j)
        if self.bent:
            np.subtract(self.sides[:, -1], self.sides[:, 0], out=self.way)
        self.sigma = float(self.block[SIGMA])
        self.area_target = self.sigma / compute_mean_area(
            self.along_i, self.along_j, self.blend_i, self.blend_j
        )
        if curved:
            share_i, share_j, least = weigh_curves(self.sides)
            curved = share_i + share_j > 0.0
            if curved:
                fill_curves(self.sides, share_i, share_j, self.curve)
                left = fade_curves(self.curve)
                curved, epsilon = left > 0.0, max(epsilon, left * least)
        scale = 0.0
        if cost_weight > 0.0:
            dear = compute_dear_rate(
                self.sound, self.along_i, self.along_j, self.blend_i, self.blend_j, self.area_target
            )
            dear = max(dear, self.least_dear_rate)
            scale = 2.0 / dear**2 if dear > 0.0 else 0.0
        self.law = BarrierLaw(
            self.along_i, self.along_j, self.blend_i, self.blend_j,
            self.bend, self.way, self.curve, curved, float(ki), float(kj),
            self.sigma, float(self.area_target), float(epsilon), float(area_weight),
            float(strengthening), 1.0, self.sound, float(scale), float(cost_weight),
        )  # fmt: skip
        self.iterations = 0

    def take_first_grid(self, first) -> None:
        """Keep the spacing law that each line j = const has in the grid `first`; theory R4.9."""
        self.take_laws(find_bend(first))

    def take_laws(self, bend: np.ndarray) -> None:
        """Keep the departures `bend` (ni+1, nj+1) of `find_bend`."""
        self.most_bend[:] = np.maximum(bend.max(axis=0), -bend.min(axis=0))
        self.bent = is_bent(bend)
        if self.bent:
            self.bend = bend

    def carry_sides(self, old) -> None:
        """Fill `displacement` of the nodes `old` from the sides', lines by their own laws.

        And `base`, the grid moved by it, with the sides themselves.
        """
        fill_displacement(old, self.sides, self.displacement)
        fill_moved(
            old, self.sides, self.bend, self.most_bend, self.bent, self.displacement, self.base,
            self.reach,
        )  # fmt: skip

    def look(self, nodes, old) -> tuple[float, float, float]:
        """Least ratio of corner areas to those of `old`, an estimate of the residual in cells, and
        how far inner nodes are from interpolated places at most, in old cell heights.

        The ratio is 0 unless all areas are positive numbers; the estimate is infinite then.
        """
        look = look_serial
        if self.threads > 1:
            self._set_threads()
            look = look_threaded
        ratio, area, total, strayed = look(
            nodes, old, self.law, self.bent, self.reach, self.columns, self.coarse.starts_i,
            self.coarse.sums, self.totals, self.least, self.scratch,
        )  # fmt: skip
        if not (area > 0.0 and ratio > 0.0 and total >= 0.0):
            return max(ratio, 0.0) if area > 0.0 else 0.0, math.inf, math.inf
        inner = (self.ni - 1) * (self.nj - 1)
        return ratio, math.sqrt(total / (self.sigma * inner)), strayed

    def _assemble(self, kernel, nodes, spread) -> None:
        for c in range(self.columns.size - 1):
            kernel(
                nodes,
                self.law,
                spread,
                self.columns[c],
                self.columns[c + 1],
                self.H[c],
                self.gradient,
                self.scratch[c],
            )

    def assemble(self, nodes) -> None:
        """Gradient and Hessian of the functional on a convex grid."""
        if self.threads == 1:
            self._assemble(assemble_barrier, nodes, 0.0)
            return
        self._set_threads()
        assemble_on_threads(nodes, self.law, self.columns, self.H, self.gradient, self.scratch)

    def _set_threads(self) -> None:
        numba.set_num_threads(min(self.threads, numba.config.NUMBA_NUM_THREADS))

    def assemble_smoothed(self, nodes, spread: float) -> None:
        """The same for the smoothed denominator on any grid."""
        self._assemble(assemble_smoothed, nodes, spread)

    def solve(self, tolerance: float, floor: float, most: int = 16, guess=None):
        """Fill `change` with the solution of `H change = -gradient`; returns the first residual.

        Without `guess` the boundary stays; with it, its boundary values are kept and its
        inside is where the iteration begins.
        """
        right = self.r[:, :, : self.nj + 1]
        if guess is None:
            self.solution[:] = 0.0
            np.negative(self.gradient, out=right)
        else:
            self.change[:] = guess
            for c in range(self.columns.size - 1):
                first, last = self.whole_columns[c], self.whole_columns[c + 1]
                fill_product(
                    self.solution,
                    -1.0,
                    self.z,
                    self.z,
                    first,
                    last,
                    self.H[c],
                    self.product,
                    self.totals,
                    self.scratch[c],
                )
            np.add(self.gradient, self.product[:, :, : self.nj + 1], out=right)
            np.negative(right, out=right)
        solver = solve_serial
        if self.threads > 1:
            self._set_threads()
            solver = solve_threaded
        done, first, last = solver(
            self.whole_columns,
            self.H,
            self.solution,
            self.r,
            self.z,
            self.p,
            self.p_old,
            self.product,
            self.totals,
            tolerance,
            floor,
            most,
            self.scratch,
        )
        self.iterations += done
        return done, first, last

    def store(self) -> Workspace:
        """A workspace with the same grids, laws and the matrix of `old`, to be added to: this one.

        It must have assembled that last.
        """
        return self

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
        with np.errstate(divide="ignore"):
            return np.clip(LEAST_SINE / sines.min(axis=0), 1.0, self.law.strengthening)

    def compute_energy(self, nodes, spread: float, barrier=None):
        """Smoothed energy, and least scaled corner area; `barrier` as `compute_barrier` gives it.

        Without it the barrier carries its greatest weight everywhere.  At `spread` 0 the energy is
        J itself, and not finite where a cell is not convex.
        """
        barrier = self.full_barrier if barrier is None else barrier
        energy, least = 0.0, np.inf
        for c in range(self.cell_columns.size - 1):
            first, last = self.cell_columns[c], self.cell_columns[c + 1]
            rows, count = self.scratch[c], last - first
            fill_energy(nodes, self.law, spread, barrier, first, last, rows)
            energy += float(rows[ENERGY : ENERGY + count].sum())
            if spread == 0.0 and self.law.cost_weight > 0.0:
                weight = self.law.cost_weight * self.sigma
                energy += compute_cost(
                    nodes, self.law.sound, self.law.cost_scale, weight, first, last, rows
                )
            least = min(least, float(rows[LEAST : LEAST + count].min()))
        return energy, least
