"""Draws docs/pictures/contact-facets.png: leader, follower, faces, pins and facets of a contact.

python docs/contact_drawing.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

FILE = Path(__file__).resolve().parent / "pictures" / "contact-facets.png"
LEADER = "#223344"
FOLLOWER = "#d84315"
GRID = "#99aabb"
FACETS = "#2e7d32", "#9ccc65"  # alternately
X_LEADER = np.array([0.0, 1.2, 2.4, 3.6, 4.8, 6.0, 7.2, 8.4, 9.6])
Y_LEADER = 2.0 - 0.1 * (X_LEADER - 3.6) ** 2 + 0.0012 * (X_LEADER - 3.6) ** 4
X_FOLLOWER = np.array([0.6, 2.8, 5.2, 7.4, 9.6])
RAISED = np.array([0.0, 0.0, 0.0, 0.5, 1.2])  # nodes beyond the end of the contact
ROWS = 0.6  # height of a row of cells
NOTES = (  # text, where it stands, what it points at
    ("pin: a follower's node\non a face of the leader", (2.2, 3.95), (2.78, 2.04)),
    ("pin: a leader's node slightly\nbehind a face of the follower", (5.6, 3.95), (3.62, 2.08)),
    ("face of the follower:\nstraight between its nodes", (1.7, -0.55), (3.9, 1.84)),
    ("facet: the leader's line from a\nnode of either line to the next", (6.0, -0.55), (4.35, 1.9)),
    ("last pin: the contact\nends here", (9.0, 3.75), (5.25, 1.8)),
    ("free surfaces", (10.6, 1.0), (7.8, 1.1)),
)


def draw_body(axes, x: np.ndarray, y: np.ndarray, up: float, colour: str, fill: str) -> None:
    """Two rows of cells beside the line (x, y), above it for up = 1 and below it for -1."""
    layers = [y + up * ROWS * k for k in range(3)]
    axes.fill(np.append(x, x[::-1]), np.append(y, layers[-1][::-1]), color=fill)
    for layer in layers[1:]:
        axes.plot(x, layer, color=GRID, lw=0.9)
    for k in range(x.size):
        axes.plot([x[k], x[k]], [y[k], layers[-1][k]], color=GRID, lw=0.9)
    axes.plot(x, y, color=colour, lw=2)


def main() -> None:
    figure, axes = plt.subplots(figsize=(9.6, 4.6), dpi=100)
    y_follower = np.interp(X_FOLLOWER, X_LEADER, Y_LEADER) + RAISED
    draw_body(axes, X_LEADER, Y_LEADER, -1.0, LEADER, "#e8eef7")
    draw_body(axes, X_FOLLOWER, y_follower, 1.0, FOLLOWER, "#fdf3e1")
    axes.plot(X_FOLLOWER, y_follower, color=FOLLOWER, lw=1.5, zorder=4)
    first = X_FOLLOWER[0]
    last = X_FOLLOWER[RAISED == 0.0][-1]
    inside = (X_LEADER > first) & (X_LEADER < last)
    pins = np.sort(np.append(X_LEADER[inside], X_FOLLOWER[RAISED == 0.0]))
    for k in range(pins.size - 1):
        ends = pins[k : k + 2]
        y = np.interp(ends, X_LEADER, Y_LEADER)
        axes.plot(ends, y, color=FACETS[k % 2], lw=5, solid_capstyle="butt")
    for x, y, at, colour in (
        (X_LEADER, Y_LEADER, inside, LEADER),
        (X_FOLLOWER, y_follower, RAISED == 0.0, FOLLOWER),
    ):
        axes.plot(x[~at], y[~at], "o", mfc="w", mec=colour, mew=1.5, ms=6, zorder=5)
        axes.plot(x[at], y[at], "o", color=colour, ms=7, zorder=5)
    box = {"fc": "w", "ec": "none", "alpha": 0.8, "pad": 2}
    axes.text(6.2, 0.92, "leader", ha="center", weight="bold", color=LEADER, bbox=box)
    axes.text(8.3, 1.95, "follower", ha="center", weight="bold", color=FOLLOWER, bbox=box)
    for text, place, target in NOTES:
        axes.annotate(
            text, target, place, ha="center", va="center", arrowprops={"arrowstyle": "->"}, zorder=6
        )
    axes.set(xlim=(-0.6, 12.0), ylim=(-1.5, 4.4))
    axes.axis("off")
    figure.savefig(FILE, bbox_inches="tight")


if __name__ == "__main__":
    main()
