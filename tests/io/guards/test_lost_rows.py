"""A history that was deleted, cut or edited: told, and mended where the dumps allow it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from runs.store.reader import RunData

HISTORY = Path("run/history.csv")


@pytest.fixture
def whole(shockgrid):
    """A stopped run with dumps at its start and at later steps; its history as it was."""
    words = ("-q", "-o", "run", "--set", "run.max_steps=30", "--set", "run.t_end=0.4")
    assert shockgrid("run", "toy", *words)[0] == 0
    run = RunData("run")
    return run.history, [dump.step for dump in run.dumps]


def change(number, words):
    lines = HISTORY.read_text().split("\n")
    lines[number] = words(lines[number])
    HISTORY.write_text("\n".join(lines))


def drop(first, last):
    lines = HISTORY.read_text().split("\n")
    HISTORY.write_text("\n".join(lines[:first] + lines[last:]))


DAMAGES = {
    "deleted": (HISTORY.unlink, "history.csv is missing, while the dumps go to step 30"),
    "cut out": (lambda: drop(3, 9), "history.csv lacks the rows of steps 2 to 7"),
    "without its start": (lambda: drop(1, 4), "history.csv lacks the rows of steps 0 to 2"),
    "cut off": (lambda: drop(20, 32), "history.csv ends at step 18, the dumps go to step 30"),
    "edited": (
        lambda: change(7, lambda line: line.replace(",", ",1", 1)),
        "history.csv is damaged in line 8 and lacks the rows of step 6",
    ),
    "sum edited": (lambda: change(7, lambda line: line[:-1] + "x"), "is damaged in line 8"),
    "other names": (lambda: change(0, str.upper), "history.csv is damaged in its first line"),
    "garbage": (lambda: HISTORY.write_bytes(bytes(range(256)) * 9), "history.csv is damaged in"),
    "twice": (lambda: change(5, lambda line: f"{line}\n{line}"), "is damaged in line 7"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_lost_is_told_and_measured_anew(shockgrid, whole, damage):
    before, dumped = whole
    work, words = DAMAGES[damage]
    work()
    for command in (
        ("info", "run"),
        ("plot", "run", "--what", "history"),
        ("compare", "run", "run"),
    ):
        code, text, error = shockgrid(*command)
        assert code == 2 and words in text + error, (command, text + error)
    code, text, error = shockgrid("restart", "run", "-q", "--set", "run.max_steps=34")
    assert code == 0 and "run/history.csv " in error, error
    after = RunData("run").history
    assert after["step"][-1] == 34 and after["step"][0] == 0
    at = np.isin(after["step"], dumped)
    assert set(dumped) <= set(after["step"])  # those of the dumps are there, measured anew
    for name in ("t", "hottest", "total_heat"):  # the same bits as before the damage
        assert (after[name][at] == before[name][np.isin(before["step"], dumped)]).all(), name
    kept = after["step"] <= 30
    same = np.isin(before["step"], after["step"])
    assert (after["hottest"][kept] == before["hottest"][same]).all()
    lost = 31 - same.sum()
    assert (f"caution: the history has lost {lost} row" in text) == bool(lost), text
    code, text, _ = shockgrid("info", "run")
    assert code == 0 and ("the history has lost" in text) == bool(lost)


def test_the_history_of_another_run_is_not_taken(shockgrid, whole):
    shockgrid("run", "toy", "-q", "-o", "other", "--set", "run.max_steps=30", "--set", "cells=6")
    HISTORY.write_bytes(Path("other/history.csv").read_bytes())
    code, _, error = shockgrid("restart", "run", "-q", "--set", "run.max_steps=34")
    assert code == 0 and "has a row of step 30 that is not of t =" in error
    assert "measured anew on dumps: steps" in error
    assert Path("run/superseded/history.csv").read_bytes() == Path("other/history.csv").read_bytes()
