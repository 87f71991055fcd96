"""`shockgrid.load`: a case is looked at, stepped, run with hooks and drawn; ghosts never show."""

from __future__ import annotations

import numpy as np
import pytest

import shockgrid as sg
from runs.deck.reading import read_deck

DECK = {"cells": 8, "run": {"max_steps": 12}}
NAME = "interface-instability"


def load(**settings):
    return sg.load(NAME, **(DECK | settings))


@pytest.fixture(scope="module")
def case():
    case = load()
    case.advance(3)
    return case


def test_keywords_are_settings_of_the_deck():
    words = ("cells=8", "run.max_steps=5", "modes=[{number = 2, ka0 = 0.1}]", "limiter=minmod")
    modes = [{"number": 2, "ka0": 0.1}]
    case = sg.load(NAME, cells=np.int64(8), modes=modes, limiter="minmod", **{"run.max_steps": 5})
    assert case.deck == read_deck(NAME, words).deck
    assert sg.load(NAME, regrid={"options": {"threads": 1}}).deck.regrid.options == {"threads": 1}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"cells": -3}, r"^cells = -3; it has to be a whole number at least"),
        ({"run": {"t_nd": 1.0}}, r"^there is no key 'run.t_nd'; did you mean 'run.t_end'\?"),
        ({"cells": None}, "cells = None: a deck has no such value"),
        ({"cells": object()}, "cells: a deck cannot hold"),
    ],
)
def test_wrong_keywords_are_told_without_words_of_the_command_line(settings, words):
    with pytest.raises(sg.BadInput, match=words) as found:
        sg.load(NAME, **settings)
    assert "--set" not in str(found.value)


def test_ghost_cells_never_show(case):
    for name, block in case.blocks.items():
        (inner,) = [one for one in case.simulation.blocks if one.name == name]
        ni, nj = block.cells
        assert block.nodes.shape == (2, ni + 1, nj + 1)
        assert block.centres.shape == (2, ni, nj)
        for field, row in zip(("rho", "u", "v", "p"), inner.state, strict=True):
            seen = getattr(block, field)
            assert seen.shape == (ni, nj) == block.cell_fields[field].shape
            assert np.array_equal(seen, row[1:-1, 1:-1])
            assert row.shape == (ni + 2, nj + 2)
        assert block.e.shape == (ni, nj)
        assert set(block.cell_fields) == {"rho", "u", "v", "p", "e"}
        assert all(not block.cell_fields[field].flags.writeable for field in block.cell_fields)


def test_views_are_live_and_cannot_be_written_to():
    case = load()
    block = case.blocks["second"]
    first = block.nodes
    kept = first.copy()
    with pytest.raises(ValueError, match="read-only"):
        first[...] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        block.rho[0, 0] = 2.0
    case.advance(2)
    assert not np.array_equal(first, kept)  # the trap: written over by later steps
    assert not np.array_equal(case.blocks["second"].nodes, kept)
    assert np.array_equal(block.nodes, case.blocks["second"].nodes)  # asked again: the present


def test_a_run_ends_in_the_bits_of_the_command(tmp_path, case):
    one = load().run(tmp_path / "one", hooks=[lambda case: None])
    from runs.cli.main import main

    words = ["--set", "cells=8", "--set", "run.max_steps=12", "-q", "-o", str(tmp_path / "two")]
    assert main(["run", NAME, *words]) == 0
    assert sg.compare(one, tmp_path / "two") == []
    assert one.final.step == 12 and one.reason == "max_steps = 12 reached"


def test_hooks_see_each_step_and_stop_a_run(tmp_path):
    seen, every, late = [], [], []

    def look(case):
        seen.append((case.step, float(case.blocks["first"].p.max())))
        return "far enough" if case.step == 7 else None

    def note(case):
        every.append(case.step)

    def note_time(case):
        late.append(case.t)

    tick = 2e-2
    hooks = [sg.Hook(note, steps=3), sg.Hook(note_time, time=tick), look]
    run = load().run(tmp_path / "run", hooks=hooks)
    assert [step for step, _ in seen] == [1, 2, 3, 4, 5, 6, 7] and every == [3, 6]
    assert run.reason == "far enough" and run.dumps[-1].step == 7
    numbers = np.floor(run.history.t / tick)
    crossed = np.flatnonzero(np.diff(numbers) > 0) + 1
    assert crossed.size > 0 and late == list(run.history.t[crossed])
    again = sg.restart(run)
    assert again.reason == "max_steps = 12 reached"
    whole = load().run(tmp_path / "whole")
    assert {one.where for one in sg.compare(again, whole)} <= {"dumps"}
