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


def test_what_went_on_can_be_restarted_like_any_run(shockgrid, half):
    words = ("restart", "half", "--cells=18", "-q", "--set=run.max_steps=28")
    assert shockgrid(*words, "-o", "whole")[0] == 0
    words = (*words[:-1], "--set=run.max_steps=24")
    assert shockgrid(*words, "-o", "other")[0] == 0
    assert shockgrid("restart", "other", "-q", "--set=run.max_steps=28")[0] == 0
    RunData("other").directory.dump_path(24).unlink(missing_ok=True)
    code, text, _ = shockgrid("compare", "whole", "other")
    assert (code, text.startswith("no difference")) == (0, True), text


def test_the_same_cells_keep_the_state(shockgrid, half):
    words = ("--set=cells=12", "--set=run.max_steps=20", "-q", "-o", "same")
    assert shockgrid("restart", "half", *words)[0] == 0
    old, new = RunData("half").outputs[-1], RunData("same").outputs[0]
    for block in old.blocks:
        away = new.block(block.name).nodes - block.nodes
        assert np.abs(away).max() < 0.1 / 12, "the regridder settles the grid, no more"


def test_fewer_cells(shockgrid, half):
    words = ("--cells=8", "--set=run.max_steps=23", "-q", "-o", "coarser")
    assert shockgrid("restart", "half", *words)[0] == 0
    totals = RunData("coarser").history["total_energy"]
    came = np.nan_to_num(RunData("coarser").history["boundary_energy"])
    assert np.abs(totals - came - totals[0]).max() < 1e-13 * totals[0]


def test_runs_of_other_cells_are_compared_by_norms(shockgrid, half):
    words = ("--cells=24", "--set=run.max_steps=20", "-q", "-o", "finer")
    assert shockgrid("restart", "half", *words)[0] == 0
    code, text, _ = shockgrid("compare", "half", "finer")
    assert code == 1 and "finer laid on the grid of half" in text
    assert "(steps 20 and 20, the same time)" in text
    code, text, _ = shockgrid("compare", "half", "finer", "--rtol=0.02")
    assert code == 0, text
    table = [line.split() for line in text.splitlines() if line.startswith("  ")]
    assert table[0] == ["block", "field", "L1", "L2", "Linf", "of"]
    rows = {(block, field): list(map(float, row)) for block, field, *row in table[1:]}
    assert set(rows) == {(b, f) for b in ("first", "second") for f in ("rho", "u", "v", "p", "e")}
    for l1, l2, largest, _ in rows.values():
        assert 0.0 < l1 <= l2 <= largest
    dumps = [str(RunData(name).outputs[-1].path) for name in ("finer", "half")]
    assert shockgrid("compare", *dumps, "--rtol=0.02")[0] == 0
    code, _, error = shockgrid("compare", "half", "finer", "--rtol=nan")
    assert code == 2 and "--rtol and --atol" in error


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


def test_a_full_directory_is_not_written_over(shockgrid, half, toy):
    (toy / "full").mkdir()
    (toy / "full/precious").write_text("mine")
    code, _, error = shockgrid("restart", "half", "--cells=16", "-o", "full")
    assert code == 2 and "is not empty" in error
    assert (toy / "full/precious").read_text() == "mine"


def test_what_is_no_flow_on_blocks_says_so(shockgrid):
    assert shockgrid("run", "toy", "-o", "run", "-q", "--set", "run.max_steps=3")[0] == 0
    code, _, error = shockgrid("restart", "run", "--cells=6", "-o", "new")
    assert code == 2 and "toy is no flow on blocks alone" in error
