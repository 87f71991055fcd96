"""A shock-tube experiment: growth of an air/SF6 interface [CollinsJacobs2002].

    python benchmarks/shock_tube.py [--cells 128] [--json docs/results/shock-tube.json]

The interface of the experiment is a layer 5 mm thick, the computed one is sharp: the rates are
compared after division by the growth-reduction factor psi of the layer [BrouilletteSturtevant1994].
Note: the measured interface is slower than computed: the tube's slots vent the shocked gas, as its
authors say.  They computed what its speed would be without; rates are compared in that ratio, too.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.linalg import solveh_banded
from scipy.special import erf

import shockgrid as sg

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "shock-tube.png"
# m, Pa
WAVELENGTH = 0.0593
PRESSURE = 92555.0
AIR = {"gamma": 1.276, "rho": 1.351}  # with a quarter of acetone vapour by volume
SF6 = {"gamma": 1.093, "rho": 5.494}
LAYER = 5e-3  # thickness of the layer before the shock [m]: jump of density / largest gradient
EARLY = 0.5  # k v0 t to which straight lines are fitted for the rate v0
K = 2.0 * np.pi / WAVELENGTH


@dataclass(frozen=True)
class Experiment:
    """Mach number, first amplitude [m], rate v0 [m/s] with its error, speed of the interface [m/s],
    and the speed without vents that the experiment's authors computed [m/s].

    `points`: means of firings at about one time, as in their figure 14: k v0 t, k (a - a0+), and
    the least and largest k (a - a0+); a0+ is the amplitude just after the shock.
    """

    mach: float
    amplitude: float
    rate: tuple[float, float]
    speed: float
    unvented_speed: float
    points: tuple[tuple[float, float, float, float], ...]


EXPERIMENTS = (
    Experiment(
        1.11, 2.29e-3, (3.92, 0.23), 33.0, 36.0,
        ((0.098, 0.090, 0.054, 0.115), (0.171, 0.143, 0.073, 0.190), (0.252, 0.245, 0.203, 0.291),
         (0.334, 0.313, 0.265, 0.351), (0.420, 0.434, 0.394, 0.463), (0.505, 0.509, 0.479, 0.575),
         (0.921, 0.829, 0.635, 0.963), (1.334, 1.218, 1.155, 1.357), (1.745, 1.449, 1.357, 1.513),
         (2.157, 1.695, 1.664, 1.715)),
    ),
    Experiment(
        1.21, 1.83e-3, (6.28, 0.60), 60.6, 64.2,
        ((0.268, 0.270, 0.221, 0.303), (0.413, 0.379, 0.243, 0.465), (0.541, 0.554, 0.517, 0.577),
         (0.682, 0.664, 0.589, 0.773), (0.813, 0.816, 0.773, 0.885), (1.003, 0.893, 0.833, 0.935),
         (1.340, 1.128, 0.934, 1.249), (1.666, 1.446, 1.372, 1.492), (1.994, 1.638, 1.576, 1.750),
         (2.656, 2.106, 2.076, 2.136), (3.331, 2.372, 2.209, 2.535)),
    ),
)  # fmt: skip


def compute_reduction(atwood: float, thickness: float) -> float:
    """Growth-reduction factor psi of a layer whose density rises like an error function.

    The smallest eigenvalue psi of (rho w')' - k^2 rho w + (k psi/A) rho' w = 0 on both sides of a
    layer of `thickness` [m]; a jump has psi = 1.
    """
    x, dx = np.linspace(-12.0, 12.0, 6001, retstep=True)  # in 1/k
    rho = 1.0 + atwood * erf(np.sqrt(np.pi) * x / (K * thickness))
    slope = np.gradient(rho, dx)
    face = 0.5 * (rho[1:] + rho[:-1]) / dx**2
    bands = np.zeros((2, len(x)))  # of -(rho w')' + rho w: above the diagonal, and the diagonal
    bands[0, 1:] = -face
    bands[1] = rho
    bands[1, 1:] += face
    bands[1, :-1] += face
    w = np.exp(-np.abs(x))
    largest = 1.0
    for _ in range(60):  # inverse iteration
        w = solveh_banded(bands, slope * w) / largest
        largest *= np.abs(w).max()
        w /= np.abs(w).max()
    return atwood / largest


def compute_growth(one: Experiment, cells: int, end: float) -> dict:
    """Run to k v0 t = `end` of the experiment: k t, k (a - a0+), rate, compression and theory."""
    settings = {
        "mach": one.mach, "pressure": PRESSURE, "first": AIR, "second": SF6,
        "wavelength": WAVELENGTH, "width": 0.5, "modes": [{"ka0": K * one.amplitude}],
        "start": "incident", "cells": cells, "stretch": 1.03, "line": {"thickness": 1.2e-3},
        "output": {"dumps": 2},
    }  # fmt: skip
    theory = sg.load("interface-instability", **settings).problem.linear_growth
    settings["kct_end"] = end / one.rate[0] * theory.sound_speed
    with tempfile.TemporaryDirectory() as place:
        history = sg.run("interface-instability", f"{place}/run", **settings).history
        t, a, x = (np.array(history[name]) for name in ("t", "amplitude", "interface_mean"))
    base = theory.base
    arrival = np.interp(0.5 * base.u_left, np.gradient(x, t)[: len(t) // 10], t[: len(t) // 10])
    first = int(np.argmin(np.where(t < arrival + 0.1 / (K * one.rate[0]), a, np.inf)))
    rate = one.rate[0]
    for _ in range(9):
        early = (t > t[first]) & (K * rate * (t - arrival) < EARLY)
        rate = float(np.polyfit(t[early], a[early], 1)[0])
    psi = compute_reduction(theory.atwood, LAYER * a[first] / one.amplitude)
    return {"kt": K * (t - arrival), "growth": K * (a - a[first]), "rate": rate, "psi": psi,
            "speed": base.u_left}  # fmt: skip


def main() -> None:
    """Print the table, draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cells", type=int, default=128)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    rows = []
    for i, one in enumerate(EXPERIMENTS):
        x, y, low, high = np.array(one.points).T
        found = compute_growth(one, options.cells, 1.1 * x[-1])
        scaled = found["kt"] * found["rate"]
        line = np.interp(x, scaled, found["growth"])
        vented = found["rate"] / found["psi"] * one.speed / one.unvented_speed
        rows.append({
            "Mach": one.mach,
            "v0 [m/s], measured": f"{one.rate[0]} ± {one.rate[1]:.2f}",
            "computed, sharp": f"{found['rate']:.2f}",
            "psi": f"{found['psi']:.3f}",
            "computed / psi": f"{found['rate'] / found['psi']:.2f}",
            "vented": f"{vented:.2f} ({100 * (vented / one.rate[0] - 1):+.0f} %)",
            "mean error of k (a - a0+)": f"{100 * np.mean(line / y - 1):+.1f} %",
            "at the last time": f"{100 * (line[-1] / y[-1] - 1):+.1f} %",
            "interface speed [m/s]": (
                f"{one.speed}, without vents {one.unvented_speed}, computed {found['speed']:.1f}"
            ),
        })  # fmt: skip
        print(rows[-1], flush=True)
        axes.errorbar(
            x, y, (y - low, high - y), fmt="os"[i], color=f"C{i}", mfc="none", capsize=2,
            label=f"measured, Mach {one.mach}",
        )  # fmt: skip
        shown = (scaled > 0.0) & (scaled < 1.05 * x[-1])
        axes.plot(
            scaled[shown], found["growth"][shown], f"C{i}", label=f"computed, Mach {one.mach}"
        )
    axes.plot((0, 2.4), (0, 2.4), "k:", label="linear")
    axes.set(xlabel="k v0 t", ylabel="k (a - a0+)", xlim=(0, 3.5), ylim=(0, 2.7))
    axes.legend(frameon=False)
    if options.json:
        document = {"rates": {
            "command": f"python benchmarks/shock_tube.py --cells {options.cells}", "rows": rows
        }}  # fmt: skip
        options.json.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
        figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    main()
