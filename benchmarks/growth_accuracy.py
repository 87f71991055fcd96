"""Growth of shocked interfaces beside theory over Mach numbers and density ratios: accuracy.json.

    python benchmarks/growth_accuracy.py --mach 1.2 1.5 2 --ratio 3 --cells 32 64
    python benchmarks/growth_accuracy.py --metals --mach 1.1 1.2 1.5

Rows go into problems/interface_instability/accuracy.json, which the screens of runs look things up
in; a row of the same materials, Mach number, ratio and cells is replaced.  Note: rows of two
versions of the scheme side by side; after a change of the scheme `make accuracy` makes all anew.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from shockgrid.problems.interface_instability.deck import Fluid, InterfaceDeck
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.interface_instability.theories import (
    PATH,
    Growth,
    Measured,
    get_kct,
    is_still,
)

METALS = (("Al1100", "SS304"), ("SS304", "Al1100"), ("Al1100", "Pb"), ("Pb", "Al1100"))


def measure_row(materials: str, **deck) -> Measured | None:
    """One run of the problem's default wave, to k c t = 30, beside linear theory.

    None, with a word on it, where the wave becomes too steep for theory before it can be measured.
    """
    problem = InterfaceInstability(InterfaceDeck(**deck))
    (mode,) = problem.harmonics
    growth = Growth(problem.shocked)
    window = growth.find_window(mode, problem.deck.kct_end)
    if window is None or not window.linear:
        print(f"left out, too steep for linear theory: {deck}", flush=True)
        return None
    evolution = problem.build()
    rows = [{"t": 0.0, **problem.measure(evolution)}]
    while evolution.finished is None:
        evolution.advance()
        rows.append({"t": evolution.t, **problem.measure(evolution)})
    history = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    rate = growth.measure_rate(history, mode, window.first, window.last)
    theory = problem.linear_growth.get_mean_rate(window.first, window.last)
    scale = problem.linear_growth.base.u if is_still(problem.linear_growth, theory) else theory
    ahead = problem.eos_first.sound_speed(problem.rho_first, problem.deck.pressure)
    kct = get_kct(problem, history["t"])
    last = int(np.searchsorted(kct, window.last, side="right")) - 1
    return Measured(
        materials,
        float(f"{problem.shock.shock_speed / float(ahead):.4g}"),
        float(f"{problem.rho_second / problem.rho_first:.4g}"),
        problem.deck.cells,
        float(f"{(rate - theory) / scale:.3g}"),
        float(f"{growth.scale_roughness(history)[last]:.2g}"),
    )


def list_decks(
    machs: Iterable[float], ratios: Iterable[float], cells: Iterable[int], metals: bool = False
) -> list[tuple[str, dict]]:
    """What to run: the kind of materials and the keys of the deck; metals have their own ratios."""
    pairs = [("gas", {"second": Fluid(rho=ratio)}) for ratio in ratios]
    if metals:
        pairs = [
            (
                "condensed",
                {
                    "first": Fluid(material=first),
                    "second": Fluid(material=second),
                    "pressure": 0.0,
                    "wavelength": 1e-3,
                },
            )
            for first, second in METALS
        ]
    return [
        (materials, {**pair, "mach": mach, "cells": size})
        for size in cells
        for materials, pair in pairs
        for mach in machs
    ]


def keep(row: Measured, path: Path) -> None:
    """Put a row into the table, in place of one with the same keys; sorted."""
    known = json.loads(path.read_text(encoding="utf-8"))["rows"] if path.exists() else []
    table = {_name(Measured(**other)): other for other in known}
    table[_name(row)] = dataclasses.asdict(row)
    write_rows([Measured(**other) for other in table.values()], path)


def write_rows(
    rows: Iterable[Measured], path: Path, command: str = "python benchmarks/growth_accuracy.py"
) -> None:
    """These rows and no others, sorted."""
    ordered = sorted(rows, key=_name)
    lines = ",\n".join("  " + json.dumps(dataclasses.asdict(row)) for row in ordered)
    text = f'{{\n "command": "{command}",\n "rows": [\n{lines}\n ]\n}}\n'
    path.write_text(text, encoding="utf-8")


def _name(row: Measured) -> tuple:
    return row.materials, row.mach, row.ratio, row.cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mach", type=float, nargs="+", default=[1.2, 1.5, 2.0, 3.0, 5.0])
    parser.add_argument("--ratio", type=float, nargs="+", default=[1.0 / 3.0, 1.0, 3.0])
    parser.add_argument("--cells", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--metals", action="store_true", help="metals in place of gases")
    parser.add_argument("--table", type=Path, default=PATH, help="the file of rows")
    options = parser.parse_args()
    for materials, deck in list_decks(options.mach, options.ratio, options.cells, options.metals):
        row = measure_row(materials, **deck)
        if row is not None:
            keep(row, options.table)
            print(row, flush=True)


if __name__ == "__main__":
    main()
