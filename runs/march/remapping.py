"""Going on with a run on other numbers of cells, in a directory of its own.

The old directory is read and stays as it is.  The new one gets the deck with the new cells, the
history up to the restart point, and from there on whatever a run writes; it can be restarted like
any other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hydro.remap.simulation import take_over
from hydro.simulation import Simulation
from problems.evolution import Evolution
from problems.problem import check_memory
from regrid.errors import BadInput
from runs.deck.reading import ReadDeck, parse_value
from runs.gauges.recorder import make_gauges
from runs.march.kept_deck import settle_deck
from runs.march.launching import check_changeable, check_effect
from runs.march.progress import patience
from runs.march.runner import Runner, find_restart_point, restore
from runs.store.directory import RunDirectory, create_directory
from runs.store.files import write_atomically
from runs.store.history import is_provisional, list_texts, truncate_history, write_rows
from runs.store.history_rows import Rows, read_rows
from runs.store.run_deck import read_run_deck

KEY = "cells"


def wants_other_cells(cells: str | None, settings: tuple[str, ...]) -> bool:
    """Do `--cells` or a `--set cells=...` ask for another grid?"""
    return cells is not None or any(_get_key(setting) == KEY for setting in settings)


def remap_runner(
    old: RunDirectory,
    cells: str | None,
    settings: tuple[str, ...],
    at: int | None,
    output: str | None,
    force: bool,
    quiet: bool,
    say: Callable[[str], None],
) -> Runner:
    """A runner in a new directory, whose evolution has the state of `old` on other cells.

    cells: the deck's key `cells`, "64" or "64,32"; settings: others, of run, output and regrid; at:
    the step of the restart point, None the last; output, force: as for a new run.  Its `go_on`
    starts it.  Raises BadInput, before anything is written, for what cannot be gone on with.
    """
    before = read_run_deck(old, strict=True, say=say)
    settle_deck(old, before, at)
    deck = read_run_deck(old, _add_cells(before, cells, settings), strict=True)
    check_effect(settings, deck.deck)
    deck = settle_deck(old, deck, at, cells=True)
    _check_apart(old, output)
    source: Any = _build(before, quiet)
    target: Any = _build(deck, quiet)
    if not (_is_flow(source) and _is_flow(target)):
        raise BadInput(
            f"--cells: {deck.problem} is no flow on blocks alone, and what it holds besides cannot "
            "be laid on other cells; begin a new run with the cells wanted"
        )
    gauges = make_gauges(deck.deck, target)  # points of the material are those of the first state
    state, step = find_restart_point(old, at, say)
    restore(source, state, old, step)
    before_rows = _read_history(old, step)
    with patience(quiet):
        blocks = take_over(source, target)
    if gauges is not None:
        gauges.set_state(state, other_cells=True)
    directory = create_directory(output, deck.label, force)
    write_atomically(directory.deck, deck.to_toml())  # by which the directory is known
    columns = None
    if before_rows.columns is not None:
        write_rows(directory.history, before_rows.columns, before_rows.rows)
        columns = truncate_history(directory.history, step)
    words = "; ".join(
        f"{block.name} {_format_cells(block.before)} -> {_format_cells(block.now)}"
        for block in blocks
    )
    slivers = sum(block.slivers.count for block in blocks)
    note = f"goes on from step {step} of {old} on other cells: {words}"
    if slivers:
        note += f"; cells with slivers between the outlines: {slivers}"
    directory.note(note)
    if not quiet:
        say(f"{deck.problem} in {directory} {note}")
    if target.finished:
        say(
            f"this run has finished ({target.finished}): its end is laid on the other cells; "
            f"--set run.t_end=T with T > {target.t:.6g} goes on"
        )
    runner = Runner(deck, directory, deck.make_problem(), target, quiet, gauges=gauges)
    if columns is not None and is_provisional(columns):
        before = [(number, text) for number, text in before_rows.rows if number < step]
        runner.first_rows = list_texts(columns, before)
    else:
        runner.columns = columns
    return runner


def _add_cells(before: ReadDeck, cells: str | None, settings: tuple[str, ...]) -> tuple[str, ...]:
    """The settings with the cells among them; BadInput where the deck or a restart has no such."""
    check_changeable(settings, type(before.deck), besides=(KEY,))
    present = getattr(before.deck, KEY, None)
    if present is None:
        raise BadInput(
            f"--cells: the deck of {before.problem} has no key `{KEY}`, so its grid cannot be "
            "changed in a restart; begin a new run"
        )
    if cells is None:
        return settings
    if any(_get_key(setting) == KEY for setting in settings):
        raise BadInput("--cells and --set cells say the same; give one of them")
    many = [parse_value(word) for word in cells.split(",")]
    if not all(type(number) is int and number > 0 for number in many):
        raise BadInput(f"--cells {cells}: the form is N or N,M, whole numbers such as 64")
    wanted = len(present) if isinstance(present, list | tuple) else 1
    if len(many) != wanted:
        numbers = "one number" if wanted == 1 else f"{wanted} numbers"
        raise BadInput(f"--cells {cells}: the key `{KEY}` of {before.problem} is {numbers}")
    return (*settings, f"{KEY}={cells if wanted == 1 else list(many)}")


def _get_key(setting: str) -> str:
    return setting.partition("=")[0].strip()


def _check_apart(old: RunDirectory, output: str | None) -> None:
    """The new directory is not the old one, nor inside it; BadInput otherwise."""
    if output:
        new, kept = RunDirectory(output).path.resolve(), old.path.resolve()
        if new == kept or kept in new.parents:
            raise BadInput(
                f"-o {output} is the run that is gone on with, which stays as it is; name another "
                "directory"
            )


def _is_flow(evolution: object) -> bool:
    return type(evolution) is Simulation  # one of a class of its own holds more


def _build(deck: ReadDeck, quiet: bool) -> Evolution:
    """The first state of a deck's problem."""
    problem = deck.make_problem()
    with patience(quiet), deck.numbers_in_reach():
        check_memory(problem)
        return problem.build()


def _read_history(old: RunDirectory, step: int) -> Rows:
    """The old run's history; BadInput where it is damaged or ends before the restart point."""
    found = read_rows(old.history)
    found.check(f"shockgrid restart {old.quoted} makes of it what can be made")
    if found.rows and found.last < step:
        raise BadInput(
            f"{old.history} ends at step {found.last}, before the restart point of step {step}; "
            "choose an earlier one with --at"
        )
    return found


def _format_cells(cells: tuple[int, int]) -> str:
    return f"{cells[0]} x {cells[1]}"
