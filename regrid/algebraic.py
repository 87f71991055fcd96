"""Grids written down from the sides: transfinite, quasi-one-dimensional, of curves, displaced.

Their regridders are quick and honest: a grid with a bad cell is not returned, the failure names the
cells.  Note: only the four sides of the values are read.  "displacement" accumulates: its grid
depends on all boundaries since the first, the others' on the present one alone.

Transfinite interpolation blends by the sides' own arc-length spacing, carried into the block so
that line i is the straight line, in the unit square, between its places on the sides j_min and
j_max, and line j likewise: lines of one family never cross, whatever the spacings, and nothing
depends on which family is called i.

Curved lines are the mean of the two outer lines of their family, each turned and scaled so that it
ends where the line ends (theory R4.15).  Between straight sides this is the straight line; a side
that closes on itself has no chord to be turned with.

Sources: [CharakhchyanND] (2)-(4), theory R1; [ProkopovND] (6.1), theory R6.
"""

from __future__ import annotations

import numpy as np

from regrid.errors import BadInput
from regrid.jit import kernel
from regrid.measure.corners import BLOCK_CORNERS
from regrid.measure.faults import check_grids, explain_failure, name_cells
from regrid.measure.quality import compute_corner_areas
from regrid.protocol import RegridReport, RegridResult
from regrid.sides import copy_sides

# Rows of the scratch: along j, the law on i_min, its change towards i_max, the values on i_min
# and their change towards i_max; then, along i, the same for the sides j_min and j_max.
LAW, LAW_CHANGE, VALUE_X, VALUE_Y, CHANGE_X, CHANGE_Y = range(6)


@kernel
def fill_arc_law(x, y, law):
    """Spacing law 0..1 by arc length of the polyline x, y; uniform where the line has no length."""
    last = law.shape[0] - 1
    law[0] = 0.0
    for k in range(last):
        step_x, step_y = x[k + 1] - x[k], y[k + 1] - y[k]
        law[k + 1] = law[k] + np.sqrt(step_x * step_x + step_y * step_y)
    total = law[last]
    for k in range(1, last):
        law[k] = law[k] / total if total > 0.0 else k / last
    law[last] = 1.0


@kernel
def fill_blend(along_i, along_j, corners, mean_x, mean_y, out):
    """Boolean sum (theory R6.4) of the sides' values into the inner nodes; rows as named above."""
    (corner_00x, corner_0mx, corner_n0x, corner_nmx) = corners[0]
    (corner_00y, corner_0my, corner_n0y, corner_nmy) = corners[1]
    for i in range(1, out.shape[1] - 1):
        start, turn = along_i[LAW, i], along_i[LAW_CHANGE, i]
        low_x, low_y = along_i[VALUE_X, i], along_i[VALUE_Y, i]
        rise_x, rise_y = along_i[CHANGE_X, i], along_i[CHANGE_Y, i]
        row_x, row_y = out[0, i], out[1, i]
        for j in range(1, out.shape[2] - 1):
            bend = along_j[LAW_CHANGE, j]
            blend_i = (start + along_j[LAW, j] * turn) / (1.0 - turn * bend)
            blend_j = along_j[LAW, j] + blend_i * bend
            # Corner terms of the boolean sum, folded into the part that runs along j.
            under_x = low_x - corner_00x - blend_i * (corner_n0x - corner_00x)
            under_y = low_y - corner_00y - blend_i * (corner_n0y - corner_00y)
            over_x = low_x + rise_x - corner_0mx - blend_i * (corner_nmx - corner_0mx)
            over_y = low_y + rise_y - corner_0my - blend_i * (corner_nmy - corner_0my)
            side_x = along_j[VALUE_X, j] + blend_i * along_j[CHANGE_X, j]
            side_y = along_j[VALUE_Y, j] + blend_i * along_j[CHANGE_Y, j]
            row_x[j] = mean_x + (side_x + (under_x + blend_j * (over_x - under_x)))
            row_y[j] = mean_y + (side_y + (under_y + blend_j * (over_y - under_y)))


@kernel
def fill_from_sides(laws_of, out):
    """Interpolate the values on the four sides of `out` to its inner nodes.

    `laws_of` (2, ni+1, nj+1) is a grid whose sides give the spacing laws; the sides of `out`
    (same shape) are left as they are.
    """
    ni, nj = out.shape[1] - 1, out.shape[2] - 1
    along_i, along_j = np.empty((6, ni + 1)), np.empty((6, nj + 1))
    # The mean is symmetric in the corners, so that a mirrored or transposed block gets the same
    # bits, and is the value itself where all agree: a block moved bodily keeps its shape.
    mean_x = 0.25 * ((out[0, 0, 0] + out[0, ni, nj]) + (out[0, 0, nj] + out[0, ni, 0]))
    mean_y = 0.25 * ((out[1, 0, 0] + out[1, ni, nj]) + (out[1, 0, nj] + out[1, ni, 0]))
    # The value rows first hold the sides of the grid, for the laws.
    for j, law in ((0, LAW), (nj, LAW_CHANGE)):
        for i in range(ni + 1):
            along_i[VALUE_X, i], along_i[VALUE_Y, i] = laws_of[0, i, j], laws_of[1, i, j]
        fill_arc_law(along_i[VALUE_X], along_i[VALUE_Y], along_i[law])
    for i, law in ((0, LAW), (ni, LAW_CHANGE)):
        fill_arc_law(laws_of[0, i], laws_of[1, i], along_j[law])
    for i in range(ni + 1):
        along_i[LAW_CHANGE, i] -= along_i[LAW, i]
        along_i[VALUE_X, i], along_i[VALUE_Y, i] = out[0, i, 0] - mean_x, out[1, i, 0] - mean_y
        along_i[CHANGE_X, i] = out[0, i, nj] - out[0, i, 0]
        along_i[CHANGE_Y, i] = out[1, i, nj] - out[1, i, 0]
    for j in range(nj + 1):
        along_j[LAW_CHANGE, j] -= along_j[LAW, j]
        along_j[VALUE_X, j], along_j[VALUE_Y, j] = out[0, 0, j] - mean_x, out[1, 0, j] - mean_y
        along_j[CHANGE_X, j] = out[0, ni, j] - out[0, 0, j]
        along_j[CHANGE_Y, j] = out[1, ni, j] - out[1, 0, j]
    low, high = along_j[VALUE_X : VALUE_Y + 1], along_j[CHANGE_X : CHANGE_Y + 1]
    corners = (
        (low[0, 0], low[0, nj], low[0, 0] + high[0, 0], low[0, nj] + high[0, nj]),
        (low[1, 0], low[1, nj], low[1, 0] + high[1, 0], low[1, nj] + high[1, nj]),
    )
    fill_blend(along_i, along_j, corners, mean_x, mean_y, out)


@kernel
def fill_displacement(previous, boundary, out):
    """Carry the boundary's displacement `boundary - previous` into the block, by the old laws.

    `out` (2, ni+1, nj+1) is written everywhere; equal displacements on all sides come out as they
    are, and a displacement that is affine along a graded rectangle is affine inside.
    """
    ni, nj = out.shape[1] - 1, out.shape[2] - 1
    for k in range(2):
        for i in range(ni + 1):
            out[k, i, 0] = boundary[k, i, 0] - previous[k, i, 0]
            out[k, i, nj] = boundary[k, i, nj] - previous[k, i, nj]
        for j in range(nj + 1):
            out[k, 0, j] = boundary[k, 0, j] - previous[k, 0, j]
            out[k, ni, j] = boundary[k, ni, j] - previous[k, ni, j]
    fill_from_sides(previous, out)


@kernel
def fill_moved(old, sides, bend, most_bend, bent, displacement, base, reach):
    """Move a grid: `base = old + displacement`, with the sides of `sides`; (2, ni+1, nj+1), in m.

    Lines j = const that keep spacing laws of their own (theory R4.9) take their part of the change
    of their way from i_min to i_max: where `bent`, `displacement` is given `bend` (ni+1, nj+1)
    times that change first; `reach` (nj+1) is the most that this is on each line, with
    `most_bend` (nj+1), the most of `bend` there.
    """
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    turn = np.zeros((2, nj + 1))
    if bent:
        for k in range(2):
            for j in range(nj + 1):
                way = sides[k, ni, j] - sides[k, 0, j]
                turn[k, j] = way - (old[k, ni, j] - old[k, 0, j])
        for j in range(nj + 1):
            square = turn[0, j] * turn[0, j] + turn[1, j] * turn[1, j]
            reach[j] = most_bend[j] * np.sqrt(square)
    for k in range(2):
        turned = turn[k]
        for i in range(ni + 1):
            row, here, moved = displacement[k, i], old[k, i], base[k, i]
            if bent:
                part = bend[i]
                for j in range(nj + 1):
                    row[j] += part[j] * turned[j]
            for j in range(nj + 1):
                moved[j] = here[j] + row[j]
            moved[0], moved[nj] = sides[k, i, 0], sides[k, i, nj]
        for j in range(nj + 1):
            base[k, 0, j], base[k, ni, j] = sides[k, 0, j], sides[k, ni, j]


def displaced_grid(previous: np.ndarray, boundary: np.ndarray) -> np.ndarray:
    """The grid `previous` moved by the interpolated displacement of its sides (theory R6.5).

    Both (2, ni+1, nj+1), of `boundary` the sides alone; the result may be folded.
    """
    nodes = np.empty_like(previous)
    fill_displacement(previous, boundary, nodes)
    nodes += previous
    copy_sides(boundary, nodes)
    return nodes


def begin_grid(previous: np.ndarray, boundary: np.ndarray, sign: float) -> tuple[np.ndarray, str]:
    """The old grid carried along, where that is convex in the orientation `sign`, else transfinite
    interpolation; and which of the two it is."""
    nodes = displaced_grid(previous, boundary)
    if (sign * compute_corner_areas(nodes) > 0.0).all():
        return nodes, "displacement"
    return transfinite_grid(boundary), "transfinite"


def transfinite_grid(boundary: np.ndarray) -> np.ndarray:
    """Grid between four sides by transfinite interpolation of their nodes.

    `boundary` (2, ni+1, nj+1) is read on its sides only.  The result may be folded where the
    sides bend strongly: check it with `regrid.measure.quality`.
    """
    nodes = np.array(boundary, dtype=np.float64, order="C")
    fill_from_sides(nodes, nodes)
    return nodes


def fill_quasi_1d(boundary: np.ndarray, out: np.ndarray) -> None:
    """Grid (theory R1.3), lines j = const straight between the sides i_min and i_max:

    `r[i,j] = r[0,j] + t[i,j] (r[N,j] - r[0,j])`, `t[i,j] = ((M - j) t[i,0] + j t[i,M])/M`.
    Sides are copied from `boundary` (2, ni+1, nj+1), inner nodes of it are not read.
    """
    copy_sides(boundary, out)
    laws, nj = np.empty((2, out.shape[1])), out.shape[2] - 1
    for law, j in zip(laws, (0, -1), strict=True):
        fill_arc_law(*np.ascontiguousarray(boundary[:, :, j]), law)
    low, change = laws[0, 1:-1, None], (laws[1] - laws[0])[1:-1, None]
    part = low + change * (np.arange(1, nj) / nj)
    first, last = out[:, :1, 1:-1], out[:, -1:, 1:-1]
    out[:, 1:-1, 1:-1] = first + part * (last - first)


def quasi_1d_grid(boundary: np.ndarray, family: str = "i") -> np.ndarray:
    """Grid between four sides with straight lines along `family` ("i": the lines j = const).

    `boundary` (2, ni+1, nj+1) is read on its sides only; the result may be folded.
    """
    turned = boundary if family == "i" else boundary.transpose(0, 2, 1)
    turned = np.ascontiguousarray(turned, dtype=np.float64)
    nodes = np.empty_like(turned)
    fill_quasi_1d(turned, nodes)
    return nodes if family == "i" else np.ascontiguousarray(nodes.transpose(0, 2, 1))


@kernel
def fill_shape(x, y, shape):
    """A line (n,) with its chord as the unit: parts along and across it into `shape` (2, n)."""
    last = x.shape[0] - 1
    chord_x, chord_y = x[last] - x[0], y[last] - y[0]
    scale = 1.0 / (chord_x * chord_x + chord_y * chord_y)
    for k in range(last + 1):
        step_x, step_y = x[k] - x[0], y[k] - y[0]
        shape[0, k] = scale * (step_x * chord_x + step_y * chord_y)
        shape[1, k] = scale * (chord_x * step_y - chord_y * step_x)


@kernel
def fill_curves(sides, share_i, share_j, curve):
    """Fill `curve` (2, ni+1, nj+1) [m] with curved lines between the sides of `sides`, same shape.

    `share_i` times the lines j = const and `share_j` times the lines i = const, where these are not
    0; the sides j_min, j_max or i_min, i_max that they take their shapes from have to be open.
    """
    ni, nj = curve.shape[1] - 1, curve.shape[2] - 1
    x, y = sides
    curve[:] = 0.0
    if share_i > 0.0:
        line, low, high = np.empty((2, ni + 1)), np.empty((2, ni + 1)), np.empty((2, ni + 1))
        for j, shape in ((0, low), (nj, high)):
            for i in range(ni + 1):
                line[0, i], line[1, i] = x[i, j], y[i, j]
            fill_shape(line[0], line[1], shape)
        for i in range(ni + 1):
            for j in range(nj + 1):
                v = j / nj
                along = (1.0 - v) * low[0, i] + v * high[0, i]
                across = (1.0 - v) * low[1, i] + v * high[1, i]
                way_x, way_y = x[ni, j] - x[0, j], y[ni, j] - y[0, j]
                curve[0, i, j] += share_i * (x[0, j] + (along * way_x - across * way_y))
                curve[1, i, j] += share_i * (y[0, j] + (along * way_y + across * way_x))
    if share_j > 0.0:
        low, high = np.empty((2, nj + 1)), np.empty((2, nj + 1))
        fill_shape(x[0], y[0], low)
        fill_shape(x[ni], y[ni], high)
        for i in range(ni + 1):
            u = i / ni
            way_x, way_y = x[i, nj] - x[i, 0], y[i, nj] - y[i, 0]
            for j in range(nj + 1):
                along = (1.0 - u) * low[0, j] + u * high[0, j]
                across = (1.0 - u) * low[1, j] + u * high[1, j]
                curve[0, i, j] += share_j * (x[i, 0] + (along * way_x - across * way_y))
                curve[1, i, j] += share_j * (y[i, 0] + (along * way_y + across * way_x))


@kernel(allocates=False)
def take_curve(curve, i, low, count, to_x, to_y, Z):
    """The edges along i of `curve` that lead to its row i, into `Z` from `to_x`, `to_y` on [m].

    Of `count` columns from `low` on.
    """
    x0, y0 = curve[0, i - 1, low : low + count], curve[1, i - 1, low : low + count]
    x1, y1 = curve[0, i, low : low + count], curve[1, i, low : low + count]
    for col in range(count):
        Z[to_x + col] = x1[col] - x0[col]
        Z[to_y + col] = y1[col] - y0[col]


@kernel(allocates=False)
def take_curve_sides(curve, i, low, cells, weight, from_x, from_y, Z):
    """Take the edges along j of row i of `curve`, times those weights, from two rows of `Z`.

    The weights lie in `Z` from `weight` on, the rows from `from_x`, `from_y` on.
    """
    x, y = curve[0, i, low : low + cells + 1], curve[1, i, low : low + cells + 1]
    for col in range(cells):
        q = Z[weight + col]
        Z[from_x + col] -= q * (x[col + 1] - x[col])
        Z[from_y + col] -= q * (y[col + 1] - y[col])


class AlgebraicRegridder:
    """Base: `make_nodes` makes a grid, `regrid` proves it convex or raises RegridFailure."""

    start = ""

    def __init__(self, threads: int = 1):
        self.threads = threads

    def make_nodes(self, previous: np.ndarray, boundary: np.ndarray) -> np.ndarray:
        """New nodes (2, ni+1, nj+1) on the sides of `boundary`; may be folded."""
        raise NotImplementedError

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid on the sides of `boundary`; raises RegridFailure naming cells that are not convex.

        Both arrays have shape (2, ni+1, nj+1); only the four sides of `boundary` are read.
        """
        previous, boundary = check_grids(previous, boundary)
        nodes = self.make_nodes(previous, boundary)
        old, new = compute_corner_areas(previous), compute_corner_areas(nodes)
        sign = 1.0 if old.sum() >= 0.0 else -1.0
        forced = [corner for corner in BLOCK_CORNERS if not sign * new[corner] > 0.0]
        for corner in forced:
            old[corner] = new[corner] = sign
        bad = np.argwhere(~(sign * new > 0.0).all(axis=0))
        if len(bad) or not np.isfinite(nodes).all():
            also = f"cells {name_cells(bad)} of the {self.start} grid are not convex"
            raise explain_failure(boundary, nodes[:: int(sign)], also=also, grid=nodes)
        ratio = float((new / old).min())
        return RegridResult(
            nodes,
            RegridReport(least_corner_ratio=ratio, start=self.start, exempt_corners=len(forced)),
        )


class QuasiOneDimensionalRegridder(AlgebraicRegridder):
    """Straight lines of one family: `family` "i" (lines j = const), "j", or "auto".

    "auto" takes the family that starts on the sides with the larger arc relative to its chord.
    """

    start = "quasi-1d"

    def __init__(self, family: str = "auto", threads: int = 1):
        super().__init__(threads)
        if family not in ("auto", "i", "j"):
            raise BadInput(f"quasi-1d: family must be 'auto', 'i' or 'j', got '{family}'")
        self.family = family

    def make_nodes(self, previous, boundary):
        family = self.family
        if family == "auto":
            bends = [
                max(compute_arc_excess(boundary[:, 0]), compute_arc_excess(boundary[:, -1])),
                max(compute_arc_excess(boundary[:, :, 0]), compute_arc_excess(boundary[:, :, -1])),
            ]
            family = "j" if bends[1] > bends[0] else "i"
        return quasi_1d_grid(boundary, family)


class TransfiniteRegridder(AlgebraicRegridder):
    """Transfinite interpolation of the boundary's nodes, blended by the sides' own laws.

    Theory R6.4.
    """

    start = "transfinite"

    def make_nodes(self, previous, boundary):
        return transfinite_grid(boundary)


class DisplacementRegridder(AlgebraicRegridder):
    """The old grid moved by the interpolated displacement of its boundary.

    Theory R6.5.
    """

    start = "displacement"

    def make_nodes(self, previous, boundary):
        return displaced_grid(previous, boundary)


def compute_arc_excess(line: np.ndarray) -> float:
    """Arc length over chord of a polyline (2, n), less one."""
    chord = np.hypot(*(line[:, -1] - line[:, 0]))
    return float(np.hypot(*np.diff(line, axis=1)).sum() / max(chord, 1e-300) - 1.0)
