"""The files of a run have one list."""

from __future__ import annotations

from pathlib import Path

from runs.store.directory import RunDirectory, create_directory
from runs.store.files import DUMPS, KEPT_NAMES, OWN_NAMES


def test_every_file_that_a_run_names_is_in_the_list():
    named = {value.name for value in vars(RunDirectory("a")).values() if isinstance(value, Path)}
    assert named - {"a", DUMPS} == set(OWN_NAMES)
    assert KEPT_NAMES[-1] == "deck.toml"  # by which a run is known: it goes last


def test_force_removes_what_is_listed_and_nothing_else(tmp_path):
    for name in (*KEPT_NAMES, "mine.txt"):
        (tmp_path / name).write_text("x")
    create_directory(str(tmp_path), "toy", force=True)
    assert {path.name for path in tmp_path.iterdir()} == {"mine.txt", DUMPS}
