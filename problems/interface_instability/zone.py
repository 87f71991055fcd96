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
from shockgrid.hydro.rows import RHO
from shockgrid.problems.interface_instability.spacing import Spacing

ZONE_BLOCK = "both"  # name of the block of both materials
CONTACT_FRACTION = 0.5  # volume fraction at the contact
SMEARED_CELLS = 3  # on either side of a contact, beyond which cells hold one material
LEAST_WHOLE_CONTRAST = 0.95  # of the fractions there, where no other contact is near
ZONE_UNITS = {"integral_width": "m", "mixed_mass": "kg/m"}


def make_zone_nodes(
    spacing: Spacing, sides: tuple[np.ndarray, np.ndarray], line: np.ndarray, heights: np.ndarray
) -> np.ndarray:
    """Nodes (2, ni + 1, nj + 1) [m] of a block from side to side, even where the line (2, n) lies.

    sides: nodes (2, nj + 1) of both far sides, which need not be straight; heights (nj + 1,): of
    the rows of nodes.
    """
    low = float(sides[0][0].mean())
    high = float(sides[1][0].mean())
    zone_low = float(line[0].min())
    zone_high = float(line[0].max())
    size = spacing.deck.wavelength / spacing.deck.cells
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


def find_tip(places: np.ndarray, rows: np.ndarray, count: int, sign: float) -> float:
    """The greatest of places (n,) [m] in `count` rows, or with sign = -1 the least.

    Places are means over rows; the tip is that of the parabola through three rows, mirrored at
    both ends, where they lie on one.
    """
    reach = np.full(count, -np.inf)
    np.maximum.at(reach, rows, sign * places)
    top = int(reach.argmax())
    before = reach[max(top - 1, 0)]
    after = reach[min(top + 1, count - 1)]
    bend = 0.5 * (before + after) - reach[top]
    slope = 0.5 * (after - before)
    if not (np.isfinite(bend) and bend < 0.0):
        return sign * float(reach[top])
    return sign * float(reach[top] - bend / 12.0 - slope * slope / (4.0 * bend))


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


def measure_zone(block: Any) -> dict[str, float]:
    """Integral width [m] of the mixing zone, and mass [kg/m] of what is mixed.

    The integral over x of 4 z (1 - z) with z the mean volume fraction at each x; and of
    4 y (1 - y), y the mass fraction, over the mass.
    """
    fraction = block.carried[VOLUME_FRACTION, 1:-1, 1:-1]
    part = block.carried[MASS_FRACTION, 1:-1, 1:-1]
    volume = block.volume
    mass = volume * block.state[RHO, 1:-1, 1:-1]
    profile = (volume * fraction).sum(axis=1) / volume.sum(axis=1)
    widths = volume.sum(axis=1) / np.ptp(block.nodes[1, 0])
    return {
        "integral_width": float((4.0 * profile * (1.0 - profile) * widths).sum()),
        "mixed_mass": float((4.0 * part * (1.0 - part) * mass).sum()),
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


def trace_contact(block: Any) -> list[np.ndarray]:
    """Curves (2, n) [m] on which the volume fraction of a dumped block is a half."""
    from contourpy import contour_generator  # with matplotlib: slow to load

    x, y = block.nodes
    centres = [
        0.25 * (nodes[1:, 1:] + nodes[:-1, 1:] + nodes[1:, :-1] + nodes[:-1, :-1])
        for nodes in (x, y)
    ]
    found = contour_generator(*centres, block.cell_fields["volume_fraction"]).lines(
        CONTACT_FRACTION
    )
    return [np.asarray(curve).T for curve in found]


def find_lines(blocks: Any) -> list[np.ndarray]:
    """The interface (2, n) [m] of dumped blocks: the line between them, or where a fraction is."""
    if blocks[0].name == ZONE_BLOCK:
        return trace_contact(blocks[0])
    return [blocks[0].nodes[:, -1, :]]
