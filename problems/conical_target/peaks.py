"""Where pressure is at its greatest in `conical-target`: in the whole of it and in each material.

The trap: lead beside a rigid wall is pressed twice, by the shock and by what comes back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hydro.block import Block
from regrid.measure.corners import compute_centres

PARTS = ("impactor", "shell", "target", "filling")
MM, GPA, US = 1e3, 1e-9, 1e6
PEAK_UNITS = {
    f"peak_{what}_{part}": unit
    for part in PARTS
    for what, unit in (("pressure", "Pa"), ("x", "m"), ("y", "m"))
}


MEASURED_NUMBERS = 4  # that `measure_block` gives


def measure_block(block: Block) -> tuple[float, float, float, float]:
    """Of a block: greatest pressure [Pa], the centre x, y [m] of that cell, the part of the mass in
    its second phase (NaN but for the cone)."""
    rho, _, _, p = block.state[:, 1:-1, 1:-1]
    cell = np.unravel_index(p.argmax(), p.shape)
    x, y = compute_centres(block.nodes)[(slice(None), *cell)]
    part = math.nan
    if block.name == "cone":
        mass = rho * block.volume
        part = float((mass * block.eos.compute_second_part(rho)).sum() / mass.sum())
    return float(p.max()), float(x), float(y), part


def find_peaks(measured: Sequence[tuple[str, float, float, float]]) -> dict[str, float]:
    """Greatest pressure [Pa] of each material's cells, and the centre x, y [m] of that cell.

    measured: of each block its material, and the first three numbers of `measure_block`.
    """
    row = {}
    for part in PARTS:
        own = [numbers for material, *numbers in measured if material == part]
        peak = own[int(np.argmax([pressure for pressure, *_ in own]))]
        for what, number in zip(("pressure", "x", "y"), peak, strict=True):
            row[f"peak_{what}_{part}"] = number
    return row


def find_peak(history, part: str) -> tuple[float, float, float, float]:
    """Greatest pressure [Pa] of a material in the whole run, its time [s] and place x, y [m]."""
    k = int(np.nanargmax(history[f"peak_pressure_{part}"]))
    names = (f"peak_pressure_{part}", "t", f"peak_x_{part}", f"peak_y_{part}")
    return tuple(float(history[name][k]) for name in names)


def make_peak_lines(deck, history) -> list[str]:
    """The greatest pressure of all, and each material's, as lines of text."""
    peaks = {part: find_peak(history, part) for part in PARTS}
    first = max(PARTS, key=lambda part: peaks[part][0])
    lines = [f"  greatest pressure of all: {format_peak(peaks[first])}, in {getattr(deck, first)}"]
    for part in PARTS:
        lines.append(f"    {part}, {getattr(deck, part)}: {format_peak(peaks[part])}")
    return lines


def format_peak(peak: tuple[float, float, float, float]) -> str:
    """Pressure [Pa], time [s] and position x, y [m] of a peak in GPa, us and mm."""
    p, t, x, y = peak
    return f"{p * GPA:.3g} GPa at {t * US:.3g} us, x = {x * MM:.3g}, r = {y * MM:.3g} mm"
