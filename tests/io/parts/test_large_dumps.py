"""Large dumps: made without a copy in the HDF5 library, written while the run goes on."""

from __future__ import annotations

import os
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
from in_parts import forks, kill_at, names_of_open_files
from toy_problem import ToyDeck, ToyEvolution

import runs.store.files as files
import runs.store.writing as writing
from runs.store.checksum import is_sound, iterate_bytes, seal
from runs.store.directory import RunDirectory
from runs.store.dumps import make_image, read_state

RUN = ("run", "toy", "-q", "--set", "cells=24", "--set", "output.dumps=6")
NAMES = "toy", 'problem = "toy"\n', "s"


@pytest.fixture
def large(monkeypatch):
    """All dumps count as large."""
    monkeypatch.setattr(writing, "LARGE", 0)
    yield
    writing.close_outlines()


def make_evolution(cells: int = 24) -> ToyEvolution:
    return ToyEvolution(ToyDeck(cells=cells))


def join(pieces) -> bytes:
    return b"".join(iterate_bytes(pieces))


@pytest.mark.parametrize("cells", [4, 24, 60])
def test_same_bytes_as_by_way_of_an_image(large, cells):
    evolution = make_evolution(cells)
    for step in range(3):
        besides = {"gauges/x": np.arange(3.0) + step, "gauges/wide": np.full((40, 40), step)}
        image = make_image(evolution, *NAMES, besides)
        pieces = writing.make_pieces(evolution, *NAMES, besides)
        assert join(pieces) == image
        assert join(seal(pieces)) == join(seal(image))
        evolution.advance()
    assert (len(pieces) > 3) == (cells > 4)  # of 4 cells but one array is a hole


@names_of_open_files
@pytest.mark.parametrize("when", ["first", "last"])
def test_a_full_disk_is_told_as_ever(shockgrid, large, monkeypatch, when):
    sync, steps = os.fsync, []
    wanted = "dump_000000" if when == "first" else "dump_000012"

    def full(descriptor):
        if wanted in os.readlink(f"/proc/self/fd/{descriptor}"):
            raise OSError(28, "No space left on device")
        sync(descriptor)

    monkeypatch.setattr(files.os, "fsync", full)
    advance = ToyEvolution.advance
    monkeypatch.setattr(ToyEvolution, "advance", lambda e: steps.append(1) or advance(e))
    code, _, error = shockgrid(
        *RUN, "-o", "run", "--set", "run.max_steps=12", "--set", "output.dumps=1"
    )
    assert code == 2 and f"no space left for run/dumps/{wanted}.h5" in error
    there = [path.name for path in Path("run/dumps").iterdir()]
    if when == "last":
        assert "last restart point is step 0" in error and there == ["dump_000000.h5"]
        assert read_state(Path("run/dumps/dump_000000.h5"))["step"] == 0
    else:
        assert len(steps) < 12 and there == []


@pytest.mark.slow
@forks
def test_killed_between_any_two_file_operations(shockgrid, large):
    words = (*RUN, "--set", "run.max_steps=3", "--set", "output.restart_every=0.000001")
    assert shockgrid(*words, "-o", "one")[0] == 0
    seen = set()
    for number in range(1, 200):
        shutil.rmtree("killed", ignore_errors=True)
        if kill_at(number, (*words, "-o", "killed")) == signal.SIGTERM:
            break
        points = RunDirectory("killed").list_points()
        assert all(is_sound(path) for _, path in points)
        there = tuple(path.name for _, path in points)
        if not there or there in seen:
            continue
        seen.add(there)
        code, _, error = shockgrid("restart", "killed", "-q")
        assert code == 0, (there, error)
        assert shockgrid("compare", "one", "killed")[0] == 0, there
    assert number < 199 and len(seen) >= 3
