"""Tables and sentences of docs/accuracy.md, from what `make accuracy` measured.

    accuracy rates gas 64       growth rates of gases at 64 cells, Mach numbers by density ratios
    accuracy rates condensed 64 the same of condensed materials
    accuracy polars             pressure behind A over the angle
    accuracy lines              a flat interface, the shock begun a part of a cell farther away
    accuracy null               a rippled interface in one gas
    accuracy pairs              random Riemann problems
    accuracy doubts             the range of validity, sentence by sentence

Sources: problems/interface_instability/accuracy.json (rates; screens look up their cautions there),
results/bench.json (polars), results/accuracy.json (the others).  Each function takes rows and
gives lines of Markdown, so that a test can hand it other rows.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.growth_accuracy import METALS
from oracles.random_pairs import make_random_pair
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.interface_instability.theories import Measured, read_rows

RESULTS = Path(__file__).resolve().parent / "results"
LEVELS = (0.01, 0.02, 0.05)  # errors that are counted; those above the first are bold
ROUGH = 0.05  # roughness of a line that screens caution of
SAME = 1.0  # ratio of densities where nothing grows, so that roughness has no mode to be over
NEAR = 0.5  # degrees below the critical angle: nearer is its own sentence
# per cent, cells, parts of the shock's speed
POLAR_BAR = 3.0
LINE_BAR = 1e-3
SPEED_BAR = 1e-5
# first mode; the largest of the others
NULL_BAR = 0.004
OTHERS_BAR = 0.005
PAIR_STEPS = (1e-4, 1e-3, 1e-2)
# the worst pairs in the table; the worst rates in a sentence
PAIRS_SHOWN = 5
NAMED = 6
Rows = Sequence[dict[str, Any]]


def say_error(percent: float, digits: int = 2) -> str:
    """An error in per cent, bold above the first level."""
    said = f"{percent:+.{digits}f}"
    return f"**{said}**" if abs(percent) > 100.0 * LEVELS[0] else said


def make_table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """A Markdown table, the first column to the left and the others to the right."""
    heads = list(heads)
    lines = ["| " + " | ".join(heads) + " |", "|---|" + "---:|" * (len(heads) - 1)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


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
    machs, ratios = (sorted({key[n] for key in known}) for n in (0, 1))
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
    """One line of the table for a pair of materials and a Mach number, both time steps beside."""
    steps = sorted({row["cfl"] for row in rows}, reverse=True)
    cases: dict[tuple, dict] = {}
    for row in rows:
        cases.setdefault((row["materials"], row["mach"]), {})[row["cfl"]] = row
    columns = (
        ("deviation from linear, 1e-3 cells", lambda row: f"{1e3 * row['unevenness']:.2f}"),
        ("error in dx/ds, %", lambda row: f"{100.0 * row['slope_error']:.2f}"),
        ("speed error, 1e-5 D", lambda row: f"{1e5 * row['speed_error']:+.1f}"),
        ("variation of speed with s, 1e-5 D", lambda row: f"{1e5 * row['speed_scatter']:.1f}"),
    )
    heads = [f"{head}; cfl {cfl:g}" for head, _ in columns for cfl in steps]
    body = []
    for (name, mach), by in cases.items():
        said = (say(by[cfl]) if cfl in by else "-" for _, say in columns for cfl in steps)
        body.append([name, f"{mach:g}", *said])
    return make_table(["materials", "Mach", *heads], body)


def table_null(rows: Rows) -> list[str]:
    """First mode and the largest of the others, by time."""
    times = sorted({row["kct"] for row in rows})
    cases: dict[tuple, dict] = {}
    for row in rows:
        cases.setdefault((row["mach"], row["cells"], row["ka0"], row["exact"]), {})[row["kct"]] = (
            row
        )
    heads = [f"mode 1, k c t = {kct:g}" for kct in times]
    heads += [f"largest other, {kct:g}" for kct in times]
    body = [
        [f"{mach:g}", f"{cells:g}", f"{ka0:g}", f"{exact:.4f}"]
        + [f"{by[kct]['mode_1']:.4f}" for kct in times]
        + [f"{by[kct]['others']:.4f}" for kct in times]
        for (mach, cells, ka0, exact), by in cases.items()
    ]
    return make_table(["Mach", "cells", "k a0", "exact", *heads], body)


def table_pairs(rows: Rows) -> list[str]:
    """Counts of pairs by their errors, then the worst of them."""
    errors = [row["error"] for row in rows if row["error"] is not None]
    bounds = [0.0, *PAIR_STEPS, float("inf")]
    counts = [
        sum(low < error <= high for error in errors) for low, high in itertools.pairwise(bounds)
    ]
    steps = [f"{100.0 * step:g}" for step in PAIR_STEPS]
    heads = [f"error up to {steps[0]} %"]
    heads += [f"error from {low} to {high} %" for low, high in itertools.pairwise(steps)]
    heads += [f"error above {steps[-1]} %", "no error measured"]
    numbers = [str(count) for count in [*counts, len(rows) - len(errors)]]
    lines = make_table(["", *heads], [["number of pairs", *numbers]])
    worst = sorted((row for row in rows if row["error"] is not None), key=lambda r: -r["error"])
    body = []
    for row in worst[:PAIRS_SHOWN]:
        sides = make_random_pair(row["seed"])
        states = [
            ", ".join(f"{value:.3g}" for value in (side.rho, side.p, side.gamma)) for side in sides
        ]
        body.append([str(row["seed"]), *states, f"{sides[1].u:.3g}", f"{100.0 * row['error']:.3g}"])
    heads = ["seed", "left: rho, p, gamma", "right: rho, p, gamma", "u right", "error, %"]
    return [*lines, "", "These pairs have the largest errors:", "", *make_table(heads, body)]


def doubt_rates(rows: Iterable[Measured]) -> list[str]:
    """Of each kind of materials and number of cells: how many are within the bars, which not."""
    groups: dict[tuple, list[Measured]] = {}
    for row in rows:
        groups.setdefault((row.materials, row.cells), []).append(row)
    told = []
    for (materials, cells), group in sorted(groups.items(), key=lambda item: item[0][::-1])[::-1]:
        kind = {"gas": "gases", "condensed": "condensed materials"}[materials]
        told.append(
            f"- At {cells:g} cells per wavelength, {_count_rates(group, kind)}."
            + _list_rough(group, materials)
        )
    return told


def _count_rates(group: list[Measured], kind: str) -> str:
    """How many errors are within each level, up to the first level that holds them all."""
    counts = [sum(abs(row.rate_error) <= most for row in group) for most in LEVELS]
    counts = counts[: counts.index(len(group)) + 1] if len(group) in counts else counts
    levels = [f"within {100.0 * most:g}%" for most in LEVELS]
    numbers = ["all" if count == len(group) else str(count) for count in counts]
    first = f"all {counts[0]}" if numbers[0] == "all" else f"{counts[0]} of {len(group)}"
    said = [f"{first} growth rates of {kind} lie {levels[0]} of theory"]
    said += [f"{n} {level}" for n, level in zip(numbers[1:], levels[1:], strict=False)]
    return f"{', '.join(said[:-1])} and {said[-1]}" if len(said) > 1 else said[0]


def _list_rough(group: list[Measured], materials: str) -> str:
    rough = [row for row in group if row.roughness > ROUGH and row.ratio != SAME]
    rough.sort(key=lambda row: -row.roughness)
    named = [_name_rate(row, materials, f"{row.roughness:g}") for row in rough]
    return f" The interface is rougher than {ROUGH:g} at {_cut(named)}." if named else ""


def _name_rate(row: Measured, materials: str, said: str) -> str:
    ratio = "ratio " * (materials == "gas") + name_ratio(materials, row.ratio)
    return f"Mach {row.mach:g}, {ratio} ({said})"


def _cut(named: list[str]) -> str:
    """The first NAMED of a list, the worst ones, and how many more there are."""
    more = len(named) - NAMED
    return "; ".join(named[:NAMED]) + (f"; and {more} more" if more > 0 else "")


def doubt_polars(rows: Rows) -> list[str]:
    """Near the critical angle and away from it: the worst, and what has no value."""
    told = []
    for near, words in ((False, "Farther than"), (True, "Up to")):
        group = [
            row
            for row in rows
            if float(row["below critical"]) > 0.0 and (float(row["below critical"]) <= NEAR) == near
        ]
        known = [row for row in group if row["error in p, %"] != ""]
        if not known:
            continue
        worst = max(known, key=lambda row: abs(float(row["error in p, %"])))
        over = [row for row in known if abs(float(row["error in p, %"])) > POLAR_BAR]
        without = len(group) - len(known)
        told.append(
            f"- {words} {NEAR:g} degrees below the critical angle, the pressure behind the "
            f"collision point is within {POLAR_BAR:g}% of theory in {_count_within(known, over)} "
            f"runs; the largest error is {worst['error in p, %']}% ({_name_polar(worst)})."
            + (f" In {without} further runs no pressure was measured." if without else "")
        )
    past = [row for row in rows if float(row["below critical"]) < 0.0]
    if past:
        told.append(
            f"- Past the critical angle ({len(past)} runs) there is no attached shock, so only the "
            "presence or absence of a jet is compared with theory."
        )
    died = [row for row in rows if row["behind A"] == "died"]
    if died:
        told.append(f"- Failed runs: {'; '.join(map(_name_polar, died))}.")
    return told


def _count_within(known: Rows, over: Rows) -> str:
    inside = len(known) - len(over)
    return f"all {inside}" if not over else f"{inside} of {len(known)}"


def _name_polar(row: dict[str, Any]) -> str:
    return (
        f"{row['plate on wedge']} at {row['V, km/s']} km/s, {row['below critical']} degrees below, "
        f"{row['cells']} cells"
    )


def doubt_lines(rows: Rows) -> list[str]:
    """How the position of a flat interface depends on the sub-cell phase of the shock."""
    told = [
        "- In the tests of a [flat interface](#a-flat-interface-hit-by-a-shock) a shock of speed D "
        "starts at a distance that we increase by s, from 0 to 1 cell."
    ]
    for key, bar, words, unit in (
        ("unevenness", LINE_BAR, "final position deviates from a linear function of s", "cells"),
        ("speed_scatter", SPEED_BAR, "late speed varies with s", "D"),
    ):
        over = sum(row[key] > bar for row in rows)
        worst = max(rows, key=lambda row: row[key])
        told.append(
            f"- The {words} by more than {bar:g} {unit} in {over} of {len(rows)} runs (at most "
            f"{worst[key]:.2g} {unit}: {_name_line(worst)})."
        )
    worst = max(rows, key=lambda row: abs(row["speed_error"]))
    told.append(
        "- The error of the late speed, averaged over s, is at most "
        f"{abs(worst['speed_error']):.1e} D ({_name_line(worst)})."
    )
    return told


def _name_line(row: dict[str, Any]) -> str:
    return f"{row['materials']} at Mach {row['mach']:g}, cfl {row['cfl']:g}"


def doubt_null(rows: Rows) -> list[str]:
    """Runs whose modes are beyond the bars, and the worst of each kind."""
    first = max(rows, key=lambda row: abs(row["mode_1"] - row["exact"]))
    other = max(rows, key=lambda row: row["others"])
    runs = {(row["mach"], row["cells"], row["ka0"]) for row in rows}
    bad = {
        (row["mach"], row["cells"], row["ka0"])
        for row in rows
        if abs(row["mode_1"] - row["exact"]) > NULL_BAR or row["others"] > OTHERS_BAR
    }
    count = "All" if len(bad) == len(runs) else f"{len(bad)} of"
    return [
        f"- With one gas on both sides, {count.lower()} {len(runs)} runs on cells of one size miss "
        f"our tolerance: the first mode should be within {NULL_BAR:g} of its exact value and all "
        f"others below {OTHERS_BAR:g}. The worst first mode is {first['mode_1']:.4f} instead of "
        f"{first['exact']:.4f} ({_name_null(first)}), and the largest other mode is "
        f"{other['others']:.4f} ({_name_null(other)})."
    ]


def _name_null(row: dict[str, Any]) -> str:
    return (
        f"Mach {row['mach']:g}, k a0 = {row['ka0']:g}, {row['cells']:g} cells, "
        f"k c t = {row['kct']:g}"
    )


def doubt_pairs(rows: Rows) -> list[str]:
    """Median, worst, and what was refused or has no value."""
    errors = sorted(row["error"] for row in rows if row["error"] is not None)
    over = sum(error > PAIR_STEPS[-1] for error in errors)
    told = (
        f"- Of {len(rows)} Riemann problems of random gases, {over or 'none'} have a star-state "
        f"error above {100.0 * PAIR_STEPS[-1]:g}%. The median error is "
        f"{100.0 * errors[len(errors) // 2]:.2g}%, the largest {100.0 * errors[-1]:.2g}%."
    )
    said = [row for row in rows if row["error"] is None]
    return [told + (f" Seed {said[0]['seed']} has no value: {said[0]['said']}." if said else "")]


def read_document(name: str, part: str) -> Rows:
    """Rows of a part of a file of docs/results."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))[part]["rows"]


def fill_accuracy(arguments: str) -> list[str]:
    """The lines of a region of the page."""
    what, *rest = arguments.split()
    if what == "rates":
        return table_rates(read_rows(), rest[0], float(rest[1]))
    if what == "polars":
        return table_polars(read_document("bench", "polars over the angle"))
    if what == "doubts":
        return [
            *doubt_rates(read_rows()),
            *doubt_polars(read_document("bench", "polars over the angle")),
            *doubt_lines(read_document("accuracy", "lines")),
            *doubt_null(read_document("accuracy", "null")),
            *doubt_pairs(read_document("accuracy", "pairs")),
        ]
    tables = {"lines": table_lines, "null": table_null, "pairs": table_pairs}
    return tables[what](read_document("accuracy", what))
