"""Tables of docs/cost.md: what was foretold beside what came, and the rules for a verdict.

cost judged     steps and wall time of runs, foretold over real, from results/forecast.json
cost sizes      memory and dumps, foretold and real, of the same runs
cost rules      the rules of the verdict
"""

from __future__ import annotations

import json
from pathlib import Path

from accuracy_tables import make_table

from shockgrid.runs.inspection.account import RULES

RESULTS = Path(__file__).resolve().parent / "results"
SHARES = ("10%", "25%", "50%")


def fill_cost(part: str) -> list[str]:
    """The lines of a part of the page."""
    return {
        "judged": _judge,
        "sizes": _list_sizes,
        "rules": _list_rules,
    }[part.strip()]()


def _read() -> dict:
    return json.loads((RESULTS / "forecast.json").read_text(encoding="utf-8"))


def _judge() -> list[str]:
    heads = ["run", "cells", "steps", "predicted before", "wall time [s]"]
    heads += [f"at {share} of it" for share in SHARES]
    rows = []
    for row in _read()["rows"]:
        low, likely, high = row["foretold steps"]
        cells = [f"`{row['deck']}`", str(row["cells"]), str(row["steps"])]
        cells += [f"{likely} ({low} to {high})", f"{row['seconds']:.1f}"]
        for share in SHARES:
            likely, low, high = row[share]
            cells.append(f"{likely:.2f} ({low:.2f} to {high:.2f})")
        rows.append(cells)
    return [f"`{_read()['command']}`", "", *make_table(heads, rows)]


def _list_sizes() -> list[str]:
    heads = ["run", "cells", "memory [MB]", "predicted", "a dump [MB]", "predicted"]
    rows = []
    for row in sorted(_read()["rows"], key=lambda row: row["cells"]):
        numbers = (row[name] / 1e6 for name in ("memory", "foretold memory"))
        dumps = (row[name] / 1e6 for name in ("dump", "foretold dump"))
        rows.append(
            [f"`{row['deck']}`", str(row["cells"])]
            + [f"{number:.0f}" for number in numbers]
            + [f"{number:.2f}" for number in dumps]
        )
    return make_table(heads, rows)


def _list_rules() -> list[str]:
    rows = [[rule.name, rule.meaning, f"above {rule.limit:g}"] for rule in RULES]
    rows.append(["cautions", "sentences of the problem on this deck and run", "above 0"])
    return make_table(["rule", "what is measured", "reported"], rows)
