"""How far growth rates of this code were found off theory, and what that says of a deck.

`accuracy.json` beside this file holds the rows: one run of `benchmarks/growth_accuracy.py` each.

`materials`: "gas", two ideal gases, or "condensed", two of the others; `mach`: of the shock in the
first material; `ratio`: density of the second over the first; `cells`: in a wavelength of the mode;
`rate_error`: mean rate over theory's less 1, or where theory's is next to nothing the difference
over the interface's speed; `roughness`: harmonics above the fourth in the line, over its mode,
now or just after the shock.

The look-up asks the corners of the box of Mach numbers and ratios around a deck, each at the
greatest measured number of cells that is not above the deck's.  A ratio more than NEAR times the
deck's, or less than the deck's over NEAR, is left out where the other one is nearer; where none is,
the sentence says so.  Rows of ratio 1 are of one gas, where nothing grows: their errors are parts
of the interface's speed, and are told as parts of the deck's own rate.  Note: between two corners
an error may be larger than at both, and all gases measured have gamma 1.4.
"""

from __future__ import annotations

import bisect
import functools
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

PATH = Path(__file__).with_name("accuracy.json")
TRUSTED = 0.02  # a rate error above it is worth a sentence
ROUGH_LINE = 0.05  # of the largest mode: more in its higher harmonics is no wave of the deck's
NEAR = 2.0  # factor between density ratios from which growth at the one says little of the other
EDGE = 0.01  # of a Mach number or ratio: so far outside counts as inside
MATERIALS = {"gas": "two gases", "condensed": "two condensed materials"}


@dataclass(frozen=True)
class Measured:
    """One row: a run compared with theory."""

    materials: str
    mach: float
    ratio: float
    cells: float
    rate_error: float
    roughness: float


@functools.cache
def read_rows(path: Path = PATH) -> tuple[Measured, ...]:
    """All rows of the table."""
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"]
    return tuple(Measured(**row) for row in rows)


def find_bracket(values: Sequence[float], wanted: float) -> tuple[float, ...] | None:
    """The one or two of the ascending `values` around `wanted`; None outside of them all."""
    for value in values:
        if abs(value - wanted) <= EDGE * value:
            return (value,)
    place = bisect.bisect(values, wanted)
    return (values[place - 1], values[place]) if 0 < place < len(values) else None


def _choose_cells(rows: Iterable[Measured], cells: float) -> Measured:
    """Of rows at one corner that with the most cells up to `cells`, else that with the fewest."""
    ordered = sorted(rows, key=lambda row: row.cells)
    fitting = [row for row in ordered if row.cells <= cells * (1.0 + EDGE)]
    return fitting[-1] if fitting else ordered[0]


def caution_growth(
    materials: str,
    mach: float,
    ratio: float,
    cells: float,
    rows: Sequence[Measured] | None = None,
    growth: float = 1.0,
) -> list[str]:
    """What is to be said of a growth rate at such numbers; nothing where all is well.

    `materials` is a key of MATERIALS, or anything else for a pair that is neither; `growth`:
    theory's rate over the interface's speed, 1 where errors are parts of that speed.
    """
    of_cells, others = sort_cautions(materials, mach, ratio, cells, rows, growth)
    return of_cells + others


def leave_far_out(ratios: Sequence[float], wanted: float) -> tuple[float, ...]:
    """Of one or two ratios those within a factor of NEAR; both where none is."""
    far = NEAR * (1.0 + EDGE)
    near = tuple(ratio for ratio in ratios if wanted / far <= ratio <= wanted * far)
    return near or tuple(ratios)


def sort_cautions(
    materials: str,
    mach: float,
    ratio: float,
    cells: float,
    rows: Sequence[Measured] | None = None,
    growth: float = 1.0,
) -> tuple[list[str], list[str]]:
    """The same: that there are too few cells, and what else there is to say."""
    known = [row for row in (read_rows() if rows is None else rows) if row.materials == materials]
    if not known:
        pair = MATERIALS.get(materials, "a gas and a condensed material")
        return [], [f"growth was never compared with theory for {pair}"]
    machs, ratios = (sorted({getattr(row, key) for row in known}) for key in ("mach", "ratio"))
    near_machs, near_ratios = find_bracket(machs, mach), find_bracket(ratios, ratio)
    if near_machs is None or near_ratios is None:
        return [], [
            f"growth at Mach {mach:.3g} and density ratio {ratio:.3g} was never compared with "
            f"theory: measured are Mach {machs[0]:.3g} to {machs[-1]:.3g}, "
            f"ratios {ratios[0]:.3g} to {ratios[-1]:.3g}"
        ]
    near_ratios = leave_far_out(near_ratios, ratio)
    corners = [
        [row for row in known if (row.mach, row.ratio) == (near_mach, near_ratio)]
        for near_mach in near_machs
        for near_ratio in near_ratios
    ]
    where = f"Mach {_say_range(near_machs)}, density ratio {_say_range(near_ratios)}"
    nearest = min(near_ratios, key=lambda one: abs(math.log(one / ratio)))
    if max(nearest / ratio, ratio / nearest) > NEAR * (1.0 + EDGE):
        where += f" (none nearer to {ratio:.3g} was measured)"
    if not all(corners):
        return [], [f"growth was compared with theory at some of {where} only"]
    chosen = [_choose_cells(corner, cells) for corner in corners]

    def find_error(row: Measured) -> float:
        """Of the deck's own rate."""
        still = row.materials == "gas" and abs(row.ratio - 1.0) <= EDGE
        return abs(row.rate_error) / (growth if still else 1.0)

    worst = max(chosen, key=find_error)
    error = find_error(worst)
    of_cells, told = [], []
    if worst.cells > cells * (1.0 + EDGE):
        of_cells.append(
            f"growth was never compared with theory at {cells:.3g} cells in a wavelength: "
            f"take {worst.cells:g} or more"
        )
    if error > TRUSTED:
        words = f"{100.0 * error:.2g} % off theory"
        if error != abs(worst.rate_error):
            words = (
                f"{100.0 * abs(worst.rate_error):.2g} % of the interface's speed off theory, which "
                f"is {100.0 * error:.2g} % of the growth here,"
            )
        told.append(
            f"growth rates at {where} were found up to {words} with {worst.cells:g} cells in a "
            "wavelength"
        )
    rough = max(row.roughness for row in chosen)
    if rough > ROUGH_LINE:
        told.append(
            f"at {where} the line was found rough with {worst.cells:g} cells in a wavelength: "
            f"harmonics above the fourth are {rough:.2g} of the largest mode"
        )
    return of_cells, told


def _say_range(values: tuple[float, ...]) -> str:
    return " to ".join(f"{value:.3g}" for value in values)
