"""`shockgrid.load`: a case is looked at, stepped, run with hooks and drawn; ghosts never show."""

from __future__ import annotations

from operator import methodcaller

import numpy as np
import pytest

import shockgrid as sg
from runs.deck.reading import read_deck

# what notebooks call
show_png, show_html = methodcaller("_repr_png_"), methodcaller("_repr_html_")
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


def test_unknown_names_get_the_nearest():
    with pytest.raises(sg.BadInput, match="did you mean 'interface-instability'"):
        sg.load("interface-instabilty")


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


def test_what_a_block_has_not_is_told(case):
    with pytest.raises(AttributeError, match="block 'second' has no field 'rho2'; did you mean"):
        _ = case.blocks["second"].rho2
    with pytest.raises(sg.BadInput, match="there is no block 'sekond'; did you mean 'second'"):
        _ = case.blocks["sekond"]
    assert "missing" not in case.blocks and list(case.blocks) == ["first", "second"]


def test_theory_is_that_of_the_closing_screen(case):
    theory = case.theory
    assert set(theory) == {"interface_speed", "atwood_number", "growth_rate", "impulsive_rate"}
    assert theory["interface_speed"] == case.problem.theory.base.u
    strong = sg.load(NAME, cells=8, mach=2.0).theory
    assert strong["interface_speed"] > 1.5 * theory["interface_speed"]
    exact = sg.load("riemann").theory
    assert exact["star_p_left"] == exact["star_p_right"] == pytest.approx(0.30313, rel=1e-5)  # Sod
    assert sg.load("noh").theory["density_behind"] == pytest.approx(16.0)  # gamma = 5/3, a cylinder


def test_a_run_ends_in_the_bits_of_the_command(tmp_path, case):
    one = load().run(tmp_path / "one", hooks=[lambda case: None])
    from runs.cli.main import main

    words = ["--set", "cells=8", "--set", "run.max_steps=12", "-q", "-o", str(tmp_path / "two")]
    assert main(["run", NAME, *words]) == 0
    assert sg.compare(one, tmp_path / "two") == []
    assert one.final.step == 12 and one.reason == "max_steps = 12 reached"


def test_a_run_goes_on_from_the_state_of_the_case(tmp_path):
    case = load()
    row = case.advance(5)
    run = case.run(tmp_path / "run", dumps=1)
    assert run.dumps[0].step == 5 and run.dumps[-1].step == 12
    assert run.history.step[0] == 5 and run.history.t[0] == row["t"]
    assert case.step == 12
    assert case.advance()["step"] == 13  # max_steps ended the run, not the flow


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


def test_a_failing_hook_leaves_a_run_that_goes_on(tmp_path):
    def fail(case):
        if case.step == 4:
            raise ZeroDivisionError("of the hook")

    with pytest.raises(ZeroDivisionError, match="of the hook"):
        load().run(tmp_path / "run", hooks=[fail])
    run = sg.open(tmp_path / "run")
    assert run.dumps[-1].step == 4 and run.history.step[-1] == 4
    assert "stopped by a hook: ZeroDivisionError" in (tmp_path / "run" / "run.log").read_text()
    again, whole = sg.restart(run), load().run(tmp_path / "whole")
    assert {one.where for one in sg.compare(again, whole)} <= {"dumps"}


@pytest.mark.parametrize(
    ("hook", "words"),
    [
        (lambda case: case.advance(), "a hook sees the run between two steps"),
        (lambda case: case.run("elsewhere"), "a hook cannot start the run"),
        (lambda case: 3, "returned 3: a hook returns None, or words"),
    ],
)
def test_hooks_do_not_meddle(tmp_path, hook, words):
    with pytest.raises(sg.BadInput, match=words):
        load().run(tmp_path / "run", hooks=[hook])


@pytest.mark.parametrize(
    "options", [{"steps": 0}, {"steps": 1.5}, {"time": -1.0}, {"steps": 1, "time": 1.0}]
)
def test_a_hook_that_is_never_due_is_refused(options):
    with pytest.raises(sg.BadInput):
        sg.Hook(print, **options)
    with pytest.raises(sg.BadInput, match="a hook is a function"):
        sg.Hook("print")


def test_pictures_and_the_interface_of_the_present_state(case):
    figure = case.plot("p", mesh=True)
    assert figure.axes[0].get_title().startswith("t = ")
    assert case.plot(what="mesh").axes and case.plot(what="interface").axes
    assert show_png(figure)[:4] == b"\x89PNG"
    curve = case.interface()
    line = case.blocks["first"].nodes[:, -1, :]
    assert np.array_equal([curve.x, curve.y], line) and curve.t == case.t
    assert case.plot("rate").axes and case.plot("schlieren").axes, "derived from what is there"
    with pytest.raises(sg.BadInput, match="no field or picture 'rhoo'"):
        case.plot("rhoo")
    with pytest.raises(sg.BadInput, match="'history' is a picture of a run's directory"):
        case.plot(what="history")


def test_words_for_notebooks(case):
    assert "not built yet" in repr(load())
    assert repr(case).startswith("<case interface-instability: t = ")
    assert "<th" in show_html(case) and "theory: growth_rate" in show_html(case)
    assert repr(case.blocks["first"]).startswith("<block first: ")


def test_advance_stops_at_the_end():
    case = sg.load(NAME, cells=8, run={"t_end": 2e-2})
    row = case.advance(10_000)
    assert case.finished == "t_end reached" and row["t"] == case.t == 2e-2
    with pytest.raises(sg.BadInput, match="at its end already"):
        case.advance()
    with pytest.raises(sg.BadInput, match="at its end already"):
        case.run("nowhere")
    with pytest.raises(sg.BadInput, match="a whole number of steps"):
        case.advance(0)
