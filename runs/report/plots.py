"""The history of a run as plots that one can zoom, in a page that needs no network (plotly).

The panels are those of the picture of the history.  The trap: plotly draws every point; a long
history is thinned so that each stretch keeps its least and its largest value.
"""

from __future__ import annotations

import html
from collections.abc import Mapping
from typing import Any

import numpy as np

from regrid.errors import BadInput
from runs.inspection.account import compute_drifts
from runs.inspection.units import pick_prefix
from runs.pictures.fields import scale_times
from runs.pictures.history import choose_panels, find_units
from runs.store.reader import RunData

MOST = 4000  # points of a curve; a longer one is thinned
COLUMNS, HEIGHT = 2, 230  # panels beside each other, pixels of each
COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#17becf")
EXTRA = "a report needs {name}, which is not installed: pip install 'shockgrid[report]'"


def make_history_plot(run: RunData) -> str:
    """The history as HTML with the plotting library inside; "" where no step was made.

    All panels share the axis of time.  Raises BadInput where plotly is missing.
    """
    try:
        from plotly.subplots import make_subplots
    except ImportError as error:
        raise BadInput(EXTRA.format(name="plotly")) from error
    history = dict(run.history)
    if len(history.get("t", ())) < 2:
        return ""
    factor, unit = scale_times(run.dumps) if run.dumps else pick_prefix(history["t"][-1], "s")
    if run.dumps and run.dumps[-1].t_unit != "s":
        history = {name: values[1:] for name, values in history.items()}
    units = find_units(run)
    panels, constant = choose_panels(history, units)
    drawn = [make_panel(history, names, units) for names in panels]
    rows = -(-len(drawn) // COLUMNS)
    figure = make_subplots(
        rows,
        COLUMNS,
        shared_xaxes="all",
        subplot_titles=[title for title, _ in drawn],
        vertical_spacing=min(0.3 / rows, 0.08),
        horizontal_spacing=0.2,  # the names of curves stand there
    )
    t = history["t"] * factor
    for number, (_, curves) in enumerate(drawn):
        place = {"row": number // COLUMNS + 1, "col": number % COLUMNS + 1}
        legend = f"legend{number + 1}" if number else "legend"
        for k, (name, values, mode) in enumerate(curves):
            x, y = thin(t, values)
            look = {"color": COLOURS[k % len(COLOURS)]}
            figure.add_scatter(
                x=x, y=y, name=name, legend=legend, mode=mode, showlegend=len(curves) > 1,
                line={"width": 1.2, **look}, marker={"size": 3, **look}, **place,
            )  # fmt: skip
        figure.update_xaxes(showticklabels=True, **place)
        axes = figure.get_subplot(place["row"], place["col"])
        side = {"x": axes.xaxis.domain[1] + 0.005, "y": axes.yaxis.domain[1]}
        side |= {"xanchor": "left", "yanchor": "top", "font": {"size": 10}}
        figure.update_layout({legend: side})
    last = {"row": rows, "col": 1}
    figure.update_xaxes(title_text=f"t [{unit}]" if unit.endswith("s") else unit, **last)
    figure.update_annotations(font_size=13)
    figure.update_layout(
        template="plotly_white",
        height=HEIGHT * rows + 80,
        margin={"l": 50, "r": 20, "t": 40, "b": 50},
        hovermode="closest",
    )
    told = [f"{name.replace('_', ' ')} {np.nanmax(history[name]):.4g}" for name in constant]
    words = f'<p class="small">Constant: {html.escape(", ".join(told))}.</p>' if told else ""
    return words + figure.to_html(
        full_html=False,
        include_plotlyjs=True,
        include_mathjax=False,
        div_id="history",
        config={"displaylogo": False, "responsive": True},
    )


def make_panel(
    history: Mapping[str, np.ndarray], names: list[str], units: Mapping[str, str]
) -> tuple[str, list[tuple[str, np.ndarray, str]]]:
    """Title of a panel, and name, values and mode of its curves."""
    if names == ["drift"]:
        drifts = compute_drifts(history)
        curves = [(name.replace("_", " "), drift, "lines") for name, drift in drifts.items()]
        return "change of conserved totals, relative", curves
    largest = max(float(np.nanmax(np.abs(history[name]))) for name in names)
    factor, unit = pick_prefix(largest, units.get(names[0], "s" if names == ["dt"] else "1"))
    title = ", ".join(name.replace("_", " ") for name in names) + (f" [{unit}]" if unit else "")
    words = history.get("dt_limit")
    if names == ["dt"] and words is not None and words.dtype.kind == "U":
        kinds = [word for word in dict.fromkeys(words.tolist()) if word]
        values = history["dt"] * factor
        return title, [(kind, np.where(words == kind, values, np.nan), "markers") for kind in kinds]
    return title, [(name.replace("_", " "), history[name] * factor, "lines") for name in names]


def thin(t: np.ndarray, values: np.ndarray, most: int = MOST) -> tuple[np.ndarray, np.ndarray]:
    """At most `most` points (t, values) of a curve (n,), the extremes of every stretch among them.

    Points that are not finite are left out where others are in their stretch.
    """
    values = np.asarray(values, dtype=float)
    if values.size <= most:
        return t, values
    kept: list[Any] = []
    for part in np.array_split(np.arange(values.size), most // 2):
        known = part[np.isfinite(values[part])]
        if known.size:
            ends = {int(known[values[known].argmin()]), int(known[values[known].argmax()])}
            kept += sorted(ends)
        else:
            kept.append(int(part[0]))
    return t[kept], values[kept]
