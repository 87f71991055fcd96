"""What a run foretells of itself while it marches, and what is said of it at its end.

Nothing of the flow depends on any of this.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from problems.evolution import Evolution
from problems.problem import Problem
from runs.deck.reading import ReadDeck
from runs.early_end.causes import name_failure
from runs.forecast.cost import measure_size
from runs.forecast.past_runs import find_past, keep_run, make_past_run, name_flow, name_kernels
from runs.forecast.step_trend import StepTrend
from runs.forecast.time_left import Course
from runs.inspection.account import count_cells
from runs.inspection.verdict import judge
from runs.store.directory import RunDirectory
from runs.store.history import read_history
from runs.store.verdict_file import remove_verdict, write_verdict


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
        self.deck, self.problem, self.evolution = deck, problem, evolution
        self.directory = directory
        self.began = evolution.step
        self.flow, self.cells = name_flow(deck.problem, deck.deck), count_cells(evolution)
        self.finest = measure_size(problem, evolution).finest
        self.trend = StepTrend(evolution, directory.note, say)
        remove_verdict(directory)
        if self.began:
            self.trend.resume(read_history(directory.history))

    def find_course(self) -> Course | None:
        """How dt went in a past run of the same flow."""
        past = find_past(self.flow, self.cells)
        return past.course if past and math.isclose(past.t_end, self.evolution.t_end) else None

    def follow(self, row: Mapping[str, Any]) -> None:
        """Take note of a step's history row."""
        self.trend.follow(row)

    def fail(self, error: Exception) -> None:
        """The verdict on a run that has failed; nothing may hide its own sentence."""
        with contextlib.suppress(Exception):
            history = read_history(self.directory.history)
            self.close("ended early", str(error), history, name_failure(error))

    def close(
        self, status: str, reason: str, history: Mapping[str, np.ndarray], name: str = ""
    ) -> dict[str, Any]:
        """Write the verdict, which is returned; keep what a whole run tells of later ones.

        name: of the cause of an early end.
        """
        marks = self.trend.describe()
        verdict = judge(status, reason, history, self.cells, self.problem, marks, name)
        write_verdict(self.directory, verdict)
        clock = getattr(self.evolution, "clock", None)
        if status == "finished" and clock is not None and not self.began:
            run = make_past_run(
                self.flow, self.deck.problem, self.cells, self.evolution.t_end, self.finest,
                clock.first_stable_dt, history, name_kernels(self.evolution),
            )  # fmt: skip
            if run is not None:
                keep_run(run)
        return verdict
