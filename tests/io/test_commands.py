"""Commands on runs of the toy, and the pictures they draw."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shockgrid.problems.registry import PROBLEMS
from shockgrid.runs.pictures.command import new_figure
from shockgrid.runs.pictures.curves import draw_history
from shockgrid.runs.store.reader import RunData


@pytest.fixture
def run(shockgrid):
    shockgrid("run", "toy", "-q", "-o", "run", "--set", "run.t_end=0.2")
    return RunData("run")


def test_list_names_every_problem(shockgrid):
    code, text, _ = shockgrid("list")
    assert code == 0
    assert all(name in text for name in PROBLEMS)
    assert "Heat spreading through two blocks" in text
    assert "forgets" in shockgrid("list", "toy")[1]


def test_run_ends_with_a_screen(shockgrid):
    code, text, error = shockgrid("run", "toy", "--set", "run.t_end=0.2")
    assert code == 0 and "toy (the defaults of toy with --set run.t_end=0.2) in out/toy-1" in error
    for words in ("t_end reached", "theory 1.5", "dt limited by: diffusion", "out/toy-1"):
        assert words in text
    assert Path("out/toy-1/summary.txt").read_text() == text
    assert "start: toy" in Path("out/toy-1/run.log").read_text()


def test_dry_run_leaves_nothing(shockgrid):
    code, text, _ = shockgrid("run", "toy", "--dry-run", "--threads", "2", "--set", "cells=10")
    assert code == 0 and "200 cells" in text and "10 x 10 cells" in text and "2 threads" in text
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("words", "size"),
    [
        (("interface-instability", "--set", "cells=4000"), "2000 cells"),
        (("vortex", "--set", "cells=100000"), "100000 x 100000 cells"),
    ],
)
def test_dry_run_of_a_huge_run_allocates_nothing(shockgrid, words, size):
    import tracemalloc

    tracemalloc.start()
    code, text, _ = shockgrid("run", *words, "--dry-run")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert code == 0 and size in text and "GB" in text, text
    assert peak < 200e6
    code, _, error = shockgrid("run", *words, "--set", "run.t_end=-1", "--dry-run")
    assert code == 2 and "t_end" in error


def test_info(shockgrid, run):
    code, text, _ = shockgrid("info", "run")
    assert code == 0
    for words in (
        "t_end reached",
        "run.t_end = 0.2",
        "conservation",
        "kg/m3",
        "cooling",
        "21 dumps",
    ):
        assert words in text, text
    code, text, _ = shockgrid("info", str(run.dumps[3].path))
    assert code == 0 and "block left (stuff left): 8 x 8 cells" in text


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["rho", "q", "--at", "0,0.1,end", "--mesh"],
        ["--zoom", "0.5,1.5,0,1", "--mirror", "y"],
        ["--what", "mesh"],
        ["--what", "interface"],
        ["--what", "history"],
        ["hottest", "--what", "history"],
        ["--what", "cooling"],
    ],
)
def test_plot(shockgrid, run, words):
    code, text, error = shockgrid("plot", "run", *words, "-o", "picture.png", "--dpi", "40")
    assert code == 0, error
    assert text.strip() == "picture.png"
    from matplotlib.image import imread

    pixels = imread("picture.png")
    assert pixels.shape[0] > 60 and pixels[..., :3].std() > 0.02


def test_compare_codes(shockgrid, run):
    shockgrid("run", "toy", "-q", "-o", "same", "--set", "run.t_end=0.2")
    hotter = ("--set", "start={kind='hot',temperature=2.0001}")
    shockgrid("run", "toy", "-q", "-o", "other", "--set", "run.t_end=0.2", *hotter)
    finer = ("--set", "cells=10")
    shockgrid("run", "toy", "-q", "-o", "finer", "--set", "run.t_end=0.2", *finer)
    assert shockgrid("compare", "run", "same")[0] == 0
    code, text, _ = shockgrid("compare", "run", "other")
    assert code == 1 and "start.temperature" in text.splitlines()[1]
    assert "\nfirst: " in text and "most:" in text
    assert shockgrid("compare", "run", "other", "--rtol", "1e-2")[0] == 0
    a, b = (str(RunData(name).dumps[0].path) for name in ("run", "other"))
    code, text, _ = shockgrid("compare", a, b)
    assert code == 1 and "block left, rho" in text and "64 of 64" in text
    assert shockgrid("compare", a, a)[0] == 0
    code, text, _ = shockgrid("compare", "run", "finer")
    assert code == 1 and "finer are remapped to the grid of run" in text
    assert shockgrid("compare", "run", a)[0] == 2
    assert shockgrid("compare", "run", "nowhere")[0] == 2
    for path in RunData("same").path.joinpath("dumps").iterdir():
        path.unlink()
    code, _, error = shockgrid("compare", "same", "same")
    assert code == 2 and "same has no dump yet" in error


def test_schema(shockgrid):
    code, text, _ = shockgrid("schema", "toy")
    schema = json.loads(text)
    assert code == 0
    assert schema["additionalProperties"] is False and schema["required"] == ["problem"]
    assert schema["properties"]["cells"]["maximum"] == 400
    assert schema["properties"]["run"]["default"]["t_end"] == 0.5
    assert "null" not in text and "None" not in text


WORDS = (
    "--set=mach=2",
    "--set=cells=12",
    "--set=kct_end=6",
    "--set=run.threads=2",
    "-q",
)


@pytest.fixture
def run_of_pictures(shockgrid):
    code, screen, error = shockgrid("run", "interface-instability", *WORDS, "-o", "run")
    assert code == 0, error
    return RunData("run"), screen


def test_history_has_units(run_of_pictures):
    data, _ = run_of_pictures
    assert data.dumps[-1].length_unit == data.dumps[-1].t_unit == "1"
    figure = new_figure()
    draw_history(figure, data, [])
    titles = {axes.get_title() for axes in figure.axes}
    assert {"dt", "amplitude", "interface"} <= titles  # the deck's numbers have no units
    data.problem.t_unit = "s"  # as with a pressure in pascals
    figure = new_figure()
    draw_history(figure, data, [])
    titles = {axes.get_title() for axes in figure.axes}
    assert {"dt [ms]", "amplitude [mm]", "interface [m]"} <= titles
    assert titles & {f"far transverse speed [{prefix}m/s]" for prefix in ("n", "µ", "m")}  # small
    panel = next(axes for axes in figure.axes if axes.get_title() == "interface [m]")
    legend = {text.get_text() for text in panel.get_legend().get_texts()}
    assert legend == {"mean", "min", "max"}
    state = data.problem.build()
    assert set(data.problem.units) <= set(data.problem.measure(state))


def test_quiet_prints_nothing_but_errors(shockgrid, toy):
    run = ("run", "toy", "-q", "--plot", "-o", "run", "--set", "run.t_end=0.1")
    assert shockgrid(*run) == (0, "", "")
    assert Path("run/summary.txt").stat().st_size > 100 and list(Path("run").glob("*.png"))
    assert shockgrid("restart", "run", "-q", "--set", "run.t_end=0.2") == (0, "", "")
    study = ("study", "toy", "-q", "--jobs", "1", "--set", "run.t_end=0.02", "--set", "shape=flat")
    assert shockgrid(*study, "--vary", "cells=4,6", "-o", "study") == (0, "", "")
    code, out, error = shockgrid(*run, "--set", "fail_at=3", "--force")
    assert code == 3 and out == "" and error.startswith("shockgrid: ")


@pytest.mark.parametrize(
    ("words", "form"),
    [
        (("run", "toy", "--set", "cells", "8"), "--set cells 8: write --set cells=8"),
        (("run", "--set", "cells", "8", "toy"), "--set cells 8: write --set cells=8"),
        (("check", "toy", "--set", "cells", "=", "8"), "--set cells = 8: write --set cells=8"),
        (("check", "toy", "--set", "cells=", "8"), "--set cells= 8: write --set cells=8"),
        (("check", "toy", "--set", "cells", "-3.5"), "write --set cells=-3.5"),
        (("check", "--set", "cells", "toy"), "write --set cells=VALUE"),
        (("study", "toy", "--vary", "cells", "4,6"), "write --vary cells=4,6"),
        (("grid", "make", "dome", "--option", "epsilon", "0.1"), "write --option epsilon=0.1"),
    ],
)
def test_a_key_and_its_value_as_two_words(shockgrid, toy, words, form):
    code, out, error = shockgrid(*words)
    assert code == 2 and out == "" and error.count("\n") == 1
    assert error.rstrip().endswith(form), error


def test_materials_are_listed_with_all_their_names(shockgrid):
    code, out, _ = shockgrid("materials")
    assert code == 0 and "\nCu " in out and "copper" in out
    assert shockgrid("materials", "copper") == shockgrid("materials", "Cu")
    code, out, error = shockgrid("materials", "coper")
    assert code == 2 and out == "" and "did you mean 'copper'?" in error
