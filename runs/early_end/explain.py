"""What a run that ended early leaves behind: sentence, meaning, what has helped, a picture.

Nothing that goes wrong in here may hide the sentence: each part is made by itself, and one that
cannot be made is reported in its place.
"""

from __future__ import annotations

import contextlib
import re
import shlex
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.runs.deck.checking import is_runtime_key
from shockgrid.runs.deck.reading import ReadDeck, resolve_deck
from shockgrid.runs.early_end.causes import ENDS, Cause
from shockgrid.runs.early_end.place import describe_event
from shockgrid.runs.store.directory import RunDirectory
from shockgrid.runs.store.dumps import has_state
from shockgrid.runs.store.files import write_atomically
from shockgrid.runs.store.history import read_history
from shockgrid.runs.store.reader import RunData

CALM_STEP_PART = 0.3  # of the usual dt: with less a run is in trouble already
SHOWN_SETTINGS = 3  # settings


@dataclass
class EarlyEnd:
    """What was left of a run that ended early; None and [] for what could not be made.

    picture: path of early-end.png; point: step of the restart point to go back to; settings: words
    for `--set`, the best first; commands: one for each of them; lines: all of it as words.
    """

    picture: Path | None = None
    point: int | None = None
    settings: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


def explain(failure: RunFailure, directory: RunDirectory, deck: ReadDeck, restart: str) -> EarlyEnd:
    """Write early-end.png and early-end.txt into `directory`, whose last dump shows the end.

    restart: the command that continues the run.  The failure gets what was made as its
    `early_end`, and the words as its notes.  Raises nothing that is an Exception.
    """
    cause = ENDS.get(failure.cause, Cause("", ""))
    place = failure.place
    end = failure.early_end = EarlyEnd()

    def say(head: str, words: str) -> None:
        end.lines += [f"{head}: {words.replace('`', '')}"] if words else []

    def measure() -> None:
        outputs = RunData(directory.path).outputs
        say("what happened there", describe_event(outputs[-1].blocks, place) if outputs else "")

    def choose_point() -> None:
        end.point = find_calm_point(directory)

    def list_commands() -> None:
        settings = list_settings(cause, deck)[:SHOWN_SETTINGS]
        end.settings = [setting for setting, _ in settings]
        end.commands = [make_command(s, directory, deck, restart, end.point) for s in end.settings]
        end.lines += ["what has helped in such runs:"] * bool(settings)
        for command, (_, change) in zip(end.commands, settings, strict=True):
            end.lines.append(f"  {command}   ({change})")

    def draw() -> None:
        from shockgrid.runs.early_end.picture import draw_early_end  # matplotlib may not be there

        title = re.split("; last restart point is|; there is no restart point yet", str(failure))[0]
        end.picture = draw_early_end(RunData(directory.path), title, place, end.point)
        end.lines.append(f"picture of the place: {end.picture}")

    say("what it means", cause.means)
    parts: dict[str, Callable[[], None]] = {
        "the outlines could not be measured": measure,
        "no restart point could be chosen": choose_point,
        "settings that have helped could not be looked up": list_commands,
        "no picture of the place could be made": draw,
    }
    for otherwise, part in parts.items():
        try:
            part()
        except Exception as error:  # whatever it is: the sentence comes first
            say(otherwise, str(error).partition("\n")[0] or type(error).__name__)
    say("what else can be done", cause.advice)
    for line in end.lines:
        failure.add_note(line)
    with contextlib.suppress(BadInput, OSError):
        write_atomically(directory.early_words, "\n".join([str(failure), *end.lines]) + "\n")
    return end


def find_calm_point(directory: RunDirectory) -> int | None:
    """Step of the last restart point from before the trouble; None where there is none at all.

    Trouble begins after the last step that was not retried and had CALM_STEP_PART of the usual dt.
    Where all points are later, the first of them.
    """
    points = []
    for step, path in directory.list_points():
        with contextlib.suppress(BadInput):  # damaged
            points += [step] if has_state(path) else []
    history = read_history(directory.history)
    steps = history.get("step", ())
    dt = history.get("dt")
    if not points or dt is None or len(steps) < 2:
        return points[-1] if points else None
    retried = history.get("retries", np.zeros(len(steps))) > 0
    calm = steps[(dt >= CALM_STEP_PART * float(np.nanmedian(dt))) & ~retried]
    last = min(calm[-1] if len(calm) else points[0], steps[-1] - 1)
    return max((step for step in points if step <= last), default=points[0])


def list_settings(cause: Cause, deck: ReadDeck) -> list[tuple[str, str]]:
    """(`key=value`, what it does) of the settings of a cause that this deck can take."""
    found = []
    for setting in cause.settings:
        present: Any = msgspec.to_builtins(deck.deck)
        for name in setting.key.split("."):
            present = present.get(name) if isinstance(present, dict) else None
        assignment = f"{setting.key}={setting.choose(present)}"
        with contextlib.suppress(BadInput):  # not for this problem, or with this deck
            table = tomllib.loads(deck.to_toml())
            if setting.choose(present) is not None:
                resolve_deck(table, deck.origin, (assignment,), deck.file).make_problem()
                found.append((assignment, setting.words))
    return found


def make_command(
    setting: str, directory: RunDirectory, deck: ReadDeck, restart: str, point: int | None
) -> str:
    """The command that continues, or starts again, with a setting."""
    option = f"--set {shlex.quote(setting)}"
    if not restart.startswith("shockgrid "):  # by a script: blocks of one's own
        return f"{restart}, with {setting}"
    if is_runtime_key(setting.partition("=")[0], type(deck.deck)) and point is not None:
        return f"{restart} --at {point} {option}"
    return f"shockgrid run {shlex.quote(str(directory.deck))} {option}"
