"""Exact signs of corner areas: which way three nodes turn, whatever the rounding.

The area in floating point decides where it is above its own error bound; elsewhere the sign is
computed once more with rational numbers, which are exact.  The bound `(3 + 16 u) u (|left| +
|right|)`, u = 2^-53, is that of [Shewchuk1997] for `(a - c) × (b - c)`; a few times the smallest
normal number is added to it, against underflow.

Triangles: at a block's corner all three nodes of the corner triangle are given, and where the sides
go straight on there the cell is a triangle with a fourth node on one side (theory R7).  It has no
flaw but this one corner, and is counted apart.

The trap: an exact sign says that a cell is convex, not that it is good: with an area of 1e-300 it
is of no use to anybody.  Regridders prove convexity with margins; this is for judging given grids.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from regrid.jit import kernel

UNIT = 2.0**-53
BOUND = (3.0 + 16.0 * UNIT) * UNIT
UNDERFLOW = 4.0 * np.finfo(float).tiny
# Corner triangles 1 to 4 of a cell: its node, and two neighbours so that convex means positive.
TRIANGLES = (
    ((0, 0), (1, 0), (0, 1)),
    ((0, 1), (0, 0), (1, 1)),
    ((1, 1), (0, 1), (1, 0)),
    ((1, 0), (1, 1), (0, 0)),
)

# Corner triangles all of whose nodes are boundary nodes: (corner, i, j) in (4, ni, nj).
BLOCK_CORNERS = ((0, 0, 0), (1, 0, -1), (2, -1, -1), (3, -1, 0))
FLAT = 1e-2  # part of its cell up to which a block's corner triangle makes the cell a triangle
TURNED = 1e-9  # part of its cell up to which it may be turned over, by rounding


def turn_exactly(a, b, c) -> int:
    """Sign of (a - c) × (b - c) for points given as floats: 1 anticlockwise, 0 on one line, -1."""
    (ax, ay), (bx, by), (cx, cy) = ([Fraction(float(v)) for v in point] for point in (a, b, c))
    area = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
    return (area > 0) - (area < 0)


def compute_turns(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, int]:
    """Exact signs (...) of (a - c) × (b - c) for points (2, ...), and how many were in doubt.

    Where a coordinate is not finite the sign is 0.
    """
    with np.errstate(all="ignore"):
        left = (a[0] - c[0]) * (b[1] - c[1])
        right = (a[1] - c[1]) * (b[0] - c[0])
        area = left - right
        bound = BOUND * (np.abs(left) + np.abs(right)) + UNDERFLOW
        sure = (np.abs(area) > bound) & np.isfinite(area)
        # Equal coordinates make both products exact zeros: collapsed edges, lines along x or y.
        sure |= ((a[0] == c[0]) | (b[1] == c[1])) & ((a[1] == c[1]) | (b[0] == c[0]))
    signs = np.where(sure, np.sign(area), 0.0).astype(np.int8)
    finite = np.isfinite(a).all(axis=0) & np.isfinite(b).all(axis=0) & np.isfinite(c).all(axis=0)
    doubtful = np.argwhere(~sure & finite)
    for index in doubtful:
        at = (slice(None), *index)
        signs[tuple(index)] = turn_exactly(a[at], b[at], c[at])
    return signs, len(doubtful)


def compute_corner_signs(nodes: np.ndarray) -> np.ndarray:
    """Exact signs (4, ni, nj) of the corner triangles of a grid (2, ni+1, nj+1).

    Numbered as in `regrid.measure.quality`; a cell is convex where all four are 1.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    signs = np.empty((4, ni, nj), dtype=np.int8)
    for corner, triangle in enumerate(TRIANGLES):
        c, a, b = (nodes[:, i : i + ni, j : j + nj] for i, j in triangle)
        signs[corner] = compute_turns(a, b, c)[0]
    return signs


def find_folded_cells(nodes: np.ndarray, excluded: np.ndarray | None = None) -> np.ndarray:
    """Cells (n, 2) with a corner that is not positive, but for `excluded` (4, ni, nj); exact.

    Without `excluded` the block's own corners are left out.
    """
    wrong = compute_corner_signs(nodes) <= 0
    if excluded is not None:
        wrong &= ~excluded
    else:
        for corner in BLOCK_CORNERS:
            wrong[corner] = False
    return np.argwhere(wrong.any(axis=0))


@kernel
def mark_triangles(nodes, areas):
    """Sum of 2^k over the block's corners k of BLOCK_CORNERS with triangles; see find_triangles.

    areas (4,): scratch.
    """
    x, y = nodes[0], nodes[1]
    marks = 0
    for corner in range(4):
        i = 0 if corner < 2 else x.shape[0] - 2
        j = 0 if corner == 0 or corner == 3 else x.shape[1] - 2
        cosine = 0.0
        for k in range(4):
            c, a, b = TRIANGLES[k]
            along_x = x[i + a[0], j + a[1]] - x[i + c[0], j + c[1]]
            along_y = y[i + a[0], j + a[1]] - y[i + c[0], j + c[1]]
            across_x = x[i + b[0], j + b[1]] - x[i + c[0], j + c[1]]
            across_y = y[i + b[0], j + b[1]] - y[i + c[0], j + c[1]]
            areas[k] = along_x * across_y - along_y * across_x
            if k == corner:
                cosine = along_x * across_x + along_y * across_y
        others = True
        for k in range(4):
            others = others and (k == corner or areas[k] > 0.0)
        cell = areas[corner] + areas[(corner + 2) % 4]
        flat = -TURNED * cell <= areas[corner] <= FLAT * cell
        if cosine < 0.0 and others and flat:
            marks += 1 << corner
    return marks


def find_triangles(nodes: np.ndarray) -> list[tuple[int, int, int]]:
    """The block's corners (corner, i, j), of BLOCK_CORNERS, whose cells are triangles.

    There the angle is above 90 degrees and the corner triangle FLAT of the cell or less (TURNED of
    it over, at most), while the cell's area and its other three corner triangles are positive.
    nodes (2, ni+1, nj+1); i, j turn counter-clockwise.  Source: [ProkopovND] §5.
    """
    marks = mark_triangles(np.ascontiguousarray(nodes, dtype=np.float64), np.empty(4))
    return [place for place in BLOCK_CORNERS if marks >> place[0] & 1]


def count_triangles(nodes: np.ndarray) -> int:
    """How many `find_triangles` finds; `nodes` C-contiguous, of float64."""
    return mark_triangles(nodes, np.empty(4)).bit_count()
