"""The picture of a run's history: a grid of panels over time.

The march comes first (dt, conservation), then the grid, then what was measured; measured columns of
one first word, unit and size share a panel (`interface_min`, `interface_max`, ...).
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping

import numpy as np
from matplotlib import colormaps

from problems.deck import place_gauges
from regrid.errors import BadInput
from runs.inspection.account import compute_drifts, pick_prefix
from runs.pictures.fields import lay_out, scale_times
from runs.store.reader import RunData

FLAT = 1e-9  # relative variation of what is called constant
PLAIN = ("step", "t", "dt", "dt_limit", "finished")
GRID = ("least_scaled_jacobian", "worst_aspect", "cells_not_convex")
SHARED = 30.0  # columns in one panel are of one size within this factor
MOST = 4  # of them
LOGARITHMIC = ("residual", "change", "error")  # words of names of what falls by decades
DECADES = 1e3
WIDTH, HEIGHT = 13.5, 2.4  # inches: of the picture, of a row
LETTERS = 12.0  # an inch, of the line below the panels
HEADROOM = 0.8  # of the range of the conserved totals, above them: for the legend
Panel = list[str]  # names of columns; "dt" and "drift" are drawn their own way


def draw_history(figure, run: RunData, names: list[str]) -> None:
    """Curves over time: the columns in `names`, or else the march, the grid, the measurements."""
    history = run.history
    if len(history.get("t", ())) < 2:
        raise BadInput(f"{run.path} has no history yet: no step was made")
    for name in names:
        if name not in history:
            raise BadInput(f"{run.path} has no column {name!r}; there are: {', '.join(history)}")
        if history[name].dtype.kind not in "fi":
            raise BadInput(f"the column {name!r} of {run.path} holds words, no numbers")
    units = run.find_units()
    factor, unit = scale_times(run.dumps) if run.dumps else pick_prefix(history["t"][-1], "s")
    label = f"t [{unit}]"
    if run.dumps and run.dumps[-1].t_unit != "s":
        label = unit
        history = {name: values[1:] for name, values in history.items()}  # the first is no iterate
    panels, constant = [[name] for name in names], []
    if not names:
        panels, constant = choose_panels(history, units)
    number = len(panels)
    columns = min(min((4, 3, 5), key=lambda n: -number % n), number)  # the fewest empty places
    grid = lay_out(figure, number, columns, (max(WIDTH / max(columns, 3), 6.0 / columns), HEIGHT),
                   sharex=True)  # fmt: skip
    for axes, chosen in zip(grid, panels, strict=True):
        _draw_panel(axes, history["t"] * factor, history, chosen, units)
    if constant:
        words = ", ".join(f"{_say(name)} {np.nanmax(history[name]):.4g}" for name in constant)
        letters = int(LETTERS * figure.get_size_inches()[0])
        label += "\n\n" + textwrap.fill(f"constant: {words}", letters)
    figure.supxlabel(label, fontsize=9)


def choose_panels(
    history: Mapping[str, np.ndarray], units: Mapping[str, str]
) -> tuple[list[Panel], list[str]]:
    """Panels in their order, and the columns that are constant and need none.

    Measured columns of one first word, one unit and one size share a panel.
    """
    known = [
        name
        for name, values in history.items()
        if name not in PLAIN
        and not name.startswith(("total_", "boundary_", "seconds_"))
        and values.dtype.kind in "fi"
        and np.isfinite(values).sum() > 1
    ]
    constant = [name for name in known if _is_flat(history[name])]
    moving = [name for name in known if name not in constant]
    grid = [name for name in moving if name in GRID or name.startswith(("regrid_", "grid_"))]
    panels = [] if moving and _is_flat(history["dt"]) else [["dt"]]
    panels += [["drift"]] if compute_drifts(history) else []
    panels += [[name] for name in grid]
    alone, measured = len(panels), [name for name in moving if name not in grid]
    for name in measured:
        size = np.nanmax(np.abs(history[name]))
        for together in panels[alone:]:
            first = together[0]
            other = np.nanmax(np.abs(history[first]))
            alike = name.split("_")[0] == first.split("_")[0]
            alike = alike and units.get(name) == units.get(first) and len(together) < MOST
            if alike and max(size, other) <= SHARED * min(size, other):
                together.append(name)
                break
        else:
            panels.append([name])
    return panels, constant


def _is_flat(values: np.ndarray) -> bool:
    return np.nanmax(values) - np.nanmin(values) <= FLAT * np.nanmax(np.abs(values))


def _say(name: str) -> str:
    return name.replace("_", " ")


def make_panel(
    history: Mapping[str, np.ndarray], names: Panel, units: Mapping[str, str]
) -> tuple[str, list[tuple[str, np.ndarray, bool]]]:
    """Title of a panel; of its curves label, values (n,), and whether they are points."""
    if names == ["drift"]:
        drifts = compute_drifts(history).items()
        title = "change of conserved totals, relative"
        return title, [(_say(name), drift, False) for name, drift in drifts]
    largest = max(float(np.nanmax(np.abs(history[name]))) for name in names)
    factor, unit = pick_prefix(largest, units.get(names[0], "1"))
    words = history.get("dt_limit")
    if names == ["dt"] and words is not None and words.dtype.kind == "U":
        kinds = [word for word in dict.fromkeys(words.tolist()) if word]
        dt = history["dt"] * factor
        return f"dt [{unit}]", [(k, np.where(words == k, dt, np.nan), True) for k in kinds]
    parts = zip(*(name.split("_") for name in names), strict=False)
    title = " ".join(one[0] for one in parts if len(set(one)) == 1)
    curves = [
        (_say(name).removeprefix(title).strip() or _say(name), history[name] * factor, False)
        for name in names
    ]
    return f"{title} [{unit}]" if unit else title, curves


def _draw_panel(axes, t, history, names: Panel, units) -> None:
    title, curves = make_panel(history, names, units)
    for label, values, points in curves:
        look = {"ls": "", "marker": ".", "ms": 2.5} if points else {"lw": 0.9}
        axes.plot(t, values, label=label, **look)
    axes.set_title(title, fontsize=9)
    if names == ["drift"]:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + HEADROOM * (high - low))
        close = {"columnspacing": 0.8, "handlelength": 1.2, "borderaxespad": 0.2}
        axes.legend(fontsize=6, framealpha=0.6, loc="upper center", ncols=2, **close)
    elif len(curves) > 1:
        axes.legend(fontsize=7, framealpha=0.6)
    size = np.concatenate([np.abs(values) for _, values, _ in curves])
    falls = any(word in LOGARITHMIC for name in names for word in name.split("_"))
    if falls and np.nanmax(size) > DECADES * np.nanmin(size[size > 0.0]):
        axes.set_yscale("log", nonpositive="mask")
    if curves and curves[0][2]:
        axes.set_ylim(bottom=0.0)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)


UNITS = {"rho": "kg/m3", "u": "m/s", "v": "m/s", "p": "Pa", "e": "J/kg", "c": "m/s"}
WORDS = {
    "rho": "density", "u": "velocity u", "v": "velocity v", "p": "pressure",
    "e": "specific internal energy", "c": "sound speed",
}  # fmt: skip
MOST_NAMED = 10  # gauges with a line in the legend; more are told apart by a row of colours
COLUMNS = 3
GAUGES_WIDTH, GAUGES_HEIGHT = 4.4, 3.0  # inches of a panel


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
    size = max(GAUGES_WIDTH, 7.0 / columns), GAUGES_HEIGHT
    grid = lay_out(figure, len(fields), columns, size, sharex=True)
    lines = {}
    for axes, field in zip(grid, fields, strict=True):
        writers = [(k, p) for k, p in enumerate(chosen) if field in p.fields]
        values = [np.asarray(table[f"{p.name}_{field}"], dtype=float) for _, p in writers]
        largest = max(np.abs(v[np.isfinite(v)]).max(initial=0.0) for v in values)
        scale, field_unit = pick_prefix(float(largest), UNITS[field])
        for (k, point), curve in zip(writers, values, strict=True):
            style = "--" if point.moves else "-"
            words = point.name + " (outside of all blocks)" * (not np.isfinite(curve).any())
            lines[k] = axes.plot(
                factor * table["t"], scale * curve, style, color=colours[k], lw=1, label=words
            )[0]
        axes.set_title(f"{WORDS[field]} [{field_unit}]", fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
    moving = "; dashed: moves with the material" * any(point.moves for point in chosen)
    figure.supxlabel(f"t [{unit}]{moving}", fontsize=9)
    handles = [lines[k] for k in sorted(lines)]
    named = handles[:: -(-len(handles) // MOST_NAMED)]
    title = f"{len(named)} of {len(handles)}" if len(named) < len(handles) else None
    figure.legend(handles=named, loc="outside right upper", fontsize=8, title=title)
