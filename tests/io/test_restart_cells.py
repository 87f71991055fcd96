"""Going on with other numbers of cells, and comparing runs that have other numbers of them."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from runs.store.reader import RunData

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
    code, _, error = shockgrid(
        "restart", "half", "--cells=20", "--set=run.max_steps=26", "-o", "finer"
    )
    assert code == 0, error
    assert "goes on from step 20 of half on other cells: first" in error
    assert sum_files(half) == before, "the old run stays as it is"
    old, new = RunData("half"), RunData("finer")
    assert new.deck.cells == 20 and new.deck.mach == 2.0
    assert list(new.history["step"]) == list(range(27)), "the history goes on"
    assert (new.history["t"][:21] == old.history["t"]).all()
    ends, starts = old.outputs[-1], new.outputs[0]
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
        (("--cells=many",), "--cells many: the form is N or N,M, whole numbers such as 64"),
        (("--cells=0",), "--cells 0: the form is N or N,M"),
        (("--cells=16,8",), "--cells 16,8: the key `cells` of interface-instability is one number"),
        (("--cells=2",), "cells = 2"),
        (("--cells=16", "--set=cells=16"), "say the same; give one of them"),
        (("--cells=16", "--set=mach=3"), "another mach is another run"),
        (("--cells=16", "-o", "half"), "which stays as it is; name another directory"),
        (("--cells=16", "-o", "half/inside"), "which stays as it is; name another directory"),
        (("--cells=16", "--at=7", "-o", "new"), "half has no restart point of step 7; there are:"),
        (("-o", "new"), "-o and --force go with --cells"),
        (("--force",), "-o and --force go with --cells"),
    ],
)
def test_bad_words_are_told_and_nothing_is_written(shockgrid, half, words, sentence):
    before = sum_files(half)
    code, _, error = shockgrid("restart", "half", *words)
    assert (code, sentence in error) == (2, True), error
    assert sum_files(half) == before
    assert [path.name for path in half.parent.iterdir()] == ["half"]
