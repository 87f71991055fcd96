"""A mushroom beside an independent vortex sheet, at Mach 1.05 and two Atwood numbers.

    python benchmarks/vortex_sheet.py [--cells 48 64] [--runs DIR] [--json FILE]

The deck `interface-instability-mushroom` at Mach 1.05, to k c t = 120, beside the sheet of
`problems.references.vortex_sheet` with the same smoothing length.  The sheet has the amplitude and
the rate that linear compressible theory has after the passage.  DIR keeps the runs; those that are
in it are not computed again.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import shockgrid as sg
from shockgrid.problems.interface_instability.theories import get_kct
from shockgrid.problems.pictures import find_dump
from shockgrid.problems.references.vortex_sheet import VortexSheet

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "vortex-sheet.png"
DECK = "interface-instability-mushroom"
SETTLED_KCT = 30.0  # at which the amplitude of linear theory grows at its late rate
CURVE_POINTS = 4000  # of the sheet in pictures and distances


@dataclass(frozen=True)
class Pair:
    """Two gases: settings of the deck, and the k c t at which the lines are compared."""

    label: str
    settings: Mapping[str, Any]
    times: tuple[float, ...]


PAIRS = (
    Pair(
        "density ratio 3", {"second": {"rho": 3.0, "gamma": 1.4}},
        (10.0, 22.0, 40.0, 60.0, 80.0, 100.0, 120.0),
    ),
    Pair("density ratio 5.1", {}, (10.0, 22.0, 40.0, 60.0, 80.0)),
)  # fmt: skip


def make_sheet(problem: Any) -> VortexSheet:
    """The sheet of a deck, with its smoothing length."""
    theory = problem.linear_growth
    wavelength = problem.deck.wavelength
    late = SETTLED_KCT / theory.sound_speed
    rate = theory.get_asymptotic_rate()
    # the straight line that linear theory becomes, at the shock's arrival
    amplitude = problem.amplitude * (theory.get_amplitude(1.0, late) - late * rate)
    speed = problem.amplitude * rate / (theory.atwood * amplitude)
    smoothing = problem.thickness / wavelength
    return VortexSheet(amplitude / wavelength, theory.atwood, speed / wavelength, smoothing)


def run_deck(pair: Pair, cells: int, runs: Path) -> Any:
    """The run of a pair of gases, computed if it is not there."""
    ratio = pair.label.rpartition(" ")[2]
    place = runs / f"{ratio}-{cells}"
    if (place / "summary.txt").exists():
        return sg.open(place)
    settings = {"mach": 1.05, "kct_end": 120.0, "cells": cells, **pair.settings}
    return sg.run(DECK, place, **settings)


def measure_distance(line: np.ndarray, curve: np.ndarray) -> float:
    """The largest distance of a node (2, n) of a line from a curve (2, m), their means aside."""
    middles = [0.5 * (one[0].max() + one[0].min()) for one in (line, curve)]
    nodes = np.stack([line[0] - middles[0], line[1]])
    points = np.stack([curve[0] - middles[1], curve[1]])
    return float(cKDTree(points.T).query(nodes.T)[0].max())


def compare(pair: Pair, runs: dict[int, Any]) -> tuple[list[dict[str, str]], list[tuple]]:
    """Rows of the table; lines and curves at the dumps nearest to three of the times."""
    finest = runs[max(runs)]
    problem = sg.load(DECK, mach=1.05, kct_end=120.0, **pair.settings).problem
    sheet = make_sheet(problem)
    first_energy = sheet.measure_energy()
    rows = []
    shown = []
    for kct in pair.times:
        t = kct / (problem.k * problem.linear_growth.sound_speed)
        sheet.advance_to(t)
        row = {"gases": pair.label, "k c t": f"{kct:g}"}
        for cells, run in sorted(runs.items()):
            extent = float(np.interp(t + problem.arrival, run.history.t, run.history.amplitude))
            row[f"{cells} cells"] = f"{extent:.4f}"
        off = extent / sheet.amplitude - 1.0
        row |= {"vortex sheet": f"{sheet.amplitude:.4f}", "difference": f"{100 * off:+.1f} %"}
        row["energy of the sheet"] = f"{sheet.measure_energy() / first_energy:.3f}"
        rows.append(row)
        print(row, flush=True)
    # the lines at dumps' times, from a sheet of its own
    sheet = make_sheet(problem)
    for kct in (pair.times[1], pair.times[-3], pair.times[-1]):
        t = kct / (problem.k * problem.linear_growth.sound_speed) + problem.arrival
        dump = find_dump(finest, t)
        sheet.advance_to(dump.t - problem.arrival)
        line = dump.blocks[0].nodes[:, -1, :]
        curve = sheet.trace(CURVE_POINTS)
        shown.append((float(get_kct(problem, dump.t)), line, curve, measure_distance(line, curve)))
    return rows, shown


def draw(found: dict[str, list[tuple]]) -> None:
    """Lines of the grid over those of the sheet, half a wavelength each."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(
        len(found), 3, figsize=(9, 4.1), layout="constrained", sharex=True, sharey="row"
    )
    for axes_row, (label, shown) in zip(panels, found.items(), strict=True):
        for axes, (kct, line, curve, distance) in zip(axes_row, shown, strict=True):
            middle = 0.5 * (curve[0].max() + curve[0].min())
            own_middle = 0.5 * (line[0].max() + line[0].min())
            axes.plot(line[0] - own_middle, line[1], color="C0", lw=1.4, label="shockgrid")
            inside = (curve[1] > -0.02) & (curve[1] < 0.52)
            x = np.where(inside, curve[0] - middle, math.nan)
            axes.plot(x, curve[1], color="C3", lw=1.2, ls="--", label="vortex sheet")
            axes.set(aspect="equal", ylim=(0.0, 0.5))
            axes.set_title(f"{label}, k c t = {kct:.0f}: {distance:.3f} apart", fontsize="small")
        axes_row[0].set_ylabel("y / wavelength")
    panels[0][0].legend(frameon=False, fontsize="x-small", loc="lower right")
    for axes in panels[-1]:
        axes.set_xlabel("x / wavelength")
    figure.savefig(PICTURE, dpi=110)


def main() -> None:
    """Print the table; with --json write it, and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cells", type=int, nargs="+", default=[48, 64])
    parser.add_argument("--runs", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        place = options.runs or Path(folder)
        for pair in PAIRS:
            runs = {cells: run_deck(pair, cells, place) for cells in options.cells}
            pair_rows, found[pair.label] = compare(pair, runs)
            rows += pair_rows
    if options.json:
        cells = " ".join(map(str, options.cells))
        command = f"python benchmarks/vortex_sheet.py --cells {cells}"
        document = {"extent": {"command": command, "rows": rows}}
        options.json.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
        draw(found)


if __name__ == "__main__":
    main()
