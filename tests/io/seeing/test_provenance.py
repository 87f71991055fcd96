"""Every dump and log says what made it; the numbers and the bits of equal runs stay equal."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from regrid.errors import BadInput
from regrid.given import read_grid
from runs.grids.files import write_grid
from runs.grids.quality import judge
from runs.inspection.tree import inspect_differences
from runs.store.checksum import seal
from runs.store.provenance import HOME, describe_software, find_commit, find_provenance, hash_deck
from runs.store.reader import RunData


def run(shockgrid, name: str, *words: str) -> RunData:
    code, _, error = shockgrid("run", "toy", "-q", "-o", name, *words)
    assert code == 0, error
    return RunData(name)


def test_equal_runs_make_equal_bytes_and_say_what_made_them(shockgrid):
    one, other = run(shockgrid, "one"), run(shockgrid, "other")
    for a, b in zip(one.dumps, other.dumps, strict=True):
        assert a.path.read_bytes() == b.path.read_bytes()
    made = one.dumps[-1].provenance
    assert made == find_provenance(Path("one/deck.toml").read_text())
    assert made["numpy"] == np.__version__ and made["platform"]
    assert made["deck_sha256"] == hash_deck(one.dumps[-1].deck_text)
    assert "dirty" not in made["version"]


def test_another_deck_has_another_hash(shockgrid):
    one, other = run(shockgrid, "one"), run(shockgrid, "other", "--set", "density=2.0")
    hashes = {data.dumps[-1].provenance["deck_sha256"] for data in (one, other)}
    assert len(hashes) == 2


def test_what_made_a_run_is_no_difference(shockgrid):
    one = run(shockgrid, "one")
    shutil.copytree("one", "other")
    path = Path("other/dumps") / one.dumps[-1].path.name
    with h5py.File(path, "r+") as file:
        file["provenance"].attrs["version"] = "0.0.1"
    path.write_bytes(b"".join(seal(path.read_bytes())))
    assert shockgrid("compare", "one", "other")[0] == 0
    words = inspect_differences(str(one.dumps[-1].path), str(path))
    assert words.startswith("no difference") and "@version" in words and "'0.0.1'" in words
    with h5py.File(path, "r+") as file:  # as a dump of an older version
        del file["provenance"]
    path.write_bytes(b"".join(seal(path.read_bytes())))
    assert shockgrid("info", str(path))[0] == 0
    assert shockgrid("compare", "one", "other")[0] == 0


def test_logs_and_screens_say_where_the_deck_is_from(shockgrid):
    code, _, error = shockgrid("run", "toy", "-o", "run", "--set", "cells=6", "--set", "density=3")
    assert code == 0
    words = "toy (the defaults of toy with --set cells=6 --set density=3)"
    assert words in error
    log = Path("run/run.log").read_text()
    assert words in log and f"SHA-256 {hash_deck(Path('run/deck.toml').read_text())[:16]}" in log
    assert "s of wall time" in log and "s of processor time" in log
    assert "made by: shockgrid" in shockgrid("info", "run")[1]
    assert "with --set" in shockgrid("run", "toy", "--dry-run", "--set", "cells=6")[1]


def test_a_grid_says_what_made_it():
    nodes = np.array(np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0, 3.0], indexing="ij"))
    for name in ("one.h5", "other.h5"):
        write_grid(Path(name), nodes, judge(nodes), {"family": "none"})
    assert Path("one.h5").read_bytes() == Path("other.h5").read_bytes()
    with h5py.File("one.h5") as file:
        assert dict(file["provenance"].attrs) == find_provenance()


def test_a_repository_around_an_installed_package_is_not_its_own(tmp_path):
    inside = tmp_path / "site-packages"
    inside.mkdir()
    (tmp_path / ".git").mkdir()
    assert find_commit(inside) in ("", find_commit(tmp_path / "nowhere"))
    if (HOME / ".git").exists():
        assert len(find_commit(HOME).removesuffix("-dirty")) >= 7


def test_a_tree_in_words(shockgrid):
    data = run(shockgrid, "one")
    path = str(data.dumps[-1].path)
    code, tree, _ = shockgrid("inspect", path)
    assert code == 0
    assert "/blocks/left/" in tree and "(8, 8) float64" in tree and "kg/m3, density" in tree
    assert tree.count("as stored") == 5 and "NOT AS STORED" not in tree
    assert "@deck = text," in tree and "NaN" not in tree


def test_damage_and_bad_numbers_are_seen(shockgrid):
    data = run(shockgrid, "one")
    first, last = data.dumps[0].path, data.dumps[-1].path
    with h5py.File(last, "r+") as file:
        file["state/left/heat"][2, 3] = np.nan
        file["blocks/right/rho"][1, 1] = np.inf
    tree = shockgrid("inspect", str(last))[1]
    assert "NOT AS STORED" in tree and "1 NaN" in tree and "1 infinite" in tree
    code, words, _ = shockgrid("inspect", str(first), str(last))
    assert code == 0
    assert "/state/left/heat: 64 of 64 values differ" in words
    assert "/ @step: 0 and" in words


@pytest.mark.parametrize("kind", ["missing.h5", "words.txt", "folder"])
def test_no_hdf5_file_is_said_so(shockgrid, kind):
    Path("words.txt").write_text("no HDF5")
    Path("folder").mkdir()
    code, _, error = shockgrid("inspect", kind)
    assert code == 2 and kind in error and len(error.splitlines()) == 1
    with pytest.raises(BadInput):
        inspect_differences(kind, kind)


def test_pictures_films_and_tables_say_what_made_them(shockgrid):
    from PIL import Image

    data = run(shockgrid, "one", "--set", "run.max_steps=4", "--set", "output.dumps=3")
    made, deck = describe_software(), hash_deck(data.dumps[-1].deck_text)
    assert made.startswith("shockgrid ") and find_commit(HOME) in made
    for name in ("one.png", "one.pdf", "one.svg", "film.gif"):
        command = "film" if name.endswith("gif") else "plot"
        assert shockgrid(command, "one", "-o", name)[0] == 0
    with Image.open("one.png") as image:
        assert image.text["Software"] == made and deck in image.text["Description"]
    with Image.open("film.gif") as image:
        assert image.info["comment"].decode() == f"{made}; deck SHA-256 {deck}"
    for name in ("one.pdf", "one.svg"):
        words = Path(name).read_bytes()
        assert made.encode() in words and deck.encode() in words


def test_compare_says_what_else_made_one_of_them(shockgrid):
    one = run(shockgrid, "one")
    shutil.copytree("one", "other")
    assert "made by others" not in shockgrid("compare", "one", "other")[1]
    name = one.dumps[-1].path.name
    with h5py.File(Path("other/dumps") / name, "r+") as file:
        file["provenance"].attrs["version"] = "0.0.1"
        file["provenance"].attrs["commit"] = ""
    path = Path("other/dumps") / name
    path.write_bytes(b"".join(seal(path.read_bytes())))
    for paths in (("one", "other"), (f"one/dumps/{name}", f"other/dumps/{name}")):
        code, text, _ = shockgrid("compare", *paths)
        assert code == 0 and "made by others: version" in text and "and 0.0.1, commit" in text
        assert "no difference" in text


@pytest.mark.parametrize("ending", [".npz", ".vts"])
def test_grids_of_other_kinds_say_what_made_them(ending):
    nodes = np.array(np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0, 3.0], indexing="ij"))
    path = Path("grid" + ending)
    write_grid(path, nodes, judge(nodes), {"family": "none"})
    if ending == ".npz":
        assert str(np.load(path)["made_by"]) == describe_software()
    else:
        assert f"made by {describe_software()}".encode() in path.read_bytes()
    assert np.array_equal(read_grid(str(path)), nodes)
