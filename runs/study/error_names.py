"""Which numbers of a problem are errors: those that `shockgrid verify` judges."""

from __future__ import annotations

import functools
from collections.abc import Iterable

from problems.registry import PROBLEMS
from runs.deck.reading import packaged_decks, read_toml
from runs.verify.cases import CASES, Case


@functools.cache
def _find_problem(deck: str) -> str:
    return deck if deck in PROBLEMS else str(read_toml(packaged_decks()[deck])["problem"])


def find_error_columns(problem: str, measured: Iterable[str] = ()) -> tuple[str, ...]:
    """Names of errors that `verify` has statements about for `problem`, columns among them.

    And those of `measured` that begin with `error`.
    """
    judged = (case.quantity for case in CASES if _find_problem(case.deck) == problem)
    named = (name for name in measured if name.startswith("error"))
    return tuple(dict.fromkeys([*judged, *named]))


def find_case(deck: str, settings: tuple[str, ...], quantity: str) -> Case | None:
    """The statement of `verify` on this quantity of this very deck, None where there is none."""
    for case in CASES:
        if (case.deck, case.quantity, set(case.settings)) == (deck, quantity, set(settings)):
            return case
    return None
