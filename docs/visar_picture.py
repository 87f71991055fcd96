"""Draws docs/pictures/visar.png: measured velocity histories over computed ones.

Each run is made twice, the second time with twice the cells; what is between both is the numerical
error, drawn as a band.

shockgrid run flying-plate-al5083 -o out/al
shockgrid run flying-plate-al5083 --set flyer_cells=200 -o out/al-fine
shockgrid run flyer-target-five-layers -o out/scg
shockgrid run flyer-target-five-layers --set plates.3.strength=zerilli-armstrong-bcc -o out/za
shockgrid run flyer-target-five-layers FINE -o out/scg-fine     # and so out/za-fine
python docs/visar_picture.py out

FINE: --set plates.0.cells=120 --set plates.1.cells=80 --set plates.2.cells=120
      --set plates.3.cells=400 --set plates.4.cells=240
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from shockgrid.runs.store.reader import RunData

PICTURES = Path(__file__).resolve().parent / "pictures"
MEASURED_ERROR = 0.01  # of the features of the aluminium, as their source says
# folder, column, colour, label
ALUMINIUM = (("al", "back_speed", "#1f6fb4", "computed"),)
LAYERS = (
    ("scg", "window_speed", "#1f6fb4", "Ta: Steinberg–Cochran–Guinan"),
    ("za", "window_speed", "#d1495b", "Ta: Zerilli–Armstrong"),
)
WORDS = (
    ("precursor", (0.935, 75.0), (0.955, 40.0)),
    ("plastic shock", (1.115, 140.0), (0.9, 140.0)),
    ("plateau", (1.55, 198.0), (1.5, 165.0)),
)
LAYER_WORDS = (
    ("precursor", (1.22, 28.0), (0.55, 45.0)),
    ("plastic shock", (1.44, 50.0), (0.45, 75.0)),
    ("reshock by\ntungsten carbide", (2.03, 94.0), (2.45, 92.0)),
    ("release by PMMA", (2.3, 52.0), (2.7, 62.0)),
    ("echo from behind\nthe window", (3.35, -16.0), (2.2, -25.0)),
)
ARROW = {"arrowstyle": "-", "color": "#222222", "lw": 0.7}


def draw_computed(axis, folder: Path, curves) -> float:
    """Computed histories with the band of their numerical error; its root mean square [m/s]."""
    largest = 0.0
    for name, column, colour, label in curves:
        coarse = RunData(folder / name).history
        fine = RunData(folder / f"{name}-fine").history
        t = coarse["t"]
        refined = np.interp(t, fine["t"], fine[column])
        axis.fill_between(1e6 * t, coarse[column], refined, color=colour, alpha=0.3, lw=0)
        axis.plot(1e6 * t, coarse[column], color=colour, lw=1.3, label=label)
        error = float(np.sqrt(np.mean((refined - coarse[column]) ** 2)))
        print(f"{name}: numerical error {error:.2f} m/s (root mean square)")
        largest = max(largest, error)
    return largest


def draw_measured(axis, run: RunData, part: float) -> None:
    """Measured points, with their error as a part of the velocity."""
    times, speeds = np.transpose(run.deck.trace)
    style = {"fmt": "k+", "ms": 8, "elinewidth": 0.8, "label": "measured", "zorder": 5}
    axis.errorbar(1e6 * times, speeds, part * np.abs(speeds), **style)


def annotate(axis, words) -> None:
    """Names of the features."""
    for text, place, stands in words:
        axis.annotate(text, place, stands, fontsize=8, arrowprops=ARROW, va="center")


def main(folder: Path) -> None:
    """Both panels."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.9), dpi=140, layout="constrained")
    aluminium_error = draw_computed(left, folder, ALUMINIUM)
    draw_measured(left, RunData(folder / "al"), MEASURED_ERROR)
    annotate(left, WORDS)
    left.set(xlim=(0.85, 1.85), ylim=(-5.0, 225.0))
    left.set(xlabel="t after the impact [µs]", ylabel="free surface [m/s]")
    title = "Al 5083 onto itself, 206 m/s"
    left.set_title(f"{title}; numerical error {aluminium_error:.1f} m/s", fontsize=10)
    layer_error = draw_computed(right, folder, LAYERS)
    draw_measured(right, RunData(folder / "scg"), 0.0)
    annotate(right, LAYER_WORDS)
    right.set(xlim=(0.4, 4.2), ylim=(-75.0, 105.0))
    right.set(xlabel="t after the impact [µs]", ylabel="face of the window [m/s]")
    title = "PMMA, WC, sapphire onto Ta and a window"
    right.set_title(f"{title}; numerical error {layer_error:.1f} m/s", fontsize=10)
    for axis in (left, right):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, frameon=False, loc="lower right" if axis is left else "lower left")
    figure.savefig(PICTURES / "visar.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
