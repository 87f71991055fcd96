"""Pictures of a study: quantities over the varied keys, with theory; errors over the cells.

The most finely varied key is along x, with a line for each value of the others.  If two numbers are
varied over a product of some size and there is theory, a map shows the error of each run.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from shockgrid.problems.pictures import name_axis
from shockgrid.runs.pictures.command import new_figure
from shockgrid.runs.study.definition import make_column
from shockgrid.runs.study.orders import Series

FEW_LINES = 5  # in a panel, with colours and a column of the legend for them
LEAST_MAP = 4  # values of each key from which a map is drawn
MOST_WRITTEN_RUNS = 240  # runs up to which numbers are written into a map
BOUNDS = (-10.0, -5.0, -2.0, -1.0, 1.0, 2.0, 5.0, 10.0)  # per cent, of the map's colours


def draw_study(study: Any) -> Figure:
    """The figure of a study: a panel for each quantity shown."""
    panels: list[Callable[[Any], None]] = []
    for name in study.shown:
        series = [one for one in study.orders if one.quantity == name]
        if series:
            draw = _draw_errors if series[0].error else _draw_values
            panels.append(partial(draw, study=study, name=name, series=series))
        elif study.refined_key is None:
            panels.append(partial(_draw_lines, study=study, name=name))
            if _is_map(study, name):
                panels.append(partial(_draw_map, study=study, name=name))
    figure = new_figure()
    figure.set_size_inches(6.2 * max(1, len(panels)), 4.8)
    row = figure.subplots(1, max(1, len(panels)), squeeze=False)[0]
    for axes, panel in zip(row, panels, strict=False):
        panel(axes)
    settings = ", ".join(study.definition.settings)
    title = study.definition.source + (f" ({settings})" if settings else "")
    figure.suptitle(title if len(title) < 110 else f"{title[:107]}...", fontsize="medium")
    return figure


def _numbers(study: Any, key: str) -> np.ndarray | None:
    """Values of a key (n,), None if they are not numbers."""
    column = study.table[key]
    return column.astype(float) if column.dtype.kind in "if" else None


def _is_even_in_log(values: np.ndarray) -> bool:
    """Whether values are spaced by ratios rather than by differences."""
    known = np.unique(values)
    if known.size < 3 or known[0] <= 0.0 or known[-1] < 4.0 * known[0]:
        return False
    steps = np.diff(known)
    ratios = np.diff(np.log(known))
    return bool(ratios.max() / ratios.min() < steps.max() / steps.min())


def _find_edges(values: np.ndarray) -> np.ndarray:
    """Edges (n+1,) between increasing values (n,), midway in their logarithms if they are spaced by
    ratios."""
    log = _is_even_in_log(values)
    places = np.log(values) if log else values
    middle = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2.0 * places[0] - middle[0]], middle, [2.0 * places[-1] - middle[-1]]])
    return np.exp(edges) if log else edges


def _mark(axis: Any, values: np.ndarray, form: Callable[[float], str] = "{:.3g}".format) -> None:
    """A logarithmic axis with ticks at these values, or at some if there are many."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_locator(FixedLocator(values[:: max(1, len(values) // 7)].tolist()))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(lambda value, place: form(value))


def _draw_lines(axes: Any, study: Any, name: str) -> None:
    """A quantity over the key along x, a line for each value of the others; theory dashed."""
    table = study.table
    keys = study.definition.keys
    numbers = [key for key in keys if _numbers(study, key) is not None]
    key = max(numbers, key=lambda key: len(np.unique(table[key])), default=keys[0])
    x = _numbers(study, key)
    places = np.arange(len(table[key])) if x is None else x
    others = [other for other in keys if other != key]
    groups: dict[tuple, list[int]] = {}
    for n in np.argsort(places, kind="stable"):
        groups.setdefault(tuple(table[other][n] for other in others), []).append(n)
    theory = table.get(f"{name}_theory")
    look: dict[str, Any] = {"ls": "--", "lw": 1.0}
    if x is None:
        look = {"marker": "_", "ms": 24, "ls": ""}
        axes.set_xticks(places, table[key], rotation=30, ha="right")
        axes.set_xlim(-0.5, len(places) - 0.5)
    elif _is_even_in_log(x):
        _mark(axes.xaxis, np.unique(x))
    for (values, order), colour in zip(groups.items(), _make_colours(len(groups)), strict=True):
        label = ", ".join(f"{o} = {_say(v)}" for o, v in zip(others, values, strict=True))
        line = "o" if theory is not None or x is None else "o-"
        axes.plot(places[order], table[name][order], line, ms=4, color=colour, label=label or None)
        if theory is not None:
            axes.plot(places[order], theory[order], color=colour, **look)
    shown = table[name][np.isfinite(table[name])]
    if shown.size and shown.min() > 0.0 and shown.max() > 50.0 * shown.min():
        axes.set_yscale("log")
    axes.set(xlabel=key, ylabel=_label(study, name))
    if theory is not None:
        axes.plot([], [], "k_" if x is None else "k--", ms=12, lw=1.0, label="theory")
    if theory is not None or len(groups) > 1:
        axes.legend(fontsize="small", frameon=False, ncols=1 + (len(groups) > FEW_LINES))
    axes.grid(alpha=0.3)


def _make_colours(count: int) -> list[Any]:
    if count <= FEW_LINES:
        return [f"C{n}" for n in range(count)]
    return list(colormaps["viridis"](np.linspace(0.0, 0.92, count)))


def _say(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float | np.floating) else str(value)


def _label(study: Any, name: str) -> str:
    units = study.units.get(name, "1")
    return name_axis(name.replace("_", " "), units)


def _is_map(study: Any, name: str) -> bool:
    vary = study.definition.vary
    numbers = [key for key in vary if _numbers(study, key) is not None]
    large = len(vary) == len(numbers) == 2 and min(map(len, vary.values())) >= LEAST_MAP
    return large and f"{name}_error" in study.table


def _draw_map(axes: Any, study: Any, name: str) -> None:
    """Error of a quantity against theory, in per cent, over the two varied keys."""
    vary = study.definition.vary
    x, y = (make_column(list(values)).astype(float) for values in vary.values())
    errors = 100.0 * study.table[f"{name}_error"].reshape(x.size, y.size)
    orders = np.argsort(x), np.argsort(y)
    x = x[orders[0]]
    y = y[orders[1]]
    errors = errors[np.ix_(*orders)]
    norm = BoundaryNorm(BOUNDS, 256, extend="both")
    edges = (_find_edges(x), _find_edges(y))
    look = {"cmap": "RdBu_r", "edgecolors": "w", "lw": 0.5}
    mesh = axes.pcolormesh(*edges, errors.T, norm=norm, **look)
    for (i, j), error in np.ndenumerate(errors) if errors.size <= MOST_WRITTEN_RUNS else ():
        text = f"{error:+.1f}"
        colour = "w" if abs(error) > BOUNDS[-2] else "k"
        axes.text(
            x[i],
            y[j],
            "-" if np.isnan(error) else text,
            ha="center",
            va="center",
            fontsize=6,
            color=colour,
        )
    for axis, values in ((axes.xaxis, x), (axes.yaxis, y)):
        if _is_even_in_log(values):
            _mark(axis, values)
    axes.set(**dict(zip(("xlabel", "ylabel"), vary, strict=True)))
    axes.set_title(f"error of {name.replace('_', ' ')} [%]", fontsize="medium")
    axes.figure.colorbar(mesh, ax=axes, label="%", ticks=BOUNDS)


def _name_series(one: Series) -> str:
    order = one.refined.order
    kind = "" if one.refined.kind == "error" else one.refined.kind
    name_of_order = f"order {order:.2f}" if np.isfinite(order) else kind
    return ", ".join(part for part in (one.words, name_of_order) if part)


def _draw_errors(axes: Any, study: Any, name: str, series: list[Series]) -> None:
    """Errors over the cell size, both logarithmic, with slopes of orders 1 and 2 through the
    largest of the coarsest grids."""
    for one, colour in zip(series, _make_colours(len(series)), strict=True):
        label = _name_series(one)
        axes.plot(1.0 / one.cells, np.abs(one.values), "o-", color=colour, ms=5, label=label)
    axes.set_yscale("log")
    sizes = np.unique(np.concatenate([1.0 / one.cells for one in series]))
    _mark(axes.xaxis, sizes, lambda size: f"1/{1.0 / size:.4g}")
    largest = max(series, key=lambda one: abs(one.values[0]))
    size = 1.0 / largest.cells
    for order, line in ((1, "k-."), (2, "k:")):
        slope = abs(largest.values[0]) * (size / size[0]) ** order
        axes.plot(size, slope, line, lw=0.7, alpha=0.6, label=f"slope {order}")
    _finish(axes, study, f"|{_label(study, name)}|")


def _draw_values(axes: Any, study: Any, name: str, series: list[Series]) -> None:
    """Values with the uncertainty of the finest, theory dashed, a star for zero cell size.

    Several series are drawn as differences from theory, or else from their finest value.
    """
    known = all(np.isfinite(one.theory) and one.theory for one in series)
    scales = [one.theory if known else one.values[-1] for one in series]
    apart = len(series) > 1 and all(scales)
    for one, scale, colour in zip(series, scales, _make_colours(len(series)), strict=True):
        factor, zero = (100.0 / scale, 100.0) if apart else (1.0, 0.0)
        bars = np.zeros_like(one.values)
        bars[-1] = np.nan_to_num(one.refined.uncertainty) * abs(factor)
        look = {"fmt": "o-", "color": colour, "capsize": 4, "label": _name_series(one)}
        axes.errorbar(1.0 / one.cells, factor * one.values - zero, yerr=bars, **look)
        if np.isfinite(one.theory) and (known or not apart):
            axes.axhline(
                factor * one.theory - zero, color="k" if apart else colour, lw=1.0, ls="--"
            )
        axes.plot(0.0, factor * one.refined.extrapolated - zero, "*", color=colour, ms=9)
    axes.set_xlim(left=-0.03 * float(max((1.0 / one.cells).max() for one in series)))
    if known:
        axes.plot([], [], "k--", lw=1.0, label="theory")
    if any(np.isfinite(one.refined.extrapolated) for one in series):
        axes.plot([], [], "k*", ms=9, label="extrapolated to h = 0")
    away = (
        f"{name.replace('_', ' ')}: difference from {'theory' if known else 'the finest grid'} [%]"
    )
    _finish(axes, study, away if apart else _label(study, name))


def _finish(axes: Any, study: Any, label: str) -> None:
    axes.set(xlabel=f"1 / {study.refined_key}", ylabel=label)
    axes.legend(fontsize="small", frameon=False)
    axes.grid(alpha=0.3)
