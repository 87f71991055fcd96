"""Figures over ranges of decks in docs/verification.md, then the page: `make accuracy`.

    python benchmarks/accuracy.py                       everything: half an hour and more
    python benchmarks/accuracy.py --only lines null     these parts alone, the others stay
    python benchmarks/accuracy.py --short               fewer cases, printed and not kept
    python benchmarks/accuracy.py --processes 8         so many runs at a time

Parts: rates (growth beside theory), polars (pressure behind a running contact point), lines (a flat
line, the shock begun a part of a cell farther away), null (a wavy line in one gas), pairs (random
Riemann problems).  The tables of a part are written to docs/results when all of it is measured, so
that rows of two versions of the scheme never stand side by side.  Note: parts can.  After a
change of the scheme make all parts anew.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from benchmarks import accuracy_tables as tables  # noqa: E402
from benchmarks.growth_accuracy import list_decks, measure_row, write_rows  # noqa: E402
from benchmarks.result_tables import RESULTS, write_result  # noqa: E402
from oracles.random_pairs import measure_random_pairs  # noqa: E402
from oracles.shocked_lines import measure_null_line, sweep_flat_line  # noqa: E402
from shockgrid.problems.deck import RunControl  # noqa: E402
from shockgrid.problems.interface_instability.deck import Fluid, InterfaceDeck  # noqa: E402
from shockgrid.problems.interface_instability.theories import PATH, Measured  # noqa: E402
from shockgrid.regrid.errors import RunFailure  # noqa: E402

PICTURE = ROOT / "docs" / "pictures" / "accuracy.png"
COMMAND = "make accuracy"
Rows = list[dict[str, Any]]

MACHS = (1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 8.0, 10.0)
RATIOS = (0.1, 1.0 / 3.0, 1.0, 3.0, 10.0)
METAL_MACHS = (1.1, 1.2, 1.5, 2.0)
CELLS = (32, 64)
STEPS = (0.8, 0.4)  # cfl
LINE_MACHS = (1.2, 2.0, 5.0, 10.0, 20.0)
LINE_METAL_MACHS = (1.2, 2.0)
LINE_RATIOS = {"gas 1 : 3": 3.0, "gas 3 : 1": 1.0 / 3.0, "gas 1 : 1": 1.0}
LINE_METALS = (("Al1100", "SS304"), ("SS304", "Al1100"))
NULL_MACHS = (1.5, 3.0, 5.0, 10.0)
NULL_KA0 = (0.02, 1e-6)
PAIRS = 40
POLARS = (
    "--pairs Al1100-SS304 Cu-SS304 --speeds 1500 3000 5000 --below -1 -.1 .1 .25 .5 1 2 3".split()
)
SHORT_POLARS = "--speeds 3000 --below .5 2".split()
COLOURS = ("#6abf69", "#f2d64b", "#f0a04b", "#d9534f")


def run_all(function: Callable, cases: Sequence, processes: int) -> Iterator:
    """What the function gives for each case, in their order, said as they come."""
    if processes > 1:
        with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
            yield from _say_each(pool.map(function, cases), len(cases))
    else:
        yield from _say_each(map(function, cases), len(cases))


def _say_each(results: Iterable, count: int) -> Iterator:
    for number, result in enumerate(results, start=1):
        print(f"{number}/{count} {result}", flush=True)
        yield result


def measure_rate(case: tuple[str, dict]) -> Measured | None:
    """A growth rate; None where the wave is too steep or the run dies."""
    materials, deck = case
    try:
        return measure_row(materials, **deck)
    except RunFailure as failure:
        print(f"left out, the run died: {deck}: {failure}", flush=True)
        return None


def measure_line(case: tuple[str, dict, float, int]) -> dict[str, Any]:
    """A sweep of the shock's first place over one cell."""
    name, deck, cfl, parts = case
    line = sweep_flat_line(InterfaceDeck(run=RunControl(cfl=cfl), **deck), parts)
    return {
        "materials": name,
        "mach": deck["mach"],
        "cfl": cfl,
        "unevenness": _round(line.unevenness),
        "slope_error": _round(line.slope_error),
        "speed_error": _round(float(line.late_speed.mean())),
        "speed_scatter": _round(line.speed_scatter),
    }


def list_lines(short: bool) -> list[tuple[str, dict, float, int]]:
    """Pairs of materials, decks, time steps and numbers of places."""
    pairs = [
        (name, {"second": Fluid(rho=ratio), "mach": mach})
        for name, ratio in LINE_RATIOS.items()
        for mach in ((2.0, 5.0) if short else LINE_MACHS)
    ]
    pairs += [
        (
            f"{first} into {second}",
            {
                "first": Fluid(material=first),
                "second": Fluid(material=second),
                "pressure": 0.0,
                "mach": mach,
            },
        )
        for first, second in LINE_METALS
        for mach in (LINE_METAL_MACHS[:1] if short else LINE_METAL_MACHS)
    ]
    steps, parts = (STEPS[:1], 5) if short else (STEPS, 10)
    return [(name, deck, cfl, parts) for name, deck in pairs for cfl in steps]


def measure_null(case: tuple[float, int, float]) -> Rows:
    """The modes of a line in one gas at three times."""
    mach, cells, ka0 = case
    return [
        {
            "mach": mach,
            "cells": cells,
            "ka0": ka0,
            "kct": line.kct,
            "exact": _round(line.exact, 6),
            "mode_1": _round(float(line.modes[0]), 4),
            "others": _round(line.others),
        }
        for line in measure_null_line(InterfaceDeck(mach=mach, cells=cells), ka0)
    ]


def measure_pair(seed: int) -> dict[str, Any]:
    """Worst star state of a random pair."""
    found = measure_random_pairs([seed])[seed]
    if isinstance(found, str):
        return {"seed": seed, "error": None, "said": found}
    if math.isnan(found):
        return {"seed": seed, "error": None, "said": "a plateau without a cell"}
    return {"seed": seed, "error": _round(found)}


def _round(value: float, digits: int = 3) -> float:
    return float(f"{value:.{digits}g}")


def make_rates(options: argparse.Namespace) -> None:
    """Growth rates over Mach numbers and density ratios, and their picture."""
    if options.short:
        cases = list_decks((1.5, 5.0), (1.0 / 3.0, 3.0), CELLS[:1])
        cases += list_decks((1.2,), (), CELLS[:1], metals=True)
    else:
        cases = list_decks(MACHS, RATIOS, CELLS)
        cases += list_decks(METAL_MACHS, (), CELLS, metals=True)
    rows = [row for row in run_all(measure_rate, cases, options.processes) if row is not None]
    if options.short:
        for materials in ("gas", "condensed"):
            print(*tables.table_rates(rows, materials, CELLS[0]), sep="\n")
        return
    write_rows(rows, PATH, COMMAND)
    for name, materials in (("gas", "gas"), ("metals", "condensed")):
        write_result(f"accuracy-rates-{name}", tables.table_rates(rows, materials, CELLS[-1]))
    draw_rates(rows, PICTURE)


def make_polars(options: argparse.Namespace) -> None:
    """Pressure behind A over the angle, by the benchmark that the page of the problem shows."""
    words = SHORT_POLARS if options.short else [*POLARS, "--json", str(RESULTS / "bench.json")]
    script = Path(__file__).with_name("polars_over_angle.py")
    subprocess.run([sys.executable, str(script), *words], cwd=ROOT, check=True)
    if not options.short:
        measured = json.loads((RESULTS / "bench.json").read_text(encoding="utf-8"))
        rows = measured["polars over the angle"]["rows"]
        write_result("accuracy-polars", tables.table_polars(rows))


def make_lines(options: argparse.Namespace) -> None:
    """Flat lines."""
    rows = list(run_all(measure_line, list_lines(options.short), options.processes))
    keep("lines", rows, options.short)


def make_null(options: argparse.Namespace) -> None:
    """Wavy lines in one gas."""
    machs, sizes = ((5.0,), CELLS[:1]) if options.short else (NULL_MACHS, CELLS)
    cases = [(mach, cells, ka0) for mach in machs for cells in sizes for ka0 in NULL_KA0]
    found = run_all(measure_null, cases, options.processes)
    keep("null", [row for rows in found for row in rows], options.short)


def make_pairs(options: argparse.Namespace) -> None:
    """Random Riemann problems."""
    seeds = range(5 if options.short else PAIRS)
    keep("pairs", list(run_all(measure_pair, seeds, options.processes)), options.short)


PARTS = {
    "rates": make_rates,
    "polars": make_polars,
    "lines": make_lines,
    "null": make_null,
    "pairs": make_pairs,
}


def keep(part: str, rows: Rows, short: bool) -> None:
    """Put the table of a part into docs/results, or only print it."""
    lines = getattr(tables, f"table_{part}")(rows)
    if short:
        print(*lines, sep="\n")
    else:
        write_result(f"accuracy-{part}", lines)


def draw_rates(rows: Iterable[Measured], path: Path) -> None:
    """The errors of gases as a map in the colours of the page, a panel for each number of cells."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.colors import BoundaryNorm, ListedColormap

    gases = [row for row in rows if row.materials == "gas"]
    sizes = sorted({row.cells for row in gases})
    machs, ratios = (sorted({getattr(row, key) for row in gases}) for key in ("mach", "ratio"))
    norm = BoundaryNorm([0.0, *(100.0 * most for most in tables.LEVELS), 100.0], len(COLOURS))
    figure, axes = plt.subplots(
        1, len(sizes), figsize=(4.6 * len(sizes), 4.4), squeeze=False, layout="constrained"
    )
    for axis, cells in zip(axes[0], sizes, strict=True):
        errors = [[math.nan] * len(ratios) for _ in machs]
        for row in gases:
            if row.cells == cells:
                errors[machs.index(row.mach)][ratios.index(row.ratio)] = 100.0 * row.rate_error
        sizes_of_errors = [[abs(value) for value in line] for line in errors]
        axis.imshow(sizes_of_errors, cmap=ListedColormap(COLOURS), norm=norm, aspect="auto")
        for i, line in enumerate(errors):
            for j, value in enumerate(line):
                said = "-" if math.isnan(value) else f"{value:+.1f}"
                axis.text(j, i, said, ha="center", va="center", fontsize=9)
        axis.set_xticks(range(len(ratios)), [f"{ratio:.3g}" for ratio in ratios])
        axis.set_yticks(range(len(machs)), [f"{mach:g}" for mach in machs])
        axis.set(xlabel="density ratio", ylabel="Mach number")
        axis.set_title(f"error of the rate [%], {cells:g} cells per wavelength", fontsize=10)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART")
    parser.add_argument("--short", action="store_true", help="fewer cases, printed and not kept")
    parser.add_argument("--processes", type=int, default=1, help="runs at a time")
    options = parser.parse_args()
    for part in options.only:
        print(f"== {part}", flush=True)
        PARTS[part](options)
    if not options.short:
        script = ROOT / "docs" / "generate.py"
        subprocess.run([sys.executable, str(script)], cwd=ROOT, check=True)


if __name__ == "__main__":
    main()
