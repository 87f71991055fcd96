"""The verdict on a run, in one line: how it ended, and what limits trust in it.

Each rule of RULES measures one thing in the history and says from what value on it is told.  A
verdict is plain data: `status` ("finished", "stopped", "ended early", "unfinished"), `name` (the
reason in a word or two), `reason` (its sentence), `trust` (a list of what the rules found, each
with `rule`, `value`, `limit`, `words`), and `dt_trend` (marks of `runs.forecast.step_trend`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.problem import Problem
from runs.inspection.account import count, count_known, describe_share, measure_drifts
from runs.inspection.cautions import HEAD, describe_cautions

History = Mapping[str, np.ndarray]
WAVES = "cells a wave"
OWN_REASONS = ("start", "t_end", "end", "dump", "retry")  # of a step's length: no trend


@dataclass(frozen=True)
class Rule:
    """What is measured (nan where the run has no such thing), the value above which it is told.

    words: with `{value}`, `{share}`; meaning: for the table in the pages.
    """

    name: str
    measure: Callable[[History, int, Problem | None], float]
    limit: float
    words: str
    meaning: str
    below: bool = False


def _find_known(history: History, name: str) -> np.ndarray:
    """A column but for its start and for rows that were lost and made again without it."""
    values = np.asarray(history.get(name, ()), dtype=float)[1:]
    return values[np.isfinite(values)]


def _share_of_steps(name: str) -> Callable[[History, int, Problem | None], float]:
    """Steps in which a column is above zero, over all steps whose rows have it."""

    def measure(history: History, cells: int, problem: Problem | None) -> float:
        values = _find_known(history, name)
        return float((values > 0).mean()) if values.size else np.nan

    return measure


def _share_of_cells(name: str, a_cell: float) -> Callable[[History, int, Problem | None], float]:
    """Mean of a column over all steps, over the number of cells times `a_cell`."""

    def measure(history: History, cells: int, problem: Problem | None) -> float:
        values = _find_known(history, name)
        return float(values.mean()) / (a_cell * cells) if values.size and cells else np.nan

    return measure


def _most(name: str) -> Callable[[History, int, Problem | None], float]:
    def measure(history: History, cells: int, problem: Problem | None) -> float:
        values = history.get(name)
        if values is None or not np.isfinite(values).any():
            return np.nan
        return float(np.nanmax(values))

    return measure


def _measure_drift(history: History, cells: int, problem: Problem | None) -> float:
    return max(measure_drifts(history).values(), default=np.nan)


def measure_shrinkage(history: History, cells: int = 0, problem: Problem | None = None) -> float:
    """How many times dt fell below its largest value before, steps cut on purpose left out."""
    dts, limits = history.get("dt"), history.get("dt_limit")
    if dts is None or limits is None or dts.dtype.kind != "f":
        return np.nan
    counts = dts[np.isfinite(dts) & (dts > 0.0) & ~np.isin(limits, OWN_REASONS)]
    return float((np.maximum.accumulate(counts) / counts).max()) if counts.size else np.nan


def _measure_lost(history: History, cells: int, problem: Problem | None) -> float:
    known, steps = count_known(history)
    return (steps - known) / steps if steps else np.nan


def _count_cells_a_wave(history: History, cells: int, problem: Problem | None) -> float:
    waves = problem.count_cells_a_wave() if problem is not None else {}
    return min(waves.values(), default=np.nan)


RULES = (
    Rule(
        "rows lost",
        _measure_lost,
        0.0,
        "rows of the history lost in {share} of the steps",
        "steps whose rows of the history are lost, or were made again from dumps: what the other "
        "rules say is said of the rest",
    ),
    Rule(
        "cells not convex",
        _most("cells_not_convex"),
        0.0,
        "{value:.0f} cells not convex",
        "most cells in a step that were not convex",
    ),
    Rule(
        "rescues",
        _share_of_steps("regrid_rescues"),
        0.01,
        "grids untangled in {share} of the steps",
        "steps in which a grid had to be untangled",
    ),
    Rule(
        "retries",
        _share_of_steps("retries"),
        0.02,
        "{share} of the steps begun anew",
        "steps that were repeated with a shorter dt",
    ),
    Rule(
        "first-order faces",
        _share_of_cells("first_order_faces", 2.0),
        0.01,
        "{share} of the faces of first order",
        "mean part of the faces that are computed at first order, where second gave no positive "
        "state",
    ),
    Rule(
        "voids",
        _most("voided_cells"),
        0.0,
        "voids in {value:.0f} cells",
        "most cells in a step that were torn and have a void",
    ),
    Rule(
        "shared cells",
        _share_of_cells("shared_cells", 1.0),
        0.03,
        "{share} of the cells share their states",
        "mean part of the cells that were too small for the step and share their states",
    ),
    Rule(
        "dt",
        measure_shrinkage,
        100.0,
        "dt fell {value:.3g} times",
        "how many times dt fell below its largest value",
    ),
    Rule(
        "drift",
        _measure_drift,
        1e-10,
        "a conserved total drifts by {value:.1e}",
        "largest relative drift of a mass, of energy or momentum: round-off is below the limit",
    ),
    Rule(
        WAVES,
        _count_cells_a_wave,
        16.0,
        "{value:.3g} cells a wave of the shortest mode",
        "cells a wave of the shortest mode of the deck: told below the limit",
        below=True,
    ),
)


def judge(
    status: str,
    reason: str,
    history: History,
    cells: int,
    problem: Problem | None = None,
    dt_trend: Sequence[Mapping[str, Any]] = (),
    name: str = "",
) -> dict[str, Any]:
    """The verdict on a run from its history; `cells`: of all its blocks; see the module.

    name: of the cause of an early end, in a word or two.
    """
    found = []
    for rule in RULES:
        value = rule.measure(history, cells, problem) if history else np.nan
        if np.isnan(value):
            continue
        if value < rule.limit if rule.below else value > rule.limit:
            words = rule.words.format(value=value, share=describe_share(value))
            found.append({"rule": rule.name, "value": value, "limit": rule.limit, "words": words})
    if problem is not None:
        told = history if len(history.get("step", ())) > 1 else None
        sentences = dict.fromkeys(describe_cautions(problem, told))
        if any(one["rule"] == WAVES for one in found):  # told already
            for sentence in problem.list_wave_cautions():
                sentences.pop(HEAD + sentence, None)
        number = len(sentences)
        if number:
            words = f"{count(number, 'caution')} of the problem"
            found.append({"rule": "cautions", "value": number, "limit": 0, "words": words})
    return {
        "status": status,
        "name": name_reason(status, reason, name),
        "reason": reason,
        "trust": found,
        "dt_trend": [dict(mark) for mark in dt_trend],
    }


def name_reason(status: str, reason: str, name: str = "") -> str:
    """The reason of an end in a word or two; "failed" for an early one that has no `name`."""
    if status != "ended early":
        return reason.partition(" = ")[0].partition(",")[0]
    return name or "failed"


def describe_verdict(verdict: Mapping[str, Any]) -> str:
    """The verdict in one line."""
    status, reason = str(verdict["status"]), str(verdict["reason"]).splitlines()
    head = status
    if status == "ended early":
        head = f"{status}, {verdict['name']}"
    elif status != "finished" and reason:
        said = reason[0].startswith(status)  # such as "stopped by SIGTERM"
        head = reason[0] if said else f"{status}, {reason[0]}"
    words = [str(one["words"]) for one in verdict["trust"]]
    if not words:
        return f"verdict: {head}; no rule finds what would limit trust"
    return f"verdict: {head}; trust is limited by: {', '.join(words)}"
