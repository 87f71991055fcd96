"""Making the runner of a new run, or of one that goes on."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from problems.problem import Problem
from regrid.errors import BadInput
from runs.deck.reading import ReadDeck
from runs.forecast.cost import check_disk, describe_cost, estimate_cost
from runs.inspection.cautions import describe_cautions
from runs.inspection.listing import estimate_memory
from runs.march.first_checks import check_regridder, check_requests
from runs.march.progress import patience
from runs.march.runner import Runner
from runs.march.schedule import check_output
from runs.store.directory import RunDirectory, create_directory
from runs.store.run_deck import read_run_deck

CHANGEABLE = ("run", "output", "regrid")


def start_runner(
    deck: ReadDeck, output: str | None, force: bool, quiet: bool, say: Callable[[str], None]
) -> Runner:
    """A runner at the first step; its directory is made once all else has been found good."""
    problem = deck.make_problem()
    with patience(quiet), deck.numbers_in_reach():
        check_memory(problem)
        cautions = describe_cautions(problem)
        check_regridder(problem)
        evolution = problem.build()
        check_requests(deck, evolution)  # refused before there is a directory
        folder = Path(output) if output else None
        cost = estimate_cost(deck, problem, evolution, folder)
        cautions += check_disk(cost, folder)
    directory = create_directory(output, deck.label, force)
    if not quiet:
        say(
            "\n".join(
                [
                    f"{deck.problem} ({deck.described}) in {directory}",
                    *describe_cost(cost),
                    *cautions,
                ]
            )
        )
    return Runner(deck, directory, problem, evolution, quiet)


def check_memory(problem: Problem) -> None:
    """Raise BadInput for more cells than the machine's memory holds, as far as `plan` tells."""
    plan = problem.plan()
    cells = sum(block.cells[0] * block.cells[1] for block in plan[1]) if plan else 0
    try:
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):  # Windows
        return
    if (wanted := estimate_memory(cells)) > memory:
        raise BadInput(
            f"{cells:.4g} cells need about {wanted / 1e9:.3g} GB of memory, this machine has "
            f"{memory / 1e9:.3g} GB; take fewer cells"
        )


def continue_runner(directory: RunDirectory, settings: tuple[str, ...], quiet: bool) -> Runner:
    """A runner for the deck in `directory` with `settings`; its `resume` goes on.

    Raises BadInput for a setting that would make it another flow.
    """
    check_changeable(settings)
    deck = read_run_deck(directory, settings, strict=True)
    problem = deck.make_problem()
    with patience(quiet), deck.numbers_in_reach():
        evolution = problem.build()
        check_output(deck.deck.output, evolution)
    return Runner(deck, directory, problem, evolution, quiet)


def check_changeable(settings: tuple[str, ...]) -> None:
    """Raise BadInput for a setting that a restart cannot change."""
    for setting in settings:
        key = setting.partition("=")[0].strip()
        if key.split(".")[0] not in CHANGEABLE:
            parts = ", ".join(f"{part}.*" for part in CHANGEABLE)
            raise BadInput(
                f"--set {key}: a restart can change only {parts}; another {key} is another run "
                "(shockgrid run)"
            )
