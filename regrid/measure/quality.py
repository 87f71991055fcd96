"""Quality of a grid: corner areas and sines, aspect ratio, skew, the first line's distance; the
best sines that its boundary allows; how sharply a line bends and how even its steps are.

Corner areas carry the absolute orientation (positive when i, j turn like x, y): a folded cell
cannot hide behind its own neighbours, as it can behind measures that normalise by the cell's
sign.  Corners are numbered as in theory R2: (i,j), (i,j+1), (i+1,j+1), (i+1,j).

Aspect ratio and skew are those of [Robinson1987], the "maximum edge ratio" and "skew" of the
Verdict library: with the cell's two mid-lines p (along i) and q (along j),
`max(|p|/|q|, |q|/|p|)` and `|p . q| / (|p| |q|)`.

Best sines: an inner node of a side shares its angle theta between two cells, and the sine of the
worse one is at most sin(theta/2); a corner of the block leaves its angle to one cell: sin(theta).
Only the sides' angles are judged, so a grid may fall short of this for other reasons.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import (
    ORIENTATION_ERROR_BOUND,
    UNDERFLOW,
    compute_corner_signs,
    count_triangles,
    find_triangles,
)
from shockgrid.regrid.measure.crossings import walk_boundary
from shockgrid.regrid.sides import SIDE_NAMES


@dataclass(frozen=True)
class Quality:
    """One grid in numbers; places are cells (i, j).

    `triangles` counts cells at the block's corners that the sides make triangles
    (`regrid.measure.corners.find_triangles`): their flat corner enters no other measure.
    """

    least_corner_area: float
    least_corner_area_at: tuple[int, int]
    least_scaled_jacobian: float
    least_scaled_jacobian_at: tuple[int, int]
    worst_aspect_ratio: float
    worst_skew: float
    bad_cells: int
    triangles: int = 0


@inlined
def take_edges(x0, y0, x1, y1, j):
    """The edges of cell j between two rows of nodes: along i at j and at j + 1, then along j at
    the first row and at the second."""
    return (
        (x1[j] - x0[j], y1[j] - y0[j]), (x1[j + 1] - x0[j + 1], y1[j + 1] - y0[j + 1]),
        (x0[j + 1] - x0[j], y0[j + 1] - y0[j]), (x1[j + 1] - x1[j], y1[j + 1] - y1[j]),
    )  # fmt: skip


@inlined
def square(edge):
    """The square of a vector's length."""
    return edge[0] * edge[0] + edge[1] * edge[1]


@inlined
def find_areas(low, up, near, far):
    """Doubled areas of a cell's corner triangles, from its `take_edges`."""
    return (
        low[0] * near[1] - low[1] * near[0], up[0] * near[1] - up[1] * near[0],
        up[0] * far[1] - up[1] * far[0], low[0] * far[1] - low[1] * far[0],
    )  # fmt: skip


@inlined
def measure_cell(low, up, near, far):
    """Least sine of a cell's corners, squared with its sign, so that one root serves a whole grid;
    squares and product of the doubled mid-lines along i and along j."""
    area_1, area_2, area_3, area_4 = find_areas(low, up, near, far)
    low_square = square(low)
    up_square = square(up)
    near_square = square(near)
    far_square = square(far)
    sine_1 = area_1 * abs(area_1) / (low_square * near_square)
    sine_2 = area_2 * abs(area_2) / (up_square * near_square)
    sine_3 = area_3 * abs(area_3) / (up_square * far_square)
    sine_4 = area_4 * abs(area_4) / (low_square * far_square)
    sine_12 = sine_1 if sine_1 < sine_2 else sine_2
    sine_34 = sine_3 if sine_3 < sine_4 else sine_4
    mid_i = (low[0] + up[0], low[1] + up[1])
    mid_j = (near[0] + far[0], near[1] + far[1])
    dot = mid_i[0] * mid_j[0] + mid_i[1] * mid_j[1]
    sine = sine_12 if sine_12 < sine_34 else sine_34
    return sine, square(mid_i), square(mid_j), dot


@kernel
def fill_corner_areas(nodes, out):
    """Signed areas of the four corner triangles of every cell into `out` (4, ni, nj)."""
    x, y = nodes[0], nodes[1]
    for i in range(out.shape[1]):
        x0 = x[i]
        y0 = y[i]
        x1 = x[i + 1]
        y1 = y[i + 1]
        for j in range(out.shape[2]):
            area_1, area_2, area_3, area_4 = find_areas(*take_edges(x0, y0, x1, y1, j))
            out[0, i, j] = 0.5 * area_1
            out[1, i, j] = 0.5 * area_2
            out[2, i, j] = 0.5 * area_3
            out[3, i, j] = 0.5 * area_4


@kernel
def fill_scaled_jacobians(nodes, out):
    """Sines of the four corner angles of every cell into `out` (4, ni, nj); NaN at a zero edge."""
    x, y = nodes[0], nodes[1]
    for i in range(out.shape[1]):
        x0 = x[i]
        y0 = y[i]
        x1 = x[i + 1]
        y1 = y[i + 1]
        for j in range(out.shape[2]):
            low, up, near, far = take_edges(x0, y0, x1, y1, j)
            area_1, area_2, area_3, area_4 = find_areas(low, up, near, far)
            low_square = square(low)
            up_square = square(up)
            near_square = square(near)
            far_square = square(far)
            out[0, i, j] = area_1 / np.sqrt(low_square * near_square)
            out[1, i, j] = area_2 / np.sqrt(up_square * near_square)
            out[2, i, j] = area_3 / np.sqrt(up_square * far_square)
            out[3, i, j] = area_4 / np.sqrt(low_square * far_square)


# Rows of the scratch of `measure_rows`, and of its result (one value a row of cells).
AREA, SINE, ASPECT, SKEW = range(4)


@kernel
def measure_rows(nodes, rows, worst, bad_cells):
    """Per row of cells: least corner area, least sine, largest squared aspect ratio and skew.

    `rows` (4, nj): scratch; `worst` (4, ni), `bad_cells` (ni,): cells with a corner area that is
    not positive (or NaN).
    """
    x, y = nodes[0], nodes[1]
    ni, nj = worst.shape[1], x.shape[1] - 1
    for i in range(ni):
        x0 = x[i]
        y0 = y[i]
        x1 = x[i + 1]
        y1 = y[i + 1]
        for j in range(nj):
            edges = take_edges(x0, y0, x1, y1, j)
            area_1, area_2, area_3, area_4 = find_areas(*edges)
            sine, along, across, dot = measure_cell(*edges)
            area_12 = area_1 if area_1 < area_2 else area_2
            area_34 = area_3 if area_3 < area_4 else area_4
            # 0, or NaN where a corner is: comparisons lose it, the sum does not
            not_a_number = 0.0 * (area_1 + area_2 + area_3 + area_4)
            rows[AREA, j] = (area_12 if area_12 < area_34 else area_34) + not_a_number
            rows[SINE, j] = sine
            rows[ASPECT, j] = along / across if along > across else across / along
            rows[SKEW, j] = dot * dot / (along * across)
        area = rows[AREA, 0]
        sine = rows[SINE, 0]
        aspect = 0.0
        skew = 0.0
        bad_count = 0
        for j in range(nj):
            area = min(area, rows[AREA, j])
            sine = min(sine, rows[SINE, j])
            aspect = max(aspect, rows[ASPECT, j])
            skew = max(skew, rows[SKEW, j])
            bad_count += 0 if rows[AREA, j] > 0.0 else 1
        worst[AREA, i] = 0.5 * area
        worst[SINE, i] = sine
        worst[ASPECT, i] = aspect
        worst[SKEW, i] = skew
        bad_cells[i] = bad_count


def compute_corner_areas(nodes: np.ndarray) -> np.ndarray:
    """Signed areas (4, ni, nj) of the corner triangles; a cell is convex when all four are > 0."""
    nodes = _checked(nodes)
    out = np.empty((4, nodes.shape[1] - 1, nodes.shape[2] - 1))
    fill_corner_areas(nodes, out)
    return out


def compute_scaled_jacobians(nodes: np.ndarray) -> np.ndarray:
    """Sines (4, ni, nj) of the corner angles, with the absolute orientation."""
    nodes = _checked(nodes)
    out = np.empty((4, nodes.shape[1] - 1, nodes.shape[2] - 1))
    fill_scaled_jacobians(nodes, out)
    return out


def compute_mid_lines(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mid-line vectors (2, ni, nj) of every cell along i and along j."""
    x = np.asarray(nodes)
    along = 0.5 * (x[:, 1:, :-1] - x[:, :-1, :-1] + x[:, 1:, 1:] - x[:, :-1, 1:])
    across = 0.5 * (x[:, :-1, 1:] - x[:, :-1, :-1] + x[:, 1:, 1:] - x[:, 1:, :-1])
    return along, across


def compute_aspect_ratio(nodes: np.ndarray) -> np.ndarray:
    """Longer over shorter mid-line (ni, nj)."""
    ratio = np.divide(*(np.hypot(*line) for line in compute_mid_lines(nodes)))
    return np.maximum(ratio, 1.0 / ratio)


def compute_skew(nodes: np.ndarray) -> np.ndarray:
    """Absolute cosine (ni, nj) of the angle between the two mid-lines; 0 is best."""
    along, across = compute_mid_lines(nodes)
    return np.abs((along * across).sum(axis=0)) / (np.hypot(*along) * np.hypot(*across))


def say_not_convex(count: int) -> str:
    """`1 cell is not convex`, `2 cells are not convex`."""
    return f"{count} {'cell is' if count == 1 else 'cells are'} not convex"


def find_bad_cells(nodes: np.ndarray) -> np.ndarray:
    """Cells (n, 2) as (i, j) that are not convex or not finite, worst first.

    Areas within their rounding error have their sign computed exactly
    (`regrid.measure.corners`). Triangles at the block's corners are as good as convex.
    """
    if _are_surely_convex(nodes):
        return np.empty((0, 2), dtype=np.int64)
    areas = compute_corner_areas(nodes)
    triangles = find_triangles(nodes)
    for flat in triangles:
        areas[flat] = np.inf
    least = areas.min(axis=0)
    is_bad = ~(least > 0.0)
    edges = max(_longest(np.diff(nodes, axis=axis)) for axis in (1, 2))
    is_doubtful = np.abs(least) <= 4.0 * ORIENTATION_ERROR_BOUND * edges * edges + UNDERFLOW
    if is_doubtful.any():
        signs = compute_corner_signs(nodes)
        for flat in triangles:
            signs[flat] = 1
        is_bad = np.where(is_doubtful, ~(signs > 0).all(axis=0), is_bad)
    cells = np.argwhere(is_bad)
    return cells[np.argsort(least[cells[:, 0], cells[:, 1]], kind="stable")]


def _are_surely_convex(nodes: np.ndarray) -> bool:
    """Whether all sines of corners exceed their rounding error (of edges above 1e-77 m)."""
    sine, _, bad_cells = reduce_worst(_checked(nodes), np.empty((3, nodes.shape[2] - 1)))
    return bad_cells == 0 and sine > (8.0 * ORIENTATION_ERROR_BOUND) ** 2


def _longest(differences: np.ndarray) -> float:
    """The largest finite component of some vectors."""
    size = np.abs(differences)
    return float(np.where(np.isfinite(size), size, 0.0).max())


def least_corner_area(nodes: np.ndarray) -> float:
    """Smallest signed corner area; positive exactly when every cell is convex."""
    return float(compute_corner_areas(nodes).min())


def measure_quality(nodes: np.ndarray) -> Quality:
    """All measures in one pass, cheap enough for every time step."""
    nodes = _checked(nodes)
    # all rows in one pass
    rows, worst, bad_cells = _make_scratch(nodes)
    measure_rows(nodes, rows, worst, bad_cells)
    triangles = find_triangles(nodes)
    # without corners that sides make flat
    if triangles:
        areas = compute_corner_areas(nodes)
        sines = compute_scaled_jacobians(nodes)
        for flat in triangles:
            areas[flat] = sines[flat] = np.inf
        areas = areas.min(axis=0)
        sines = sines.min(axis=0)
        worst[AREA] = areas.min(axis=1)
        bad_cells[:] = (~(areas > 0.0)).sum(axis=1)
        worst[SINE] = (sines * np.abs(sines)).min(axis=1)
    # where the worst are: their rows again
    area_row = int(worst[AREA].argmin())
    sine_row = int(worst[SINE].argmin())
    if triangles:
        areas = areas[area_row]
        sines = sines[sine_row]
    else:
        areas, sines = (
            compute(nodes[:, row : row + 2]).min(axis=0)[0]
            for compute, row in (
                (compute_corner_areas, area_row),
                (compute_scaled_jacobians, sine_row),
            )
        )
    # from squares to values
    sine = worst[SINE, sine_row]
    return Quality(
        least_corner_area=float(worst[AREA, area_row]),
        least_corner_area_at=(area_row, int(areas.argmin())),
        least_scaled_jacobian=float(np.copysign(np.sqrt(abs(sine)), sine)),
        least_scaled_jacobian_at=(sine_row, int(sines.argmin())),
        worst_aspect_ratio=float(np.sqrt(worst[ASPECT].max())),
        worst_skew=float(np.sqrt(worst[SKEW].max())),
        bad_cells=int(bad_cells.sum()),
        triangles=len(triangles),
    )


@kernel
def reduce_worst(nodes, rows):
    """Least squared sine, largest squared aspect ratio and number of bad cells of a grid.

    As of `measure_rows`, in fewer operations, and without places; rows (3, nj): scratch.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    sines = rows[0]
    aspects = rows[1]
    bad_counts = rows[2]
    # extremes by column, so that rows vectorise
    for j in range(nj):
        sines[j] = np.inf
        aspects[j] = 0.0
        bad_counts[j] = 0.0
    # areas, sine and aspect of the cells of a row
    for i in range(ni):
        x0 = nodes[0, i]
        y0 = nodes[1, i]
        x1 = nodes[0, i + 1]
        y1 = nodes[1, i + 1]
        for j in range(nj):
            edges = take_edges(x0, y0, x1, y1, j)
            area_1, area_2, area_3, area_4 = find_areas(*edges)
            sine, along, across, _ = measure_cell(*edges)
            longer = along if along > across else across
            shorter = across if along > across else along
            aspect = longer / shorter
            is_convex = (area_1 > 0.0) & (area_2 > 0.0) & (area_3 > 0.0) & (area_4 > 0.0)
            sines[j] = sine if sine < sines[j] else sines[j]
            aspects[j] = aspect if aspect > aspects[j] else aspects[j]
            bad_counts[j] += 0.0 if is_convex else 1.0
    # extremes of all columns
    sine = sines[0]
    aspect = aspects[0]
    count = 0.0
    for j in range(nj):
        sine = sines[j] if sines[j] < sine else sine
        aspect = aspects[j] if aspects[j] > aspect else aspect
        count += bad_counts[j]
    return sine, aspect, int(count)


def _make_scratch(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`rows`, `worst` and `bad_cells` of `measure_rows`."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    return np.empty((4, nj)), np.empty((4, ni)), np.empty(ni, dtype=np.int64)


def measure_worst(nodes: np.ndarray) -> tuple[float, float, int, int]:
    """Least scaled Jacobian, worst aspect ratio, bad cells and triangles, for every time step.

    The same numbers as in `measure_quality`, without the places.
    """
    sine, aspect, bad_cells = reduce_worst(nodes, np.empty((3, nodes.shape[2] - 1)))
    if bad_cells or count_triangles(nodes):
        quality = measure_quality(nodes)
        return (
            quality.least_scaled_jacobian,
            quality.worst_aspect_ratio,
            quality.bad_cells,
            quality.triangles,
        )
    return math.copysign(math.sqrt(abs(sine)), sine), math.sqrt(aspect), 0, 0


def compute_first_line_gaps(nodes: np.ndarray, side: str = "i_min") -> np.ndarray:
    """First grid line's distance from `side`, node by node, over that of the quasi-1D grid.

    With the block turned so that the side is i = 0:
    `|r[1,j] - r[0,j]| / (t[1,j] |r[N,j] - r[0,j]|)` for inner j, t the arc-length law interpolated
    between j = 0 and j = M (theory R1.6).
    """
    if side not in SIDE_NAMES:
        raise BadInput(
            f"first line gap: no side is called '{side}'; sides are {', '.join(SIDE_NAMES)}"
        )
    turned = nodes if side[0] == "i" else nodes.transpose(0, 2, 1)
    turned = turned[:, ::-1] if side.endswith("max") else turned
    low_part, high_part = (
        np.hypot(*(line[:, 1] - line[:, 0])) / np.hypot(*np.diff(line, axis=1)).sum()
        for line in (turned[:, :, 0], turned[:, :, -1])
    )
    part_j = np.linspace(0.0, 1.0, turned.shape[2])[1:-1]
    first_distance = np.hypot(*(turned[:, 1] - turned[:, 0]))[1:-1]
    side_distance = np.hypot(*(turned[:, -1] - turned[:, 0]))[1:-1]
    return first_distance / (((1.0 - part_j) * low_part + part_j * high_part) * side_distance)


def measure_first_line_gap(nodes: np.ndarray, side: str = "i_min") -> float:
    """Largest of `compute_first_line_gaps`: how far the grid lags behind a side (1 is quasi-1D)."""
    return float(compute_first_line_gaps(nodes, side).max())


def _checked(nodes: np.ndarray) -> np.ndarray:
    """The nodes of a grid as C-contiguous float64; BadInput for another shape."""
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    if nodes.ndim != 3 or nodes.shape[0] != 2 or min(nodes.shape[1:]) < 2:
        raise BadInput(f"grid: nodes must have shape (2, ni+1, nj+1), got {nodes.shape}")
    return nodes


def compute_best_sines(boundary: np.ndarray) -> tuple[np.ndarray, list[tuple[str, int]]]:
    """Largest possible corner sines (n,) at the boundary's nodes, and each one's side and index.

    `boundary` (2, ni+1, nj+1) is read on its sides only; either orientation.  Negative where the
    boundary itself turns a block's corner over.
    """
    line, positions = walk_boundary(boundary)
    to_next = np.roll(line, -1, axis=1) - line
    to_last = np.roll(line, 1, axis=1) - line
    area = 0.5 * (line[0] * np.roll(line[1], -1) - line[1] * np.roll(line[0], -1)).sum()
    first, second = (to_next, to_last) if area > 0.0 else (to_last, to_next)
    cross = first[0] * second[1] - first[1] * second[0]
    angle = np.arctan2(cross, (first * second).sum(axis=0)) % (2.0 * np.pi)
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    ends = {"i_min": nj, "i_max": nj, "j_min": ni, "j_max": ni}
    corner = np.array([node in (0, ends[side]) for side, node in positions])
    return np.sin(np.where(corner, angle, 0.5 * angle)), positions


def find_best_sine(boundary: np.ndarray) -> tuple[float, str, int]:
    """The least of `compute_best_sines`, with its side and node."""
    sines, positions = compute_best_sines(boundary)
    worst = int(sines.argmin())
    return float(sines[worst]), *positions[worst]


def measure_turns(line: np.ndarray) -> np.ndarray:
    """Turns (n - 2,) [rad] from segment to segment of a polyline (2, n), positive to the left."""
    steps = line[:, 1:] - line[:, :-1]
    ax, ay = steps[:, :-1]
    bx, by = steps[:, 1:]
    return np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
