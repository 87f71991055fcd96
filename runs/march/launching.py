"""Making the runner of a new run, or of one that goes on."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from pathlib import Path

from problems.deck import Deck
from problems.problem import check_memory
from regrid.errors import BadInput
from runs.deck.checking import show
from runs.deck.reading import ReadDeck
from runs.deck.runtime_keys import describe_runtime_keys, is_runtime_key
from runs.forecast.cost import check_disk, describe_cost, estimate_cost
from runs.inspection.cautions import describe_cautions
from runs.march.first_checks import check_regridder, check_requests
from runs.march.kept_deck import settle_deck
from runs.march.progress import patience
from runs.march.runner import Runner
from runs.march.schedule import check_output
from runs.ranks.world import World
from runs.store.directory import RunDirectory, create_directory
from runs.store.run_deck import read_run_deck


def start_runner(
    deck: ReadDeck,
    output: str | None,
    force: bool,
    quiet: bool,
    say: Callable[[str], None],
    world: World | None = None,
) -> Runner:
    """A runner at the first step; its directory is made once all else has been found good.

    world: the ranks of MPI that are to share it.
    """
    problem = deck.make_problem()
    with patience(quiet), deck.numbers_in_reach():
        check_memory(problem)
        cautions = describe_cautions(problem)
        check_regridder(problem)
        if world is not None:
            world.build(deck)
        evolution = problem.build()
        check_requests(deck, evolution)  # refused before there is a directory
        if world is not None:
            world.check(evolution)
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


def continue_runner(
    directory: RunDirectory,
    settings: tuple[str, ...],
    quiet: bool,
    at: int | None = None,
    say: Callable[[str], None] = lambda text: None,
    world: World | None = None,
) -> Runner:
    """A runner for the deck in `directory` with `settings`; its `resume` goes on.

    at: step of the restart point that `resume` will be asked for.  say: is told the cautions of a
    run that goes on beyond the end that it was set up for.  world: the ranks of MPI that are to
    share it.  Raises BadInput for a deck that would make it another flow.
    """
    deck = read_restart_deck(directory, settings, at, say)
    problem = deck.make_problem()
    with patience(quiet), deck.numbers_in_reach():
        if world is not None:
            world.build(deck)
        evolution = problem.build()
        check_output(deck.deck.output, evolution)
        if deck.deck.run.t_set_up is not None and not quiet:
            for line in describe_cautions(problem):
                say(line)
    return Runner(deck, directory, problem, evolution, quiet)


def read_restart_deck(
    directory: RunDirectory,
    settings: tuple[str, ...],
    at: int | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> ReadDeck:
    """The deck that a restart marches with: that of `directory` with `settings`, checked against
    the one in the restart point of step `at`, None the last (`kept_deck`)."""
    deck = read_run_deck(directory, settings, strict=True, say=say)
    check_changeable(settings, type(deck.deck))
    check_effect(settings, deck.deck)
    return settle_deck(directory, deck, at)


def check_effect(settings: tuple[str, ...], deck: Deck) -> None:
    """Raise BadInput for a setting of a key that another key of the deck overrules."""
    for setting in settings:
        key = setting.partition("=")[0].strip()
        other = deck.overruled.get(key)
        if other is not None and attrgetter(other)(deck) is not None:
            raise BadInput(
                f"--set {key} has no effect, since {other} = {show(attrgetter(other)(deck))} is "
                f"set; --set {other}=..."
            )


def check_changeable(
    settings: tuple[str, ...], kind: type[Deck], besides: tuple[str, ...] = ()
) -> None:
    """Raise BadInput for a setting of a deck `kind` that a restart cannot change.

    besides: keys that this restart can change, too.
    """
    for setting in settings:
        key = setting.partition("=")[0].strip()
        if not is_runtime_key(key, kind) and key not in besides:
            keys = ", ".join((*besides, describe_runtime_keys(kind)))
            raise BadInput(
                f"--set {key}: it shapes the state, and a restart can change only {keys}; another "
                f"{key} is another run (shockgrid run)"
            )
