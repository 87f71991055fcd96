"""What does not fit together in a run's directory: its deck, summary, history and dumps.

The log notes the digest of the deck at each start, and that of the summary at each end; a
file that has none of the noted digests was edited or damaged.  Of a deck the dumps are the judge:
the log itself is guarded by nothing.  Directories from before these notes are taken as they are.
"""

from __future__ import annotations

import json
import math
import re
import shlex
import tomllib
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from problems.problem_file import ProblemFile, compute_digest, is_problem_file, read_problem_file
from problems.registry import is_problem, load_problem
from regrid.errors import BadInput
from regrid.text_files import cut
from runs.deck.reading import ReadDeck, read_toml, resolve_deck
from runs.store.directory import RunDirectory
from runs.store.dumps import open_dump
from runs.store.files import write_atomically
from runs.store.history import Rows, read_rows
from runs.store.provenance import hash_deck

NOTED = 16  # digits of a digest that the log has
DECK = re.compile(r"deck: SHA-256 ([0-9a-f]{16})")
SUMMARY = re.compile(r"summary\.txt: SHA-256 ([0-9a-f]{16})")
SHOWN = 3


def note_summary(directory: RunDirectory, screen: str) -> None:
    """Note the digest of a summary in the log, before it is written."""
    directory.note(f"summary.txt: SHA-256 {hash_deck(screen)[:NOTED]}")


def check_deck(directory: RunDirectory) -> str:
    """Raise BadInput where deck.toml is neither the deck of a start nor that of the last dump.

    Key by key the dump is the judge, since its checksum guards it.  Returns a sentence where it
    says that the deck is right and the log knows it not; "" where all agree.
    """
    try:
        text = directory.deck.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError):
        text = None
    noted = _find_digests(directory, DECK)
    if not noted or (text is not None and hash_deck(text)[:NOTED] in noted):
        return ""
    found, told, way = read_stored_deck(directory), "", "no dump that can be read has it"
    if found is not None:
        differences = None if text is None else find_changes(text, found.text)
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


def find_changes(text: str, stored: str) -> list[str] | None:
    """Keys of two decks that differ, in words; None where one is no TOML."""
    try:
        now, was = (dict(_flatten(tomllib.loads(words))) for words in (text, stored))
    except tomllib.TOMLDecodeError:
        return None

    def show(name: str, table: Mapping[str, Any]) -> str:
        """Cut where it is long: texts in quotes, so that an empty one is seen."""
        if name not in table:
            return "missing"
        return cut(json.dumps(table[name], ensure_ascii=False, default=str))

    names = [name for name in {**was, **now} if now.get(name) != was.get(name)]
    return [f"{name} is {show(name, now)}, was {show(name, was)}" for name in names]


def _flatten(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def check_summary(directory: RunDirectory) -> str:
    """Raise BadInput where summary.txt is no summary that the log knows; else ""."""
    noted = _find_digests(directory, SUMMARY)
    if noted and directory.summary.exists():
        text = directory.summary.read_bytes().decode("utf-8", "replace")
        if hash_deck(text)[:NOTED] not in noted:
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


def read_rows_beside_dumps(directory: RunDirectory) -> Rows:
    """The rows of the history, with a fault where it ends before the last dump."""
    points = directory.list_points()  # first: the history is ahead of them, also in a live run
    found = read_rows(directory.history)
    last = points[-1][0] if points else 0
    if not found.fault and 0 < last and found.last < last:
        there = f"ends at step {found.last}" if found.rows else "is empty"
        found.fault = f"{there if found.columns else 'is missing'}, the dumps go to step {last}"
    return found


def _find_digests(directory: RunDirectory, pattern: re.Pattern[str]) -> set[str]:
    try:
        return set(pattern.findall(directory.log.read_text(encoding="utf-8", errors="replace")))
    except OSError:
        return set()


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
            "store the file of its problem, is missing or damaged"
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


SUM = "crc32"
KEYS = ("status", "name", "reason", "trust")


def write_verdict(directory: RunDirectory, verdict: dict[str, Any]) -> None:
    """Write a verdict; numbers that are not finite become null, which JSON has."""
    plain = _make_plain(verdict)
    text = json.dumps(plain | {SUM: _sum(plain)}, indent=1, ensure_ascii=False)
    write_atomically(directory.verdict, text + "\n")


def read_verdict(directory: RunDirectory) -> dict[str, Any] | None:
    """The verdict of a run; None where it has not ended, or was ended by force.

    Raises BadInput for a file that is no verdict, or not as it was written.
    """
    path = directory.verdict
    try:
        verdict = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise BadInput(f"{path} is damaged: it cannot be read") from error
    if not isinstance(verdict, dict) or not all(key in verdict for key in KEYS):
        raise BadInput(f"{path} is damaged: a verdict has {', '.join(KEYS)}")
    if verdict.pop(SUM, None) != _sum(verdict):
        raise BadInput(f"{path} is not as it was written: edited or damaged")
    return verdict


def _sum(verdict: dict[str, Any]) -> str:
    text = json.dumps(verdict, sort_keys=True, separators=(",", ":"))
    return f"{zlib.crc32(text.encode('ascii')):08x}"


def remove_verdict(directory: RunDirectory) -> None:
    """Remove the verdict: the run continues."""
    (directory.verdict).unlink(missing_ok=True)


def _make_plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _make_plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_make_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
