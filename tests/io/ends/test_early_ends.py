"""Runs that end early leave a picture, the sentence, what has helped, and a point to go back to."""

from __future__ import annotations

import functools
import shlex

import matplotlib.image
import numpy as np
import pytest

from shockgrid.regrid.errors import Place, RunFailure
from shockgrid.runs.deck.reading import read_deck
from shockgrid.runs.early_end.causes import ENDS, Setting
from shockgrid.runs.early_end.explain import find_calm_point
from shockgrid.runs.march.launching import start_runner
from shockgrid.runs.store.directory import RunDirectory
from shockgrid.runs.store.reader import RunData


def run_toy(shockgrid, *settings, at=40):
    words = [word for setting in (f"fail_at={at}", *settings) for word in ("--set", setting)]
    return shockgrid("run", "toy", "-q", "-o", "run", *words)


def count_colours(path):
    pixels = matplotlib.image.imread(path)[..., :3].reshape(-1, 3)
    return len(np.unique((255 * pixels).astype(int), axis=0))


def test_the_place_is_drawn_and_the_sentence_kept(shockgrid, toy):
    code, output, error = run_toy(shockgrid)
    assert code == 3 and not output
    first, *rest = error.splitlines()
    assert "block 'left', cell (1, 2)" in first and "last restart point is step" in first
    picture = toy / "run" / "early-end.png"
    assert any(line.endswith("run/early-end.png") for line in rest)
    assert count_colours(picture) > 200
    kept = (toy / "run" / "early-end.txt").read_text().splitlines()
    assert kept == [line.removeprefix("shockgrid: ") for line in error.splitlines()]


def test_the_last_state_can_be_drawn_and_the_restart_points_are_as_before(shockgrid):
    run_toy(shockgrid)
    data = RunData("run")
    assert data.outputs[-1].step == 40 and not data.outputs[-1].has_state
    assert data.outputs[-1].t == data.history["t"][-1]
    assert data.restart_step < 40
    assert shockgrid("plot", "run", "--mesh", "--at", "end", "--dpi", "30")[0] == 0


def test_the_settings_of_the_cause_are_told_with_commands_that_work(shockgrid, monkeypatch):
    helped = (Setting("run.cfl", 0.5, "shorter steps"), Setting("no.such", "1", "x"))
    cause = ENDS["no-state"].__class__("density -1", "the toy was told to", helped, "`fail_at=-1`")
    monkeypatch.setitem(ENDS, "toy", cause)
    failure = functools.partial(RunFailure, cause="toy", place=Place("left", (1, 2)))
    monkeypatch.setattr("toy_problem.RunFailure", failure)
    code, _, error = run_toy(shockgrid)
    assert code == 3 and "what it means: the toy was told to" in error
    assert "no.such" not in error and "what else can be done: fail_at=-1" in error
    (line,) = [line for line in error.splitlines() if "--set run.cfl" in line]
    words = shlex.split(line.partition("shockgrid:")[2].partition("   (")[0])
    point = find_calm_point(RunDirectory("run"))
    assert words[1:] == ["restart", "run", "--at", str(point), "--set", "run.cfl=0.375"]
    # goes on from there, as far as it is let, and what was said of the end is gone
    code, _, _ = shockgrid(*words[1:], "--set", "run.max_steps=39", "-q")
    data = RunData("run")
    assert code == 0 and data.deck.run.cfl == 0.375 and data.history["step"][-1] == 39
    assert not data.directory.early_picture.exists() and not data.directory.early_words.exists()


def test_the_error_in_python_carries_it(toy):
    runner = start_runner(read_deck("toy", ("fail_at=30",)), "run", False, True, print)
    with pytest.raises(RunFailure) as failure:
        runner.start()
    end = failure.value.early_end
    assert end.picture.exists() and end.point == find_calm_point(runner.directory)
    assert list(end.lines) == failure.value.__notes__
    assert "\n" not in str(failure.value)


@pytest.mark.slow
def test_a_flow_that_ends_early_ends_well_with_the_setting_that_is_told(shockgrid, toy):
    settings = ("--set", "cells=16", "--set", "mesh=follow", "--set", "gamma=1.1")
    code, _, error = shockgrid("run", "sedov", "-q", "-o", "run", *settings)
    assert code == 3 and "not convex, the first is i=" in error
    assert count_colours(toy / "run" / "early-end.png") > 200
    end = RunData("run").outputs[-1]
    assert end.step == RunData("run").history["step"][-1]
    (line,) = [line for line in error.splitlines() if "--set mesh=fixed" in line]
    words = shlex.split(line.partition("shockgrid:")[2].partition("   (")[0])
    code, screen, _ = shockgrid(*words[1:], "-o", "again")
    assert code == 0 and "t_end reached" in screen
    state = RunData("again").outputs[-1].state()
    assert state["clock/t"] == 1.0 > end.t and state["gas/state"][0].min() > 0.0


@pytest.mark.parametrize("cells", [8, 20, 50])
def test_near_vacuum_stays_positive_on_few_cells(shockgrid, cells):
    words = ("riemann-123", "-q", "-o", "run", "--set", f"cells={cells}")
    assert shockgrid("run", *words)[0] == 0
    for dump in RunData("run").outputs:
        for block in dump.blocks:
            assert block.rho.min() > 0.0 and block.p.min() > 0.0
