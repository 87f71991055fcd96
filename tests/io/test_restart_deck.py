"""What a restart may change: its end, its cells."""

from __future__ import annotations

import hashlib
import shutil

import numpy as np
import pytest

import shockgrid as sg
from shockgrid.runs.store.reader import RunData

SHORT = ("--set=cells=16", "-q")


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A run of the main problem to k c t = 3, with dumps on its way."""
    place = tmp_path_factory.mktemp("restart") / "first"
    sg.run("interface-instability", place, cells=16, kct_end=3.0, dumps=4)
    return place


@pytest.fixture
def again(first, toy):
    """A copy of it to go on with."""
    return shutil.copytree(first, toy / "run")


def read_end(directory):
    data = RunData(str(directory))
    return data.deck, data.dumps[-1]


@pytest.mark.parametrize("setting", ["run.t_end=1.1", "kct_end=6"])
def test_the_end_moves_and_the_domain_stays(shockgrid, again, setting):
    steps = [dump.step for dump in RunData(str(again)).dumps]
    made_for = RunData(str(again)).dumps[-1].t
    code, _, error = shockgrid("restart", "run", "--at", str(steps[2]), "-q", "--set", setting)
    assert code == 0, error
    deck, last = read_end("run")
    assert deck.run.t_set_up == made_for < last.t
    assert np.ptp(last.blocks[1].nodes[0]) < 4.0
    words = (*SHORT, f"--set=run.t_set_up={made_for!r}", f"--set={setting}")
    assert shockgrid("run", "interface-instability", *words, "-o", "whole")[0] == 0
    one = RunData("run")
    two = RunData("whole")
    assert np.array_equal(one.history["t"], two.history["t"])
    assert np.array_equal(one.dumps[-1].blocks[0].nodes, two.dumps[-1].blocks[0].nodes)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("wavelength = 1.0", "wavelength = 2.0", "wavelength is 2.0, was 1.0"),
        ("gamma = 1.4", "gamma = 1.5", "first.gamma is 1.5, was 1.4"),
        ("ka0 = 0.02", "ka0 = 0.05", "modes.0.ka0 is 0.05, was 0.02"),
        ("cells = 16", "cells = 24", "cells is 24, was 16"),
        ("pressure = 1.0", "pressure = 1.0\nmach = 2.0", "mach is 2.0, was left out"),
        ("[output]", "[[gauge]]\nname = 'a'\nat = [0.0, 0.0]\n\n[output]", "gauge is "),
    ],
)
def test_a_deck_changed_by_hand_is_refused(shockgrid, again, old, new, words):
    deck = again / "deck.toml"
    text = deck.read_text()
    if "gauge" in new:
        text = text.replace("gauge = []\n", "")
    assert old in text
    deck.write_text(text.replace(old, new))
    before = (again / "history.csv").read_bytes()
    code, _, error = shockgrid("restart", "run", "-q", "--set", "run.t_end=1")
    assert code == 2 and words in error and "change keys with restart --set" in error
    assert (again / "history.csv").read_bytes() == before, "nothing was touched"


GAS = (
    "interface-instability",
    "--set=mach=2",
    "--set=lengths=[2,2]",
    "--set=modes=[{ka0=0.5}]",
    "--set=cells=12",
    "--set=run.t_end=0.6",
    "--set=output.dumps=8",
    "-q",
)


def sum_files(folder) -> str:
    content = [(path.name, path.read_bytes()) for path in sorted(folder.rglob("*.*"))]
    return hashlib.sha256(repr(content).encode()).hexdigest()


@pytest.fixture
def half(shockgrid, toy):
    """A run stopped in the middle, in the folder `half`."""
    assert shockgrid("run", *GAS, "--set=run.max_steps=20", "-o", "half")[0] == 0
    return toy / "half"


def test_a_run_goes_on_with_more_cells(shockgrid, half):
    before = sum_files(half)
    code, screen, error = shockgrid(
        "restart", "half", "--cells=20", "--set=run.max_steps=26", "-o", "finer"
    )
    assert code == 0, error
    assert "continues from step 20 of half on other cells: first" in error
    for told in (screen, shockgrid("info", "finer")[1]):
        verdict = next(line for line in told.splitlines() if line.startswith("verdict"))
        assert "the history up to step 20 is that of half, on its cells" in verdict
    further = shockgrid("restart", "finer", "--set=run.max_steps=26")[1]
    assert "the history up to step 20 is that of half, on its cells" in further
    assert sum_files(half) == before, "the old run stays as it is"
    old = RunData("half")
    new = RunData("finer")
    assert new.deck.cells == 20 and new.deck.mach == 2.0
    assert list(new.history["step"]) == list(range(27)), "the history goes on"
    assert (new.history["t"][:21] == old.history["t"]).all()
    ends = old.outputs[-1]
    starts = new.outputs[0]
    assert (starts.step, starts.t) == (20, ends.t)
    for one, other in zip(ends.blocks, starts.blocks, strict=True):
        assert np.prod(other.nodes.shape) > 2 * np.prod(one.nodes.shape)
        assert one.material == other.material
    lines = [dump.block("first").nodes[:, -1] for dump in (ends, starts)]
    assert np.abs(starts.block("second").nodes[:, 0] - lines[1]).max() == 0.0
    height = np.interp(lines[1][1], lines[0][1], lines[0][0])
    assert np.abs(height - lines[1][0]).max() < 0.01, "the interface is the same curve"
    for name in ("mass_first", "mass_second", "momentum_x", "energy"):
        total = new.history[f"total_{name}"]
        came = np.nan_to_num(new.history[f"boundary_{name}"])
        assert np.abs(total - came - total[0]).max() < 1e-13 * np.abs(total).max(), name
    assert "step 20 of half" in new.directory.log.read_text()


def test_fewer_cells(shockgrid, half):
    words = ("--cells=8", "--set=run.max_steps=23", "-q", "-o", "coarser")
    assert shockgrid("restart", "half", *words)[0] == 0
    totals = RunData("coarser").history["total_energy"]
    came = np.nan_to_num(RunData("coarser").history["boundary_energy"])
    assert np.abs(totals - came - totals[0]).max() < 1e-13 * totals[0]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--cells=many",), 'cells = "many"; it must be a whole number'),
        (("--cells=0",), "cells = 0; it must be a whole number"),
        (("--cells=16,8",), "cells = [16, 8]; it must be a whole number"),
        (("--cells=2",), "cells = 2"),
        (("--set=cells=16",), "--cells continues on other cells"),
        (("--cells=16", "--set=mach=3"), "another mach is another run"),
        (("--cells=16", "-o", "half"), "which stays as it is; name another directory"),
        (("--cells=16", "-o", "half/inside"), "which stays as it is; name another directory"),
        (("--cells=16", "--at=7", "-o", "new"), "half has no restart point of step 7; there are:"),
        (("-o", "new"), "-o and --force need --cells"),
        (("--force",), "-o and --force need --cells"),
    ],
)
def test_bad_words_are_told_and_nothing_is_written(shockgrid, half, words, sentence):
    before = sum_files(half)
    code, _, error = shockgrid("restart", "half", *words)
    assert (code, sentence in error) == (2, True), error
    assert sum_files(half) == before
    assert [path.name for path in half.parent.iterdir()] == ["half"]
