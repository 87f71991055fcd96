"""Comparisons, first checks, cost of runs, exported interfaces."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from shockgrid.runs.store.reader import RunData

DECK = ("interface-instability", "--set", "cells=16", "--set", "lengths=[2, 2]", "--set", "mach=2")


@pytest.fixture
def runs(shockgrid):
    for name, cfl in (("a", 0.5), ("b", 0.4)):
        more = ("--set", f"run.cfl={cfl}", "--set", "run.t_end=0.2", "--set", "output.dumps=4")
        assert shockgrid("run", *DECK, *more, "-q", "-o", name)[0] == 0


def test_other_steps_are_compared_by_time(shockgrid, runs):
    code, out, error = shockgrid("compare", "a", "b")
    assert code == 1 and error == ""
    assert "run.cfl" in out.splitlines()[1]
    assert "\nsteps differ: step 1 is at t = " in out
    assert "dumps at about the same times, 0 within the tolerances" in out
    assert "rows" not in out and "  L1 " in out
    code, out, _ = shockgrid("compare", "a", "b", "--rtol", "0.5")
    assert code == 0 and "5 dumps at about the same times, 5 within" in out


def test_the_same_steps_are_compared_bit_for_bit(shockgrid, runs):
    assert shockgrid("compare", "a", "a")[:2] == (0, "no difference between a and a\n")
    more = ("--set", "run.cfl=0.5", "--set", "run.t_end=0.2", "--set", "run.max_steps=5")
    assert shockgrid("run", *DECK, *more, "-q", "-o", "short")[0] == 0
    code, out, _ = shockgrid("compare", "a", "short")
    assert code == 1 and "rows in a, 6 in short" in out and "steps differ" not in out


HEAD = 'problem = "interface-instability"\ncells = 16\nlengths = [2, 2]\n'
GAUGE = '[[gauge]]\nname = "a"\nat = [99.0, 0.1]\n'
REFUSED = [
    ('[regrid]\nname = "barier"', "did you mean 'barrier'?"),
    ("[regrid]\noptions = {family = 3}", "family 3 must be 'auto', 'i', 'j'"),
    ("[regrid]\noptions = {famly = 'i'}", "has no option 'famly'; did you mean 'family'?"),
    ("[output]\ntimes = [0.1, 99.0]", "output.times has 99"),
    ('[output]\nfields = ["rhoo"]', "did you mean 'rho'?"),
    ('[output]\ncolumns = ["none"]', "there is no group of history columns 'none'"),
    (GAUGE + "moves = true", "gauge 'a' moves with the material, but at [99, 0.1] there is none"),
    (GAUGE + "count = 3", "a line needs its end `to`"),
    (GAUGE + 'fields = ["rho", "roh"]', "there is no field 'roh'; did you mean 'rho'?"),
    (GAUGE + "speed = 1", "there is no key 'gauge.0.speed'"),
]


@pytest.mark.parametrize(("lines", "words"), REFUSED)
def test_check_says_what_a_run_would(shockgrid, lines, words):
    Path("mine.toml").write_text(HEAD + lines)
    for command in (["check"], ["run", "--dry-run"], ["run", "-q", "-o", "never"]):
        code, out, error = shockgrid(*command, "mine.toml")
        assert (code, out) == (2, ""), command
        assert words in error and error.startswith("shockgrid: mine.toml: "), error
        assert error.count("\n") == 1 and not Path("never").exists()


def test_what_a_run_takes_passes(shockgrid):
    lines = '[output]\nfields = ["rho"]\ntimes = [0.1]\n[[gauge]]\nname = "a"\nat = [99.0, 0.1]'
    Path("mine.toml").write_text(HEAD + lines)
    assert shockgrid("check", "mine.toml")[0] == 0
    assert shockgrid("run", "--dry-run", "mine.toml")[0] == 0


def test_the_first_lines_and_a_dry_run_say_cells_memory_and_disk(shockgrid):
    for words in (("--dry-run",), ("-o", "a")):
        code, out, err = shockgrid("run", "toy", *words)
        said = out + err
        assert code == 0 and "128 cells in 2 blocks" in said
        assert "cost: memory about 190 MB" in said and "21 dumps of" in said


def test_a_finished_run_says_so_in_its_second_line_and_in_a_file(shockgrid):
    code, out, _ = shockgrid("run", "toy", "-o", "a")
    line = out.splitlines()[1]
    assert code == 0 and line == "verdict: finished; no warnings"
    verdict = RunData("a").verdict
    assert verdict["status"] == "finished" and verdict["trust"] == []
    assert verdict["name"] == "t_end reached"
    assert line in shockgrid("info", "a")[1].splitlines()


GAS = ("interface-instability", "--set=mach=2", "--set=lengths=[2,2]", "--set=cells=16", "-q",
       "--set=modes=[{ka0=0.5}]", "--set=run.t_end=0.3", "--set=output.dumps=3",
       "--set=regrid.options.family=auto")  # fmt: skip


def test_curves_have_the_nodes_of_the_interface(shockgrid):
    assert shockgrid("run", *GAS, "-o", "run")[0] == 0
    code, text, _ = shockgrid("export", "run")
    assert code == 0 and text.split() == ["run/interfaces.csv"]
    with open("run/interfaces.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    dumps = RunData("run").outputs
    assert len(rows) == len(dumps) * 9
    for dump in dumps:
        line = dump.block("first").nodes[:, -1, :]
        steps = np.hypot(*np.diff(line, axis=1))
        own = [row for row in rows if int(row["step"]) == dump.step]
        assert {row["interface"] for row in own} == {"interface_first_second"}
        assert [[float(row[name]) for row in own] for name in "xy"] == line.tolist()
        assert float(own[-1]["s"]) == pytest.approx(steps.sum(), rel=1e-14)
        assert float(own[0]["t"]) == dump.t
