"""Tables of docs/verification.md over ranges of decks, from what `make accuracy` measured.

Each function takes rows and gives lines of Markdown, which `benchmarks/accuracy.py` keeps in
docs/results/accuracy-*.txt.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

from benchmarks.growth_accuracy import METALS
from benchmarks.result_tables import make_table
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.interface_instability.theories import Measured

LEVELS = (0.01, 0.02, 0.05)  # errors that are counted; those above the first are bold
PAIR_STEPS = (1e-4, 1e-3, 1e-2)  # errors by which random pairs are counted
LINE_CFL = 0.8  # of the table of flat interfaces
NULL_KA0 = 0.02  # of the table of ripples in one gas
Rows = Sequence[dict[str, Any]]


def say_error(percent: float, digits: int = 2) -> str:
    """An error in per cent, bold above the first level."""
    said = f"{percent:+.{digits}f}"
    return f"**{said}**" if abs(percent) > 100.0 * LEVELS[0] else said


def name_ratio(materials: str, ratio: float) -> str:
    """What a density ratio is called: condensed materials by their names."""
    if materials == "condensed":
        for first, second in METALS:
            known = find_material(second).rho0 / find_material(first).rho0
            if abs(ratio / known - 1.0) < 1e-3:
                return f"{first} into {second}"
    return f"{ratio:.4g}"


def table_rates(rows: Iterable[Measured], materials: str, cells: float) -> list[str]:
    """Errors of growth rates; `-` where there is no value."""
    known = {(r.mach, r.ratio): r for r in rows if (r.materials, r.cells) == (materials, cells)}
    machs = sorted({mach for mach, _ in known})
    ratios = sorted({ratio for _, ratio in known})
    body = [
        [f"{mach:g}", *(_say_rate(known.get((mach, ratio))) for ratio in ratios)] for mach in machs
    ]
    return make_table(["Mach", *(name_ratio(materials, ratio) for ratio in ratios)], body)


def _say_rate(row: Measured | None) -> str:
    return "-" if row is None else say_error(100.0 * row.rate_error)


def table_polars(rows: Rows) -> list[str]:
    """Error of the pressure by angles below critical, a column for each plate, wedge and speed."""
    cases = []
    angles = []
    found = {}
    for row in rows:
        case = (row["plate on wedge"], row["V, km/s"], row["cells"])
        cases += [case] if case not in cases else []
        angles += [row["below critical"]] if row["below critical"] not in angles else []
        found[row["below critical"], case] = _say_polar(row)
    heads = [f"{pair}, {speed} km/s, {cells}" for pair, speed, cells in cases]
    body = [
        [angle, *(found.get((angle, case), "-") for case in cases)]
        for angle in sorted(angles, key=float)
    ]
    return make_table(["degrees below critical", *heads], body)


def _say_polar(row: dict[str, Any]) -> str:
    if row["error in p, %"] == "":
        return row["behind A"]
    return say_error(float(row["error in p, %"]))


def table_lines(rows: Rows) -> list[str]:
    """One line for a pair of materials and a Mach number."""
    heads = [
        "materials",
        "Mach",
        "deviation from linear, 1e-3 cells",
        "error in dx/ds, %",
        "speed error, 1e-5 D",
        "variation of speed with s, 1e-5 D",
    ]
    body = [
        [
            row["materials"],
            f"{row['mach']:g}",
            f"{1e3 * row['unevenness']:.2f}",
            f"{100.0 * row['slope_error']:.2f}",
            f"{1e5 * row['speed_error']:+.1f}",
            f"{1e5 * row['speed_scatter']:.1f}",
        ]
        for row in rows
        if row["cfl"] == LINE_CFL
    ]
    return make_table(heads, body)


def table_null(rows: Rows) -> list[str]:
    """First mode and the largest of the others, by time."""
    times = sorted({row["kct"] for row in rows})
    cases: dict[tuple, dict] = {}
    for row in rows:
        if row["ka0"] == NULL_KA0:
            cases.setdefault((row["mach"], row["cells"], row["exact"]), {})[row["kct"]] = row
    heads = ["Mach", "cells", "exact", *(f"mode 1, k c t = {kct:g}" for kct in times)]
    heads += [f"largest other, {kct:g}" for kct in times]
    body = [
        [f"{mach:g}", f"{cells:g}", f"{exact:.4f}"]
        + [f"{by[kct]['mode_1']:.4f}" for kct in times]
        + [f"{by[kct]['others']:.4f}" for kct in times]
        for (mach, cells, exact), by in cases.items()
    ]
    return make_table(heads, body)


def table_pairs(rows: Rows) -> list[str]:
    """Counts of pairs by their errors, the median and the largest."""
    errors = sorted(row["error"] for row in rows if row["error"] is not None)
    bounds = [0.0, *PAIR_STEPS, float("inf")]
    counts = [
        sum(low < error <= high for error in errors) for low, high in itertools.pairwise(bounds)
    ]
    steps = [f"{100.0 * step:g}" for step in PAIR_STEPS]
    heads = [f"pairs up to {steps[0]} %"]
    heads += [f"from {low} to {high} %" for low, high in itertools.pairwise(steps)]
    heads += [f"above {steps[-1]} %", "without a value", "median error, %", "largest, %"]
    numbers = [str(count) for count in [*counts, len(rows) - len(errors)]]
    ends = (errors[len(errors) // 2], errors[-1])
    return make_table(heads, [[*numbers, *(f"{100.0 * error:.2g}" for error in ends)]])
