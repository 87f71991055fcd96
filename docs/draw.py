"""Draws the pictures of docs/pictures that no command of shockgrid draws.

    python docs/draw.py terms                blocks-and-lines.png: block, side, key node, contact
    python docs/draw.py facets               contact-facets.png: leader, follower, pins, facets
    python docs/draw.py plate RUN            plate-on-wedge-strip.png: pressure at three times
    python docs/draw.py mushroom RUN         mushroom-strip.png: density at three times
    python docs/draw.py film NAME FIELD DIR  body-NAME.gif of docs/examples/NAME.toml, run in DIR

The runs:

    shockgrid run plate-on-wedge-apart --set cells=[160,48] --set output.dumps=28 -o out/plate
    shockgrid run interface-instability-mushroom --set cells=256 -o out/mushroom

The films are those of `hammer v`, `jaws u` and `three-discs v`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.patches import Rectangle
from PIL import Image, ImageSequence

from shockgrid.problems.interface_instability.theories import get_kct
from shockgrid.problems.pictures import find_dump
from shockgrid.runs.store.reader import RunData

DOCS = Path(__file__).resolve().parent
INK = "#222222"
SIDE = "#223344"
CONTACT = "#d84315"
GRID = "#99aabb"
ARROW = {"arrowstyle": "->", "color": INK, "lw": 0.8}
BOX = {"fc": "w", "ec": "none", "alpha": 0.8, "pad": 2}
FILM_WIDTH = 400  # pixels
FILM_COLOURS = 32
FRAME_TIME = 350  # ms
TERMS = (  # text, where it stands, what it points at
    ("segment: a wall,\non side j_max", (1.2, 3.6), (1.4, 3.0)),
    ("contact: an interface, one grid line\nthat both blocks share", (5.2, 3.65), (3.84, 2.45)),
    ("side i_min", (0.3, 0.35), (0.0, 1.6)),
    ("key node: segments end here;\nhere three blocks meet", (1.45, -0.55), (3.25, 0.9)),
    ("segment: outflow,\non side i_max", (8.1, 2.2), (7.0, 2.0)),
    ("sliding contact: the nodes\nneed not match", (8.5, 1.0), (6.6, 0.96)),
    ("segment: a free surface", (8.5, -0.2), (7.0, 0.1)),
    ("cell", (0.5, 2.4), (1.35, 1.95)),
)
FACETS = (
    ("pin: a follower's node\non a face of the leader", (2.2, 3.95), (2.78, 2.04)),
    ("pin: a leader's node slightly\nbehind a face of the follower", (5.6, 3.95), (3.62, 2.08)),
    ("face of the follower:\nstraight between its nodes", (1.7, -0.55), (3.9, 1.84)),
    ("facet: the leader's line from a\nnode of either line to the next", (6.0, -0.55), (4.35, 1.9)),
    ("last pin: the contact\nends here", (9.0, 3.75), (5.25, 1.8)),
    ("free surfaces", (10.6, 1.0), (7.8, 1.1)),
)
PLATE = (  # by panel
    (("aluminium, 2 km/s", (33, 6.5), (33, 6.5)), ("steel", (29, -12), (29, -12)),
     ("collision point", (33, -6.3), (19.2, -1.7))),
    (("shocks", (40, -13), (26.5, -6.6)), ("contact", (9, -14.5), (12, -1.7))),
    (("jet", (44.5, -13.5), (41.7, -9.3)), ("gap opens", (11, 3.5), (7, -1.5))),
)  # fmt: skip


def note(axes, notes) -> None:
    """Write notes with arrows to what they are about."""
    for text, place, target in notes:
        axes.annotate(
            text, target, place, ha="center", va="center", color=INK, arrowprops=ARROW, zorder=6
        )


def draw_lines(axes, nodes: np.ndarray, step: int = 1, **style) -> None:
    """Every `step`-th line of a grid (2, ni + 1, nj + 1), and the last ones."""
    lines = []
    for grid in (nodes, nodes.transpose(0, 2, 1)):
        count = grid.shape[1] - 1
        lines += [grid[:, k].T for k in sorted({*range(0, count, step), count})]
    axes.add_collection(LineCollection(lines, **style))


def save(figure, name: str, **options) -> None:
    figure.savefig(DOCS / "pictures" / f"{name}.png", **options)


def fill_grid(axes, nodes: np.ndarray, colour: str) -> None:
    """A block in its colour, with its grid and thick sides."""
    x, y = nodes
    rim = np.s_[0, :], np.s_[:, -1], np.s_[-1, ::-1], np.s_[::-1, 0]
    outline = [np.concatenate([part[side] for side in rim]) for part in (x, y)]
    axes.fill(*outline, color=colour)
    draw_lines(axes, nodes, colors=GRID, lw=0.9)
    axes.plot(*outline, color=SIDE, lw=2.2)


def draw_terms() -> None:
    """Two gases beside each other on a plate: the terms of blocks and lines."""
    figure, axes = plt.subplots(figsize=(9.6, 4.6), dpi=100)
    s = np.linspace(0.0, 1.0, 13)
    y = 1.0 + 2.0 * s
    bend = 3.6 - 0.35 * np.cos(np.pi * s)  # of the interface
    for first, last, cells, colour in ((0.0, bend, 7, "#e8eef7"), (bend, 7.0, 8, "#fdf3e1")):
        i = np.linspace(0.0, 1.0, cells + 1)[:, None]
        fill_grid(axes, np.array([first + i * (last - first), y + 0.0 * i * y]), colour)
    plate = np.meshgrid(np.linspace(bend[0], 7.0, 7), np.linspace(-0.3, 0.93, 5), indexing="ij")
    fill_grid(axes, np.array(plate), "#e9f3ea")
    axes.plot(bend, y, color=CONTACT, lw=4)
    axes.plot([bend[0], 7.0], [0.96, 0.96], color="#2e7d32", lw=4)
    cell = np.array([2, 3, 3, 2]) / 7 * bend[[5, 5, 6, 6]]
    axes.fill(cell, y[[5, 5, 6, 6]], color="#ffd54f")
    keys = [(0, 1), (0, 3), (bend[0], 0.96), (bend[-1], 3), (7, 3), (7, 0.96), (bend[0], -0.3)]
    axes.plot(*zip(*[*keys, (7, -0.3)], strict=True), "o", mfc="w", mec=SIDE, mew=2, ms=9)
    for name, place in (("air", (1.75, 1.35)), ("gas", (5.3, 1.75)), ("plate", (5.1, 0.3))):
        axes.text(*place, f"block '{name}'", ha="center", weight="bold", bbox=BOX)
    note(axes, TERMS)
    axes.set(xlim=(-0.3, 9.6), ylim=(-0.9, 4.0), aspect="equal")
    axes.axis("off")
    save(figure, "blocks-and-lines", bbox_inches="tight")


def draw_facets() -> None:
    """A follower that lies on its leader in part, with the facets between their pins."""
    figure, axes = plt.subplots(figsize=(9.6, 4.6), dpi=100)
    x_leader = np.linspace(0.0, 9.6, 9)
    y_leader = 2.0 - 0.1 * (x_leader - 3.6) ** 2 + 0.0012 * (x_leader - 3.6) ** 4
    x_follower = np.array([0.6, 2.8, 5.2, 7.4, 9.6])
    raised = np.array([0.0, 0.0, 0.0, 0.5, 1.2])  # nodes beyond the end of the contact
    y_follower = np.interp(x_follower, x_leader, y_leader) + raised
    lies_on = raised == 0.0
    between = (x_leader > x_follower[0]) & (x_leader < x_follower[lies_on][-1])
    bodies = (
        (x_leader, y_leader, -0.6, SIDE, "#e8eef7", between),
        (x_follower, y_follower, 0.6, CONTACT, "#fdf3e1", lies_on),
    )
    for x, y, height, colour, fill, pinned in bodies:
        rows = [np.array([x, y + height * k]) for k in range(3)]
        nodes = np.stack(rows, axis=-1)
        axes.fill(*np.concatenate([rows[0], rows[-1][:, ::-1]], axis=1), color=fill)
        draw_lines(axes, nodes, colors=GRID, lw=0.9)
        axes.plot(x, y, color=colour, lw=2)
        axes.plot(x[~pinned], y[~pinned], "o", mfc="w", mec=colour, mew=1.5, ms=6, zorder=5)
        axes.plot(x[pinned], y[pinned], "o", color=colour, ms=7, zorder=5)
    pins = np.sort(np.append(x_leader[between], x_follower[lies_on]))
    for k in range(pins.size - 1):
        ends = pins[k : k + 2]
        colour = ("#2e7d32", "#9ccc65")[k % 2]
        y = np.interp(ends, x_leader, y_leader)
        axes.plot(ends, y, color=colour, lw=5, solid_capstyle="butt", zorder=3)
    axes.plot(x_follower, y_follower, color=CONTACT, lw=1.5, zorder=4)
    axes.text(6.2, 0.92, "leader", ha="center", weight="bold", color=SIDE, bbox=BOX)
    axes.text(8.3, 1.95, "follower", ha="center", weight="bold", color=CONTACT, bbox=BOX)
    note(axes, FACETS)
    axes.set(xlim=(-0.6, 12.0), ylim=(-1.5, 4.4))
    axes.axis("off")
    save(figure, "contact-facets", bbox_inches="tight")


def draw_plate(run: RunData) -> None:
    """Pressure in plate and wedge at three times; materials at rest in colours of their own."""
    figure, panels = plt.subplots(
        1, 3, figsize=(12, 3.2), dpi=140, sharey=True, layout="constrained"
    )
    colours = matplotlib.colormaps["inferno_r"](np.linspace(0.0, 1.0, 256))
    colours[:, 3] = np.clip(np.linspace(0.0, 1.0 / 0.08, 256), 0.0, 1.0)  # the lower end fades
    style = {"cmap": ListedColormap(colours), "vmin": 0.0, "vmax": 45.0}
    at_rest = {"plate": "#dbe9f4", "wedge": "#e6e2dc"}
    for axes, t, notes in zip(panels, (1.29e-6, 2.58e-6, 4.3e-6), PLATE, strict=True):
        dump = find_dump(run, t)
        for block in dump.blocks:
            nodes = 1e3 * block.nodes
            kind = {"shading": "flat", "rasterized": True}
            rest = np.zeros(np.array(nodes.shape[1:]) - 1)
            axes.pcolormesh(*nodes, rest, cmap=ListedColormap([at_rest[block.name]]), **kind)
            shown = axes.pcolormesh(*nodes, block.cell_fields["p"] / 1e9, **kind, **style)
            draw_lines(axes, nodes, 2, colors=INK, lw=0.25, alpha=0.3)
            axes.plot(*nodes[:, :, 0 if block.name == "plate" else -1], color=INK, lw=0.9)
        axes.set(
            title=f"{1e6 * dump.t:.2f} µs", aspect="equal", xlim=(0, 48), ylim=(-17.1, 11.5),
            xlabel="x [mm]",
        )  # fmt: skip
        note(axes, notes)
    velocity = {"width": 3.0, "headwidth": 9.0, "headlength": 8.0, "color": "#4a6fa5"}
    panels[0].annotate("", (33, 0.6), (33, 5.2), arrowprops=velocity)
    panels[2].text(10, -15.5, "reflected shock", color="white", ha="center", va="center")
    panels[0].set_ylabel("y [mm]")
    figure.colorbar(shown, ax=panels, label="pressure [GPa]", pad=0.01, extend="max")
    save(figure, "plate-on-wedge-strip")


def draw_mushroom(run: RunData) -> None:
    """Density at three times, the grid in the lower half; the rolled-up end of the last."""
    figure, panels = plt.subplot_mosaic(
        [["early", "close"], ["middle", "close"], ["late", "close"]],
        figsize=(12, 6.6), dpi=105, layout="constrained", width_ratios=(0.6, 1),
    )  # fmt: skip
    style = {"cmap": "YlGnBu", "vmin": 0.0, "vmax": 10.0, "shading": "flat", "rasterized": True}
    half = np.array([0.0, 0.5])[:, None, None]
    upside_down = np.array([1.0, -1.0])[:, None, None]
    times = {"early": 0.64, "middle": 4.97, "late": 7.65, "close": 7.65}
    for name, axes in panels.items():
        dump = find_dump(run, times[name])
        for block, colour in zip(dump.blocks, (INK, "white"), strict=True):
            lower = block.nodes - half
            for nodes in (lower, upside_down * lower):
                shown = axes.pcolormesh(*nodes, block.cell_fields["rho"], **style)
            step = 2 if name == "close" else 8
            draw_lines(axes, lower, step, colors=colour, lw=0.4, alpha=0.5)
        x, y = (dump.blocks[0].nodes - half)[:, -1]
        axes.plot(x, y, x, -y, color=INK, lw=1.2)
        centre = 0.5 * (x.max() + x.min())
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
    close.spines[:].set(color="#d1495b", lw=1.5)
    late.set_xlabel("x / wavelength")
    late.add_patch(Rectangle((1.25, -0.34), 0.36, 0.34, fill=False, ec="#d1495b", lw=1.5))
    figure.colorbar(shown, ax=close, label="density / that of air", pad=0.01)
    save(figure, "mushroom-strip")


def make_film(name: str, field: str, folder: Path) -> None:
    """Run a deck of docs/examples and make a small film of every second frame."""
    folder.mkdir(parents=True, exist_ok=True)
    run = folder / name
    film = folder / f"{name}.gif"
    shockgrid = [sys.executable, "-m", "shockgrid"]
    deck = DOCS / "examples" / f"{name}.toml"
    subprocess.run([*shockgrid, "run", deck, "-o", run, "--force"], check=True)
    subprocess.run([*shockgrid, "film", run, field, "--mesh", "-o", film], check=True)
    frames = []
    for picture in list(ImageSequence.Iterator(Image.open(film)))[::2]:
        height = round(picture.height * FILM_WIDTH / picture.width)
        size = FILM_WIDTH, height
        frames.append(picture.convert("RGB").resize(size, Image.Resampling.LANCZOS))
    # one palette for all, else the scale beside the picture changes from frame to frame
    sheet = Image.new("RGB", (FILM_WIDTH, height * len(frames)))
    for number, picture in enumerate(frames):
        sheet.paste(picture, (0, number * height))
    palette = sheet.quantize(FILM_COLOURS)
    first, *others = (
        picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in frames
    )
    options = {"save_all": True, "duration": FRAME_TIME, "loop": 0, "optimize": True}
    first.save(DOCS / "pictures" / f"body-{name}.gif", append_images=others, **options)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["terms"]:
            draw_terms()
        case ["facets"]:
            draw_facets()
        case ["plate", run]:
            draw_plate(RunData(run))
        case ["mushroom", run]:
            draw_mushroom(RunData(run))
        case ["film", name, field, folder]:
            make_film(name, field, Path(folder))
        case _:
            raise SystemExit(__doc__)
