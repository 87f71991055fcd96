"""The commands on a finished run: what they print, draw and return."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from problems.registry import PROBLEMS
from runs.deck.schema import make_schema
from runs.pictures.command import new_figure, parse_zoom
from runs.pictures.fields import View, draw_fields, draw_meshes, time_titles
from runs.store.reader import RunData


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


def test_resolved_deck_runs_to_the_same_end(shockgrid, run):
    deck = run.directory.deck
    said = shockgrid("check", "toy", "--set", "run.t_end=0.2")[1]
    assert said.startswith(deck.read_text())
    rest = said.removeprefix(deck.read_text()).splitlines()
    assert all(line.startswith("#") for line in rest if line)
    assert shockgrid("run", str(deck), "-q", "-o", "again")[0] == 0
    assert shockgrid("compare", "run", "again")[0] == 0


def test_table_given_in_part_keeps_the_problems_defaults(shockgrid):
    _, text, _ = shockgrid("check", "toy", "--set", "run.threads=2")
    assert "cfl = 0.75" in text and "threads = 2" in text and "t_end = 0.5" in text
    _, text, _ = shockgrid("check", "toy", "--set", "start={kind='cold'}")
    assert "chill = 1.0" in text and "temperature" not in text


def test_dry_run_leaves_nothing(shockgrid):
    code, text, _ = shockgrid("run", "toy", "--dry-run", "--threads", "2", "--set", "cells=10")
    assert code == 0 and "200 cells" in text and "10 x 10 cells" in text and "2 threads" in text
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("words", "size"),
    [
        (("interface-instability", "--set", "cells=20000"), "10000 cells"),
        (("vortex", "--set", "cells=100000"), "100000 x 100000 cells"),
    ],
)
def test_dry_run_of_a_huge_run_allocates_nothing(shockgrid, words, size):
    """Gigabytes would be wanted; a deck that is wrong is still refused."""
    import tracemalloc

    tracemalloc.start()
    code, text, _ = shockgrid("run", *words, "--dry-run")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert code == 0 and size in text and "GB" in text, text
    assert peak < 200e6
    code, _, error = shockgrid("run", *words, "--set", "run.t_end=-1", "--dry-run")
    assert code == 2 and "t_end" in error


@pytest.mark.parametrize("name", ["interface-instability-mushroom", "vortex"])
def test_dry_run_tells_the_size_that_is_built(shockgrid, name):
    from runs.deck.reading import read_deck

    problem = read_deck(name, ("cells=12",)).make_problem()
    t_end, plans = problem.plan()
    evolution = problem.build()
    assert t_end == evolution.t_end
    for plan, block in zip(plans, evolution.blocks, strict=True):
        assert (plan.name, plan.cells) == (block.name, block.volume.shape)
        assert plan.low == pytest.approx(block.nodes.min(axis=(1, 2)), abs=1e-12)
        assert plan.high == pytest.approx(block.nodes.max(axis=(1, 2)), abs=1e-12)


def test_dry_run_sees_what_blocks_would_refuse(shockgrid):
    words = ("run", "interface-instability", "--dry-run", "--set", "lengths=[0.01,1]")
    code, _, error = shockgrid(*words, "--set", "modes=[{ka0=0.5}]")
    assert code == 2 and "amplitude" in error


def test_where_not_to_trust_a_result_is_said_on_every_screen(shockgrid):
    """Before a run what the deck tells, after it what the run shows as well."""
    deck, run = "caution: density 12 was never tried; take 10 or less", "caution: it was hot"
    words = ("toy", "--set", "density=12", "--set", "run.t_end=0.05")
    code, text, error = shockgrid("check", *words)
    assert code == 0 and deck in error and "caution" not in text
    _, text, _ = shockgrid("run", *words, "--dry-run")
    assert deck in text and run not in text
    code, screen, error = shockgrid("run", *words, "-o", "cautious")
    assert code == 0 and deck in error and run not in error
    assert f"{deck}\n{run}\n" in screen
    assert f"{deck}\n{run}\n" in Path("cautious/summary.txt").read_text()
    assert f"{deck}\n{run}\n" in shockgrid("info", "cautious")[1]
    _, screen, error = shockgrid("run", *words, "-q", "-o", "quiet")
    assert "caution" not in error and deck in screen
    _, screen, error = shockgrid("run", "toy", "--set", "run.t_end=0.05", "-o", "fine")
    assert "caution" not in screen + error + shockgrid("info", "fine")[1]


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


def test_run_data(run):
    assert run.deck.cells == 8 and run.problem_name == "toy"
    assert run.history["t"][0] == 0.0 and np.isnan(run.history["dt"][0])
    assert run.history["dt_limit"][1] == "diffusion"
    assert run.history["step"].dtype == np.int64
    times = [dump.t for dump in run.dumps]
    assert len(times) == 21 and times == sorted(times)
    late = [t - 0.2 * k / 20 for k, t in enumerate(times)]
    assert min(late) >= 0 and max(late) < run.history["dt"][1:].max()
    assert run.dump_at(0.1).block("right").nodes.shape == (2, 9, 9)


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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["bla"], "no field 'bla'; there are: rho, q"),
        (["--what", "colling"], "did you mean 'cooling'?"),
        (["--zoom", "1,2"], "four numbers"),
        (["--zoom", "0,1e9,0,1"], "more than 1000 times the other"),
        (["--zoom", "5,6,0,1"], "outside the domain: x is 0 to 2 m, y is 0 to 1 m"),
        (["--zoom", "0,1,1,2", "--what", "interface"], "outside the domain"),
        (["--at", "soon"], "'soon' is not a number"),
        (["-o", "nowhere/picture.png"], "nowhere is no folder to write picture.png into"),
        (["-o", "picture.doc"], ".png, .pdf or .svg"),
        (["dt_limit", "--what", "history"], "holds words"),
    ],
)
def test_plot_of_what_is_not_there(shockgrid, run, words, said):
    code, _, error = shockgrid("plot", "run", *words)
    assert code == 2 and said in error


def test_damaged_files_are_named(shockgrid, run):
    """A torn dump, one without attributes, a history of words: told, and nothing is drawn."""
    import h5py

    torn, bare = run.dumps[-1].path, run.dumps[-2].path
    torn.write_bytes(torn.read_bytes()[:5000])
    with h5py.File(bare, "r+") as file:
        del file.attrs["t"]
    code, _, error = shockgrid("plot", "run", "--dpi", "40")
    assert code == 2 and f"{bare.name} is torn or damaged" in error
    code, text, _ = shockgrid("info", "run")
    assert code == 2 and all(f"damaged: {path} is torn" in text for path in (torn, bare))
    assert f"last restart point: step {run.dumps[-3].step}" in text
    for words in (("info", str(bare)), ("compare", "run", "run")):
        code, _, error = shockgrid(*words)
        assert code == 2 and f"{bare.name} is torn or damaged" in error
    lines = run.directory.history.read_text().splitlines()
    lines[2] = ",".join(["x"] * (lines[2].count(",") + 1))
    run.directory.history.write_text("\n".join(lines) + "\n")
    for words in (("info", "run"), ("plot", "run", "--what", "history")):
        code, text, error = shockgrid(*words)
        assert code == 2 and "history.csv is damaged in line 3" in text + error


def test_last_restart_point_is_shown(shockgrid, run):
    """As a kill leaves it: after the last dump there is a restart point."""
    directory, last = run.directory, run.dumps[-1].step
    directory.dump_path(last).rename(directory.restart_path(last))
    killed = RunData("run")
    assert len(killed.outputs) == 20 and len(killed.dumps) == 21
    assert [dump.is_restart_point for dump in killed.dumps[-2:]] == [False, True]
    assert time_titles(killed.dumps)[-1] == "t = 200 ms (restart point)"
    assert shockgrid("plot", "run", "-o", "end.png", "--at", "end", "--dpi", "40")[0] == 0
    assert "20 dumps and a newer restart point, t = 0 to 0.2 s" in shockgrid("info", "run")[1]
    shockgrid("run", "toy", "-q", "-o", "whole", "--set", "run.t_end=0.2")
    code, text, _ = shockgrid("compare", "run", "whole")
    assert code == 1 and text == f"first: dumps: 1 only in whole (steps {last})\n"
    directory.restart_path(last).rename(directory.restart_path(1))
    assert len(RunData("run").dumps) == 20  # older than the last dump: not shown


@pytest.mark.parametrize("number", [1, 2, 3, 4, 7, 12])
def test_no_panel_of_a_field_is_empty(run, number):
    figure = new_figure()
    draw_fields(figure, run.dumps[:number], ["rho"], View())
    *panels, _bar = figure.axes
    assert len(panels) == number and all(axes.get_visible() for axes in panels)


@pytest.mark.parametrize("what", ["history", "cooling"])
def test_plot_without_its_history(shockgrid, run, what):
    run.directory.history.unlink()
    code, _, error = shockgrid("plot", "run", "--what", what)
    assert code == 2 and "history.csv is missing" in error


def test_plot_beyond_the_end_says_what_is_drawn(shockgrid, run):
    code, _, error = shockgrid("plot", "run", "--at", "0,99")
    assert code == 0 and "t = 0 to 0.2 s; drawn: t = 0, 0.2 s" in error
    assert shockgrid("plot", "run", "--at", "0,end")[2] == ""


@pytest.mark.parametrize(
    ("words", "idle"),
    [
        (["--what", "cooling", "--at", "0.1", "--mesh"], "--at, --mesh"),
        (["--what", "history", "hottest", "--zoom", "0,1,0,1"], "--zoom"),
        (["--what", "interface", "rho", "--at", "0"], "FIELDS"),
    ],
)
def test_plot_says_which_options_a_picture_does_not_heed(shockgrid, run, words, idle):
    code, _, error = shockgrid("plot", "run", *words, "--dpi", "40")
    assert code == 0 and error == f"{idle}: not heeded by the picture {words[1]!r}\n"


@pytest.mark.parametrize("zoom", ["0.5,1.5,0,1", "0.9,1.1,0,1", "0.5,1,0,0.1"])
def test_title_of_a_single_panel_is_whole(run, zoom):
    view = View(parse_zoom(zoom))
    fields, meshes = new_figure(), new_figure()
    draw_fields(fields, run.dumps[-1:], ["rho"], view)
    draw_meshes(meshes, run.dumps[-1:], view)
    for figure in (fields, meshes):
        figure.canvas.draw()
        title = figure.axes[0].title.get_window_extent()
        assert title.y1 < figure.bbox.y1 - 2 and title.y0 > figure.axes[0].bbox.y1


def test_plot_at_the_end_of_a_run(shockgrid):
    code, text, _ = shockgrid("run", "toy", "-q", "--plot", "--set", "run.t_end=0.05")
    assert code == 0 and "out/toy-1/cooling.png" in text
    assert Path("out/toy-1/fields-rho.png").exists()


def test_compare_codes(shockgrid, run):
    shockgrid("run", "toy", "-q", "-o", "same", "--set", "run.t_end=0.2")
    hotter = ("--set", "start={kind='hot',temperature=2.0001}")
    shockgrid("run", "toy", "-q", "-o", "other", "--set", "run.t_end=0.2", *hotter)
    finer = ("--set", "cells=10")
    shockgrid("run", "toy", "-q", "-o", "finer", "--set", "run.t_end=0.2", *finer)
    assert shockgrid("compare", "run", "same")[0] == 0
    code, text, _ = shockgrid("compare", "run", "other")
    assert code == 1 and text.startswith("first: ") and "most:" in text
    assert shockgrid("compare", "run", "other", "--rtol", "1e-2")[0] == 0
    a, b = (str(RunData(name).dumps[0].path) for name in ("run", "other"))
    code, text, _ = shockgrid("compare", a, b)
    assert code == 1 and "block left, rho" in text and "64 of 64" in text
    assert shockgrid("compare", a, a)[0] == 0
    code, text, _ = shockgrid("compare", "run", "finer")
    assert code == 1 and "finer laid on the grid of run" in text
    assert shockgrid("compare", "run", a)[0] == 2
    assert shockgrid("compare", "run", "nowhere")[0] == 2


def test_schema(shockgrid):
    code, text, _ = shockgrid("schema", "toy")
    schema = json.loads(text)
    assert code == 0 and schema == json.loads(shockgrid("check", "toy", "--schema")[1])
    assert schema["additionalProperties"] is False and schema["required"] == ["problem"]
    assert schema["properties"]["cells"]["maximum"] == 400
    assert schema["properties"]["run"]["default"]["t_end"] == 0.5
    assert "null" not in text and "None" not in text


def test_schema_keys_are_the_decks_keys():
    schema = make_schema("toy")
    import toy_problem

    assert set(schema["properties"]) == {"problem", *toy_problem.ToyDeck.__struct_fields__}


def test_bench_prints_and_keeps_speeds(shockgrid, toy):
    """Every speed is a positive number, the shares make a whole, and other tables stay."""
    path = toy / "speeds.json"
    path.write_text('{"kept": {"rows": []}}')
    code, out, _ = shockgrid("bench", "--cells=16", "--rounds=1", "--runs=none", f"--json={path}")
    assert code == 0 and "whole step, grid rebuilt" in out
    tables = json.loads(path.read_text())
    assert set(tables) >= {"kept", "flow", "flow-parts"}
    assert all(row["median, million/s"] > 0.0 for row in tables["flow"]["rows"])
    for row in tables["flow-parts"]["rows"]:
        assert sum(row[f"{part}, %"] for part in ("sides", "regrid", "flow")) == pytest.approx(
            100, 1e-2
        )


def test_bench_says_what_it_cannot_use(shockgrid, toy):
    """No peer in the directory, no JSON in the file: a sentence each, and nothing is lost."""
    path = toy / "speeds.json"
    path.write_text("not JSON")
    code, _, err = shockgrid("bench", "--runs=none", f"--json={path}")
    assert code == 2 and "is not a JSON file of measurements" in err
    assert path.read_text() == "not JSON"
    code, _, err = shockgrid("bench", "--runs=none", f"--peer={toy}")
    assert code == 2 and "build CloverLeaf_ref there" in err
