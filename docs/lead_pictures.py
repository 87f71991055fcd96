"""Draws pictures of README and the index: plate-on-wedge-strip, mushroom-strip and growth-rate.png.

shockgrid run plate-on-wedge-apart --set cells=[160,48] --set output.dumps=28 -o out/plate
shockgrid run interface-instability-mushroom --set cells=256 -o out/mushroom
shockgrid run interface-instability --set start=incident --set modes=[{ka0=0.005}] \\
    --set cells=N -o out/N     # for N of 32, 64, 128, 256
python docs/lead_pictures.py out/plate out/mushroom out/32 out/64 out/128 out/256
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.patches import Rectangle

from shockgrid.problems.interface_instability.theories import get_kct, predict_amplitude
from shockgrid.problems.pictures import find_dump
from shockgrid.runs.store.reader import RunData

PICTURES = Path(__file__).resolve().parent / "pictures"
INK = "#222222"
FRAME = "#d1495b"
AT_REST = {"plate": "#dbe9f4", "wedge": "#e6e2dc"}
# panel, words, where they stand, what they point at
NOTES = (
    (0, "aluminium, 2 km/s", (33, 6.5), (33, 6.5)),
    (0, "steel", (29, -12), (29, -12)),
    (0, "collision point", (33, -6.3), (19.2, -1.7)),
    (1, "shocks", (40, -13), (26.5, -6.6)),
    (1, "contact", (9, -14.5), (12, -1.7)),
    (2, "jet", (44.5, -13.5), (41.7, -9.3)),
    (2, "gap opens", (11, 3.5), (7, -1.5)),
)
ARROW = {"arrowstyle": "->", "color": INK, "lw": 0.8}
SLOPE = 0.005  # k a0 of the runs of growth
START = 6.0  # k c t from which rates are averaged
LINES = 8  # of the grid of 256 cells, every so many


def draw_grid(axes, nodes: np.ndarray, step: int, **style) -> None:
    """Every `step`-th line of a grid (2, ni + 1, nj + 1), and the last ones."""
    lines = []
    for grid in (nodes, nodes.transpose(0, 2, 1)):
        count = grid.shape[1] - 1
        lines += [grid[:, k].T for k in sorted({*range(0, count, step), count})]
    axes.add_collection(LineCollection(lines, **style))


def fade_in(name: str, part: float) -> ListedColormap:
    """A colour map whose first `part` is transparent at its lower end."""
    colours = matplotlib.colormaps[name](np.linspace(0.0, 1.0, 256))
    colours[:, 3] = np.clip(np.linspace(0.0, 1.0 / part, 256), 0.0, 1.0)
    return ListedColormap(colours)


def draw_plate(run: RunData) -> None:
    """Pressure in plate and wedge at three times; materials at rest in colours of their own."""
    figure, panels = plt.subplots(
        1, 3, figsize=(12, 3.2), dpi=140, sharey=True, layout="constrained"
    )
    style = {"cmap": fade_in("inferno_r", 0.08), "vmin": 0.0, "vmax": 45.0}
    for axes, t in zip(panels, (1.29e-6, 2.58e-6, 4.3e-6), strict=True):
        dump = find_dump(run, t)
        for block in dump.blocks:
            nodes = 1e3 * block.nodes
            kind = {"shading": "flat", "rasterized": True}
            rest = np.zeros(np.array(nodes.shape[1:]) - 1)
            axes.pcolormesh(*nodes, rest, cmap=ListedColormap([AT_REST[block.name]]), **kind)
            shown = axes.pcolormesh(*nodes, block.cell_fields["p"] / 1e9, **kind, **style)
            draw_grid(axes, nodes, 2, colors=INK, lw=0.25, alpha=0.3)
            axes.plot(*nodes[:, :, 0 if block.name == "plate" else -1], color=INK, lw=0.9)
        axes.set(
            title=f"{1e6 * dump.t:.2f} µs", aspect="equal", xlim=(0, 48), ylim=(-17.1, 11.5),
            xlabel="x [mm]",
        )  # fmt: skip
    for panel, text, place, target in NOTES:
        panels[panel].annotate(
            text, target, place, ha="center", va="center", color=INK, arrowprops=ARROW
        )
    velocity = {"width": 3.0, "headwidth": 9.0, "headlength": 8.0, "color": "#4a6fa5"}
    panels[0].annotate("", (33, 0.6), (33, 5.2), arrowprops=velocity)
    panels[2].text(10, -15.5, "reflected shock", color="white", ha="center", va="center")
    panels[0].set_ylabel("y [mm]")
    figure.colorbar(shown, ax=panels, label="pressure [GPa]", pad=0.01, extend="max")
    figure.savefig(PICTURES / "plate-on-wedge-strip.png")


def draw_mushroom(run: RunData) -> None:
    """Density at three times, the grid in the lower half; the rolled-up end of the last."""
    figure, panels = plt.subplot_mosaic(
        [["early", "close"], ["middle", "close"], ["late", "close"]],
        figsize=(12, 6.6), dpi=105, layout="constrained", width_ratios=(0.6, 1),
    )  # fmt: skip
    style = {"cmap": "YlGnBu", "vmin": 0.0, "vmax": 10.0, "shading": "flat", "rasterized": True}
    half = np.array([0.0, 0.5])[:, None, None]
    times = {"early": 0.64, "middle": 4.97, "late": 7.65, "close": 7.65}
    for name, axes in panels.items():
        dump = find_dump(run, times[name])
        for block, colour in zip(dump.blocks, (INK, "white"), strict=True):
            lower = block.nodes - half
            for nodes in (lower, mirror(lower)):
                shown = axes.pcolormesh(*nodes, block.cell_fields["rho"], **style)
            step = 2 if name == "close" else LINES
            draw_grid(axes, lower, step, colors=colour, lw=0.4, alpha=0.5)
        line = (dump.blocks[0].nodes - half)[:, -1]
        for part in (line, mirror(line)):
            axes.plot(*part, color=INK, lw=1.2)
        centre = 0.5 * (line[0].max() + line[0].min())
        axes.set(aspect="equal", xlim=(centre - 0.9, centre + 0.9), ylim=(-0.5, 0.5))
        axes.set_title(f"$kct$ = {float(get_kct(run.problem, dump.t)):.1f}", fontsize="medium")
        axes.set_ylabel("y / wavelength")
    early, late, close = (panels[name] for name in ("early", "late", "close"))
    for axes, x, y, words, colour in (
        (early, -0.4, 0.3, "air", INK), (early, 0.67, 0.3, "heavy gas", "white"),
        (early, 0.52, 0.1, "shock", "white"), (close, 1.31, -0.27, "air", INK),
        (close, 1.33, -0.06, "heavy gas", "white"),
    ):  # fmt: skip
        axes.text(x, y, words, color=colour, ha="center", va="center")
    early.annotate("", (0.62, 0.02), (0.4, 0.02), arrowprops=ARROW | {"color": "white"})
    close.set(xlim=(1.25, 1.61), ylim=(-0.34, 0.0), ylabel="", xlabel="x / wavelength")
    close.set_title("in the red frame, every second grid line", fontsize="medium")
    close.spines[:].set(color=FRAME, lw=1.5)
    late.set_xlabel("x / wavelength")
    late.add_patch(Rectangle((1.25, -0.34), 0.36, 0.34, fill=False, ec=FRAME, lw=1.5))
    figure.colorbar(shown, ax=close, label="density / that of air", pad=0.01)
    figure.savefig(PICTURES / "mushroom-strip.png")


def draw_growth(runs: list[RunData]) -> None:
    """Growth rate in runs on finer and finer grids and in linear theory; error of its mean."""
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11, 3.0), dpi=130, layout="constrained", width_ratios=(1.5, 1)
    )
    problem = runs[-1].problem
    theory = problem.theory
    speed = problem.theory.base.u
    t = np.linspace(0.0, runs[-1].history.t[-1] - problem.arrival, 600)[1:]
    for n, run in enumerate(runs):
        history = run.history
        cells = run.problem.deck.cells
        kct = get_kct(run.problem, history.t)
        width = max(1, len(history.t) // 200)
        slope = history.amplitude_mode_1 / SLOPE
        rate = (slope[width:] - slope[:-width]) / (history.t[width:] - history.t[:-width]) / speed
        style = {"color": f"C{n}", "lw": 1.4, "label": f"{cells} cells"}
        left.plot(0.5 * (kct[width:] + kct[:-width]), rate, **style)
        exact = predict_amplitude(theory, kct) / problem.k
        gain, right_gain = (a - np.interp(START, kct, a) for a in (slope, exact))
        late = kct > START + 1.0
        right.plot(kct[late], 100.0 * (gain[late] / right_gain[late] - 1.0), **style)
    words = {"color": INK, "ls": "--", "lw": 1.0, "label": "linear compressible theory"}
    left.plot(problem.k * theory.sound_speed * t, theory.get_rate(problem.k, t) / speed, **words)
    left.axhline(theory.impulsive / speed, color="0.6", lw=0.8, label="impulsive model (Richtmyer)")
    left.set(xlabel="kct", ylabel="(da/dt) / (ka₀Δu)", xlim=(0, 30), ylim=(0.0, 0.44))
    left.legend(ncols=2, loc="lower right", fontsize="small")
    right.axhline(0.0, color=INK, ls="--", lw=1.0)
    right.set(xlabel="kct", ylabel="error of the mean rate\nfrom kct = 6 on [%]", xlim=(START, 30))
    right.set_ylim(-0.5, 2.0)
    figure.savefig(PICTURES / "growth-rate.png")


def mirror(points: np.ndarray) -> np.ndarray:
    """Points (2, ...) mirrored in the axis y = 0."""
    return np.stack([points[0], -points[1]])


if __name__ == "__main__":
    draw_plate(RunData(sys.argv[1]))
    draw_mushroom(RunData(sys.argv[2]))
    draw_growth([RunData(path) for path in sys.argv[3:]])
