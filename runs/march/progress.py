"""How a run is getting on: a bar in a terminal, now and then a line elsewhere."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from shockgrid.problems.deck import Deck, place_gauges
from shockgrid.problems.evolution import Evolution
from shockgrid.problems.problem import Problem
from shockgrid.regrid.compilation.first_calls import read_clock
from shockgrid.regrid.jit import can_use_threads
from shockgrid.regrid.text_files import escape_controls
from shockgrid.runs.deck.reading import ReadDeck
from shockgrid.runs.early_end.causes import name_failure
from shockgrid.runs.forecast import ShortSteps, TimeLeft, measure_size
from shockgrid.runs.gauges import NO_BLOCK
from shockgrid.runs.inspection.account import count_cells, judge
from shockgrid.runs.quantities import count, describe_seconds, describe_time, drop_units
from shockgrid.runs.store.directory import RunDirectory, write_verdict
from shockgrid.runs.store.history import read_history

LINE_EVERY = 15.0  # wall seconds between lines when there is no terminal
FIRST_WORD = 3.0  # wall seconds after the first step until the whole run is foretold
WORTH_A_WORD = 30.0  # wall seconds of a run that is foretold in a line of its own
REMAPPED = "remapped"  # of the verdict: part of the history is of other cells
BAR = "{desc} {percentage:3.0f}%|{bar:12}| {elapsed}{postfix}"


class Progress:
    """Shows time, steps, dt and its limiter, cell updates per second and the worst corner."""

    def __init__(self, evolution: Evolution, quiet: bool = False, stream=None, t_unit: str = "s"):
        self.t_unit = t_unit
        self.stream = stream or sys.stderr
        self.quiet = quiet
        self.cells = count_cells(evolution)
        self.bar = None
        self._t = evolution.t
        self.left = TimeLeft(evolution.t_end)
        self._left_said = (-1.0, "?")  # wall time, words
        self._foretold = False
        self._began = self._said = read_clock()
        self.steps = 0
        if not quiet and self.stream.isatty():
            from tqdm import tqdm

            self.bar = tqdm(
                total=evolution.t_end,
                initial=evolution.t,
                bar_format=BAR,
                file=self.stream,
                dynamic_ncols=True,
                mininterval=0.2,
            )

    def update(self, evolution: Evolution, row: Mapping[str, Any]) -> None:
        """Take note of a step."""
        self.steps += 1
        now = read_clock()
        self.left.note(self.steps, evolution.t, now)
        if self.quiet:
            return
        if not self._foretold and now - self._began > FIRST_WORD:
            found = self.left.foretell(self.steps, evolution.t, now)
            self._foretold = found is not None
            if found is not None and found[1] >= WORTH_A_WORD:
                a_step = (now - self._began) / self.steps
                ends = describe_seconds(found[0], found[2])
                self.say(f"measured: {a_step * 1e3:.3g} ms per step; {ends} to the end")
        if self.bar is None and now - self._said < LINE_EVERY:
            return
        t = evolution.t
        t_end = evolution.t_end
        when = describe_time(t, self.t_unit, 4)
        status = f"{self.remaining(evolution, now)} left, {self.describe(evolution, row, now)}"
        if self.bar is not None:
            self.bar.set_description_str(when, refresh=False)
            self.bar.set_postfix_str(status, refresh=False)
            self.bar.update(min(t, t_end) - self._t)
            self._t = min(t, t_end)
        else:
            self._said = now
            self.say(f"{when} of {t_end:.4g} ({t / t_end:.0%}), {status}")

    def describe(self, evolution: Evolution, row: Mapping[str, Any], now: float) -> str:
        """Steps, dt, speed and corner quality in a few words."""
        parts = [f"step {evolution.step}"]
        if "dt" in row:
            limit = f" ({row['dt_limit']})" if row.get("dt_limit") else ""
            unit = "" if self.t_unit == "1" else " s"
            parts.append(f"dt {row['dt']:.2e}{unit}{limit}")
        running = now - self._began
        if self.steps and running > 0:
            rate = self.steps * self.cells / running
            parts.append(f"{rate / 1e6:.2f} Mcells/s" if rate > 1e5 else f"{rate:.0f} cells/s")
        if "least_scaled_jacobian" in row:
            parts.append(f"corner {row['least_scaled_jacobian']:.3f}")
        return ", ".join(parts)

    def remaining(self, evolution: Evolution, now: float) -> str:
        """Wall time left in words, a range where it is uncertain; updated once a second."""
        since, duration = self._left_said
        if now - since >= 1.0:
            found = self.left.foretell(self.steps, evolution.t, now)
            duration = describe_seconds(found[0], found[2]) if found else "?"
            self._left_said = now, duration
        return duration

    def say(self, text: str) -> None:
        """A line for the person, above the bar if there is one; nothing when quiet."""
        text = escape_controls(text)
        if self.quiet:
            return
        if self.bar is not None:
            self.bar.write(text, file=self.stream)
        else:
            print(text, file=self.stream, flush=True)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
            self.bar = None


class Outlook:
    """Follows the steps of one run in its directory; `say`: takes a line for the screen."""

    def __init__(
        self,
        deck: ReadDeck,
        problem: Problem,
        evolution: Evolution,
        directory: RunDirectory,
        say: Callable[[str], None],
    ):
        self.deck = deck
        self.problem = problem
        self.evolution = evolution
        self.directory = directory
        self.size = measure_size(problem, evolution)
        self.trend = ShortSteps(evolution, self.tell)
        self.say = say
        directory.verdict.unlink(missing_ok=True)

    def tell(self, line: str) -> None:
        """Note a line about the run and show it."""
        line = drop_units(line, self.problem.t_unit)
        self.directory.note(line)
        self.say(line)

    def fail(self, error: Exception) -> None:
        """The verdict on a run that has failed; nothing may hide its own sentence."""
        with contextlib.suppress(Exception):
            history = read_history(self.directory.history)
            self.close("ended early", str(error), history, name_failure(error))

    def close(
        self,
        status: str,
        reason: str,
        history: Mapping[str, np.ndarray],
        name: str = "",
        remapped: str = "",
    ) -> dict[str, Any]:
        """Write the verdict, which is returned; name: of the cause of an early end; remapped: which
        part of the history is of other cells."""
        verdict = judge(status, reason, history, self.size.cells, self.problem, name)
        if remapped:
            verdict["trust"].append({"rule": REMAPPED, "value": 1, "limit": 0, "words": remapped})
        write_verdict(self.directory, verdict)
        return verdict


def describe_gauges(deck: Deck, directory: RunDirectory) -> list[str]:
    """How many gauges there are, and which of them have been outside of all blocks how often."""
    points = place_gauges(deck.gauge)
    if not points:
        return []
    table = read_history(directory.gauges)
    description = f"{count(len(points), 'gauge')} in gauges.csv"
    outside = {p.name: int((table[f"{p.name}_block"] == NO_BLOCK).sum()) for p in points if table}
    rows = len(table.get("step", ()))
    absences = [f"{name} in {times} of {rows} rows" for name, times in outside.items() if times]
    if absences:
        more = f" and {len(absences) - 3} more" if len(absences) > 3 else ""
        description += f"; outside of all blocks: {', '.join(absences[:3])}{more}"
    return [description]


def describe_threads(wanted: int | None, evolution: Evolution) -> str:
    """Threads that the blocks asked for, those there are, and how they are started."""
    workers = getattr(evolution, "workers", None)
    numba = sys.modules.get("numba")
    if workers and workers.side_by_side:
        return f"{workers.threads}, blocks side by side"
    wanted = workers.threads if workers else wanted or 1
    if wanted == 1 or numba is None:
        return "1"
    if not can_use_threads():
        return f"1; {wanted} wanted, but a process forked from one with threads can start none"
    allowed = numba.config.NUMBA_NUM_THREADS
    try:
        layer = numba.threading_layer()
    except ValueError:  # nothing has run on more than one
        return f"{wanted} wanted, 1 used: the blocks are too small to gain by more"
    more = f"; {wanted} wanted, but this machine has {allowed}" if wanted > allowed else ""
    if layer == "workqueue":
        more += "; omp is missing here (install libgomp): threads start more slowly"
    return f"{min(wanted, allowed)} ({layer}){more}"
