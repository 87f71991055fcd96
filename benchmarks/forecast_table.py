"""Past runs that foretell others, and how well the cost of ten decks is foretold.

    python benchmarks/forecast_table.py past     runs/past_runs.json anew: small runs
    python benchmarks/forecast_table.py judge    docs/results/forecast.txt anew: ten other runs

The runs that are judged have other cells than those of the table.  What is foretold at a tenth, a
quarter and a half of a run's wall time is found by giving its history, step by step, to the class
that the progress line asks.  Other work on the machine counts: leave it alone meanwhile.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.result_tables import make_table, write_result  # noqa: E402
from shockgrid.hydro.clock import START_FACTORS  # noqa: E402
from shockgrid.runs.deck.reading import read_deck  # noqa: E402
from shockgrid.runs.forecast import (  # noqa: E402
    PARTS,
    PAST_RUNS,
    PastRun,
    TimeLeft,
    drop_events,
    find_past,
    foretell_steps,
    measure_size,
    name_flow,
    read_past,
)
from shockgrid.runs.store.reader import RunData  # noqa: E402

# decks whose steps are foretold from a run of theirs, at cells that take seconds
PAST = {
    "interface-instability": "cells=16",
    "interface-instability-air-sf6": "cells=16",
    "interface-instability-al-pb": "cells=16",
    "interface-instability-al-ss304": "cells=16",
    "interface-instability-mach-2": "cells=16",
    "interface-instability-modes": "cells=16",
    "interface-instability-mushroom": "cells=16",
    "interface-instability-mushroom-mach-2": "cells=16",
    "interface-instability-spectrum": "cells=24",
    "interface-instability-strip": "cells=16",
    "interface-instability-two-shocks": "cells=16",
    "triple-point": "cells=8",
    "shock-bubble": "cells=6",
    "shock-bubble-r22": "cells=8",
    "rayleigh-taylor": "cells=12",
    "sedov": "cells=16",
    "riemann": "cells=200",
    "saltzmann": "cells=60",
    "kidder": "cells=16",
    "detonation": "cells=100",
    "plate-on-wedge": "cells=[48,14]",
    "plate-on-wedge-jet": "cells=[48,14]",
    "plate-on-wedge-flyer": "cells=[48,14]",
}
JUDGED = {
    "interface-instability": "cells=48",
    "interface-instability-al-ss304": "cells=32",
    "interface-instability-mushroom": "cells=32",
    "interface-instability-mushroom-mach-2": "cells=32",
    "interface-instability-modes": "cells=32",
    "interface-instability-strip": "cells=24",
    "triple-point": "cells=12",
    "shock-bubble-r22": "cells=12",
    "plate-on-wedge": "cells=[80,24]",
    "rayleigh-taylor": "cells=24",
}
SHARES = (0.1, 0.25, 0.5)


def run(deck: str, setting: str, folder: Path) -> tuple[RunData, int]:
    """Run a deck in a process of its own; its directory and peak memory [bytes]."""
    words = ["run", deck, "--set", setting, "--threads", "1", "-q", "-o", str(folder / deck)]
    child = subprocess.Popen([sys.executable, "-m", "shockgrid", *words], cwd=ROOT,
                             stdout=subprocess.DEVNULL)  # fmt: skip
    _, status, usage = os.wait4(child.pid, 0)
    if status:
        raise SystemExit(f"{deck} ({setting}) did not finish")
    return RunData(folder / deck), usage.ru_maxrss * 1024


def make_past(deck: str, setting: str, folder: Path) -> PastRun:
    """The entry of past_runs.json."""
    data, _ = run(deck, setting, folder)
    read = read_deck(deck, (setting,))
    size = measure_size(data.problem)
    row = data.history
    first_dt = float(row["dt"][1]) / START_FACTORS[0]
    seconds = drop_events(np.nan_to_num(row["seconds_step"]))
    done = np.interp(PARTS * size.t_end, row["t"], seconds.cumsum() / seconds.sum())
    return PastRun(
        name_flow(read.problem, read.deck), size.cells, size.t_end, size.finest, first_dt,
        int(row["step"][-1]), tuple(done.round(4).tolist()),
        float(f"{np.quantile(seconds[2:], 0.25):.3g}"),
    )  # fmt: skip


def judge(deck: str, setting: str, folder: Path) -> dict[str, Any]:
    """What was foretold of a run at its start and on its way, over what came true."""
    data, memory = run(deck, setting, folder)
    read = read_deck(deck, (setting,))
    problem = read.make_problem()
    size = measure_size(problem)
    history = data.history
    first_dt = float(history["dt"][1]) / START_FACTORS[0]
    steps = int(history["step"][-1])
    past = find_past(name_flow(read.problem, read.deck), size.cells)
    foretold = foretell_steps(size, past, first_dt, read.deck.run.max_steps)
    t = history["t"][1:]
    seconds = history["seconds_step"][1:].copy()
    seconds[0] = np.median(seconds)  # loading kernels
    wall = np.cumsum(drop_events(seconds))
    left = TimeLeft(size.t_end, past.course if past else ())
    found = {}
    waiting = [share * wall[-1] for share in SHARES]
    for number, (now, when) in enumerate(zip(t, wall, strict=True), start=1):
        left.note(number, float(now), float(when))
        if waiting and when >= waiting[0]:
            share = SHARES[len(SHARES) - len(waiting)]
            low, likely, high = left.foretell(number, float(now), float(when))
            waiting.pop(0)
            ends = likely, low, high
            found[f"{share:.0%}"] = [round(float((when + end) / wall[-1]), 3) for end in ends]
    return {
        "deck": f"{deck}, {setting}",
        "cells": size.cells,
        "steps": steps,
        "foretold steps": [round(value) for value in foretold],
        "seconds": round(float(wall[-1]), 1),
        **found,
        "memory": memory,
        "foretold memory": size.memory,
        "dump": data.dumps[-1].path.stat().st_size,
        "foretold dump": size.dump,
    }


def tabulate(rows: list[dict[str, Any]]) -> list[str]:
    """Steps and wall time of the judged runs: foretold over real, with the range in parentheses."""
    heads = ["run", "cells", "steps", "predicted before", "wall time [s]"]
    heads += [f"at {share:.0%} of it" for share in SHARES]
    lines = []
    for row in rows:
        low, likely, high = row["foretold steps"]
        cells = [f"`{row['deck']}`", str(row["cells"]), str(row["steps"])]
        cells += [f"{likely} ({low} to {high})", f"{row['seconds']:.1f}"]
        for share in SHARES:
            likely, low, high = row[f"{share:.0%}"]
            cells.append(f"{likely:.2f} ({low:.2f} to {high:.2f})")
        lines.append(cells)
    return make_table(heads, lines)


def main() -> int:
    kind = sys.argv[1] if len(sys.argv) == 2 else ""
    if kind not in ("past", "judge"):
        raise SystemExit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for deck, setting in (PAST if kind == "past" else JUDGED).items():
            print(f"{deck} {setting}", flush=True)
            make = make_past if kind == "past" else judge
            rows.append(make(deck, setting, Path(folder)))
    if kind == "past":
        lines = ",\n".join(msgspec.json.encode(row).decode() for row in rows)
        PAST_RUNS.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
        read_past.cache_clear()
    else:
        write_result(
            "forecast", ["`python benchmarks/forecast_table.py judge`", "", *tabulate(rows)]
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
