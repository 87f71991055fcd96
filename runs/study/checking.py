"""What is wrong with all points of a study, told before anything is made or computed.

A value that is wrong at some points fails these alone; a deck or a key that there is not is wrong
at all of them.
"""

from __future__ import annotations

import warnings

import numpy as np

from problems.evolution import get_start_row
from problems.problem import Problem
from regrid.errors import BadInput
from runs.deck.reading import read_deck
from runs.study.definition import Definition
from runs.study.error_names import find_error_columns
from runs.study.orders import find_refined_key


def check_study(definition: Definition, refine: str | None = None) -> None:
    """Raise BadInput where no point can be begun, or a name of `shown` is in none.

    refine: the key of cells, as `--refine` names it.
    """
    find_refined_key(definition, refine)
    sentences = []
    for number in range(len(definition.points)):
        try:
            _make_problem(definition, number)
            break
        except BadInput as error:
            sentences.append(str(error))
    else:
        many = len(set(sentences)) > 1
        head = f"all {len(sentences)} points are wrong; {definition.points[0].name}: " * many
        raise BadInput(head + sentences[0])
    _check_shown(definition)


def _make_problem(definition: Definition, number: int) -> tuple[str, Problem]:
    """The problem of a point, with its name in decks; BadInput where the deck is wrong."""
    settings = (*definition.settings, *definition.points[number].settings)
    deck = read_deck(definition.source, settings)
    return deck.problem, deck.make_problem()


def _check_shown(definition: Definition) -> None:
    """Raise BadInput for a name of `shown` that no kind of point has at its start.

    Points of one kind differ in decimal numbers alone.  Where a problem cannot say its names before
    its first step, nothing is refused.
    """
    missing, known, kinds = list(definition.shown), [], set()
    for number, point in enumerate(definition.points):
        kind = tuple(str(value) for _, value in point.values if not isinstance(value, float))
        if not missing:
            return
        if kind in kinds:
            continue
        try:
            names = _find_names(*_make_problem(definition, number))
        except BadInput:
            continue  # it fails by itself
        except Exception:
            return
        kinds.add(kind)
        known += names
        missing = [name for name in missing if name not in names]
    if missing:
        known = list(dict.fromkeys(known))
        words = f"; there are: {', '.join(known)}" if known else ""
        raise BadInput(f"--of {missing[0]}: no run has it{words}")


def _find_names(problem_name: str, problem: Problem) -> list[str]:
    """Names of results, errors and measurements, from a history that has its first row alone."""
    evolution = problem.build()
    measured = problem.measure(evolution)
    row = {"step": evolution.step, "t": evolution.t, **get_start_row(evolution), **measured}
    history = {name: np.array([value]) for name, value in row.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # one row is little to compute with
        results = list(problem.results(history))
        errors = [*problem.errors(history), *find_error_columns(problem_name, measured)]
    return [*results, *(f"{name}_error" for name in results), *errors, *measured]
