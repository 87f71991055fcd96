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
    U_GHOST,
    V_GHOST,
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
# rows of `metrics`: weights of the differences along both lines, vectors along these, 1/area
# between them, ways from the centre to the four corners
WEIGHT_BEFORE, WEIGHT_AFTER, WEIGHT_BELOW, WEIGHT_ABOVE = range(4)
LINE_I_X, LINE_I_Y, LINE_J_X, LINE_J_Y, INVERSE_AREA = range(4, 9)
CORNER_X = 9
CORNER_Y = 13
# axisymmetric solids: vectors between the middles of opposite faces
MIDDLE_I_X, MIDDLE_I_Y, MIDDLE_J_X, MIDDLE_J_Y = range(17, 21)
METRIC_ROWS = 21

NO_SIDES = np.zeros((0, 3), dtype=np.int64)  # stands for the open sides of a block
NO_RATES = np.zeros((1, 1, 1))  # stands for the rates of a fluid


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
def make_predict(
    geometry: Geometry, limit: Callable = limit_van_leer, fill_rates: Callable | None = None
):
    """Kernel that fills the slopes of carried fields, of a geometry and a limiter's formula.

    fill_rates: of a solid, formula (`hydro.strength.rates.make_fill_rates`) that fills the rates of
    strain of a cell on the way, as the weights of differences are there.
    """
    curved = geometry.curved
    is_solid = fill_rates is not None
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

    @inlined
    def weigh_cell(nodes, i, j, measures, centres, metrics):
        """What all fields of a cell have in common, into column j of `metrics`."""
        corners = find_corners(nodes, i, j)
        a, b, c, d = corners
        line_i, line_j, area = compute_line_geometry(a, b, c, d)
        inverse = 1.0 / area
        if curved:
            if is_solid:
                metrics[MIDDLE_I_X, j], metrics[MIDDLE_I_Y, j] = line_i
                metrics[MIDDLE_J_X, j], metrics[MIDDLE_J_Y, j] = line_j
            twist, y = find_twist(a, b, c, d)
            line_i, line_j = lean_lines(line_i, line_j, twist, y)
            inverse = 1.0 / (line_i[0] * line_j[1] - line_i[1] * line_j[0])
        cell = i + 1, j + 1
        metrics[WEIGHT_BEFORE, j], metrics[WEIGHT_AFTER, j] = compute_difference_weights(
            measures, LENGTH_I, cell, (i, j + 1), (i + 2, j + 1)
        )
        metrics[WEIGHT_BELOW, j], metrics[WEIGHT_ABOVE, j] = compute_difference_weights(
            measures, LENGTH_J, cell, (i + 1, j), (i + 1, j + 2)
        )
        metrics[LINE_I_X, j], metrics[LINE_I_Y, j] = line_i
        metrics[LINE_J_X, j], metrics[LINE_J_Y, j] = line_j
        metrics[INVERSE_AREA, j] = inverse
        x = centres[0, i, j]
        y = centres[1, i, j]
        metrics[CORNER_X, j] = a[0] - x
        metrics[CORNER_X + 1, j] = b[0] - x
        metrics[CORNER_X + 2, j] = c[0] - x
        metrics[CORNER_X + 3, j] = d[0] - x
        metrics[CORNER_Y, j] = a[1] - y
        metrics[CORNER_Y + 1, j] = b[1] - y
        metrics[CORNER_Y + 2, j] = c[1] - y
        metrics[CORNER_Y + 3, j] = d[1] - y

    @inlined
    def fill_slope(field, state, i, j, half_dt, metrics, slopes):
        """Bounded slopes of a field in a cell, and its value there at mid-time."""
        value = field[i + 1, j + 1]
        before = field[i, j + 1]
        after = field[i + 2, j + 1]
        below = field[i + 1, j]
        above = field[i + 1, j + 2]
        along_i = limit(
            (value - before) * metrics[WEIGHT_BEFORE, j], (after - value) * metrics[WEIGHT_AFTER, j]
        )
        along_j = limit(
            (value - below) * metrics[WEIGHT_BELOW, j], (above - value) * metrics[WEIGHT_ABOVE, j]
        )
        slope_x, slope_y = compute_gradient(
            along_i,
            along_j,
            (metrics[LINE_I_X, j], metrics[LINE_I_Y, j]),
            (metrics[LINE_J_X, j], metrics[LINE_J_Y, j]),
            metrics[INVERSE_AREA, j],
        )
        # nowhere in the cell beyond the values around
        lowest = min(value, min(min(before, after), min(below, above)))
        highest = max(value, max(max(before, after), max(below, above)))
        slope_fraction = 1.0
        for corner in range(4):
            change = (
                slope_x * metrics[CORNER_X + corner, j] + slope_y * metrics[CORNER_Y + corner, j]
            )
            slope_fraction = min(slope_fraction, bound(change, value, lowest, highest))
        slope_x *= slope_fraction
        slope_y *= slope_fraction
        along_flow = state[U, i + 1, j + 1] * slope_x + state[V, i + 1, j + 1] * slope_y
        slopes[AT_CENTRE, i, j] = value - half_dt * along_flow
        slopes[SLOPE_X, i, j] = slope_x
        slopes[SLOPE_Y, i, j] = slope_y

    @compiled_once(allocates=False)
    def weigh_row(nodes, i, measures, centres, metrics):
        """`weigh_cell` of the cells of a row."""
        for j in range(centres.shape[2]):
            weigh_cell(nodes, i, j, measures, centres, metrics)

    @compiled_once(allocates=False)
    def fill_row(field, state, i, half_dt, metrics, slopes):
        """`fill_slope` of the cells of a row."""
        for j in range(slopes.shape[2]):
            fill_slope(field, state, i, j, half_dt, metrics, slopes)

    @compiled_once(allocates=False)
    def fill_rates_of_row(state, i, metrics, centres, rates):
        """`fill_rates` of the cells of a row."""
        for j in range(centres.shape[2]):
            fill_rates(state, i, j, metrics, centres, rates)

    @kernel(allocates=False)
    def predict(values, state, nodes, rim, half_dt, rows, scratch, rates):
        """Slopes (n, 3, ni, nj) of fields (n, ni + 2, nj + 2) in the cells that a step reads.

        These are the rows first..last - 1 of cells of `rows`, one more on either side, and the
        cells along all sides.  scratch: measures (4, ni + 2, nj + 2), centres (2, ni, nj), the
        slopes, and metrics (METRIC_ROWS, nj) of a row of cells, which are filled; rates: of a
        solid, likewise.
        """
        measures, centres, slopes, metrics = scratch
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
        for q in range(values.shape[0]):
            place_ghosts(rim, find_carried_row(q) + CARRIED_GHOST, values[q])
        if is_solid:
            place_ghosts(rim, U_GHOST, state[U])
            place_ghosts(rim, V_GHOST, state[V])
        # slopes row by row, all fields of each
        for i in range(ni):
            if low <= i < high or i == 0 or i == ni - 1:
                weigh_row(nodes, i, measures, centres, metrics)
                for q in range(values.shape[0]):
                    fill_row(values[q], state, i, half_dt, metrics, slopes[q])
                if is_solid:
                    fill_rates_of_row(state, i, metrics, centres, rates)
                continue
            for j in (0, nj - 1):
                weigh_cell(nodes, i, j, measures, centres, metrics)
                for q in range(values.shape[0]):
                    fill_slope(values[q], state, i, j, half_dt, metrics, slopes[q])
                if is_solid:
                    fill_rates(state, i, j, metrics, centres, rates)

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
    def fill_middles_i(grids, i, middles):
        """Middles (2, nj) of the faces between the rows of cells i - 1 and i."""
        for j in range(grids[0].shape[2] - 1):
            middles[0, j], middles[1, j] = find_middle(grids, i, j, i, j + 1)

    @compiled_once(allocates=False)
    def fill_middles_j(grids, i, middles):
        """Middles (2, nj + 1) of the faces between the cells of a row."""
        for j in range(grids[0].shape[2]):
            middles[0, j], middles[1, j] = find_middle(grids, i + 1, j, i, j)

    @compiled_once(allocates=False)
    def fill_faces_i(slopes, centres, mass_i, i, middles, faces):
        """Values (nj,) at the faces between the rows of cells i - 1 and i, not along the sides."""
        for j in range(centres.shape[2]):
            before = find_value(slopes, centres, i - 1, j, middles[0, j], middles[1, j])
            after = find_value(slopes, centres, i, j, middles[0, j], middles[1, j])
            faces[j] = before if mass_i[i, j] > 0.0 else after

    @compiled_once(allocates=False)
    def fill_faces_j(slopes, centres, mass_j, i, middles, faces):
        """Values (nj + 1,) at the faces between the cells of a row; none along the sides."""
        for k in range(centres.shape[2] - 1):
            x = middles[0, k + 1]
            y = middles[1, k + 1]
            before = find_value(slopes, centres, i, k, x, y)
            after = find_value(slopes, centres, i, k + 1, x, y)
            faces[k + 1] = before if mass_j[i, k + 1] > 0.0 else after

    @compiled_once(allocates=False)
    def gather_changes(field, i, masses, faces, changes):
        """Rates of mass times what is carried beyond the cell's value, out of the cells of a row.

        faces: values at the faces of the row, those along the sides apart: there nothing passes.
        """
        mass_i, mass_j = masses
        low, high, face_j = faces
        for j in range(changes.shape[0]):
            value = field[i + 1, j + 1]
            before = mass_i[i, j] * (low[j] - value)
            after = mass_i[i + 1, j] * (high[j] - value)
            below = mass_j[i, j] * (face_j[j] - value)
            above = mass_j[i, j + 1] * (face_j[j + 1] - value)
            changes[j] = (after - before) + (above - below)

    @inlined
    def find_change(value, i, j, masses, faces, sides):
        """The same of a cell along the sides; sides: what the rim has of these (rim, row)."""
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

    @compiled_once(allocates=False)
    def fill_masses(state, nodes, excess, masses, i, dt, left):
        """Masses (nj,) that are left in the cells of a row."""
        mass_i, mass_j = masses
        ni = mass_i.shape[0] - 1
        nj = left.shape[0]
        for j in range(nj):
            volume = measure_volume(nodes, i, j, weigh_volume)
            leaving = (mass_i[i + 1, j] - mass_i[i, j]) + (mass_j[i, j + 1] - mass_j[i, j])
            left[j] = volume * state[RHO, i + 1, j + 1] - dt * leaving
        step = 1 if i == 0 or i == ni - 1 else nj - 1
        for j in range(0, nj, step):
            left[j] += find_excess(excess, i, j, ni, nj) * state[RHO, i + 1, j + 1]

    @compiled_once(allocates=False)
    def keep_changes(old, changes, left, dt, i, new):
        """New values of the cells of a row."""
        for j in range(left.shape[0]):
            new[i + 1, j + 1] = old[i + 1, j + 1] - dt * changes[j] / left[j]

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
        mass_i, mass_j = masses
        slopes, centres = scratch
        first, last = rows
        ni = centres.shape[1]
        nj = centres.shape[2]
        middles_i = np.empty((2, nj))
        middles_j = np.empty((2, nj + 1))
        lows = np.zeros((old.shape[0], nj))
        highs = np.zeros((old.shape[0], nj))
        face_j = np.zeros(nj + 1)
        left = np.empty(nj)
        changes = np.empty(nj)
        for i in range(first - 1, last):
            # the faces towards +i of the row before are those towards -i of this one
            lows, highs = highs, lows
            if 0 <= i < ni - 1:
                fill_middles_i(grids, i + 1, middles_i)
                for q in range(old.shape[0]):
                    fill_faces_i(slopes[q], centres, mass_i, i + 1, middles_i, highs[q])
            if i < first:
                continue
            fill_middles_j(grids, i, middles_j)
            fill_masses(state, grids[0], excess, masses, i, dt, left)
            for q in range(old.shape[0]):
                fill_faces_j(slopes[q], centres, mass_j, i, middles_j, face_j)
                faces = lows[q], highs[q], face_j
                gather_changes(old[q], i, masses, faces, changes)
                row = find_carried_row(q)
                step = 1 if i == 0 or i == ni - 1 else nj - 1
                for j in range(0, nj, step):
                    value = old[q, i + 1, j + 1]
                    changes[j] = find_change(value, i, j, masses, faces, (rim, row))
                keep_changes(old[q], changes, left, dt, i, new[q])

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
        self.metrics = np.zeros((METRIC_ROWS, nj))

    def gather(self, block: Any) -> None:
        """Phase 2, before the couplings fill what is beyond the sides: see `gather`."""
        gather(block.get_start("carried"), block.rim.rows)

    def predict(
        self,
        block: Any,
        half_dt: float,
        fill_rates: Callable | None = None,
        rates: np.ndarray = NO_RATES,
    ) -> None:
        """Phase 2, after the couplings: slopes and values at mid-time; rates of a solid."""
        predict = make_predict(block.geometry, self.limit, fill_rates)
        predict(
            block.get_start("carried"), block.start, block.nodes, block.rim.rows, half_dt,
            (block.rows.start, block.rows.stop),
            (self.measures, self.centres, self.slopes, self.metrics), rates,
        )  # fmt: skip

    def trace(self, block: Any) -> None:
        """Phase 6, with the traces of the sides known, before the couplings' fluxes.

        Of a solid its stress comes before what passes through open sides.
        """
        opened = block.plan.opened if block.stress is None else NO_SIDES
        trace(self.slopes, self.centres, opened, block.rim.rows)

    def carry(self, block: Any, dt: float) -> None:
        """Phase 6, after the flow's update: the new values."""
        carry = make_carry(block.geometry)
        carry(
            (block.get_start("carried"), block.carried_new), block.start,
            (block.nodes, block.nodes_new), (block.rim.rows, block.excess_volume), self.masses, dt,
            (block.rows.start, block.rows.stop), (self.slopes, self.centres),
        )  # fmt: skip
