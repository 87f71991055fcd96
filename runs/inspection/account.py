"""What a run's history says in words, and the verdict on it: how it ended, what limits trust in it.

Each rule of RULES measures one thing in the history and says from what value on it is reported.  A
verdict is plain data: `status` ("finished", "stopped", "ended early", "unfinished"), `name` (the
reason in a word or two), `reason` (its sentence), `trust` (list of what the rules found, each with
`rule`, `value`, `limit`, `words`), and `dt_trend` (marks of `runs.forecast.step_trend`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from problems.evolution import Evolution
from problems.problem import Problem
from regrid.errors import RunFailure

History = Mapping[str, np.ndarray]
PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
PREFIXED = ("m", "s", "m/s", "Pa", "J", "J/kg", "N")
HEAD = "caution: "
WAVES = "cells per wave"
OWN_REASONS = ("start", "t_end", "end", "dump", "retry")  # of a step's length: no trend
NONE = np.zeros(0)


def pick_prefix(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit that bring a quantity of size `largest` near 1 to 1000: (1e-9, "GPa")."""
    if unit not in PREFIXED or not math.isfinite(largest) or largest == 0:
        return 1.0, "" if unit == "1" else unit
    power = 3 * math.floor(math.log10(abs(largest) * 1.0000001) / 3)
    power = min(max(power, -12), {"m": 3, "s": 0}.get(unit, 12))
    return 10.0**-power, PREFIXES[power] + unit


def describe_time(t: float, unit: str = "s", digits: int = 6) -> str:
    """`t = 1.5 s`; what counts something else than seconds: `13 iterations`."""
    return f"t = {t:.{digits}g} s" if unit == "s" else f"{t:.{digits}g} {unit}"


def describe_seconds(seconds: float) -> str:
    """A wall time in the unit a person would choose."""
    if seconds < 100:
        return f"{seconds:.1f} s" if seconds >= 1 else f"{seconds:.2g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


def describe_share(share: float) -> str:
    """A share in per cent; a small one is not called nothing."""
    return "<1%" if 0 < share < 0.01 else f"{share:.0%}"


def count(number: int, thing: str) -> str:
    """`1 block`, `2 blocks`."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def count_cells(evolution: Evolution) -> int:
    """Cells of all blocks together."""
    return sum(math.prod(n - 1 for n in block.nodes.shape[1:]) for block in evolution.blocks)


def describe_run(history: History, cells: int, blocks: Sequence[str] = ()) -> list[str]:
    """Lines about dt, regridding, speed and conservation: those that the history can tell.

    blocks: their names.
    """
    drifts = ", ".join(
        f"{name.replace('_', ' ')} {drift:.1e}" for name, drift in measure_drifts(history).items()
    )
    lines = (
        ("dt limited by: ", describe_limits(history)),
        ("fastest cell: ", describe_fastest(history, blocks)),
        ("regridding: ", describe_regridding(history)),
        ("", describe_convexity(history)),
        ("", describe_contacts(history)),
        ("largest conservation errors: ", drifts),
        ("speed: ", describe_speed(history, cells)),
    )
    return [head + words for head, words in lines if words]


def describe_limits(history: History) -> str:
    """How often each limiter decided dt."""
    words = history.get("dt_limit")
    if words is None or words.dtype.kind != "U":
        return ""
    names, counts = np.unique(words[words != ""], return_counts=True)
    order = np.argsort(-counts)
    return ", ".join(f"{names[k]} {describe_share(counts[k] / counts.sum())}" for k in order)


def describe_fastest(history: History, blocks: Sequence[str]) -> str:
    """Where the cell of largest rate was mostly, and what not waiting for it has saved."""
    over = history.get("fastest_over_limit", NONE)
    if "fastest_block" not in history or not np.isfinite(over).any():
        return ""
    known = np.isfinite(over)
    cells = np.array([history[name][known] for name in ("fastest_block", "fastest_i", "fastest_j")])
    places, counts = np.unique(cells.astype(int), axis=1, return_counts=True)
    (number, i, j), often = places[:, counts.argmax()], counts.max() / known.sum()
    block = blocks[number] if number < len(blocks) else f"block {number}"
    told = f"{block}, i={i}, j={j} in {describe_share(often)} of the steps"
    # a step of the fastest cell's own would have been so many times shorter
    alone = round(float(np.sum(over[known])))
    if alone > 1.02 * known.sum():
        most = count(int(np.nanmax(history.get("shared_cells", np.zeros(1)))), "cell")
        told += f"; state redistribution in up to {most} ({alone} steps would be needed without it)"
    return told


def describe_regridding(history: History) -> str:
    """Totals of the regridder's work and the worst cells of the run."""
    parts = []
    for name, words, find in (
        ("regrid_iterations", "iterations", np.nansum),
        ("regrid_sub_moves", "sub-moves", np.nansum),
        ("regrid_rescues", "untangling events", np.nansum),
        ("least_scaled_jacobian", "minimum scaled Jacobian", np.nanmin),
        ("worst_aspect", "worst aspect ratio", np.nanmax),
    ):
        values = history.get(name, NONE)
        if np.isfinite(values).any():
            value = find(values)
            parts.append(f"{int(value)} {words}" if find is np.nansum else f"{words} {value:.3g}")
    return ", ".join(parts)


def describe_contacts(history: History) -> str:
    """How many contacts of bodies were made and opened, and when the first of each."""
    told = []
    for name in ("made", "opened"):
        counts = np.nan_to_num(history.get(f"contacts_{name}", NONE))
        if counts.any():
            first = float(history["t"][np.flatnonzero(counts > 0)[0]])
            told.append(f"{int(counts.max())} {name}, the first by t = {first:.4g} s")
    return f"contacts: {'; '.join(told)}" if told else ""


def describe_convexity(history: History) -> str:
    """Whether every cell was convex in every step; if not, how many, in how many steps, since when.

    Cells at blocks' corners that the sides make triangles are counted apart.  Histories without
    `cells_not_convex` are judged by `least_scaled_jacobian`; "" without both.
    """
    count_bad, sine = history.get("cells_not_convex"), history.get("least_scaled_jacobian")
    if count_bad is not None:
        bad = np.nan_to_num(count_bad) > 0
    elif sine is not None:
        bad = sine <= 0.0
    else:
        return ""
    if bad.any():
        most = "" if count_bad is None else f", at most {count(int(np.nanmax(count_bad)), 'cell')}"
        since, steps = history["t"][int(np.argmax(bad))], count(int(bad.sum()), "step")
        return f"NOT CONVEX: in {steps} of {bad.size}, first at t = {since:.6g} s{most}"
    told = "every cell convex in every step"
    flat = np.nan_to_num(history.get("cells_triangular", np.zeros(1)))
    if not flat.any():
        return told
    since, most = history["t"][int(np.argmax(flat > 0))], count(int(flat.max()), "triangle")
    steps = count(int((flat > 0).sum()), "step")
    return f"{told}; at corners of blocks {most} at most, in {steps}, first at t = {since:.6g} s"


def measure_drifts(history: History) -> dict[str, float]:
    """Largest relative change of each `total_*` over the run; see `compute_drifts`."""
    return {
        name: float(np.nanmax(np.abs(drift))) for name, drift in compute_drifts(history).items()
    }


def compute_drifts(history: History) -> dict[str, np.ndarray]:
    """Change of each `total_*` since the start, less what came through the boundary.

    Relative to the largest size of the total; momentum, which may be zero, to the momentum of all
    mass at the speed that all energy would give it.
    """

    def find_largest(values: np.ndarray) -> float:
        return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))

    drifts = {}
    masses = [find_largest(v) for n, v in history.items() if n.startswith("total_mass")]
    energy = find_largest(history.get("total_energy", NONE))
    usual_momentum = float(np.sqrt(2.0 * sum(masses) * energy))
    for name, values in history.items():
        if not name.startswith("total_") or values.dtype.kind not in "fi":
            continue
        if np.isfinite(values).sum() < 2:
            continue
        through = history.get("boundary_" + name.removeprefix("total_"))
        inside = values - np.nan_to_num(through) if through is not None else values
        size = find_largest(values)
        if name.startswith("total_momentum"):
            size = max(size, usual_momentum)
        start = inside[np.flatnonzero(np.isfinite(inside))[0]]
        drifts[name.removeprefix("total_")] = (inside - start) / (size or 1.0)
    return drifts


def describe_speed(history: History, cells: int) -> str:
    """Cell updates per second of wall time and the share of each phase."""
    step = history.get("seconds_step", NONE)[2:]  # row 0 is the start; row 1 fills caches
    total = float(np.nansum(step))
    if not cells or total <= 0:
        return ""
    text = f"{np.isfinite(step).sum() * cells / total / 1e6:.3g} million cell updates per second"
    shares = [
        f"{name.removeprefix('seconds_').replace('_', ' ')} "
        f"{describe_share(float(np.nansum(values[2:])) / total)}"
        for name, values in history.items()
        if name.startswith("seconds_") and name != "seconds_step"
    ]
    return text + (f" ({', '.join(shares)})" if shares else "")


def describe_cautions(
    problem: Problem, history: Mapping[str, np.ndarray] | None = None
) -> list[str]:
    """A line for each of the problem's cautions; a history of one row tells no more than none.

    Where a reference that they need cannot be computed, a line says so.
    """
    told = history if history and len(history.get("step", ())) > 1 else None
    try:
        sentences = problem.cautions(told)
    except RunFailure as error:
        sentences = [f"cautions could not be computed: {error}"]
    return [HEAD + sentence for sentence in dict.fromkeys(sentences)]


def describe_own(
    problem: Problem, history: Mapping[str, np.ndarray], final: Evolution | None = None
) -> str:
    """The problem's summary of columns of a history and, where there is one, the final state."""
    try:
        return problem.summary(history, final).strip("\n")
    except RunFailure as error:
        return f"there is no comparison with theory: {error}"


class Rule(NamedTuple):
    """What is measured (nan where the run has no such thing), the value above which it is reported.

    words: with `{value}`, `{share}`; meaning: for the table in the pages; below: reported below it.
    """

    name: str
    measure: Callable[[History, int, Problem | None], float]
    limit: float
    words: str
    meaning: str
    below: bool = False


def find_known(history: History, name: str) -> np.ndarray:
    """The values of a column but for its start, those that are not finite left out."""
    values = np.asarray(history.get(name, ()), dtype=float)[1:]
    return values[np.isfinite(values)]


def _find_mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else np.nan


def _find_most(history: History, name: str) -> float:
    values = history.get(name, NONE)
    return float(np.nanmax(values)) if np.isfinite(values).any() else np.nan


def measure_shrinkage(history: History) -> float:
    """How many times dt fell below its largest value before, steps cut on purpose left out."""
    dts, limits = history.get("dt"), history.get("dt_limit")
    if dts is None or limits is None or dts.dtype.kind != "f":
        return np.nan
    counts = dts[np.isfinite(dts) & (dts > 0.0) & ~np.isin(limits, OWN_REASONS)]
    return float((np.maximum.accumulate(counts) / counts).max()) if counts.size else np.nan


def _count_cells_a_wave(problem: Problem | None) -> float:
    return min((problem.count_cells_a_wave() if problem else {}).values(), default=np.nan)


RULES = (
    Rule("cells not convex",
         lambda history, cells, problem: _find_most(history, "cells_not_convex"),
         0.0, "{value:.0f} cells not convex", "most cells in a step that were not convex"),
    Rule("untangling events",
         lambda history, cells, problem: _find_mean(find_known(history, "regrid_rescues") > 0),
         0.01, "folded grids untangled in {share} of the steps",
         "steps in which a grid had to be untangled"),
    Rule("retries",
         lambda history, cells, problem: _find_mean(find_known(history, "retries") > 0),
         0.02, "{share} of the steps retried", "steps that were repeated with a shorter dt"),
    Rule("first-order faces",
         lambda history, cells, problem: _find_mean(
             find_known(history, "first_order_faces")) / (2 * cells or np.nan),
         0.01, "{share} of the faces of first order",
         "mean part of the faces that are computed at first order, where second gave no positive "
         "state"),
    Rule("voids",
         lambda history, cells, problem: _find_most(history, "voided_cells"),
         0.0, "voids in {value:.0f} cells", "most failed cells with a void in a step"),
    Rule("shared cells",
         lambda history, cells, problem: _find_mean(
             find_known(history, "shared_cells")) / (cells or np.nan),
         0.03, "{share} of the cells redistribute their states",
         "mean fraction of cells too small for the step, with state redistribution"),
    Rule("dt", lambda history, cells, problem: measure_shrinkage(history),
         100.0, "dt fell {value:.3g} times",
         "how many times dt fell below its largest value"),
    Rule("drift",
         lambda history, cells, problem: max(measure_drifts(history).values(), default=np.nan),
         1e-10, "conservation error {value:.1e}",
         "largest relative conservation error of mass, energy or momentum; round-off is below the "
         "limit"),
    Rule(WAVES, lambda history, cells, problem: _count_cells_a_wave(problem),
         16.0, "{value:.3g} cells per wave of the shortest mode",
         "cells per wave of the deck's shortest mode: reported below the limit", True),
)  # fmt: skip


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

    name: of the cause of an early end, in a word or two; "failed" where it has none.
    """
    found = []
    for rule in RULES if history else ():
        value = rule.measure(history, cells, problem)
        if value < rule.limit if rule.below else value > rule.limit:
            words = rule.words.format(value=value, share=describe_share(value))
            found.append({"rule": rule.name, "value": value, "limit": rule.limit, "words": words})
    if problem is not None:
        told = history if len(history.get("step", ())) > 1 else None
        sentences = dict.fromkeys(describe_cautions(problem, told))
        if any(one["rule"] == WAVES for one in found):  # told already
            for sentence in problem.list_wave_cautions():
                sentences.pop(HEAD + sentence, None)
        if number := len(sentences):
            words = f"{count(number, 'caution')} of the problem"
            found.append({"rule": "cautions", "value": number, "limit": 0, "words": words})
    if status != "ended early":
        name = reason.partition(" = ")[0].partition(",")[0]
    trend = [dict(mark) for mark in dt_trend]
    verdict = {"status": status, "name": name or "failed", "reason": reason}
    return {**verdict, "trust": found, "dt_trend": trend}


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
        return f"verdict: {head}; no warnings"
    return f"verdict: {head}; warnings: {', '.join(words)}"
