"""Checks and conversion of what a regridder takes; why no grid was found, by side and node.

Lists, whole numbers, single precision, any order in memory, views and read-only arrays: all become
C-contiguous float64.  A block far smaller or larger than any body, or so far from the origin that
its coordinates do not distinguish its nodes, is refused.  Arrays that need nothing cost two
microseconds, as this runs in front of every regrid.  `explain_failure` is called only after a
regrid failed, so that good boundaries pay nothing for it.

Proofs that no grid of convex cells exists on a boundary (`find_impossible`, theory R5.5): each
inner node has a convex region that it cannot leave, at first a box round the boundary.  The
corner triangles of a cell with two nodes given cut it by half planes; those with two or three
inner nodes cut it by what the others' regions allow.  Where a region gets empty there is no grid,
whatever method looks for it.  Cuts are loosened by far more than rounding.  Note: the reverse does
not hold; a boundary without a proof may have no grid either.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.corners import BLOCK_CORNERS, TRIANGLES
from shockgrid.regrid.measure.crossings import BoundaryCheck, find_crossing, walk_boundary
from shockgrid.regrid.measure.cuts import Cuts
from shockgrid.regrid.measure.quality import compute_corner_areas
from shockgrid.regrid.sides import compute_area, get_sides

FLOAT64 = np.dtype(np.float64)
# of a block, in m: squares of its areas are still numbers
LEAST_SIZE = 1e-150
MOST_SIZE = 1e150
# sizes of the block from the origin up to which nothing has to be looked at
MOST_SIZES_FROM_ORIGIN = 1e9
MOST_COORDINATE_ROUNDING = 0.01  # of a mean cell: the most that coordinates may be rounded to
EVERYDAY = 1e-40, 1e40  # sizes whose tenth powers need no unit of their own


def name_cells(cells: np.ndarray, most: int = 4) -> str:
    """`(3, 4), (3, 5) and 7 more`."""
    named = ", ".join("(" + ", ".join(str(int(k)) for k in cell) + ")" for cell in cells[:most])
    return named + (f" and {len(cells) - most} more" if len(cells) > most else "")


def convert_grids(previous, boundary) -> tuple[np.ndarray, np.ndarray]:
    """Both as C-contiguous float64 of shape (2, ni+1, nj+1), in m; themselves where they are.

    Raises BadInput for what is no array of real numbers, for shapes that do not fit, for blocks
    outside LEAST_SIZE to MOST_SIZE, and for those too far from the origin.
    """
    previous = convert_nodes(previous, "previous")
    boundary = convert_nodes(boundary, "boundary")
    if previous.shape != boundary.shape:
        raise BadInput(
            f"regrid: previous has shape {previous.shape}, boundary {boundary.shape}; "
            "they must agree"
        )
    if not are_ordinary(previous, boundary):
        _check_size(previous, "previous")
        _check_size(boundary, "boundary")
    return previous, boundary


def convert_nodes(nodes, name: str, axes: str = "ij") -> np.ndarray:
    """A grid as C-contiguous float64; BadInput, with its `name`, for what is none of these axes."""
    nodes = convert_numbers(nodes, name)
    shape = nodes.shape
    dimensions = len(axes)
    if len(shape) != dimensions + 1 or shape[0] != dimensions or min(shape) < 2:
        wanted = ", ".join([str(dimensions), *(f"n{axis}+1" for axis in axes)])
        cells = ", ".join(f"n{axis}" for axis in axes)
        raise BadInput(f"regrid: {name} has shape {shape}; it must be ({wanted}), {cells} >= 1")
    return nodes


def convert_numbers(values, name: str) -> np.ndarray:
    """`values` as C-contiguous float64 of any shape; BadInput for what is no real numbers."""
    if type(values) is np.ndarray and values.dtype == FLOAT64 and values.flags.carray:
        return values
    if np.ma.is_masked(values):
        raise BadInput(f"regrid: {name} has masked values; give a number for every node")
    try:
        array = np.asarray(values)
    except ValueError:
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "iuf":
        kind = type(values).__name__ if array.dtype.kind == "O" else array.dtype.name
        raise BadInput(f"regrid: {name} must be an array of real numbers, not {kind}")
    return np.array(array, dtype=FLOAT64, order="C")


def find_unit(nodes: np.ndarray) -> float:
    """The power of two to divide `nodes` (2, ni+1, nj+1) by before tenth powers of lengths.

    1 for everyday sizes; in other units a block has the same bits, but for the exponent.
    """
    return choose_unit(measure_corners_span(nodes))


def choose_unit(size: float) -> float:
    """The same for a block of this size, in m."""
    if EVERYDAY[0] < size < EVERYDAY[1] or not 0.0 < size < math.inf:
        return 1.0
    return 2.0 ** math.frexp(size)[1]


@kernel
def measure_corners_span(nodes):
    """The longest distance, along x or y, from the first corner of `nodes` to the others, in m."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    size = 0.0
    for k in range(2):
        for i, j in ((ni, 0), (0, nj), (ni, nj)):
            size = max(size, abs(nodes[k, i, j] - nodes[k, 0, 0]))
    return size


@kernel
def are_ordinary(previous, boundary):
    """Whether both grids (2, ni+1, nj+1), by their corners, have a usual size and place."""
    for nodes in (previous, boundary):
        size = measure_corners_span(nodes)
        distance = abs(nodes[0, 0, 0]) + abs(nodes[1, 0, 0])
        if not (
            LEAST_SIZE < size and size < MOST_SIZE and distance < MOST_SIZES_FROM_ORIGIN * size
        ):
            return False
    return True


def _check_size(nodes: np.ndarray, name: str) -> None:
    """Refuse what is no block's size or place; the corners alone could not tell."""
    check_size(np.concatenate(get_sides(nodes), axis=1), max(nodes.shape[1:]), name)


def check_size(sides: np.ndarray, count: int, name: str) -> None:
    """BadInput for the size or place of a block by the nodes (2 or 3, n) of its sides.

    `count`: of the most nodes along one of them; `name`: of the grid, for the message.
    """
    if not np.isfinite(sides).all():
        return  # named by whoever explains failures
    with np.errstate(over="ignore"):
        size = float(np.ptp(sides, axis=1).max())
    if size > 0.0 and not LEAST_SIZE < size < MOST_SIZE:
        raise BadInput(
            f"regrid: the block of {name} is {size:.3g} m across; sizes between {LEAST_SIZE:g} and "
            f"{MOST_SIZE:g} m can be regridded: choose another unit of length"
        )
    cell = size / count
    if size > 0.0 and np.spacing(np.abs(sides).max()) > MOST_COORDINATE_ROUNDING * cell:
        raise BadInput(
            f"regrid: the block of {name} lies {np.abs(sides).max() / cell:.1g} of its cells away "
            "from the origin, and its coordinates have no digits left for its cells: give them "
            "relative to one of its nodes"
        )


LOOSENED_CUT = 1e-10  # of the boundary's size: how far cuts are loosened
NEIGHBOUR_CUT_ROUNDS = 3  # of cuts by neighbours' regions
MOST_CELLS = 1600  # larger blocks are cut by their sides only
MOST_VERTICES = 14  # regions with more, or with pairs of them that are more, cut no other

Point = tuple[float, float]


def find_impossible(boundary: np.ndarray) -> tuple[int, int] | None:
    """An inner node (i, j), or a corner of the block, that has no place in any grid; or None.

    `boundary` (2, ni+1, nj+1) is read on its sides only; the block's own corner triangles are left
    out.  Either way round.  A corner (i, j) on the boundary is named where a cell of a block one
    cell wide folds.
    """
    # turned counter-clockwise, in units of the block
    nodes = boundary if compute_area(boundary) >= 0.0 else boundary[::-1]
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    sides = np.concatenate(get_sides(nodes), axis=1)
    centre = 0.5 * (sides.max(axis=1) + sides.min(axis=1))
    size = float(np.ptp(sides, axis=1).max())
    if not (np.isfinite(size) and size > 0.0):
        return None
    # where each node may lie: its place on the sides, the whole box inside
    regions: dict[tuple[int, int], list[Point]] = {}
    box = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
    for i in range(ni + 1):
        for j in range(nj + 1):
            if i in (0, ni) or j in (0, nj):
                x, y = (nodes[:, i, j] - centre) / size
                regions[i, j] = [(float(x), float(y))]
            else:
                regions[i, j] = box
    triangles = list(_list_triangles(ni, nj))
    fixed = [tuple(len(regions[node]) == 1 for node in triangle) for triangle in triangles]
    # triangles with two nodes given cut the third one's region
    for triangle, is_fixed in zip(triangles, fixed, strict=True):
        if all(is_fixed):
            if _double_area(*(regions[node][0] for node in triangle)) <= -LOOSENED_CUT:
                return triangle[0]
        elif sum(is_fixed) == 2 and not _cut(regions, triangle, is_fixed.index(False)):
            return triangle[is_fixed.index(False)]
    if ni * nj > MOST_CELLS:
        return None
    # then each region by those of its neighbours, until none shrinks
    for _ in range(NEIGHBOUR_CUT_ROUNDS):
        has_changed = False
        for triangle, is_fixed in zip(triangles, fixed, strict=True):
            if sum(is_fixed) > 1:
                continue
            for free in range(3):
                if is_fixed[free]:
                    continue
                region = regions[triangle[free]]
                if not _cut(regions, triangle, free):
                    return triangle[free]
                has_changed = has_changed or regions[triangle[free]] is not region
        if not has_changed:
            break
    return None


def _list_triangles(ni: int, nj: int):
    """Corner triangles but for the block's own, anticlockwise, as three nodes (i, j)."""
    block_corners = {(corner, i % ni, j % nj) for corner, i, j in BLOCK_CORNERS}
    for i in range(ni):
        for j in range(nj):
            for corner, triangle in enumerate(TRIANGLES):
                if (corner, i, j) not in block_corners:
                    yield tuple((i + a, j + b) for a, b in triangle)


def _double_area(a: Point, b: Point, c: Point) -> float:
    """Twice the signed area of a triangle, positive if a, b, c go anticlockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _cut(regions, triangle, free: int) -> bool:
    """Cut one node's region by what those of the others allow; False where nothing is left."""
    p, q, r = (triangle[(free + k) % 3] for k in range(3))
    region = regions[p]
    second = regions[q]
    third = regions[r]
    if len(region) > MOST_VERTICES or len(second) * len(third) > MOST_VERTICES:
        return True
    # All of it is allowed as soon as one place of the others allows all of its vertices.
    allowed: list[Point] = []
    for b in second:
        for c in third:
            clipped = _clip(region, b, c)
            if clipped is region:
                return True
            allowed += clipped
    if not allowed:
        return False
    is_convex = len(second) * len(third) == 1
    regions[p] = allowed if is_convex else _hull(allowed)
    return True


def _clip(polygon: list[Point], b: Point, c: Point) -> list[Point]:
    """The part of a convex polygon to the left of b -> c, loosened; the same list if all of it."""
    areas = [_double_area(b, c, point) + LOOSENED_CUT for point in polygon]
    if min(areas) >= 0.0:
        return polygon
    clipped = []
    for k, (point, area) in enumerate(zip(polygon, areas, strict=True)):
        last_area = areas[k - 1]
        (last_x, last_y), (x, y) = polygon[k - 1], point
        if (last_area < 0.0) != (area < 0.0):
            fraction = last_area / (last_area - area)
            clipped.append((last_x + fraction * (x - last_x), last_y + fraction * (y - last_y)))
        if area >= 0.0:
            clipped.append(point)
    return clipped


def _hull(points: list[Point]) -> list[Point]:
    """The convex hull of points, anticlockwise."""
    points = sorted(set(points))
    if len(points) < 3:
        return points
    chains = []
    for ordered in (points, points[::-1]):
        chain: list[Point] = []
        for point in ordered:
            while len(chain) > 1 and _double_area(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return chains[0] + chains[1]


def explain_failure(
    boundary: np.ndarray,
    trial: np.ndarray | None = None,
    transposed: bool = False,
    too_sharp: bool = False,
    also: str = "",
    grid: np.ndarray | None = None,
    previous: np.ndarray | None = None,
    cuts: Cuts = (),
) -> RegridFailure:
    """The failure to be raised: which side, which of its nodes, and what is wrong with them.

    `boundary` (2, ni+1, nj+1) is read on its sides; `trial`, of that shape or transposed, is the
    grid that came closest, in the frame of a workspace; `too_sharp` says that it is valid, with a
    corner too sharp for the equations to be solved.  `also` ends the sentence, `grid` is what the
    failure shows, `previous` the grid before, if its orientation is to be compared; `cuts` as
    `find_crossing` takes them.
    """
    fault = _find_fault(boundary, trial, transposed, too_sharp, previous, cuts)
    return RegridFailure(
        f"{fault.sentence}; {also}" if also else fault.sentence,
        side=fault.side,
        nodes=fault.nodes,
        grid=grid,
        cell=fault.cell,
        cause=fault.cause,
    )


class _Fault(NamedTuple):
    """Id of the cause, what is wrong, the side, its nodes, the cell where one is to blame."""

    cause: str
    sentence: str
    side: str
    nodes: tuple[int, ...]
    cell: tuple[int, int] | None = None


def _find_fault(
    boundary, trial, transposed: bool, too_sharp: bool, previous=None, cuts: Cuts = ()
) -> _Fault:
    """What is wrong with sides that have no grid; what they show themselves comes first."""
    fault = _find_side_fault(boundary, cuts)
    if fault is not None:
        return fault
    if previous is not None and compute_area(previous) * compute_area(boundary) <= 0.0:
        turned = (
            "the boundary has the opposite orientation to the previous grid; "
            "give its sides in the same order and direction"
        )
        return _Fault("no-grid", turned, "i_min", (0, boundary.shape[2] - 1))
    # sides in which no grid exists
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    place = find_impossible(boundary)
    if place is not None:
        side, node = _find_nearest_side(*place, ni, nj)
        impossible = (
            f"no valid grid exists: the sides leave no place for node ({place[0]}, {place[1]}) "
            "in convex cells"
        )
        return _Fault("no-grid", impossible, side, (node,))
    return _find_trial_fault(boundary, trial, transposed, too_sharp)


def _find_side_fault(boundary, cuts: Cuts) -> _Fault | None:
    """What the sides themselves show: nodes that are not finite, crossings, nodes in one point."""
    line, positions = walk_boundary(boundary)
    not_finite = np.flatnonzero(~np.isfinite(line).all(axis=0))
    if not_finite.size:
        side, node = positions[not_finite[0]]
        return _Fault("not-finite", "not a finite number", side, (node,))
    # sides that cross or touch
    crossing = find_crossing(boundary, cuts)
    if crossing is not None:
        common = _find_common_node(boundary, crossing)
        (side, node), (other_side, other_node) = common or crossing
        if common and side == other_side:
            return _Fault("lines-cross", "they are the same point", side, (node, other_node))
        if common:
            same_point = f"it is the same point as node {other_node} of side {other_side}"
            return _Fault("lines-cross", same_point, side, (node,))
        if side == other_side:
            return _Fault("lines-cross", "polyline crosses itself", side, (node, other_node))
        crosses = f"crosses side {other_side} at node {other_node}"
        return _Fault("lines-cross", crosses, side, (node,))
    # neighbours in one point
    doubled_nodes = np.flatnonzero((line == np.roll(line, -1, axis=1)).all(axis=0))
    if doubled_nodes.size:
        side, node = positions[doubled_nodes[0]]
        doubled = (
            "the node and its neighbour on the boundary are the same point; a side may shrink to a "
            "point only as a whole"
        )
        return _Fault("no-grid", doubled, side, (node,))
    return None


def _find_trial_fault(boundary, trial, transposed: bool, too_sharp: bool) -> _Fault:
    """Where a grid may exist, but none was found: where the trial fails, or edges are shortest."""
    if trial is None or not np.isfinite(trial).all():
        line, positions = walk_boundary(boundary)
        step = np.hypot(*(np.roll(line, -1, axis=1) - line))
        shortest = int(np.argmin(np.minimum(step, np.roll(step, 1))))
        side, node = positions[shortest]
        return _Fault("no-grid", "no valid grid was found near it", side, (node,))
    i, j = _worst_cell(trial)
    i, j = (j, i) if transposed else (i, j)
    side, node = _find_nearest_side(i, j, boundary.shape[1] - 2, boundary.shape[2] - 2)
    if too_sharp:
        too_flat = (
            f"no grid was found near them: cell ({i}, {j}) is too flat for its equations to be "
            "solved; repair the grid there first"
        )
        return _Fault("flat-cell", too_flat, side, (node, node + 1), (i, j))
    folded = (
        f"no valid grid was found near them, cell ({i}, {j}) folds; the boundary moved too far "
        "or turns too sharply there"
    )
    return _Fault("no-grid", folded, side, (node, node + 1), (i, j))


def _find_nearest_side(i: int, j: int, last_i: int, last_j: int) -> tuple[str, int]:
    """The side nearest to a node or cell by count, and its index there."""
    return min(
        ((i, "i_min", j), (last_i - i, "i_max", j), (j, "j_min", i), (last_j - j, "j_max", i))
    )[1:]


def _find_common_node(boundary, crossing):
    """The two nodes in one point, as (side, node), of two edges that touch there, or None."""
    line, positions = walk_boundary(boundary)
    first, second = (positions.index(start) for start in crossing)
    for p in (first, (first + 1) % len(positions)):
        for q in (second, (second + 1) % len(positions)):
            if p != q and (line[:, p] == line[:, q]).all():
                return positions[p], positions[q]
    return None


def _worst_cell(nodes: np.ndarray) -> tuple[int, int]:
    """Indices of the cell with the least corner area."""
    least = compute_corner_areas(nodes).min(axis=0)
    return tuple(int(k) for k in np.unravel_index(np.argmin(least), least.shape))


def check_grids(previous: np.ndarray, boundary: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both as `convert_grids` makes them.

    BadInput for what is no grid, RegridFailure for sides that are not finite or cross.
    """
    previous, boundary = convert_grids(previous, boundary)
    if not np.isfinite(previous).all():
        raise BadInput("regrid: the previous grid has nodes that are not finite numbers")
    if not all(np.isfinite(side).all() for side in get_sides(boundary)):
        raise explain_failure(boundary)
    check_simple(boundary)
    return previous, boundary


def check_simple(boundary: np.ndarray) -> None:
    """RegridFailure where the boundary of a grid (2, ni+1, nj+1) crosses or touches itself.

    For families that let neighbours on a side be one point, as the barrier does not.
    """
    check = BoundaryCheck(boundary.shape[1] - 1, boundary.shape[2] - 1)
    if not check.is_simple(boundary) and find_crossing(boundary) is not None:
        raise explain_failure(boundary)
