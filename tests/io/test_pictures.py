"""Pictures and screens of a small `interface-instability`: frames, labels, units, threads."""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest

from runs.march.closing import describe_threads
from runs.pictures.command import new_figure
from runs.pictures.fields import View, draw_fields, draw_meshes
from runs.pictures.history import draw_history
from runs.store.reader import RunData

WORDS = ("--set=mach=2", "--set=cells=12", "--set=kct_end=6", "--set=run.threads=2", "-q")


@pytest.fixture
def run(shockgrid):
    code, screen, error = shockgrid("run", "interface-instability", *WORDS, "-o", "run")
    assert code == 0, error
    return RunData("run"), screen


def test_growth_stays_in_its_frame_and_says_what_it_shows(run):
    data, _ = run
    figure = new_figure()
    data.problem.figures()["growth"](figure, data)
    amplitude, rate, *panels, bar = figure.axes
    for axes in (amplitude, rate):
        low, high = axes.get_ylim()
        for line in axes.get_lines():
            values = np.asarray(line.get_ydata(), dtype=float)
            if not values.size:  # an entry of the legend
                continue
            assert low <= values.min() and values.max() <= high, line.get_label()
        assert axes.get_xlabel() and axes.get_ylabel()
    assert len(panels) == 3
    assert all(axes.get_xlabel() == "x [m]" and axes.get_title() for axes in panels)
    assert panels[0].get_ylabel() == "y [m]" and bar.get_ylabel() == "density [kg/m3]"


@pytest.mark.parametrize(("deck", "name"), [("noh-spherical", "r"), ("noh", "y")])
def test_the_radius_is_called_so(shockgrid, deck, name):
    words = ("--set=cells=16", "--set=run.max_steps=2", "-q", "-o", "round")
    assert shockgrid("run", deck, *words)[0] == 0
    data = RunData("round")
    for draw in (
        lambda figure: draw_fields(figure, data.dumps, ["v"], View()),
        lambda figure: draw_meshes(figure, data.dumps, View()),
        lambda figure: data.problem.figures()["noh"](figure, data),
    ):
        figure = new_figure()
        draw(figure)
        assert figure.axes[0].get_ylabel() == f"{name} [m]"
    figure = new_figure()
    draw_fields(figure, data.dumps, ["v"], View())
    assert figure.axes[-1].get_ylabel().startswith(("velocity r [", "velocity y [")[name == "y"])
    assert f"{name} 0 to 1 m" in shockgrid("info", str(data.dumps[0].path))[1]


def test_history_has_units(run):
    data, _ = run
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


def test_threads_are_said(run, shockgrid):
    _, screen = run
    (line,) = (line for line in screen.splitlines() if line.startswith("threads: "))
    assert line in shockgrid("info", "run")[1]


@pytest.mark.parametrize(
    ("wanted", "layer", "words"),
    [
        (1, "omp", "1"),
        (2, "omp", "2 (omp)"),
        (2, "workqueue", "2 (workqueue); omp is missing here"),
        (8, "omp", "4 (omp); 8 wanted, but this machine has 4"),
        (2, None, "2 wanted, 1 used"),
    ],
)
def test_words_about_threads(monkeypatch, wanted, layer, words):
    def threading_layer():
        if layer is None:
            raise ValueError("not initialized")
        return layer

    fake = types.SimpleNamespace(
        config=types.SimpleNamespace(NUMBA_NUM_THREADS=4), threading_layer=threading_layer
    )
    monkeypatch.setitem(sys.modules, "numba", fake)
    assert describe_threads(wanted, types.SimpleNamespace()).startswith(words)


def test_blocks_side_by_side_are_said():
    workers = types.SimpleNamespace(threads=2, side_by_side=True)
    words = describe_threads(None, types.SimpleNamespace(workers=workers))
    assert words == "2, blocks side by side"
