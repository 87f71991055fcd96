"""The verdict: each rule tells what it is for, and nothing of a good run."""

from __future__ import annotations

import errno

import numpy as np
import pytest

from regrid.errors import BadInput, RegridFailure, RunFailure
from runs.early_end.causes import name_failure
from runs.inspection.verdict import RULES, describe_verdict, judge
from runs.store.directory import RunDirectory
from runs.store.verdict_file import read_verdict, remove_verdict, write_verdict

STEPS, CELLS = 200, 1000


def make_history(**columns):
    """A run in which nothing went wrong, with other columns laid over it."""
    known = np.arange(STEPS + 1)
    history = {
        "step": known, "t": known * 0.1, "dt": np.full(STEPS + 1, 0.1),
        "dt_limit": np.array(["", *["sound"] * STEPS]), "retries": np.zeros(STEPS + 1),
        "regrid_rescues": np.zeros(STEPS + 1), "first_order_faces": np.zeros(STEPS + 1),
        "voided_cells": np.zeros(STEPS + 1), "shared_cells": np.zeros(STEPS + 1),
        "cells_not_convex": np.zeros(STEPS + 1), "total_energy": np.full(STEPS + 1, 5.0),
    }  # fmt: skip
    return history | columns


def fill(value, every=1):
    column = np.zeros(STEPS + 1)
    column[1::every] = value
    return column


def find(history, problem=None):
    return {
        one["rule"]: one for one in judge("finished", "t_end", history, CELLS, problem)["trust"]
    }


def test_a_good_run_has_nothing_that_limits_trust():
    verdict = judge("finished", "t_end reached", make_history(), CELLS)
    assert verdict["trust"] == []
    assert describe_verdict(verdict) == "verdict: finished; no rule finds what would limit trust"


@pytest.mark.parametrize(
    ("rule", "column", "bad", "good"),
    [
        ("rescues", "regrid_rescues", fill(1, 20), fill(1, 190)),
        ("retries", "retries", fill(2, 20), fill(1, 100)),
        ("first-order faces", "first_order_faces", fill(30), fill(3)),
        ("voids", "voided_cells", fill(1, 100), fill(0)),
        ("shared cells", "shared_cells", fill(45), fill(10)),
        ("cells not convex", "cells_not_convex", fill(2, 150), fill(0)),
        ("drift", "total_energy", np.linspace(5.0, 5.0 + 1e-8, STEPS + 1), 5.0 + fill(1e-13)),
        ("dt", "dt", np.geomspace(0.1, 0.1 / 150, STEPS + 1), np.geomspace(0.1, 0.01, STEPS + 1)),
    ],
)
def test_each_rule_tells_beyond_its_limit_and_is_silent_below(rule, column, bad, good):
    found = find(make_history(**{column: bad}))
    assert list(found) == [rule]
    limit = next(one.limit for one in RULES if one.name == rule)
    assert found[rule]["value"] > limit == found[rule]["limit"] and found[rule]["words"]
    assert not find(make_history(**{column: good}))


def make_disk_error(number):
    error = BadInput("out/a")
    error.__cause__ = OSError(number, "of the system")
    return error


@pytest.mark.parametrize(
    ("error", "name"),
    [
        (RunFailure("not convex", cause="collapse"), "time step collapsed"),
        (RunFailure("regrid", cause="no-state"), "state not positive"),
        (RegridFailure("polyline crosses itself", block="plate"), "no grid"),
        (make_disk_error(errno.ENOSPC), "disk full"),
        (make_disk_error(errno.EACCES), "disk not writable"),
        (RunFailure("time step has collapsed"), "failed"),
        (BadInput("columns of a history"), "failed"),
    ],
)
def test_an_early_end_has_the_name_of_its_cause(error, name):
    verdict = judge("ended early", str(error), make_history(), CELLS, name=name_failure(error))
    assert verdict["name"] == name
    line = describe_verdict(verdict)
    assert line.startswith(f"verdict: ended early, {name};") and "\n" not in line


def test_a_verdict_is_kept_and_a_damaged_one_is_told(tmp_path):
    directory = RunDirectory(tmp_path)
    assert read_verdict(directory) is None
    verdict = judge("finished", "t_end reached", make_history(retries=fill(1)), CELLS)
    verdict["dt_trend"] = [{"x": float("nan"), "step": 3}]
    write_verdict(directory, verdict)
    kept = read_verdict(directory)
    assert kept["trust"] == verdict["trust"] and kept["dt_trend"] == [{"x": None, "step": 3}]
    for text in ("", "{", "[]", "{}", '{"status": "finished"}', "[" * 100_000, "\x00\xff"):
        directory.verdict.write_text(text, encoding="utf-8")
        with pytest.raises(BadInput, match=r"verdict\.json is damaged"):
            read_verdict(directory)
    remove_verdict(directory)
    remove_verdict(directory)
    assert read_verdict(directory) is None
