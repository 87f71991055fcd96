"""What a run that ended early leaves behind: sentence, meaning, what has helped, a picture.

Nothing that goes wrong in here may hide the sentence: each part is made by itself, and one that
cannot be made is told of in its place.
"""

from __future__ import annotations

import shlex
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from regrid.errors import BadInput, RunFailure
from runs.deck.reading import ReadDeck, resolve_deck
from runs.deck.runtime_keys import is_runtime_key
from runs.early_end.causes import CAUSES, settings_for
from runs.store.directory import RunDirectory
from runs.store.dumps import has_state
from runs.store.files import write_atomically
from runs.store.history import read_history

CALM = 0.3  # of the usual dt: with less a run is in trouble already
SHOWN = 3  # settings


@dataclass(frozen=True)
class EarlyEnd:
    """What was left of a run that ended early; None and () for what could not be made.

    picture: path of early-end.png; point: step of the restart point to go back to; settings: words
    for `--set`, the best first; commands: one for each of them; lines: all of it as words.
    """

    directory: Path
    cause: str
    picture: Path | None = None
    point: int | None = None
    settings: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()


def explain(failure: RunFailure, directory: RunDirectory, deck: ReadDeck, restart: str) -> EarlyEnd:
    """Write early-end.png and early-end.txt into `directory`, whose last dump shows the end.

    restart: the command that goes on with the run.  The failure gets what was made as its
    `early_end`, and the words as its notes.  Raises nothing that is an Exception.
    """
    lines, made = [], {}
    cause = CAUSES.get(failure.cause)
    if cause is not None:
        lines.append(f"what it means: {cause.means.replace('`', '')}")
    for part in (_tell_event, _choose_point, _choose_settings, _draw):
        try:
            lines += part(failure, directory, deck, restart, made)
        except Exception as error:  # whatever it is: the sentence comes first
            told = str(error).partition("\n")[0] or type(error).__name__
            lines.append(f"{FAILED[part.__name__]}: {told}")
    if cause is not None and cause.advice:
        lines.append(f"what else can be done: {cause.advice.replace('`', '')}")
    early_end = EarlyEnd(directory.path, failure.cause, **made, lines=tuple(lines))
    failure.early_end = early_end
    for line in lines:
        failure.add_note(line)
    try:
        write_atomically(directory.early_words, "\n".join([str(failure), *lines]) + "\n")
    except (BadInput, OSError):
        pass
    return early_end


FAILED = {
    "_tell_event": "the outlines could not be measured",
    "_choose_point": "no restart point could be chosen",
    "_choose_settings": "settings that have helped could not be looked up",
    "_draw": "no picture of the place could be made",
}


def _tell_event(failure, directory, deck, restart, made) -> list[str]:
    from runs.early_end.event import describe_event
    from runs.store.reader import RunData

    outputs = RunData(directory.path).outputs
    event = describe_event(outputs[-1].blocks, failure.place) if outputs else ""
    return [f"what happened there: {event}"] if event else []


def _choose_point(failure, directory, deck, restart, made) -> list[str]:
    made["point"] = find_calm_point(directory)
    return []


def _choose_settings(failure, directory, deck, restart, made) -> list[str]:
    found = list_settings(failure.cause, deck)[:SHOWN]
    made["settings"] = tuple(setting for setting, _ in found)
    made["commands"] = tuple(
        make_command(setting, directory, deck, restart, made.get("point"))
        for setting in made["settings"]
    )
    lines = ["what has helped in such runs:"] if found else []
    for (_, words), command in zip(found, made["commands"], strict=True):
        lines.append(f"  {command}   ({words})")
    return lines


def _draw(failure, directory, deck, restart, made) -> list[str]:
    from runs.early_end.picture import draw_early_end
    from runs.store.reader import RunData

    sentence = str(failure).partition("; last restart point is")[0]
    sentence = sentence.partition("; there is no restart point yet")[0]
    picture = draw_early_end(RunData(directory.path), sentence, failure.place, made.get("point"))
    made["picture"] = picture
    return [f"picture of the place: {picture}"]


def find_calm_point(directory: RunDirectory) -> int | None:
    """Step of the last restart point from before the trouble; None where there is none at all.

    Trouble begins after the last step that was not begun anew and had CALM of the usual dt.  Where
    all points are later, the first of them.
    """
    points = []
    for step, path in directory.list_points():
        try:
            points += [step] if has_state(path) else []
        except BadInput:  # torn
            continue
    if not points:
        return None
    history = read_history(directory.history)
    steps, dt = history.get("step"), history.get("dt")
    if steps is None or dt is None or len(steps) < 2:
        return points[-1]
    retries = history.get("retries", np.zeros(len(steps)))
    usual = float(np.nanmedian(dt))
    calm = steps[(dt >= CALM * usual) & ~(retries > 0)]
    last = int(calm[-1]) if len(calm) else points[0]
    before = [step for step in points if step <= last and step < int(steps[-1])]
    return before[-1] if before else points[0]


def list_settings(cause: str, deck: ReadDeck) -> list[tuple[str, str]]:
    """(`key=value`, what it does) of the settings of a cause that this deck can take."""
    found = []
    for setting in settings_for(cause):
        value = setting.choose(_look_up(deck.deck, setting.key))
        if value is None:
            continue
        words = f"{setting.key}={value}"
        try:
            table = tomllib.loads(deck.to_toml())
            resolve_deck(table, deck.origin, (words,), deck.file).make_problem()
        except BadInput:  # not for this problem, or with this deck
            continue
        found.append((words, setting.words))
    return found


def make_command(
    setting: str, directory: RunDirectory, deck: ReadDeck, restart: str, point: int | None
) -> str:
    """The command that goes on, or begins anew, with a setting."""
    words = f"--set {shlex.quote(setting)}"
    if not restart.startswith("shockgrid "):  # by a script: blocks of one's own
        return f"{restart}, with {setting}"
    if is_runtime_key(setting.partition("=")[0], type(deck.deck)) and point is not None:
        return f"{restart} --at {point} {words}"
    return f"shockgrid run {shlex.quote(str(directory.deck))} {words}"


def _look_up(deck: Any, key: str) -> Any:
    """The value of a dotted key; None where the deck has no such key, or none is set."""
    value = msgspec.to_builtins(deck)
    for name in key.split("."):
        value = value.get(name) if isinstance(value, dict) else None
    return value
