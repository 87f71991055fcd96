"""Pictures, films, and what made them."""

from __future__ import annotations

import shutil
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from matplotlib import animation
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.corners import compute_centres
from shockgrid.runs.pictures import fields, film
from shockgrid.runs.pictures.fields import find_field
from shockgrid.runs.pictures.film import make_film
from shockgrid.runs.store.files import seal
from shockgrid.runs.store.provenance import find_provenance, hash_deck
from shockgrid.runs.store.reader import RunData


def run(shockgrid, name: str, *words: str) -> RunData:
    code, _, error = shockgrid("run", "toy", "-q", "-o", name, *words)
    assert code == 0, error
    return RunData(name)


def test_equal_runs_make_equal_bytes_and_say_what_made_them(shockgrid):
    one = run(shockgrid, "one")
    other = run(shockgrid, "other")
    for a, b in zip(one.dumps, other.dumps, strict=True):
        assert a.path.read_bytes() == b.path.read_bytes()
    made = one.dumps[-1].provenance
    assert made == find_provenance(Path("one/deck.toml").read_text())
    assert made["numpy"] == np.__version__ and made["platform"]
    assert made["deck_sha256"] == hash_deck(one.dumps[-1].deck_text)
    assert "dirty" not in made["version"]


def test_what_made_a_run_is_no_difference(shockgrid):
    one = run(shockgrid, "one")
    shutil.copytree("one", "other")
    path = Path("other/dumps") / one.dumps[-1].path.name
    with h5py.File(path, "r+") as file:
        file["provenance"].attrs["version"] = "0.0.1"
    path.write_bytes(b"".join(seal(path.read_bytes())))
    assert shockgrid("compare", "one", "other")[0] == 0
    assert "@version = '0.0.1'" in shockgrid("inspect", str(path))[1]
    with h5py.File(path, "r+") as file:  # as a dump of an older version
        del file["provenance"]
    path.write_bytes(b"".join(seal(path.read_bytes())))
    assert shockgrid("info", str(path))[0] == 0
    assert shockgrid("compare", "one", "other")[0] == 0


@pytest.fixture
def run_of_film(shockgrid):
    words = ("-q", "-o", "run", "--set", "output.dumps=5", "--set", "cells=6")
    assert shockgrid("run", "toy", *words)[0] == 0
    return RunData("run")


def without_ffmpeg(monkeypatch):
    known = type(animation.writers).is_available

    def ask(self, name):
        return name != "ffmpeg" and known(self, name)

    monkeypatch.setattr(type(animation.writers), "is_available", ask)


def test_a_gif_has_a_frame_for_each_dump(run_of_film, shockgrid, monkeypatch):
    without_ffmpeg(monkeypatch)
    code, said, error = shockgrid("film", "run", "--fps", "4", "--dpi", "30", "--mesh")
    assert code == 0, error
    path = Path(said.strip())
    assert path == Path("run/film-rho-mesh.gif")
    with Image.open(path) as film:
        assert film.n_frames == len(run_of_film.dumps) == 6
        assert film.info["duration"] == 250
        frames = []
        for number in range(film.n_frames):
            film.seek(number)
            frames.append(np.asarray(film.convert("L"), dtype=float))
    assert all(np.abs(a - b).max() > 30 for a, b in pairwise(frames))
    assert not [name for name in Path("run").iterdir() if "part" in name.name]


def test_a_film_that_fails_leaves_nothing_and_keeps_the_old(run_of_film, monkeypatch):
    without_ffmpeg(monkeypatch)
    old = Path("run/film-rho.gif")
    old.write_bytes(b"old")

    def fail(number):
        if number:
            raise BadInput("no more")

    monkeypatch.setattr(film, "make_frames", lambda *words: fail)
    with pytest.raises(BadInput, match="no more"):
        make_film("run", dpi=30)
    assert old.read_bytes() == b"old"
    assert [p.name for p in Path("run").iterdir() if "part" in p.name] == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("-o", "film.avi"), "has to end in .mp4 or .gif"),
        (("-o", "film.mp4"), "needs the program ffmpeg"),
        (("-o", "nowhere/film.gif"), "is not a folder"),
        (("--follow", "--zoom", "0,1,0,1"), "use one"),
        (("--zoom", "5,6,0,1"), "is outside the domain"),
        (("pressure",), "has no field 'pressure'; known are: rho, q"),
        (("--fps", "0"), "fps"),
    ],
)
def test_wrong_words_are_told(run_of_film, shockgrid, monkeypatch, words, told):
    without_ffmpeg(monkeypatch)
    code, _, error = shockgrid("film", "run", *words)
    assert code == 2 and told in error
    assert not list(Path().rglob("*.gif"))


def make_block(seed: int = 0) -> SimpleNamespace:
    """A bent grid, sheared by chance, with fields linear in x and y and a solid rotation."""
    x, y = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 9), indexing="ij")
    shift = np.random.default_rng(seed).uniform(-0.015, 0.015, (2, *x.shape))
    nodes = np.array([x + 0.1 * y * y, y + 0.08 * np.sin(3 * x)]) + shift
    x, y = compute_centres(nodes)
    fields = {"rho": 5 + 3 * x - 4 * y, "p": 1 - 5 * x - 12 * y, "u": -2.5 * y + 7, "v": 2.5 * x}
    return SimpleNamespace(nodes=nodes, cell_fields=fields, state_fields={})


@pytest.mark.parametrize(
    ("name", "exact"), [("schlieren", 5.0), ("pressure_gradient", 13.0), ("vorticity", 5.0)]
)
def test_gradients_of_linear_fields_are_exact_on_a_bent_grid(name, exact):
    block = make_block()
    assert find_field(block, name).unit != "1"
    np.testing.assert_allclose(find_field(block, name).compute(block), exact, rtol=1e-12)


@pytest.mark.parametrize(("name", "halves"), [("rho", 1), ("", 2)])
def test_a_grid_over_a_field_leaves_the_mirror_image_free(name, halves, monkeypatch):
    block = make_block()
    drawn = []
    monkeypatch.setattr(fields, "draw_grid_lines", lambda _, nodes, *words: drawn.append(nodes))
    sheet = fields.Sheet(block.nodes, "gas", "gas", block.cell_fields)
    image = fields.Sheet(block.nodes * [[[1]], [[-1]]], "gas", "gas mirrored", sheet.fields)
    look = fields.Colours(Normalize(0, 1), "viridis", 1.0, "density", "neither")
    fields.draw_blocks(Figure().add_subplot(), [sheet, image], name, look, 1.0, (0, 1, 0, 1))
    assert len(drawn) == halves and (drawn[0][1] > -0.1).all()


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder for runs that several tests look at."""
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def toys(shockgrid, kept):
    """Copies of two runs of the toy."""
    for name, cells in (("one", "6"), ("other", "8")):
        if not (kept / name).exists():
            words = ("-q", "-o", str(kept / name), "--set", f"cells={cells}")
            assert shockgrid("run", "toy", *words, "--set", "output.dumps=2")[0] == 0
        shutil.copytree(kept / name, name)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--line", "1,2,3"), "two points in metres"),
        (("--line", "1,2,1,2"), "two points in metres"),
        (("--line", "1,2,x,2"), "is not a number"),
        (("--line", "7,7,8,8"), "it meets no cell of"),
        (("--what", "line"), "--line X0,Y0,X1,Y1 says which"),
        (("--csv", "a.csv"), "--line says which"),
        (("--what", "mesh", "--beside", "one"), "not for 'mesh'"),
        (("--beside", "nowhere"), "nowhere does not exist"),
        (("vorticity",), "has no field 'vorticity'; known are: rho, q, schlieren"),
        (("density",), "has no field 'density'; did you mean 'rho'?"),
        (("rate",), "has no field 'rate'"),
    ],
)
def test_wrong_words_are_told_in_a_sentence(toys, shockgrid, words, told):
    code, _, error = shockgrid("plot", "one", *words)
    assert code == 2 and told in error and len(error.splitlines()) == 1
    assert not list(Path().glob("*.csv")) and not list(Path("one").glob("*.png"))


def test_pictures_of_one_run_have_names_of_their_own(shockgrid, toy):
    assert shockgrid("run", "toy", "-q", "-o", "mine", "--set", "run.max_steps=3")[0] == 0
    words = ("plot", "mine", "q", "--dpi", "30")
    names = [shockgrid(*words, *more)[1].strip() for more in (
        (), ("--at", "start"), ("--mesh",), ("--limits", "0,1", "--colours", "magma"),
    )]  # fmt: skip
    assert len(set(names)) == 4 and names[0] == "mine/fields-q.png"
    code, _, error = shockgrid(*words, "--colours", "magmaa")
    assert code == 2 and "did you mean 'magma'" in error
    code, _, error = shockgrid(*words, "--limits", "1,0")
    assert code == 2 and "low < high" in error
