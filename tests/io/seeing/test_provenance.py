"""Every dump and log says what made it; the numbers and the bits of equal runs stay equal."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np

from runs.inspection.tree import inspect_differences
from runs.store.checksum import seal
from runs.store.provenance import find_provenance, hash_deck
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
