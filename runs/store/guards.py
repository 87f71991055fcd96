"""What does not fit together in a run's directory: its deck, summary, verdict and dumps.

The log notes the digest of the deck at each start, and those of summary and verdict at each end; a
file that has none of the noted digests was edited or damaged.  Of a deck the dumps are the judge:
the log itself is guarded by nothing.
"""

from __future__ import annotations

import hashlib
import json
import re
import shlex
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from problems.problem_file import ProblemFile, compute_digest, is_problem_file, read_problem_file
from problems.registry import is_problem, load_problem
from regrid.errors import BadInput
from runs.deck.checking import find_changes, show
from runs.deck.reading import ReadDeck, read_toml, resolve_deck
from runs.store.directory import RunDirectory
from runs.store.dumps import open_dump
from runs.store.files import write_atomically
from runs.store.provenance import NOTED, hash_deck

SHOWN = 3


def write_noted(directory: RunDirectory, path: Path, text: str) -> None:
    """Write a file of the run whose digest the log notes first; see `is_noted`."""
    directory.note(f"{path.stem}: SHA-256 {hash_deck(text)[:NOTED]}")
    write_atomically(path, text)


def is_noted(directory: RunDirectory, path: Path) -> bool:
    """Has a file one of the digests that the log has noted of it?  True where it has none."""
    try:
        log = directory.log.read_text(encoding="utf-8", errors="replace")
        noted = re.findall(rf"\b{path.stem}: SHA-256 ([0-9a-f]{{{NOTED}}})", log)
        return not noted or hashlib.sha256(path.read_bytes()).hexdigest()[:NOTED] in noted
    except OSError:  # told of where it is read
        return True


def check_deck(directory: RunDirectory) -> str:
    """Raise BadInput where deck.toml is neither the deck of a start nor that of the last dump.

    Key by key the dump is the judge, since its checksum guards it.  Returns a sentence where it
    says that the deck is right and the log knows it not; "" where all agree.
    """
    if is_noted(directory, directory.deck):
        return ""
    found, told, way = read_stored_deck(directory), "", "no dump that can be read has it"
    if found is not None:
        text = directory.deck.read_text(encoding="utf-8", errors="replace")
        differences = _find_changes(text, found.text)
        if differences == []:
            return (
                f"{directory.log} has no start with the digest of {directory.deck.name}, whose "
                f"keys are those in {found.path.name}: the log was edited or damaged, the deck is "
                "taken"
            )
        if differences:
            more = f" and {len(differences) - SHOWN} more" if len(differences) > SHOWN else ""
            told = f" ({'; '.join(differences[:SHOWN])}{more})"
        way = (
            f"the last dump has it: shockgrid info --deck {shlex.quote(str(found.path))} > "
            f"{shlex.quote(str(directory.deck))}"
        )
    raise BadInput(
        f"{directory.deck} is not as it was written{told}; set it right ({way}), and change keys "
        "with restart --set, or with --set in a new run"
    )


def _find_changes(text: str, stored: str) -> list[str] | None:
    """Keys of two decks that differ, in words; None where one is no TOML."""
    try:
        was, now = tomllib.loads(stored), tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None
    told = [(one.key, _show(one.now), _show(one.before)) for one in find_changes(was, now)]
    return [f"{key} is {new}, was {old}" for key, new, old in told]


def _show(value: Any) -> str:
    return "missing" if value is None else show(value)


def check_summary(directory: RunDirectory) -> str:
    """Raise BadInput where summary.txt is no summary that the log knows; else ""."""
    if not is_noted(directory, directory.summary):
        raise BadInput(f"{directory.summary} is not as it was written: edited or damaged")
    return ""


@dataclass(frozen=True)
class StoredDeck:
    """The deck in a dump: its text, the file it is from, the end time [s] of the run then."""

    text: str
    path: Path
    t_end: float


def read_stored_deck(directory: RunDirectory, at: int | None = None) -> StoredDeck | None:
    """The deck of the last dump that can be read, or of step `at`; None where there is none."""
    for step, path in reversed(directory.list_points()):
        if at is not None and step != at:
            continue
        try:
            with open_dump(path) as file:
                return StoredDeck(str(file.attrs["deck"]), path, float(file.attrs["t_end"]))
        except (BadInput, KeyError, OSError):  # told of where its state is read
            continue
    return None


def keep_problem_file(directory: RunDirectory, file: ProblemFile) -> None:
    """Copy a problem's file into the directory of its run, with its place and digest."""
    if file.path.resolve() == directory.problem_copy.resolve():
        return  # a run that goes on with its copy
    note = {"file": str(file.path.resolve()), "sha256": file.digest}
    write_atomically(directory.problem_note, json.dumps(note, indent=1) + "\n")
    write_atomically(directory.problem_copy, file.text)


def read_run_deck(
    directory: RunDirectory,
    settings: tuple[str, ...] = (),
    strict: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> ReadDeck:
    """The checked deck of a run, `settings` laid over it.

    strict: for going on; raises BadInput where the problem's file is no longer as it was.  say: is
    then given what is wrong with the log alone.  Raises BadInput, too, for a deck or a
    kept file that cannot be read.
    """
    if strict and (fault := check_deck(directory)):
        say(fault)
    table = read_toml(directory.deck)
    file = None
    if is_problem_file(table.get("problem")):
        file = _read_kept(directory, strict)
    elif is_problem(table.get("problem")):
        table = {**load_problem(table["problem"]).Deck.absent, **table}
    return resolve_deck(table, str(directory.deck), settings, file)


def _read_kept(directory: RunDirectory, strict: bool) -> ProblemFile:
    """The file of the problem of a run: where it was, if it is as it was, else the copy."""
    try:
        note = json.loads(directory.problem_note.read_text(encoding="utf-8"))
        place, digest = Path(note["file"]), str(note["sha256"])
        copy = compute_digest(directory.problem_copy.read_bytes())
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise BadInput(
            f"{directory}: {directory.problem_copy.name} or {directory.problem_note.name}, which "
            "store the file of its problem, is missing or damaged; start it again: shockgrid run "
            f"PROBLEM_FILE -o {directory.quoted} --force"
        ) from error
    if copy != digest:
        raise BadInput(
            f"{directory.problem_copy} has changed since the run started; it was the copy of the "
            "file of the problem, which is lost"
        )
    if place.is_file() and compute_digest(place.read_bytes()) == digest:
        return read_problem_file(place)
    if strict and place.is_file():
        raise BadInput(
            f"{place} has changed since the run in {directory} started, and a run continues only "
            f"with the same file: restore it from {directory.problem_copy}, or start a new run"
        )
    return read_problem_file(directory.problem_copy, name=place.name, beside=place.parent)


def write_verdict(directory: RunDirectory, verdict: dict[str, Any]) -> None:
    """Write a verdict; numbers that are not finite become null, which JSON has."""
    plain = msgspec.json.encode(verdict, enc_hook=lambda value: value.item())
    text = msgspec.json.format(plain, indent=1).decode("utf-8")
    write_noted(directory, directory.verdict, text + "\n")


def read_verdict(directory: RunDirectory) -> dict[str, Any] | None:
    """The verdict of a run; None where it has not ended, or was ended by force.

    Raises BadInput for a file that is not as it was written.
    """
    path = directory.verdict
    if not path.exists():
        return None
    if not is_noted(directory, path):
        raise BadInput(f"{path} is not as it was written: edited or damaged")
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise BadInput(f"{path} is damaged: it cannot be read") from error
