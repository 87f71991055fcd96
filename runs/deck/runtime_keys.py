"""What a restart may change of a deck: the keys that its tables name as `runtime`.

All other keys say from what a run starts, and what drives it.  Decks are compared key by key, with
every default written out, so that a deck changed by hand is found as a setting is.

The trap: a file that moved is the same file.  Where a deck keeps digests of the files that it
names, two names of one digest are no difference.
"""

from __future__ import annotations

import typing
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec

from problems.deck import Deck, DeckTable

DIGESTS = "digests"


@dataclass(frozen=True)
class Difference:
    """A dotted key of two decks with both its values; None where a deck leaves it out."""

    key: str
    before: Any
    now: Any


def find_tables(kind: type[DeckTable], prefix: str = "") -> Iterator[tuple[str, type[DeckTable]]]:
    """Each table class in a deck `kind` with the dotted key of the table; "" for the deck."""
    yield prefix, kind
    for field in msgspec.structs.fields(kind):
        key = f"{prefix}.{field.name}" if prefix else field.name
        for inner in _find_table_types(field.type):
            yield from find_tables(inner, key)


def _find_table_types(kind: Any) -> Iterator[type[DeckTable]]:
    if isinstance(kind, type) and issubclass(kind, DeckTable):
        yield kind
    for inner in typing.get_args(kind):
        yield from _find_table_types(inner)


def list_runtime_keys(kind: type[Deck]) -> list[str]:
    """The dotted keys of a deck `kind` that a restart may change, the deck's own first."""
    return [
        f"{key}.{name}" if key else name
        for key, table in find_tables(kind)
        for name in table.runtime
    ]


def describe_runtime_keys(kind: type[Deck]) -> str:
    """The same in words for a sentence: `kct_end, run.t_end, ..., output.*`."""
    words = []
    for key, table in find_tables(kind):
        whole = len(table.runtime) == len(table.__struct_fields__)
        names = ["*"] if key and whole else table.runtime
        words += [f"{key}.{name}" if key else name for name in names]
    return ", ".join(words)


def is_runtime_key(key: str, kind: type[Deck]) -> bool:
    """May a restart change the dotted `key`, or all that is in it?"""
    allowed = list_runtime_keys(kind)
    if any(key == one or key.startswith(f"{one}.") for one in allowed):
        return True
    tables = {name: table for name, table in find_tables(kind) if name}
    return key in tables and set(tables[key].runtime) == set(tables[key].__struct_fields__)


def find_differences(before: Deck, now: Deck) -> list[Difference]:
    """Where two decks of one problem differ, by the order of the keys of `before`."""
    one, two = msgspec.to_builtins(before), msgspec.to_builtins(now)
    known = [table.pop(DIGESTS, None) or {} for table in (one, two)]
    return [
        found for found in _walk(one, two, "") if not _is_same_file(found.before, found.now, *known)
    ]


def _walk(before: Any, now: Any, key: str) -> Iterator[Difference]:
    if isinstance(before, dict) and isinstance(now, dict):
        for name in dict.fromkeys((*before, *now)):
            inner = f"{key}.{name}" if key else name
            yield from _walk(before.get(name), now.get(name), inner)
    elif isinstance(before, list | tuple) and isinstance(now, list | tuple):
        if len(before) != len(now) or not any(isinstance(one, dict) for one in before):
            if list(before) != list(now):
                yield Difference(key, before, now)
            return
        for place, (one, two) in enumerate(zip(before, now, strict=True)):
            yield from _walk(one, two, f"{key}.{place}")
    elif before != now:
        yield Difference(key, before, now)


def _is_same_file(before: Any, now: Any, known: dict[str, str], known_now: dict[str, str]) -> bool:
    if not (isinstance(before, str) and isinstance(now, str) and before in known):
        return False
    return known[before] == known_now.get(now)
