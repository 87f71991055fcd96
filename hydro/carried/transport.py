"""How carried fields move: with the mass that the flow's own fluxes carry through the faces.

In a step, beside the phases of the flow (`hydro.phases`):

    gather    values of the cells along the sides, which also stand for what is beyond these
    predict   limited slopes of all cells, and their values at mid-time            theory F17.2
    trace     values at the faces of the sides; what passes through open sides
    carry     what the mass brings and takes                                       theory F17.1

Faces take the value of the cell that the mass leaves.  The change of a cell is summed of the
differences between what comes through its faces and what is there, so a constant stays one to the
bit.  Slopes are bounded: at no corner of a cell is its field beyond the values around.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from shockgrid.hydro.formulas.geometry import (
    Geometry,
    compute_centre_offset,
    lean_lines,
    weigh_differences,
)
from shockgrid.hydro.formulas.reconstruction import (
    compute_gradient,
    compute_line_geometry,
    compute_weights,
    limit_van_leer,
)
from shockgrid.hydro.interior.scratch import find_twist
from shockgrid.hydro.perimeter.contacts import carry_fields_through_open_sides
from shockgrid.hydro.perimeter.faces import find_corners, measure_volume
from shockgrid.hydro.rim import (
    CARRIED_CELL,
    CARRIED_FLUX,
    CARRIED_GHOST,
    CARRIED_TRACE,
    LENGTH_GHOST,
    X_TRACE,
    Y_TRACE,
    find_carried_row,
    find_cell_of_face,
    find_excess,
)
from shockgrid.hydro.rows import RHO, U, V
from shockgrid.regrid.jit import compiled_once, inlined, kernel

# rows of `measures`: lengths of cells along both lines, and how far their centres of volume lie
# from their middles along them
LENGTH_I, SHIFT_I, LENGTH_J, SHIFT_J = range(4)
MEASURE_ROWS = 4
# rows of `slopes` of a field: value at mid-time at the cell's centre, gradient
AT_CENTRE, SLOPE_X, SLOPE_Y = range(3)
SLOPE_PARTS = 3


@inlined
def bound(change, value, lowest, highest):
    """The part of a change of `value` that does not lead beyond lowest..highest: at most 1."""
    allowed = highest - value if change > 0.0 else value - lowest
    size = abs(change)
    return allowed / size if size > allowed else 1.0


@kernel(allocates=False)
def gather(values, rim):
    """The fields (n, ni + 2, nj + 2) of the cells along the sides; the same beyond the faces."""
    ni = values.shape[1] - 2
    nj = values.shape[2] - 2
    for q in range(values.shape[0]):
        row = find_carried_row(q)
        for k in range(rim.shape[1]):
            _, i, j = find_cell_of_face(k, ni, nj)
            rim[row + CARRIED_CELL, k] = values[q, i + 1, j + 1]
            rim[row + CARRIED_GHOST, k] = values[q, i + 1, j + 1]


@compiled_once(allocates=False)
def place_ghosts(rim, row, field):
    """Write a row of ghosts of the rim into the layer around a field (ni + 2, nj + 2)."""
    ni = field.shape[0] - 2
    nj = field.shape[1] - 2
    for k in range(nj):
        field[0, k + 1] = rim[row, k]
        field[ni + 1, k + 1] = rim[row, nj + k]
    for k in range(ni):
        field[k + 1, 0] = rim[row, 2 * nj + k]
        field[k + 1, nj + 1] = rim[row, 2 * nj + ni + k]


def make_difference_weights(geometry: Geometry):
    """Formula for the weights of the differences of a cell to those before and after."""
    curved = geometry.curved

    @inlined
    def compute_difference_weights(measures, length, here, before, after):
        """Weights of the differences to the cells before and after; indices (i, j)."""
        shift = length + 1
        if curved:
            return weigh_differences(
                measures[length, before[0], before[1]],
                measures[shift, before[0], before[1]],
                measures[length, here[0], here[1]],
                measures[shift, here[0], here[1]],
                measures[length, after[0], after[1]],
                measures[shift, after[0], after[1]],
            )
        return compute_weights(
            measures[length, before[0], before[1]],
            measures[length, here[0], here[1]],
            measures[length, after[0], after[1]],
        )

    return compute_difference_weights


@functools.cache
def make_predict(geometry: Geometry, limit: Callable = limit_van_leer):
    """Kernel that fills the slopes of carried fields, of a geometry and a limiter's formula."""
    curved = geometry.curved
    compute_difference_weights = make_difference_weights(geometry)

    @compiled_once(allocates=False)
    def measure_cell(nodes, i, j, measures, centres):
        """Lengths, shifts and the centre of a cell."""
        a, b, c, d = find_corners(nodes, i, j)
        mid_i, mid_j, _ = compute_line_geometry(a, b, c, d)
        length_i = (mid_i[0] * mid_i[0] + mid_i[1] * mid_i[1]) ** 0.5
        length_j = (mid_j[0] * mid_j[0] + mid_j[1] * mid_j[1]) ** 0.5
        offset_x = 0.0
        offset_y = 0.0
        if curved:
            twist, y = find_twist(a, b, c, d)
            offset_x, offset_y = compute_centre_offset(mid_i, mid_j, twist, y)
        measures[LENGTH_I, i + 1, j + 1] = length_i
        measures[LENGTH_J, i + 1, j + 1] = length_j
        measures[SHIFT_I, i + 1, j + 1] = (offset_x * mid_i[0] + offset_y * mid_i[1]) / length_i
        measures[SHIFT_J, i + 1, j + 1] = (offset_x * mid_j[0] + offset_y * mid_j[1]) / length_j
        centres[0, i, j] = 0.25 * ((a[0] + c[0]) + (b[0] + d[0])) + offset_x
        centres[1, i, j] = 0.25 * ((a[1] + c[1]) + (b[1] + d[1])) + offset_y

    @compiled_once(allocates=False)
    def fill_slope(field, state, nodes, i, j, half_dt, lines, slopes):
        """Bounded slopes of a field in a cell, and its value there at mid-time.

        lines: what `measure_cell` has filled, measures and centres.
        """
        measures, centres = lines
        a, b, c, d = find_corners(nodes, i, j)
        line_i, line_j, area = compute_line_geometry(a, b, c, d)
        inverse = 1.0 / area
        if curved:
            twist, y = find_twist(a, b, c, d)
            line_i, line_j = lean_lines(line_i, line_j, twist, y)
            inverse = 1.0 / (line_i[0] * line_j[1] - line_i[1] * line_j[0])
        cell = i + 1, j + 1
        value = field[i + 1, j + 1]
        before = field[i, j + 1]
        after = field[i + 2, j + 1]
        below = field[i + 1, j]
        above = field[i + 1, j + 2]
        weight_before, weight_after = compute_difference_weights(
            measures, LENGTH_I, cell, (i, j + 1), (i + 2, j + 1)
        )
        along_i = limit((value - before) * weight_before, (after - value) * weight_after)
        weight_before, weight_after = compute_difference_weights(
            measures, LENGTH_J, cell, (i + 1, j), (i + 1, j + 2)
        )
        along_j = limit((value - below) * weight_before, (above - value) * weight_after)
        slope_x, slope_y = compute_gradient(along_i, along_j, line_i, line_j, inverse)
        # nowhere in the cell beyond the values around
        lowest = min(value, min(min(before, after), min(below, above)))
        highest = max(value, max(max(before, after), max(below, above)))
        x = centres[0, i, j]
        y = centres[1, i, j]
        slope_fraction = 1.0
        for corner in (a, b, c, d):
            change = slope_x * (corner[0] - x) + slope_y * (corner[1] - y)
            slope_fraction = min(slope_fraction, bound(change, value, lowest, highest))
        slope_x *= slope_fraction
        slope_y *= slope_fraction
        along_flow = state[U, i + 1, j + 1] * slope_x + state[V, i + 1, j + 1] * slope_y
        slopes[AT_CENTRE, i, j] = value - half_dt * along_flow
        slopes[SLOPE_X, i, j] = slope_x
        slopes[SLOPE_Y, i, j] = slope_y

    @kernel(allocates=False)
    def predict(values, state, nodes, rim, half_dt, rows, scratch):
        """Slopes (n, 3, ni, nj) of fields (n, ni + 2, nj + 2) in the cells that a step reads.

        These are the rows first..last - 1 of cells of `rows`, one more on either side, and the
        cells along all sides.  scratch: measures (4, ni + 2, nj + 2), centres (2, ni, nj) and the
        slopes, which are filled.
        """
        measures, centres, slopes = scratch
        ni = nodes.shape[1] - 1
        nj = nodes.shape[2] - 1
        # rows whose slopes the step reads: its own and one on either side
        first, last = rows
        low = max(first - 1, 0)
        high = min(last + 1, ni) if last > first else low
        # lengths and centres of these cells, of those along the sides and of their neighbours
        for i in range(ni):
            near = low - 1 <= i < high + 1 and high > low
            near |= i < 2 or i >= ni - 2
            for j in range(nj):
                if near or j < 2 or j >= nj - 2:
                    measure_cell(nodes, i, j, measures, centres)
        # and beyond the sides
        place_ghosts(rim, LENGTH_GHOST, measures[LENGTH_I])
        place_ghosts(rim, LENGTH_GHOST, measures[LENGTH_J])
        # slopes field by field
        for q in range(values.shape[0]):
            place_ghosts(rim, find_carried_row(q) + CARRIED_GHOST, values[q])
            for i in range(ni):
                near = low <= i < high or i == 0 or i == ni - 1
                for j in range(nj):
                    if near or j == 0 or j == nj - 1:
                        fill_slope(
                            values[q],
                            state,
                            nodes,
                            i,
                            j,
                            half_dt,
                            (measures, centres),
                            slopes[q],
                        )

    return predict


@kernel(allocates=False)
def trace(slopes, centres, opened, rim):
    """Values at the faces of the sides; what passes through open sides, and nothing elsewhere yet.

    opened (n, 3): first faces of open sides, those after the last, and the row of the state beyond.
    """
    ni = centres.shape[1]
    nj = centres.shape[2]
    for q in range(slopes.shape[0]):
        row = find_carried_row(q)
        for k in range(rim.shape[1]):
            _, i, j = find_cell_of_face(k, ni, nj)
            rim[row + CARRIED_TRACE, k] = find_value(
                slopes[q], centres, i, j, rim[X_TRACE, k], rim[Y_TRACE, k]
            )
            rim[row + CARRIED_FLUX, k] = 0.0
    carry_fields_through_open_sides(rim, opened)


@inlined
def find_value(slopes, centres, i, j, x, y):
    """The value of a cell's field at mid-time at the point (x, y)."""
    return slopes[AT_CENTRE, i, j] + (
        slopes[SLOPE_X, i, j] * (x - centres[0, i, j])
        + slopes[SLOPE_Y, i, j] * (y - centres[1, i, j])
    )


@functools.cache
def make_carry(geometry: Geometry):
    """Kernel that carries fields over a step, of a geometry."""
    weigh_volume = geometry.volume
    compute_face = geometry.face

    @inlined
    def find_middle(grids, i, j, i_end, j_end):
        """Where the flux goes through the face between two nodes (theory F3.1, F9.2)."""
        nodes, nodes_new = grids
        a = nodes[0, i, j], nodes[1, i, j]
        b = nodes[0, i_end, j_end], nodes[1, i_end, j_end]
        a_new = nodes_new[0, i, j], nodes_new[1, i, j]
        b_new = nodes_new[0, i_end, j_end], nodes_new[1, i_end, j_end]
        _, _, _, x, y = compute_face(a, b, a_new, b_new, 1.0)
        return x, y

    @compiled_once(allocates=False)
    def fill_faces_i(slopes, centres, grids, mass_i, i, faces):
        """Values (nj,) at the faces between the rows of cells i - 1 and i; none along the sides."""
        if i == 0 or i == centres.shape[1]:
            return
        for j in range(centres.shape[2]):
            giver = i - 1 if mass_i[i, j] > 0.0 else i
            x, y = find_middle(grids, i, j, i, j + 1)
            faces[j] = find_value(slopes, centres, giver, j, x, y)

    @compiled_once(allocates=False)
    def fill_faces_j(slopes, centres, grids, mass_j, i, faces):
        """Values (nj + 1,) at the faces between the cells of a row; none along the sides."""
        for j in range(1, centres.shape[2]):
            giver = j - 1 if mass_j[i, j] > 0.0 else j
            x, y = find_middle(grids, i + 1, j, i, j)
            faces[j] = find_value(slopes, centres, i, giver, x, y)

    @compiled_once(allocates=False)
    def find_change(value, i, j, masses, faces, sides):
        """Rate of mass times what is carried beyond `value`, out of a cell.

        masses: rates of mass through both pairs of faces; faces: the values there; sides: what the
        rim has of the faces along the sides (rim, row).
        """
        mass_i, mass_j = masses
        low, high, face_j = faces
        rim, row = sides
        ni = mass_i.shape[0] - 1
        nj = mass_i.shape[1]
        flux = row + CARRIED_FLUX
        before = mass_i[i, j] * (low[j] - value) if i > 0 else -rim[flux, j]
        after = mass_i[i + 1, j] * (high[j] - value) if i < ni - 1 else rim[flux, nj + j]
        below = mass_j[i, j] * (face_j[j] - value) if j > 0 else -rim[flux, 2 * nj + i]
        above = (
            mass_j[i, j + 1] * (face_j[j + 1] - value) if j < nj - 1 else rim[flux, 2 * nj + ni + i]
        )
        return (after - before) + (above - below)

    @kernel
    def carry(values, state, grids, sides, masses, dt, rows, scratch):
        """New values of fields after a step.

        values: old and new fields (n, ni + 2, nj + 2); state (4, ni + 2, nj + 2) at the start;
        grids: nodes (2, ni + 1, nj + 1) before and after; sides: the rim, and volumes (faces,) of
        cells along the sides beyond their straight faces, at the start; masses: rates of mass
        through the faces, (ni + 1, nj) towards +i and (ni, nj + 1) towards +j; rows: the first row
        of cells and the one after the last; scratch: slopes and centres of `predict`.
        """
        old, new = values
        rim, excess = sides
        nodes = grids[0]
        mass_i, mass_j = masses
        slopes, centres = scratch
        first, last = rows
        ni = centres.shape[1]
        nj = centres.shape[2]
        low = np.empty(nj)
        high = np.empty(nj)
        face_j = np.empty(nj + 1)
        for q in range(old.shape[0]):
            row = find_carried_row(q)
            fill_faces_i(slopes[q], centres, grids, mass_i, first, high)
            for i in range(first, last):
                # the faces towards +i of the row before are those towards -i of this one
                low, high = high, low
                fill_faces_i(slopes[q], centres, grids, mass_i, i + 1, high)
                fill_faces_j(slopes[q], centres, grids, mass_j, i, face_j)
                for j in range(nj):
                    volume = measure_volume(nodes, i, j, weigh_volume)
                    volume += find_excess(excess, i, j, ni, nj)
                    leaving = (mass_i[i + 1, j] - mass_i[i, j]) + (mass_j[i, j + 1] - mass_j[i, j])
                    mass = volume * state[RHO, i + 1, j + 1] - dt * leaving
                    value = old[q, i + 1, j + 1]
                    change = find_change(value, i, j, masses, (low, high, face_j), (rim, row))
                    new[q, i + 1, j + 1] = value - dt * change / mass

    return carry


class Transport:
    """The carried fields of a block, and the scratch of the kernels that move them.

    Its phases, in their order, are called where there are fields.

    count: how many fields; masses: rates of mass through the faces, which the flow's update fills,
    (ni + 1, nj) towards +i and (ni, nj + 1) towards +j; without fields (1, 1), and not filled;
    limit: formula of the limiter.
    """

    def __init__(self, count: int, ni: int, nj: int, limit: Callable = limit_van_leer):
        self.count = count
        self.limit = limit
        self.masses = np.zeros((1, 1)), np.zeros((1, 1))
        if count == 0:
            return
        self.masses = np.zeros((ni + 1, nj)), np.zeros((ni, nj + 1))
        self.measures = np.ones((MEASURE_ROWS, ni + 2, nj + 2))
        self.measures[[SHIFT_I, SHIFT_J]] = 0.0
        self.centres = np.zeros((2, ni, nj))
        self.slopes = np.zeros((count, SLOPE_PARTS, ni, nj))

    def gather(self, block: Any) -> None:
        """Phase 2, before the couplings fill what is beyond the sides: see `gather`."""
        gather(block.get_start("carried"), block.rim.rows)

    def predict(self, block: Any, half_dt: float) -> None:
        """Phase 2, after the couplings: slopes and values at mid-time."""
        predict = make_predict(block.geometry, self.limit)
        predict(
            block.get_start("carried"), block.start, block.nodes, block.rim.rows, half_dt,
            (block.rows.start, block.rows.stop), (self.measures, self.centres, self.slopes),
        )  # fmt: skip

    def trace(self, block: Any) -> None:
        """Phase 6, with the traces of the sides known, before the couplings' fluxes."""
        trace(self.slopes, self.centres, block.plan.opened, block.rim.rows)

    def carry(self, block: Any, dt: float) -> None:
        """Phase 6, after the flow's update: the new values."""
        carry = make_carry(block.geometry)
        carry(
            (block.get_start("carried"), block.carried_new), block.start,
            (block.nodes, block.nodes_new), (block.rim.rows, block.excess_volume), self.masses, dt,
            (block.rows.start, block.rows.stop), (self.slopes, self.centres),
        )  # fmt: skip
