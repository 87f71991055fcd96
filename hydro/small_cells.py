"""Small cells: which cells limit the time step, and state redistribution for the smallest ones.

The rate of a cell is the reciprocal of the time in which waves cross it (theory F7.1).  The largest
rate limits the step.  Where a few cells are squeezed far more than all others of their block, the
step is that of cells no flatter than those others, and the squeezed cells use state redistribution.
Hot cells that are not squeezed limit the step as usual.

The neighbourhood of a squeezed cell extends across its short direction and has as many cells on
either side as make it large enough for the step.  A cell belongs to every neighbourhood that
contains it, including its own, with equal parts of its volume.  Each neighbourhood takes the mean
of its parts and a limited slope; the new state of a cell is the mean of the values of its
neighbourhoods there [BergerGiuliani2021].  The change in the step is redistributed in full, the
state itself by the fraction RELAXED_FRACTION: redistributing all of it in every step would smear
features along the short direction.  The fluxes are those of the scheme, and totals are conserved to
round-off.  Theory F7.4.

Notes: sums run outwards from a cell in pairs, so that a mirrored block gives bitwise mirrored
results.  The update may leave a small cell in a state that is not admissible, so only conserved
quantities per volume are used of it.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.crowding import (
    SIZE_BINS,
    SQUEEZED_CROWDING_RATIO,
    find_most_crowded_of_bands,
    scan_rates,
    scan_rates_of_bands,
    scan_state,
)
from shockgrid.hydro.eos.conversion import has_voids, make_conversion
from shockgrid.hydro.formulas.geometry import Geometry
from shockgrid.hydro.formulas.strength import add_shear_wave
from shockgrid.hydro.interior.solid import NO_SHEAR
from shockgrid.hydro.interior.update import compute_rate
from shockgrid.hydro.perimeter.faces import measure_lines, measure_volume
from shockgrid.hydro.ranks.blocks import Blocks
from shockgrid.hydro.ranks.cutting import Rows
from shockgrid.hydro.rim import find_excess
from shockgrid.hydro.strength.rates import PLASTIC_STRAIN
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import compiled_once, kernel

MOST_REACH = 6  # cells of a neighbourhood on either side of its own cell
# fraction of a state redistributed per step, besides all of the step's change
RELAXED_FRACTION = 0.1
# A cell's record is a pair of arrays.  `amounts` (4, quantities, ni, nj) has four groups of
# conserved quantities per volume (mass, momentum x and y, energy, mass times each carried field):
# what the cell redistributes, mean and slope of its neighbourhood, what it keeps.
REDISTRIBUTED, MEAN, SLOPE, KEPT = range(4)
RECORD_GROUPS = 4
FLOW_QUANTITIES = 4
# `sizes` (3, ni, nj): position of that mean along the line, volume, in how many neighbourhoods it
# is
MEAN_POSITION, VOLUME, MEMBERSHIPS = range(3)
SIZE_ROWS = 3
RATE_MARGIN = 1.0 + 1e-9  # a rate must exceed a limit by more than round-off
TOUCHED_REACH = MOST_REACH + 1  # rows beyond a squeezed cell that its redistribution reads


@compiled_once(allocates=False)
def compute_distance(nodes, i, j, far_i, far_j):
    """Distance between the centres of two cells."""
    x = 0.25 * (
        (nodes[0, far_i, far_j] - nodes[0, i, j])
        + (nodes[0, far_i + 1, far_j + 1] - nodes[0, i + 1, j + 1])
        + ((nodes[0, far_i + 1, far_j] - nodes[0, i + 1, j])
        + (nodes[0, far_i, far_j + 1] - nodes[0, i, j + 1]))
    )  # fmt: skip
    y = 0.25 * (
        (nodes[1, far_i, far_j] - nodes[1, i, j])
        + (nodes[1, far_i + 1, far_j + 1] - nodes[1, i + 1, j + 1])
        + ((nodes[1, far_i + 1, far_j] - nodes[1, i + 1, j])
        + (nodes[1, far_i, far_j + 1] - nodes[1, i, j + 1]))
    )  # fmt: skip
    return (x * x + y * y) ** 0.5


@functools.cache
def make_measures(geometry: Geometry):
    """Two functions of a geometry: volume of a cell, and its ratio to that in straight faces."""
    compute_volume = geometry.volume

    @compiled_once(allocates=False)
    def find_volume(nodes, excess, i, j, ni, nj):
        return measure_volume(nodes, i, j, compute_volume) + find_excess(excess, i, j, ni, nj)

    @compiled_once(allocates=False)
    def find_volume_factor(nodes, excess, i, j, ni, nj):
        beyond = find_excess(excess, i, j, ni, nj)
        return 1.0 + beyond / measure_volume(nodes, i, j, compute_volume) if beyond != 0.0 else 1.0

    return find_volume, find_volume_factor


@functools.cache
def make_fill_reaches(geometry: Geometry):
    """The kernel `fill_reaches` of a geometry."""
    _, find_volume_factor = make_measures(geometry)

    @kernel
    def fill_reaches(squeezed, rates, limit, nodes, excess, reaches):
        """Fill `reaches` (ni, nj): extents of the neighbourhoods of the cells `squeezed` (n, 2).

        excess (faces,): volume of perimeter cells beyond their straight faces.  `reaches` > 0:
        number of cells on either side along i; < 0: along j; 0: no neighbourhood.  Returns the
        largest remaining rate [1/s], above `limit` if MOST_REACH cells are too few.
        """
        ni, nj = rates.shape
        remaining_rate = limit
        for number in range(squeezed.shape[0]):
            i, j = squeezed[number]
            xi, yi, xj, yj, area = measure_lines(nodes, i, j)
            along_i = xi * xi + yi * yi < xj * xj + yj * yj
            area *= find_volume_factor(nodes, excess, i, j, ni, nj)
            needed = area * rates[i, j] / limit
            covered = area
            reach = 0
            # at least one, even if by round-off the cell appears large enough
            while (covered < needed or reach == 0) and reach < MOST_REACH:
                reach += 1
                added = 0.0
                for offset in (-reach, reach):
                    other_i, other_j = (i + offset, j) if along_i else (i, j + offset)
                    if 0 <= other_i < ni and 0 <= other_j < nj:
                        # half of a neighbour's area: the rest may belong to its own neighbourhood
                        other_area = measure_lines(nodes, other_i, other_j)[4]
                        added += (
                            0.5
                            * other_area
                            * find_volume_factor(nodes, excess, other_i, other_j, ni, nj)
                        )
                covered += added
            if covered < needed:
                remaining_rate = max(remaining_rate, area * rates[i, j] / covered)
            reaches[i, j] = reach if along_i else -reach
        return remaining_rate

    return fill_reaches


@compiled_once(allocates=False)
def limit_slope(before, after):
    """The mean of two slopes of equal sign, at most twice the smaller one; otherwise zero."""
    smaller = before if abs(before) < abs(after) else after
    mean = 0.5 * (before + after)
    slope = mean if abs(mean) < 2.0 * abs(smaller) else 2.0 * smaller
    return slope if before * after > 0.0 else 0.0


@functools.cache
def make_redistribution(eos_class, geometry: Geometry):
    """The kernel `redistribute` of an equation of state and a geometry."""
    conversion = make_conversion(eos_class)
    read_cell = conversion.read_cell
    write_cell = conversion.write_cell
    find_volume, find_volume_factor = make_measures(geometry)

    @compiled_once
    def fill_conserved(held, carried, i, j, fraction, parameters, group, amounts):
        """Store a fraction of what a cell holds, per volume, in a group of its record."""
        rho, u, v, total = read_cell(held, i, j, parameters)
        rho *= fraction
        amounts[group, 0, i, j] = rho
        amounts[group, 1, i, j] = rho * u
        amounts[group, 2, i, j] = rho * v
        amounts[group, 3, i, j] = rho * total
        for q in range(carried.shape[0]):
            amounts[group, FLOW_QUANTITIES + q, i, j] = rho * carried[q, i + 1, j + 1]

    @compiled_once
    def mark_neighbourhoods(squeezed, reaches, marks, sizes, touched):
        """List the cells in neighbourhoods (mark 1) and those just beyond their ends (2).

        Fills `marks` (ni, nj), `touched` and, of their sizes, MEMBERSHIPS: in how many
        neighbourhoods a cell is, its own among them.
        """
        ni, nj = marks.shape
        for number in range(squeezed.shape[0]):
            i, j = squeezed[number]
            reach = abs(reaches[i, j])
            along_i = reaches[i, j] > 0
            for offset in range(-reach, reach + 1):
                other_i, other_j = (i + offset, j) if along_i else (i, j + offset)
                if 0 <= other_i < ni and 0 <= other_j < nj:
                    if marks[other_i, other_j] == 0:
                        marks[other_i, other_j] = 1
                        touched.append((other_i, other_j))
                        sizes[MEMBERSHIPS, other_i, other_j] = (
                            1.0 if reaches[other_i, other_j] == 0 else 0.0
                        )
                    sizes[MEMBERSHIPS, other_i, other_j] += 1.0
        for number in range(squeezed.shape[0]):
            # a cell beyond either end of a neighbourhood determines its slope
            i, j = squeezed[number]
            beyond = abs(reaches[i, j]) + 1
            along_i = reaches[i, j] > 0
            for offset in (-beyond, beyond):
                other_i, other_j = (i + offset, j) if along_i else (i, j + offset)
                if 0 <= other_i < ni and 0 <= other_j < nj and marks[other_i, other_j] == 0:
                    marks[other_i, other_j] = 2
                    touched.append((other_i, other_j))
                    sizes[MEMBERSHIPS, other_i, other_j] = 1.0

    @compiled_once
    def fill_means(squeezed, reaches, nodes, record):
        """Mean of each neighbourhood and its position along the line."""
        amounts, sizes = record
        ni, nj = reaches.shape
        total = np.empty(amounts.shape[1])
        for number in range(squeezed.shape[0]):
            i, j = squeezed[number]
            along_i = reaches[i, j] > 0
            volume = sizes[VOLUME, i, j] / sizes[MEMBERSHIPS, i, j]
            moment = 0.0
            for q in range(amounts.shape[1]):
                total[q] = volume * amounts[REDISTRIBUTED, q, i, j]
            for offset in range(1, abs(reaches[i, j]) + 1):
                volume_before = volume_after = distance_before = distance_after = 0.0
                row, column = (i - offset, j) if along_i else (i, j - offset)
                i_before = max(row, 0)
                j_before = max(column, 0)
                if row == i_before and column == j_before:
                    volume_before = (
                        sizes[VOLUME, i_before, j_before] / sizes[MEMBERSHIPS, i_before, j_before]
                    )
                    distance_before = compute_distance(nodes, i, j, i_before, j_before)
                row, column = (i + offset, j) if along_i else (i, j + offset)
                i_after = min(row, ni - 1)
                j_after = min(column, nj - 1)
                if row == i_after and column == j_after:
                    volume_after = (
                        sizes[VOLUME, i_after, j_after] / sizes[MEMBERSHIPS, i_after, j_after]
                    )
                    distance_after = compute_distance(nodes, i, j, i_after, j_after)
                # if a side has no such cell its weight is zero
                volume += volume_before + volume_after
                moment += volume_after * distance_after - volume_before * distance_before
                for q in range(amounts.shape[1]):
                    total[q] += (
                        volume_before * amounts[REDISTRIBUTED, q, i_before, j_before]
                        if volume_before > 0.0
                        else 0.0
                    ) + (
                        volume_after * amounts[REDISTRIBUTED, q, i_after, j_after]
                        if volume_after > 0.0
                        else 0.0
                    )
            for q in range(amounts.shape[1]):
                amounts[MEAN, q, i, j] = total[q] / volume
            sizes[MEAN_POSITION, i, j] = moment / volume

    @compiled_once
    def fill_neighbourhood_slopes(squeezed, reaches, nodes, record):
        """Slope of each neighbourhood, from the means beyond its ends."""
        amounts, sizes = record
        ni, nj = reaches.shape
        slopes_before = np.zeros(amounts.shape[1])
        slopes_after = np.zeros(amounts.shape[1])
        for number in range(squeezed.shape[0]):
            i, j = squeezed[number]
            offset = abs(reaches[i, j]) + 1
            along_i = reaches[i, j] > 0
            i_before, j_before = (i - offset, j) if along_i else (i, j - offset)
            i_after, j_after = (i + offset, j) if along_i else (i, j + offset)
            has_before, has_after = i_before >= 0 and j_before >= 0, i_after < ni and j_after < nj
            position = sizes[MEAN_POSITION, i, j]
            inverse_before = inverse_after = 1.0
            if has_before:
                position_beyond = (
                    sizes[MEAN_POSITION, i_before, j_before]
                    if (reaches[i_before, j_before] > 0) == along_i
                    else 0.0
                )
                distance = compute_distance(nodes, i, j, i_before, j_before)
                gap = position + distance - position_beyond
                # neighbourhoods whose means nearly coincide determine no slope
                inverse_before = 1.0 / gap if gap > 0.5 * distance else 0.0
            if has_after:
                position_beyond = (
                    sizes[MEAN_POSITION, i_after, j_after]
                    if (reaches[i_after, j_after] > 0) == along_i
                    else 0.0
                )
                distance = compute_distance(nodes, i, j, i_after, j_after)
                gap = distance + position_beyond - position
                inverse_after = 1.0 / gap if gap > 0.5 * distance else 0.0
            for q in range(amounts.shape[1]):
                mean = amounts[MEAN, q, i, j]
                step_before = (
                    (mean - amounts[MEAN, q, i_before, j_before]) * inverse_before
                    if has_before
                    else 0.0
                )
                step_after = (
                    (amounts[MEAN, q, i_after, j_after] - mean) * inverse_after
                    if has_after
                    else 0.0
                )
                slopes_before[q] = step_before if has_before else step_after
                slopes_after[q] = step_after if has_after else step_before
            # momentum along the line and across it, so that slopes are rotation invariant
            xi, yi, xj, yj, _ = measure_lines(nodes, i, j)
            along_x, along_y = (xi, yi) if along_i else (xj, yj)
            length = (along_x * along_x + along_y * along_y) ** 0.5
            along_x, along_y = along_x / length, along_y / length
            along = limit_slope(
                along_x * slopes_before[1] + along_y * slopes_before[2],
                along_x * slopes_after[1] + along_y * slopes_after[2],
            )
            across = limit_slope(
                along_x * slopes_before[2] - along_y * slopes_before[1],
                along_x * slopes_after[2] - along_y * slopes_after[1],
            )
            amounts[SLOPE, 0, i, j] = limit_slope(slopes_before[0], slopes_after[0])
            amounts[SLOPE, 1, i, j] = along_x * along - along_y * across
            amounts[SLOPE, 2, i, j] = along_y * along + along_x * across
            for q in range(3, slopes_before.size):
                amounts[SLOPE, q, i, j] = limit_slope(slopes_before[q], slopes_after[q])

    @compiled_once
    def gather_shares(i, j, reaches, nodes, record, sums):
        """Sum into `sums[0]` the values that a cell's neighbourhoods give for it."""
        amounts, sizes = record
        total = sums[0]
        line = sums[1]
        pair = sums[2]
        ni, nj = reaches.shape
        total[:] = 0.0
        for along_i in (True, False):
            line[:] = 0.0
            for offset in range(1, MOST_REACH + 1):
                pair[:] = 0.0
                for shift in (-offset, offset):
                    other_i, other_j = (i + shift, j) if along_i else (i, j + shift)
                    if not (0 <= other_i < ni and 0 <= other_j < nj):
                        continue
                    reach = reaches[other_i, other_j] if along_i else -reaches[other_i, other_j]
                    if reach < offset:
                        continue
                    distance = compute_distance(nodes, i, j, other_i, other_j)
                    # the other cell's neighbourhood is on that side: this cell precedes it
                    distance = (-distance if shift > 0 else distance) - sizes[
                        MEAN_POSITION, other_i, other_j
                    ]
                    for q in range(amounts.shape[1]):
                        pair[q] += (
                            amounts[MEAN, q, other_i, other_j]
                            + amounts[SLOPE, q, other_i, other_j] * distance
                        )
                for q in range(amounts.shape[1]):
                    line[q] += pair[q]
            for q in range(amounts.shape[1]):
                total[q] += line[q]
        distance = -sizes[MEAN_POSITION, i, j]
        inverse_count = 1.0 / sizes[MEMBERSHIPS, i, j]
        for q in range(amounts.shape[1]):
            own_value = amounts[MEAN, q, i, j] + amounts[SLOPE, q, i, j] * distance
            total[q] = (total[q] + own_value) * inverse_count + amounts[KEPT, q, i, j]

    @kernel
    def redistribute(squeezed, grids, excess, inverse_dt, materials, before, after, scratch):
        """State redistribution of cells `small` (n, 2) over neighbourhoods `reaches` (ni, nj).

        squeezed: (small, reaches); grids: nodes (2, ni + 1, nj + 1) before and after the step;
        excess (faces,): volume of perimeter cells beyond their straight faces; materials:
        parameters, and the shear modulus of a solid (ni, nj), else (1, 1); before: the arrays
        of HELD_ARRAYS that the step started from, and carried fields (n, ni + 2, nj + 2); after:
        these and rates (ni, nj), updated in place; scratch: marks (ni, nj), zero on entry and exit,
        and the records of all cells, amounts (4, 4 + n, ni, nj) and sizes (3, ni, nj).  Returns the
        number of changed cells, their least c², and the increase in the number of cells with voids.
        """
        small, reaches = squeezed
        nodes, nodes_new = grids
        marks, record = scratch
        amounts, sizes = record
        held_before, carried_before = before
        held, carried, rates = after
        parameters, shear = materials
        is_solid = shear.shape[0] > 1
        ni, nj = rates.shape
        # the cells concerned, and what each gives and keeps of its conserved quantities
        touched = [(0, 0)]
        touched.clear()
        mark_neighbourhoods(small, reaches, marks, sizes, touched)
        voided = 0
        for i, j in touched:
            voided -= 1 if marks[i, j] == 1 and has_voids(held, i, j) else 0
            fill_conserved(held, carried, i, j, 1.0, parameters, REDISTRIBUTED, amounts)
            kept = 1.0 - RELAXED_FRACTION
            fill_conserved(held_before, carried_before, i, j, kept, parameters, KEPT, amounts)
            sizes[VOLUME, i, j] = find_volume(nodes_new, excess, i, j, ni, nj)
            sizes[MEAN_POSITION, i, j] = 0.0
            for q in range(amounts.shape[1]):
                amounts[REDISTRIBUTED, q, i, j] -= amounts[KEPT, q, i, j]
                amounts[MEAN, q, i, j] = amounts[REDISTRIBUTED, q, i, j]
                amounts[SLOPE, q, i, j] = 0.0
        # means and slopes of the neighbourhoods (theory F7.4)
        fill_means(small, reaches, nodes_new, record)
        fill_neighbourhood_slopes(small, reaches, nodes_new, record)
        least_c2 = 1e300
        changed = 0
        sums = np.empty((3, amounts.shape[1]))
        total = sums[0]
        # each cell's new state, from the neighbourhoods that contain it
        for i, j in touched:
            if marks[i, j] == 2:
                continue
            changed += 1
            gather_shares(i, j, reaches, nodes_new, record, sums)
            rho = total[0]
            u = total[1] / rho
            v = total[2] / rho
            is_voided, c2 = write_cell(held, i, j, rho, u, v, total[3] / rho, parameters)
            for q in range(carried.shape[0]):
                carried[q, i + 1, j + 1] = total[FLOW_QUANTITIES + q] / rho
            if is_solid and is_voided:  # what is torn bears nothing
                carried[:PLASTIC_STRAIN, i + 1, j + 1] = 0.0
            voided += 1 if is_voided else 0
            c2 = c2 if (rho > 0.0) & (c2 > 0.0) else -1.0
            least_c2 = min(least_c2, c2)
            # its rate, relative to its own mean velocity (theory F7.1)
            xi, yi, xj, yj, area = measure_lines(nodes_new, i, j)
            w_x = w_y = 0.0
            for a, b in ((0, 1), (1, 0)):
                w_x += (nodes_new[0, i + a, j + a] - nodes[0, i + a, j + a]) + (
                    nodes_new[0, i + a, j + b] - nodes[0, i + a, j + b]
                )
                w_y += (nodes_new[1, i + a, j + a] - nodes[1, i + a, j + a]) + (
                    nodes_new[1, i + a, j + b] - nodes[1, i + a, j + b]
                )
            u -= 0.25 * w_x * inverse_dt
            v -= 0.25 * w_y * inverse_dt
            area *= find_volume_factor(nodes_new, excess, i, j, ni, nj)
            c2 = max(c2, 0.0)
            if is_solid:
                c2 = add_shear_wave(c2, shear[i, j], rho)
            rates[i, j], _ = compute_rate(u, v, c2, xi, yi, xj, yj, 1.0 / area)
        # the marks are zero again, as the next call expects them
        for i, j in touched:
            marks[i, j] = 0
        return changed, least_c2, voided

    return redistribute


class Fastest(NamedTuple):
    """The cell with the largest rate [1/s] of a flow: its block and indices."""

    rate: float
    block: int
    i: int
    j: int


class BlockRedistribution:
    """State redistribution in one block, with arrays allocated when first needed."""

    def __init__(self, block: Block):
        self.block = block
        self.reaches: np.ndarray | None = None

    def _find_squeezed(self, limit: float, rows: Rows) -> np.ndarray:
        """The cells (n, 2) of these rows whose rate is above `limit`."""
        places = np.flatnonzero(self.block.rates[slice(*rows)] > limit)
        squeezed = np.empty((places.size, 2), dtype=np.int64)
        np.divmod(places, self.block.nj, out=(squeezed[:, 0], squeezed[:, 1]))
        squeezed[:, 0] += rows[0]
        if len(squeezed) and self.reaches is None:
            block = self.block
            self.reaches = np.zeros((block.ni, block.nj), dtype=np.int64)
            self.marks = np.zeros((block.ni, block.nj), dtype=np.int64)
            quantities = FLOW_QUANTITIES + len(block.carried_fields)
            amounts = np.zeros((RECORD_GROUPS, quantities, block.ni, block.nj))
            self.record = amounts, np.zeros((SIZE_ROWS, block.ni, block.nj))
            self.fill_reaches = make_fill_reaches(block.geometry)
            self.redistribute = make_redistribution(type(block.eos), block.geometry)
        return squeezed

    def _clear_reaches(self, squeezed: np.ndarray) -> None:
        """Make `reaches` zero again, as they are between two uses, at the cells `squeezed` (n,
        2)."""
        self.reaches[squeezed[:, 0], squeezed[:, 1]] = 0

    def find_remaining_rate(self, limit: float, rows: Rows) -> float:
        """The largest rate of these rows if all cells above `limit` are redistributed.

        0 if `rows` is empty, as it is in a cut block where no rank has a cell above `limit`.
        """
        squeezed = self._find_squeezed(limit, rows)
        rates = self.block.rates
        if len(squeezed) == 0:
            return float(rates[slice(*rows)].max(initial=0.0))
        block = self.block
        remaining_rate = self.fill_reaches(
            squeezed, rates, limit, block.nodes, block.excess_volume_new, self.reaches
        )
        self._clear_reaches(squeezed)
        return remaining_rate

    def redistribute_rows(self, limit: float, inverse_dt: float, rows: Rows) -> int:
        """Redistribute the new state at too small cells of these rows; returns how many changed."""
        block = self.block
        squeezed = self._find_squeezed(limit, rows)
        if len(squeezed) == 0:
            return 0
        self.fill_reaches(
            squeezed, block.rates, limit, block.nodes, block.excess_volume, self.reaches
        )
        shear = NO_SHEAR if block.stress is None else block.stress.arrays.shear
        block.redistributed_cells, least_c2, voided = self.redistribute(
            (squeezed, self.reaches), (block.nodes, block.nodes_new), block.excess_volume_new,
            inverse_dt, (block.parameters, shear),
            (tuple(block.list_starts()), block.get_start("carried")),
            (tuple(block.list_new()), block.carried_new, block.rates_new),
            (self.marks, self.record),
        )  # fmt: skip
        block.totals.add_redistributed(least_c2, voided)
        self._clear_reaches(squeezed)
        return block.redistributed_cells


class SmallCells:
    """Small cells of all blocks; `share`: the fraction of a block's cells that may be too small.

    Before the time `start` [s] no cell counts as too small: those that are finer until then are
    wanted.
    """

    def __init__(self, blocks: Blocks, share: float, start: float = 0.0):
        if not 0.0 <= share <= 0.1:
            raise BadInput(f"small_cells = {share:g}; it must be between 0 and 0.1")
        self.redistributions = [BlockRedistribution(block) for block in blocks]
        self.blocks = blocks
        self.scanned: Sequence[Sequence[Any]] = []  # of all blocks, by `scan`
        self.allowed = float(share)
        self.start = start
        self.part = 0.0  # `allowed`, or 0 before `start`: by `set_time`
        self.counts = np.zeros(SIZE_BINS, dtype=np.int64)
        self.kept = np.empty(max(block.ni * block.nj for block in blocks))
        self.changed = 0
        self.fastest = Fastest(0.0, 0, 0, 0)

    def set_time(self, t: float) -> None:
        """Allow the fraction `allowed` of small cells from the time `start` on, none before it."""
        self.part = self.allowed if t >= self.start else 0.0

    def find_first_rate(self, t: float) -> float:
        """`find_rate` of states given at t [s]; all blocks must be on this rank and updated."""
        self.set_time(t)
        self.scanned = [self.scan(number)[:-1] for number in range(len(self.redistributions))]
        return self.find_rate()

    def find_rate(self) -> float:
        """The rate [1/s] that sets the next step, from the results of `scan`; theory F7.3."""
        fastest = Fastest(-1.0, 0, 0, 0)
        limit = -1.0
        for number, (rate, i, j, bulk) in enumerate(self.scanned):
            limit = max(limit, bulk)
            if rate > fastest.rate:
                fastest = Fastest(rate, number, int(i), int(j))
        self.fastest = fastest
        if fastest.rate <= limit * RATE_MARGIN:
            return fastest.rate
        above = self._find_rows_above(limit)
        for number, cut in self.blocks.cuts.items():
            cut.gather_rows(cut.block.rates, above[number])
        remaining_rates = [
            [self.redistributions[number].find_remaining_rate(limit, above[number])]
            for number in self.blocks.own
        ]
        return max(rate for (rate,) in self.blocks.exchange_rows(remaining_rates, 1))

    def scan(self, number: int) -> tuple[float, int, int, float, bool]:
        """`scan_state` of a block, collectively with its other ranks if it is cut."""
        block = self.redistributions[number].block
        cut = self.blocks.cuts.get(number)
        if cut is None:
            fastest_cells = scan_state.entry(
                block.totals.rows, block.totals.array, block.rates_new, block.crowding, self.part,
                self.counts, self.kept,
            )  # fmt: skip
            block.totals.read_array()
            return fastest_cells
        most_crowded = np.inf
        if self.part > 0.0:
            options = self.part, SQUEEZED_CROWDING_RATIO, self.counts, self.kept
            most_crowded = find_most_crowded_of_bands(cut, *options)
        return (*scan_rates_of_bands(cut, most_crowded), block.totals.sum_up())

    def _find_rows_above(self, limit: float) -> dict[int, Rows]:
        """The rows of each block on this rank to be searched for rates above `limit`."""
        cuts = self.blocks.cuts
        return {
            number: cuts[number].find_rows_above(limit, TOUCHED_REACH)
            if number in cuts
            else (first, last)
            for number, first, last in self.blocks.pieces
        }

    def find_fastest(self) -> None:
        """Find the fastest cell again, for a restored state."""
        fastest_cells = [
            scan_rates(s.block.rates, s.block.crowding, np.inf) for s in self.redistributions
        ]
        number = max(range(len(fastest_cells)), key=lambda n: fastest_cells[n][0])
        self.fastest = Fastest(fastest_cells[number][0], number, *fastest_cells[number][1:3])

    def redistribute_states(self, rate: float, dt: float) -> None:
        """Redistribute the new states of cells above `rate`, for which `dt` is stable."""
        self.changed = 0
        for redistribution in self.redistributions:
            # what is there is of the last step, or of this one before a retry
            redistribution.block.redistributed_cells = 0
        if self.fastest.rate <= rate * RATE_MARGIN:
            return
        limit = rate * RATE_MARGIN
        above = self._find_rows_above(limit)
        for number, cut in self.blocks.cuts.items():
            block = cut.block
            for array in (
                *list_redistributed_arrays(block),
                block.rates,
                *block.list_starts(block.held_arrays),
            ):
                cut.gather_rows(array, above[number])
        changed = [
            [self.redistributions[number].redistribute_rows(limit, 1.0 / dt, above[number])]
            for number in self.blocks.own
        ]
        for number, cut in self.blocks.cuts.items():
            for array in list_redistributed_arrays(cut.block):
                cut.return_rows(array, above[number])
        self.changed = sum(int(count) for (count,) in self.blocks.exchange_rows(changed, 1))


def list_redistributed_arrays(block: Block) -> tuple[np.ndarray, ...]:
    """The arrays that redistribution changes."""
    return *block.list_new(block.held_arrays), block.rates_new
