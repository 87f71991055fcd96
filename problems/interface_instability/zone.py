"""The interface as a field: one block of both materials, its first grid, and what is measured.

Where the line between both materials is not followed, the volume fraction of the first says where
it was: along a row of cells the contact lies where the fraction passes a half.  What a line's
harmonics are made of, the place of the contact at each height, is the length that the first
material has there; of a folded line that is the same integral along the line.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from shockgrid.hydro.eos.mixture import MASS_FRACTION, VOLUME_FRACTION
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.spacing import FINE_ZONE_WAVELENGTHS, Spacing
from shockgrid.problems.pictures import CONTACT_FRACTION, trace_contact
from shockgrid.regrid.jit import kernel

ZONE_MARGIN = 0.5  # of the line's extent, on either side, with the finest cells
ZONE_BLOCK = "both"  # name of the block of both materials
SMEARED_CELLS = 3  # on either side of a contact, beyond which cells hold one material
LEAST_WHOLE_CONTRAST = 0.95  # of the fractions there, where no other contact is near
ZONE_UNITS = {"integral_width": "m", "circulation": "m2/s", "mixed_mass": "kg/m"}


def make_zone_nodes(
    deck: InterfaceDeck, sides: tuple[np.ndarray, np.ndarray], line: np.ndarray, finer: int
) -> np.ndarray:
    """Nodes (2, ni + 1, nj + 1) [m] of a block from side to side, even where the line (2, n) lies.

    sides: nodes (2, n) of both far sides, which need not be straight; finer: cells there, and
    within ZONE_MARGIN times the extent of the line, for one of the deck's in each direction.
    """
    parts = np.arange(finer * (sides[0].shape[1] - 1) + 1) / finer
    sides = divide_curve(sides[0], parts), divide_curve(sides[1], parts)
    heights = np.linspace(sides[0][1, 0], sides[0][1, -1], parts.size)
    low = float(sides[0][0].mean())
    high = float(sides[1][0].mean())
    zone_low = float(line[0].min())
    zone_high = float(line[0].max())
    size = deck.wavelength / deck.cells / finer
    margin = max(FINE_ZONE_WAVELENGTHS, ZONE_MARGIN * (zone_high - zone_low) / deck.wavelength)
    spacing = Spacing(deck, float(finer), margin)
    before = zone_low - spacing.make(zone_low - low)[::-1]
    after = zone_high + spacing.make(high - zone_high)
    count = max(1, round((zone_high - zone_low) / size))
    between = np.linspace(zone_low, zone_high, count + 1)[1:-1]
    if zone_high - zone_low < 0.5 * size:  # a flat line: no cell of its own
        between = np.empty(0)
        after = after[1:]
    x = np.concatenate([before, between, after])
    nodes = np.array(np.meshgrid(x, heights, indexing="ij"))
    # rows of nodes bend towards the far sides
    part = ((x - low) / (high - low))[:, None]
    bend_low = sides[0] - np.array([np.full(heights.shape, x[0]), heights])
    bend_high = sides[1] - np.array([np.full(heights.shape, x[-1]), heights])
    nodes += (1.0 - part) * bend_low[:, None] + part * bend_high[:, None]
    nodes[:, 0] = sides[0]
    nodes[:, -1] = sides[1]
    return nodes


def divide_curve(curve: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Points (2, m) on a curve of straight pieces (2, n), at places in numbers of its pieces."""
    numbers = np.arange(curve.shape[1])
    return np.array([np.interp(places, numbers, row) for row in curve])


def find_contact_places(block: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Length of the first material in each row of cells (nj,), and all places (n,) [m] where a
    row's volume fraction passes a half, with the row (n,) of each.

    A contact is smeared over a few cells; it lies where the first material in these would end.
    """
    fraction = block.cell_fields["volume_fraction"]
    x, _ = block.nodes
    edges = 0.5 * (x[:, 1:] + x[:, :-1])
    widths = np.diff(edges, axis=0)
    held = np.zeros(edges.shape)
    held[1:] = np.cumsum(fraction * widths, axis=0)
    i, j = np.nonzero((fraction[1:] >= CONTACT_FRACTION) != (fraction[:-1] >= CONTACT_FRACTION))
    falls = fraction[i, j] >= CONTACT_FRACTION
    # cells around the contact, and what of their length is the first material's
    first = np.maximum(i - SMEARED_CELLS + 1, 0)
    last = np.minimum(i + SMEARED_CELLS, fraction.shape[0] - 1)
    length = held[last + 1, j] - held[first, j]
    places = np.where(falls, edges[first, j] + length, edges[last + 1, j] - length)
    # another contact is near: between the two cells, by their fractions
    contrast = np.abs(fraction[last, j] - fraction[first, j])
    centres = 0.5 * (edges[1:] + edges[:-1])
    part = (CONTACT_FRACTION - fraction[i, j]) / (fraction[i + 1, j] - fraction[i, j])
    between = centres[i, j] + part * (centres[i + 1, j] - centres[i, j])
    return edges[0] + held[-1], np.where(contrast > LEAST_WHOLE_CONTRAST, places, between), j


def find_peak(values: np.ndarray, spread: float = 0.0) -> float:
    """The greatest of values (n,) along a mirrored line, between three of them on a parabola.

    spread: 1/12 where the values are means over their intervals, 0 where they are in the middle.
    """
    top = int(values.argmax())
    before = values[max(top - 1, 0)]
    after = values[min(top + 1, values.size - 1)]
    bend = 0.5 * (before + after) - values[top]
    slope = 0.5 * (after - before)
    if not (np.isfinite(bend) and bend < 0.0):
        return float(values[top])
    return float(values[top] - bend * spread - slope * slope / (4.0 * bend))


def find_tip(places: np.ndarray, rows: np.ndarray, count: int, sign: float) -> float:
    """The greatest of places (n,) [m] in `count` rows, or with sign = -1 the least.

    Places are means over rows; the tip is that of the parabola through three rows, mirrored at
    both ends, where they lie on one.
    """
    reach = np.full(count, -np.inf)
    np.maximum.at(reach, rows, sign * places)
    return sign * find_peak(reach, spread=1.0 / 12.0)


def measure_row_mode(
    lengths: np.ndarray, heights: np.ndarray, wavenumber: float, phase: float
) -> float:
    """Amplitude [m] of cos(k y + phase) in means (n,) over rows between heights (n + 1,) [m]."""
    centres = 0.5 * (heights[1:] + heights[:-1])
    rows = np.diff(heights)
    wave = np.cos(wavenumber * centres + phase)
    # the mean of a wave over a row is less than the wave in its middle
    flattening = np.sinc(0.5 * wavenumber * rows / math.pi)
    mean = (lengths * rows).sum() / rows.sum()
    return float(2.0 * ((lengths - mean) * wave * rows / flattening).sum() / rows.sum())


def make_line_profile(line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places x (n,) [m], in order, and how much of the height the first material has there (n,).

    Of a line (2, n) [m] from the low end to the high one, the first material before it.  Between
    the places the profile is straight, as the line is between its nodes; a fold counts as often
    as it is passed.
    """
    x, y = line
    places = np.sort(x)
    low = np.minimum(x[1:], x[:-1])
    high = np.maximum(x[1:], x[:-1])
    rises = np.diff(y)
    # of each piece of the line, the part beyond each place
    reach = np.maximum(high - low, np.finfo(float).tiny)
    beyond = np.clip((high[:, None] - places[None, :]) / reach[:, None], 0.0, 1.0)
    return places, rises @ beyond / (y[-1] - y[0])


def measure_line_width(line: np.ndarray) -> float:
    """Integral width [m] of a line (2, n): that of `measure_zone`, exactly."""
    places, profile = make_line_profile(line)
    before, after = profile[:-1], profile[1:]
    mean = 0.5 * (before + after)
    # of a straight piece of the profile, the mean of its square is that much above mean * mean
    spread = (after - before) ** 2 / 12.0
    return float((4.0 * (mean * (1.0 - mean) - spread) * np.diff(places)).sum())


@kernel(allocates=False)
def add_to_rows(nodes, amounts, heights, rows):
    """Add amounts (ni, nj) of cells to rows (n,) between heights (n + 1,), by what lies in each.

    A cell counts as even between the mean of its two lower corners and that of the two upper ones.
    """
    for i in range(amounts.shape[0]):
        for j in range(amounts.shape[1]):
            a = nodes[1, i, j]
            b = nodes[1, i, j + 1]
            c = nodes[1, i + 1, j]
            d = nodes[1, i + 1, j + 1]
            # the corners in order, as far as it matters
            a, b = min(a, b), max(a, b)
            c, d = min(c, d), max(c, d)
            a, c = min(a, c), max(a, c)
            b, d = min(b, d), max(b, d)
            low = 0.5 * (a + min(b, c))
            high = 0.5 * (d + max(b, c))
            density = amounts[i, j] / (high - low)
            for row in range(rows.shape[0]):
                shared = min(high, heights[row + 1]) - max(low, heights[row])
                if shared > 0.0:
                    rows[row] += density * shared


def measure_circulation(blocks: Any, heights: np.ndarray, is_periodic: bool = False) -> float:
    """The greatest circulation [m2/s] around rows from far side to far side.

    blocks: one, or several side by side along i; heights (n + 1,): between the rows; is_periodic:
    what lies above them is that below.  Two lines along x, joined at both far sides, where nothing
    moves along them, go around all vortices in between; the two are chosen between which these turn
    the most one way.
    """
    flow = np.zeros(heights.size - 1)
    period = float(heights[-1] - heights[0])
    for block in blocks:
        amounts = block.volume * block.u
        add_to_rows(block.nodes, amounts, heights, flow)
        for shift in (period, -period) if is_periodic else ():
            add_to_rows(block.nodes, amounts, heights + shift, flow)
    along = flow / np.diff(heights)
    return find_peak(along, 1.0 / 12.0) + find_peak(-along, 1.0 / 12.0)


def measure_zone(block: Any, heights: np.ndarray, is_periodic: bool) -> dict[str, float]:
    """Integral width [m] of the mixing zone, circulation, and mass [kg/m] of what is mixed.

    heights (n + 1,) [m]: between rows, for the circulation, and is_periodic: as there.

    The integral over x of 4 z (1 - z) with z the mean volume fraction at each x; and of
    4 y (1 - y), y the mass fraction, over the mass.
    """
    fraction = block.carried[VOLUME_FRACTION, 1:-1, 1:-1]
    part = block.carried[MASS_FRACTION, 1:-1, 1:-1]
    volume = block.volume
    mass = volume * block.rho
    profile = (volume * fraction).sum(axis=1) / volume.sum(axis=1)
    widths = volume.sum(axis=1) / np.ptp(block.nodes[1, 0])
    # between its means the profile is straight: of its square, the mean over a cell is larger
    steps = np.diff(profile, prepend=profile[0], append=profile[-1])
    spread = (0.5 * (steps[1:] + steps[:-1])) ** 2 / 12.0
    return {
        "integral_width": float((4.0 * (profile * (1.0 - profile) - spread) * widths).sum()),
        "circulation": measure_circulation([block], heights, is_periodic),
        "mixed_mass": float((4.0 * part * (1.0 - part) * mass).sum()),
    }


def measure_line(blocks: Any, heights: np.ndarray, is_periodic: bool) -> dict[str, float]:
    """What `measure_zone` measures, of a line between two blocks, where nothing is mixed."""
    return {
        "integral_width": measure_line_width(blocks[0].nodes[:, -1, :]),
        "circulation": measure_circulation(blocks, heights, is_periodic),
        "mixed_mass": 0.0,
    }


def measure_contact(block: Any, wavenumber: float, followed: Any) -> dict[str, float]:
    """What the history has of the line, of the contact in a block of both materials.

    followed: the harmonics that are followed.  What only a line has is nan.
    """
    lengths, places, rows = find_contact_places(block)
    heights = block.nodes[1, 0]
    greatest = find_tip(places, rows, lengths.size, 1.0)
    smallest = find_tip(places, rows, lengths.size, -1.0)
    return {
        "interface_mean": float((lengths * np.diff(heights)).sum() / np.ptp(heights)),
        "interface_max": greatest,
        "interface_min": smallest,
        "amplitude": 0.5 * (greatest - smallest),
        **{
            h.column: measure_row_mode(lengths, heights, h.number * wavenumber, h.phase)
            for h in followed
        },
        "roughness": math.nan,
        "largest_turn": math.nan,
    }


def find_lines(blocks: Any) -> list[np.ndarray]:
    """The interface (2, n) [m] of dumped blocks: the line between them, or where a fraction is."""
    if blocks[0].name == ZONE_BLOCK:
        return trace_contact(blocks[0])
    return [blocks[0].nodes[:, -1, :]]
