"""What people get wrong in Python is told in a sentence, before anything is written."""

from __future__ import annotations

import pytest

import shockgrid as sg
from builders import two_blocks, wall_off

STATES = ((1.0, 0.0, 0.0, 1.0), (0.125, 0.0, 0.0, 0.1))  # Sod's


def make_tube(t_end=0.1):
    """Two gases beside a straight line, closed by walls."""
    blocks, links = two_blocks(lambda y: 0.0 * y, (10, 6), (sg.IdealGas(1.4),) * 2, STATES)
    for block in blocks:
        wall_off(block, *({"left": "i_min", "right": "i_max"}[block.name], "j_min", "j_max"))
    return sg.Simulation(blocks, links, t_end=t_end)


def measure(simulation):
    return {"furthest": float(simulation.blocks[0].nodes[0].max())}


def read_all(folder):
    """All files of a run, byte by byte."""
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own") / "tube"
    return sg.run(make_tube(), folder, dumps=2, measure=measure, run={"max_steps": 4})


def add_one(simulation):
    return measure(simulation) | {"nearest": 0.0}


@pytest.mark.parametrize(
    ("again", "words"),
    [
        ({}, "would go on without furthest; give the restart what the run had"),
        ({"measure": add_one}, "would go on with nearest; give"),
        ({"measure": lambda simulation: {"far": 1.0}}, "without furthest and with far; give"),
    ],
)
def test_a_restart_with_other_columns_is_refused_before_it_writes(run, again, words):
    before = read_all(run.path)
    with pytest.raises(sg.BadInput, match=words):
        sg.restart(run, simulation=make_tube(), run={"max_steps": 6}, **again)
    assert read_all(run.path) == before


def test_columns_that_change_on_the_way_are_told(tmp_path):
    def change(simulation):
        return {f"of_step_{simulation.step // 3}": 0.0}

    with pytest.raises(sg.BadInput, match="go on without of_step_0 and with of_step_1; last rest"):
        sg.run(make_tube(), tmp_path / "changing", measure=change)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"output": {"times": [99.0]}}, r"output\.times has 99, which is after the end"),
        ({"output": {"fields": ["roh"]}}, "output.fields has 'roh'; no block has such a field"),
        ({"gauge": [{"name": "g", "x": 0.1, "y": 0.1, "fields": ["roh"]}]}, "roh"),
        ({"output": {"columns": ["nosuch"]}}, "no installed package has a group"),
    ],
)
def test_what_cannot_be_written_down_is_refused_before_there_is_a_directory(
    settings, words, tmp_path
):
    place = tmp_path / "run"
    deck = {"cells": 20, "run": {"max_steps": 1}} | settings
    with pytest.raises(sg.BadInput, match=words):
        sg.load("riemann", **deck).run(place)
    with pytest.raises(sg.BadInput, match=words):
        sg.run("riemann", place, **deck)
    assert not place.exists()


def test_a_restart_makes_the_same_checks(tmp_path):
    run = sg.run("riemann", tmp_path / "run", cells=20, run={"max_steps": 2})
    before = read_all(run.path)
    with pytest.raises(sg.BadInput, match="after the end of the run"):
        sg.restart(run, run={"max_steps": 3}, **{"output.times": [99.0]})
    assert read_all(run.path) == before


def test_a_bad_hook_or_measure_leaves_no_directory(tmp_path):
    place = tmp_path / "run"
    with pytest.raises(sg.BadInput, match="a hook is a function of the case, not a int"):
        sg.run(make_tube(), place, hooks=[3])
    for wrong, words in (
        (lambda simulation: 3.0, "measure returned 3.0: it returns numbers by name"),
        (lambda simulation: {"a": "far"}, "measure returned 'far' for 'a': a number is wanted"),
        (lambda simulation: {"a,b": 1.0}, "measure returned 'a,b': a column's name"),
        (lambda simulation: {"t": 1.0}, "measure returned 't', which every history has"),
        (3.0, "measure = 3.0: a function of the simulation is wanted"),
    ):
        with pytest.raises(sg.BadInput, match=words):
            sg.run(make_tube(), place, measure=wrong)
    assert not place.exists()


def test_one_hook_needs_no_list(tmp_path):
    steps = []

    def watch(case):
        steps.append(case.step)

    sg.run(make_tube(), tmp_path / "one", run={"max_steps": 2}, hooks=watch)
    sg.run(make_tube(), tmp_path / "two", run={"max_steps": 2}, hooks=sg.Hook(watch, steps=2))
    assert steps == [1, 2, 2]


def test_pictures_of_a_live_case(tmp_path):
    case = sg.load("interface-instability", cells=8)
    case.advance(2)
    for name in ("rho", "rate", "vorticity", "mesh", "interface", "rho,p"):
        assert case.plot(name).axes, name
    assert case.plot("rate", "p", mesh=True).axes
    xs = case.blocks["first"].nodes[0]
    low, high = float(xs.min()), float(xs.max())
    way = (low, 0.01, high, 0.01)
    assert case.plot("rho", line=way).axes and case.plot("p", what="line", line=way).axes
    run = sg.run("interface-instability", tmp_path / "run", cells=8, run={"max_steps": 2})
    assert len(case.plot("rho", beside=run.path).axes) == len(case.plot("rho").axes) + 1


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nosuch", r"no field or picture 'nosuch' of interface-instability; there are: rho, u, v"),
        ("mehs", "there are: rho.*, mesh, interface, line; did you mean 'mesh'"),
        ("history", "'history' is a picture of a run's directory: run the case"),
        ("growth", "'growth' is a picture of a run's directory: run the case"),
        ("line", "which line"),
    ],
)
def test_pictures_that_a_live_case_has_not(name, words):
    case = sg.load("interface-instability", cells=8)
    with pytest.raises(sg.BadInput, match=words):
        case.plot(name)
    with pytest.raises(sg.BadInput, match=words):
        case.plot(what=name)


def test_a_column_or_a_time_that_is_none_is_told(run):
    with pytest.raises(sg.BadInput, match=r"no column 'furthst'; did you mean 'furthest'\?$"):
        _ = run.history["furthst"]
    with pytest.raises(KeyError):
        _ = run.history["furthst"]
    assert "furthst" not in run.history and run.history.get("furthst") is None
    for wrong in ("x", None, float("nan")):
        with pytest.raises(sg.BadInput, match="is no time; a number is wanted"):
            run.dump_at(wrong)
    with pytest.raises(sg.BadInput, match="'end' is no time"):
        run.interface("end")


@pytest.mark.parametrize("command", ["check", "run"])
def test_the_deck_of_blocks_of_a_script_makes_no_run(run, command, capsys, tmp_path, monkeypatch):
    from runs.cli.main import main

    monkeypatch.chdir(tmp_path)
    assert main([command, str(run.path / "deck.toml")]) == 2
    told = capsys.readouterr()
    assert "the blocks of this run were made in Python" in told.err and told.out == ""
    assert list(tmp_path.iterdir()) == []


def test_the_report_says_how_such_a_run_is_made_again(run, tmp_path):
    pytest.importorskip("plotly", reason="reports need the extra `report`")
    pytest.importorskip("jinja2", reason="reports need the extra `report`")
    page = run.report(tmp_path / "own.html", film=False).read_text(encoding="utf-8")
    repeat = page[page.index('id="repeat"') :]
    assert "Its blocks were made" in repeat and "shockgrid compare" in repeat
    assert "shockgrid run deck.toml" not in repeat


def test_film_report_and_inspect_are_functions_too(run, tmp_path):
    first, last = run.dumps[0], run.dumps[-1]
    assert sg.inspect(last) == sg.inspect(last.path)
    assert "/blocks/left/rho" in sg.inspect(first, last)
    with pytest.raises(sg.BadInput, match="no-such"):
        sg.inspect(tmp_path / "no-such.h5")
    film = sg.film(run, "p", tmp_path / "p.gif", dpi=30)
    assert film == tmp_path / "p.gif" and film.stat().st_size > 0
    pytest.importorskip("plotly", reason="reports need the extra `report`")
    pytest.importorskip("jinja2", reason="reports need the extra `report`")
    assert sg.report(run.path, tmp_path / "a.html", film=False) == tmp_path / "a.html"


def test_a_simulation_with_nothing_left_to_do_is_not_run_again(tmp_path):
    tube, short = make_tube(), {"max_steps": 3}
    sg.run(tube, tmp_path / "first", run=short)
    with pytest.raises(sg.BadInput, match="has made 3 steps already, and max_steps = 3: nothing"):
        sg.run(tube, tmp_path / "second", run=short)
    rest = sg.run(tube, tmp_path / "rest")
    assert len(rest.history["t"]) > 1 and tube.finished
    with pytest.raises(sg.BadInput, match="is at its end already: t_end reached"):
        sg.run(tube, tmp_path / "second")
    assert not (tmp_path / "second").exists()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda run: sg.report(3), "3 is no run: its directory is wanted"),
        (lambda run: sg.plot(3.5), r"3\.5 is no run"),
        (lambda run: sg.film(None), "None is no run"),
        (lambda run: sg.plot(run, vmax=2.0), "plot: there is no option 'vmax'; known are: what"),
        (lambda run: run.plot("rho", miror="x"), "'miror'; did you mean 'mirror'"),
        (lambda run: run.film("rho", fsp=3), "film: there is no option 'fsp'; did you mean 'fps'"),
        (lambda run: sg.report(run, dip=3), "report: there is no option 'dip'; did you mean 'dpi'"),
        (lambda run: sg.load("riemann").plot(vmin=1), "plot: there is no option 'vmin'"),
    ],
)
def test_what_pictures_and_reports_cannot_take(run, call, words):
    with pytest.raises(sg.BadInput, match=words):
        call(run)


def test_a_study_takes_keywords_as_runs_do(tmp_path):
    with pytest.raises(sg.BadInput, match="no key 'celss'; did you mean 'cells'"):
        sg.study("riemann", {"cells": [8, 10]}, tmp_path / "s", celss=8)
    with pytest.raises(sg.BadInput, match=r"vary: run\.cfl is set, too"):
        sg.study("riemann", {"run.cfl": [0.4, 0.8]}, tmp_path / "s", run={"cfl": 0.3})
    made = sg.study(
        "riemann", {"run.cfl": [0.4, 0.8]}, tmp_path / "s", cells=8, run={"max_steps": 2}
    )
    assert made is not None and set(made.definition.settings) == {"cells=8", "run.max_steps=2"}
