"""What the command line says of a run's cost before it, and of its end."""

from __future__ import annotations

import json
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


def test_a_failed_run_has_a_verdict_that_goes_when_it_goes_on(shockgrid):
    code, _, err = shockgrid("run", "toy", "-o", "a", "-q", "--set", "fail_at=20")
    verdict = RunData("a").verdict
    assert code == 3 and verdict["status"] == "ended early" and verdict["name"] == "failed"
    assert verdict["reason"] in err and "cell (1, 2)" in verdict["reason"]
    assert "verdict: ended early, failed" in shockgrid("info", "a")[1]
    code, _, _ = shockgrid("run", "toy", "-o", "a", "-q", "--force")
    assert code == 0 and RunData("a").verdict["status"] == "finished"


def test_a_run_that_was_stopped_is_no_finished_one_until_it_goes_on(shockgrid):
    shockgrid("run", "toy", "-o", "a", "-q", "--set", "run.max_steps=12")
    verdict = RunData("a").verdict
    assert (verdict["status"], verdict["name"]) == ("stopped", "max_steps")
    code, out, _ = shockgrid("restart", "a", "-q", "--set", "run.max_steps=100000")
    assert code == 0 and "verdict: finished" in out


def test_a_killed_run_is_told_as_unfinished(shockgrid):
    shockgrid("run", "toy", "-o", "a", "-q")
    (RunData("a").directory.verdict).unlink()
    assert "verdict: unfinished, it marches on, or was ended by force" in shockgrid("info", "a")[1]


@pytest.mark.parametrize("change", ["unreadable", "edited", "sum taken away"])
def test_a_verdict_that_is_not_as_it_was_is_told(shockgrid, change):
    shockgrid("run", "toy", "-o", "a", "-q")
    path = RunData("a").directory.verdict
    text = path.read_text(encoding="utf-8")
    changed = {
        "unreadable": "{",
        "edited": text.replace('"t_end reached"', '"nothing"'),
        "sum taken away": "\n".join(line for line in text.split("\n") if "crc32" not in line)
        .replace("],\n}", "]\n}"),
    }[change]  # fmt: skip
    path.write_text(changed, encoding="utf-8")
    code, out, _ = shockgrid("info", "a")
    assert code == 2 and "damaged: a/verdict.json" in out and "nothing" not in out
    path.write_text(text, encoding="utf-8")
    assert shockgrid("info", "a")[0] == 0


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


def test_a_cache_that_cannot_be_read_or_written_is_none(shockgrid, own_cache):
    own_cache.mkdir()
    (own_cache / past_runs.DELIVERED.name).write_text("[{]", encoding="utf-8")
    assert past_runs.read_own() == []
    shutil.rmtree(own_cache)
    own_cache.write_text("a file where a folder is wanted", encoding="utf-8")
    assert shockgrid("run", "toy", "-o", "a", "-q")[0] == 0
    past_runs.keep_run(make_past())
    assert past_runs.read_own() == []


def make_past(cells=100, seconds=1e-3, **changes):
    known = dict(
        flow="a", problem="a", cells=cells, t_end=1.0, finest=0.1, first_dt=0.01, steps=100,
        dt=(1.0,) * 20, work=(1.0,) * 20, seconds=seconds, kernels="k",
    )  # fmt: skip
    return past_runs.PastRun(**(known | changes))


def test_a_step_s_seconds_come_from_runs_of_this_machine(own_cache):
    assert past_runs.find_seconds("k", "a", 100) is None
    past_runs.keep_run(make_past(100, 1e-3))
    past_runs.keep_run(make_past(10_000, 1e-2))
    found, sure = past_runs.find_seconds("k", "other", 1000)
    assert found == pytest.approx(10**-2.5, rel=1e-6) and sure > past_runs.SURE
    assert past_runs.find_seconds("k", "other", 100) == (pytest.approx(1e-3), past_runs.SURE)
    assert past_runs.find_seconds("unknown", "a", 100)[0] == pytest.approx(1e-3)
    assert past_runs.find_seconds("unknown", "unknown", 100) is None
    past_runs.keep_run(make_past(100, 4e-3))
    assert len(past_runs.read_own()) == 2, "the newer of two runs of the same kind is kept"
    assert json.loads((own_cache / past_runs.DELIVERED.name).read_text())[-1]["seconds"] == 4e-3


def test_the_delivered_runs_can_be_read_and_are_of_decks_that_exist():
    from runs.deck.reading import packaged_decks, read_deck

    runs = past_runs.read_delivered()
    decks = [read_deck(name) for name in (*packaged_decks(), *{run.problem for run in runs})]
    flows = {past_runs.name_flow(read.problem, read.deck) for read in decks}
    assert len(runs) >= 20 and {run.flow for run in runs} <= flows
    assert all(run.seconds == 0.0 and min(run.dt) > 0.0 and min(run.work) > 0.0 for run in runs)
