"""The keys of a deck that have no value, in words: TOML has none for them.

`shockgrid check` prints them below the deck as comments, so that what it prints is a deck still.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from problems.deck import Deck
from runs.deck.checking import describe, resolve
from runs.deck.schema import make_parts

WIDTH = 100  # of a line
HEAD = "# keys without a value, and what that means or what they could be:"


def describe_unset(deck: Deck) -> str:
    """Comment lines on the keys of a deck without a value; "" where all have one."""
    schema = make_parts(type(deck))
    entries = list(_find_unset(schema, schema, msgspec.to_builtins(deck), ""))
    lines = [HEAD] if entries else []
    for key, words in entries:
        lines += textwrap.wrap(
            f"{key}: {words}", WIDTH, initial_indent="# ", subsequent_indent="#     "
        )
    return "".join(f"{line}\n" for line in (["", *lines] if lines else []))


def _find_unset(
    schema: Mapping[str, Any], part: Mapping[str, Any], value: Any, prefix: str
) -> Iterator[tuple[str, str]]:
    """Dotted keys of a table with their words; the keys of a table that is left out after it."""
    part = resolve(schema, part)
    if isinstance(value, list | tuple) and isinstance(part.get("items"), dict):
        for k, entry in enumerate(value):
            yield from _find_unset(schema, part["items"], entry, f"{prefix}{k}.")
        return
    if not isinstance(value, dict):
        return
    kinds = [resolve(schema, one) for one in part.get("anyOf", ())]  # of several kinds of tables
    part = next((one for one in kinds if value.keys() <= one.get("properties", {}).keys()), part)
    for name, field in part.get("properties", {}).items():
        key, inner = prefix + name, resolve(schema, field)
        if value.get(name) is not None:
            yield from _find_unset(schema, field, value[name], f"{key}.")
            continue
        words = field.get("description", inner.get("description", "")).strip().partition("\n")[0]
        table = "properties" in inner
        yield key, f"{words.rstrip('.')} ({'a table' if table else describe(schema, field)})"
        if table:
            for name_inside, field_inside in inner["properties"].items():
                told = field_inside.get("description", "")
                yield f"{key}.{name_inside}", f"{told} ({describe(schema, field_inside)})"
