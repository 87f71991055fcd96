"""Draws the pictures of docs/pictures that need several runs, words or measured points.

    python docs/draw.py FOLDER [NAME...]

`pictures.toml` has them: commands of runs, which FOLDER keeps, and panels of fields or curves.
A picture with `film` is a small film of one run; one without panels is what a command draws.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
import tomllib
from itertools import cycle
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from PIL import Image, ImageSequence

from shockgrid.problems.interface_instability.theories import get_kct
from shockgrid.problems.pictures import draw_grid, find_dump
from shockgrid.runs.store.reader import RunData

DOCS = Path(__file__).resolve().parent
SHOCKGRID = [sys.executable, "-m", "shockgrid"]
INK = "#222222"
GRID = "#22222250"
MEASURED = {"fmt": "k+", "ms": 8, "elinewidth": 0.8, "label": "measured", "zorder": 5}
SIDES = {"i_min": np.s_[:, 0], "i_max": np.s_[:, -1], "j_min": np.s_[:, :, 0]}
SIDES["j_max"] = np.s_[:, :, -1]
SCALED_COLUMNS = {
    "k c t": lambda run: get_kct(run.problem, run.history["t"]),
    "k a": lambda run: run.problem.k * run.history["amplitude"],
}
FILM_COLOURS = 32
FRAME_TIME = 350  # ms


def find_run(folder: Path, picture: dict, name: str) -> RunData:
    """A run of a picture, computed where the folder does not have it."""
    directory = folder / name
    if not (directory / "summary.txt").exists():
        command = shlex.split(picture["runs"][name])
        subprocess.run([*SHOCKGRID, "run", *command, "-o", directory, "--force"], check=True)
    return RunData(directory)


def draw_field_panel(axis, panel: dict, run: RunData):
    """A field at one time with its grid; returns what a colour bar belongs to."""
    dump = find_dump(run, panel["at"])
    low, high = panel["limits"]
    colours = matplotlib.colormaps[panel["colours"]](np.linspace(0.0, 1.0, 256))
    if "rest" in panel:  # the lower end fades into colours of the materials
        colours[:, 3] = np.clip(np.linspace(0.0, 12.5, 256), 0.0, 1.0)
    style = {"cmap": ListedColormap(colours), "vmin": low, "vmax": high, "rasterized": True}
    for block, ink in zip(dump.blocks, cycle(panel.get("inks", [GRID])), strict=False):
        shift = np.array(panel.get("shift", [0.0, 0.0]))[:, None, None]
        nodes = panel.get("scale", 1.0) * block.nodes + shift
        values = block.cell_fields[panel["field"]] / panel.get("unit", 1.0)
        if "rest" in panel:
            ground = ListedColormap([panel["rest"][block.name]])
            axis.pcolormesh(*nodes, 0.0 * values, cmap=ground, rasterized=True)
        shown = axis.pcolormesh(*nodes, values, **style)
        lines = [nodes[SIDES[side]] for side in panel.get("lines", {}).get(block.name, ())]
        if panel.get("mirror"):
            axis.pcolormesh(nodes[0], -nodes[1], values, **style)
            lines += [line * [[1.0], [-1.0]] for line in lines]
        draw_grid(axis, nodes, panel["mesh"], ink, 0.25)
        for line in lines:
            axis.plot(*line, color=INK, lw=1.0)
    time = get_kct(run.problem, dump.t) if "kct" in panel else dump.t * 1e6
    words = panel.get("title", "$kct$ = {:.1f}" if "kct" in panel else "{:.2f} µs")
    axis.set_title(words.format(float(time)), fontsize="medium")
    axis.set_aspect("equal")
    return shown


def read_column(run: RunData, name: str, unit: float) -> np.ndarray:
    """A column of the history or, with a dot, of the gauges, over its unit."""
    if name in SCALED_COLUMNS:
        return SCALED_COLUMNS[name](run)
    table = run.gauges if "." in name else run.history
    return table[name.replace(".", "_")] / unit


def draw_curve_panel(axis, panel: dict, find) -> None:
    """Columns over time; bands up to finer runs; measured points."""
    name, unit = panel.get("over", "t"), panel.get("time_unit", 1e-6)
    for curve in panel["curves"]:
        run = find(curve["run"])
        t = read_column(run, name, unit)
        values = read_column(run, curve["column"], 1.0)
        style = {"color": curve["colour"], "lw": 1.3, "ls": curve.get("style", "-")}
        axis.plot(t, values, label=curve["label"], **style)
        if "fine" in curve:
            fine = find(curve["fine"])
            refined = np.interp(t, read_column(fine, name, unit), fine.history[curve["column"]])
            axis.fill_between(t, values, refined, color=curve["colour"], alpha=0.3, lw=0)
    if "trace" in panel:
        times, speeds = np.transpose(find(panel["trace"]).deck.trace)
        errors = panel.get("measured_error", 0.0) * np.abs(speeds)
        axis.errorbar(times / unit, speeds, errors, **MEASURED)
    for label, points in panel.get("points", {}).items():
        axis.plot(*np.transpose(points), panel["marks"][label], ms=8, label=label)
    axis.set_title(panel.get("title", ""), fontsize=10)
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, frameon=False, loc=panel.get("legend", "best"))


def draw_picture(picture: dict, folder: Path):
    """A figure of panels, whose places `mosaic` gives by letters."""

    def find(name):
        return find_run(folder, picture, name)

    mosaic = [list(row) for row in picture["mosaic"]]
    options = {"width_ratios": picture.get("widths"), "layout": "constrained"}
    figure, axes = plt.subplot_mosaic(mosaic, figsize=picture["size"], dpi=120, **options)
    shown = None
    for letter, panel in picture["panels"].items():
        axis = axes[letter]
        if "curves" in panel:
            draw_curve_panel(axis, panel, find)
        else:
            shown = draw_field_panel(axis, panel, find(panel["run"]))
        axis.set(**panel.get("axes", {}))
        for words, place, *target in panel.get("notes", ()):
            arrow = {"arrowstyle": "->", "color": INK, "lw": 0.8} if target else None
            style = {"ha": "center", "va": "center", "color": INK}
            if "note_ground" in panel:
                style["bbox"] = {"fc": panel["note_ground"], "lw": 0, "pad": 2.0}
            axis.annotate(words, target[0] if target else place, place, arrowprops=arrow, **style)
        for x, y, width, height in panel.get("frames", ()):
            axis.add_patch(plt.Rectangle((x, y), width, height, fill=False, ec="#d1495b", lw=1.5))
    if "bar" in picture:
        beside = [axes[letter] for letter in picture["bar_beside"]]
        figure.colorbar(shown, ax=beside, label=picture["bar"], pad=0.01)
    return figure


def make_film(film: dict, run: RunData, picture: Path) -> None:
    """A film of every second frame in few colours, the same in all of them."""
    whole = run.path / "film.gif"
    options = [film["field"], "--mesh", "--dpi", "55", "-o", whole]
    subprocess.run([*SHOCKGRID, "film", run.path, *options], check=True)
    frames = [one.convert("RGB") for one in ImageSequence.Iterator(Image.open(whole))][::2]
    sheet = Image.fromarray(np.concatenate([np.asarray(one) for one in frames]))
    palette = sheet.quantize(FILM_COLOURS)
    first, *others = (one.quantize(palette=palette, dither=0) for one in frames)
    first.save(picture, save_all=True, append_images=others, duration=FRAME_TIME, loop=0)


def main(folder: Path, names: list[str]) -> None:
    pictures = tomllib.loads((DOCS / "pictures.toml").read_text(encoding="utf-8"))
    for name in names or pictures:
        picture = pictures[name]
        if "film" in picture:
            run = find_run(folder, picture, name)
            make_film(picture["film"], run, DOCS / "pictures" / f"{name}.gif")
        else:
            path = DOCS / "pictures" / f"{name}.png"
            draw_picture(picture, folder).savefig(path)
            Image.open(path).convert("RGB").save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
