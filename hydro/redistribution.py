"""State redistribution: squeezed cells take their new states from neighbourhoods of cells.

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

import numpy as np

from shockgrid.hydro.eos.conversion import has_voids, make_conversion
from shockgrid.hydro.formulas.geometry import Geometry
from shockgrid.hydro.formulas.strength import add_shear_wave
from shockgrid.hydro.interior.update import compute_rate
from shockgrid.hydro.perimeter.faces import measure_lines, measure_volume
from shockgrid.hydro.rim import find_excess
from shockgrid.hydro.rows import NO_C2
from shockgrid.hydro.strength.rates import PLASTIC_STRAIN
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
# `sizes` (3, ni, nj): position of that mean along the line, volume, number of its neighbourhoods
MEAN_POSITION, VOLUME, MEMBERSHIPS = range(3)
SIZE_ROWS = 3
# marks of cells: in a neighbourhood, just beyond the end of one, neither
NOT_TOUCHED, IS_MEMBER, IS_BEYOND = range(3)


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
        """Volume of a cell per depth or radian; excess: as of `redistribute`."""
        return measure_volume(nodes, i, j, compute_volume) + find_excess(excess, i, j, ni, nj)

    @compiled_once(allocates=False)
    def find_volume_factor(nodes, excess, i, j, ni, nj):
        """Volume of a cell over that within straight faces."""
        beyond = find_excess(excess, i, j, ni, nj)
        return 1.0 + beyond / measure_volume(nodes, i, j, compute_volume) if beyond != 0.0 else 1.0

    return find_volume, find_volume_factor


@functools.cache
def make_fill_reaches(geometry: Geometry):
    """The kernel `fill_reaches` of a geometry."""
    _, find_volume_factor = make_measures(geometry)

    @kernel
    def fill_reaches(squeezed, rates, most_rate, nodes, excess, reaches):
        """Fill `reaches` (ni, nj): extents of the neighbourhoods of the cells `squeezed` (n, 2).

        excess (faces,): volume of perimeter cells beyond their straight faces.  `reaches` > 0:
        number of cells on either side along i; < 0: along j; 0: no neighbourhood.  Returns the
        largest rate that is left [1/s]: above `most_rate` if MOST_REACH cells are too few.
        """
        ni, nj = rates.shape
        remaining_rate = most_rate
        for number in range(squeezed.shape[0]):
            i, j = squeezed[number]
            xi, yi, xj, yj, area = measure_lines(nodes, i, j)
            along_i = xi * xi + yi * yi < xj * xj + yj * yj
            area *= find_volume_factor(nodes, excess, i, j, ni, nj)
            needed = area * rates[i, j] / most_rate
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


@compiled_once
def mark_neighbourhoods(squeezed, reaches, marks, sizes, touched):
    """List the cells in neighbourhoods (IS_MEMBER) and those just beyond their ends (IS_BEYOND).

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
                if marks[other_i, other_j] == NOT_TOUCHED:
                    marks[other_i, other_j] = IS_MEMBER
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
            if 0 <= other_i < ni and 0 <= other_j < nj and marks[other_i, other_j] == NOT_TOUCHED:
                marks[other_i, other_j] = IS_BEYOND
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
                (amounts[MEAN, q, i_after, j_after] - mean) * inverse_after if has_after else 0.0
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


@compiled_once(allocates=False)
def sum_displacements(nodes, nodes_new, i, j):
    """Sum of the displacements of a cell's four nodes in the step, x and y [m]."""
    moved_x = moved_y = 0.0
    for a, b in ((0, 1), (1, 0)):
        moved_x += (nodes_new[0, i + a, j + a] - nodes[0, i + a, j + a]) + (
            nodes_new[0, i + a, j + b] - nodes[0, i + a, j + b]
        )
        moved_y += (nodes_new[1, i + a, j + a] - nodes[1, i + a, j + a]) + (
            nodes_new[1, i + a, j + b] - nodes[1, i + a, j + b]
        )
    return moved_x, moved_y


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

    @kernel
    def redistribute(neighbourhoods, grids, excess, inverse_dt, materials, before, after, scratch):
        """Redistribute the new states of squeezed cells over their neighbourhoods; theory F7.4.

        neighbourhoods: the squeezed cells (n, 2), and `reaches` (ni, nj) of `fill_reaches`; grids:
        nodes (2, ni + 1, nj + 1) before and after the step; excess (faces,): volume of perimeter
        cells beyond their straight faces; inverse_dt [1/s]; materials: parameters of the equation
        of state, and the shear modulus of a solid (ni, nj), else (1, 1).

        before: the arrays of HELD_ARRAYS with which the step began, and carried fields (n, ni + 2,
        nj + 2); after: the same after the step, and the rates of cells (ni, nj) [1/s], all changed
        in place; scratch: marks (ni, nj), NOT_TOUCHED before and after, and the records of cells,
        `amounts` (4, 4 + n, ni, nj) and `sizes` (3, ni, nj).

        Returns how many cells have changed, their least c² [m²/s²], -1 where one is no state of the
        material, and by how many there are more cells with voids.
        """
        squeezed, reaches = neighbourhoods
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
        mark_neighbourhoods(squeezed, reaches, marks, sizes, touched)
        voided = 0
        for i, j in touched:
            voided -= 1 if marks[i, j] == IS_MEMBER and has_voids(held, i, j) else 0
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
        fill_means(squeezed, reaches, nodes_new, record)
        fill_neighbourhood_slopes(squeezed, reaches, nodes_new, record)
        least_c2 = NO_C2
        changed = 0
        sums = np.empty((3, amounts.shape[1]))
        total = sums[0]
        # each cell's new state, from the neighbourhoods that contain it
        for i, j in touched:
            if marks[i, j] == IS_BEYOND:
                continue
            changed += 1
            gather_shares(i, j, reaches, nodes_new, record, sums)
            rho = total[0]
            u = total[1] / rho
            v = total[2] / rho
            is_voided, c2 = write_cell(held, i, j, rho, u, v, total[3] / rho, parameters)
            for q in range(carried.shape[0]):
                carried[q, i + 1, j + 1] = total[FLOW_QUANTITIES + q] / rho
            if is_solid and is_voided:  # what has failed bears nothing
                carried[:PLASTIC_STRAIN, i + 1, j + 1] = 0.0
            voided += 1 if is_voided else 0
            c2 = c2 if (rho > 0.0) & (c2 > 0.0) else -1.0
            least_c2 = min(least_c2, c2)
            # its rate, relative to its own mean velocity (theory F7.1)
            xi, yi, xj, yj, area = measure_lines(nodes_new, i, j)
            moved_x, moved_y = sum_displacements(nodes, nodes_new, i, j)
            u -= 0.25 * moved_x * inverse_dt
            v -= 0.25 * moved_y * inverse_dt
            area *= find_volume_factor(nodes_new, excess, i, j, ni, nj)
            c2 = max(c2, 0.0)
            if is_solid:
                c2 = add_shear_wave(c2, shear[i, j], rho)
            rates[i, j], _ = compute_rate(u, v, c2, xi, yi, xj, yj, 1.0 / area)
        # the marks are zero again, as the next call expects them
        for i, j in touched:
            marks[i, j] = NOT_TOUCHED
        return changed, least_c2, voided

    return redistribute
