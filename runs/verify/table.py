"""`shockgrid verify`: the standard problems at stated sizes, their errors, orders and bars.

Runs are made in memory, each once for all statements about it.  Results are kept as records, plain
dicts that JSON holds; the screen's lines and the Markdown table are made from these.  The trap: a
run that fails is a line of the table, not the end of it.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from regrid.errors import BadInput, RunFailure
from runs.deck.reading import read_deck, suggest_deck
from runs.engines.engine import InTurn, open_engine
from runs.engines.protocol import Engine
from runs.store.files import check_replaceable
from runs.store.provenance import describe_software
from runs.verify.cases import CASES, Case

RunName = tuple[str, tuple[str, ...]]  # deck and settings

HEADS = ("problem", "what", "size", "error", "order", "bar", "met", "CPU s", "others")


@dataclass(frozen=True)
class Row:
    """One run of a case; `error` is NaN where it failed, then `failure` says why."""

    case: Case
    size: int
    error: float
    order: float
    seconds: float
    failure: str = ""
    short: bool = False

    @property
    def met(self) -> bool | None:
        """Is the bar, if there is one for this row, met?"""
        case = self.case
        if self.failure:
            return False
        if self.short:
            return None if case.short_bar is None else self.error <= case.short_bar
        if case.bar is not None and self.size == case.sizes[case.judged]:
            return self.error <= case.bar
        if case.order is not None and self.size == case.sizes[-1] and not math.isnan(self.order):
            return self.order >= case.order
        return None

    def make_record(self) -> dict[str, Any]:
        """The row as JSON holds it: no NaN (None instead), and the bar only where it is judged."""
        case, met = self.case, self.met
        bar: str | float | None = case.short_bar if self.short else case.bar
        if case.order is not None and not self.short:
            bar = f"order {case.order:g}"
        return {
            "problem": case.deck,
            "what": case.what,
            "size": self.size,
            "settings": [*case.settings, *case.refine(self.size)],
            "error": None if math.isnan(self.error) else self.error,
            "order": None if math.isnan(self.order) else self.order,
            "bar": None if met is None else bar,
            "met": met,
            "cpu_seconds": round(self.seconds, 1),
            "others": case.others,
            "failure": self.failure,
        }


def format_record(record: Mapping[str, Any]) -> tuple[str, ...]:
    """A record in words, in the order of HEADS."""
    error, order, bar = record["error"], record["order"], record["bar"]
    words = record["failure"] or ("" if error is None else f"{error:.3g}")
    return (
        record["problem"],
        record["what"],
        str(record["size"]),
        words,
        "" if order is None else f"{order:.2f}",
        f"{bar:.3g}" if isinstance(bar, float) else bar or "",
        {None: "", True: "yes", False: "NO"}[record["met"]],
        f"{record['cpu_seconds']:.1f}",
        record["others"],
    )


def choose_cases(names: tuple[str, ...]) -> list[Case]:
    """The cases of the named problems, all where none is named; BadInput for an unknown one."""
    known = list(dict.fromkeys(case.deck for case in CASES))
    for name in names:
        if name not in known:
            raise BadInput(f"verify knows no problem {name!r}{suggest_deck(name, known)}")
    return [case for case in CASES if not names or case.deck in names]


def march(deck: str, settings: tuple[str, ...]) -> tuple[dict[str, np.ndarray], dict, float]:
    """History, errors and CPU seconds of a run in memory."""
    problem = read_deck(deck, settings).make_problem()
    start = time.process_time()
    evolution = problem.build()
    rows = [{"t": 0.0, **evolution.start_row(), **problem.measure(evolution)}]
    most = problem.deck.run.max_steps or math.inf
    while evolution.finished is None and len(rows) <= most:
        rows.append({**evolution.advance(), **problem.measure(evolution)})
    names = [name for name, value in rows[-1].items() if isinstance(value, int | float)]
    history = {
        name: np.array([row.get(name, math.nan) for row in rows], dtype=float) for name in names
    }
    return history, problem.errors(history), time.process_time() - start


def compute_rows(cases: list[Case], short: bool, engine: Engine | None = None) -> Iterator[Row]:
    """All rows in their order, each as soon as its run is there; `engine` makes the runs."""
    wanted = [(case, size) for case in cases for size in _choose_sizes(case, short)]
    keys = list(dict.fromkeys(_name_run(case, size) for case, size in wanted))
    computed = (engine or InTurn()).compute(march_named, keys)
    runs: dict[RunName, Any] = {}
    before: Row | None = None
    for case, size in wanted:
        while (key := _name_run(case, size)) not in runs:
            place, run = next(computed)
            if isinstance(run, Exception) and not isinstance(run, RunFailure):
                raise run
            runs[keys[place]] = run
        known = before if before is not None and before.case is case else None
        before = _make_row(case, size, runs[key], known, short)
        yield before


def _choose_sizes(case: Case, short: bool) -> tuple[int, ...]:
    if short:
        return () if case.short is None else (case.short,)
    return case.sizes


def _name_run(case: Case, size: int) -> RunName:
    return case.deck, (*case.settings, *case.refine(size))


def march_named(name: RunName) -> tuple[dict[str, np.ndarray], dict, float]:
    """`march` with deck and settings in one argument, as engines pass it."""
    return march(*name)


def _make_row(case: Case, size: int, run, before: Row | None, short: bool) -> Row:
    if isinstance(run, RunFailure):
        return Row(case, size, math.nan, math.nan, 0.0, f"failed: {run}", short)
    history, errors, seconds = run
    error = errors.get(case.quantity)
    if case.quantity == "kept":
        error = measure_loss(history)
    elif error is None:
        column = history[case.quantity]
        known = column[np.isfinite(column)]
        error = float(known[-1]) if known.size else math.nan
    if math.isnan(error):
        return Row(case, size, error, math.nan, seconds, "failed: it was not measured", short)
    order = math.nan
    if case.converges and before is not None and before.error > 0.0 and error > 0.0:
        order = math.log(before.error / error) / math.log(size / before.size)
    return Row(case, size, float(error), order, seconds, short=short)


def measure_loss(history: dict[str, np.ndarray]) -> float:
    """Largest change of a material's mass or of the energy that did not come through the boundary.

    Relative to the largest of what is inside and what came; with sources at work they are in the
    ledger too.
    """
    worst = 0.0
    for name, inside in history.items():
        kept = name.removeprefix("total_")
        if kept != name and kept.startswith(("mass", "energy")):
            came = np.nan_to_num(history.get("boundary_" + kept, np.zeros_like(inside)))
            size = max(float(np.abs(inside).max()), float(np.abs(came).max()))
            worst = max(worst, float(np.abs(inside - came - inside[0]).max()) / size)
    return worst


def make_page(document: Mapping[str, Any]) -> str:
    """The Markdown page of a document: how it was made, how many bars are met, the table."""
    lines = [
        "# Standard problems",
        "",
        f"Written by `{document['command']}`;",
        f"{describe_bars(document['rows'])}.",
        "",
        *format_table(document["rows"]),
        "",
    ]
    return "\n".join(lines)


def describe_bars(records: list[Mapping[str, Any]]) -> str:
    """`44 of 44 bars met`."""
    met = [record["met"] for record in records if record["met"] is not None]
    return f"{sum(met)} of {len(met)} bars met"


def format_table(records: list[Mapping[str, Any]]) -> list[str]:
    """The lines of a Markdown table of records."""
    return [
        "| " + " | ".join(HEADS) + " |",
        "|" + "---|" * len(HEADS),
        *("| " + " | ".join(format_record(record)) + " |" for record in records),
    ]


def write_results(path: Path, records: list[dict[str, Any]], command: str) -> list[Path]:
    """Write the records as JSON and, unless `path` is the JSON file itself, the page from them."""
    document = {"command": command, "made_by": describe_software(), "rows": records}
    data = path.with_suffix(".json")
    for one in (data, path):
        check_replaceable(one)
    data.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    if data == path:
        return [data]
    path.write_text(make_page(json.loads(data.read_text(encoding="utf-8"))), encoding="utf-8")
    return [path, data]


def verify(
    names: tuple[str, ...],
    short: bool,
    output: str | None,
    say: Callable[[str], None],
    jobs: int = 1,
) -> int:
    """Run, print line by line, write the results; 1 where a bar is missed, else 0.

    `output` is the Markdown page, with a JSON file of the same name beside it, or "NAME.json";
    `jobs`: runs at once.
    """
    cases = choose_cases(names)
    if output is not None and not Path(output).parent.is_dir():
        raise BadInput(f"verify: there is no folder {str(Path(output).parent)!r} to write into")
    if output is not None and Path(output).is_dir():
        raise BadInput(f"verify: {output} is a folder, a file is needed")
    widths = [15, 59, 4, 9, 5, 9, 3, 6]
    say("  ".join(f"{head:{width}}" for head, width in zip(HEADS, widths, strict=False)).rstrip())
    records = []
    with open_engine("processes", jobs) as engine:
        for row in compute_rows(cases, short, engine):
            records.append(row.make_record())
            cells = format_record(records[-1])
            line = "  ".join(f"{cell:{width}}" for cell, width in zip(cells, widths, strict=False))
            say(f"{line}  {cells[-1]}".rstrip())
    if output is not None:
        words = ["shockgrid verify", *names, *(["--short"] if short else []), "-o", output]
        written = write_results(Path(output), records, " ".join(words))
        say(f"written: {', '.join(map(str, written))}")
    return 1 if any(record["met"] is False for record in records) else 0
