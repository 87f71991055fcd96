"""Pictures and screens of a small `interface-instability`: frames, labels, units, threads."""

from __future__ import annotations

import numpy as np
import pytest

from runs.pictures.command import new_figure
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
