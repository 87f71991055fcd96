"""Where a user should not trust a result: the problem's own sentences, as lines of a screen."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from problems.problem import Problem

HEAD = "caution: "


def describe_cautions(
    problem: Problem, history: Mapping[str, np.ndarray] | None = None
) -> list[str]:
    """A line for each of the problem's cautions; a history of one row tells no more than none."""
    told = history if history and len(history.get("step", ())) > 1 else None
    return [HEAD + sentence for sentence in dict.fromkeys(problem.cautions(told))]
