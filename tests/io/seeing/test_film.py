"""Films: a frame for each dump, one colour scale, a window that follows the interface."""

from __future__ import annotations

import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib import animation
from PIL import Image

from regrid.errors import BadInput
from runs.pictures.film import Frames, make_film
from runs.store.reader import RunData


@pytest.fixture
def run(shockgrid):
    words = ("-q", "-o", "run", "--set", "output.dumps=5", "--set", "cells=6")
    assert shockgrid("run", "toy", *words)[0] == 0
    return RunData("run")


def without_ffmpeg(monkeypatch):
    known = type(animation.writers).is_available

    def ask(self, name):
        return name != "ffmpeg" and known(self, name)

    monkeypatch.setattr(type(animation.writers), "is_available", ask)


def test_a_gif_has_a_frame_for_each_dump(run, shockgrid, monkeypatch):
    without_ffmpeg(monkeypatch)
    code, said, error = shockgrid("film", "run", "--fps", "4", "--dpi", "30", "--mesh")
    assert code == 0, error
    path = Path(said.strip())
    assert path == Path("run/film-rho.gif")
    with Image.open(path) as film:
        assert film.n_frames == len(run.dumps) == 6
        assert film.info["duration"] == 250
        frames = []
        for number in range(film.n_frames):
            film.seek(number)
            frames.append(np.asarray(film.convert("L"), dtype=float))
    assert all(np.abs(a - b).max() > 30 for a, b in pairwise(frames))
    assert not [name for name in Path("run").iterdir() if "part" in name.name]


@pytest.mark.skipif(not animation.writers.is_available("ffmpeg"), reason="ffmpeg is not here")
def test_an_mp4_where_ffmpeg_is(run, shockgrid):
    code, said, error = shockgrid("film", "run", "q", "--fps", "3", "--dpi", "40")
    assert code == 0, error
    path = Path(said.strip())
    assert path == Path("run/film-q.mp4") and path.read_bytes()[4:8] == b"ftyp"
    if shutil.which("ffprobe"):
        asked = ["ffprobe", "-v", "error", "-show_entries", "stream=nb_frames", "-of", "csv=p=0"]
        assert subprocess.run([*asked, path], capture_output=True, text=True).stdout.strip() == "6"


def test_a_film_that_fails_leaves_nothing_and_keeps_the_old(run, monkeypatch):
    without_ffmpeg(monkeypatch)
    old = Path("run/film-rho.gif")
    old.write_bytes(b"old")

    def fail(self, number):
        if number:
            raise BadInput("no more")

    monkeypatch.setattr(Frames, "draw", fail)
    with pytest.raises(BadInput, match="no more"):
        make_film("run", dpi=30)
    assert old.read_bytes() == b"old"
    assert [p.name for p in Path("run").iterdir() if "part" in p.name] == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("-o", "film.avi"), "has to end in .mp4 or .gif"),
        (("-o", "film.mp4"), "needs the program ffmpeg"),
        (("-o", "nowhere/film.gif"), "is no folder"),
        (("--follow", "--zoom", "0,1,0,1"), "take one"),
        (("--zoom", "5,6,0,1"), "is outside the domain"),
        (("pressure",), "has no field 'pressure'; there are: rho, q"),
        (("--fps", "0"), "fps"),
    ],
)
def test_wrong_words_are_told(run, shockgrid, monkeypatch, words, told):
    without_ffmpeg(monkeypatch)
    code, _, error = shockgrid("film", "run", *words)
    assert code == 2 and told in error
    assert not list(Path().rglob("*.gif"))
