"""Draws docs/pictures/interface-instability-solids.png: growth of metals with and without strength.

shockgrid run interface-instability-solids --set strength=false -o out/fluid
shockgrid run interface-instability-solids -o out/sliding
shockgrid run interface-instability-solids --set line.contact=bonded -o out/bonded
python docs/solid_interface_picture.py out
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.interface_instability.theories import get_kct
from shockgrid.problems.pictures import Colours, draw_field
from shockgrid.runs.store.reader import RunData

PICTURES = Path(__file__).resolve().parent / "pictures"
CURVES = {"fluid": ("#1f6fb4", "fluids"), "sliding": ("#d1495b", "solids, sliding")}
CURVES["bonded"] = ("#2a9d8f", "solids, bonded")
SHOWN_WAVELENGTHS = 0.35  # on either side of the interface


def main(folder: Path) -> None:
    """Amplitudes over time, and the plastic strain at the end."""
    figure, (curve, section) = plt.subplots(
        1, 2, figsize=(11, 3.9), dpi=140, layout="constrained", width_ratios=(1.3, 1)
    )
    for name, (colour, label) in CURVES.items():
        run = RunData(folder / name)
        problem = InterfaceInstability(run.deck)
        history = run.history
        slope = problem.k * history["amplitude"]
        curve.plot(get_kct(problem, history["t"]), slope, color=colour, lw=1.4, label=label)
    curve.set(xlabel="k c t", ylabel="k a")
    curve.grid(alpha=0.3)
    curve.legend(frameon=False)
    dump = RunData(folder / "sliding").dumps[-1]
    bar = "plastic strain"
    draw_field(section, dump, "plastic_strain", Colours(), every=1, bar=bar, title="t", mm=True)
    line = 1e3 * dump.blocks[0].nodes[:, -1]
    section.plot(*line, color="w", lw=1.2)
    reach = 1e3 * SHOWN_WAVELENGTHS * problem.deck.wavelength
    middle = float(np.mean(line[0]))
    section.set(xlim=(middle - reach, middle + reach))
    figure.savefig(PICTURES / "interface-instability-solids.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
