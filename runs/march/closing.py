"""The closing screen of a run: what was computed, how it kept to conservation, what the problem
says beside theory, where not to trust it, and where everything lies."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from problems.deck import Deck, place_gauges
from problems.evolution import Evolution
from problems.problem import Problem
from runs.gauges.recorder import NO_BLOCK
from runs.inspection.account import count, count_cells, describe_run, describe_seconds
from runs.inspection.cautions import HEAD, describe_cautions, describe_gaps
from runs.inspection.own_words import describe_own
from runs.inspection.units import describe_time
from runs.inspection.verdict import describe_verdict
from runs.store.directory import RunDirectory
from runs.store.history import read_history
from runs.store.history_rows import read_rows


def closing_screen(
    problem: Problem,
    evolution: Evolution,
    history: Mapping[str, np.ndarray],
    directory: RunDirectory,
    reason: str,
    seconds: float,
    verdict: Mapping[str, Any],
    ranks: Sequence[str] = (),
) -> str:
    """All of the screen as text; ranks: lines about those of MPI."""
    cells = count_cells(evolution)
    blocks = count(len(evolution.blocks), "block")
    marched = [describe_time(evolution.t, problem.t_unit)]
    if problem.t_unit == "s":
        marched.append(count(evolution.step, "step"))
    words = ", ".join([*marched, f"{cells} cells in {blocks}", describe_seconds(seconds)])
    lines = [f"{reason}: {words}", describe_verdict(verdict)]
    lines += describe_run(history, cells, [block.name for block in evolution.blocks])
    lines += describe_gauges(problem.deck, directory)
    motion = getattr(evolution, "motion", None)
    if motion is not None and motion.blocks.size > 1:
        lines.append(f"ranks of MPI: {motion.blocks.size}; on the first of them")
    lines.append(f"threads: {describe_threads(problem.deck.run.threads, evolution)}")
    lines += ranks
    gaps = read_rows(directory.history).gaps
    if len(history.get("step", ())) > 1 and not (gaps and gaps[0][0] == 0):
        own = describe_own(problem, history, evolution)
        if own:
            lines += ["", own]
    cautions = [HEAD + sentence for sentence in describe_gaps(gaps)]
    cautions += describe_cautions(problem, history)
    lines += ["", *cautions] if cautions else []
    dumps = count(len(directory.list_files("dump")), "dump")
    lines += [
        "",
        f"in {directory}: {dumps}, history.csv, run.xmf (ParaView)",
        f"look at it:  shockgrid plot {directory.quoted}    shockgrid info {directory.quoted}",
    ]
    if evolution.finished is None:
        lines.append(f"go on:       {problem.say_restart(directory.quoted)}")
    return "\n".join(lines)


def describe_gauges(deck: Deck, directory: RunDirectory) -> list[str]:
    """How many gauges there are, and which of them have been outside of all blocks how often."""
    points = place_gauges(deck.gauge)
    if not points:
        return []
    table = read_history(directory.gauges)
    words = f"{count(len(points), 'gauge')} in gauges.csv"
    outside = {p.name: int((table[f"{p.name}_block"] == NO_BLOCK).sum()) for p in points if table}
    rows = len(table.get("step", ()))
    told = [f"{name} in {times} of {rows} rows" for name, times in outside.items() if times]
    if told:
        more = f" and {len(told) - 3} more" if len(told) > 3 else ""
        words += f"; outside of all blocks: {', '.join(told[:3])}{more}"
    return [words]


def describe_threads(wanted: int | None, evolution: Evolution) -> str:
    """Threads that the blocks asked for, those there are, and how they are started."""
    workers = getattr(evolution, "workers", None)
    if workers and workers.side_by_side:
        return f"{workers.threads}, blocks side by side"
    wanted = workers.threads if workers else wanted or 1
    numba = sys.modules.get("numba")
    if wanted == 1 or numba is None:
        return "1"
    allowed = numba.config.NUMBA_NUM_THREADS
    try:
        layer = numba.threading_layer()
    except ValueError:  # nothing has run on more than one
        return f"{wanted} wanted, 1 used: the blocks are too small to gain by more"
    text = f"{min(wanted, allowed)} ({layer})"
    if wanted > allowed:
        text += f"; {wanted} wanted, but this machine has {allowed}"
    if layer == "workqueue":
        text += "; omp is missing here (install libgomp): threads start more slowly"
    return text
