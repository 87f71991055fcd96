"""Draws docs/pictures/blocks-and-lines.png: block, side, segment, key node, contact.

python docs/blocks_drawing.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

FILE = Path(__file__).resolve().parent / "pictures" / "blocks-and-lines.png"
CONTACT = "#d84315"
SLIDING = "#2e7d32"
SIDE = "#223344"
GRID = "#99aabb"
NOTES = (  # text, where it stands, what it points at
    ("segment: a wall,\non side j_max", (1.2, 3.6), (1.4, 3.0)),
    ("contact: an interface, one grid line\nthat both blocks share", (5.2, 3.65), (3.84, 2.45)),
    ("side i_min", (0.3, 0.35), (0.0, 1.6)),
    ("key node: segments end here;\nhere three blocks meet", (1.45, -0.55), (3.25, 0.9)),
    ("segment: outflow,\non side i_max", (8.1, 2.2), (7.0, 2.0)),
    ("sliding contact: the nodes\nneed not match", (8.5, 1.0), (6.6, 0.96)),
    ("segment: a free surface", (8.5, -0.2), (7.0, 0.1)),
)


def draw_block(axes, x: np.ndarray, y: np.ndarray, colour: str) -> None:
    """Grid lines, thick at the sides; x and y have the shape (ni+1, nj+1)."""
    axes.fill(
        np.concatenate([x[0], x[:, -1], x[-1, ::-1], x[::-1, 0]]),
        np.concatenate([y[0], y[:, -1], y[-1, ::-1], y[::-1, 0]]),
        color=colour,
    )
    for along, across in ((x, y), (x.T, y.T)):
        for k, (a, b) in enumerate(zip(along, across, strict=True)):
            edge = k in (0, len(along) - 1)
            axes.plot(a, b, color=SIDE if edge else GRID, lw=2.2 if edge else 0.9)


def main() -> None:
    figure, axes = plt.subplots(figsize=(9.6, 4.6), dpi=100)
    s = np.linspace(0.0, 1.0, 13)
    y = 1.0 + 2.0 * s
    bend = 3.6 - 0.35 * np.cos(np.pi * s)  # of the interface
    i = np.linspace(0.0, 1.0, 8)[:, None]
    draw_block(axes, i * bend, y + 0.0 * i, "#e8eef7")
    i = np.linspace(0.0, 1.0, 9)[:, None]
    draw_block(axes, bend + i * (7.0 - bend), y + 0.0 * i, "#fdf3e1")
    i, j = np.meshgrid(np.linspace(bend[0], 7.0, 7), np.linspace(-0.3, 0.93, 5), indexing="ij")
    draw_block(axes, i, j, "#e9f3ea")
    axes.plot(bend, y, color=CONTACT, lw=4)
    axes.plot([bend[0], 7.0], [0.96, 0.96], color=SLIDING, lw=4)
    cell = np.array([2, 3, 3, 2]) / 7 * bend[[5, 5, 6, 6]]
    axes.fill(cell, y[[5, 5, 6, 6]], color="#ffd54f")
    keys = [(0, 1), (0, 3), (bend[0], 0.96), (bend[-1], 3), (7, 3), (7, 0.96), (bend[0], -0.3)]
    axes.plot(*zip(*[*keys, (7, -0.3)], strict=True), "o", mfc="w", mec=SIDE, mew=2, ms=9)
    for name, place in (("air", (1.75, 1.35)), ("gas", (5.3, 1.75)), ("plate", (5.1, 0.3))):
        box = {"fc": "w", "ec": "none", "alpha": 0.8, "pad": 2}
        axes.text(*place, f"block '{name}'", ha="center", weight="bold", bbox=box)
    axes.annotate("cell", (1.35, 1.95), (0.5, 2.4), arrowprops={"arrowstyle": "->"})
    for text, place, target in NOTES:
        axes.annotate(
            text, target, place, ha="center", va="center", arrowprops={"arrowstyle": "->"}
        )
    axes.set(xlim=(-0.3, 9.6), ylim=(-0.9, 4.0), aspect="equal")
    axes.axis("off")
    figure.savefig(FILE, bbox_inches="tight")


if __name__ == "__main__":
    main()
