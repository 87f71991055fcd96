"""What ranks have said to each other, on the closing screen and in run.log."""

from __future__ import annotations

import pytest
from test_world_on_threads import run_with_followers

from runs.cli.main import main
from runs.ranks.account import read_books
from runs.store.directory import open_directory

STEPS, RING = 5, 184  # bytes of a face along a side: four rows of nodes, three of cells


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    folder = tmp_path_factory.mktemp("books") / "two"
    assert run_with_followers(2, folder)[0] == [0, 0]
    return open_directory(folder)


def test_a_step_tells_nodes_and_states_once_and_no_whole_blocks(directory):
    books = read_books(directory.log.read_text())
    assert (books["ranks"], books["steps"]) == (2, STEPS)
    assert books["calls"]["nodes"] == books["calls"]["states"] == STEPS
    assert books["calls"]["whole blocks"] <= 3 * 4  # for the dump at the end alone


def test_its_bytes_are_those_of_the_sides_but_for_their_corners(directory):
    from runs.store.reader import RunData

    books = read_books(directory.log.read_text())
    blocks = RunData(directory.path).dumps[-1].blocks
    faces = sum(2 * (ni - 1 + nj - 1) for ni, nj in (b.nodes.shape[1:] for b in blocks))
    told = (books["bytes"]["nodes"] + books["bytes"]["states"]) / STEPS
    assert 0.6 * RING * faces < told < 1.1 * RING * faces


def test_the_closing_screen_says_so_and_that_of_one_process_is_silent(directory, tmp_path, capsys):
    screen = directory.summary.read_text()
    (line,) = [line for line in screen.splitlines() if line.startswith("messages of ranks: ")]
    assert "a step, MB of" in line and line.endswith("of a step are waits for them")
    words = ["triple-point", "--set", "cells=8", "--set", "run.max_steps=1"]
    assert main(["run", *words, "-o", str(tmp_path / "one"), "-q"]) == 0
    assert "ranks" not in capsys.readouterr().out
    assert read_books(open_directory(tmp_path / "one").log.read_text()) is None
