"""Tables of docs/scaling.md, from docs/results/mpi.json (`python benchmarks/bench_mpi.py --write`).

scaling strong | weak    measured runs
scaling costs            the fitted constants of a step
scaling fit              the model beside the runs
scaling assumed          numbers of the projection that are not measured
scaling cases            the named cases at more ranks, and where more of them gain little
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accuracy_tables import make_table

RESULTS = Path(__file__).resolve().parent / "results"
COSTS = {
    "cell": ("$u$, update, regridding without iterations and history row, a cell", 1e9, "ns"),
    "own_block": ("$u_b$, the same, a block", 1e6, "µs"),
    "iteration": ("$i$, an iteration of the regridder, a node", 1e9, "ns"),
    "face": ("$p$, perimeters and lines, a face", 1e9, "ns"),
    "block": ("$p_b$, the same, a block", 1e6, "µs"),
    "step": ("$s$, all else that every rank does in a step", 1e6, "µs"),
    "message": ("$c$, a message to all ranks", 1e6, "µs"),
    "byte": ("$w$, a byte of it, copies included", 1e9, "ns"),
    "record": ("$r$, the first rank's history and words", 1e6, "µs"),
}
PARTS = ("own work", "alike", "messages", "record")


def fill_scaling(part: str) -> list[str]:
    """The lines of a part of the page."""
    result = json.loads((RESULTS / "mpi.json").read_text(encoding="utf-8"))
    made = {
        "strong": lambda: [_say(result), "", *_list(result["strong"])],
        "weak": lambda: _list(result["weak"]),
        "costs": lambda: _list_costs(result["costs"]),
        "fit": lambda: _list(result["fit"]),
        "assumed": lambda: _list_assumed(result["projection"]["assumed"]),
        "cases": lambda: _list_cases(result["projection"]),
    }
    return made[part.strip()]()


def _say(result: Mapping[str, Any]) -> str:
    return f"`{result['command']}`, {result['machine']}."


def _tell(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _list(rows: list[Mapping[str, Any]]) -> list[str]:
    return make_table(list(rows[0]), [[_tell(value) for value in row.values()] for row in rows])


def _list_costs(costs: Mapping[str, float]) -> list[str]:
    rows = [
        [words, f"{costs[name] * factor:.3g} {unit}"]
        for name, (words, factor, unit) in COSTS.items()
    ]
    return make_table(["constant", "fitted"], rows)


def _list_assumed(assumed: Mapping[str, float]) -> list[str]:
    rows = [
        ["latency $a$ of the network", f"{1e6 * assumed['latency']:.3g} µs", "assumed"],
        ["its bandwidth $b$", f"{assumed['bandwidth'] / 1e9:.3g} GB/s a rank", "assumed"],
        ["messages per step", f"{assumed['messages per step']:.3g}", "of the run on two ranks"],
        [
            "iterations of the regridder a node and step",
            f"{assumed['iterations per node and step']:.3g}",
            "of `interface-instability-mushroom`",
        ],
    ]
    return make_table(["number", "value", "where from"], rows)


def _list_cases(projection: Mapping[str, Any]) -> list[str]:
    least = projection["assumed"]["least efficiency"]
    lines: list[str] = []
    for name, case in projection["cases"].items():
        heads = ["ranks", *(f"{part}, ms" for part in PARTS), "step, ms", "efficiency"]
        rows = [
            [
                str(row["ranks"]),
                *(f"{float(f'{1e3 * row[part]:.3g}'):g}" for part in (*PARTS, "step")),
                f"{row['efficiency']:.2f}",
            ]
            for row in case["rows"]
        ]
        last = projection["cases"][name]["rows"][-1]["ranks"]
        where = case["crossover"]
        words = f"below {least:g} from {where} ranks on" if where else f"above {least:g} throughout"
        lines += [f"**{name}**, up to {last} ranks: efficiency {words}.", ""]
        lines += [*make_table(heads, rows), ""]
    return lines[:-1]
