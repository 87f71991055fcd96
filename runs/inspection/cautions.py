"""Where a user should not trust a result: the problem's own sentences, as lines of a screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from problems.problem import Problem
from regrid.errors import RunFailure
from runs.inspection.account import count
from runs.store.history_rows import say_stretches

HEAD = "caution: "


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
        sentences = [f"how far to trust this is not known: {error}"]
    return [HEAD + sentence for sentence in dict.fromkeys(sentences)]


def describe_gaps(gaps: Sequence[tuple[int, int]]) -> list[str]:
    """Sentences on rows of a history that are lost for good; none where it is whole."""
    if not gaps:
        return []
    firsts, lasts = [first for first, _ in gaps], [last for _, last in gaps]
    rows = count(sum(last - first + 1 for first, last in gaps), "row")
    told = [f"the history has lost {rows} ({say_stretches(firsts, lasts, 'step')})"]
    if firsts[0] == 0:
        told[0] += (
            ", its start among them: the first amplitude, or whatever it began with, is unknown"
        )
    return told
