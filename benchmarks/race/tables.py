"""Tables of the race from docs/results/race.json, as Markdown in docs/results.

race            a table a case: for each code its errors and CPU seconds by cells
race-summary    CPU seconds to an error of BAR, a row a case
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.result_tables import make_table

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results" / "race.json"
NAMES = {
    "shockgrid": "shockgrid",
    "cloverleaf": "CloverLeaf_ref",
    "pyclaw": "PyClaw",
    "amrclaw": "AMRClaw",
    "athena": "Athena++",
    "pyro": "pyro",
    "pennant": "PENNANT",
}
# no other code starts from linear theory; the grid of shockgrid moves with the slab; PENNANT gains
# energy in the spherical blast
NOT_SUMMED_UP = "growth-behind", "contact", "sedov"
BAR = 0.01  # the error that times are compared at
CHANCE = 0.1  # of BAR: below it errors cancel, where a finer grid has a greater one
FARTHEST = 10.0  # times the longest run: so far times are extrapolated


def find_time(rows: list[dict[str, Any]], code: str) -> tuple[float, bool]:
    """CPU seconds from which on a code stays within BAR, and whether that was measured.

    A grid on which the error nearly vanishes, but not on a finer one, does not count.  Between two
    grids error and time are interpolated in logarithms; where the error changes its sign between
    them, it is the time of the finer one.  Beyond the finest they are continued at the slope of the
    last two.  NaN where the error does not fall.
    """
    mine = sorted((r for r in rows if r["code"] == code), key=lambda r: r["cells"])
    most = [max(abs(r["error"]) for r in mine[n:]) for n in range(len(mine))]
    mine = [
        r for r, later in zip(mine, most, strict=True) if not abs(r["error"]) < CHANCE * BAR < later
    ]
    signed, seconds = (np.array([r[key] for r in mine]) for key in ("error", "cpu"))
    errors = np.abs(signed)
    above = np.flatnonzero(errors > BAR)
    if above.size == 0:
        return float(seconds[0]), True
    last = above[-1]
    measured = last + 1 < len(mine)
    i = last if measured else last - 1
    if i < 0:
        return math.nan, False
    if signed[i] * signed[i + 1] < 0.0:
        return (float(seconds[i + 1]), True) if measured else (math.nan, False)
    fall = math.log(errors[i] / max(errors[i + 1], 1e-12))
    if fall <= 0.0:
        return math.nan, False
    rise = math.log(seconds[i + 1] / seconds[i])
    return float(seconds[i] * math.exp(rise * math.log(errors[i] / BAR) / fall)), measured


def describe_time(rows: list[dict[str, Any]], code: str) -> str:
    """CPU seconds to BAR, in parentheses if extrapolated; else the smallest error and its time."""
    mine = [r for r in rows if r["code"] == code]
    if not mine:
        return "-"
    best = min(mine, key=lambda r: abs(r["error"]))
    seconds, measured = find_time(rows, code)
    if not seconds < FARTHEST * best["cpu"] and abs(best["error"]) > BAR:
        return f"{100.0 * abs(best['error']):.2g} % in {say(best['cpu'])}"
    return say(seconds) if measured else f"({say(seconds)})"


def say(seconds: float) -> str:
    """Two digits, without an exponent."""
    return f"{seconds:.2g}" if seconds < 99.5 else f"{float(f'{seconds:.2g}'):.0f}"


def typeset(words: str) -> str:
    """A title with its symbols as pages print them."""
    for plain, symbol in (("k c t", "*kct*"), ("k a0", "*ka*₀"), ("gamma ", "γ = ")):
        words = words.replace(plain, symbol)
    return words


def list_summary(document: dict[str, Any]) -> list[str]:
    """One row a case; codes that ran none of them are left out."""
    cases = [name for name in document["cases"] if name not in NOT_SUMMED_UP]
    ran = {r["code"] for r in document["rows"] if r["case"] in cases}
    codes = {code: name for code, name in NAMES.items() if code in ran}
    lines = []
    for name in cases:
        rows = [r for r in document["rows"] if r["case"] == name]
        title = typeset(document["cases"][name]["title"])
        lines.append([title, *(describe_time(rows, code) for code in codes)])
    return make_table([f"CPU seconds to {100 * BAR:.0f} %", *codes.values()], lines)


def list_cases(document: dict[str, Any]) -> list[str]:
    """One table a case, a row a code: `cells: error (CPU seconds)`, grid by grid."""
    lines: list[str] = []
    for name, case in document["cases"].items():
        title = typeset(case["title"])
        found: dict[str, list[str]] = {}
        for row in (r for r in document["rows"] if r["case"] == name):
            error = f"{100.0 * row['error']:.3g} %" if abs(row["error"]) > 1e-9 else "round-off"
            grids = found.setdefault(NAMES[row["code"]], [])
            grids.append(f"{row['cells']}: {error} ({row['cpu']:.3g})")
        lines += ["", f"## {title[0].upper()}{title[1:]}", "", f"Error: {typeset(case['error'])}."]
        rows = [[code, ", ".join(grids)] for code, grids in found.items()]
        lines += ["", *make_table(["code", "cells: error (CPU seconds)"], rows)]
    return lines[1:]
