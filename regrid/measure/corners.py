"""Corner triangles and centres of cells: exact signs, and corners that no inner node can repair.

The area in floating point decides where it is above its own error bound; elsewhere the sign is
computed once more with rational numbers, which are exact.  The bound `(3 + 16 u) u (|left| +
|right|)`, u = 2^-53, is that of [Shewchuk1997] for `(a - c) × (b - c)`; a few times the smallest
normal number is added to it, against underflow.  Note: an exact sign says that a cell is convex,
not that it is good: with an area of 1e-300 it is of no use to anybody.  Regridders prove convexity
with margins; this is for judging given grids.

Triangles: at a block's corner all three nodes of the corner triangle are given, and where the sides
go straight on there the cell is a triangle with a fourth node on one side (theory R7).  It has no
flaw but this one corner, and is counted apart.  Excluded corners: the boundary's own nodes may turn
such a triangle over; where a side has shrunk to a point (an axis, the tip of a sector) its cells
are triangles, each with a corner triangle of no area.  They leave every sum and every test, and
`regrid.measure.quality` still counts them as not convex.

Source: [ProkopovND] §5.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.sides import compute_area


def compute_centres(nodes: np.ndarray) -> np.ndarray:
    """Means (..., ni, nj) of the four nodes of every cell of `nodes` (..., ni+1, nj+1).

    For coordinates (2, ...) or (3, ...) and for any other quantity known at the nodes, in its
    unit.  Opposite nodes are added first: a cell given mirrored or transposed has the same bits.
    """
    return 0.25 * (
        (nodes[..., :-1, :-1] + nodes[..., 1:, 1:]) + (nodes[..., 1:, :-1] + nodes[..., :-1, 1:])
    )


def compute_hexahedron_centres(nodes: np.ndarray) -> np.ndarray:
    """Means (3, n1, n2, n3) of the eight nodes of every cell of `nodes` (3, n1+1, n2+1, n3+1)."""
    along = nodes[:, 1:] + nodes[:, :-1]
    along = along[:, :, 1:] + along[:, :, :-1]
    return 0.125 * (along[..., 1:] + along[..., :-1])


UNIT_ROUND_OFF = 2.0**-53
ORIENTATION_ERROR_BOUND = (3.0 + 16.0 * UNIT_ROUND_OFF) * UNIT_ROUND_OFF
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
# part of its cell up to which a block's corner triangle makes the cell a triangle
FLAT_TRIANGLE_PART = 1e-2
TURNED_TRIANGLE_PART = 1e-9  # part of its cell up to which it may be turned over, by rounding


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
        bound = ORIENTATION_ERROR_BOUND * (np.abs(left) + np.abs(right)) + UNDERFLOW
        is_certain = (np.abs(area) > bound) & np.isfinite(area)
        # Equal coordinates make both products exact zeros: collapsed edges, lines along x or y.
        is_certain |= ((a[0] == c[0]) | (b[1] == c[1])) & ((a[1] == c[1]) | (b[0] == c[0]))
    signs = np.where(is_certain, np.sign(area), 0.0).astype(np.int8)
    finite = np.isfinite(a).all(axis=0) & np.isfinite(b).all(axis=0) & np.isfinite(c).all(axis=0)
    doubtful = np.argwhere(~is_certain & finite)
    for index in doubtful:
        place = (slice(None), *index)
        signs[tuple(index)] = turn_exactly(a[place], b[place], c[place])
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
    is_folded = compute_corner_signs(nodes) <= 0
    if excluded is not None:
        is_folded &= ~excluded
    else:
        for corner in BLOCK_CORNERS:
            is_folded[corner] = False
    return np.argwhere(is_folded.any(axis=0))


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
        others_are_positive = True
        for k in range(4):
            others_are_positive = others_are_positive and (k == corner or areas[k] > 0.0)
        cell = areas[corner] + areas[(corner + 2) % 4]
        is_flat = -TURNED_TRIANGLE_PART * cell <= areas[corner] <= FLAT_TRIANGLE_PART * cell
        if cosine < 0.0 and others_are_positive and is_flat:
            marks += 1 << corner
    return marks


def find_triangles(nodes: np.ndarray) -> list[tuple[int, int, int]]:
    """The block's corners (corner, i, j), of BLOCK_CORNERS, whose cells are triangles.

    There the angle is above 90 degrees and the corner triangle FLAT_TRIANGLE_PART of the cell or
    less (TURNED_TRIANGLE_PART of it over, at most), while the cell's area and its other three
    corner triangles are positive.  nodes (2, ni+1, nj+1); i, j turn counter-clockwise.  Source:
    [ProkopovND] §5.
    """
    marks = mark_triangles(np.ascontiguousarray(nodes, dtype=np.float64), np.empty(4))
    return [place for place in BLOCK_CORNERS if marks >> place[0] & 1]


def count_triangles(nodes: np.ndarray) -> int:
    """How many `find_triangles` finds; `nodes` C-contiguous, of float64."""
    return mark_triangles(nodes, np.empty(4)).bit_count()


@inlined
def find_triangle(i, j, corner):
    """Nodes of a corner triangle, as (p, q, next_p, next_q).

    The corner's own node is (p, q), its neighbours in the cell are (next_p, q) and (p, next_q).
    """
    p = i + corner // 2
    q = j + (1 if corner == 1 or corner == 2 else 0)
    return p, q, 2 * i + 1 - p, 2 * j + 1 - q


@inlined
def compute_doubled_area(nodes, i, j, corner):
    """Twice the area of a corner triangle of `nodes` (2, ni+1, nj+1), in m².

    Positive when the cell is convex there, in a grid whose i, j turn like x, y.
    """
    p, q, next_p, next_q = find_triangle(i, j, corner)
    x, y = nodes[0], nodes[1]
    cross = (x[next_p, q] - x[p, q]) * (y[p, next_q] - y[p, q])
    cross -= (y[next_p, q] - y[p, q]) * (x[p, next_q] - x[p, q])
    return cross if (p == i) == (q == j) else -cross


@kernel
def count_turned_corners(sides):
    """How many of a block's own four corner triangles are not positive; 0 to 4.

    Their nodes are all on the sides: of `sides` (2, ni+1, nj+1) nothing else is read.
    """
    ni, nj = sides.shape[1] - 1, sides.shape[2] - 1
    count = 0
    for corner in range(4):
        i = 0 if corner < 2 else ni - 1
        j = 0 if corner == 0 or corner == 3 else nj - 1
        count += 1 if compute_doubled_area(sides, i, j, corner) <= 0.0 else 0
    return count


def find_excluded_corners(nodes: np.ndarray) -> np.ndarray:
    """Corner triangles (4, ni, nj) that no inner node can make positive; exact.

    Those at the block's corners that the boundary turns over, and those with an edge of no length
    on the boundary.  Only the sides of `nodes` (2, ni+1, nj+1) are read.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    sign = 1 if compute_area(nodes) >= 0.0 else -1
    excluded = np.zeros((4, ni, nj), dtype=bool)
    for corner, i, j in BLOCK_CORNERS:
        row = i % ni
        column = j % nj
        cell = nodes[:, row : row + 2, column : column + 2]
        turn = compute_corner_signs(cell)[corner, 0, 0]
        excluded[corner, i, j] = sign * turn <= 0
    fixed = np.zeros((ni + 1, nj + 1), dtype=bool)
    fixed[[0, -1]] = fixed[:, [0, -1]] = True
    for corner, triangle in enumerate(TRIANGLES):
        slices = [(slice(i, i + ni), slice(j, j + nj)) for i, j in triangle]
        for p, q in ((0, 1), (0, 2), (1, 2)):
            coincide = (nodes[(slice(None), *slices[p])] == nodes[(slice(None), *slices[q])]).all(
                axis=0
            )
            excluded[corner] |= coincide & fixed[slices[p]] & fixed[slices[q]]
    return excluded


def is_collapsed(excluded: np.ndarray) -> bool:
    """Whether corners other than the block's own are excluded."""
    return bool(excluded.any()) and int(excluded.sum()) > sum(
        bool(excluded[corner]) for corner in BLOCK_CORNERS
    )
