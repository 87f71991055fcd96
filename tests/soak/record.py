"""The kept outcomes, one line of JSON a trial, and the table that is made of them."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

from shockgrid.regrid.compilation.kept_files import ROOT
from shockgrid.runs.store.files import write_atomically
from soak.trial import Outcome

# folders of one machine in what commands said: the trial's and the code's
MACHINE = re.compile(rf"\S*/soak-\w+/(?:trial/|undisturbed/|flips/)?|{re.escape(str(ROOT))}/")


class Record:
    """Outcomes of all trials so far, in a file that a later call goes on with."""

    def __init__(self, path: Path, seed: int):
        self.path = path
        self.seed = seed
        self.rows: list[dict[str, Any]] = []
        if path.exists():
            text, _, torn = path.read_text(encoding="utf-8").rpartition("\n")
            if torn:  # a kill while it was written
                write_atomically(path, text + "\n")
            rows = [json.loads(line) for line in text.splitlines()]
            self.rows = [row for row in rows if row["seed"] == seed]

    def find_next(self, kind: str) -> int:
        """The number of the first trial of a kind that was not made yet."""
        return 1 + max((row["number"] for row in self.rows if row["kind"] == kind), default=-1)

    def find_seconds(self, kind: str) -> float:
        """Wall time that the trials of a kind took."""
        return sum(row["seconds"] for row in self.rows if row["kind"] == kind)

    def add(self, kind: str, number: int, outcome: Outcome, seconds: float) -> None:
        """Keep one outcome, at once."""
        row = {"kind": kind, "seed": self.seed, "number": number, **asdict(outcome)}
        row["seconds"] = round(seconds, 3)
        self.rows.append(row)
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")

    def summarise(self, kinds) -> dict[str, Any]:
        """What a page shows: per kind how many were tried, of which outcomes, and the defects."""
        table = []
        for kind in kinds:
            rows = [row for row in self.rows if row["kind"] == kind.name]
            counts = Counter(row["label"] for row in rows if not row["defect"])
            bad = [row for row in rows if row["defect"]]
            first: dict[str, dict[str, Any]] = {}
            for row in bad:
                first.setdefault(row["label"], row)
            table.append(
                {
                    "kind": kind.name,
                    "about": kind.about,
                    "wanted": kind.wanted,
                    "tried": len(rows),
                    "outcomes": dict(counts.most_common()),
                    "defects": [
                        {
                            "label": label,
                            "count": sum(row["label"] == label for row in bad),
                            "reproduce": f"{kind.name}:{row['number']}",
                            "words": MACHINE.sub("", row["words"]),
                        }
                        for label, row in first.items()
                    ],
                }
            )
        return {"seed": self.seed, "kinds": table}


def describe(summary: dict[str, Any]) -> str:
    """The summary as lines for a terminal."""
    lines = []
    for kind in summary["kinds"]:
        lines.append(f"{kind['kind']}: {kind['tried']} of {kind['wanted']}; {kind['about']}")
        lines += [f"  {count:6d}  {label}" for label, count in kind["outcomes"].items()]
        for defect in kind["defects"]:
            lines.append(f"  {defect['count']:6d}  DEFECT {defect['label']}")
            lines.append(f"          --reproduce {defect['reproduce']}  {defect['words']}")
    return "\n".join(lines)


def list_outcomes(summary: dict[str, Any]) -> list[str]:
    """The summary as Markdown: a table of all kinds of trials, then one of the defects."""
    from benchmarks.result_tables import make_table

    rows = []
    defects = []
    for kind in summary["kinds"]:
        ends = "; ".join(f"{count} {label}" for label, count in kind["outcomes"].items())
        wrong = sum(defect["count"] for defect in kind["defects"])
        tried = f"{kind['tried']} of {kind['wanted']}"
        rows.append([f"`{kind['kind']}`: {kind['about']}", tried, ends, str(wrong)])
        for defect in kind["defects"]:
            defects.append([defect["label"], str(defect["count"]), f"`{defect['reproduce']}`"])
    lines = make_table(["trials", "tried", "outcomes", "defects"], rows)
    lines = [f"Seed {summary['seed']}.", "", *lines, ""]
    if not defects:
        return [*lines, "No defect was found."]
    return [*lines, *make_table(["defect", "trials", "the first"], defects)]
