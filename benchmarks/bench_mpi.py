"""What ranks of MPI gain: strong and weak scaling, and a model of a step carried to 1000 ranks.

    python benchmarks/bench_mpi.py [--rounds 3] [--sizes 200 1000] [--write]

Runs of `interface-instability`, two square blocks, as a person starts them: in one process, on two
threads, on 1 and 2 ranks with a thread each, on 4 ranks (more than this machine has cores: marked).
All cases take turns; the fastest quarter of the steps of the fastest run is kept.  `--write` leaves
docs/results/mpi.json and docs/pictures/scaling.png; it takes four minutes on a machine without
other work.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from result_tables import Tables, describe_machine  # noqa: E402

from benchmarks.mpi_scaling.cases import Case, Timing, find_mpiexec, measure  # noqa: E402
from benchmarks.mpi_scaling.model import describe_load, fit, predict  # noqa: E402
from benchmarks.mpi_scaling.picture import draw  # noqa: E402
from benchmarks.mpi_scaling.projection import project  # noqa: E402

RESULT = ROOT / "docs" / "results" / "mpi.json"
PICTURE = ROOT / "docs" / "pictures" / "scaling.png"
WAYS = ((0, 1), (0, 2), (1, 1), (2, 1), (4, 1))  # ranks (0: no mpiexec) and threads
BASE = WAYS[0]
STEPS = {200: 120, 1000: 10}
FIT_SIZES = (50, 100)  # smaller squares for the model, on one process and two ranks
ROW_SIZES = (16, 32)  # of the deck of eight blocks
MUSHROOM = 32
# of a run, and times its cells
LEAST_STEPS = 10
CELL_STEPS = 5_000_000


def count_steps(cells: int) -> int:
    """Steps of a run of two squares of so many cells."""
    return STEPS.get(cells) or max(LEAST_STEPS, min(120, CELL_STEPS // (2 * cells * cells)))


def list_cases(sizes: list[int]) -> tuple[list[Case], list[Case], list[Case]]:
    """The runs of strong and of weak scaling, and those for the model alone."""
    strong = [Case("square", n, *way, count_steps(n)) for n in sizes for way in WAYS]
    halves = [round(n / 2**0.5) for n in sizes]  # of half as many cells, on one rank
    weak = [Case("square", n, *BASE, count_steps(n)) for n in halves]
    small = [Case("square", n, ranks, 1, count_steps(n)) for n in FIT_SIZES for ranks in (0, 2)]
    rows = [Case("blocks", n, 0, 1, 60) for n in ROW_SIZES]
    return strong, weak, [*small, *rows, Case("mushroom", MUSHROOM, 0, 1, 900)]


def run_all(cases: list[Case], rounds: int, mpiexec: list[str]) -> dict[Case, Timing]:
    """All cases in turns; a mushroom and the small runs for the model at least twice."""
    found = {case: Timing(case) for case in dict.fromkeys(cases)}
    for number in range(rounds):
        for case, timing in found.items():
            if number and case.kind == "mushroom":
                continue
            measure(timing, mpiexec)
            print(f"round {number + 1}: {case.kind} {case.cells}², {case.how}: "
                  f"{1e3 * timing.seconds['loop']:.3g} ms per step", flush=True)  # fmt: skip
    return found


def make_strong(timings: dict[Case, Timing], strong: list[Case]) -> list[dict[str, Any]]:
    """Rows of strong scaling: each size against one process with one thread."""
    rows = []
    for case in strong:
        base = timings[Case("square", case.cells, *BASE, case.steps)]
        timing = timings[case]
        parts = max(1, case.ranks) * case.threads
        gain = base.seconds["loop"] / timing.seconds["loop"]
        rows.append(
            {
                "cells per block": f"{case.cells}²",
                "how": case.how,
                "ms per step": 1e3 * timing.seconds["loop"],
                "speed-up": gain,
                "efficiency": gain / parts,
                "command, s": timing.command,
                "its steps": case.steps,
                "speed-up of the command": base.command / timing.command,
            }
        )
    return rows


def make_weak(timings: dict[Case, Timing], weak: list[Case], sizes: list[int]) -> list[dict]:
    """Rows of weak scaling: two ranks with as many cells per rank as one process has."""
    rows = []
    for half, n in zip(weak, sizes, strict=True):
        one = timings[half]
        two = timings[Case("square", n, 2, 1, count_steps(n))]
        for timing, cells in ((one, half.cells), (two, n)):
            rows.append(
                {
                    "cells per block": f"{cells}²",
                    "how": timing.case.how,
                    "cells per rank": 2 * cells * cells // max(1, timing.case.ranks),
                    "ms per step": 1e3 * timing.seconds["loop"],
                    "efficiency": one.seconds["loop"] / timing.seconds["loop"],
                }
            )
    return rows


def make_fit(timings: dict[Case, Timing], costs) -> list[dict[str, Any]]:
    """Rows of the model beside the runs: parts, their sum, what was measured, the difference."""
    rows = []
    for case, timing in timings.items():
        if case.threads > 1 or case.kind == "mushroom" or case.ranks > 2:
            continue
        parts = predict(costs, describe_load(timing))
        if case.kind == "blocks":  # what its problem records is not what a person's would
            parts["record"] = timing.seconds["record"]
        total = sum(parts.values())
        measured = timing.seconds["loop"]
        rows.append(
            {
                "run": f"{case.blocks} blocks of {case.cells}², {case.how}",
                **{f"{name}, ms": 1e3 * value for name, value in parts.items()},
                "model, ms": 1e3 * total,
                "measured, ms": 1e3 * measured,
                "difference, %": 100.0 * (total / measured - 1.0),
            }
        )
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(STEPS))
    parser.add_argument("--write", action="store_true", help="docs/results/mpi.json, the picture")
    tables = Tables(parser)
    options = tables.options
    mpiexec = find_mpiexec()
    if mpiexec is None:
        print("nothing to measure: mpi4py or mpiexec is missing (pip install 'shockgrid[mpi]')")
        return 0
    strong, weak, others = list_cases(options.sizes)
    timings = run_all([*strong, *weak, *others], options.rounds, mpiexec)
    costs = fit(list(timings.values()))
    mushroom = timings[others[-1]]
    result = {
        "command": "python benchmarks/bench_mpi.py --write",
        "machine": describe_machine(),
        "strong": make_strong(timings, strong),
        "weak": make_weak(timings, weak, options.sizes),
        "costs": asdict(costs),
        "fit": make_fit(timings, costs),
        "projection": project(costs, mushroom, timings[Case("square", options.sizes[0], 2, 1,
                              count_steps(options.sizes[0]))]),
    }  # fmt: skip
    for name in ("strong", "weak", "fit"):
        for row in result[name]:
            tables.add(f"mpi-{name}", **row)
    tables.write()
    if options.write:
        RESULT.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        draw(result, PICTURE)
        print(f"written: {RESULT.relative_to(ROOT)}, {PICTURE.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
