"""Shock-tube experiments: growth of an air/SF6 interface [CollinsJacobs2002, JacobsKrivets2005].

    python benchmarks/shock_tube.py [--cells 32 48 64] [--runs DIR] [--json FILE]

DIR keeps the runs; those that are in it are not computed again.

The interface of the experiments is a layer 5 mm thick, and so is the computed one
(`diffusion_thickness`).  Measured points and computed curves are each scaled by their own rate v0
and first amplitude a0+, as the experiments' authors do.  The last two grids give the numerical
error.
Note: Collins and Jacobs measured a slower interface than the Riemann solution; `find_vent` says how
much of the tube's section its slots have to be.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import shockgrid as sg
from shockgrid.problems.pictures import find_dump

HERE = Path(__file__).resolve().parent
POINTS = HERE / "shock_tube_points.csv"
PICTURE = HERE.parent / "docs" / "pictures" / "shock-tube.png"
FIELDS_PICTURE = PICTURE.with_name("shock-tube-59.png")
SHOWN = "jacobs-krivets-59"  # whose density is drawn, at these times after the shock [s]
SHOWN_TIMES = (0.7e-3, 1.8e-3, 2.7e-3, 4.0e-3, 5.9e-3)
SHOWN_EXTENT = -0.052, 0.03  # along the tube from the mean interface [m]
EARLY = 0.5  # k v0 t to which straight lines are fitted for the rate v0
PASSAGE = 0.1  # k v0 t in which the amplitude is least: that is a0+
LEAST_TIME = 0.1  # k v0 t from which on deviations are counted: before, they are of a0+ alone
SMOOTH_DEGREE = 4  # of the polynomial through the origin that stands for points without scatter


@dataclass(frozen=True)
class Experiment:
    """A set of firings: its deck and what the authors' tables have [SI].

    amplitude: just after the shock; rate: v0, the slope of the early amplitudes; speed: of the
    interface.  The authors' speeds without vents: in the text, and as their wave diagrams draw it.
    """

    name: str
    label: str
    deck: str
    amplitude: float
    rate: float
    speed: float
    settings: Mapping[str, Any] = field(default_factory=dict)
    unvented: float = math.nan
    drawn: float = math.nan


EXPERIMENTS = (
    Experiment(
        "collins-jacobs-1.11", "Collins and Jacobs, Mach 1.11", "collins-jacobs",
        2.10e-3, 3.92, 33.0,
        {"mach": 1.11, "modes": [{"ka0": 0.2426}], "run": {"t_end": 6.3e-3}},
        unvented=36.0, drawn=37.4,
    ),
    Experiment(
        "collins-jacobs-1.21", "Collins and Jacobs, Mach 1.21", "collins-jacobs",
        1.57e-3, 6.28, 60.6,
        unvented=64.2, drawn=67.7,
    ),
    Experiment(
        "jacobs-krivets-59", "Jacobs and Krivets, 59 mm", "jacobs-krivets-59",
        2.15e-3, 10.55, 92.6,
    ),
    Experiment(
        "jacobs-krivets-36", "Jacobs and Krivets, 36 mm", "jacobs-krivets-36",
        0.98e-3, 8.98, 90.1,
    ),
)  # fmt: skip
VENTED = 2  # of them were measured in a tube whose slots let gas out


@dataclass(frozen=True)
class Curve:
    """A computed growth: k v0 t and k (a - a0+) (n,), v0 [m/s], a0+ [m], k [1/m]."""

    times: np.ndarray
    growth: np.ndarray
    rate: float
    amplitude: float
    wavenumber: float

    def interpolate(self, times: np.ndarray) -> np.ndarray:
        return np.interp(times, self.times, self.growth)

    def find_amplitude(self, t: np.ndarray) -> np.ndarray:
        """a [m] at times t [s]."""
        growth = self.interpolate(self.wavenumber * self.rate * t)
        return self.amplitude + growth / self.wavenumber


def load(one: Experiment) -> Any:
    """The problem of an experiment."""
    return sg.load(f"interface-instability-{one.deck}", **one.settings).problem


def read_points() -> dict[str, np.ndarray]:
    """Measured k v0 t and k (a - a0+) (2, n) of each experiment, by name."""
    with POINTS.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    names = dict.fromkeys(row[0] for row in rows)
    return {
        name: np.array([row[1:] for row in rows if row[0] == name], dtype=float).T for name in names
    }


def compute_growth(one: Experiment, cells: int, runs: Path) -> Curve:
    """Growth in the run of an experiment on so many cells per wavelength, computed if missing."""
    place = runs / f"{one.name}-{cells}"
    if (place / "summary.txt").exists():
        run = sg.open(place)
    else:
        settings = {**one.settings, "cells": cells}
        run = sg.run(f"interface-instability-{one.deck}", place, **settings)
    problem = load(one)
    t = np.array(run.history.t) - problem.arrival
    a = np.array(run.history.amplitude)
    k = problem.k
    passed = np.abs(t) < PASSAGE / (k * one.rate)
    first = int(np.argmin(np.where(passed, a, np.inf)))
    # the straight line through the early amplitudes, whose end depends on its slope
    rate = one.rate
    for _ in range(9):
        early = (t > t[first]) & (k * rate * t < EARLY)
        rate = float(np.polyfit(t[early], a[early], 1)[0])
    shown = t >= t[first]
    times = k * rate * t[shown]
    growth = k * (a[shown] - a[first])
    return Curve(times, growth, rate, float(a[first]), k)


def measure_deviation(measured: np.ndarray, expected: np.ndarray) -> float:
    """Mean of |measured/expected - 1|, the measure of Jacobs and Krivets."""
    return float(np.mean(np.abs(measured / expected - 1.0)))


def fit_smooth(times: np.ndarray, growth: np.ndarray) -> np.ndarray:
    """The points without their scatter: a polynomial through the origin at their times (n,)."""
    powers = times[:, None] ** np.arange(1, SMOOTH_DEGREE + 1)
    factors = np.linalg.lstsq(powers, growth, rcond=None)[0]
    return powers @ factors


def find_vent(one: Experiment, unvented: float) -> float:
    """What part of the tube's section slots at the interface's first place have to open, so that
    the interface has the measured speed and not the one without vents.

    Gas leaves there as a steady jet into the air outside.  The tube loses it, and sends weak
    expansions both ways, which change the gas's speed by half of the loss; the interface passes on
    what its impedances let through.
    """
    problem = load(one)
    base = problem.linear_growth.base
    outside = problem.deck.pressure
    first = base.rho_left * float(problem.eos_first.sound_speed(base.rho_left, base.p))
    second = base.rho_right * float(problem.eos_second.sound_speed(base.rho_right, base.p))
    lost = 2.0 * (unvented - one.speed) * (first + second) / (2.0 * first)
    gamma = problem.deck.first.gamma
    enthalpy = gamma / (gamma - 1.0) * base.p / base.rho_left
    fall = (outside / base.p) ** ((gamma - 1.0) / gamma)
    jet = math.sqrt(2.0 * enthalpy * (1.0 - fall))
    density = (outside / base.p) ** (1.0 / gamma)
    return lost / (jet * density)


def compare(one: Experiment, curves: dict[int, Curve], points: np.ndarray) -> dict[str, str]:
    """A row of the table: the finest curve beside the points, the numerical error."""
    *_, coarse, fine = (curves[cells] for cells in sorted(curves))
    times, growth = points[:, points[0] > LEAST_TIME]
    expected = fine.interpolate(times)
    scatter = measure_deviation(growth, fit_smooth(times, growth))
    change = measure_deviation(coarse.interpolate(times), expected)
    # without the scales: at the same time in the tube
    t = times / (fine.wavenumber * one.rate)
    amplitude = one.amplitude + growth / fine.wavenumber
    in_metres = fine.find_amplitude(t) / amplitude
    return {
        "experiment": one.label,
        "v0 [m/s], measured": f"{one.rate:g}",
        "computed v0": f"{fine.rate:.2f}",
        "a0+ [mm], measured": f"{1e3 * one.amplitude:.2f}",
        "computed a0+": f"{1e3 * fine.amplitude:.2f}",
        "points off the computed curve": f"{100 * measure_deviation(growth, expected):.1f} %",
        "mean of computed / measured": f"{np.mean(expected / growth):.3f}",
        "of a, without scales": f"{np.mean(in_metres):.3f}",
        "scatter of the points": f"{100 * scatter:.1f} %",
        "numerical error": f"{100 * change:.1f} %",
    }


def draw(curves: Mapping[str, Curve], points: Mapping[str, np.ndarray]) -> None:
    """Computed curves over measured points, a panel for each pair of experiments."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(
        1, 2, figsize=(11, 4.2), layout="constrained", width_ratios=(1, 1.4)
    )
    ends = 3.5, 10.0
    for axes, pair, end in zip(panels, (EXPERIMENTS[:2], EXPERIMENTS[2:]), ends, strict=True):
        for one, symbol, colour in zip(pair, "os", ("C0", "C3"), strict=True):
            curve = curves[one.name]
            axes.plot(
                *points[one.name], symbol, color=colour, mfc="none", ms=5, alpha=0.8,
                label=f"measured, {one.label}",
            )  # fmt: skip
            shown = curve.times < 1.02 * points[one.name][0].max()
            axes.plot(curve.times[shown], curve.growth[shown], color=colour, label="computed")
        top = axes.get_ylim()[1]
        axes.plot((0, top), (0, top), "k:", lw=1, label="linear growth")
        axes.set(xlabel="k v₀ t", ylabel="k (a − a₀⁺)", xlim=(0, end), ylim=(0, top))
        axes.legend(frameon=False, fontsize="small", loc="lower right")
    figure.savefig(PICTURE, dpi=110)


def draw_fields(run: Any) -> None:
    """Density of one and a half waves, the width of the tube, which runs down the page."""
    import matplotlib.pyplot as plt

    problem = load(next(one for one in EXPERIMENTS if one.name == SHOWN))
    wavelength = problem.deck.wavelength
    figure, panels = plt.subplots(
        1, len(SHOWN_TIMES), figsize=(11, 2.6), layout="constrained", sharey=True
    )
    for axes, t in zip(panels, SHOWN_TIMES, strict=True):
        dump = find_dump(run, t + problem.arrival)
        mean = float(np.interp(dump.t, run.history.t, run.history.interface_mean))
        for block in dump.blocks:
            x, y = block.nodes
            rho = block.cell_fields["rho"]
            # the half wave that is computed, and its mirror images
            for across in (y, wavelength - y, wavelength + y):
                shown = axes.pcolormesh(
                    1e3 * across, 1e3 * (x - mean), rho, cmap="YlGnBu", vmin=1.5, vmax=13.0,
                    rasterized=True,
                )  # fmt: skip
        high, low = (1e3 * end for end in SHOWN_EXTENT)
        axes.set(aspect="equal", ylim=(low, high), xlabel="mm")
        axes.set_title(f"{1e3 * (dump.t - problem.arrival):.1f} ms", fontsize="medium")
    panels[0].set_ylabel("mm from the mean interface")
    figure.colorbar(shown, ax=panels, label="density [kg/m³]", pad=0.01)
    figure.savefig(FIELDS_PICTURE, dpi=110)


def main() -> None:
    """Print the tables; with --json write them, and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cells", type=int, nargs="+", default=[32, 48, 64])
    parser.add_argument("--runs", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        compare_all(options, options.runs or Path(folder))


def compare_all(options: argparse.Namespace, runs: Path) -> None:
    """Compute what is not in the folder `runs`, print the tables, write and draw what is wanted."""
    points = read_points()
    finest = {}
    rows = []
    for one in EXPERIMENTS:
        curves = {cells: compute_growth(one, cells, runs) for cells in sorted(options.cells)}
        finest[one.name] = curves[max(curves)]
        rows.append(compare(one, curves, points[one.name]))
        print(rows[-1], flush=True)
    vents = []
    for one in EXPERIMENTS[:VENTED]:
        exact = float(load(one).linear_growth.base.u)
        vents.append({
            "experiment": one.label,
            "interface speed [m/s], measured": f"{one.speed:g}",
            "the authors, without vents": f"{one.unvented:g}",
            "their wave diagram": f"{one.drawn:g}",
            "exact Riemann solution": f"{exact:.1f}",
            "vents from the authors' to the measured one":
                f"{100 * find_vent(one, one.unvented):.1f} % of the section",
            "from the exact one": f"{100 * find_vent(one, exact):.1f} %",
        })  # fmt: skip
        print(vents[-1], flush=True)
    if options.json:
        cells = " ".join(map(str, sorted(options.cells)))
        command = f"python benchmarks/shock_tube.py --cells {cells}"
        tables = {"growth": rows, "speed": vents}
        document = {name: {"command": command, "rows": rows} for name, rows in tables.items()}
        options.json.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
        draw(finest, points)
        draw_fields(sg.open(runs / f"{SHOWN}-{max(options.cells)}"))


if __name__ == "__main__":
    main()
