"""Tables of docs/soak.md, from docs/results/soak.json.

soak outcomes    what was tried, how often, and how the trials ended
soak defects     what came out wrong, each with the trial that shows it
"""

from __future__ import annotations

import json
from pathlib import Path

from accuracy_tables import make_table

RESULTS = Path(__file__).resolve().parent / "results"


def fill_soak(arguments: str) -> list[str]:
    """The table `arguments` of the two."""
    document = json.loads((RESULTS / "soak.json").read_text(encoding="utf-8"))
    kinds = document["kinds"]
    if arguments.strip() == "outcomes":
        rows = []
        for kind in kinds:
            ends = "; ".join(f"{count} {label}" for label, count in kind["outcomes"].items())
            wrong = sum(defect["count"] for defect in kind["defects"])
            rows.append(
                [
                    f"`{kind['kind']}`: {kind['about']}",
                    f"{kind['tried']} of {kind['wanted']}",
                    ends,
                    str(wrong),
                ]
            )
        return [
            f"Seed {document['seed']}.",
            "",
            *make_table(["trials", "tried", "outcomes", "defects"], rows),
        ]
    rows = [
        [defect["label"], str(defect["count"]), f"`{defect['reproduce']}`"]
        for kind in kinds
        for defect in kind["defects"]
    ]
    if not rows:
        return ["No defect was found."]
    return make_table(["defect", "trials", "the first"], rows)
