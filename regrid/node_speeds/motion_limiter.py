"""Node speeds of a rebuilt grid: inner nodes should not outrun the boundary (a maximum principle).

A ratio well above 1 says that the regridder throws inner nodes about, which costs time steps and
smears the flow.  The trap: the limited grid is a mixture of two grids node by node, so convexity
has to be shown again; where the mixture fails, the limit gives way, not convexity.

Source: [ProkopovND] §6; theory R8.
"""

from __future__ import annotations

import numpy as np

from regrid.algebraic.transfinite import fill_displacement
from regrid.jit import kernel
from regrid.measure.corner_areas import compute_doubled_area, find_triangle
from regrid.measure.quality import find_bad_cells

HALVINGS = 8
LOOSE = 2.0  # times as far as others may go nodes of cells that would be sharpened otherwise
KEPT = 0.98  # of the lesser of a corner's areas, old and new, is left where a node is limited


@kernel
def fill_limited(old, new, interpolated, most, out):
    """Nodes of `new`, each at most `most` local spacings from where interpolation puts it.

    old, new, interpolated (displacements), out: (2, ni + 1, nj + 1), in m.  The local spacing is
    the least height of the four old corner triangles at the node over their longer edges: in a
    sheared sliver its thickness, where the shortest edge would let a node cross many cells.
    Returns the number of nodes limited.  Theory R8.2.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    x, y = old[0], old[1]
    limited = 0
    for i in range(ni + 1):
        for j in range(nj + 1):
            out[0, i, j] = new[0, i, j]
            out[1, i, j] = new[1, i, j]
    for i in range(1, ni):
        for j in range(1, nj):
            excess_x = (new[0, i, j] - x[i, j]) - interpolated[0, i, j]
            excess_y = (new[1, i, j] - y[i, j]) - interpolated[1, i, j]
            square = excess_x * excess_x + excess_y * excess_y
            ax, ay = x[i + 1, j] - x[i, j], y[i + 1, j] - y[i, j]
            bx, by = x[i, j + 1] - x[i, j], y[i, j + 1] - y[i, j]
            cx, cy = x[i - 1, j] - x[i, j], y[i - 1, j] - y[i, j]
            dx, dy = x[i, j - 1] - x[i, j], y[i, j - 1] - y[i, j]
            a, b = ax * ax + ay * ay, bx * bx + by * by
            c, d = cx * cx + cy * cy, dx * dx + dy * dy
            limit = (ax * by - ay * bx) ** 2 / max(a, b)
            limit = min(limit, (bx * cy - by * cx) ** 2 / max(b, c))
            limit = min(limit, (cx * dy - cy * dx) ** 2 / max(c, d))
            limit = most * most * min(limit, (dx * ay - dy * ax) ** 2 / max(d, a))
            if square > limit:
                keep = (limit / square) ** 0.5
                out[0, i, j] = x[i, j] + interpolated[0, i, j] + keep * excess_x
                out[1, i, j] = y[i, j] + interpolated[1, i, j] + keep * excess_y
                limited += 1
    return limited


@kernel
def relax_sharpened(old, new, limited, loose):
    """Go half the way from `limited` to `new` with nodes of cells that the limit sharpens.

    That is a cell with a corner triangle of less area in `limited` than KEPT of that in either
    other grid, all (2, ni + 1, nj + 1); the block's own corners apart, which no inner node changes.
    `loose` (ni + 1, nj + 1) is scratch.  Returns the number of such cells.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    count = 0
    for i in range(ni + 1):
        for j in range(nj + 1):
            loose[i, j] = 0
    for i in range(ni):
        for j in range(nj):
            sharpened = False
            for corner in range(4):
                p, q, _, _ = find_triangle(i, j, corner)
                if (p == 0 or p == ni) and (q == 0 or q == nj):
                    continue
                before = compute_doubled_area(old, i, j, corner)
                after = compute_doubled_area(new, i, j, corner)
                area = compute_doubled_area(limited, i, j, corner)
                sharpened |= not (area >= KEPT * min(before, after))
            if sharpened:
                count += 1
                loose[i, j] = loose[i + 1, j] = loose[i, j + 1] = loose[i + 1, j + 1] = 1
    for i in range(1, ni):
        for j in range(1, nj):
            if loose[i, j] > 0:
                for k in range(2):
                    limited[k, i, j] = 0.5 * (limited[k, i, j] + new[k, i, j])
    return count


class MotionLimiter:
    """Keeps a regridder from moving nodes through the fluid faster than the step allows.

    A regridder aims at its best grid, however far that is from the old one: the part of its
    motion that the boundary does not ask for does not shrink with dt.  Taken in one step it is
    a remap of many cells through one face, and the time step, which follows the speed of the
    faces, collapses.  Limited, the grid gets there in the steps that follow.

    In a curled block the motion that the boundary asks for, interpolated inside, shears
    cells thinner step by step, and the thinner they are the less of the regridder's cure they
    would be left.  So where the limit makes a corner sharper than it is in both grids, the old and
    the new, nodes may go LOOSE times as far; let go altogether, a regridder that swings at rest
    would shorten the time step without end.
    """

    def __init__(self, shape: tuple[int, ...]):
        self.interpolated, self.limited = np.empty(shape), np.empty(shape)
        self.far, self.loose = np.empty(shape), np.empty(shape[1:], dtype=np.int8)

    def limit(self, old: np.ndarray, new: np.ndarray, most: float) -> tuple[np.ndarray, int]:
        """`new` with inner nodes within `most` spacings of the interpolated grid, and how many were
        limited.

        Where that sharpens corners, nodes go towards LOOSE times as many spacings, by halves; all
        go back to `new` where the grid would not be convex.
        """
        fill_displacement(old, new, self.interpolated)
        count = fill_limited(old, new, self.interpolated, most, self.limited)
        if count == 0:
            return new, 0
        fill_limited(old, new, self.interpolated, LOOSE * most, self.far)
        for _ in range(HALVINGS):
            if relax_sharpened(old, self.far, self.limited, self.loose) == 0:
                break
        for _ in range(HALVINGS):
            if len(find_bad_cells(self.limited)) == 0:
                return self.limited, count
            self.limited += new
            self.limited *= 0.5
        return new, 0
