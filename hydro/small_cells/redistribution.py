"""State redistribution: cells too small for a step share their new states with neighbours.

Every such cell gathers a neighbourhood over its short direction, as many cells on either side as
make it large enough for the step.  A cell belongs to every neighbourhood that reaches it, its own
included, with equal parts of its volume; each neighbourhood takes the mean of its parts and lays a
limited slope through it; each cell is the mean of what its neighbourhoods say there
[BergerGiuliani2021].  What is shared is what the step has changed, and RELAXED of the state itself:
sharing all of it in every step would smear what lies along the short direction.  The fluxes are
those of the scheme, and sums are kept to round-off.  Theory F7.4.

Notes: sums run from a cell outwards in pairs, so that a mirrored block keeps its bits; what the
update has made of a small cell may be no state of the material, and only conserved quantities
per volume are taken from it.
"""

from __future__ import annotations

import functools

import numpy as np

from hydro.eos.base import make_least_pressure
from hydro.formulas.geometry import Geometry
from hydro.interior.update import compute_rate
from hydro.perimeter.faces import measure_lines, measure_volume
from hydro.rim import find_excess
from hydro.rows import RHO, P, U, V
from regrid.jit import compiled_once, kernel

MOST_REACH = 6  # cells of a neighbourhood on either side of its own cell
CONSERVED_ROWS = 4  # per volume: mass, momentum x and y, energy
RELAXED = 0.1  # of a state is shared in a step, besides all that the step has changed
# rows of a cell's record: what it shares per volume, the mean and slope of its neighbourhood, where
# that mean lies along the line, volume, neighbourhoods that it belongs to, what it keeps per volume
MEAN, SLOPE, LEVER, VOLUME, PARTS = 4, 8, 12, 13, 14
KEPT = 15
RECORD_ROWS = 19


@compiled_once(allocates=False)
def find_way(nodes, i, j, far_i, far_j):
    """Distance between the middles of two cells."""
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
    """Two functions of a geometry: a cell's volume in all, and over that in its straight faces."""
    weigh = geometry.volume

    @compiled_once(allocates=False)
    def find_volume(nodes, excess, i, j, ni, nj):
        return measure_volume(nodes, i, j, weigh) + find_excess(excess, i, j, ni, nj)

    @compiled_once(allocates=False)
    def find_share(nodes, excess, i, j, ni, nj):
        beyond = find_excess(excess, i, j, ni, nj)
        return 1.0 + beyond / measure_volume(nodes, i, j, weigh) if beyond != 0.0 else 1.0

    return find_volume, find_share


@functools.cache
def make_fill_reaches(geometry: Geometry):
    """The kernel `fill_reaches` of a geometry."""
    _, find_share = make_measures(geometry)

    @kernel
    def fill_reaches(small, rates, limit, nodes, excess, reaches):
        """How far the neighbourhoods of the cells `small` (n, 2) go, into `reaches` (ni, nj).

        excess (faces,): volume of perimeter cells beyond their straight faces.  `reaches` > 0: so
        many cells on either side along i; < 0: along j; 0: no neighbourhood.  Returns the largest
        rate that is left [1/s]; above `limit` where MOST_REACH cells are too few.
        """
        ni, nj = rates.shape
        left = limit
        for n in range(small.shape[0]):
            i, j = small[n]
            xi, yi, xj, yj, own = measure_lines(nodes, i, j)
            along_i = xi * xi + yi * yi < xj * xj + yj * yj
            own *= find_share(nodes, excess, i, j, ni, nj)
            need = own * rates[i, j] / limit
            held = own
            reach = 0
            # at least one, though round-off may say that the cell is large enough
            while (held < need or reach == 0) and reach < MOST_REACH:
                reach += 1
                pair = 0.0
                for way in (-reach, reach):
                    p, q = (i + way, j) if along_i else (i, j + way)
                    if 0 <= p < ni and 0 <= q < nj:
                        # half of a neighbour's area: it may count for its own neighbourhood as well
                        area = measure_lines(nodes, p, q)[4]
                        pair += 0.5 * area * find_share(nodes, excess, p, q, ni, nj)
                held += pair
            if held < need:
                left = max(left, own * rates[i, j] / held)
            reaches[i, j] = reach if along_i else -reach
        return left

    return fill_reaches


@compiled_once(allocates=False)
def limit_slope(before, after):
    """The mean of two slopes of one sign, at most twice the lesser of them; else none."""
    least = before if abs(before) < abs(after) else after
    mean = 0.5 * (before + after)
    slope = mean if abs(mean) < 2.0 * abs(least) else 2.0 * least
    return slope if before * after > 0.0 else 0.0


@functools.cache
def make_redistribution(eos_class, geometry: Geometry):
    """The kernel `redistribute` of an equation of state and a geometry."""
    pressure_part, energy_part = eos_class.pressure_part, eos_class.energy_part
    sound_speed_squared_part = eos_class.sound_speed_squared_part
    find_least_pressure = make_least_pressure(eos_class)
    find_volume, find_share = make_measures(geometry)

    @compiled_once
    def fill_conserved(state, void_energy, i, j, part, parameters, first, record):
        """A part of a cell's state per volume into four rows of its record."""
        rho, u = state[RHO, i + 1, j + 1], state[U, i + 1, j + 1]
        v, p = state[V, i + 1, j + 1], state[P, i + 1, j + 1]
        e = energy_part(rho, p, parameters) + void_energy[i, j]
        rho *= part
        record[first, i, j], record[first + 1, i, j] = rho, rho * u
        record[first + 2, i, j] = rho * v
        record[first + 3, i, j] = rho * (e + 0.5 * (u * u + v * v))

    @compiled_once
    def mark_neighbourhoods(small, reaches, marks, record, touched):
        """List the cells that neighbourhoods reach (mark 1), and those beyond their ends (2)."""
        ni, nj = marks.shape
        for n in range(small.shape[0]):
            i, j = small[n]
            reach, along_i = abs(reaches[i, j]), reaches[i, j] > 0
            for way in range(-reach, reach + 1):
                a, b = (i + way, j) if along_i else (i, j + way)
                if 0 <= a < ni and 0 <= b < nj:
                    if marks[a, b] == 0:
                        marks[a, b] = 1
                        touched.append((a, b))
                        record[PARTS, a, b] = 1.0 if reaches[a, b] == 0 else 0.0
                    record[PARTS, a, b] += 1.0
        for n in range(small.shape[0]):
            # a cell beyond either end of a neighbourhood tells its slope
            i, j = small[n]
            beyond, along_i = abs(reaches[i, j]) + 1, reaches[i, j] > 0
            for way in (-beyond, beyond):
                a, b = (i + way, j) if along_i else (i, j + way)
                if 0 <= a < ni and 0 <= b < nj and marks[a, b] == 0:
                    marks[a, b] = 2
                    touched.append((a, b))
                    record[PARTS, a, b] = 1.0

    @compiled_once
    def fill_means(small, reaches, nodes, record):
        """Mean of each neighbourhood, and where that lies along its line."""
        ni, nj = reaches.shape
        total = np.empty(CONSERVED_ROWS)
        for n in range(small.shape[0]):
            i, j = small[n]
            along_i = reaches[i, j] > 0
            volume = record[VOLUME, i, j] / record[PARTS, i, j]
            lever = 0.0
            for q in range(CONSERVED_ROWS):
                total[q] = volume * record[q, i, j]
            for way in range(1, abs(reaches[i, j]) + 1):
                v1 = v2 = d1 = d2 = 0.0
                row, column = (i - way, j) if along_i else (i, j - way)
                a, b = max(row, 0), max(column, 0)
                if row == a and column == b:
                    v1 = record[VOLUME, a, b] / record[PARTS, a, b]
                    d1 = find_way(nodes, i, j, a, b)
                row, column = (i + way, j) if along_i else (i, j + way)
                c, d = min(row, ni - 1), min(column, nj - 1)
                if row == c and column == d:
                    v2 = record[VOLUME, c, d] / record[PARTS, c, d]
                    d2 = find_way(nodes, i, j, c, d)
                # where a side has no such cell its part is nothing, of whatever cell
                volume += v1 + v2
                lever += v2 * d2 - v1 * d1
                for q in range(CONSERVED_ROWS):
                    total[q] += (v1 * record[q, a, b] if v1 > 0.0 else 0.0) + (
                        v2 * record[q, c, d] if v2 > 0.0 else 0.0
                    )
            for q in range(CONSERVED_ROWS):
                record[MEAN + q, i, j] = total[q] / volume
            record[LEVER, i, j] = lever / volume

    @compiled_once
    def fill_slopes(small, reaches, nodes, record):
        """Slope of each neighbourhood, by the means beyond its ends."""
        ni, nj = reaches.shape
        ones, twos = np.zeros(CONSERVED_ROWS), np.zeros(CONSERVED_ROWS)
        for n in range(small.shape[0]):
            i, j = small[n]
            way, along_i = abs(reaches[i, j]) + 1, reaches[i, j] > 0
            a, b = (i - way, j) if along_i else (i, j - way)
            c, d = (i + way, j) if along_i else (i, j + way)
            low, high = a >= 0 and b >= 0, c < ni and d < nj
            here = record[LEVER, i, j]
            before = after = 1.0
            if low:
                turn = record[LEVER, a, b] if (reaches[a, b] > 0) == along_i else 0.0
                far = find_way(nodes, i, j, a, b)
                gap = here + far - turn
                # neighbourhoods whose means all but meet tell no slope
                before = 1.0 / gap if gap > 0.5 * far else 0.0
            if high:
                turn = record[LEVER, c, d] if (reaches[c, d] > 0) == along_i else 0.0
                far = find_way(nodes, i, j, c, d)
                gap = far + turn - here
                after = 1.0 / gap if gap > 0.5 * far else 0.0
            for q in range(CONSERVED_ROWS):
                mean = record[MEAN + q, i, j]
                one = (mean - record[MEAN + q, a, b]) * before if low else 0.0
                two = (record[MEAN + q, c, d] - mean) * after if high else 0.0
                ones[q] = one if low else two
                twos[q] = two if high else one
            # momentum along the line and across it, so that a turned block keeps its slopes
            xi, yi, xj, yj, _ = measure_lines(nodes, i, j)
            x, y = (xi, yi) if along_i else (xj, yj)
            length = (x * x + y * y) ** 0.5
            x, y = x / length, y / length
            along = limit_slope(x * ones[1] + y * ones[2], x * twos[1] + y * twos[2])
            across = limit_slope(x * ones[2] - y * ones[1], x * twos[2] - y * twos[1])
            record[SLOPE, i, j] = limit_slope(ones[0], twos[0])
            record[SLOPE + 1, i, j] = x * along - y * across
            record[SLOPE + 2, i, j] = y * along + x * across
            record[SLOPE + 3, i, j] = limit_slope(ones[3], twos[3])

    @compiled_once
    def gather_shares(i, j, reaches, nodes, record, pair, line, total):
        """What the neighbourhoods that a cell belongs to say of it, into `total`."""
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
                    # the other cell's neighbourhood lies on that side: this cell is before it
                    far = (-far if side > 0 else far) - record[LEVER, a, b]
                    for q in range(CONSERVED_ROWS):
                        pair[q] += record[MEAN + q, a, b] + record[SLOPE + q, a, b] * far
                for q in range(CONSERVED_ROWS):
                    line[q] += pair[q]
            for q in range(CONSERVED_ROWS):
                total[q] += line[q]
        far, part = -record[LEVER, i, j], 1.0 / record[PARTS, i, j]
        for q in range(CONSERVED_ROWS):
            own = record[MEAN + q, i, j] + record[SLOPE + q, i, j] * far
            total[q] = (total[q] + own) * part + record[KEPT + q, i, j]

    @kernel
    def redistribute(squeezed, grids, excess, inverse_dt, parameters, before, after, scratch):
        """Share the states of cells `small` (n, 2) over their neighbourhoods `reaches` (ni, nj).

        squeezed: both; grids: nodes (2, ni + 1, nj + 1) before and after the step; excess
        (faces,): volume of perimeter cells beyond their straight faces; before: state (4, ni + 2,
        nj + 2) and void energy (ni, nj); after: these and rates (ni, nj), mended in place; scratch:
        marks (ni, nj), zeros and left so, and records (RECORD_ROWS, ni, nj).  Returns the cells
        whose state has changed, the least c² of them, and by how much the number of cells with
        voids has grown.
        """
        (small, reaches), (nodes, nodes_new), (marks, record) = squeezed, grids, scratch
        (start, start_void_energy), (state, void_energy, rates) = before, after
        ni, nj = rates.shape
        touched = [(0, 0)]
        touched.clear()
        mark_neighbourhoods(small, reaches, marks, record, touched)
        voided = 0
        for i, j in touched:
            voided -= 1 if marks[i, j] == 1 and void_energy[i, j] != 0.0 else 0
            fill_conserved(state, void_energy, i, j, 1.0, parameters, 0, record)
            fill_conserved(start, start_void_energy, i, j, 1.0 - RELAXED, parameters, KEPT, record)
            record[VOLUME, i, j] = find_volume(nodes_new, excess, i, j, ni, nj)
            record[LEVER, i, j] = 0.0
            for q in range(CONSERVED_ROWS):
                record[q, i, j] -= record[KEPT + q, i, j]
                record[MEAN + q, i, j] = record[q, i, j]
                record[SLOPE + q, i, j] = 0.0
        fill_means(small, reaches, nodes_new, record)
        fill_slopes(small, reaches, nodes_new, record)
        least, changed = 1e300, 0
        pair, line = np.empty(CONSERVED_ROWS), np.empty(CONSERVED_ROWS)
        total = np.empty(CONSERVED_ROWS)
        for i, j in touched:
            if marks[i, j] == 2:
                continue
            changed += 1
            gather_shares(i, j, reaches, nodes_new, record, pair, line, total)
            rho, u, v = total[0], total[1] / total[0], total[2] / total[0]
            e = total[3] / total[0] - 0.5 * (u * u + v * v)
            p = pressure_part(rho, e, parameters)
            void_energy[i, j] = 0.0
            bound = find_least_pressure(rho, parameters)
            if p < bound:
                p = bound
                void_energy[i, j] = e - energy_part(rho, p, parameters)
                voided += 1
            c2 = sound_speed_squared_part(rho, p, parameters)
            c2 = c2 if (rho > 0.0) & (c2 > 0.0) else -1.0
            state[RHO, i + 1, j + 1], state[U, i + 1, j + 1] = rho, u
            state[V, i + 1, j + 1], state[P, i + 1, j + 1] = v, p
            least = min(least, c2)
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
            area *= find_share(nodes_new, excess, i, j, ni, nj)
            rates[i, j], _ = compute_rate(u, v, max(c2, 0.0), xi, yi, xj, yj, 1.0 / area)
        for i, j in touched:
            marks[i, j] = 0
        return changed, least, voided

    return redistribute
