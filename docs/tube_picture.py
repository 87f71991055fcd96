"""Draws docs/pictures/expanding-tube.png: a tube that expands, and its speed over the measured one.

shockgrid run blocks-expanding-tube -o out/steel
shockgrid run blocks-expanding-tube --set 'block.1.strength={law="linear-hardening", \\
    shear_modulus=77e9,yield_strength=1.7e9,hardening=2e9}' -o out/hard
python docs/tube_picture.py out
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from shockgrid.problems.pictures import Colours, draw_field, find_dump
from shockgrid.runs.store.reader import RunData

PICTURES = Path(__file__).resolve().parent / "pictures"
# times [µs] and radial speeds [m/s] of Vogler et al. (2003), as the public code spheral has them
MEASURED = {
    "probe-25": (
        (0.60, 20.0), (1.64, 103.0), (2.67, 148.0), (3.71, 184.0), (4.75, 198.0), (5.79, 202.0),
        (6.83, 195.0), (8.91, 166.0),
    ),
    "probe-20": ((1.79, 20.0), (3.52, 144.0), (5.26, 196.0), (6.99, 207.0), (8.72, 205.0)),
}  # fmt: skip
STYLES = {"probe-25": "-", "probe-20": "--"}
COLOURS = {"steel": ("#1f6fb4", "SS304 of the library"), "hard": ("#d1495b", "Y = 1.7 GPa")}
TIMES = (3e-6, 8e-6)


def read_speeds(run: Path, probe: str) -> tuple[np.ndarray, np.ndarray]:
    """Times [µs] and radial speeds [m/s] of a gauge."""
    with (run / "gauges.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    pairs = [(1e6 * float(row["t"]), float(row[f"{probe}_v"])) for row in rows]
    return tuple(np.transpose(pairs))


def main(folder: Path) -> None:
    """Pressure at two times, and speeds of both probes."""
    figure = plt.figure(figsize=(12, 4.4), dpi=140, layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1))
    run = RunData(folder / "steel")
    sections = []
    for place, time in enumerate(TIMES):
        axis = figure.add_subplot(grid[place, 0])
        colours = Colours(unit=1e9, low=-3.5, high=3.5, map="RdBu_r")
        dump = find_dump(run, time)
        picture = draw_field(axis, dump, "p", colours, every=4, title="t", mm=True)
        sections.append(axis)
        axis.set_facecolor("#f4f4f4")
        axis.set(xlim=(0.0, 51.0), ylim=(0.0, 12.0))
    figure.colorbar(picture, ax=sections, shrink=0.8, label="p [GPa]")
    axis = figure.add_subplot(grid[:, 1])
    for name, (colour, label) in COLOURS.items():
        for probe, style in STYLES.items():
            t, speed = read_speeds(folder / name, probe)
            words = f"{label}, at {probe[-2:]} mm"
            axis.plot(t, speed, style, color=colour, lw=1.3, label=words)
    for probe, points in MEASURED.items():
        t, speed = np.transpose(points)
        mark = "k+" if probe == "probe-25" else "kx"
        axis.plot(t, speed, mark, ms=8, label=f"measured, at {probe[-2:]} mm")
    axis.set(xlabel="t after the impact [µs]", ylabel="speed of the tube's outside [m/s]")
    axis.set(xlim=(0.0, 9.0), ylim=(0.0, 360.0))
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, frameon=False, loc="upper left")
    figure.savefig(PICTURES / "expanding-tube.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
