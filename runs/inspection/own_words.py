"""What a problem says of its run beside its references.

A reference that cannot be computed is told in a sentence: the run is none the worse for it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from problems.evolution import Evolution
from problems.problem import Problem
from regrid.errors import RunFailure


def describe_own(
    problem: Problem, history: Mapping[str, np.ndarray], final: Evolution | None = None
) -> str:
    """The problem's summary of columns of a history and, where there is one, the final state."""
    try:
        return problem.summary(history, final).strip("\n")
    except RunFailure as error:
        return f"there is no comparison with theory: {error}"
