"""What pictures, `info` and reports say: all of it in sight, in words that a person reads."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.text import Text

from runs.interface.opened import OpenRun
from runs.pictures.command import new_figure
from runs.pictures.history import draw_history
from runs.report.study import show_number
from runs.store.reader import RunData

DECK = """
problem = "interface-instability"
mach = 2
lengths = [2, 2]
cells = 16
[run]
max_steps = 4
[[gauge]]
name = "wall"
at = [0.25, 0.0]
[[gauge]]
name = "line"
at = [-0.5, 0.25]
to = [0.25, 0.25]
count = 4
moves = true
[[gauge]]
name = "far"
at = [99.0, 0.0]
"""


@pytest.fixture
def run(toy, shockgrid) -> RunData:
    (toy / "mine.toml").write_text(DECK)
    assert shockgrid("run", "mine.toml", "-o", "here", "-q")[0] == 0
    return RunData("here")


def test_a_history_shows_all_it_says(run):
    figure = new_figure()
    draw_history(figure, run, [])
    figure.canvas.draw()
    (words,) = (text for text in figure.findobj(Text) if "constant: " in text.get_text())
    box = figure.bbox
    extent = words.get_window_extent()
    assert box.x0 <= extent.x0 and extent.x1 <= box.x1 and box.y0 <= extent.y0
    (totals,) = (axes for axes in figure.axes if axes.get_title().startswith("change of conserved"))
    legend = totals.get_legend().get_window_extent()
    for line in totals.get_lines():
        points = line.get_transform().transform(line.get_xydata())
        assert not any(legend.contains(*point) for point in points)


def test_gauges_without_values_are_named(run):
    figure = OpenRun("here").plot("gauges")
    for axes in (axes for axes in figure.axes if axes.get_visible()):
        assert [text.get_text() for text in axes.texts] == ["outside of all blocks: far"]


def test_info_says_names_and_places(run, shockgrid):
    out = shockgrid("info", "here")[1]
    assert "gauge = wall at [0.25, 0]; line at [-0.5, 0.25] to [0.25, 0.25], 4 points" in out
    assert "moving; far at [99, 0]" in out
    assert "Gauge(" not in out


def test_a_missing_folder_is_named(run, shockgrid):
    code, _, error = shockgrid("export", "here", "-o", "nowhere/curves.csv")
    assert code == 2 and "the folder nowhere does not exist" in error and error.count("\n") == 1
    assert not Path("nowhere").exists()


def test_numbers_of_a_study_have_six_digits():
    shown = {
        "0.22201123456789012": "0.222011", "32": "32", "-1234567": "-1234567",
        "cells=32": "cells=32", "1.2345678901234567e-05": "1.23457e-05", "nan": "nan", "": "",
    }  # fmt: skip
    assert {cell: show_number(cell) for cell in shown} == shown
