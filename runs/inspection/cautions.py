"""Where a user should not trust a result: the problem's own sentences, as lines of a screen."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from problems.problem import Problem
from regrid.errors import RunFailure

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
