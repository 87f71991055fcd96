"""The finish of every picture, whoever has drawn it: readable numbers and no blank space.

Axes labelled with an SI unit get a prefix (`x [m]` up to 0.002 becomes `x [mm]` up to 2), so that
problems may draw in SI units.  Curves that only differ by round-off are drawn flat, single points
far beyond all others do not set the range of an axis, and panels are as large as the maps in them.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.ticker import ScalarFormatter

from shockgrid.problems.prefixes import PREFIXED, pick_prefix

# relative to the size of a quantity: smaller differences are those of round-off
SHOWN_ROUND_OFF = 1e-11
FLAT_MARGIN = 0.05  # of its size: shown about a quantity that is constant
# points beyond the usual range by this factor do not set the range of an axis
SPIKE_RATIO = 50.0
SPIKE_SHARE = 0.01  # of the points of a curve at most: those of spikes, at each end
LEAST_CURVE_POINTS = 20  # a curve of fewer has no usual range
SPIKE_MARGIN = 0.3  # of the usual range: shown beyond it
FITTING_PASSES = 3
LEAST_BLANK = 0.03  # of the size of a picture: less is left
SMALLEST_PICTURE = (5.0, 2.2)  # inches
PLAIN_NUMBERS = (0.1, 1e4)  # numbers in this range need no prefix
LABEL = re.compile(r"(?P<words>.*) \[(?P<unit>[^\]]+)\](?P<more>.*)")
COORDINATES = ("x", "y", "r", "z")


def finish_figure(figure: Figure) -> None:
    """Finish a picture that is drawn; a second call changes nothing."""
    for axes in figure.axes:
        if _is_graph(axes):
            _keep_round_off_flat(axes)
            _leave_out_spikes(axes)
    _use_prefixes(figure)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if type(formatter := axis.get_major_formatter()) is ScalarFormatter:
                formatter.set_useOffset(False)
    _remove_blank(figure)


def _is_graph(axes: Axes) -> bool:
    return bool(axes.lines) and axes.get_aspect() == "auto" and axes.get_yscale() == "linear"


def _get_curves(axes: Axes) -> Iterator[np.ndarray]:
    """The finite ordinates of each curve, ignoring straight lines across the axes."""
    for line in axes.lines:
        if line.get_transform() == axes.transData:
            values = np.asarray(line.get_ydata(), dtype=float)
            values = values[np.isfinite(values)]
            if values.size:
                yield values


def _keep_round_off_flat(axes: Axes) -> None:
    curves = list(_get_curves(axes))
    if not curves:
        return
    low = min(values.min() for values in curves)
    high = max(values.max() for values in curves)
    size = max(abs(low), abs(high))
    if 0.0 < high - low <= SHOWN_ROUND_OFF * size:
        axes.set_ylim(low - FLAT_MARGIN * size, high + FLAT_MARGIN * size)


def find_usual_range(values: np.ndarray, share: float) -> tuple[float, float]:
    """Least and largest of the finite `values` without a share (at least one) at each end."""
    number = max(1, int(share * values.size))
    ordered = np.sort(values)
    return float(ordered[number]), float(ordered[-1 - number])


def _leave_out_spikes(axes: Axes) -> None:
    """Limit the axis to the usual range of curves if single points lie far beyond it."""
    curves = [values for values in _get_curves(axes) if values.size >= LEAST_CURVE_POINTS]
    if not curves or not axes.get_autoscaley_on():
        return
    ranges = [find_usual_range(values, SPIKE_SHARE) for values in curves]
    low = min(one[0] for one in ranges)
    high = max(one[1] for one in ranges)
    bottom = min(values.min() for values in curves)
    top = max(values.max() for values in curves)
    if not high - low > SHOWN_ROUND_OFF * max(abs(low), abs(high)):
        return
    if top - bottom <= SPIKE_RATIO * (high - low):
        return
    margin = SPIKE_MARGIN * (high - low)
    notes = []
    if bottom < low - margin:
        notes.append(f"down to {bottom:.2g}")
    else:
        low = bottom
    if top > high + margin:
        notes.append(f"up to {top:.2g}")
    else:
        high = top
    axes.set_ylim(low - margin, high + margin)
    frame = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.5}
    note = f"single points {' and '.join(notes)}"
    axes.text(0.99, 0.01, note, transform=axes.transAxes, ha="right", fontsize=7, bbox=frame)


class Prefixed(ScalarFormatter):
    """Numbers on an axis, times a factor."""

    def __init__(self, factor: float):
        super().__init__(useOffset=False)
        self.set_scientific(False)
        self.factor = factor

    def set_locs(self, locs) -> None:
        """Take the places of the ticks, in the unit of the data."""
        super().set_locs([self.factor * place for place in locs])

    def __call__(self, x, pos=None) -> str:
        """Return the number at a tick."""
        return super().__call__(self.factor * x, pos)

    def format_data_short(self, value) -> str:
        """Return the number at the pointer, in a window."""
        return super().format_data_short(self.factor * value)


class Labelled(NamedTuple):
    """An axis with an SI unit in its label or in the title of its panel."""

    axes: Axes
    axis: Axis
    words: str
    unit: str
    more: str
    in_title: bool

    @property
    def group(self) -> tuple[str, str]:
        """Axes of one group have one prefix: all coordinates, and those of one label."""
        is_coordinate = self.words in COORDINATES and self.unit == "m"
        return ("" if is_coordinate else self.words), self.unit


def _find_labels(figure: Figure) -> Iterator[Labelled]:
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            text = axis.get_label_text()
            in_title = not text and axis is axes.yaxis and _is_graph(axes)
            found = LABEL.fullmatch(axes.get_title() if in_title else text)
            if not found or found["unit"] not in PREFIXED or (in_title and found["more"]):
                continue
            if axis.get_scale() == "linear" and type(axis.get_major_formatter()) is ScalarFormatter:
                yield Labelled(axes, axis, *found.groups(), in_title)


def _use_prefixes(figure: Figure) -> None:
    groups = defaultdict(list)
    for one in _find_labels(figure):
        groups[one.group].append(one)
    for (_, si_unit), members in groups.items():
        largest = max(float(np.abs(one.axis.get_view_interval()).max()) for one in members)
        factor, unit = pick_prefix(largest, si_unit)
        if factor == 1.0 or PLAIN_NUMBERS[0] <= largest < PLAIN_NUMBERS[1]:
            continue
        for one in members:
            label = f"{one.words} [{unit}]{one.more}"
            if one.in_title:
                one.axes.set_title(label, fontsize=one.axes.title.get_fontsize())
            else:
                one.axis.set_label_text(label)
            for axis in (one.axis, *_find_unlabelled(figure, one)):
                axis.set_major_formatter(Prefixed(factor))


def _find_unlabelled(figure: Figure, one: Labelled) -> Iterator[Axis]:
    """Axes beside a labelled one that share its label."""
    place = one.axes.get_subplotspec()
    is_y = one.axis is one.axes.yaxis
    if place is None or one.in_title:
        return
    for axes in figure.axes:
        other = axes.get_subplotspec()
        axis = axes.yaxis if is_y else axes.xaxis
        if axes is one.axes or other is None or other.get_gridspec() is not place.get_gridspec():
            continue
        beside = other.rowspan == place.rowspan if is_y else other.colspan == place.colspan
        same_kind = axes.get_aspect() == one.axes.get_aspect()
        plain = type(axis.get_major_formatter()) is ScalarFormatter
        if beside and same_kind and plain and not axis.get_label_text():
            yield axis


def _remove_blank(figure: Figure) -> None:
    """Make rows and columns of panels as large as the maps in them, which have a given aspect."""
    panels = [axes for axes in figure.axes if axes.get_visible() and axes.get_subplotspec()]
    grids = {axes.get_subplotspec().get_gridspec() for axes in panels}
    if len(grids) != 1 or not isinstance(grid := grids.pop(), GridSpec) or figure.subfigs:
        return
    if all(axes.get_aspect() == "auto" for axes in panels):
        return
    first = figure.get_size_inches()
    for _ in range(FITTING_PASSES):
        figure.draw_without_rendering()
        width, height = figure.get_size_inches()
        rows, lost_height = _measure_panels(panels, grid.nrows, height, down=True)
        columns, lost_width = _measure_panels(panels, grid.ncols, width, down=False)
        lost = np.array([lost_width, lost_height])
        if np.all(lost <= LEAST_BLANK * np.array([width, height])):
            break
        grid.set_height_ratios(rows)
        grid.set_width_ratios(columns)
        size = np.maximum([width, height] - lost, SMALLEST_PICTURE)
        figure.set_size_inches(size * np.min(first / size))  # as large as it was


def _measure_panels(
    panels: list[Axes], number: int, inches: float, down: bool
) -> tuple[list[float], float]:
    """Sizes [inches] that the rows (or columns) of panels need, and how much space is blank."""
    needs = np.zeros(number)
    used = np.zeros(number)
    slots = np.zeros(number)
    for axes in panels:
        place = axes.get_subplotspec()
        span = place.rowspan if down else place.colspan
        figure = axes.figure
        slot = axes.get_position(original=True)
        drawn = axes.get_position()
        whole = axes.get_tightbbox().transformed(figure.transFigure.inverted())  # with its labels
        low, high = (slot.y0, slot.y1) if down else (slot.x0, slot.x1)
        first, last = (whole.y0, whole.y1) if down else (whole.x0, whole.x1)
        sizes = (
            drawn.height if down else drawn.width,
            min(last, high) - max(first, low),
            high - low,
        )
        for most, size in zip((needs, used, slots), sizes, strict=True):
            part = slice(span.start, span.stop)
            most[part] = np.maximum(most[part], inches * size / len(span))
    if np.min(needs) <= 0.0:
        return slots.tolist(), 0.0
    return needs.tolist(), float(np.sum(slots - used))
