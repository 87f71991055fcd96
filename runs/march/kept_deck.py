"""The deck that a restart marches with, beside the one that its restart point was written with.

What shapes the state stays as it was.  An end that moves moves nothing else: lengths and motions
that a problem makes for its end time are made for the old one, which `run.t_set_up` keeps.
"""

from __future__ import annotations

import dataclasses
import tomllib
from typing import Any

import msgspec

from regrid.errors import BadInput
from runs.deck.checking import show
from runs.deck.reading import ReadDeck, resolve_deck
from runs.deck.runtime_keys import (
    Difference,
    find_differences,
    is_runtime_key,
)
from runs.store.directory import RunDirectory
from runs.store.guards import StoredDeck, read_stored_deck

CELLS = "cells"
SET_UP = "run.t_set_up"


def settle_deck(
    directory: RunDirectory, deck: ReadDeck, at: int | None = None, cells: bool = False
) -> ReadDeck:
    """The deck that a restart from `directory` marches with: `deck`, with run.t_set_up if it needs.

    at: step of the restart point, None the last; cells: may the key `cells` differ?  Raises
    BadInput where `deck` is one of another state than the dump's.
    """
    kept = read_stored_deck(directory, at)
    if kept is None:
        return deck
    before = _resolve_kept(kept, deck)
    if before is None:
        return deck
    if before.problem != deck.problem and not deck.file:
        raise BadInput(
            f"{directory.deck}: problem = {show(deck.problem)}, and {kept.path.name} holds a run "
            f"of {before.problem}; another problem is another run (shockgrid run)"
        )
    found = find_differences(before.deck, deck.deck)
    refused = [one for one in found if not is_runtime_key(one.key, type(deck.deck))]
    refused = [one for one in refused if one.key != SET_UP and not (cells and one.key == CELLS)]
    if refused:
        raise BadInput("\n".join(_refuse(one, directory, deck, kept) for one in refused))
    return _keep_set_up(found, before, deck, directory, kept)


def _resolve_kept(kept: StoredDeck, deck: ReadDeck) -> ReadDeck | None:
    """The dump's deck; None where another version wrote it with keys that are none now."""
    try:
        return resolve_deck(tomllib.loads(kept.text), str(kept.path), file=deck.file)
    except (BadInput, tomllib.TOMLDecodeError):
        return None


def _refuse(found: Difference, directory: RunDirectory, deck: ReadDeck, kept: StoredDeck) -> str:
    key = found.key
    ours = any(setting.partition("=")[0].strip() == key for setting in deck.settings)
    where = "--set" if ours else str(directory.deck)
    way = "begin a new run with it (shockgrid run)"
    if key == CELLS:
        way = f"shockgrid restart {directory.quoted} --cells {found.now} goes on with other cells"
    return (
        f"{where}: {key} is {_say(found.now)}, and {_say(found.before)} in {kept.path}: it shapes "
        f"the state, so a restart keeps it; {way}"
    )


def _say(value: Any) -> str:
    return "left out" if value is None else show(value)


def _keep_set_up(
    found: list[Difference],
    before: ReadDeck,
    deck: ReadDeck,
    directory: RunDirectory,
    kept: StoredDeck,
) -> ReadDeck:
    """The deck with the time that the run was set up for, where its end is another one now."""
    made_for = before.deck.run.t_set_up or kept.t_end
    run = deck.deck.run
    if run.t_set_up is not None:
        if run.t_set_up != made_for:
            raise BadInput(
                f"{SET_UP} is {run.t_set_up!r}, and the run in {directory} was set up for "
                f"{made_for!r} s: it shapes the state, so a restart keeps it; leave it out, or "
                "begin a new run with it (shockgrid run)"
            )
        return deck
    moves = [one for one in found if one.key == "run.t_end" or "." not in one.key]
    if not moves and before.deck.run.t_set_up is None:
        return deck
    run = msgspec.structs.replace(run, t_set_up=made_for)
    return dataclasses.replace(deck, deck=msgspec.structs.replace(deck.deck, run=run))
