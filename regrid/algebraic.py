"""Algebraic grids: transfinite, quasi-one-dimensional, curved and displaced.

Their regridders are fast.  They never return a grid with a bad cell; the failure names the cells.
Only the values on the four sides are read.  The grid of "displacement" depends on all boundaries
since the first one; the other grids depend only on the present boundary.

Transfinite interpolation blends by the arc-length spacing of the sides.  In the unit square, line i
is the straight line between its positions on the sides j_min and j_max, and line j likewise.  Lines
of one family therefore never cross, whatever the spacings, and the result does not depend on which
family is called i.

A curved line is the mean of the two outer lines of its family, each rotated and scaled to the end
points of the line (theory R4.15).  Between straight sides it is a straight line.  A closed side has
no chord and cannot be rotated in this way.

Sources: [CharakhchyanND] (2)-(4), theory R1; [ProkopovND] (6.1), theory R6.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import BLOCK_CORNERS
from shockgrid.regrid.measure.faults import check_grids, explain_failure, name_cells
from shockgrid.regrid.measure.quality import compute_corner_areas
from shockgrid.regrid.protocol import RegridReport, RegridResult
from shockgrid.regrid.sides import copy_sides

# Rows of the tables of `fill_tables`: along j, the spacing on i_min, its change towards i_max, the
# values on i_min and their change towards i_max; along i, the same for the sides j_min and j_max.
SPACING, SPACING_CHANGE, VALUE_X, VALUE_Y, CHANGE_X, CHANGE_Y = range(6)


@kernel
def fill_arc_spacing(x, y, spacing):
    """Spacing 0..1 by arc length of the polyline x, y; uniform where the line has no length."""
    last = spacing.shape[0] - 1
    spacing[0] = 0.0
    for k in range(last):
        step_x, step_y = x[k + 1] - x[k], y[k + 1] - y[k]
        spacing[k + 1] = spacing[k] + np.sqrt(step_x * step_x + step_y * step_y)
    total = spacing[last]
    for k in range(1, last):
        spacing[k] = spacing[k] / total if total > 0.0 else k / last
    spacing[last] = 1.0


class RowBlend(NamedTuple):
    """What the boolean sum (theory R6.4) takes of a row of nodes.

    Its spacing on j_min and the change towards j_max; of its values beyond the corners' at either
    end, `low_x` to `high_y`, the value on i_min and the change towards i_max; the values' mean.
    """

    spacing: float
    spacing_change: float
    low_x: tuple[float, float]
    low_y: tuple[float, float]
    high_x: tuple[float, float]
    high_y: tuple[float, float]
    mean_x: float
    mean_y: float


@inlined
def take_blend(i, along_i, corners):
    """The `RowBlend` of row i, from the tables of `fill_tables`."""
    value_x, value_y = along_i[VALUE_X, i], along_i[VALUE_Y, i]
    change_x, change_y = along_i[CHANGE_X, i], along_i[CHANGE_Y, i]
    return RowBlend(
        along_i[SPACING, i], along_i[SPACING_CHANGE, i],
        (value_x - corners[0, 0], corners[0, 2] - corners[0, 0]),
        (value_y - corners[1, 0], corners[1, 2] - corners[1, 0]),
        (value_x + change_x - corners[0, 1], corners[0, 3] - corners[0, 1]),
        (value_y + change_y - corners[1, 1], corners[1, 3] - corners[1, 1]),
        corners[0, 4], corners[1, 4],
    )  # fmt: skip


@inlined
def blend(row, spacing, spacing_change, value_x, value_y, change_x, change_y):
    """Boolean sum (theory R6.4) of the sides' values at a node: x and y.

    `row` is the `RowBlend` of its row, the others are the rows along j at its column.
    """
    turn = row.spacing_change
    blend_i = (row.spacing + spacing * turn) / (1.0 - turn * spacing_change)
    blend_j = spacing + blend_i * spacing_change
    # corner terms of the boolean sum, folded into the part that runs along j
    low_x, low_y = row.low_x[0] - blend_i * row.low_x[1], row.low_y[0] - blend_i * row.low_y[1]
    high_x, high_y = (
        row.high_x[0] - blend_i * row.high_x[1],
        row.high_y[0] - blend_i * row.high_y[1],
    )
    side_x, side_y = value_x + blend_i * change_x, value_y + blend_i * change_y
    return (
        row.mean_x + (side_x + (low_x + blend_j * (high_x - low_x))),
        row.mean_y + (side_y + (low_y + blend_j * (high_y - low_y))),
    )


@kernel
def fill_blend(along_i, along_j, corners, out):
    """Boolean sum (theory R6.4) of the sides' values into the inner nodes; rows as named above."""
    for i in range(1, out.shape[1] - 1):
        row_blend = take_blend(i, along_i, corners)
        row_x = out[0, i]
        row_y = out[1, i]
        for j in range(1, out.shape[2] - 1):
            row_x[j], row_y[j] = blend(
                row_blend, along_j[SPACING, j], along_j[SPACING_CHANGE, j], along_j[VALUE_X, j],
                along_j[VALUE_Y, j], along_j[CHANGE_X, j], along_j[CHANGE_Y, j],
            )  # fmt: skip


@kernel
def fill_tables(spacings_of, values, moved, along_i, along_j, corners):
    """Rows, as named above, of the values on the four sides of `values`; their corners and mean.

    `spacings_of` (2, ni+1, nj+1) is a grid whose sides give the spacings; where `moved`, its sides
    are taken from those of `values` (same shape).  `along_i` (6, ni+1), `along_j` (6, nj+1),
    `corners` (2, 5): (0, 0), (0, nj), (ni, 0), (ni, nj), and the mean that the values are beyond.
    """
    ni, nj = values.shape[1] - 1, values.shape[2] - 1
    # 1 to take the grid's places from the values, else 0
    subtracted = 1.0 if moved else 0.0
    # The value rows first hold the sides of the grid, for the spacings.
    for j, row in ((0, SPACING), (nj, SPACING_CHANGE)):
        for i in range(ni + 1):
            along_i[VALUE_X, i] = spacings_of[0, i, j]
            along_i[VALUE_Y, i] = spacings_of[1, i, j]
        fill_arc_spacing(along_i[VALUE_X], along_i[VALUE_Y], along_i[row])
    for i, row in ((0, SPACING), (ni, SPACING_CHANGE)):
        fill_arc_spacing(spacings_of[0, i], spacings_of[1, i], along_j[row])
    for k in range(2):
        component = values[k]
        places = spacings_of[k]
        value = VALUE_X + k
        change = CHANGE_X + k
        corner_1 = component[0, 0] - subtracted * places[0, 0]
        corner_2 = component[0, nj] - subtracted * places[0, nj]
        corner_3 = component[ni, 0] - subtracted * places[ni, 0]
        corner_4 = component[ni, nj] - subtracted * places[ni, nj]
        # The mean is symmetric in the corners, so that a mirrored or transposed block gets the
        # same bits, and is the value itself where all agree: a block moved bodily keeps its shape.
        mean = 0.25 * ((corner_1 + corner_4) + (corner_2 + corner_3))
        for i in range(ni + 1):
            low = component[i, 0] - subtracted * places[i, 0]
            along_i[value, i] = low - mean
            along_i[change, i] = (component[i, nj] - subtracted * places[i, nj]) - low
        for j in range(nj + 1):
            near = component[0, j] - subtracted * places[0, j]
            along_j[value, j] = near - mean
            along_j[change, j] = (component[ni, j] - subtracted * places[ni, j]) - near
        corners[k, 0] = along_j[value, 0]
        corners[k, 1] = along_j[value, nj]
        corners[k, 2] = along_j[value, 0] + along_j[change, 0]
        corners[k, 3] = along_j[value, nj] + along_j[change, nj]
        corners[k, 4] = mean
    for i in range(ni + 1):
        along_i[SPACING_CHANGE, i] -= along_i[SPACING, i]
    for j in range(nj + 1):
        along_j[SPACING_CHANGE, j] -= along_j[SPACING, j]


@kernel
def fill_from_sides(spacings_of, out):
    """Interpolate the values on the four sides of `out` to its inner nodes.

    `spacings_of` (2, ni+1, nj+1) is a grid whose sides give the spacings; the sides of `out`
    (same shape) are left as they are.
    """
    along_i, along_j = np.empty((6, out.shape[1])), np.empty((6, out.shape[2]))
    corners = np.empty((2, 5))
    fill_tables(spacings_of, out, False, along_i, along_j, corners)
    fill_blend(along_i, along_j, corners, out)


@kernel
def fill_displacement(previous, boundary, out):
    """Carry the boundary's displacement `boundary - previous` into the block, by the old spacings.

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
    along_i, along_j = np.empty((6, ni + 1)), np.empty((6, nj + 1))
    corners = np.empty((2, 5))
    fill_tables(previous, boundary, True, along_i, along_j, corners)
    fill_blend(along_i, along_j, corners, out)


class SideMotion(NamedTuple):
    """How the sides of a grid move, and the new `sides` (2, ni+1, nj+1) [m].

    `along_i`, `along_j` and `corners` are those of `fill_tables`.  `chord_change` (2, nj+1) is the
    change of each line's chord from i_min to i_max; lines j = const that keep spacings of their own
    (theory R4.9) move by a part of it, at most by `reach` (nj+1).
    """

    sides: np.ndarray
    along_i: np.ndarray
    along_j: np.ndarray
    corners: np.ndarray
    chord_change: np.ndarray
    reach: np.ndarray


@kernel
def prepare_motion(old, motion, most_departure, departs):
    """Fill the tables of a `SideMotion` from the `old` grid to its sides; theory R6.5.

    Where a line `departs` from the sides' spacing, `most_departure` (nj+1) is by how much at most.
    """
    sides = motion.sides
    chord_change = motion.chord_change
    ni, nj = old.shape[1] - 1, old.shape[2] - 1
    fill_tables(old, sides, True, motion.along_i, motion.along_j, motion.corners)
    if departs:
        for j in range(nj + 1):
            for k in range(2):
                chord = sides[k, ni, j] - sides[k, 0, j]
                chord_change[k, j] = chord - (old[k, ni, j] - old[k, 0, j])
            square = (
                chord_change[0, j] * chord_change[0, j] + chord_change[1, j] * chord_change[1, j]
            )
            motion.reach[j] = most_departure[j] * np.sqrt(square)


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
    """The old grid moved along, where that is convex in the orientation `sign`, else transfinite
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
    spacings = np.empty((2, out.shape[1]))
    nj = out.shape[2] - 1
    for spacing, j in zip(spacings, (0, -1), strict=True):
        fill_arc_spacing(*np.ascontiguousarray(boundary[:, :, j]), spacing)
    low_spacing = spacings[0, 1:-1, None]
    change = (spacings[1] - spacings[0])[1:-1, None]
    position = low_spacing + change * (np.arange(1, nj) / nj)
    near_side = out[:, :1, 1:-1]
    far_side = out[:, -1:, 1:-1]
    out[:, 1:-1, 1:-1] = near_side + position * (far_side - near_side)


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
    # lines j = const: shapes of j_min and j_max, mixed, turned and stretched between i_min and
    # i_max (R4.15)
    if share_i > 0.0:
        line = np.empty((2, ni + 1))
        low = np.empty((2, ni + 1))
        high = np.empty((2, ni + 1))
        for j, shape in ((0, low), (nj, high)):
            for i in range(ni + 1):
                line[0, i] = x[i, j]
                line[1, i] = y[i, j]
            fill_shape(line[0], line[1], shape)
        for i in range(ni + 1):
            for j in range(nj + 1):
                v = j / nj
                along = (1.0 - v) * low[0, i] + v * high[0, i]
                across = (1.0 - v) * low[1, i] + v * high[1, i]
                chord_x, chord_y = x[ni, j] - x[0, j], y[ni, j] - y[0, j]
                curve[0, i, j] += share_i * (x[0, j] + (along * chord_x - across * chord_y))
                curve[1, i, j] += share_i * (y[0, j] + (along * chord_y + across * chord_x))
    # lines i = const likewise
    if share_j > 0.0:
        low, high = np.empty((2, nj + 1)), np.empty((2, nj + 1))
        fill_shape(x[0], y[0], low)
        fill_shape(x[ni], y[ni], high)
        for i in range(ni + 1):
            u = i / ni
            chord_x, chord_y = x[i, nj] - x[i, 0], y[i, nj] - y[i, 0]
            for j in range(nj + 1):
                along = (1.0 - u) * low[0, j] + u * high[0, j]
                across = (1.0 - u) * low[1, j] + u * high[1, j]
                curve[0, i, j] += share_j * (x[i, 0] + (along * chord_x - across * chord_y))
                curve[1, i, j] += share_j * (y[i, 0] + (along * chord_y + across * chord_x))


@kernel(allocates=False)
def load_curve_edges(curve, i, low, count, row_x, row_y, Z):
    """Load the edges along i of `curve` that lead to its row i [m] into two rows of `Z`.

    Of `count` columns from `low` on.
    """
    x0, y0 = curve[0, i - 1, low : low + count], curve[1, i - 1, low : low + count]
    x1, y1 = curve[0, i, low : low + count], curve[1, i, low : low + count]
    for col in range(count):
        Z[row_x + col] = x1[col] - x0[col]
        Z[row_y + col] = y1[col] - y0[col]


@kernel(allocates=False)
def subtract_curve_sides(curve, i, low, cells, rows, Z):
    """Subtract the edges along j of row i of `curve`, weighted, from two rows of `Z`.

    `rows`: where the row of the weights and those of x and y begin.
    """
    weight_row, row_x, row_y = rows
    x, y = curve[0, i, low : low + cells + 1], curve[1, i, low : low + cells + 1]
    for col in range(cells):
        q = Z[weight_row + col]
        Z[row_x + col] -= q * (x[col + 1] - x[col])
        Z[row_y + col] -= q * (y[col + 1] - y[col])


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
        old_areas = compute_corner_areas(previous)
        new_areas = compute_corner_areas(nodes)
        sign = 1.0 if old_areas.sum() >= 0.0 else -1.0
        exempt = [corner for corner in BLOCK_CORNERS if not sign * new_areas[corner] > 0.0]
        for corner in exempt:
            old_areas[corner] = new_areas[corner] = sign
        bad_cells = np.argwhere(~(sign * new_areas > 0.0).all(axis=0))
        if len(bad_cells) or not np.isfinite(nodes).all():
            also = f"cells {name_cells(bad_cells)} of the {self.start} grid are not convex"
            raise explain_failure(boundary, nodes[:: int(sign)], also=also, grid=nodes)
        ratio = float((new_areas / old_areas).min())
        return RegridResult(
            nodes,
            RegridReport(least_corner_ratio=ratio, start=self.start, exempt_corners=len(exempt)),
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
    """Transfinite interpolation of the boundary's nodes, blended by the sides' own spacing.

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
