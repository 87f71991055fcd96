"""Limits on node speeds: no inner node should outrun the boundary (a maximum principle).

A ratio well above 1 means that the regridder moves inner nodes back and forth, which shortens time
steps and smears the flow.  The limited grid is a mixture of two grids node by node, so its
convexity must be checked again; where the mixture fails, the limit is relaxed.

Source: [ProkopovND] §6; theory R8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shockgrid.regrid.algebraic import fill_displacement
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import compute_doubled_area, find_triangle
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.symmetry import find_symmetry
from shockgrid.regrid.work_arrays import share_memory

MOST_CELL_HALVINGS = 8
MOST_RETURN_ROUNDS = 24  # at most, in which nodes of folded cells return to the new grid
MOST_BLENDS = 12  # halvings of the distance to the new grid for all nodes if folds persist
# factor of the limit for nodes of cells that would otherwise be sharpened
LOOSENED_LIMIT_FACTOR = 2.0
ROUND_OFF_AREA = 1e-12  # relative, well above that of an area or a comparison
FLAT_CORNER_SINE = 0.01  # sine of an obtuse corner below which it is nearly a straight line
# fraction of the smaller of a corner's areas, old and new, left by the limit
KEPT_AREA_FRACTION = 0.98


@kernel
def find_fast_rows(old, new, interpolated, most, first, last):
    """Find whole rows of nodes with a node that `fill_limited` may limit; returns their number.

    `first`, `last` (ni + 1) receive the inner nodes of such a row, ni > first > last elsewhere.
    The comparison is that of `fill_limited` without divisions, slightly stricter.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    part = (1.0 - ROUND_OFF_AREA) * most * most
    rows = 0
    for i in range(ni + 1):
        first[i] = nj
        last[i] = 0
    for i in range(1, ni):
        x0 = old[0, i - 1]
        y0 = old[1, i - 1]
        x = old[0, i]
        y = old[1, i]
        x1, y1 = old[0, i + 1], old[1, i + 1]
        new_x = new[0, i]
        new_y = new[1, i]
        way_x = interpolated[0, i]
        way_y = interpolated[1, i]
        fast = 0
        for j in range(1, nj):
            # motion of the node beside the interpolated one
            excess_x, excess_y = (new_x[j] - x[j]) - way_x[j], (new_y[j] - y[j]) - way_y[j]
            square = excess_x * excess_x + excess_y * excess_y
            # edges of the four old triangles at the node, their squares and areas
            ax = x1[j] - x[j]
            ay = y1[j] - y[j]
            bx = x[j + 1] - x[j]
            by = y[j + 1] - y[j]
            cx = x0[j] - x[j]
            cy = y0[j] - y[j]
            dx = x[j - 1] - x[j]
            dy = y[j - 1] - y[j]
            a = ax * ax + ay * ay
            b = bx * bx + by * by
            c = cx * cx + cy * cy
            d = dx * dx + dy * dy
            p = ax * by - ay * bx
            q = bx * cy - by * cx
            r = cx * dy - cy * dx
            s = dx * ay - dy * ax
            # farther than `most` heights of any of them (R8.2)?
            beyond = square * (a if a > b else b) > part * (p * p)
            beyond |= square * (b if b > c else c) > part * (q * q)
            beyond |= square * (c if c > d else d) > part * (r * r)
            beyond |= square * (d if d > a else a) > part * (s * s)
            fast += 1 if beyond else 0
        # then all inner nodes of the row are looked at again
        if fast > 0:
            first[i] = 1
            last[i] = nj - 1
            rows += 1
    return rows


@inlined
def measure_spacing(area, along, a, b, wide):
    """Square of a corner's height over its longer edge; a, b: squares of the edges.

    area, along: cross and scalar product of the edges.  wide: of an almost straight corner the
    shorter edge, since a cell with a flat corner need not be thin.
    """
    if wide and along < 0.0 and area * area < FLAT_CORNER_SINE * FLAT_CORNER_SINE * a * b:
        return min(a, b)
    return area * area / max(a, b)


@kernel
def fill_limited(old, new, interpolated, most, first, last, wide, out):
    """Nodes of `new`, each at most `most` local spacings from its interpolated position.

    old, new, interpolated (displacements), out: (2, ni + 1, nj + 1), in m.  The local spacing is
    the least height of the four old corner triangles at the node over their longer edges: in a
    sheared sliver this is the thickness, whereas the shortest edge would allow a node to cross many
    cells. wide: see `measure_spacing`.  Only nodes from `first` to `last` (ni + 1) of a row are
    examined, and both are narrowed to the limited nodes.  Returns the number of these.  Theory
    R8.2.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    x, y = old[0], old[1]
    limited = 0
    out[:] = new
    for i in range(1, ni):
        begin = first[i]
        end = last[i]
        first[i] = nj
        last[i] = 0
        for j in range(begin, end + 1):
            # motion of the node beside the interpolated one
            excess_x = (new[0, i, j] - x[i, j]) - interpolated[0, i, j]
            excess_y = (new[1, i, j] - y[i, j]) - interpolated[1, i, j]
            square = excess_x * excess_x + excess_y * excess_y
            # heights of the four old triangles at the node
            ax, ay = x[i + 1, j] - x[i, j], y[i + 1, j] - y[i, j]
            bx, by = x[i, j + 1] - x[i, j], y[i, j + 1] - y[i, j]
            cx, cy = x[i - 1, j] - x[i, j], y[i - 1, j] - y[i, j]
            dx, dy = x[i, j - 1] - x[i, j], y[i, j - 1] - y[i, j]
            a = ax * ax + ay * ay
            b = bx * bx + by * by
            c = cx * cx + cy * cy
            d = dx * dx + dy * dy
            limit = measure_spacing(ax * by - ay * bx, ax * bx + ay * by, a, b, wide)
            limit = min(limit, measure_spacing(bx * cy - by * cx, bx * cx + by * cy, b, c, wide))
            limit = min(limit, measure_spacing(cx * dy - cy * dx, cx * dx + cy * dy, c, d, wide))
            limit = min(limit, measure_spacing(dx * ay - dy * ax, dx * ax + dy * ay, d, a, wide))
            limit *= most * most
            # taken back to the limit
            if square > limit:
                keep = (limit / square) ** 0.5
                out[0, i, j] = x[i, j] + interpolated[0, i, j] + keep * excess_x
                out[1, i, j] = y[i, j] + interpolated[1, i, j] + keep * excess_y
                limited += 1
                first[i] = min(first[i], j)
                last[i] = j
    return limited


@inlined
def mark_cell(loose, i, j):
    """Mark the four nodes of a cell."""
    loose[i, j] = loose[i + 1, j] = loose[i, j + 1] = loose[i + 1, j + 1] = 1


@inlined
def move_marked(limited, new, first, last, loose, part):
    """Move marked nodes by a fraction of the distance from `limited` to `new`."""
    for i in range(1, limited.shape[1] - 1):
        for j in range(first[i], last[i] + 1):
            if loose[i, j] > 0:
                for k in range(2):
                    limited[k, i, j] += part * (new[k, i, j] - limited[k, i, j])


@kernel
def relax_sharpened(old, new, limited, first, last, loose):
    """Move nodes of cells that the limit sharpens halfway from `limited` to `new`.

    These cells have a corner triangle of less area in `limited` than KEPT of that in either other
    grid, all (2, ni + 1, nj + 1), except the block's own corners, which no inner node changes.
    Only nodes from `first` to `last` of a row may differ from `new`, which is convex: no other
    cells are examined.  `loose` (ni + 1, nj + 1) is scratch.  Returns the number of such cells.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    count = 0
    loose[:] = 0
    for i in range(ni):
        for j in range(min(first[i], first[i + 1]) - 1, min(max(last[i], last[i + 1]) + 1, nj)):
            sharpened = False
            for corner in range(4):
                p, q, _, _ = find_triangle(i, j, corner)
                if (p == 0 or p == ni) and (q == 0 or q == nj):
                    continue
                before = compute_doubled_area(old, i, j, corner)
                after = compute_doubled_area(new, i, j, corner)
                area = compute_doubled_area(limited, i, j, corner)
                sharpened |= not (area >= KEPT_AREA_FRACTION * min(before, after))
            if sharpened:
                count += 1
                mark_cell(loose, i, j)
    move_marked(limited, new, first, last, loose, 0.5)
    return count


@kernel
def release_folded(new, limited, first, last, whole, loose):
    """Move nodes of cells that the limit folds halfway from `limited` to `new`.

    A corner is folded if it is not positive beyond round-off, except the block's own corners, which
    no inner node changes.  Only nodes from `first` to `last` (ni + 1) of a row may differ from
    `new`.  whole: all the way.  `loose` (ni + 1, nj + 1) is scratch.  Returns the number of such
    cells.
    """
    ni, nj = new.shape[1] - 1, new.shape[2] - 1
    x, y = limited[0], limited[1]
    part = 1.0 if whole else 0.5
    count = 0
    loose[:] = 0
    for i in range(ni):
        for j in range(min(first[i], first[i + 1]) - 1, min(max(last[i], last[i + 1]) + 1, nj)):
            folded = False
            for corner in range(4):
                p, q, far_i, far_j = find_triangle(i, j, corner)
                if (p == 0 or p == ni) and (q == 0 or q == nj):
                    continue
                ax, ay = x[far_i, q] - x[p, q], y[far_i, q] - y[p, q]
                bx, by = x[p, far_j] - x[p, q], y[p, far_j] - y[p, q]
                squares = (ax * ax + ay * ay) + (bx * bx + by * by)
                folded |= not (
                    compute_doubled_area(limited, i, j, corner) > ROUND_OFF_AREA * squares
                )
            if folded:
                count += 1
                mark_cell(loose, i, j)
    move_marked(limited, new, first, last, loose, part)
    return count


class MotionLimiter:
    """Keeps a regridder from moving nodes through the fluid faster than the step allows.

    A regridder aims at its optimal grid, however far that is from the old one: the part of its
    motion not required by the boundary does not shrink with dt.  In one step it would remap many
    cells through one face, and the time step, which depends on the face speed, would collapse.
    With the limit, the grid approaches the optimum over the following steps.

    In a curled block the boundary motion, interpolated inward, shears cells thinner step by step,
    and the thinner they are, the less of the regridder's correction the limit allows.  So where the
    limit makes a corner sharper than in both grids, old and new, nodes may move
    LOOSENED_LIMIT_FACTOR times as far; without any limit, a regridder that oscillates at rest would
    shorten the time step indefinitely.
    """

    def __init__(self, shape: tuple[int, ...]):
        self.shape = shape
        self.loose = np.empty(shape[1:], dtype=np.int8)
        # the limited nodes of each row; those of `far` are a subset
        self.first, self.last = (np.empty(shape[1], dtype=np.int64) for _ in range(2))
        self.far_first, self.far_last = (np.empty(shape[1], dtype=np.int64) for _ in range(2))

    def limit(self, old: np.ndarray, new: np.ndarray, most: float) -> tuple[np.ndarray, int]:
        """`new` with inner nodes within `most` spacings of the interpolated grid, and how many were
        limited.

        `new` must be convex; the result is valid until the next regrid of this thread.

        Where the limit sharpens corners, nodes move towards LOOSENED_LIMIT_FACTOR times as many
        spacings, by halves; those of folded cells return to `new`.  If that keeps folding others,
        all nodes return by the same fraction to `new`, the least of halvings that leaves no fold.
        A symmetric block stays so.
        """
        limited, count = self._limit(old, new, most)
        symmetry = find_symmetry(old, new) if count > 0 else None
        if symmetry is not None:
            back = limited - new
            if symmetry.even_out(back):
                even = new + back
                if len(find_bad_cells(even)) == 0:
                    limited = even
        return limited, count

    def _limit(self, old: np.ndarray, new: np.ndarray, most: float) -> tuple[np.ndarray, int]:
        """`limit` without regard to symmetry."""
        # nodes that the limit of theory R8.2 holds
        first = self.first
        last = self.last
        whole = share_memory(3 * new.size)[: 3 * new.size]
        interpolated, held, far = whole.reshape(3, *self.shape)
        fill_displacement(old, new, interpolated)
        if find_fast_rows(old, new, interpolated, most, first, last) == 0:
            return new, 0
        count = fill_limited(old, new, interpolated, most, first, last, False, held)
        if count == 0:
            return new, 0
        # those that it sharpens may go to the looser limit, by halves
        self.far_first[:] = first
        self.far_last[:] = last
        far_first = self.far_first
        far_last = self.far_last
        fill_limited(
            old, new, interpolated, LOOSENED_LIMIT_FACTOR * most, far_first, far_last, True, far
        )
        for _ in range(MOST_CELL_HALVINGS):
            if relax_sharpened(old, far, held, first, last, self.loose) == 0:
                break
        # folded ones go back to `new`
        for halvings in range(MOST_RETURN_ROUNDS):
            whole = halvings >= MOST_CELL_HALVINGS
            if release_folded(new, held, first, last, whole, self.loose) == 0:
                return held, count
        if len(find_bad_cells(held)) == 0:
            return held, count
        find_fast_rows(old, new, interpolated, most, first, last)
        fill_limited(old, new, interpolated, most, first, last, False, held)
        for halvings in range(MOST_BLENDS, 0, -1):
            np.subtract(new, held, out=far)
            far *= 0.5**halvings
            far += held
            if len(find_bad_cells(far)) == 0:
                return far, count
        return new, 0


@dataclass(frozen=True)
class NodeSpeeds:
    """Largest speeds of the nodes inside and on the boundary, and their ratio.

    `ratio` is 0 if nothing moves and infinite if only inner nodes do; `fastest` is the inner node
    (i, j) with the largest speed.
    """

    inner: float
    boundary: float
    ratio: float
    fastest: tuple[int, int]


def measure_node_speeds(old: np.ndarray, new: np.ndarray, dt: float = 1.0) -> NodeSpeeds:
    """Speeds (new - old)/dt of two grids (2, ni+1, nj+1); needs inner nodes."""
    speed = np.hypot(*(new - old)) / dt
    inside = speed[1:-1, 1:-1]
    inner = float(inside.max()) if inside.size else 0.0
    sides = (speed[0], speed[-1], speed[:, 0], speed[:, -1])
    boundary = float(max(side.max() for side in sides))
    fastest = divmod(int(inside.argmax()), inside.shape[1]) if inside.size else (-1, -1)
    ratio = inner / boundary if boundary > 0.0 else (np.inf if inner > 0.0 else 0.0)
    return NodeSpeeds(inner, boundary, float(ratio), (fastest[0] + 1, fastest[1] + 1))


def limit_node_speeds(old: np.ndarray, new: np.ndarray, factor: float) -> np.ndarray:
    """The grid `new`, limited where inner nodes exceed `factor` times the fastest boundary node.

    Such a node moves from its position given by the interpolated boundary displacement towards that
    in `new` only as far as its displacement is within the limit.  `new` must be convex; the result
    is, too: the mixture is moved back to `new` by halves until every cell is convex.  Theory R8.1.
    """
    interpolated = np.empty_like(new)
    fill_displacement(np.ascontiguousarray(old), np.ascontiguousarray(new), interpolated)
    extra = (new - old) - interpolated
    limit = factor * measure_node_speeds(old, new).boundary
    too_fast = np.hypot(*(new - old)) > limit
    too_fast[[0, -1]] = too_fast[:, [0, -1]] = False
    if not too_fast.any():
        return new
    # Largest theta in 0..1 with |interpolated + theta extra| <= limit; 0 where interpolated alone
    # is beyond it.
    square = (extra**2).sum(axis=0)
    slope = (extra * interpolated).sum(axis=0)
    room = np.maximum(limit**2 - (interpolated**2).sum(axis=0), 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        theta = (-slope + np.sqrt(slope**2 + square * room)) / square
    held = np.where(too_fast & (square > 0.0), 1.0 - np.clip(theta, 0.0, 1.0), 0.0)
    for _ in range(MOST_CELL_HALVINGS):
        limited = new - held * extra
        if len(find_bad_cells(limited)) == 0:
            return limited
        held *= 0.5
    return new
