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
from shockgrid.hydro.interior.update import compute_rate
from shockgrid.hydro.perimeter.faces import measure_lines, measure_volume
from shockgrid.hydro.ranks.blocks import Blocks
from shockgrid.hydro.ranks.cutting import Rows
from shockgrid.hydro.rim import find_excess
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import compiled_once, kernel

MOST_REACH = 6  # cells of a neighbourhood on either side of its own cell
# fraction of a state redistributed per step, besides all of the step's change
RELAXED_FRACTION = 0.1
# A cell's record is a pair of arrays.  `amounts` (4, quantities, ni, nj) has four groups of
# conserved quantities per volume (mass, momentum x and y, energy, mass times each carried field):
# what the cell redistributes, mean and slope of its neighbourhood, what it keeps.
GIVEN, MEAN, SLOPE, KEPT = range(4)
RECORD_GROUPS = 4
FLOW_QUANTITIES = 4
# `sizes` (3, ni, nj): position of that mean along the line, volume, number of its neighbourhoods
LEVER, VOLUME, PARTS = range(3)
SIZE_ROWS = 3


@compiled_once(allocates=False)
def find_way(nodes, i, j, far_i, far_j):
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
    weigh = geometry.volume

    @compiled_once(allocates=False)
    def find_volume(nodes, excess, i, j, ni, nj):
        return measure_volume(nodes, i, j, weigh) + find_excess(excess, i, j, ni, nj)

    @compiled_once(allocates=False)
    def find_volume_factor(nodes, excess, i, j, ni, nj):
        beyond = find_excess(excess, i, j, ni, nj)
        return 1.0 + beyond / measure_volume(nodes, i, j, weigh) if beyond != 0.0 else 1.0

    return find_volume, find_volume_factor


@functools.cache
def make_fill_reaches(geometry: Geometry):
    """The kernel `fill_reaches` of a geometry."""
    _, find_volume_factor = make_measures(geometry)

    @kernel
    def fill_reaches(small, rates, limit, nodes, excess, reaches):
        """Fill `reaches` (ni, nj): extents of the neighbourhoods of the cells `small` (n, 2).

        excess (faces,): volume of perimeter cells beyond their straight faces.  `reaches` > 0:
        number of cells on either side along i; < 0: along j; 0: no neighbourhood.  Returns the
        largest remaining rate [1/s], above `limit` if MOST_REACH cells are too few.
        """
        ni, nj = rates.shape
        left = limit
        for n in range(small.shape[0]):
            i, j = small[n]
            xi, yi, xj, yj, own = measure_lines(nodes, i, j)
            along_i = xi * xi + yi * yi < xj * xj + yj * yj
            own *= find_volume_factor(nodes, excess, i, j, ni, nj)
            need = own * rates[i, j] / limit
            held = own
            reach = 0
            # at least one, even if by round-off the cell appears large enough
            while (held < need or reach == 0) and reach < MOST_REACH:
                reach += 1
                pair = 0.0
                for way in (-reach, reach):
                    p, q = (i + way, j) if along_i else (i, j + way)
                    if 0 <= p < ni and 0 <= q < nj:
                        # half of a neighbour's area: the rest may belong to its own neighbourhood
                        area = measure_lines(nodes, p, q)[4]
                        pair += 0.5 * area * find_volume_factor(nodes, excess, p, q, ni, nj)
                held += pair
            if held < need:
                left = max(left, own * rates[i, j] / held)
            reaches[i, j] = reach if along_i else -reach
        return left

    return fill_reaches


@compiled_once(allocates=False)
def limit_slope(before, after):
    """The mean of two slopes of equal sign, at most twice the smaller one; otherwise zero."""
    least = before if abs(before) < abs(after) else after
    mean = 0.5 * (before + after)
    slope = mean if abs(mean) < 2.0 * abs(least) else 2.0 * least
    return slope if before * after > 0.0 else 0.0


@functools.cache
def make_redistribution(eos_class, geometry: Geometry):
    """The kernel `redistribute` of an equation of state and a geometry."""
    conversion = make_conversion(eos_class)
    read_cell = conversion.read_cell
    write_cell = conversion.write_cell
    find_volume, find_volume_factor = make_measures(geometry)

    @compiled_once
    def fill_conserved(held, carried, i, j, part, parameters, group, amounts):
        """Store a fraction of what a cell holds, per volume, in a group of its record."""
        rho, u, v, total = read_cell(held, i, j, parameters)
        rho *= part
        amounts[group, 0, i, j] = rho
        amounts[group, 1, i, j] = rho * u
        amounts[group, 2, i, j] = rho * v
        amounts[group, 3, i, j] = rho * total
        for q in range(carried.shape[0]):
            amounts[group, FLOW_QUANTITIES + q, i, j] = rho * carried[q, i + 1, j + 1]

    @compiled_once
    def mark_neighbourhoods(small, reaches, marks, sizes, touched):
        """List the cells in neighbourhoods (mark 1) and those just beyond their ends (2).

        Fills `marks` (ni, nj), `touched` and, of their sizes, PARTS: in how many neighbourhoods a
        cell is, its own among them.
        """
        ni, nj = marks.shape
        for n in range(small.shape[0]):
            i, j = small[n]
            reach = abs(reaches[i, j])
            along_i = reaches[i, j] > 0
            for way in range(-reach, reach + 1):
                a, b = (i + way, j) if along_i else (i, j + way)
                if 0 <= a < ni and 0 <= b < nj:
                    if marks[a, b] == 0:
                        marks[a, b] = 1
                        touched.append((a, b))
                        sizes[PARTS, a, b] = 1.0 if reaches[a, b] == 0 else 0.0
                    sizes[PARTS, a, b] += 1.0
        for n in range(small.shape[0]):
            # a cell beyond either end of a neighbourhood determines its slope
            i, j = small[n]
            beyond = abs(reaches[i, j]) + 1
            along_i = reaches[i, j] > 0
            for way in (-beyond, beyond):
                a, b = (i + way, j) if along_i else (i, j + way)
                if 0 <= a < ni and 0 <= b < nj and marks[a, b] == 0:
                    marks[a, b] = 2
                    touched.append((a, b))
                    sizes[PARTS, a, b] = 1.0

    @compiled_once
    def fill_means(small, reaches, nodes, record):
        """Mean of each neighbourhood and its position along the line."""
        amounts, sizes = record
        ni, nj = reaches.shape
        total = np.empty(amounts.shape[1])
        for n in range(small.shape[0]):
            i, j = small[n]
            along_i = reaches[i, j] > 0
            volume = sizes[VOLUME, i, j] / sizes[PARTS, i, j]
            lever = 0.0
            for q in range(amounts.shape[1]):
                total[q] = volume * amounts[GIVEN, q, i, j]
            for way in range(1, abs(reaches[i, j]) + 1):
                v1 = v2 = d1 = d2 = 0.0
                row, column = (i - way, j) if along_i else (i, j - way)
                a = max(row, 0)
                b = max(column, 0)
                if row == a and column == b:
                    v1 = sizes[VOLUME, a, b] / sizes[PARTS, a, b]
                    d1 = find_way(nodes, i, j, a, b)
                row, column = (i + way, j) if along_i else (i, j + way)
                c = min(row, ni - 1)
                d = min(column, nj - 1)
                if row == c and column == d:
                    v2 = sizes[VOLUME, c, d] / sizes[PARTS, c, d]
                    d2 = find_way(nodes, i, j, c, d)
                # if a side has no such cell its weight is zero
                volume += v1 + v2
                lever += v2 * d2 - v1 * d1
                for q in range(amounts.shape[1]):
                    total[q] += (v1 * amounts[GIVEN, q, a, b] if v1 > 0.0 else 0.0) + (
                        v2 * amounts[GIVEN, q, c, d] if v2 > 0.0 else 0.0
                    )
            for q in range(amounts.shape[1]):
                amounts[MEAN, q, i, j] = total[q] / volume
            sizes[LEVER, i, j] = lever / volume

    @compiled_once
    def fill_slopes(small, reaches, nodes, record):
        """Slope of each neighbourhood, from the means beyond its ends."""
        amounts, sizes = record
        ni, nj = reaches.shape
        ones = np.zeros(amounts.shape[1])
        twos = np.zeros(amounts.shape[1])
        for n in range(small.shape[0]):
            i, j = small[n]
            way = abs(reaches[i, j]) + 1
            along_i = reaches[i, j] > 0
            a, b = (i - way, j) if along_i else (i, j - way)
            c, d = (i + way, j) if along_i else (i, j + way)
            low, high = a >= 0 and b >= 0, c < ni and d < nj
            here = sizes[LEVER, i, j]
            before = after = 1.0
            if low:
                turn = sizes[LEVER, a, b] if (reaches[a, b] > 0) == along_i else 0.0
                far = find_way(nodes, i, j, a, b)
                gap = here + far - turn
                # neighbourhoods whose means nearly coincide determine no slope
                before = 1.0 / gap if gap > 0.5 * far else 0.0
            if high:
                turn = sizes[LEVER, c, d] if (reaches[c, d] > 0) == along_i else 0.0
                far = find_way(nodes, i, j, c, d)
                gap = far + turn - here
                after = 1.0 / gap if gap > 0.5 * far else 0.0
            for q in range(amounts.shape[1]):
                mean = amounts[MEAN, q, i, j]
                one = (mean - amounts[MEAN, q, a, b]) * before if low else 0.0
                two = (amounts[MEAN, q, c, d] - mean) * after if high else 0.0
                ones[q] = one if low else two
                twos[q] = two if high else one
            # momentum along the line and across it, so that slopes are rotation invariant
            xi, yi, xj, yj, _ = measure_lines(nodes, i, j)
            x, y = (xi, yi) if along_i else (xj, yj)
            length = (x * x + y * y) ** 0.5
            x, y = x / length, y / length
            along = limit_slope(x * ones[1] + y * ones[2], x * twos[1] + y * twos[2])
            across = limit_slope(x * ones[2] - y * ones[1], x * twos[2] - y * twos[1])
            amounts[SLOPE, 0, i, j] = limit_slope(ones[0], twos[0])
            amounts[SLOPE, 1, i, j] = x * along - y * across
            amounts[SLOPE, 2, i, j] = y * along + x * across
            for q in range(3, ones.size):
                amounts[SLOPE, q, i, j] = limit_slope(ones[q], twos[q])

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
            for way in range(1, MOST_REACH + 1):
                pair[:] = 0.0
                for side in (-way, way):
                    a, b = (i + side, j) if along_i else (i, j + side)
                    if not (0 <= a < ni and 0 <= b < nj):
                        continue
                    reach = reaches[a, b] if along_i else -reaches[a, b]
                    if reach < way:
                        continue
                    far = find_way(nodes, i, j, a, b)
                    # the other cell's neighbourhood is on that side: this cell precedes it
                    far = (-far if side > 0 else far) - sizes[LEVER, a, b]
                    for q in range(amounts.shape[1]):
                        pair[q] += amounts[MEAN, q, a, b] + amounts[SLOPE, q, a, b] * far
                for q in range(amounts.shape[1]):
                    line[q] += pair[q]
            for q in range(amounts.shape[1]):
                total[q] += line[q]
        far = -sizes[LEVER, i, j]
        part = 1.0 / sizes[PARTS, i, j]
        for q in range(amounts.shape[1]):
            own = amounts[MEAN, q, i, j] + amounts[SLOPE, q, i, j] * far
            total[q] = (total[q] + own) * part + amounts[KEPT, q, i, j]

    @kernel
    def redistribute(squeezed, grids, excess, inverse_dt, parameters, before, after, scratch):
        """State redistribution of cells `small` (n, 2) over neighbourhoods `reaches` (ni, nj).

        squeezed: (small, reaches); grids: nodes (2, ni + 1, nj + 1) before and after the step;
        excess (faces,): volume of perimeter cells beyond their straight faces; before: the arrays
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
        ni, nj = rates.shape
        # the cells concerned, and what each gives and keeps of its conserved quantities
        touched = [(0, 0)]
        touched.clear()
        mark_neighbourhoods(small, reaches, marks, sizes, touched)
        voided = 0
        for i, j in touched:
            voided -= 1 if marks[i, j] == 1 and has_voids(held, i, j) else 0
            fill_conserved(held, carried, i, j, 1.0, parameters, GIVEN, amounts)
            kept = 1.0 - RELAXED_FRACTION
            fill_conserved(held_before, carried_before, i, j, kept, parameters, KEPT, amounts)
            sizes[VOLUME, i, j] = find_volume(nodes_new, excess, i, j, ni, nj)
            sizes[LEVER, i, j] = 0.0
            for q in range(amounts.shape[1]):
                amounts[GIVEN, q, i, j] -= amounts[KEPT, q, i, j]
                amounts[MEAN, q, i, j] = amounts[GIVEN, q, i, j]
                amounts[SLOPE, q, i, j] = 0.0
        # means and slopes of the neighbourhoods (theory F7.4)
        fill_means(small, reaches, nodes_new, record)
        fill_slopes(small, reaches, nodes_new, record)
        least = 1e300
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
            voided += 1 if is_voided else 0
            c2 = c2 if (rho > 0.0) & (c2 > 0.0) else -1.0
            least = min(least, c2)
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
            rates[i, j], _ = compute_rate(u, v, max(c2, 0.0), xi, yi, xj, yj, 1.0 / area)
        # the scratch as it was
        for i, j in touched:
            marks[i, j] = 0
        return changed, least, voided

    return redistribute


RATE_MARGIN = 1.0 + 1e-9  # a rate must exceed a limit by more than round-off
TOUCHED_REACH = MOST_REACH + 1  # rows beyond a squeezed cell that its redistribution reads


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

    def _find_small(self, limit: float, rows: Rows) -> np.ndarray:
        """The cells (n, 2) of these rows whose rate is above `limit`."""
        found = np.flatnonzero(self.block.rates[slice(*rows)] > limit)
        small = np.empty((found.size, 2), dtype=np.int64)
        np.divmod(found, self.block.nj, out=(small[:, 0], small[:, 1]))
        small[:, 0] += rows[0]
        if len(small) and self.reaches is None:
            block = self.block
            self.reaches = np.zeros((block.ni, block.nj), dtype=np.int64)
            self.marks = np.zeros((block.ni, block.nj), dtype=np.int64)
            quantities = FLOW_QUANTITIES + len(block.carried_fields)
            amounts = np.zeros((RECORD_GROUPS, quantities, block.ni, block.nj))
            self.record = amounts, np.zeros((SIZE_ROWS, block.ni, block.nj))
            self.fill_reaches = make_fill_reaches(block.geometry)
            self.redistribute = make_redistribution(type(block.eos), block.geometry)
        return small

    def _clear_reaches(self, small: np.ndarray) -> None:
        """Make `reaches` zero again, as they are between two uses, at the cells `small` (n, 2)."""
        self.reaches[small[:, 0], small[:, 1]] = 0

    def find_rate_left(self, limit: float, rows: Rows) -> float:
        """The largest rate of these rows if all cells above `limit` are redistributed.

        0 without rows: a part of a cut block has none if no cell is above.
        """
        small = self._find_small(limit, rows)
        rates = self.block.rates
        if len(small) == 0:
            return float(rates[slice(*rows)].max(initial=0.0))
        block = self.block
        left = self.fill_reaches(
            small, rates, limit, block.nodes, block.excess_volume_new, self.reaches
        )
        self._clear_reaches(small)
        return left

    def redistribute_rows(self, limit: float, inverse_dt: float, rows: Rows) -> int:
        """Redistribute the new state at too small cells of these rows; returns how many changed."""
        block = self.block
        small = self._find_small(limit, rows)
        if len(small) == 0:
            return 0
        self.fill_reaches(small, block.rates, limit, block.nodes, block.excess_volume, self.reaches)
        block.redistributed_cells, least, voided = self.redistribute(
            (small, self.reaches), (block.nodes, block.nodes_new), block.excess_volume_new,
            inverse_dt, block.parameters, (tuple(block.list_starts()), block.get_start("carried")),
            (tuple(block.list_new()), block.carried_new, block.rates_new),
            (self.marks, self.record),
        )  # fmt: skip
        block.totals.add_redistributed(least, voided)
        self._clear_reaches(small)
        return block.redistributed_cells


class SmallCells:
    """Small cells of all blocks; `share`: the fraction of a block's cells that may be too small.

    Before the time `start` [s] no cell is: those that are finer then are meant to be.
    """

    def __init__(self, blocks: Blocks, share: float, start: float = 0.0):
        if not 0.0 <= share <= 0.1:
            raise BadInput(f"small_cells = {share:g}; it must be between 0 and 0.1")
        self.redistributions = [BlockRedistribution(block) for block in blocks]
        self.blocks = blocks
        self.scanned: Sequence[Sequence[Any]] = []  # of all blocks, by `scan`
        self.allowed = float(share)
        self.start = start
        self.part = 0.0  # of `allowed`, by `set_time`
        self.counts = np.zeros(SIZE_BINS, dtype=np.int64)
        self.kept = np.empty(max(block.ni * block.nj for block in blocks))
        self.changed = 0
        self.fastest = Fastest(0.0, 0, 0, 0)

    def set_time(self, t: float) -> None:
        """May cells be too small at t [s]?"""
        self.part = self.allowed if t >= self.start else 0.0

    def find_first_rate(self, t: float) -> float:
        """`find_rate` of states given at t [s]; all blocks must be on this rank and updated."""
        self.set_time(t)
        self.scanned = [self.scan(number)[:-1] for number in range(len(self.redistributions))]
        return self.find_rate()

    def find_rate(self) -> float:
        """The rate [1/s] that sets the next step, from the results of `scan`; theory F7.3."""
        most = Fastest(-1.0, 0, 0, 0)
        limit = -1.0
        for number, (rate, i, j, bulk) in enumerate(self.scanned):
            limit = max(limit, bulk)
            if rate > most.rate:
                most = Fastest(rate, number, int(i), int(j))
        self.fastest = most
        if most.rate <= limit * RATE_MARGIN:
            return most.rate
        above = self._find_rows_above(limit)
        for number, cut in self.blocks.cuts.items():
            cut.gather_rows(cut.block.rates, above[number])
        left = [
            [self.redistributions[number].find_rate_left(limit, above[number])]
            for number in self.blocks.own
        ]
        return max(rate for (rate,) in self.blocks.exchange_rows(left, 1))

    def scan(self, number: int) -> tuple[float, int, int, float, bool]:
        """`scan_state` of a block, collectively with its other ranks if it is cut."""
        block = self.redistributions[number].block
        cut = self.blocks.cuts.get(number)
        if cut is None:
            found = scan_state.entry(
                block.totals.rows, block.totals.array, block.rates_new, block.crowding, self.part,
                self.counts, self.kept,
            )  # fmt: skip
            block.totals.read_array()
            return found
        edge = np.inf
        if self.part > 0.0:
            how = self.part, SQUEEZED_CROWDING_RATIO, self.counts, self.kept
            edge = find_most_crowded_of_bands(cut, *how)
        return (*scan_rates_of_bands(cut, edge), block.totals.sum_up())

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
        found = [scan_rates(s.block.rates, s.block.crowding, np.inf) for s in self.redistributions]
        number = max(range(len(found)), key=lambda n: found[n][0])
        self.fastest = Fastest(found[number][0], number, *found[number][1:3])

    def redistribute_states(self, rate: float, dt: float) -> None:
        """Redistribute the new states of cells above `rate`, for which `dt` is stable."""
        self.changed = 0
        for one in self.redistributions:
            one.block.redistributed_cells = 0  # from the last step, or from this one before a retry
        if self.fastest.rate <= rate * RATE_MARGIN:
            return
        limit = rate * RATE_MARGIN
        above = self._find_rows_above(limit)
        for number, cut in self.blocks.cuts.items():
            block = cut.block
            for array in (*_list_mended(block), block.rates, *block.list_starts(block.held_arrays)):
                cut.gather_rows(array, above[number])
        changed = [
            [self.redistributions[number].redistribute_rows(limit, 1.0 / dt, above[number])]
            for number in self.blocks.own
        ]
        for number, cut in self.blocks.cuts.items():
            for array in _list_mended(cut.block):
                cut.return_rows(array, above[number])
        self.changed = sum(int(count) for (count,) in self.blocks.exchange_rows(changed, 1))


def _list_mended(block: Block) -> tuple[np.ndarray, ...]:
    """The arrays that redistribution changes."""
    return *block.list_new(block.held_arrays), block.rates_new
