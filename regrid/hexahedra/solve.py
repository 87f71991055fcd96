"""The linear solve of a Newton step on hexahedra: lines, conjugate gradients, smooth errors.

Conjugate gradients are preconditioned by the blocks of single edges (theory R14.6), including the
coupling for edges along i: a block tridiagonal system per line, factored once per step.  Note:
block and coupling of an edge along i must have the same factor, or a line's matrix is not positive
definite.  Sums use numpy in a fixed order.

Smooth errors of a large block are first removed on coarse nodes (theory R14.11): every few nodes
form a coarse block of hexahedra with its own conditional lengths, straight-line weights and
strengths; its Hessian is that of the functional on it.  Displacements are trilinear in the indices
between coarse nodes.  Note: if a coarse cell is folded although no fine one is, there is no
correction.
"""

from __future__ import annotations

import math

import numpy as np

from shockgrid.regrid.barrier.coarse_nodes import cut_evenly
from shockgrid.regrid.hexahedra.faces import FaceLengths, Functional
from shockgrid.regrid.hexahedra.functional import (
    WITH_MATRIX,
    assemble,
    compare_corners,
    cross,
    fill_product,
    formula,
    plus,
)
from shockgrid.regrid.jit import kernel


@formula
def get_six(matrix, i, j, k):
    """A symmetric 3 x 3 matrix of (6, nodes): xx, xy, xz, yy, yz, zz."""
    return (
        matrix[0, i, j, k], matrix[1, i, j, k], matrix[2, i, j, k],
        matrix[3, i, j, k], matrix[4, i, j, k], matrix[5, i, j, k],
    )  # fmt: skip


@formula
def times(m, v):
    """A symmetric matrix times a vector."""
    x, y, z = v
    return (
        m[0] * x + m[1] * y + m[2] * z,
        m[1] * x + m[3] * y + m[4] * z,
        m[2] * x + m[4] * y + m[5] * z,
    )


@kernel(allocates=False)
def factor_lines(blocks):
    """Overwrite the diagonal blocks in (2, 6, nodes) by inverse pivots of the lines along i; the
    forward couplings are unchanged."""
    diagonal_blocks = blocks[0]
    couplings = blocks[1]
    n1 = diagonal_blocks.shape[1] - 1
    n2 = diagonal_blocks.shape[2] - 1
    n3 = diagonal_blocks.shape[3] - 1
    for i in range(1, n1):
        for j in range(1, n2):
            for k in range(1, n3):
                xx, xy, xz, yy, yz, zz = get_six(diagonal_blocks, i, j, k)
                # the block less the coupling through the row before
                if i > 1:
                    pivot = get_six(diagonal_blocks, i - 1, j, k)
                    c = get_six(couplings, i - 1, j, k)
                    u = times(c, times(pivot, (c[0], c[1], c[2])))
                    v = times(c, times(pivot, (c[1], c[3], c[4])))
                    w = times(c, times(pivot, (c[2], c[4], c[5])))
                    xx, xy, xz = xx - u[0], xy - v[0], xz - w[0]
                    yy = yy - v[1]
                    yz = yz - w[1]
                    zz = zz - w[2]
                # its inverse, symmetric
                p = cross((xy, yy, yz), (xz, yz, zz))
                q = xx * zz - xz * xz
                r = xy * xz - xx * yz
                inverse = 1.0 / (xx * p[0] + xy * p[1] + xz * p[2])
                diagonal_blocks[0, i, j, k] = p[0] * inverse
                diagonal_blocks[1, i, j, k] = p[1] * inverse
                diagonal_blocks[2, i, j, k] = p[2] * inverse
                diagonal_blocks[3, i, j, k] = q * inverse
                diagonal_blocks[4, i, j, k] = r * inverse
                diagonal_blocks[5, i, j, k] = (xx * yy - xy * xy) * inverse


@kernel(allocates=False)
def solve_lines(blocks, r, z):
    """`z` = solution along every line for the residual `r`, (3, nodes); zeros on the boundary."""
    diagonal_blocks = blocks[0]
    couplings = blocks[1]
    n1 = diagonal_blocks.shape[1] - 1
    n2 = diagonal_blocks.shape[2] - 1
    n3 = diagonal_blocks.shape[3] - 1
    for i in range(1, n1):
        for j in range(1, n2):
            for k in range(1, n3):
                right = (r[0, i, j, k], r[1, i, j, k], r[2, i, j, k])
                if i > 1:
                    before = (z[0, i - 1, j, k], z[1, i - 1, j, k], z[2, i - 1, j, k])
                    before = times(get_six(diagonal_blocks, i - 1, j, k), before)
                    right = plus(right, times(get_six(couplings, i - 1, j, k), before))
                z[0, i, j, k], z[1, i, j, k], z[2, i, j, k] = right
    for i in range(n1 - 1, 0, -1):
        for j in range(1, n2):
            for k in range(1, n3):
                right = (z[0, i, j, k], z[1, i, j, k], z[2, i, j, k])
                if i < n1 - 1:
                    after = (z[0, i + 1, j, k], z[1, i + 1, j, k], z[2, i + 1, j, k])
                    right = plus(right, times(get_six(couplings, i, j, k), after))
                solved = times(get_six(diagonal_blocks, i, j, k), right)
                z[0, i, j, k], z[1, i, j, k], z[2, i, j, k] = solved


def solve(multiply, precondition, r, x, stop: float, most_iterations: int):
    """Add to `x` the correction that removes the residual `r` (3, nodes), which is overwritten.

    `multiply(p)` and `precondition(r)` return fresh or own arrays with zeros on the boundary.
    Returns (iterations, first r.z, last r.z); stops when r.z is `stop` or less.
    """
    z = precondition(r)
    first_square = residual_square = float((r * z).sum())
    iterations = 0
    p = z.copy()
    while iterations < most_iterations and residual_square > stop:
        product = multiply(p)
        curvature = float((p * product).sum())
        if not curvature > 0.0 or not np.isfinite(curvature):
            break
        alpha = residual_square / curvature
        x += alpha * p
        r -= alpha * product
        z = precondition(r)
        square_before = residual_square
        residual_square = float((r * z).sum())
        p *= residual_square / square_before
        p += z
        iterations += 1
    return iterations, first_square, residual_square


LEAST_CELLS = 1000  # of corrected blocks: in smaller ones the fine solve removes all errors
FINE_EDGES_PER_COARSE = 4  # fine edges per coarse edge
LEAST_VOLUME = 0.02  # of a coarse corner, over that of its conditional lengths
# of the coarse solve
COARSE_TOLERANCE = 0.05
COARSE_ITERATIONS = 12


def cut_block(cells: int) -> np.ndarray:
    """Indices of coarse nodes along `cells` edges, including both ends, int64.

    About every fourth node, at least two coarse edges, symmetric about the middle.
    """
    return cut_evenly(cells, max(2, cells // FINE_EDGES_PER_COARSE))


def make_hats(starts: np.ndarray) -> np.ndarray:
    """Values (coarse, fine) of the linear hat functions of coarse nodes; zero for both ends."""
    fine = np.arange(starts[-1] + 1)
    hats = np.array([np.interp(fine, starts, unit) for unit in np.eye(starts.size)])
    hats[[0, -1]] = 0.0
    return hats


def contract(hats, values: np.ndarray) -> np.ndarray:
    """Sums of `values` (3, ...) over every index with one matrix (new, old) per index."""
    for axis, matrix in enumerate(hats, start=1):
        values = np.moveaxis(np.tensordot(matrix, values, (1, axis)), 0, axis)
    return np.ascontiguousarray(values)


class CoarseBlock:
    """The coarse nodes of a block of `cells` (3,) and the data for a solve on them.

    `is_possible` is False for blocks that are not corrected.
    """

    def __init__(self, cells: tuple[int, ...]):
        self.is_possible = math.prod(cells) >= LEAST_CELLS and min(cells) > 1
        if not self.is_possible:
            return
        self.starts = tuple(cut_block(n) for n in cells)
        self.hats = [make_hats(starts) for starts in self.starts]
        shape = tuple(len(starts) for starts in self.starts)
        self.solution, self.product, self.z = (np.zeros((3, *shape)) for _ in range(3))
        self.gradient = np.zeros((3, *shape))
        self.blocks = np.zeros((2, 6, *shape))
        self.planes = np.empty(shape[0] - 1)

    def make_lengths(self, lengths: FaceLengths) -> FaceLengths:
        """Lengths, straight-line weights and scale of the coarse block, from the fine one."""
        inverse = []
        line_weights = []
        edge_counts = [np.diff(starts) for starts in self.starts]
        # fine lines that a coarse one represents, half of those on either side
        shares = [0.5 * (np.append(m, m[-1]) + np.append(m[0], m)) for m in edge_counts]
        for axis in range(3):
            across = [k for k in range(3) if k != axis]
            fine = [
                self.starts[k] if k != axis else np.arange(self.starts[k][-1]) for k in range(3)
            ]
            length = np.add.reduceat(
                1.0 / lengths.inverse[axis][np.ix_(*fine)], self.starts[axis][:-1], axis=axis
            )
            inverse.append(np.ascontiguousarray(1.0 / length))
            p, q = across
            line_weight = lengths.line_weights[axis][np.ix_(self.starts[p], self.starts[q])]
            line_weights.append(np.ascontiguousarray(line_weight * np.outer(shares[p], shares[q])))
        return FaceLengths(tuple(inverse), tuple(line_weights), lengths.scale)  # type: ignore[arg-type]

    def find(self, nodes, functional: Functional, r, Z) -> float:
        """Solve for the correction of the smooth part of the residual `r`; both (3, nodes).

        Returns the residual times the solution; 0 if the coarse block is folded or the block is not
        corrected.
        """
        if not self.is_possible:
            return 0.0
        # the coarse block, if it is valid
        coarse = np.ascontiguousarray(nodes[np.ix_(range(3), *self.starts)])
        cells = tuple(len(starts) - 1 for starts in self.starts)
        lengths = self.make_lengths(functional.lengths)
        strength = functional.strength
        _, least = compare_corners(coarse, coarse, lengths.inverse, cells, Z)
        if not least > LEAST_VOLUME:
            return 0.0
        # its barrier: sums over the cells in each of its cells
        for axis in range(3):
            strength = np.add.reduceat(strength, self.starts[axis][:-1], axis=axis)
        strength = np.ascontiguousarray(strength)
        functional = Functional(lengths, strength, functional.area_weight)
        # its matrix and lines (R14.11)
        for array in (self.gradient, self.blocks, self.solution):
            array[:] = 0.0
        assemble(coarse, functional, WITH_MATRIX, self.gradient, self.blocks, self.planes, Z)
        factor_lines(self.blocks)

        def multiply(p):
            fill_product(coarse, p, functional, self.product, Z)
            return self.product

        def precondition(r):
            solve_lines(self.blocks, r, self.z)
            return self.z

        right = contract(self.hats, r)
        remaining = right.copy()
        stop = COARSE_TOLERANCE**2 * float((remaining * precondition(remaining)).sum())
        solve(multiply, precondition, remaining, self.solution, stop, COARSE_ITERATIONS)
        gain = float((right * self.solution).sum())
        return gain if math.isfinite(gain) else 0.0

    def add(self, change: np.ndarray) -> None:
        """Add the solution to `change` (3, nodes), trilinear between coarse nodes."""
        change += contract([hats.T for hats in self.hats], self.solution)
