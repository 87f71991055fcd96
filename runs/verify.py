"""`shockgrid verify`: the standard problems at stated sizes: errors, orders, bars.

`quantity` of a case is a name of the problem's `errors` or a column of its history, whose last
finite value counts; all are errors, the smaller the better.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from shockgrid.regrid.compilation.first_calls import read_processor_time
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.runs.deck.reading import read_deck, suggest_deck
from shockgrid.runs.engines import Engine, InTurn, open_engine
from shockgrid.runs.store.files import check_free, write_atomically
from shockgrid.runs.store.provenance import describe_software


class Case(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A problem at several sizes, and one error of it: a row of `verify.toml`.

    deck: a problem or packaged deck; sizes: rising, the bar is for the one at `judged`; order: the
    least order that is asked for between the last two.  The short form runs `short` alone (None: no
    part of it) and judges it by `short_bar`, at most a third above what is reached there.
    `converges` is False where the error is round-off, passes through zero or is of an experiment:
    no order is printed.  refine: keys that grow with the size, and their ratio to it.
    """

    deck: str
    what: str
    quantity: str
    sizes: tuple[int, ...]
    short: int | None = None
    short_bar: float | None = None
    bar: float | None = None
    judged: int = -1
    order: float | None = None
    converges: bool = True
    others: str = ""
    settings: tuple[str, ...] = ()
    refine: dict[str, float] = msgspec.field(default_factory=lambda: {"cells": 1.0})

    def set_size(self, n: int) -> tuple[str, ...]:
        """All settings of the run with size n."""
        return (*self.settings, *(f"{key}={round(n * part)}" for key, part in self.refine.items()))


TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
CASES = msgspec.convert(TABLE["case"], tuple[Case, ...])
RunName = tuple[str, tuple[str, ...]]  # deck and settings

HEADS = ("problem", "what", "size", "error", "order", "threshold", "met", "CPU s", "other results")


def format_record(record: Mapping[str, Any]) -> tuple[str, ...]:
    """A record in words, in the order of HEADS."""
    error = record["error"]
    order = record["order"]
    bar = record["bar"]
    return (
        record["problem"],
        record["what"],
        str(record["size"]),
        record["failure"] or ("" if error is None else f"{error:.3g}"),
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
            raise BadInput(
                f"there is no verification case for {name!r}{suggest_deck(name, known)}; a study "
                "over cells shows the errors of any problem (shockgrid study)"
            )
    return [case for case in CASES if not names or case.deck in names]


def march(name: RunName) -> tuple[dict[str, np.ndarray], dict, float]:
    """History, errors and CPU seconds of a run in memory, without those of compiling kernels."""
    problem = read_deck(*name).make_problem()
    start = read_processor_time()
    evolution = problem.build()
    rows = [{"t": 0.0, **evolution.start_row(), **problem.measure(evolution)}]
    most = problem.deck.run.max_steps or math.inf
    while evolution.finished is None and len(rows) <= most:
        rows.append({**evolution.advance(), **problem.measure(evolution)})
    names = [name for name, value in rows[-1].items() if isinstance(value, int | float)]
    history = {
        name: np.array([row.get(name, math.nan) for row in rows], dtype=float) for name in names
    }
    return history, problem.errors(history), read_processor_time() - start


def compute_records(
    cases: list[Case], short: bool, engine: Engine | None = None
) -> Iterator[dict[str, Any]]:
    """A record of each size of each case, in order, as soon as its run is there; `engine` makes
    the runs.

    As JSON holds it: None for what there is not, the threshold (`bar`) where one is judged, and
    the `failure` of a run that has no error.
    """
    sizes = [((case.short,) if short else case.sizes) for case in cases]
    wanted = [(c, n) for c, some in zip(cases, sizes, strict=True) for n in some if n is not None]
    names = [(case.deck, case.set_size(size)) for case, size in wanted]
    keys = list(dict.fromkeys(names))
    computed = (engine or InTurn()).compute(march, keys)
    runs: dict[RunName, Any] = {}
    before: tuple[Case, int, float] | None = None
    for (case, size), name in zip(wanted, names, strict=True):
        while name not in runs:
            place, run = next(computed)
            if isinstance(run, Exception) and not isinstance(run, RunFailure):
                raise run
            runs[keys[place]] = run
        error, seconds, failure = _find_error(case, runs[name])
        order = math.nan
        if case.converges and before and before[0] is case and before[2] > 0.0 and error > 0.0:
            order = math.log(before[2] / error) / math.log(size / before[1])
        met, bar = _judge(case, size, error, order, short)
        before = case, size, error
        yield {
            "problem": case.deck,
            "what": case.what,
            "size": size,
            "settings": list(name[1]),
            "error": None if math.isnan(error) else error,
            "order": None if math.isnan(order) else order,
            "bar": bar,
            "met": False if failure else met,
            "cpu_seconds": round(seconds, 1),
            "others": case.others,
            "failure": failure,
        }


def _find_error(case: Case, run: Any) -> tuple[float, float, str]:
    """Error and CPU seconds of a run; NaN and why where it has none."""
    if isinstance(run, RunFailure):
        return math.nan, 0.0, f"failed: {run}"
    history, errors, seconds = run
    known = np.atleast_1d(errors.get(case.quantity, history.get(case.quantity)))
    known = known[np.isfinite(known)]
    if not known.size:
        return math.nan, seconds, "failed: it was not measured"
    return float(known[-1]), seconds, ""


def _judge(
    case: Case, size: int, error: float, order: float, short: bool
) -> tuple[bool | None, float | str | None]:
    """Is the threshold, if there is one at this size, met, and what is it?"""
    limit = case.short_bar if short else case.bar
    if limit is not None and (short or size == case.sizes[case.judged]):
        return error <= limit, limit
    if case.order is not None and not short and size == case.sizes[-1] and not math.isnan(order):
        return order >= case.order, f"order {case.order:g}"
    return None, None


def describe_bars(records: list[Mapping[str, Any]]) -> str:
    """`44 of 44 thresholds met`."""
    met = [record["met"] for record in records if record["met"] is not None]
    return f"{sum(met)} of {len(met)} thresholds met"


def verify(
    problems: tuple[str, ...],
    short: bool,
    output: str | None,
    say: Callable[[str], None],
    jobs: int = 1,
) -> int:
    """Run, print line by line, write the records as JSON; 1 where a bar is missed, else 0.

    `output`: the JSON file; `jobs`: runs at once.
    """
    cases = choose_cases(problems)
    if output is not None:
        check_free(Path(output))
    widths = [15, 59, 4, 9, 5, 9, 3, 6]
    say("  ".join(f"{head:{width}}" for head, width in zip(HEADS, widths, strict=False)).rstrip())
    records = []
    with open_engine("processes", jobs) as engine:
        for record in compute_records(cases, short, engine):
            records.append(record)
            cells = format_record(record)
            line = "  ".join(f"{cell:{width}}" for cell, width in zip(cells, widths, strict=False))
            say(f"{line}  {cells[-1]}".rstrip())
    say(describe_bars(records))
    if output is not None:
        made = {
            "command": " ".join(
                ["shockgrid verify", *problems, *(["--short"] if short else []), "-o", output]
            ),
            "made_by": describe_software(),
            "rows": records,
        }
        text = json.dumps(made, indent=1, allow_nan=False) + "\n"
        write_atomically(Path(output), text)
        say(f"written: {output}")
    return 1 if any(record["met"] is False for record in records) else 0
