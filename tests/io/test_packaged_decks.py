"""Every deck that comes with shockgrid, and every problem's default deck, is a good deck."""

from __future__ import annotations

import json

import msgspec
import pytest

from shockgrid.problems.problem import Problem
from shockgrid.problems.registry import PROBLEMS, load_problem
from shockgrid.runs.deck.checking import check_deck, make_schema
from shockgrid.runs.deck.reading import packaged_decks, read_deck, resolve_deck, to_toml
from shockgrid.runs.inspection.listing import describe_deck

NAMES = tuple(PROBLEMS)


@pytest.mark.parametrize("name", packaged_decks())
def test_packaged_deck(name):
    deck = read_deck(name)
    assert name == deck.problem or name.startswith(deck.problem + "-")
    assert isinstance(deck.make_problem(), Problem)
    path = packaged_decks()[name]
    assert path.read_text().startswith("# "), "the first lines are its description"
    words = describe_deck(path)
    assert 10 < len(words) < 100 and words[-1].isalnum(), "one clause, not cut off"
    assert words.split()[-1] not in ("in", "the", "a", "of", "and", "so", "at", "to")


@pytest.mark.parametrize("name", NAMES)
def test_default_deck(name):
    import tomllib

    kind = load_problem(name).Deck
    text = to_toml(name, kind())
    assert isinstance(read_deck(name).make_problem(), Problem)
    table = tomllib.loads(text)
    again = resolve_deck(dict(table), "again")
    assert to_toml(name, again.deck) == text
    del table["problem"]
    check_deck(table, kind, lambda key: "default")
    assert msgspec.convert(table, kind) is not None


@pytest.mark.parametrize("name", NAMES)
def test_every_key_is_explained(name):
    schema = make_schema(name)
    json.dumps(schema)
    tables = {"": schema, **schema["$defs"]}
    mute = [
        f"{table}.{key}"
        for table, content in tables.items()
        for key, entry in content.get("properties", {}).items()
        if "description" not in json.dumps(entry) and "$ref" not in json.dumps(entry)
        if "const" not in entry and "enum" not in entry
    ]
    assert not mute, f"keys without a description: {mute}"
