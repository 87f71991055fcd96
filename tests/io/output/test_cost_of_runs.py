"""What the command line says of a run's cost before it, and of its end."""

from __future__ import annotations

import shutil
from collections import namedtuple

import pytest

from runs.forecast import past_runs
from runs.store.reader import RunData

Usage = namedtuple("Usage", "total used free")


@pytest.fixture(autouse=True)
def own_cache(monkeypatch, tmp_path):
    """Past runs of these tests are kept among themselves; no kernels are needed."""
    home = tmp_path / "cache"
    monkeypatch.setattr(past_runs, "find_home", lambda: home)
    return home


def set_free(monkeypatch, free):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(1e15, 0.0, free))


def test_the_first_lines_and_a_dry_run_say_cells_memory_and_disk(shockgrid):
    for words in (("--dry-run",), ("-o", "a")):
        code, out, err = shockgrid("run", "toy", *words)
        said = out + err
        assert code == 0 and "128 cells (left 8 x 8, right 8 x 8)" in said
        assert "cost: memory about 190 MB" in said and "21 dumps of" in said


def test_a_finished_run_says_so_in_its_second_line_and_in_a_file(shockgrid):
    code, out, _ = shockgrid("run", "toy", "-o", "a", "-q")
    line = out.splitlines()[1]
    assert code == 0 and line == "verdict: finished; no rule finds what would limit trust"
    verdict = RunData("a").verdict
    assert verdict["status"] == "finished" and verdict["trust"] == []
    assert verdict["name"] == "t_end reached"
    assert line in shockgrid("info", "a")[1].splitlines()


def test_a_disk_that_will_not_hold_the_run_is_told_before_it(shockgrid, monkeypatch, toy):
    words = ("run", "toy", "--set", "cells=100", "--set", "output.dumps=1000")
    set_free(monkeypatch, 5e8)
    code, _, err = shockgrid(*words, "--set", "run.max_steps=1", "-o", "a")
    assert code == 0 and "caution: the run will want about 1.3" in err and "output.dumps" in err
    set_free(monkeypatch, 1e6)
    code, _, err = shockgrid(*words, "-o", "never")
    assert code == 2 and "a run needs two dumps of 1.34 MB at the least" in err
    assert not (toy / "never").exists()
    code, out, _ = shockgrid(*words, "-o", "never", "--dry-run")
    assert code == 0 and "caution: the disk of never has 1 MB free" in out
