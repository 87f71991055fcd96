"""The linear solve of a large block without a stored matrix: strips of columns, one at a time.

The Hessian of a node is 26 numbers, twice as much as all else that a block keeps.  Here each pass
of the conjugate gradients (`regrid.barrier.line_cg`) goes over strips of columns and assembles the
strip's rows of the matrix into one small array before it uses them.  A strip's numbers are those of
the same chunk of a stored matrix, and sums are one partial a column, added in order: the same bits,
at the cost of two assemblies an iteration.  Large blocks seldom need a solve: smooth errors are
taken away on coarse nodes.

The trap: the new direction takes the place of the old one, so that it is made as a whole before any
strip is multiplied by it; the preconditioned residual lies where the product was.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np


class Phases(NamedTuple):
    """Kernels of a solve by strips, with the arguments of those named.

    assemble: `regrid.barrier.assembly.assemble_barrier`; multiply, solve_lines: `fill_product`,
    `fill_line_solution` of `regrid.barrier.line_cg`; span: numbers in a row of a strip's matrix.
    """

    assemble: Callable[..., None]
    multiply: Callable[..., None]
    solve_lines: Callable[..., None]
    span: int


class Matrix(NamedTuple):
    """What a Hessian is assembled from: nodes (2, ni + 1, nj + 1) [m], a `BarrierLaw`, the spread
    of the smoothed denominator."""

    nodes: np.ndarray
    law: Any
    spread: float


class Vectors(NamedTuple):
    """Vectors (2, ni + 1, columns >= nj + 1) of a solve, their rims zero, and partial sums.

    solution: of H x = r; residual; preconditioned: the residual after the preconditioner, and the
    matrix times the direction, in turn; direction; totals (columns,): a partial a column.
    """

    solution: np.ndarray
    residual: np.ndarray
    preconditioned: np.ndarray
    direction: np.ndarray
    totals: np.ndarray


class Strips:
    """The strips of a block of ni × nj cells, shared among threads.

    columns (strips + 1): their first node columns, `whole` the same with columns of zeros behind
    the last one, up to whole vectors of the processor.
    """

    def __init__(self, columns: np.ndarray, whole: np.ndarray, nj: int, threads: int):
        self.columns, self.whole, self.nj, self.threads = columns, whole, nj, threads
        self.count = columns.size - 1
        self._pool: ThreadPoolExecutor | None = None

    def run(self, call: Callable[[int, int], None]) -> None:
        """`call(strip, thread)` for all strips."""

        def work(thread: int) -> None:
            for strip in range(thread, self.count, self.threads):
                call(strip, thread)

        if self.threads > 1 and self._pool is None:
            self._pool = ThreadPoolExecutor(self.threads - 1, "strip")
        waiting = [self._pool.submit(work, n) for n in range(1, self.threads)] if self._pool else []
        work(0)
        for future in waiting:
            future.result()


class StripSolver:
    """Conjugate gradients for `H x = -gradient`; see the module's docstring.

    rows: an array a thread for a strip's rows of the matrix, zero where no strip has written;
    scratch (strips, n): of the kernels; `spare` (2, ni + 1, nj + 1): an array whose inside is of no
    use during the solve.
    """

    def __init__(
        self,
        strips: Strips,
        phases: Phases,
        matrix: Matrix,
        vectors: Vectors,
        rows: list[np.ndarray],
        scratch: np.ndarray,
        spare: np.ndarray,
    ):
        self.strips, self.phases, self.matrix, self.vectors = strips, phases, matrix, vectors
        self.rows, self.scratch, self.spare = rows, scratch, spare

    def solve(self, tolerance: float, floor: float, most: int, guess: np.ndarray | None):
        """Fill the solution; returns (iterations, first and last r·z), as `line_cg.solve` does.

        Without `guess` (2, ni + 1, nj + 1) the rim stays; with it, it is where the iteration
        begins, its rim is kept.
        """
        _, _, z, p, _ = self.vectors
        self._clear(guess)
        beta, done = 0.0, 0
        self.strips.run(self._begin_with if guess is not None else self._begin)
        rz = first = self._add_columns()
        stop = max(floor, tolerance * tolerance * first)
        while done < most and rz > stop:
            np.multiply(p, beta, out=p)
            np.add(z, p, out=p)
            self.strips.run(self._multiply)
            curvature = self._add_columns()
            if not curvature > 0.0:
                break
            alpha = rz / curvature
            self.strips.run(functools.partial(self._step, alpha))
            done += 1
            previous, rz = rz, self._add_columns()
            beta = rz / previous
        return done, first, rz

    def _clear(self, guess: np.ndarray | None) -> None:
        """Zeros at the start of the solution and direction, and around the rest."""
        x, r, z, p, _ = self.vectors
        nj = self.strips.nj
        x[:], p[:] = 0.0, 0.0
        if guess is not None:
            x[:, :, : nj + 1] = guess
        for vector in (r, z):
            vector[:, [0, -1]] = 0.0
            vector[:, :, 0] = 0.0
            vector[:, :, nj:] = 0.0

    def _assemble(self, strip: int, thread: int, gradient: np.ndarray) -> np.ndarray:
        """A strip's rows of the matrix, and its columns of `gradient`."""
        rows, strips, matrix = self.rows[thread], self.strips, self.matrix
        first, last = strips.columns[strip], strips.columns[strip + 1]
        if strip == strips.count - 1:  # what a wider strip has left must not reach into the zeros
            rows.reshape(-1, self.phases.span)[:, last - first + 1 :] = 0.0
        self.phases.assemble(
            matrix.nodes, matrix.law, matrix.spread, first, last, rows, gradient,
            self.scratch[strip],
        )  # fmt: skip
        return rows

    def _begin(self, strip: int, thread: int) -> None:
        """The residual without a guess: -gradient."""
        r = self.vectors.residual
        rows = self._assemble(strip, thread, r)
        own = r[:, :, self.strips.columns[strip] : self.strips.columns[strip + 1]]
        np.negative(own, out=own)
        self._solve_lines(0.0, strip, rows)

    def _begin_with(self, strip: int, thread: int) -> None:
        """The residual of the guess: -(gradient + H x)."""
        x, r, z, _, _ = self.vectors
        rows = self._assemble(strip, thread, r)
        self._multiply_by(x, strip, rows)
        columns = slice(self.strips.columns[strip], self.strips.columns[strip + 1])
        own = r[:, :, columns]
        np.add(own, z[:, :, columns], out=own)
        np.negative(own, out=own)
        self._solve_lines(0.0, strip, rows)

    def _solve_lines(self, alpha: float, strip: int, rows: np.ndarray) -> None:
        """A step of length `alpha`, and the strip's lines solved for the residual after it."""
        x, r, z, p, totals = self.vectors
        low, high = self.strips.whole[strip], self.strips.whole[strip + 1]
        self.phases.solve_lines(alpha, p, z, x, r, z, low, high, rows, totals)

    def _step(self, alpha: float, strip: int, thread: int) -> None:
        self._solve_lines(alpha, strip, self._assemble(strip, thread, self.spare))

    def _multiply(self, strip: int, thread: int) -> None:
        self._multiply_by(self.vectors.direction, strip, self._assemble(strip, thread, self.spare))

    def _multiply_by(self, direction: np.ndarray, strip: int, rows: np.ndarray) -> None:
        """The strip's rows times `direction` into its columns of `preconditioned`."""
        z, totals = self.vectors.preconditioned, self.vectors.totals
        low, high = self.strips.whole[strip], self.strips.whole[strip + 1]
        self.phases.multiply(direction, -1.0, z, z, low, high, rows, z, totals, self.scratch[strip])

    def _add_columns(self) -> float:
        """The sum over the columns in order."""
        whole = self.strips.whole
        return float(np.add.accumulate(self.vectors.totals[whole[0] : whole[-1]])[-1])
