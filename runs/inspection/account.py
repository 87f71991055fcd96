"""A run's history summarised in text, and the verdict: how it ended and what may be wrong.

A verdict is plain data: `status` ("finished", "stopped", "ended early", "unfinished"), `name` (the
reason in a word or two), `reason` (the sentence), `trust` (what the RULES found, each with
`rule`, `value`, `limit`, `words`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from shockgrid.problems.evolution import Evolution
from shockgrid.problems.problem import Problem
from shockgrid.regrid.errors import RunFailure
from shockgrid.runs.quantities import count, describe_share, drop_units

History = Mapping[str, np.ndarray]
HEAD = "caution: "
OWN_REASONS = ("start", "t_end", "end", "dump", "retry")  # of a step's length: no trend
NONE = np.zeros(0)
CONSERVATION_ERROR_LIMIT = 1e-10  # round-off is below


def count_cells(evolution: Evolution) -> int:
    """Cells of all blocks together."""
    return sum(math.prod(n - 1 for n in block.nodes.shape[1:]) for block in evolution.blocks)


def describe_run(history: History, cells: int, blocks: Sequence[str] = ()) -> list[str]:
    """Lines about dt, regridding, speed and conservation, as far as the history has the columns.

    blocks: names of the blocks.
    """
    drifts = [f"{n.replace('_', ' ')} {v:.1e}" for n, v in measure_drifts(history).items()]
    lines = (
        ("dt limited by: ", describe_limits(history)),
        ("fastest cell: ", describe_fastest(history, blocks)),
        ("regridding: ", describe_regridding(history)),
        ("", describe_convexity(history)),
        ("contacts: ", describe_contacts(history)),
        ("one grid for two materials: ", describe_handover(history)),
        ("largest conservation errors: ", ", ".join(drifts)),
        ("speed: ", describe_speed(history, cells)),
    )
    return [head + content for head, content in lines if content]


def describe_limits(history: History) -> str:
    """How often each limiter decided dt."""
    limits = history.get("dt_limit", NONE)
    if limits.dtype.kind != "U":
        return ""
    names, counts = np.unique(limits[limits != ""], return_counts=True)
    shares = [describe_share(often) for often in counts / counts.sum()]
    return ", ".join(f"{names[k]} {shares[k]}" for k in np.argsort(-counts))


def describe_handover(history: History) -> str:
    """From when on two blocks have been one, and why."""
    reasons = history.get("handover", NONE)
    if reasons.dtype.kind != "U":
        return ""
    rows = np.flatnonzero(reasons != "")
    if not rows.size:
        return ""
    row = int(rows[0])
    reason = str(reasons[row]).replace("-", " ")
    why = "as the deck says" if reason == "time" else f"the lines could not go on: {reason}"
    return f"from step {history['step'][row]}, t = {history['t'][row]:.4g}, on; {why}"


def describe_fastest(history: History, blocks: Sequence[str]) -> str:
    """Most frequent location of the fastest cell, and steps saved by state redistribution."""
    over = history.get("fastest_over_limit", NONE)
    known = np.isfinite(over)
    if not known.any():
        return ""
    cells = np.array([history[f"fastest_{name}"][known] for name in ("block", "i", "j")])
    places, counts = np.unique(cells.astype(int), axis=1, return_counts=True)
    number, i, j = places[:, counts.argmax()]
    block = blocks[number] if number < len(blocks) else f"block {number}"
    cell = f"{block}, i={i}, j={j} in {describe_share(counts.max() / known.sum())} of the steps"
    alone = round(float(over[known].sum()))  # steps, if none were longer than this cell's own
    if alone > 1.02 * known.sum():
        most = count(int(np.nanmax(history.get("shared_cells", np.zeros(1)))), "cell")
        cell += f"; state redistribution in up to {most} ({alone} steps would be needed without it)"
    return cell


def describe_regridding(history: History) -> str:
    """Totals of the regridder's work and the worst cells of the run."""
    parts = []
    for name, unit, find in (
        ("regrid_iterations", "{:.0f} iterations", np.nansum),
        ("regrid_sub_moves", "{:.0f} sub-moves", np.nansum),
        ("regrid_rescues", "{:.0f} untangling events", np.nansum),
        ("least_scaled_jacobian", "minimum scaled Jacobian {:.3g}", np.nanmin),
        ("worst_aspect", "worst aspect ratio {:.3g}", np.nanmax),
    ):
        if np.isfinite(history.get(name, NONE)).any():
            parts.append(unit.format(find(history[name])))
    return ", ".join(parts)


def describe_contacts(history: History) -> str:
    """Number of contacts between bodies that closed and opened, and the first times."""
    contacts = []
    for name in ("made", "opened"):
        counts = np.nan_to_num(history.get(f"contacts_{name}", NONE))
        if counts.any():
            first = float(history["t"][np.argmax(counts > 0)])
            contacts.append(f"{int(counts.max())} {name}, the first by t = {first:.4g} s")
    return "; ".join(contacts)


def describe_convexity(history: History) -> str:
    """Whether every cell was convex in every step; if not, in how many steps, since when.

    Triangular cells at the corners of blocks are counted separately.  Histories without
    `cells_not_convex` are judged by `least_scaled_jacobian`; "" without both.
    """
    sine = history.get("least_scaled_jacobian")
    bad = history.get("cells_not_convex", None if sine is None else sine <= 0.0)
    if bad is None:
        return ""
    flat = np.nan_to_num(history.get("cells_triangular", NONE))
    statement = "every cell convex in every step"
    for counts in (np.nan_to_num(bad), flat):
        if counts.any():
            since = f"first at t = {history['t'][np.argmax(counts > 0)]:.6g}"
            steps = count(int((counts > 0).sum()), "step")
            if counts is not flat:
                return f"NOT CONVEX: in {steps} of {counts.size}, {since}"
            most = count(int(flat.max()), "triangle")
            statement += f"; at corners of blocks {most} at most, in {steps}, {since}"
    return statement


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
    totals = {
        name.removeprefix("total_"): values
        for name, values in history.items()
        if name.startswith("total_")
        and values.dtype.kind in "fi" and np.isfinite(values).sum() > 1
    }  # fmt: skip
    sizes = {name: float(np.nanmax(np.abs(values))) for name, values in totals.items()}
    mass = sum(size for name, size in sizes.items() if name.startswith("mass"))
    drifts = {}
    for name, values in totals.items():
        inside = values - np.nan_to_num(history.get(f"boundary_{name}", np.zeros(len(values))))
        usual = math.sqrt(2.0 * mass * sizes.get("energy", 0.0)) * name.startswith("momentum")
        start = inside[np.isfinite(inside)][0]
        drifts[name] = (inside - start) / (max(sizes[name], usual) or 1.0)
    return drifts


def describe_speed(history: History, cells: int) -> str:
    """Cell updates per second of wall time and the share of each phase."""
    sums = {  # row 0 is the start; row 1 fills caches
        name.removeprefix("seconds_").replace("_", " "): float(np.nansum(values[2:]))
        for name, values in history.items()
        if name.startswith("seconds_")
    }
    total = sums.pop("step", 0.0)
    if not cells or total <= 0.0:
        return ""
    steps = np.isfinite(history["seconds_step"][2:]).sum()
    shares = ", ".join(f"{name} {describe_share(part / total)}" for name, part in sums.items())
    text = f"{steps * cells / total / 1e6:.3g} million cell updates per second"
    return f"{text} ({shares})" if shares else text


def describe_cautions(problem: Problem, history: History | None = None) -> list[str]:
    """A line for each of the problem's cautions; a history of one row is ignored.

    If a reference that they need cannot be computed, a line reports it.
    """
    known_history = history if history and len(history.get("step", ())) > 1 else None
    try:
        sentences = problem.cautions_on(known_history)
    except RunFailure as error:
        sentences = [f"cautions could not be computed: {error}"]
    return [HEAD + drop_units(one, problem.t_unit) for one in dict.fromkeys(sentences)]


def describe_own(problem: Problem, history: History, final: Evolution | None = None) -> str:
    """The problem's summary of the history and of the final state, if there is one."""
    try:
        return drop_units(problem.summary(history, final).strip("\n"), problem.t_unit)
    except RunFailure as error:
        return f"no comparison with theory: {error}"


class Rule(NamedTuple):
    """A quantity of a history and the number of cells, and the value above which it is reported.

    The quantity is nan if the run lacks it.  words: with `{value}`, `{share}`; meaning: for the
    table in the pages.
    """

    name: str
    measure: Callable[[History, int], float]
    limit: float
    words: str
    meaning: str


def most(name: str) -> Callable[[History, int], float]:
    """The largest value of a column."""
    return lambda history, cells: mean(name, lambda n, _: np.max(n))(history, cells)


def mean(name: str, part: Callable[[np.ndarray, int], Any]) -> Callable[[History, int], float]:
    """The mean over all steps of `part`, a function of a column and the number of cells."""

    def measure(history: History, cells: int) -> float:
        values = np.asarray(history.get(name, NONE), dtype=float)[1:]
        values = values[np.isfinite(values)]
        return float(np.mean(part(values, cells))) if values.size else np.nan

    return measure


def measure_shrinkage(history: History) -> float:
    """By what factor dt fell below its earlier maximum, ignoring steps cut on purpose."""
    dts = history.get("dt")
    limits = history.get("dt_limit")
    if dts is None or limits is None or dts.dtype.kind != "f":
        return np.nan
    counts = dts[np.isfinite(dts) & (dts > 0.0) & ~np.isin(limits, OWN_REASONS)]
    return float((np.maximum.accumulate(counts) / counts).max()) if counts.size else np.nan


RULES = (
    Rule("cells not convex", most("cells_not_convex"), 0.0, "{value:.0f} cells not convex",
         "most cells in a step that were not convex"),
    Rule("untangling events", mean("regrid_rescues", lambda n, _: n > 0), 0.01,
         "folded grids untangled in {share} of the steps",
         "steps in which a grid had to be untangled"),
    Rule("retries", mean("retries", lambda n, _: n > 0), 0.02, "{share} of the steps retried",
         "steps that were repeated with a shorter dt"),
    Rule("first-order faces", mean("first_order_faces", lambda n, cells: n / (2 * cells)), 0.01,
         "{share} of the faces of first order",
         "mean part of the faces that are computed at first order, where second gave no positive "
         "state"),
    Rule("voids", most("voided_cells"), 0.0,
         "voids in {value:.0f} cells, opened by tension beyond the material's strength",
         "most failed cells with a void in a step"),
    Rule("shared cells", mean("shared_cells", lambda n, cells: n / cells), 0.03,
         "{share} of the cells redistribute their states",
         "mean fraction of cells too small for the step, with state redistribution"),
    Rule("dt", lambda history, _: measure_shrinkage(history), 100.0, "dt fell {value:.3g} times",
         "how many times dt fell below its largest value"),
    Rule("overlap", most("contact_overlap"), 0.1, "bodies overlap by {value:.2g} cells",
         "largest area by which bodies lay in each other after a step, in cells"),
    Rule("pushed apart", most("contact_pushed_area"), 1.0,
         "bodies were pushed apart by {value:.2g} cells",
         "area without a flux by which nodes that lay deep in another body were pushed out of it, "
         "in cells, since the start"),
    Rule("drift", lambda history, _: max(measure_drifts(history).values(), default=np.nan),
         CONSERVATION_ERROR_LIMIT, "conservation error {value:.1e}",
         "largest relative conservation error of mass, energy or momentum; round-off is below the "
         "limit"),
)  # fmt: skip


def judge(
    status: str,
    reason: str,
    history: History,
    cells: int,
    problem: Problem | None = None,
    name: str = "",
) -> dict[str, Any]:
    """The verdict on a run from its history; `cells`: of all its blocks; see the module.

    name: the cause of an early end in a word or two; "failed" if unknown.
    """
    found = []
    for rule in RULES if history else ():
        if (value := rule.measure(history, cells)) > rule.limit:
            sentence = rule.words.format(value=value, share=describe_share(value))
            found.append(
                {"rule": rule.name, "value": value, "limit": rule.limit, "words": sentence}
            )
    if problem is not None and (number := len(describe_cautions(problem, history))):
        sentence = f"{count(number, 'caution')} of the problem"
        found.append({"rule": "cautions", "value": number, "limit": 0, "words": sentence})
    if status != "ended early":
        name = reason.partition(" = ")[0].partition(",")[0]
    return {"status": status, "name": name or "failed", "reason": reason, "trust": found}


def describe_verdict(verdict: Mapping[str, Any]) -> str:
    """The verdict in one line."""
    head = str(verdict["status"])
    reason = str(verdict["reason"]).partition("\n")[0]
    if head == "ended early":
        head = f"{head}, {verdict['name']}"
    elif head != "finished" and reason:  # which may begin so: "stopped by SIGTERM"
        head = reason if reason.startswith(head) else f"{head}, {reason}"
    reasons = ", ".join(str(one["words"]) for one in verdict["trust"])
    return f"verdict: {head}; {f'warnings: {reasons}' if reasons else 'no warnings'}"
