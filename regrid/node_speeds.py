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
# local spacings that the limit allows, below which a step is a short one: folded cells then stay
# where they are if they can, as the way to the new grid is finite in a step of any length
SHORT_STEP_SPACINGS = 0.03
MOST_BLENDS = 12  # halvings of the distance to the new grid for all nodes if folds persist
# factor of the limit for nodes of cells that would otherwise be sharpened
LOOSENED_LIMIT_FACTOR = 2.0
ROUND_OFF_AREA = 1e-12  # relative, well above that of an area or a comparison
FLAT_CORNER_SINE = 0.01  # sine of an obtuse corner below which it is nearly a straight line
# fraction of the smaller of a corner's areas, old and new, left by the limit
KEPT_AREA_FRACTION = 0.98


@kernel
def find_fast_rows(old, new, interpolated, most_spacings, first, last):
    """Find whole rows of nodes with a node that `fill_limited` may limit; returns their number.

    `first`, `last` (ni + 1) receive the inner nodes of such a row, ni > first > last elsewhere.
    The comparison is that of `fill_limited` without divisions, slightly stricter.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    limit_factor = (1.0 - ROUND_OFF_AREA) * most_spacings * most_spacings
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
        motion_x = interpolated[0, i]
        motion_y = interpolated[1, i]
        fast_count = 0
        for j in range(1, nj):
            # motion of the node beside the interpolated one
            excess_x, excess_y = (new_x[j] - x[j]) - motion_x[j], (new_y[j] - y[j]) - motion_y[j]
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
            # farther than `most_spacings` heights of any of them (R8.2)?
            is_fast = square * (a if a > b else b) > limit_factor * (p * p)
            is_fast |= square * (b if b > c else c) > limit_factor * (q * q)
            is_fast |= square * (c if c > d else d) > limit_factor * (r * r)
            is_fast |= square * (d if d > a else a) > limit_factor * (s * s)
            fast_count += 1 if is_fast else 0
        # then all inner nodes of the row are looked at again
        if fast_count > 0:
            first[i] = 1
            last[i] = nj - 1
            rows += 1
    return rows


@inlined
def measure_spacing(area, dot, a, b, spares_flat):
    """Square of a corner's height over its longer edge; a, b: squares of the edges.

    area, dot: cross and scalar product of the edges.  If it `spares_flat` corners, that of the
    shorter edge where a corner is almost straight: such a cell need not be thin.
    """
    is_flat = area * area < FLAT_CORNER_SINE * FLAT_CORNER_SINE * a * b
    if spares_flat and dot < 0.0 and is_flat:
        return min(a, b)
    return area * area / max(a, b)


@kernel
def fill_limited(old, new, interpolated, most_spacings, first, last, spares_flat, out):
    """Nodes of `new`, each at most `most_spacings` local spacings from its interpolated position.

    old, new, interpolated (displacements), out: (2, ni + 1, nj + 1), in m.  The local spacing is
    the least height of the four old corner triangles at the node over their longer edges: in a
    sheared sliver this is the thickness, whereas the shortest edge would allow a node to cross many
    cells. `spares_flat`: see `measure_spacing`.  Only nodes from `first` to `last` (ni + 1) of a
    row are examined, and both are narrowed to the limited nodes.  Returns the number of these.
    Theory R8.2.
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
            limit = measure_spacing(ax * by - ay * bx, ax * bx + ay * by, a, b, spares_flat)
            limit = min(
                limit,
                measure_spacing(bx * cy - by * cx, bx * cx + by * cy, b, c, spares_flat),
            )
            limit = min(
                limit,
                measure_spacing(cx * dy - cy * dx, cx * dx + cy * dy, c, d, spares_flat),
            )
            limit = min(
                limit,
                measure_spacing(dx * ay - dy * ax, dx * ax + dy * ay, d, a, spares_flat),
            )
            limit *= most_spacings * most_spacings
            # taken back to the limit
            if square > limit:
                fraction = (limit / square) ** 0.5
                out[0, i, j] = x[i, j] + interpolated[0, i, j] + fraction * excess_x
                out[1, i, j] = y[i, j] + interpolated[1, i, j] + fraction * excess_y
                limited += 1
                first[i] = min(first[i], j)
                last[i] = j
    return limited


@inlined
def mark_cell(marks, i, j):
    """Mark the four nodes of a cell."""
    marks[i, j] = marks[i + 1, j] = marks[i, j + 1] = marks[i + 1, j + 1] = 1


@inlined
def move_marked(limited, new, first, last, marks, fraction):
    """Move marked nodes by a fraction of the distance from `limited` to `new`."""
    for i in range(1, limited.shape[1] - 1):
        for j in range(first[i], last[i] + 1):
            if marks[i, j] > 0:
                for k in range(2):
                    limited[k, i, j] += fraction * (new[k, i, j] - limited[k, i, j])


@kernel
def relax_sharpened(old, new, limited, first, last, marks):
    """Move nodes of cells that the limit sharpens halfway from `limited` to `new`.

    These cells have a corner triangle of less area in `limited` than KEPT of that in either other
    grid, all (2, ni + 1, nj + 1), except the block's own corners, which no inner node changes.
    Only nodes from `first` to `last` of a row may differ from `new`, which is convex: no other
    cells are examined.  `marks` (ni + 1, nj + 1) is scratch.  Returns the number of such cells.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    count = 0
    marks[:] = 0
    for i in range(ni):
        for j in range(min(first[i], first[i + 1]) - 1, min(max(last[i], last[i + 1]) + 1, nj)):
            is_sharpened = False
            for corner in range(4):
                p, q, _, _ = find_triangle(i, j, corner)
                if (p == 0 or p == ni) and (q == 0 or q == nj):
                    continue
                old_area = compute_doubled_area(old, i, j, corner)
                new_area = compute_doubled_area(new, i, j, corner)
                limited_area = compute_doubled_area(limited, i, j, corner)
                is_sharpened |= not (limited_area >= KEPT_AREA_FRACTION * min(old_area, new_area))
            if is_sharpened:
                count += 1
                mark_cell(marks, i, j)
    move_marked(limited, new, first, last, marks, 0.5)
    return count


@kernel
def release_folded(new, limited, first, last, all_the_way, marks):
    """Move nodes of cells that the limit folds halfway from `limited` to `new`.

    A corner is folded if it is not positive beyond round-off, except the block's own corners, which
    no inner node changes.  Only nodes from `first` to `last` (ni + 1) of a row may differ from
    `new`.  They may move `all_the_way` at once.  `marks` (ni + 1, nj + 1) is scratch.  Returns the
    number of such cells.
    """
    ni, nj = new.shape[1] - 1, new.shape[2] - 1
    x, y = limited[0], limited[1]
    fraction = 1.0 if all_the_way else 0.5
    count = 0
    marks[:] = 0
    for i in range(ni):
        for j in range(min(first[i], first[i + 1]) - 1, min(max(last[i], last[i + 1]) + 1, nj)):
            is_folded = False
            for corner in range(4):
                p, q, next_p, next_q = find_triangle(i, j, corner)
                if (p == 0 or p == ni) and (q == 0 or q == nj):
                    continue
                ax, ay = x[next_p, q] - x[p, q], y[next_p, q] - y[p, q]
                bx, by = x[p, next_q] - x[p, q], y[p, next_q] - y[p, q]
                squares = (ax * ax + ay * ay) + (bx * bx + by * by)
                is_folded |= not (
                    compute_doubled_area(limited, i, j, corner) > ROUND_OFF_AREA * squares
                )
            if is_folded:
                count += 1
                mark_cell(marks, i, j)
    move_marked(limited, new, first, last, marks, fraction)
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
        self.marks = np.empty(shape[1:], dtype=np.int8)
        # the limited nodes of each row; those of `loosened` are a subset
        self.first, self.last = (np.empty(shape[1], dtype=np.int64) for _ in range(2))
        self.loosened_first, self.loosened_last = (
            np.empty(shape[1], dtype=np.int64) for _ in range(2)
        )

    def limit(
        self, old: np.ndarray, new: np.ndarray, most_spacings: float
    ) -> tuple[np.ndarray, int]:
        """`new` with inner nodes near the interpolated grid, and how many were limited.

        They are within `most_spacings` local spacings of it.

        `new` must be convex; the result is valid until the next regrid of this thread.

        Where the limit sharpens corners, nodes move towards LOOSENED_LIMIT_FACTOR times as many
        spacings, by halves; those of folded cells return to `new`.  If that keeps folding others,
        all nodes return by the same fraction to `new`, the least of halvings that leaves no fold.
        A symmetric block stays so.
        """
        limited, count = self._limit(old, new, most_spacings)
        symmetry = find_symmetry(old, new) if count > 0 else None
        if symmetry is not None:
            correction = limited - new
            if symmetry.even_out(correction):
                evened = new + correction
                if len(find_bad_cells(evened)) == 0:
                    limited = evened
        return limited, count

    def _limit(
        self, old: np.ndarray, new: np.ndarray, most_spacings: float
    ) -> tuple[np.ndarray, int]:
        """`limit` without regard to symmetry."""
        # nodes that the limit of theory R8.2 holds
        first = self.first
        last = self.last
        memory = share_memory(3 * new.size)[: 3 * new.size]
        interpolated, limited, loosened = memory.reshape(3, *self.shape)
        fill_displacement(old, new, interpolated)
        if find_fast_rows(old, new, interpolated, most_spacings, first, last) == 0:
            return new, 0
        count = fill_limited(old, new, interpolated, most_spacings, first, last, False, limited)
        if count == 0:
            return new, 0
        # those that it sharpens may go to the looser limit, by halves
        self.loosened_first[:] = first
        self.loosened_last[:] = last
        loosened_first = self.loosened_first
        loosened_last = self.loosened_last
        fill_limited(
            old,
            new,
            interpolated,
            LOOSENED_LIMIT_FACTOR * most_spacings,
            loosened_first,
            loosened_last,
            True,
            loosened,
        )
        for _ in range(MOST_CELL_HALVINGS):
            if relax_sharpened(old, loosened, limited, first, last, self.marks) == 0:
                break
        # folded ones stay where they are in a short step
        if most_spacings < SHORT_STEP_SPACINGS and self._hold_folded(old, limited, loosened):
            return loosened, count
        # else they go back to `new`
        for halvings in range(MOST_RETURN_ROUNDS):
            all_the_way = halvings >= MOST_CELL_HALVINGS
            if release_folded(new, limited, first, last, all_the_way, self.marks) == 0:
                return limited, count
        if len(find_bad_cells(limited)) == 0:
            return limited, count
        find_fast_rows(old, new, interpolated, most_spacings, first, last)
        fill_limited(old, new, interpolated, most_spacings, first, last, False, limited)
        for halvings in range(MOST_BLENDS, 0, -1):
            np.subtract(new, limited, out=loosened)
            loosened *= 0.5**halvings
            loosened += limited
            if len(find_bad_cells(loosened)) == 0:
                return loosened, count
        return new, 0

    def _hold_folded(self, old: np.ndarray, limited: np.ndarray, out: np.ndarray) -> bool:
        """Fill `out` with `limited`, but nodes of folded cells as in `old`; whether none is left.

        Where a corner is nearly straight, or a cell nearly flat, the motion of its neighbours
        folds it however little they move.
        """
        out[...] = limited
        # all inner nodes may be held
        first = self.loosened_first
        last = self.loosened_last
        first[:] = 1
        last[:] = old.shape[2] - 2
        for _ in range(MOST_RETURN_ROUNDS):
            if release_folded(old, out, first, last, True, self.marks) == 0:
                return True
        return False


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
    is_too_fast = np.hypot(*(new - old)) > limit
    is_too_fast[[0, -1]] = is_too_fast[:, [0, -1]] = False
    if not is_too_fast.any():
        return new
    # Largest theta in 0..1 with |interpolated + theta extra| <= limit; 0 where interpolated alone
    # is beyond it.
    square = (extra**2).sum(axis=0)
    dot = (extra * interpolated).sum(axis=0)
    remaining_square = np.maximum(limit**2 - (interpolated**2).sum(axis=0), 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        theta = (-dot + np.sqrt(dot**2 + square * remaining_square)) / square
    taken_back = np.where(is_too_fast & (square > 0.0), 1.0 - np.clip(theta, 0.0, 1.0), 0.0)
    for _ in range(MOST_CELL_HALVINGS):
        limited = new - taken_back * extra
        if len(find_bad_cells(limited)) == 0:
            return limited
        taken_back *= 0.5
    return new
