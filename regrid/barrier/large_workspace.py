"""A workspace that keeps next to nothing between calls, for blocks whose arrays are large.

Its grids and vectors are lent (`regrid.large.lent_arrays`): blocks that are regridded one after
another share them.  The grids given are read where they lie, the grid handed back is one that was
worked on, and the Hessian is made again, strip by strip, where it is used.  Bits are those of
`Workspace`.

The traps: `displacement` lies in `trial`, it holds until something is tried; `change` lies where
the coarse correction works, it holds until the next look.
"""

from __future__ import annotations

import math

import numpy as np

from regrid.barrier.area_ratios import SPAN
from regrid.barrier.assembly import LEAST_SINE, assemble_barrier, assemble_smoothed
from regrid.barrier.assembly_rows import NODE_ROWS
from regrid.barrier.line_cg import fill_line_solution, fill_product
from regrid.barrier.side_laws import weigh_curves
from regrid.barrier.workspace import Workspace, load_grid
from regrid.coarse.correction import LEAST_CELLS, CoarseCorrection
from regrid.large.lent_arrays import WORK, LentArrays, find_lent_arrays
from regrid.large.strips import Matrix, Phases, Strips, StripSolver, Vectors
from regrid.measure.corners import BLOCK_CORNERS
from regrid.measure.quality import compute_scaled_jacobians

STRIPS = Phases(assemble_barrier, fill_product, fill_line_solution, SPAN)
SMOOTHED = STRIPS._replace(assemble=assemble_smoothed)
GRIDS = (
    "old", "sides", "base", "trial", "solution", "r", "change", "sound", "law", "matrix",
)  # fmt: skip
NO_LAWS, NO_CURVES = np.zeros((1, 1)), np.zeros((2, 1, 1))
SLAB = 64  # rows of cells for which something is computed at a time


class LargeWorkspace(Workspace):
    """Grids, laws and vectors of one regrid; `take`, then the calls of `Workspace`, then `give`."""

    def __init__(self, ni: int, nj: int, threads: int, coarse_from: float = LEAST_CELLS):
        self._lent: LentArrays | None = None
        super().__init__(ni, nj, threads, coarse_from)
        self.strips = Strips(self.columns, self.whole_columns, nj, threads)
        self.totals = np.zeros(self.vector[2])

    def make_arrays(self) -> None:
        """None of its own; laws and shapes of lines when there are any."""
        self.bend, self.curve = NO_LAWS, NO_CURVES
        self.coarse = CoarseCorrection(self.ni, self.nj, self.coarse_from, lent=True)

    @property
    def lent(self) -> LentArrays:
        """The arrays of the thread that works here."""
        if self._lent is None:
            self._lent = find_lent_arrays()
        return self._lent

    @property
    def displacement(self) -> np.ndarray:  # type: ignore[override]
        """Of the old grid's nodes, (2, ni + 1, nj + 1), until something is tried."""
        return self.trial

    @property
    def shortening(self) -> np.ndarray:  # type: ignore[override]
        """Scratch (2, ni + 1, nj + 1) after a solve."""
        return self.lent.view("direction", *self.shape)

    def take(self, previous, boundary, transposed, mirrored, sound=None, spare=None) -> None:
        """As `Workspace.take`.

        With `spare` (n,), memory for two grids, the one that `give` gives lies there.
        """
        self.empty()
        self._lent = find_lent_arrays()
        self.coarse.take_arrays(self.lent.view(WORK, self.coarse.size))
        if sound is not None:
            self.take_sound(sound, transposed)
        self.old = previous
        if transposed or mirrored:
            self.old = self.lent.view("old", *self.shape)
            load_grid(previous, self.old, transposed, mirrored, inside=True)
        self.take_sides(boundary, transposed, mirrored)
        size = math.prod(self.shape)
        self.spared = spare is not None and spare.size >= 2 * size
        if spare is not None and self.spared:
            self.base, self.trial = spare[: 2 * size].reshape(2, *self.shape)
        else:
            self.base, self.trial = (self.lent.take_grid(self.shape) for _ in range(2))

    def take_sides(self, boundary, transposed: bool, mirrored: bool) -> None:
        """Take up new sides alone."""
        self.sides = boundary
        if transposed or mirrored:
            self.sides = self.lent.view("sides", *self.shape)
            load_grid(boundary, self.sides, transposed, mirrored, inside=False)

    def take_sound(self, sound, transposed: bool) -> None:
        """Take up sound speeds (ni, nj) [m/s], given in the block's own frame."""
        self.sound = np.ascontiguousarray(sound.T) if transposed else sound

    def begin(self, *weights, **more) -> None:
        """As `Workspace.begin`; sound speeds that nobody has given are not read."""
        if "sound" not in self.__dict__:
            self.sound = np.zeros((self.ni, self.nj))
        if self.bend is NO_LAWS:
            self.bend = np.zeros(self.shape[1:])
        if self.curve is NO_CURVES and any(weigh_curves(self.sides)[:2]):
            self.curve = np.zeros(self.shape)
        super().begin(*weights, **more)

    def own_grids(self) -> None:
        """Copies of `old` and `sides`, to be written to."""
        self.old, self.sides = self.old.copy(), self.sides.copy()

    def give(self, transposed: bool, mirrored: bool) -> np.ndarray:
        """The grid `trial` in the block's own frame; the workspace is empty afterwards."""
        nodes, base = self.trial, self.base
        if transposed or mirrored:
            nodes = nodes[::-1] if mirrored else nodes
            nodes = nodes.transpose(0, 2, 1) if transposed else nodes
            out = base.reshape(nodes.shape)
            out[:] = nodes
            nodes, base = out, self.trial
        if not self.spared:
            self.lent.give_back(base)
        self.empty()
        return nodes

    def empty(self) -> None:
        """Hold no array of a block's size."""
        for name in GRIDS:
            self.__dict__.pop(name, None)

    def assemble(self, nodes) -> None:
        """Note what the Hessian of the next solve is that of: a convex grid."""
        self.phases, self.matrix = STRIPS, Matrix(nodes, self.law, 0.0)

    def assemble_smoothed(self, nodes, spread: float) -> None:
        """The same for the smoothed denominator on any grid."""
        self.phases, self.matrix = SMOOTHED, Matrix(nodes, self.law, spread)

    def solve(self, tolerance: float, floor: float, most: int = 16, guess=None):
        """As `Workspace.solve`."""
        names = WORK, "residual", "preconditioned", "direction"
        x, r, z, p = (self.lent.view(name, *self.vector, column=1) for name in names)
        self.solution, self.r, self.change = x, r, x[:, :, : self.nj + 1]
        length = (self.ni + 1) * NODE_ROWS
        rows = [self.lent.view(f"rows {n}", length) for n in range(self.threads)]
        vectors = Vectors(x, r, z, p, self.totals)
        solver = StripSolver(
            self.strips, self.phases, self.matrix, vectors, rows, self.scratch, self.trial
        )
        done, first, last = solver.solve(tolerance, floor, most, guess)
        self.iterations += done
        return done, first, last

    def store(self) -> Workspace:
        """As `Workspace.store`: a workspace of its own, for as long as it is used."""
        stored = Workspace(self.ni, self.nj, self.threads, np.inf)
        stored.old[:], stored.sides[:], stored.trial[:] = self.old, self.sides, self.trial
        stored.law, stored.sigma, stored.iterations = self.law, self.sigma, 0
        stored.assemble(stored.old)
        return stored

    def compute_barrier(self, nodes) -> np.ndarray:
        """As `Workspace.compute_barrier`, some rows of cells at a time."""
        out = np.empty((self.ni, self.nj))
        for first in range(0, self.ni, SLAB):
            last = min(first + SLAB, self.ni)
            sines = compute_scaled_jacobians(nodes[:, first : last + 1])
            for corner, i, j in BLOCK_CORNERS:
                if first <= i % self.ni < last:
                    sines[corner, i % self.ni - first, j] = 1.0
            with np.errstate(divide="ignore"):
                out[first:last] = np.clip(
                    LEAST_SINE / sines.min(axis=0), 1.0, self.law.strengthening
                )
        return out
