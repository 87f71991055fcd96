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
from runs.pictures.command import new_figure
from runs.pictures.fields import View, find_range, make_sheets
from runs.pictures.film import Frames, choose_windows, make_film
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


def test_one_scale_spans_all_frames(run):
    view, paths = View(), [dump.path for dump in run.dumps]
    boxes = choose_windows(paths, view, follow=False)
    ranges = [find_range(make_sheets(d, ["q"], view), "q", boxes[0]) for d in run.dumps]
    frames = Frames(new_figure(), run.dumps, "q", view, boxes, ranges)
    every = np.concatenate([b.cell_fields["q"].ravel() for d in run.dumps for b in d.blocks])
    assert (frames.norm.vmin, frames.norm.vmax) == (every.min(), every.max())
    for number in range(len(paths)):
        frames.draw(number)
        norms = [mesh.norm for mesh in frames.axes.collections[:2]]
        assert all(norm is frames.norm for norm in norms)


def test_the_window_follows_the_interface(run):
    paths = [dump.path for dump in run.dumps]
    boxes = np.array(choose_windows(paths, View(), follow=True))
    assert np.ptp(boxes[:, 1] - boxes[:, 0]) < 1e-12 and np.ptp(boxes[:, 3] - boxes[:, 2]) < 1e-12
    assert (boxes[:, 1] - boxes[:, 0] < 2.0).all()  # the domain is 2 m long
    for box, dump in zip(boxes, run.dumps, strict=True):
        line = dump.block("left").nodes[0, -1]  # the interface sways about x = 1
        assert box[0] < line.min() and line.max() < box[1]


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


def test_one_dump_is_no_film(run, shockgrid):
    for dump in run.dumps[1:]:
        dump.path.unlink()
    code, _, error = shockgrid("film", "run")
    assert code == 2 and "a film needs two or more" in error
