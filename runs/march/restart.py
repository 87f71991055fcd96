"""Going on with a run: its restart point, its deck, its history.

Of the deck, what shapes the state stays as it was.  An end that moves moves nothing else: lengths
and motions that a problem makes for its end time are made for the old one, which `run.t_set_up`
keeps.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from problems.evolution import Evolution, take_cells
from regrid.errors import BadInput
from runs.deck.checking import Difference, find_differences, is_runtime_key, show
from runs.deck.reading import ReadDeck, resolve_deck
from runs.store.directory import RunDirectory
from runs.store.dumps import has_state, open_dump, read_state
from runs.store.guards import StoredDeck, read_stored_deck
from runs.store.history import Rows, read_rows


def find_restart_point(
    directory: RunDirectory, at: int | None, say=lambda text: None, tables: Sequence[Path] = ()
) -> tuple[dict[str, Any], int, list[Rows]]:
    """State and step of the last restart point that can be read, or of step `at`; rows of `tables`.

    tables: the history, and the table of gauges of a deck that has some.  Where one of them is
    damaged, or ends before a point, the point is one from before that; at step 0 they start again.
    """
    points = [entry for entry in directory.list_points() if not is_light(entry[1])]
    newest = points[-1][0] if points else 0
    found = [read_rows(path, newest) for path in tables]
    if at is not None:
        steps = ", ".join(str(step) for step in sorted({step for step, _ in points})) or "none"
        points = [entry for entry in points if entry[0] == at]
        if not points:
            raise BadInput(f"{directory} has no restart point of step {at}; there are: {steps}")
    for step, path in reversed(points):
        try:
            for rows in found:
                _drop_foreign(rows, step, path)
            behind = [rows for rows in found if step and rows.last < step]
            if not behind:
                return read_state(path), step, found
            if at is not None:
                behind[0].check("choose an earlier restart point with --at")
        except BadInput as error:
            if at is not None:
                raise
            say(f"skipped: {error}")
    if not directory.list_points():
        raise BadInput(
            f"nothing was computed yet in {directory}, so there is nothing to continue; start it "
            f"again: shockgrid run {directory.quoted}/deck.toml -o {directory.quoted} --force"
        )
    for rows in found:
        rows.check("no restart point is earlier; start the run again")
    raise BadInput(f"{directory} has no readable restart point; start the run again")


def _drop_foreign(rows: Rows, step: int, path: Path) -> None:
    """Trust no row where that of the dump at `path` has another time than the dump itself."""
    text = dict(rows.rows).get(step)
    if text is None or rows.columns is None or "t" not in rows.columns:
        return
    with open_dump(path) as file:
        t = float(file.attrs["t"])
    if float(text.split(",")[rows.columns.index("t")]) != t:
        rows.rows, rows.columns = [], None
        rows.fault = f"has a row of step {step} that is not of t = {t:.6g} s"


def is_light(path: Path) -> bool:
    """Is the dump at `path` one without a state?"""
    try:
        return not has_state(path)
    except BadInput:  # torn: told of when it is read
        return False


def restore(
    evolution: Evolution, state: dict[str, Any], directory: RunDirectory, step: int
) -> None:
    """Give `state` to a freshly built evolution; BadInput where the two do not fit."""
    take_cells(evolution, state)
    expected = evolution.get_state()
    missing = sorted(set(expected) - set(state))
    if missing:
        raise BadInput(
            f"the restart point of step {step} in {directory} was written by another version: "
            f"it lacks {', '.join(missing[:4])}"
        )
    for name, value in expected.items():
        shape, stored = np.shape(value), np.shape(state[name])
        if shape != stored:
            raise BadInput(
                f"the restart point of step {step} in {directory} has {name} of shape {stored}, "
                f"with this deck it would be {shape}: the deck's changes change the grid; "
                "begin a new run instead"
            )
    evolution.set_state(state)
    if evolution.step != step:
        raise BadInput(f"the restart point of step {step} holds step {evolution.step}")


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
    run, made_for = deck.deck.run, before.deck.run.t_set_up or kept.t_end
    found = find_differences(before.deck, deck.deck)
    refused = [one for one in found if not is_runtime_key(one.key, type(deck.deck))]
    may_differ = {CELLS} if cells else set()
    if run.t_set_up in (None, made_for):
        may_differ.add(SET_UP)
    refused = [one for one in refused if one.key not in may_differ]
    if refused:
        raise BadInput("\n".join(_refuse(one, directory, deck, kept) for one in refused))
    moves = [one for one in found if one.key == "run.t_end" or "." not in one.key]
    if run.t_set_up is not None or not (moves or before.deck.run.t_set_up):
        return deck
    run = msgspec.structs.replace(run, t_set_up=made_for)
    return dataclasses.replace(deck, deck=msgspec.structs.replace(deck.deck, run=run))


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
    way = "start a new run with it (shockgrid run)"
    if key == CELLS:
        way = f"shockgrid restart {directory.quoted} --cells {found.now} continues on other cells"
    return (
        f"{where}: {key} is {_say(found.now)}, and {_say(found.before)} in {kept.path}: it affects "
        f"the state, so a restart cannot change it; {way}"
    )


def _say(value: Any) -> str:
    return "left out" if value is None else show(value)
