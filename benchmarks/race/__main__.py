"""Run the race, print its tables, and keep the results with --write."""

from __future__ import annotations

import argparse
import json
import subprocess
import textwrap
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.race.athena_peer import run_athena
from benchmarks.race.cases import CASES, Case
from benchmarks.race.compiled_peers import (
    build_amrclaw,
    build_cloverleaf,
    build_pennant,
    run_cloverleaf,
    run_pennant,
    spend,
)
from benchmarks.race.ours import run_ours
from benchmarks.race.tables import (
    BAR,
    NAMES,
    NOT_SUMMED_UP,
    RESULTS,
    list_cases,
    list_summary,
)
from benchmarks.result_tables import write_result

REFERENCE_CELLS = 256
ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "pictures" / "race.png"
SCRIPT = Path(__file__).with_name("python_peers.py")


def run_python_peer(python: str, code: str, name: str, numbers: dict, cells: int) -> tuple:
    """What PyClaw or pyro found, and the CPU seconds of the process."""
    home = Path(subprocess.check_output(["mktemp", "-d"], text=True).strip())
    command = [python, str(SCRIPT), code, name, str(cells)]
    spent = spend(command, home, json.dumps(numbers))
    return json.loads((home / "stdout").read_text().splitlines()[-1]), spent


def run_amrclaw(python: str, program: Path, name: str, numbers: dict, cells: int) -> tuple:
    """What AMRClaw found, and the CPU seconds of its program."""
    command = [python, SCRIPT.with_name("amr_peer.py"), program, name, str(cells)]
    done = subprocess.run(
        command, input=json.dumps(numbers), capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout.splitlines()[-1])
    return found, found["cpu"]


def list_codes(options: argparse.Namespace, case: Case) -> dict[str, Any]:
    """Codes that were given and compute this case, each with a function of the cells."""
    wanted = set(options.codes) & set(case.cells)
    codes: dict[str, Any] = {}
    if "shockgrid" in wanted:
        codes["shockgrid"] = partial(run_ours, case.name, case.numbers)
    if options.cloverleaf and "cloverleaf" in wanted:
        work = build_cloverleaf(options.cloverleaf, case.numbers)
        codes["cloverleaf"] = partial(run_cloverleaf, work, case.name, case.numbers)
    if options.pennant and "pennant" in wanted:
        codes["pennant"] = partial(
            run_pennant, build_pennant(options.pennant), case.name, case.numbers
        )
    if options.amrclaw and "amrclaw" in wanted:
        python = options.peer_python
        program = build_amrclaw(options.amrclaw, python)
        codes["amrclaw"] = partial(run_amrclaw, python, program, case.name, case.numbers)
    if options.athena and "athena" in wanted:
        codes["athena"] = partial(run_athena, options.athena, case.name, case.numbers)
    for code in ("pyclaw", "pyro"):
        if options.peer_python and code in wanted:
            codes[code] = partial(
                run_python_peer, options.peer_python, code, case.name, case.numbers
            )
    return codes


def race(case: Case, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Rows of one case: code, cells, error, CPU seconds."""
    rows = []
    found = {}
    for code, run in list_codes(options, case).items():
        cells = [n for n in case.cells[code] if n <= options.most_cells]
        if not cells:
            continue
        if code in ("shockgrid", "pyro"):  # compiles; our large blocks have kernels of their own
            run(cells[0])
            if code == "shockgrid":
                run(cells[-1])
        for n in cells:
            found[code, n], seconds = run(n)
            rows.append({"case": case.name, "code": code, "cells": n, "cpu": seconds})
            print(f"{case.name}: {code}, {n} cells: {seconds:.2f} CPU s", flush=True)
    if "amplitude" in case.numbers:  # the reference is shockgrid's, too, and no row of the table
        finest, _ = run_ours(case.name, case.numbers, REFERENCE_CELLS)
        case.numbers["amplitude"] = float(
            np.interp(case.numbers["times"][-1], finest["t"], finest["amplitude"])
        )
    for row in rows:
        row["error"] = case.measure(found[row["code"], row["cells"]])
    return rows


def draw(document: dict[str, Any]) -> None:
    """Error versus CPU seconds, a panel per case; errors below 1e-3 % are drawn there."""
    import matplotlib.pyplot as plt

    rows = document["rows"]
    titles = {name: case["title"] for name, case in document["cases"].items()}
    known = {row["case"] for row in rows} - {*NOT_SUMMED_UP}
    names = [name for name in CASES if name in known]
    columns = 3 if len(names) > 2 else len(names)
    lines = -(-len(names) // columns)
    figure, axes = plt.subplots(
        lines, columns, figsize=(4.2 * columns, 3.4 * lines), layout="constrained", squeeze=False
    )
    for axis in axes.flat[len(names) :]:
        axis.remove()
    for axis, name in zip(axes.flat, names, strict=False):
        for i, (code, label) in enumerate(NAMES.items()):
            mine = [r for r in rows if r["case"] == name and r["code"] == code and r["error"]]
            if mine:
                errors = [max(100.0 * abs(r["error"]), 1e-3) for r in mine]
                seconds = [r["cpu"] for r in mine]
                width = 2.2 if code == "shockgrid" else 1.2
                axis.loglog(seconds, errors, "o-", color=f"C{i}", label=label, lw=width, ms=4)
        axis.axhline(100.0 * BAR, color="0.6", lw=0.8, ls="--")
        axis.set(xlabel="CPU seconds", ylabel="error [%]")
        axis.xaxis.set_minor_formatter("")
        axis.set_title(textwrap.fill(titles[name], 38), fontsize=9)
    lines_by_label = {h.get_label(): h for a in axes.flat for h in a.get_lines()}
    handles = [lines_by_label[label] for label in NAMES.values() if label in lines_by_label]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    figure.savefig(PICTURE, dpi=110)


def main() -> None:
    """Run what was asked for; rows of other cases and codes stay in the results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.race", description=__doc__)
    parser.add_argument("--cloverleaf", type=Path, help="checkout of UK-MAC/CloverLeaf_ref")
    parser.add_argument("--pennant", type=Path, help="checkout of lanl/PENNANT")
    claw = "folder with checkouts of clawpack's amrclaw, classic, clawutil and riemann"
    parser.add_argument("--amrclaw", type=Path, help=f"{claw}; needs --peer-python")
    words = "Athena++ built with the problem generator athena_start.cpp and HLLC"
    parser.add_argument("--athena", type=Path, metavar="PROGRAM", help=words)
    parser.add_argument("--peer-python", help="interpreter with clawpack and pyro-hydro")
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--codes", nargs="+", choices=NAMES, default=list(NAMES))
    parser.add_argument("--most-cells", type=int, default=10**6)
    keep = "keep the results in docs/results/race.json and draw their picture"
    parser.add_argument("--write", action="store_true", help=keep)
    options = parser.parse_args()
    document = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"cases": {}, "rows": []}
    for name in options.only:
        case = CASES[name]()
        new = race(case, options)
        done = {(r["case"], r["code"]) for r in new}
        kept = [r for r in document["rows"] if (r["case"], r["code"]) not in done]
        order = list(CASES)
        document["rows"] = sorted(kept + new, key=lambda r: order.index(r["case"]))
        cases = document["cases"] | {name: {"title": case.title, "error": case.error_name}}
        document["cases"] = {known: cases[known] for known in order if known in cases}
    print("\n".join(list_cases(document)))
    if options.write:
        write_result("race", list_cases(document))
        write_result("race-summary", list_summary(document))
        RESULTS.write_text(json.dumps(document, indent=1) + "\n")
        draw(document)


if __name__ == "__main__":
    main()
