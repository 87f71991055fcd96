"""What pictures show: units, ranges, windows and sizes, whoever draws them."""

from __future__ import annotations

import numpy as np
import pytest

from shockgrid.problems.pictures import compute_rates
from shockgrid.runs.pictures import fields
from shockgrid.runs.pictures.command import new_figure
from shockgrid.runs.pictures.finishing import SMALLEST_PICTURE, finish_figure

SMALLEST = np.array(SMALLEST_PICTURE)


def draw_map(axes, x, y):
    axes.pcolormesh(*np.meshgrid(x, y), np.zeros((len(y) - 1, len(x) - 1)))
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")


def get_ticks(axis) -> list[str]:
    """Labels of the ticks that are shown."""
    low, high = sorted(axis.get_view_interval())
    places = [place for place in axis.get_majorticklocs() if low <= place <= high]
    return axis.get_major_formatter().format_ticks(places)


@pytest.mark.parametrize(
    ("length", "unit", "last"),
    [(2e-3, "mm", 2.0), (2e-7, "nm", 200.0), (0.2, "m", 0.2), (3e4, "km", 30.0)],
)
def test_lengths_in_metres_get_a_prefix(length, unit, last):
    figure = new_figure()
    axes = figure.subplots()
    draw_map(axes, np.linspace(0.0, length, 5), np.linspace(0.0, length / 2, 5))
    finish_figure(figure)
    finish_figure(figure)  # once is enough
    assert (axes.get_xlabel(), axes.get_ylabel()) == (f"x [{unit}]", f"y [{unit}]")
    assert float(get_ticks(axes.xaxis)[-1]) == pytest.approx(last)


def test_panels_of_one_row_have_one_unit():
    """An unlabelled axis beside a labelled one has its numbers; other quantities have their own."""
    figure = new_figure()
    left, right = figure.subplots(1, 2)
    for axes, size in ((left, 1e-4), (right, 5e-3)):
        axes.plot(np.linspace(0.0, 1e-6, 30), np.linspace(0.0, size, 30))
        axes.set_xlabel("t [s]")
    left.set_ylabel("amplitude [m]")
    right.sharey(left)
    finish_figure(figure)
    assert left.get_xlabel() == right.get_xlabel() == "t [µs]"
    assert left.get_ylabel() == "amplitude [mm]"
    assert get_ticks(right.yaxis) == get_ticks(left.yaxis)
    (titled,) = [(figure := new_figure()).subplots()]
    titled.plot([0.0, 1.0], [0.0, 2.7e10])
    titled.set_title("pressure [Pa]")
    finish_figure(figure)
    assert titled.get_title() == "pressure [GPa]" and float(get_ticks(titled.yaxis)[-1]) == 25.0


def test_round_off_is_flat():
    figure = new_figure()
    axes = figure.subplots()
    axes.plot(1.0 + 1e-14 * np.sin(np.arange(100.0)))
    finish_figure(figure)
    low, high = axes.get_ylim()
    assert low < 0.96 and high > 1.04
    assert all(len(words) < 6 for words in get_ticks(axes.yaxis))


@pytest.mark.parametrize("spikes", [1, 9])
def test_single_points_do_not_set_the_range(spikes):
    values = np.sin(np.linspace(0.0, 6.0, 1000))
    values[-spikes:] = -3.5e8
    figure = new_figure()
    axes = figure.subplots()
    axes.plot(values)
    finish_figure(figure)
    low, high = axes.get_ylim()
    assert -2.0 < low < -1.0 and 1.0 <= high < 2.0
    assert "-3.5e+08" in axes.texts[0].get_text(), "nothing is hidden silently"
    figure = new_figure()
    axes = figure.subplots()
    axes.plot(np.where(np.arange(1000) > 500, 1e3, np.sin(np.arange(1000.0))))  # a front
    finish_figure(figure)
    assert axes.get_ylim()[1] > 1e3 and not axes.texts


def test_rates_do_not_depend_on_the_steps():
    """Steps that become short, with round-off in the values, leave the rate as it is."""
    t = np.concatenate([np.linspace(0.0, 1.0, 400), 1.0 + 1e-14 * np.arange(1, 3000)])
    noise = 1e-12 * np.sin(np.arange(t.size) ** 2)
    middles, rates = compute_rates(t, 3.0 * t + noise)
    assert np.abs(rates - 3.0).max() < 1e-8 and np.all(np.diff(middles) > 0.0)
    assert compute_rates(t[:1], t[:1])[1].size == 0


@pytest.mark.parametrize("shape", [(1, 2), (2, 2), (2, 1)])
@pytest.mark.parametrize("ratio", [0.1, 1.0, 5.0])
def test_maps_fill_their_panels(shape, ratio):
    """At most a tenth of a picture above its least size is lost between maps and their room."""
    figure = new_figure()
    panels = figure.subplots(*shape, squeeze=False)
    for axes in panels.flat:
        draw_map(axes, np.linspace(0.0, 1.0, 5), np.linspace(0.0, ratio, 5))
    finish_figure(figure)
    figure.draw_without_rendering()
    for axes in panels.flat:
        room = axes.get_position(original=True)
        drawn = axes.get_position()
        lost = np.array([room.width - drawn.width, room.height - drawn.height])
        assert np.all((lost < 0.1) | (figure.get_size_inches() < 1.001 * SMALLEST))
    assert np.all(figure.get_size_inches() <= (10.0, 6.0))


def make_sheet(x0, x1, y0, y1, values=None):
    nodes = np.array(np.meshgrid(np.linspace(x0, x1, 13), np.linspace(y0, y1, 13), indexing="ij"))
    return fields.Sheet(nodes, "gas", "gas", {} if values is None else {"rho": values})


def test_bodies_on_their_way_are_followed():
    """Where all times together are mostly blank each panel shows its own."""
    moments = [[make_sheet(x, x + 1.0, 2.0 * x, 2.0 * x + 1.0)] for x in (0.0, 3.0, 9.0)]
    extents = [fields.measure_extent(sheets) for sheets in moments]
    boxes, follows = fields.follow_bodies([(0.0, 10.0, 0.0, 19.0)] * 3, extents)
    assert follows
    for box, (extent, _) in zip(boxes, extents, strict=True):
        assert box == pytest.approx(extent)
    piston = [fields.measure_extent([make_sheet(x, 1.0, 0.0, 0.1)]) for x in (0.0, 0.5, 0.9)]
    assert fields.follow_bodies([(0.0, 1.0, 0.0, 0.1)] * 3, piston) == (
        [(0.0, 1.0, 0.0, 0.1)] * 3,
        False,
    )


def test_windows_leave_out_what_is_blank():
    """A window in a bore is as high as the bore, not as the wide part of the gun elsewhere."""
    sheets = [make_sheet(-1.0, 0.0, 0.0, 0.5), make_sheet(0.0, 1.0, 0.0, 0.1)]
    (box,) = fields.crop_boxes([(0.2, 0.6, 0.0, 0.5)], [sheets])
    assert box == pytest.approx((0.2, 0.6, 0.0, 0.1))


@pytest.mark.parametrize(("cell", "extend"), [(1e4, "max"), (-1e4, "min"), (1.5, "neither")])
def test_one_cell_does_not_stretch_the_colours(cell, extend):
    values = 1.0 + 0.1 * np.sin(np.arange(144.0)).reshape(12, 12)
    values[3, 4] = cell
    found = fields.find_range([make_sheet(0.0, 1.0, 0.0, 1.0, values)], "rho", (0.0, 1.0, 0.0, 1.0))
    low, high, ends = fields.choose_limits([found], cut=True)
    assert ends == extend
    assert (-2.0 < low and high < 2.0) and (extend != "neither" or high == cell)
    half = np.where(np.arange(144).reshape(12, 12) < 72, 1.0, 1e4)
    found = fields.find_range([make_sheet(0.0, 1.0, 0.0, 1.0, half)], "rho", (0.0, 1.0, 0.0, 1.0))
    assert fields.choose_limits([found], cut=True) == (1.0, 1e4, "neither")
