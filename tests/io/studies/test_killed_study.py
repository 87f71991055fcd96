"""A study that is killed goes on: every point once, and a table of all."""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from builders import ROOT

STEPS = 30
WORDS = ("--set", f"run.max_steps={STEPS}", "--set", "output.dumps=0", "--jobs", "2", "-q")


def start_study(folder: Path, points: int) -> subprocess.Popen:
    vary = ("--vary", f"rayleigh=1000:2000:{points}")
    return subprocess.Popen(
        [sys.executable, "-m", "runs.cli", "study", "convection-1d", *vary, *WORDS, "-o", folder],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def count_results(folder: Path) -> int:
    return len(list(folder.glob("runs/*/result.json")))


def kill_after(process: subprocess.Popen, folder: Path, results: int) -> int:
    """kill -9 as soon as there are so many results; how many there were a second later."""
    while count_results(folder) < results:
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    time.sleep(1.0)  # the workers end with it
    return count_results(folder)


def kill_twice_and_finish(folder: Path, points: int) -> None:
    first = kill_after(start_study(folder, points), folder, points // 3)
    second = kill_after(start_study(folder, points), folder, 2 * points // 3)
    assert points // 3 <= first < second < points
    last = start_study(folder, points)
    out, err = last.communicate()
    assert last.returncode == 0, err
    assert f"{points} runs: {points - second} computed now, {second} there already, 0 failed" in out
    rows = list(csv.DictReader((folder / "study.csv").read_text().splitlines()))
    assert len(rows) == points
    assert all(row["state"] == f"max_steps = {STEPS} reached" for row in rows)
    logs = [path.read_text() for path in sorted(folder.glob("runs/*/run.log"))]
    assert len(logs) == points
    ended = [len(re.findall(rf"reached at step {STEPS}\b", log)) for log in logs]
    assert ended == [1] * points  # none was computed twice
    begun = [log.count("start: ") + log.count("restart from step") for log in logs]
    assert sum(begun) <= points + 4  # two workers, killed twice


@pytest.mark.slow
def test_a_study_killed_twice_has_every_run_once(tmp_path):
    kill_twice_and_finish(tmp_path / "study", 12)
