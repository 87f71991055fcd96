"""Table of random motions in docs/grids.md, from docs/results/random-motions.json.

motions outcomes    how often the sides were moved, in which way, and what came of it
"""

from __future__ import annotations

import json
from pathlib import Path

from accuracy_tables import make_table

RESULTS = Path(__file__).resolve().parent / "results"


def fill_motions(arguments: str) -> list[str]:
    """The table; `arguments` is "outcomes"."""
    if arguments.strip() != "outcomes":
        raise SystemExit(f"motions: the only part is 'outcomes', not {arguments.strip()!r}")
    document = json.loads((RESULTS / "random-motions.json").read_text(encoding="utf-8"))
    kinds = document["kinds"]
    outcomes = list(next(iter(kinds.values())))
    rows = [
        [outcome, *(str(kinds[kind][outcome]) for kind in kinds)]
        + [str(sum(kinds[kind][outcome] for kind in kinds))]
        for outcome in outcomes
    ]
    return [
        f"{document['motions']} motions, seed {document['seed']}.",
        "",
        *make_table(["outcome", *kinds, "all"], rows),
    ]
