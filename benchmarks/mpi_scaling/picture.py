"""The picture of docs/scaling.md: measured steps beside the model, efficiencies to 1000 ranks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red")


def draw(result: Mapping[str, Any], path: Path) -> None:
    """Draw the `result` of benchmarks/bench_mpi.py into the PNG file `path`."""
    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw_fit(left, result["fit"])
    _draw_cases(right, result["projection"])
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _draw_fit(axes: Axes, rows: list[Mapping[str, Any]]) -> None:
    """Measured seconds of steps over those of the model, and the line where they agree."""
    hows = list(dict.fromkeys(row["run"].split("², ")[1] for row in rows))
    for how, colour, mark in zip(hows, COLOURS, "osD^", strict=False):
        chosen = [row for row in rows if row["run"].endswith(how)]
        model, measured = ([row[f"{key}, ms"] for row in chosen] for key in ("model", "measured"))
        axes.plot(model, measured, mark, color=colour, label=how, fillstyle="none")
    ends = [row["model, ms"] for row in rows]
    line = min(ends) / 1.5, 1.5 * max(ends)
    axes.plot(line, line, color="grey", lw=0.8, label="equal")
    axes.set(xscale="log", yscale="log")
    axes.set(xlabel="model, ms per step", ylabel="measured, ms per step")
    axes.set_title("Measured runs and the model fitted to them", fontsize=10)
    axes.legend(fontsize=8)


def _draw_cases(axes: Axes, projection: Mapping[str, Any]) -> None:
    """Efficiency over ranks of the named cases; a mark where it falls below a half."""
    assumed = projection["assumed"]
    for number, (name, case) in enumerate(projection["cases"].items()):
        ranks = [row["ranks"] for row in case["rows"]]
        values = [row["efficiency"] for row in case["rows"]]
        style = {"color": COLOURS[number // 2], "ls": "-" if number % 2 == 0 else "--"}
        axes.plot(ranks, values, marker=".", label=name, **style)
        if case["crossover"] is not None:
            axes.plot(case["crossover"], assumed["least efficiency"], "o", ms=9, fillstyle="none",
                      color=style["color"])  # fmt: skip
            axes.annotate(f"{case['crossover']} ranks", (case["crossover"], 0.5),
                          xytext=(6, 6), textcoords="offset points", fontsize=8)  # fmt: skip
    axes.axhline(assumed["least efficiency"], color="grey", lw=0.8)
    axes.set(xscale="log", ylim=(0.0, 1.1), xlabel="ranks", ylabel="efficiency")
    axes.set_title("Model for more ranks: 10⁷ cells (strong), 10⁴ per rank (weak)", fontsize=10)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=2)
