"""Pictures of a study: quantities over what is varied, theory beside; errors over the cells.

What is varied most finely lies along x, lines are for the other keys.  Where two numbers are varied
over a product of some size and there is theory, a map shows how far from it each run is.
"""

from __future__ import annotations

import io
import itertools
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from runs.pictures.command import write_figure
from runs.store.files import write_atomically
from runs.study.definition import make_column
from runs.study.orders import Series
from runs.verify import CASES

MOST_LINES = 10  # in a panel with a legend
LEAST_MAP = 4  # values of each key from which a map is drawn
WRITTEN = 240  # runs up to which a map's numbers are written into it
BOUNDS = (-10.0, -5.0, -2.0, -1.0, 1.0, 2.0, 5.0, 10.0)  # per cent, of the map's colours
APART = 3.0  # distance of series over their own length from which they are drawn as ratios
DPI = 130


def draw_study(study: Any) -> Figure:
    """The figure of a study: a panel for each quantity shown."""
    refined = study.refined_key is not None
    panels = [] if refined else list(study.shown)
    maps = [name for name in panels if _is_map(study, name)]
    series = _choose_series(study) if refined else {}
    total = len(panels) + len(maps) + len(series)
    figure = Figure(figsize=(6.2 * max(1, total), 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    all_axes = iter(figure.subplots(1, max(1, total), squeeze=False)[0])
    for name in panels:
        _draw_lines(next(all_axes), study, name)
        if name in maps:
            _draw_map(figure, next(all_axes), study, name)
    for name, lines in series.items():
        _draw_orders(next(all_axes), study, name, lines)
    words = ", ".join(study.definition.settings)
    title = study.definition.source + (f" ({words})" if words else "")
    figure.suptitle(title if len(title) < 110 else f"{title[:107]}...", fontsize="medium")
    return figure


def save_figure(figure: Figure, path: Path, deck_text: str | None = None) -> None:
    """Write the figure, in the format of the file ending; whole or not at all.

    deck_text: the study's definition as TOML, for the metadata.
    """
    image = io.BytesIO()
    write_figure(figure, image, DPI, path.suffix.lstrip(".") or "png", deck_text)
    write_atomically(path, image.getvalue(), durable=False)


def _numbers(study: Any, key: str) -> np.ndarray | None:
    """Values of a key (n,), None where they are no numbers."""
    column = study.table[key]
    return column.astype(float) if column.dtype.kind in "if" else None


def _choose_axis(study: Any) -> str:
    """The key along x: of those that are numbers the one with the most values."""
    keys = [key for key in study.definition.keys if _numbers(study, key) is not None]
    if not keys:
        return study.definition.keys[0]
    return max(keys, key=lambda key: len(set(study.table[key].tolist())))


def _is_even_in_log(values: np.ndarray) -> bool:
    """Do values spread by ratios rather than by steps?"""
    known = np.unique(values)
    if known.size < 3 or known[0] <= 0.0 or known[-1] < 4.0 * known[0]:
        return False
    steps, ratios = np.diff(known), np.diff(np.log(known))
    return ratios.max() / ratios.min() < steps.max() / steps.min()


def _draw_lines(axes, study: Any, name: str) -> None:
    """A quantity over the key along x, a line for each value of the others; theory dashed."""
    key = _choose_axis(study)
    table = study.table
    x = _numbers(study, key)
    places = np.arange(len(table[key])) if x is None else x
    others = [other for other in study.definition.keys if other != key]
    groups: dict[tuple, list[int]] = {}
    for n in range(len(places)):
        groups.setdefault(tuple(table[other][n] for other in others), []).append(n)
    theory = table.get(f"{name}_theory")
    colours = _make_colours(len(groups))
    for (values, numbers), colour in zip(groups.items(), colours, strict=True):
        label = ", ".join(f"{o} = {_say(v)}" for o, v in zip(others, values, strict=True))
        order = sorted(numbers, key=lambda n: places[n])
        line = "o" if theory is not None or x is None else "o-"
        axes.plot(places[order], table[name][order], line, ms=4, color=colour, label=label or None)
        if theory is not None:
            look = {"marker": "_", "ms": 24, "ls": ""} if x is None else {"ls": "--", "lw": 1.0}
            axes.plot(places[order], theory[order], color=colour, **look)
    if x is None:
        axes.set_xticks(places, table[key], rotation=30, ha="right")
        axes.set_xlim(-0.5, len(places) - 0.5)
    elif _is_even_in_log(x):
        axes.set_xscale("log")
        _mark(axes.xaxis, np.unique(x))
    shown = table[name][np.isfinite(table[name])]
    if shown.size and shown.min() > 0.0 and shown.max() > 50.0 * shown.min():
        axes.set_yscale("log")
    axes.set_xlabel(key)
    axes.set_ylabel(_label(study, name))
    if theory is not None:
        axes.plot([], [], "k_" if x is None else "k--", ms=12, lw=1.0, label="theory")
    if theory is not None or len(groups) > 1:
        axes.legend(fontsize="small", frameon=False, ncols=1 + (len(groups) > MOST_LINES // 2))
    axes.grid(alpha=0.3)


def _make_colours(count: int) -> list:
    from matplotlib import colormaps

    if count <= MOST_LINES // 2:
        return [f"C{n}" for n in range(count)]
    return list(colormaps["viridis"](np.linspace(0.0, 0.92, count)))


def _mark(axis, values: np.ndarray) -> None:
    """Ticks of a logarithmic axis: the varied values themselves, some of them where many."""
    shown = values[:: max(1, len(values) // 7)]
    axis.set_major_locator(FixedLocator(shown.tolist()))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(lambda value, place: f"{value:.3g}")


def _say(value) -> str:
    return f"{value:.4g}" if isinstance(value, float | np.floating) else str(value)


def _label(study: Any, name: str) -> str:
    units = study.units.get(name, "1")
    return name.replace("_", " ") + (f" [{units}]" if units != "1" else "")


def _is_map(study: Any, name: str) -> bool:
    vary = study.definition.vary
    numbers = [key for key in vary if _numbers(study, key) is not None]
    large = len(vary) == len(numbers) == 2 and min(map(len, vary.values())) >= LEAST_MAP
    return large and f"{name}_error" in study.table


def _draw_map(figure, axes, study: Any, name: str) -> None:
    """Error of a quantity against theory, in per cent, over the two varied keys."""
    first, second = study.definition.vary
    x, y = (make_column(list(study.definition.vary[key])).astype(float) for key in (first, second))
    errors = 100.0 * study.table[f"{name}_error"].reshape(x.size, y.size)
    orders = np.argsort(x), np.argsort(y)
    x, y, errors = x[orders[0]], y[orders[1]], errors[np.ix_(*orders)]
    norm = BoundaryNorm(BOUNDS, 256, extend="both")
    mesh = axes.pcolormesh(
        _find_edges(x), _find_edges(y), errors.T, norm=norm, cmap="RdBu_r", edgecolors="w", lw=0.5
    )
    if errors.size <= WRITTEN:
        for (i, j), error in np.ndenumerate(errors):
            strong = abs(error) > BOUNDS[-2]
            text = "-" if np.isnan(error) else f"{error:+.1f}"
            colour = "w" if strong else "k"
            axes.text(x[i], y[j], text, ha="center", va="center", fontsize=6, color=colour)
    for values, axis, scale in ((x, axes.xaxis, axes.set_xscale), (y, axes.yaxis, axes.set_yscale)):
        if _is_even_in_log(values):
            scale("log")
            _mark(axis, values)
    axes.set_xlabel(first)
    axes.set_ylabel(second)
    axes.set_title(f"error of {name.replace('_', ' ')} [%]", fontsize="medium")
    figure.colorbar(mesh, ax=axes, label="%", ticks=BOUNDS)


def _find_edges(values: np.ndarray) -> np.ndarray:
    """Edges (n+1,) between rising values (n,), in the middle of their logarithms where they spread

    by ratios.
    """
    log = _is_even_in_log(values)
    places = np.log(values) if log else values
    middle = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2.0 * places[0] - middle[0]], middle, [2.0 * places[-1] - middle[-1]]])
    return np.exp(edges) if log else edges


def _choose_series(study: Any) -> dict[str, list[Series]]:
    """Series by quantity, of those that are shown."""
    chosen: dict[str, list[Series]] = {name: [] for name in study.shown}
    for one in study.orders:
        if one.quantity in chosen:
            chosen[one.quantity].append(one)
    return {name: series for name, series in chosen.items() if series}


def _draw_orders(axes, study: Any, name: str, series: list[Series]) -> None:
    """Errors over the cell size with their orders; other quantities with their uncertainty."""
    axes.set_xlabel(f"1 / {study.refined_key}")
    if series[0].error:
        _draw_errors(axes, study, name, series)
    else:
        _draw_values(axes, study, name, series)
    axes.legend(fontsize="small", frameon=False)
    axes.grid(alpha=0.3)


def _name_series(one: Series) -> str:
    order, kind = one.refined.order, one.refined.kind.removeprefix("error")
    told = f"order {order:.2f}" if np.isfinite(order) else kind
    return ", ".join(words for words in (one.words, told) if words)


def _draw_errors(axes, study: Any, name: str, series: list[Series]) -> None:
    """Both axes logarithmic; the bar of `shockgrid verify` where it has one for this deck."""
    for one, colour in zip(series, _make_colours(len(series)), strict=True):
        label = _name_series(one)
        axes.plot(1.0 / one.cells, np.abs(one.values), "o-", color=colour, ms=5, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylabel(f"|{_label(study, name)}|")
    _mark(axes.xaxis, np.unique(np.concatenate([1.0 / one.cells for one in series])))
    axes.xaxis.set_major_formatter(lambda value, place: f"1/{1.0 / value:.4g}")
    _draw_slopes(axes, series)
    this = study.definition.source, name, set(study.definition.settings)
    case = next((c for c in CASES if (c.deck, c.quantity, set(c.settings)) == this), None)
    if case is not None and case.bar is not None and len(series) == 1:
        label = f"bar of shockgrid verify at {case.sizes[case.judged]} cells"
        axes.axhline(case.bar, color="C3", lw=1.0, ls=":", label=label)


def _draw_values(axes, study: Any, name: str, series: list[Series]) -> None:
    """Values with the uncertainty of the finest, theory dashed, a star for cells of no size.

    Series that lie farther apart than they are long are drawn as differences from theory, or from
    their finest value where there is none.
    """
    spans = [float(np.ptp(one.values)) for one in series]
    ends = [float(one.values[-1]) for one in series]
    apart = len(series) > 1 and max(ends) - min(ends) > APART * max(spans)
    known = all(np.isfinite(one.theory) and one.theory for one in series)
    apart = apart and (known or all(ends))
    for one, colour in zip(series, _make_colours(len(series)), strict=True):
        scale = one.theory if known else float(one.values[-1])

        def show(value, scale=scale):
            return 100.0 * (value / scale - 1.0) if apart else value

        bars = np.zeros_like(one.values)
        bars[-1] = np.nan_to_num(one.refined.uncertainty)
        bars *= abs(100.0 / scale) if apart else 1.0
        look = {"fmt": "o-", "color": colour, "capsize": 4, "label": _name_series(one)}
        axes.errorbar(1.0 / one.cells, show(one.values), yerr=bars, **look)
        if np.isfinite(one.theory) and not apart:
            axes.axhline(one.theory, color=colour, lw=1.0, ls="--")
        if np.isfinite(one.refined.extrapolated):
            axes.plot(0.0, show(one.refined.extrapolated), "*", color=colour, ms=9)
    away = "theory" if known else "the finest grid"
    label = (
        f"{name.replace('_', ' ')}: difference from {away} [%]" if apart else _label(study, name)
    )
    axes.set_ylabel(label)
    axes.set_xlim(left=-0.03 * float(max((1.0 / one.cells).max() for one in series)))
    if apart and known:
        axes.axhline(0.0, color="k", lw=1.0, ls="--")
    if known:
        axes.plot([], [], "k--", lw=1.0, label="theory")
    if any(np.isfinite(one.refined.extrapolated) for one in series):
        axes.plot([], [], "k*", ms=9, label="extrapolated to h = 0")


def _draw_slopes(axes, series: list[Series]) -> None:
    """Slopes of orders 1 and 2 through the largest error of the coarsest grid."""
    largest = max(series, key=lambda one: abs(one.values[0]))
    size = 1.0 / largest.cells
    for order, line in zip((1, 2), itertools.cycle(("-.", ":"))):
        slope = abs(largest.values[0]) * (size / size[0]) ** order
        axes.plot(size, slope, f"k{line}", lw=0.7, alpha=0.6, label=f"slope {order}")
