"""Trials of endurance are judged rightly, can be repeated, and go on where they stopped."""

from __future__ import annotations

import json
import sys
import time
from itertools import pairwise

import pytest

from benchmarks.soak import small_runs
from benchmarks.soak.child import Call, Done, call, count_changes, import_commands
from benchmarks.soak.decks import make_deck
from benchmarks.soak.disks import Disks
from benchmarks.soak.kills import Kills, finish
from benchmarks.soak.record import Record, describe
from benchmarks.soak.rivals import Clocks, make_clocks_jump
from benchmarks.soak.settings import change_cells, draw_setting
from benchmarks.soak.small_runs import Undisturbed, find_left_overs, list_words
from benchmarks.soak.trial import Outcome, find_fault, make_random
from runs.deck.reading import read_deck
from runs.deck.schema import make_schema

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a system that forks")


@pytest.fixture(autouse=True, scope="module")
def imported():
    import_commands()


@pytest.fixture
def small_toy(monkeypatch):
    """The toy as the one small run."""
    for name in list(small_runs.SMALL):
        monkeypatch.delitem(small_runs.SMALL, name)
    monkeypatch.setitem(small_runs.SMALL, "toy", ("run.t_end=0.1",))
    monkeypatch.setattr(small_runs, "load_kernels", lambda problem: None)


@pytest.mark.parametrize(
    ("done", "label"),
    [
        (Done(0, "fine\n", "", 0.1), None),
        (Done(2, "", "shockgrid: cells = 0; it has to be at least 1\n", 0.1), None),
        (
            Done(70, "", "shockgrid: a mistake in shockgrid itself (KeyError: 3); --d", 0.1),
            "exit 70",
        ),
        (Done(1, "", "Traceback (most recent call last):\n", 0.1), "traceback"),
        (Done(-11, "", "", 0.1), "exit -11"),
        (Done(2, "", "", 0.1), "an error without words"),
        (Done(2, "", 'shockgrid: "\x1b[2J" is no name\n', 0.1), "control characters"),
        (Done(0, "", "a.py:7: RuntimeWarning: invalid value\n", 0.1), "a warning of Python's"),
        (Done(-24, "", "File step.py\n", 0.1, stuck=True), "no end within the time"),
    ],
)
def test_faults_are_told_apart(done, label):
    fault = find_fault(done)
    assert (fault is None) if label is None else fault.defect and fault.label.startswith(label)


def test_time_of_compilers_is_no_defect():
    fault = find_fault(Done(-24, "", 'File "numba/core/ir.py"\n', 0.1, stuck=True))
    assert not fault.defect and "compiled" in fault.label


def test_processor_time_is_bounded(tmp_path):
    def turn_for_ever():
        while True:
            pass

    done = call(["list"], tmp_path, cpu=1, before=turn_for_ever)
    assert done.stuck and "turn_for_ever" in done.err  # its stack


def test_a_kill_at_a_change_of_files_is_the_same_moment_again(small_toy, tmp_path):
    words = list_words("toy", tmp_path / "run")
    assert count_changes(words, tmp_path, tmp_path / "run") > 20
    left = []
    for name in ("one", "two"):
        path = tmp_path / name
        done = Call(list_words("toy", path), tmp_path, kill_at=(path, 12)).wait()
        assert done.killed
        left.append(sorted(str(p.relative_to(path)) for p in path.rglob("*")))
    assert left[0] == left[1]


def test_whoever_claims_a_directory_clears_parts_of_files(small_toy, tmp_path):
    whole, path = tmp_path / "whole", tmp_path / "run"
    for directory in (whole, path):
        assert call(list_words("toy", directory), tmp_path).code == 0
    for part in (path / ".history.csv.part", path / "dumps" / ".restart_000007.h5.part"):
        part.write_bytes(b"half of")
    other = path / ".interfaces.csv.part"  # of a command that may be writing it
    other.write_bytes(b"half of")
    assert call(["restart", str(path), "-q"], tmp_path).code == 0
    assert find_left_overs(path) == [other.name]
    other.unlink()
    assert not finish("toy", path, whole, tmp_path).defect


def test_other_bits_are_a_defect(small_toy, tmp_path):
    whole, path = tmp_path / "whole", tmp_path / "run"
    assert call(list_words("toy", whole), tmp_path).code == 0
    assert call(list_words("toy", path, "--set", "density=2"), tmp_path).code == 0
    rows = (path / "history.csv").read_text().splitlines()
    cells = rows[1].split(",")
    cells[rows[0].split(",").index("hottest")] = "7.0"
    (path / "history.csv").write_text("\n".join([rows[0], ",".join(cells), *rows[2:]]) + "\n")
    assert finish("toy", path, whole, tmp_path).defect


@pytest.mark.parametrize("kind", [Kills, Disks, Clocks])
def test_trials_of_the_toy_find_nothing(small_toy, tmp_path, kind):
    trials = kind(5, Undisturbed(tmp_path))
    trials.prepare()
    for number in range(2):
        folder = tmp_path / f"trial-{number}"
        folder.mkdir()
        outcome = trials.attempt(number, folder)
        assert not outcome.defect, outcome


def test_clocks_jump(monkeypatch):
    monkeypatch.setattr(time, "monotonic", time.monotonic)  # put back at the end
    for name in ("time", "perf_counter", "process_time"):
        monkeypatch.setattr(time, name, getattr(time, name))
    make_clocks_jump(3)
    read = [time.monotonic() for _ in range(200)]
    assert any(after < before for before, after in pairwise(read))


def test_changed_decks_are_the_same_for_a_seed_and_not_for_another():
    decks = [make_deck(make_random("decks", seed, 3)) for seed in (1, 1, 2)]
    assert decks[0] == decks[1] != decks[2]


@pytest.mark.parametrize("problem", ["interface-instability", "detonation", "plate-on-wedge"])
def test_random_settings_are_within_the_schema(problem):
    schema, kind = make_schema(problem), type(read_deck(problem).deck)
    for number in range(40):
        setting = draw_setting(schema, {}, make_random("settings", 1, number))
        key, _, value = setting.partition("=")
        assert key.split(".")[0] in kind.__struct_fields__, setting
        assert value not in ("nan", "inf")


def test_every_number_of_cells_is_changed():
    deck = {"cells": [24, 4], "run": {"cfl": 0.8}, "block": [{"curves": {"j": {"cells": 7}}}]}
    assert change_cells(deck, 2.0) == ["cells=[48, 8]", "block.0.curves.j.cells=14"]


def test_outcomes_are_kept_and_gone_on_with(tmp_path):
    kept = tmp_path / "soak.jsonl"
    record = Record(kept, seed=4)
    record.add("kills", 0, Outcome("the same bits"), 1.0)
    record.add("kills", 1, Outcome("other bits", True, "step 3"), 2.0)
    with open(kept, "a", encoding="utf-8") as file:
        file.write('{"kind": "kills", "seed": 4, "num')  # killed while it wrote
    again = Record(kept, seed=4)
    assert again.find_next("kills") == 2 and again.find_seconds("kills") == 3.0
    assert Record(kept, seed=5).find_next("kills") == 0
    (summary,) = again.summarise([Kills])["kinds"]
    assert summary["tried"] == 2 and summary["outcomes"] == {"the same bits": 1}
    assert summary["defects"][0]["reproduce"] == "kills:1"
    assert "DEFECT other bits" in describe({"kinds": [summary]})
    again.add("kills", 2, Outcome("the same bits"), 1.0)
    lines = kept.read_text(encoding="utf-8").splitlines()
    assert json.loads(lines[-1])["number"] == 2 and len(lines) == 3
