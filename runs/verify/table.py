"""`shockgrid verify`: the standard problems at stated sizes, their errors, orders and bars.

Runs are made in memory, each once for all statements about it.  The trap: a run that fails is
a line of the table, not the end of it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from regrid.errors import BadInput, RunFailure
from runs.deck.reading import read_deck, suggest
from runs.verify.cases import CASES, Case

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

    def cells(self) -> tuple[str, ...]:
        """The row in words, in the order of HEADS."""
        case, met = self.case, self.met
        number = case.short_bar if self.short else case.bar
        bar = f"{number:.3g}" if number is not None else ""
        if case.order is not None and not self.short:
            bar = f"order {case.order:g}"
        order = "" if math.isnan(self.order) else f"{self.order:.2f}"
        verdict = {None: "", True: "yes", False: "NO"}[met]
        error = self.failure or f"{self.error:.3g}"
        return (
            case.deck, case.what, str(self.size), error, order,
            bar if met is not None else "", verdict, f"{self.seconds:.1f}", case.others,
        )  # fmt: skip


def choose_cases(names: tuple[str, ...]) -> list[Case]:
    """The cases of the named problems, all where none is named; BadInput for an unknown one."""
    known = list(dict.fromkeys(case.deck for case in CASES))
    for name in names:
        if name not in known:
            raise BadInput(f"verify knows no problem {name!r}{suggest(name, known)}")
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


def compute_rows(cases: list[Case], short: bool) -> Iterator[Row]:
    """All rows, as they are computed."""
    runs: dict[tuple, tuple] = {}
    for case in cases:
        before: Row | None = None
        if short and case.short is None:
            continue
        for size in (case.short,) if short else case.sizes:
            settings = (*case.settings, *case.refine(size))
            key = (case.deck, settings)
            if key not in runs:
                try:
                    runs[key] = march(*key)
                except RunFailure as failure:
                    runs[key] = failure
            row = _make_row(case, size, runs[key], before, short)
            yield row
            before = row


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


def write_page(path: Path, rows: list[Row], command: str) -> None:
    """Write the table with date and command as a Markdown page."""
    met = [row.met for row in rows if row.met is not None]
    lines = [
        "# Standard problems",
        "",
        f"Written by `{command}` on {datetime.now(UTC):%Y-%m-%d};",
        f"{sum(met)} of {len(met)} bars met.",
        "",
        "Errors are relative unless their name says otherwise; the problems' pages say how each is",
        "measured. A bar is for the row in which it stands; orders are from the row above, and",
        "missing where the error is round-off, changes its sign or is of an experiment.",
        "`make verify` runs the long tests and then this command. Junctions in a uniform flow are",
        "no problem of their own: `tests/verification/test_junctions.py` has them to 1e-12.",
        "",
        "| " + " | ".join(HEADS) + " |",
        "|" + "---|" * len(HEADS),
        *("| " + " | ".join(row.cells()) + " |" for row in rows),
        "",
    ]
    path.write_text("\n".join(lines), encoding="utf-8")


def verify(
    names: tuple[str, ...], short: bool, output: str | None, say: Callable[[str], None]
) -> int:
    """Run, print line by line, write the page; 1 where a bar is missed, else 0."""
    cases = choose_cases(names)
    if output is not None and not Path(output).parent.is_dir():
        raise BadInput(f"verify: there is no folder {str(Path(output).parent)!r} to write into")
    if output is not None and Path(output).is_dir():
        raise BadInput(f"verify: {output} is a folder, a file is needed")
    widths = [15, 59, 4, 9, 5, 9, 3, 6]
    say("  ".join(f"{head:{width}}" for head, width in zip(HEADS, widths, strict=False)).rstrip())
    rows = []
    for row in compute_rows(cases, short):
        rows.append(row)
        cells = row.cells()
        line = "  ".join(f"{cell:{width}}" for cell, width in zip(cells, widths, strict=False))
        say(f"{line}  {cells[-1]}".rstrip())
    if output is not None:
        words = ["shockgrid verify", *names, *(["--short"] if short else [])]
        write_page(Path(output), rows, " ".join([*words, "-o", output]))
        say(f"written: {output}")
    return 1 if any(row.met is False for row in rows) else 0
