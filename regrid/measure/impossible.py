"""Proofs that no grid of convex cells exists on a boundary (theory R5.6).

Each inner node has a convex region that it cannot leave: at first a box round the boundary.  The
corner triangles of a cell with two nodes given cut it by half planes; those with two or three
inner nodes cut it by what the others' regions allow.  Where a region gets empty there is no grid,
whatever method looks for it.

Cuts are loosened by far more than rounding, so that an empty region is empty.  The trap: the
reverse does not hold; a boundary without a proof may have no grid either.
"""

from __future__ import annotations

import numpy as np

from regrid.measure.predicates import BLOCK_CORNERS, TRIANGLES
from regrid.sides import compute_area, get_sides

LOOSE = 1e-10  # of the boundary's size: how far cuts are loosened
ROUNDS = 3  # of cuts by neighbours' regions
MOST_CELLS = 1600  # larger blocks are cut by their sides only
MOST_VERTICES = 14  # regions with more, or with pairs of them that are more, cut no other

Point = tuple[float, float]


def find_impossible(boundary: np.ndarray) -> tuple[int, int] | None:
    """An inner node (i, j), or a corner of the block, that has no place in any grid; or None.

    `boundary` (2, ni+1, nj+1) is read on its sides only; the block's own corner triangles are left
    out.  Either way round.  A corner (i, j) on the boundary is named where a cell of a block one
    cell wide folds.
    """
    nodes = boundary if compute_area(boundary) >= 0.0 else boundary[::-1]
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    sides = np.concatenate(get_sides(nodes), axis=1)
    centre = 0.5 * (sides.max(axis=1) + sides.min(axis=1))
    size = float(np.ptp(sides, axis=1).max())
    if not (np.isfinite(size) and size > 0.0):
        return None
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
    given = [tuple(len(regions[node]) == 1 for node in triangle) for triangle in triangles]
    for triangle, known in zip(triangles, given, strict=True):
        if all(known):
            if _double_area(*(regions[node][0] for node in triangle)) <= -LOOSE:
                return triangle[0]
        elif sum(known) == 2 and not _cut(regions, triangle, known.index(False)):
            return triangle[known.index(False)]
    if ni * nj > MOST_CELLS:
        return None
    for _ in range(ROUNDS):
        changed = False
        for triangle, known in zip(triangles, given, strict=True):
            if sum(known) > 1:
                continue
            for free in range(3):
                if known[free]:
                    continue
                before = regions[triangle[free]]
                if not _cut(regions, triangle, free):
                    return triangle[free]
                changed = changed or regions[triangle[free]] is not before
        if not changed:
            break
    return None


def _list_triangles(ni: int, nj: int):
    """Corner triangles but for the block's own, anticlockwise, as three nodes (i, j)."""
    own = {(corner, i % ni, j % nj) for corner, i, j in BLOCK_CORNERS}
    for i in range(ni):
        for j in range(nj):
            for corner, triangle in enumerate(TRIANGLES):
                if (corner, i, j) not in own:
                    yield tuple((i + a, j + b) for a, b in triangle)


def _double_area(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _cut(regions, triangle, free: int) -> bool:
    """Cut one node's region by what those of the others allow; False where nothing is left."""
    p, q, r = (triangle[(free + k) % 3] for k in range(3))
    here, second, third = regions[p], regions[q], regions[r]
    if len(here) > MOST_VERTICES or len(second) * len(third) > MOST_VERTICES:
        return True
    # All of it is allowed as soon as one place of the others allows all of its vertices.
    kept: list[Point] = []
    for b in second:
        for c in third:
            part = _clip(here, b, c)
            if part is here:
                return True
            kept += part
    if not kept:
        return False
    one = len(second) * len(third) == 1
    regions[p] = kept if one else _hull(kept)
    return True


def _clip(polygon: list[Point], b: Point, c: Point) -> list[Point]:
    """The part of a convex polygon to the left of b -> c, loosened; the same list if all of it."""
    areas = [_double_area(b, c, point) + LOOSE for point in polygon]
    if min(areas) >= 0.0:
        return polygon
    part = []
    for k, (point, area) in enumerate(zip(polygon, areas, strict=True)):
        before, last = areas[k - 1], polygon[k - 1]
        if (before < 0.0) != (area < 0.0):
            t = before / (before - area)
            part.append((last[0] + t * (point[0] - last[0]), last[1] + t * (point[1] - last[1])))
        if area >= 0.0:
            part.append(point)
    return part


def _hull(points: list[Point]) -> list[Point]:
    """Their convex hull, anticlockwise."""
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
