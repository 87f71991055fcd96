"""Parts of pictures that problems share: fields of a dump, grids, columns of the history over time.

`run_data` is runs.store.reader.RunData: `.deck`, `.history` (dict of arrays), `.dumps`.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from shockgrid.problems.prefixes import pick_prefix
from shockgrid.regrid.measure.corners import compute_centres


def name_axis(words: str, unit: str) -> str:
    """`words [unit]`; the words alone where there is no unit."""
    return words if unit in ("", "1") else f"{words} [{unit}]"


CONTACT_FRACTION = 0.5  # volume fraction at a contact between two materials in one block
MOST_RATES = 200  # intervals of a run in which rates are drawn
UNITS = {"s": 1.0, "1": 1.0, "ms": 1e3, "µs": 1e6}  # of a time axis, in a second


def make_panels(figure, width: float, height: float, rows: int = 1, columns: int = 1, **more):
    """The panels of a picture of that size [inch], as `figure.subplots` gives them."""
    figure.set_size_inches(width, height)
    return figure.subplots(rows, columns, **more)


def find_dump(run_data, t: float):
    """The dump nearest to time t [s]."""
    return min(run_data.dumps, key=lambda dump: abs(dump.t - t))


def choose_even_dumps(run_data, count: int) -> list:
    """At most so many dumps, evenly spread over the run up to the last one."""
    return run_data.dumps[-1 :: -max(1, len(run_data.dumps) // count)][count - 1 :: -1]


class Colours(NamedTuple):
    """How values become colours: shown over `unit`, as the ends `low` and `high` of the scale are.

    `map`: a colour map of matplotlib; an end that is None is that of the values.
    """

    unit: float = 1.0
    low: float | None = None
    high: float | None = None
    map: str = "viridis"


COLOURS_OF_VALUES = Colours()


def draw_field(
    axis, dump, values, colours=COLOURS_OF_VALUES, *, every=0, bar="", title="", mm=False
):  # fmt: skip
    """Draw a field of all blocks of a dump on an axis; returns the picture for a colour bar.

    values: a name of `cell_fields` or a function `block -> (ni, nj)`; every: draw each so many grid
    lines, 0 none; bar: the label of a colour bar, none without; title: above the panel, "t" for
    the time; mm: lengths in millimetres.
    """
    make = values if callable(values) else (lambda block: block.cell_fields[values])
    fields = [make(block) / colours.unit for block in dump.blocks]
    low = colours.low
    if low is None:
        low = min(float(np.nanmin(field)) for field in fields)
    high = colours.high
    if high is None:
        high = max(float(np.nanmax(field)) for field in fields)
    ends = {"vmin": low, "vmax": high}
    picture = None
    for block, field in zip(dump.blocks, fields, strict=True):
        x, y = nodes = (1e3 if mm else 1.0) * block.nodes
        picture = axis.pcolormesh(x, y, field, cmap=colours.map, rasterized=True, **ends)
        if every:
            draw_grid(axis, nodes, every)
    axis.set_aspect("equal")
    length_unit = "mm" if mm else dump.length_unit
    xlabel, ylabel = (name_axis(name, length_unit) for name in dump.axes)
    axis.set(xlabel=xlabel, ylabel=ylabel)
    if bar:
        axis.figure.colorbar(picture, ax=axis, shrink=0.8, label=bar)
    if title:
        axis.set_title(title_time(dump) if title == "t" else title, fontsize="medium")
    return picture


def draw_lines(axis, lines: Iterable[np.ndarray]) -> None:
    """White polylines (2, n) over a field, in the units of its axes."""
    for line in lines:
        axis.plot(*line, color="w", lw=0.8)


def trace_contact(block) -> list[np.ndarray]:
    """Curves (2, n) [m] on which the volume fraction of a dumped block is a half.

    None where its cells have no such fraction, or lie in a single row.
    """
    fraction = block.cell_fields.get("volume_fraction")
    if fraction is None or min(fraction.shape) < 2:
        return []
    from contourpy import contour_generator  # with matplotlib: slow to load

    centres = compute_centres(block.nodes)
    found = contour_generator(*centres, fraction).lines(CONTACT_FRACTION)
    return [np.asarray(curve).T for curve in found]


def title_time(dump) -> str:
    """`t = 0.6`, or `t = 1.11 µs` where the dump's time has a unit."""
    factor, unit = pick_prefix(dump.t, dump.t_unit)
    return f"t = {factor * dump.t:.3g} {unit}".rstrip()


def draw_grid(axis, nodes: np.ndarray, every: int = 1, color="k", lw=0.2) -> None:
    """Each so many grid lines of a block's nodes (2, ni + 1, nj + 1)."""
    x, y = nodes
    axis.plot(x[::every].T, y[::every].T, color=color, lw=lw)
    axis.plot(x[:, ::every], y[:, ::every], color=color, lw=lw)


def draw_profiles(axis, dumps, name: str, unit: float, exact=None) -> None:
    """A field over `unit` along the first row of the first block [mm] at the times of some dumps;
    in black that of an `exact` flow: its `compute_profile(t)` gives places [m] and values (n,)."""
    for dump in dumps:
        block = dump.blocks[0]
        x = block.centres[0][:, 0]
        values = block.cell_fields[name][:, 0] / unit
        axis.plot(1e3 * x, values, lw=1.4, label=f"{1e6 * dump.t:.3g} µs")
        if exact and dump.t > 0.0:
            x, values = exact.compute_profile(dump.t)
            axis.plot(1e3 * x, values / unit, "k", lw=0.7)


def compute_rates(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles of equal intervals of time [s], and the rates at which `values` (n,) change in them.

    Rates from step to step are round-off over dt where steps are short, as before an early end.
    """
    known = np.isfinite(t) & np.isfinite(values)
    if np.count_nonzero(known) < 2:
        return np.empty(0), np.empty(0)
    count = min(MOST_RATES, np.count_nonzero(known) - 1)
    edges = np.linspace(t[known][0], t[known][-1], count + 1)
    sums = np.interp(edges, t[known], values[known])
    return 0.5 * (edges[1:] + edges[:-1]), np.diff(sums) / np.diff(edges)


def draw_columns(axis, history, labels: Mapping[str, str], words: str = "", unit="s") -> None:
    """Columns of a history over time [unit], with their labels."""
    t = UNITS[unit] * history["t"]
    for name, label in labels.items():
        axis.plot(t, history[name], label=label)
    axis.set(xlabel=name_axis("t", unit), ylabel=words)


def finish_panels(figure) -> None:
    """Fine lines behind the panels that are no maps; a legend where curves have labels."""
    for axes in figure.axes:
        if axes.get_aspect() == "auto" and axes.lines and not axes.collections:
            axes.grid(alpha=0.3)
        if not axes.get_legend() and axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize="small", frameon=False)
