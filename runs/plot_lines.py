"""Pictures made of lines: the interfaces over time, and the history of a run."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import Normalize

from regrid.errors import BadInput
from runs.closing import compute_drifts
from runs.interfaces import split_outline
from runs.plot_fields import View, check_zoom, find_extent, make_sheets
from runs.reader import Dump, RunData
from runs.units import pick_prefix, with_unit

FLAT = 1e-9  # relative variation of what is called constant
PLAIN = ("step", "t", "dt", "dt_limit", "finished")


def draw_interfaces(figure, dumps: list[Dump], view: View) -> None:
    """All interfaces at the times of `dumps`, coloured by time; centred if they travel far."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable

    moments = [make_sheets(dump, (), view) for dump in dumps]
    if view.zoom is not None:
        check_zoom(view.zoom, find_extent(moments))
    shapes = [(d.t, split_outline(sheets)[0]) for d, sheets in zip(dumps, moments, strict=True)]
    shapes = [(t, lines) for t, lines in shapes if lines]
    if not shapes:
        raise BadInput(f"{dumps[0].path}: no two materials touch, so there is no interface to draw")
    every = [np.concatenate(lines, axis=1) for _, lines in shapes]
    middles = [0.5 * (points.min(axis=1) + points.max(axis=1)) for points in every]
    sizes = np.max([np.ptp(points, axis=1) for points in every], axis=0)
    travel = np.ptp(middles, axis=0)
    centred = (travel > 0.5 * sizes.max()) & (view.zoom is None)
    largest = float(max(sizes.max(), 0.0 if centred.any() else np.abs(every[0]).max()))
    scale, length = pick_prefix(largest, "m")
    factor, unit = pick_prefix(max(t for t, _ in shapes), "s")
    norm = Normalize(shapes[0][0] * factor, max(shapes[-1][0] * factor, 1e-300))
    colours = colormaps["viridis_r"]
    figure.set_size_inches(8.0, 6.5)
    axes = figure.subplots()
    for (t, lines), middle in zip(shapes, middles, strict=True):
        shift = np.where(centred, middle, 0.0)
        for line in lines:
            x, y = (line - shift[:, None]) * scale
            axes.plot(x, y, color=colours(norm(t * factor)), linewidth=1.2)
    names = [f"{n} - its middle" if c else n for n, c in zip("xy", centred, strict=True)]
    axes.set_xlabel(f"{names[0]} [{length}]")
    axes.set_ylabel(f"{names[1]} [{length}]")
    stretched = view.zoom is None and sizes.min() < 0.25 * sizes.max()
    axes.set_aspect("auto" if stretched else "equal", adjustable="box" if view.zoom else "datalim")
    if view.zoom:
        axes.set_xlim(view.zoom[0] * scale, view.zoom[1] * scale)
        axes.set_ylim(view.zoom[2] * scale, view.zoom[3] * scale)
    figure.colorbar(ScalarMappable(norm, colours), ax=axes, label=f"t [{unit}]")
    first, last = with_unit(shapes[0][0], "s"), with_unit(shapes[-1][0], "s")
    note = ", axes not to one scale" if stretched else ""
    axes.set_title(f"interface, t = {first} to {last}{note}", fontsize=10)


def draw_history(figure, run: RunData, names: list[str]) -> None:
    """Curves over time: the columns in `names`, or else dt, drifts, quality and measurements."""
    history = run.history
    if len(history.get("t", ())) < 2:
        raise BadInput(f"{run.path} has no history yet: no step was made")
    for name in names:
        if name not in history:
            raise BadInput(f"{run.path} has no column {name!r}; there are: {', '.join(history)}")
        if history[name].dtype.kind not in "fi":
            raise BadInput(f"the column {name!r} of {run.path} holds words, no numbers")
    factor, unit = pick_prefix(float(history["t"][-1]), "s")
    t = history["t"] * factor
    chosen = names or [
        name
        for name, values in history.items()
        if name not in PLAIN
        and not name.startswith(("total_", "boundary_", "seconds_"))
        and values.dtype.kind in "fi"
        and np.isfinite(values).sum() > 1
    ]
    still = [] if names else [name for name in chosen if _is_flat(history[name])]
    chosen = [name for name in chosen if name not in still]
    panels = [] if names else ["dt", *(["drift"] if compute_drifts(history) else [])]
    panels += chosen
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    figure.set_size_inches(4.2 * columns, 2.4 * rows + 0.4)
    grid = list(figure.subplots(rows, columns, squeeze=False, sharex=True).flat)
    units = _known_units(run)
    for axes, name in zip(grid, panels, strict=False):
        if name == "dt":
            _draw_dt(axes, t, history)
        elif name == "drift":
            _draw_drifts(axes, t, history)
        else:
            axes.plot(t, history[name], linewidth=0.9)
            unit_of = f" [{units[name]}]" if name in units else ""
            axes.set_title(name.replace("_", " ") + unit_of, fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    for axes in grid[max(0, len(panels) - columns) : len(panels)]:
        axes.set_xlabel(f"t [{unit}]")
        axes.tick_params(labelbottom=True)
    if still:
        constant = ", ".join(f"{n.replace('_', ' ')} {np.nanmax(history[n]):.4g}" for n in still)
        figure.supxlabel(f"constant: {constant}", fontsize=8, color="0.4")


def _known_units(run: RunData) -> dict[str, str]:
    """Units of the history's columns: seconds of wall time, and what the problem says."""
    units = {name: "s" for name in run.history if name.startswith("seconds_")}
    try:
        return units | dict(run.problem.units)
    except BadInput:  # a deck of another version can still be drawn
        return units


def _is_flat(values: np.ndarray) -> bool:
    return np.nanmax(values) - np.nanmin(values) <= FLAT * np.nanmax(np.abs(values))


def _draw_dt(axes, t: np.ndarray, history) -> None:
    dt, words = history["dt"], history.get("dt_limit")
    factor, unit = pick_prefix(float(np.nanmax(dt)), "s")
    axes.set_title(f"dt [{unit}]", fontsize=9)
    if words is None or words.dtype.kind != "U":
        axes.plot(t, dt * factor, linewidth=0.9)
        return
    for name in [word for word in dict.fromkeys(words.tolist()) if word]:
        there = words == name
        axes.plot(t[there], dt[there] * factor, ".", markersize=2.5, label=name)
    axes.legend(fontsize=7, markerscale=3)
    axes.set_ylim(bottom=0.0)


def _draw_drifts(axes, t: np.ndarray, history) -> None:
    axes.set_title("change of conserved totals, relative", fontsize=9)
    for name, drift in compute_drifts(history).items():
        axes.plot(t, drift, linewidth=0.9, label=name.replace("_", " "))
    axes.legend(fontsize=7)
