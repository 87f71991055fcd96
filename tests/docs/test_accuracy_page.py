"""docs/accuracy.md says what was measured: every figure is a stored one, in the right place."""

from __future__ import annotations

import json
import re
import sys

import pytest

from builders import ROOT
from problems.interface_instability.accuracy import Measured, read_rows

sys.path.insert(0, str(ROOT / "docs"))
import accuracy_tables as tables

PAGE = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")
STORED = json.loads((ROOT / "docs" / "results" / "accuracy.json").read_text(encoding="utf-8"))
BENCH = json.loads((ROOT / "docs" / "results" / "bench.json").read_text(encoding="utf-8"))


def read_table(region: str) -> list[dict[str, str]]:
    """Rows of the first table in a generated region of the page, by the heads."""
    body = re.search(rf"<!-- generated: accuracy {region} -->(.*?)<!-- end", PAGE, re.DOTALL)[1]
    table = re.search(r"(?:^\|.*\n)+", body, re.MULTILINE)[0].splitlines()
    heads, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in table)
    return [dict(zip(heads, row, strict=True)) for row in rows]


@pytest.mark.parametrize(
    "error, colour",
    [(0.0, "🟩"), (-0.01, "🟩"), (0.0101, "🟨"), (-0.02, "🟨"), (0.049, "🟧"), (-0.051, "🟥")],
)
def test_colours_are_those_of_1_2_and_5_per_cent(error, colour):
    assert tables.mark(error) == colour


@pytest.mark.parametrize("materials", ["gas", "condensed"])
@pytest.mark.parametrize("cells", [32, 64])
def test_every_rate_stands_at_its_mach_number_and_ratio(materials, cells):
    rows = [r for r in read_rows() if (r.materials, r.cells) == (materials, cells)]
    shown = read_table(f"rates {materials} {cells}")
    figures = sum(cell != "-" for line in shown for head, cell in line.items() if head != "Mach")
    assert figures == len(rows) >= 8
    for row in rows:
        (line,) = (line for line in shown if float(line["Mach"]) == row.mach)
        colour, figure = line[tables.name_ratio(materials, row.ratio)].split()
        assert float(figure) == pytest.approx(100.0 * row.rate_error, abs=0.0051)
        assert colour == tables.mark(row.rate_error)


def test_polars_are_those_of_the_problem_s_own_table():
    rows = BENCH["polars over the angle"]["rows"]
    shown = {line.pop("degrees below critical"): line for line in read_table("polars")}
    assert sum(len(line) for line in shown.values()) >= len(rows) > 0
    for row in rows:
        case = f"{row['plate on wedge']}, {row['V, km/s']} km/s, {row['cells']}"
        cell = shown[row["below critical"]][case]
        assert row["p off, %"] in cell if row["p off, %"] else cell == row["behind A"]


def test_flat_lines():
    rows = STORED["lines"]["rows"]
    shown = read_table("lines")
    for row in rows:
        (line,) = (
            one for one in shown
            if one["materials"] == row["materials"] and float(one["Mach"]) == row["mach"]
        )  # fmt: skip
        places = float(line[f"off linear, 1e-3 cell; cfl {row['cfl']:g}"])
        speed = float(line[f"speed off, 1e-5 D; cfl {row['cfl']:g}"])
        assert places == pytest.approx(1e3 * row["unevenness"], abs=0.0051)
        assert speed == pytest.approx(1e5 * row["speed_error"], abs=0.051)


def test_null_lines():
    shown = {(float(r["Mach"]), float(r["cells"]), float(r["k a0"])): r for r in read_table("null")}
    for row in STORED["null"]["rows"]:
        line = shown[row["mach"], row["cells"], row["ka0"]]
        assert float(line[f"mode 1, k c t = {row['kct']:g}"]) == row["mode_1"]
        assert float(line[f"largest other, {row['kct']:g}"]) == pytest.approx(
            row["others"], abs=5.1e-5
        )


def test_pairs_are_counted_once_each():
    rows = STORED["pairs"]["rows"]
    (line,) = read_table("pairs")
    assert sum(int(cell) for head, cell in line.items() if head != "star state off") == len(rows)
    over = sum(row["error"] is not None and row["error"] > 1e-2 for row in rows)
    assert int(line["more"]) == over


def test_doubts_name_what_is_off_and_nothing_else():
    rows = [
        Measured("gas", 1.5, 3.0, 64, 0.004, 0.01),
        Measured("gas", 5.0, 3.0, 64, -0.064, 0.27),
        Measured("gas", 5.0, 1.0, 64, 0.001, 7.0),
        Measured("gas", 1.5, 3.0, 32, 0.015, 0.01),
    ]
    finer, coarser = tables.doubt_rates(rows)
    assert "of 3 rates 2 are within 1 %, 2 are within 2 %, 2 are within 5 %" in finer
    assert "More than 2 % off: Mach 5, 3 (-6.4 %)." in finer and "rough" in finer
    assert "Mach 1.5" not in finer and "Mach 5, 1 " not in finer
    assert "of 1 rates 0 are within 1 %, 1 are within 2 %" in coarser and "off:" not in coarser


def test_doubts_of_pairs_say_what_was_refused():
    rows = [
        {"seed": 0, "error": 1e-4},
        {"seed": 1, "error": 0.03},
        {"seed": 2, "error": None, "said": "the gases part"},
    ]
    (sentence,) = tables.doubt_pairs(rows)
    assert "1 of 3" in sentence and "seed 2: the gases part" in sentence and "worst 3 %" in sentence


def test_a_doubtful_polar_is_named():
    row = {
        "plate on wedge": "Al1100 on SS304",
        "V, km/s": "3",
        "cells": "80 x 24",
        "behind A": "fall",
    }
    rows = [
        row | {"below critical": "2.00", "p off, %": "+0.30"},
        row | {"below critical": "0.10", "p off, %": "-7.00"},
        row | {"below critical": "-1.00", "p off, %": "", "behind A": "jet by theory"},
    ]  # fmt: skip
    far, near, past = tables.doubt_polars(rows)
    assert "1 of 1 within 3 %" in far and "0 of 1 within 3 %" in near and "0.10 degrees" in near
    assert "(1 runs)" in past
