"""Limits of wall time and SIGUSR1, with real processes."""

from __future__ import annotations

import itertools
import signal
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from processes import wait_for

from shockgrid.runs.march import runner as limits
from shockgrid.runs.march.runner import WallLimit, parse_duration
from shockgrid.runs.store.reader import RunData


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("2h", 7200), ("90m", 5400), ("1:30:00", 5400), ("45", 45), ("1h30m", 5400), ("1.5h", 5400),
     ("2.5", 2.5), ("10s", 10), ("100:00:01", 360001)],
)  # fmt: skip
def test_durations(text, seconds):
    assert parse_duration(text) == seconds


def test_a_limit_leaves_time_for_the_last_restart_point(monkeypatch):
    monkeypatch.setattr(limits, "time", SimpleNamespace(monotonic=lambda: 0.0))
    limit = WallLimit("10s")
    assert not limit.reached
    limit.note_step(3.0)
    assert not limit.reached
    limit.note_write(2.5)
    assert limit.reached


def test_a_run_ends_at_its_limit_and_goes_on(shockgrid, toy, monkeypatch):
    """By a clock that goes on by a minute whenever it is looked at."""
    minutes = itertools.count()
    clock = SimpleNamespace(**vars(time) | {"monotonic": lambda: 60.0 * next(minutes)})
    monkeypatch.setattr(limits, "time", clock)
    words = ("--set", "output.dumps=2")
    code, output, error = shockgrid("run", "toy", "-o", "limited", "--max-wall", "12m", *words)
    assert code == 0, error
    assert "--max-wall 12m reached" in output and "shockgrid restart limited" in output
    steps = [RunData("limited").history["step"][-1]]
    assert RunData("limited").directory.list_points()[-1][0] == steps[0] >= 1
    while "t_end reached" not in output:  # as a queue would: again and again
        code, output, error = shockgrid("restart", "limited", "--max-wall", "12m")
        assert code == 0, error
        steps.append(RunData("limited").history["step"][-1])
        assert steps[-1] > steps[-2]
    assert len(steps) > 2
    shockgrid("run", "toy", "-o", "whole", *words)
    code, text, _ = shockgrid("compare", "whole", "limited")
    assert code == 0, text


def test_sigusr1_writes_a_restart_point_and_the_run_goes_on(shockgrid, spawn, toy):
    process = spawn("run", "toy", "-o", "run", "--set", "output.dumps=1", "--set", "holds=[4, 6]")
    wait_for(toy / "held-4", process)
    process.send_signal(signal.SIGUSR1)
    Path("go-4").touch()
    wait_for(toy / "held-6", process)
    assert list(toy.glob("run/dumps/restart_*.h5")) == [toy / "run/dumps/restart_000005.h5"]
    Path("go-6").touch()
    output, error = process.communicate()
    assert process.returncode == 0, error
    assert "t_end reached" in output and RunData("run").history["step"][-1] > 6
    assert "SIGUSR1: restart point at step 5" in (toy / "run/run.log").read_text()
    shockgrid("run", "toy", "-o", "whole", "-q", "--set", "output.dumps=1")
    code, text, _ = shockgrid("compare", "whole", "run")
    assert code == 0, text
