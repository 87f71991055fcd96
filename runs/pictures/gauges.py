"""The picture of a run's gauges: a panel for each field over time, and where moving ones went."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps

from problems.deck import place_gauges
from regrid.errors import BadInput
from runs.inspection.units import pick_prefix
from runs.pictures.fields import scale_times
from runs.store.reader import RunData

UNITS = {"rho": "kg/m3", "u": "m/s", "v": "m/s", "p": "Pa", "e": "J/kg", "c": "m/s"}
WORDS = {
    "rho": "density", "u": "velocity u", "v": "velocity v", "p": "pressure",
    "e": "specific internal energy", "c": "sound speed",
}  # fmt: skip
MOST_NAMED = 10  # gauges with a line in the legend; more are told apart by a row of colours
MOST_EMPTY = 3  # gauges without values that a panel names
COLUMNS = 3
WIDTH, HEIGHT = 4.4, 2.8  # inches of a panel


def draw_gauges(figure, run: RunData, names: list[str]) -> None:
    """Fields over time at all gauges that write them; `names`: these fields or gauges alone.

    Raises BadInput where a run has no gauges, and for a name that is none of them.
    """
    table, points = run.gauges, place_gauges(run.deck.gauge)
    if not points:
        raise BadInput(f"{run.path} has no gauges; a deck has them as [[gauge]] tables")
    if len(table.get("t", ())) < 2:
        raise BadInput(f"{run.directory.gauges} has no rows to draw yet")
    fields = list(dict.fromkeys(name for point in points for name in point.fields))
    known = [*fields, *(point.name for point in points)]
    for name in names:
        if name not in known:
            raise BadInput(f"{run.path} has no gauge or field {name!r}; there are: "
                           f"{', '.join(known[:20])}")  # fmt: skip
    chosen = [p for p in points if p.name in names] or points
    fields = [name for name in fields if name in names] or fields
    fields = [name for name in fields if any(name in point.fields for point in chosen)]
    factor, unit = scale_times(run.dumps) if run.dumps else pick_prefix(table["t"][-1], "s")
    colours = colormaps["turbo"](np.linspace(0.05, 0.95, len(chosen)))
    columns = min(COLUMNS, len(fields))
    rows = -(-len(fields) // columns)
    figure.set_size_inches(max(WIDTH * columns, 7.0), HEIGHT * rows + 0.6)
    grid = list(figure.subplots(rows, columns, squeeze=False, sharex=True).flat)
    for axes, field in zip(grid, fields, strict=False):
        writers = [(k, p) for k, p in enumerate(chosen) if field in p.fields]
        values = {p.name: np.asarray(table[f"{p.name}_{field}"], dtype=float) for _, p in writers}
        sizes = [np.abs(v[np.isfinite(v)]).max(initial=0.0) for v in values.values()]
        scale, field_unit = pick_prefix(float(max(sizes)), UNITS[field])
        for k, point in writers:
            style = "--" if point.moves else "-"
            curve = scale * values[point.name]
            axes.plot(factor * table["t"], curve, style, color=colours[k], lw=1, label=point.name)
        _name_empty(axes, [name for name, v in values.items() if not np.isfinite(v).any()])
        axes.set_title(f"{WORDS[field]} [{field_unit}]", fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
    for axes in grid[len(fields) :]:
        axes.set_visible(False)
    for axes in grid[max(0, len(fields) - columns) : len(fields)]:
        axes.tick_params(labelbottom=True)
    moving = "; dashed: moves with the material" * any(point.moves for point in chosen)
    figure.supxlabel(f"t [{unit}]{moving}", fontsize=9)
    named = chosen
    if len(chosen) > MOST_NAMED:
        named = [chosen[k] for k in np.linspace(0, len(chosen) - 1, MOST_NAMED).round().astype(int)]
    lines = {line.get_label(): line for axes in grid for line in axes.get_lines()}
    handles = [lines[point.name] for point in named if point.name in lines]
    title = f"{len(named)} of {len(chosen)}" if len(named) < len(chosen) else None
    figure.legend(handles=handles, loc="outside right upper", fontsize=8, title=title)


def _name_empty(axes, names: list[str]) -> None:
    """Say in the panel which gauges have no value at any time: they lie outside of all blocks."""
    if names:
        more = f" and {len(names) - MOST_EMPTY} more" if len(names) > MOST_EMPTY else ""
        words = f"outside of all blocks: {', '.join(names[:MOST_EMPTY])}{more}"
        place = {"transform": axes.transAxes, "ha": "left", "va": "bottom", "color": "0.3"}
        axes.text(0.02, 0.03, words, fontsize=7, **place)
