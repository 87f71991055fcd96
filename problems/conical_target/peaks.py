"""Where pressure is at its greatest in `conical-target`: in the whole of it and in each material.

The trap: lead beside a rigid wall is pressed twice, by the shock and by what comes back.
"""

from __future__ import annotations

import numpy as np

from hydro.block import Block
from regrid.measure.centres import compute_centres

PARTS = ("impactor", "shell", "target", "filling")
MM, GPA, US = 1e3, 1e-9, 1e6
PEAK_UNITS = {
    f"peak_{what}_{part}": unit
    for part in PARTS
    for what, unit in (("pressure", "Pa"), ("x", "m"), ("y", "m"))
}


def measure_peaks(blocks: list[Block]) -> dict[str, float]:
    """Greatest pressure [Pa] of each material's cells, and the centre x, y [m] of that cell."""
    row = {}
    for part in PARTS:
        own = [block for block in blocks if block.material == part]
        tops = [float(block.state[3, 1:-1, 1:-1].max()) for block in own]
        block = own[int(np.argmax(tops))]
        p = block.state[3, 1:-1, 1:-1]
        cell = np.unravel_index(p.argmax(), p.shape)
        position = compute_centres(block.nodes)[(slice(None), *cell)]
        row[f"peak_pressure_{part}"] = max(tops)
        row[f"peak_x_{part}"], row[f"peak_y_{part}"] = (float(value) for value in position)
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
