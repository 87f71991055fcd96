"""Time left, trend of the step, verdict."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from shockgrid.regrid.errors import BadInput, RegridFailure, RunFailure
from shockgrid.runs.early_end.causes import name_failure
from shockgrid.runs.forecast import ShortSteps, TimeLeft
from shockgrid.runs.inspection.account import RULES, describe_verdict, judge


def follow(dts, limit="sound"):
    """The lines on steps of these lengths."""
    blocks = [SimpleNamespace(name="a"), SimpleNamespace(name="b")]
    run = SimpleNamespace(blocks=blocks, step=0, t=0.0)
    said = []
    short = ShortSteps(run, said.append)
    for dt in dts:
        run.step = run.step + 1
        run.t = run.t + dt
        cell = {"fastest_block": 1, "fastest_i": 3, "fastest_j": 4}
        short.follow({"dt": dt, "dt_limit": limit, **cell})
    return said


def test_a_hundredth_of_the_largest_dt_is_told_once_with_cell_and_settings():
    (line,) = follow(np.geomspace(1.0, 1.01e-3, 400))
    assert "limited by sound; fastest cell: b, i=3, j=4; " in line
    assert "what can be changed: run.small_cells=0.1" in line
    (line,) = follow([1.0, 5e-3], "stretching")
    assert "cell:" not in line and "what can be changed: run.cfl halved" in line
    assert not follow([1.0, 0.011, 0.5, 0.02]) and not follow([1.0, 1e-6], "retry")


def march(step_of, t_end=1.0, seconds=lambda t: 0.01):
    """Steps, times and wall times of a run with dt = step_of(t)."""
    t = 0.0
    wall = 0.0
    rows = []
    while t < t_end:
        t = min(t + step_of(t), t_end)
        wall += seconds(t)
        rows.append((len(rows) + 1, t, wall))
    return rows


def foretell(rows, share, t_end=1.0):
    """The forecast at this share of the wall time, and what came true."""
    left = TimeLeft(t_end)
    for step, t, wall in rows:
        left.note(step, t, wall)
        if wall >= share * rows[-1][2]:
            return left.foretell(step, t, wall), rows[-1][2] - wall
    raise AssertionError


@pytest.mark.parametrize("share", [0.05, 0.25, 0.5, 0.9])
def test_a_steady_run_is_foretold_to_a_per_cent(share):
    (low, likely, high), real = foretell(march(lambda t: 1e-3), share)
    assert likely == pytest.approx(real, rel=0.02)
    assert low <= real <= high


@pytest.mark.parametrize("fall", [3.0, 10.0, 30.0])
def test_a_falling_dt_is_followed(fall):
    rows = march(lambda t: 2e-3 * np.exp(-np.log(fall) * t))
    (low, likely, high), real = foretell(rows, 0.25)
    t = next(t for _, t, wall in rows if wall >= 0.25 * rows[-1][2])
    naive = 0.25 * rows[-1][2] * (1.0 - t) / t
    assert 0.67 < likely / real < 1.5
    assert abs(np.log(likely / real)) < abs(np.log(naive / real))
    assert low <= real <= high


STEPS = 200
CELLS = 1000


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
    assert describe_verdict(verdict) == "verdict: finished; no warnings"


@pytest.mark.parametrize(
    ("rule", "column", "bad", "good"),
    [
        ("untangling events", "regrid_rescues", fill(1, 20), fill(1, 190)),
        ("retries", "retries", fill(2, 20), fill(1, 100)),
        ("first-order faces", "first_order_faces", fill(30), fill(3)),
        ("voids", "voided_cells", fill(1, 100), fill(0)),
        ("shared cells", "shared_cells", fill(45), fill(10)),
        ("overlap", "contact_overlap", fill(0.2, 150), fill(0.05)),
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


def make_disk_error(words):
    error = BadInput("out/a")
    error.__cause__ = OSError(28, words)
    return error


@pytest.mark.parametrize(
    ("error", "name"),
    [
        (RunFailure("not convex", cause="collapse"), "time step collapsed"),
        (RunFailure("regrid", cause="no-state"), "state not positive"),
        (RegridFailure("polyline crosses itself", block="plate"), "no grid"),
        (make_disk_error("No space left on device"), "no space left on device"),
        (RunFailure("time step has collapsed"), "failed"),
        (BadInput("columns of a history"), "failed"),
    ],
)
def test_an_early_end_has_the_name_of_its_cause(error, name):
    verdict = judge("ended early", str(error), make_history(), CELLS, name=name_failure(error))
    assert verdict["name"] == name
    line = describe_verdict(verdict)
    assert line.startswith(f"verdict: ended early, {name};") and "\n" not in line
