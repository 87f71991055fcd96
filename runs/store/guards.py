"""What does not fit together in a run's directory: its deck, closing screen, history and dumps.

The log notes the digest of the deck at each start, and that of the closing screen at each end; a
file that has none of the noted digests was edited or damaged.  Of a deck the dumps are the judge:
the log itself is guarded by nothing.  Directories from before these notes are taken as they are.
"""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from regrid.errors import BadInput
from regrid.text_files import cut
from runs.store.directory import RunDirectory
from runs.store.dumps import open_dump
from runs.store.history_rows import Rows, read_rows
from runs.store.provenance import hash_deck

NOTED = 16  # digits of a digest that the log has
DECK = re.compile(r"deck: SHA-256 ([0-9a-f]{16})")
SUMMARY = re.compile(r"summary\.txt: SHA-256 ([0-9a-f]{16})")
SHOWN = 3


def note_summary(directory: RunDirectory, screen: str) -> None:
    """Note the digest of a closing screen in the log, before it is written."""
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
    found = read_stored_deck(directory)
    if text is not None and found is not None and _is_same(text, found.text):
        return (
            f"{directory.log} has no start with the digest of {directory.deck.name}, whose keys "
            f"are those in {found.path.name}: the log was edited or damaged, the deck is taken"
        )
    told = "" if text is None or found is None else describe_changes(text, found.text)
    way = "no dump that can be read has it"
    if found is not None:
        way = (
            f"the last dump has it: shockgrid info --deck {shlex.quote(str(found.path))} > "
            f"{shlex.quote(str(directory.deck))}"
        )
    raise BadInput(
        f"{directory.deck} is not as it was written{told}; set it right ({way}), and change keys "
        "with restart --set, or with --set in a new run"
    )


def _is_same(text: str, stored: str) -> bool:
    """Have two decks the same keys and values?"""
    try:
        return text == stored or tomllib.loads(text) == tomllib.loads(stored)
    except tomllib.TOMLDecodeError:
        return False


def check_summary(directory: RunDirectory) -> str:
    """Raise BadInput where summary.txt is no closing screen that the log knows; else ""."""
    noted = _find_digests(directory, SUMMARY)
    if not noted or not directory.summary.exists():
        return ""
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
    if not found.faults and 0 < last and found.last < last:
        if not directory.history.exists():
            found.faults.append(f"is missing, while the dumps go to step {last}")
        elif not found.rows:
            found.faults.append(f"is empty, while the dumps go to step {last}")
        else:
            found.faults.append(f"ends at step {found.last}, the dumps go to step {last}")
    return found


def _find_digests(directory: RunDirectory, pattern: re.Pattern[str]) -> set[str]:
    try:
        return set(pattern.findall(directory.log.read_text(encoding="utf-8", errors="replace")))
    except OSError:
        return set()


def describe_changes(text: str, stored: str) -> str:
    """Keys of two decks that differ, in words; "" where one is no TOML."""
    try:
        now, was = (dict(_flatten(tomllib.loads(words))) for words in (text, stored))
    except tomllib.TOMLDecodeError:
        return ""
    names = [name for name in {**was, **now} if now.get(name) != was.get(name)]
    told = [f"{n} is {_show(n, now)}, was {_show(n, was)}" for n in names[:SHOWN]]
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f" ({'; '.join(told)}{more})" if told else ""


def _show(name: str, table: Mapping[str, Any]) -> str:
    """A value of a deck, cut where it is long: texts in quotes, so that an empty one is seen."""
    if name not in table:
        return "missing"
    return cut(json.dumps(table[name], ensure_ascii=False, default=str))


def _flatten(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value
