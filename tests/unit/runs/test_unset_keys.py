"""What `check` prints: every key of a deck, those without a value as comments; still that deck."""

from __future__ import annotations

import re
import tomllib

import msgspec
import pytest

from runs.deck.reading import read_deck
from runs.deck.unset import describe_unset


def list_keys(value, prefix=""):
    """Dotted keys of everything in a nested table, and those of them that have no value."""
    keys = {}
    if isinstance(value, list | tuple):
        value = {str(k): entry for k, entry in enumerate(value)}
    for name, entry in value.items():
        keys[prefix + name] = entry
        if isinstance(entry, dict) or (isinstance(entry, list | tuple) and entry):
            keys |= list_keys(entry, f"{prefix}{name}.")
    return keys


@pytest.mark.parametrize(
    "name", ["interface-instability-modes", "blocks-gas-gun", "plate-on-wedge", "riemann-captured"]
)
def test_every_key_without_a_value_is_told(name):
    read = read_deck(name)
    told = describe_unset(read.deck)
    keys = dict(re.findall(r"^# (\S+): (.+)$", told, re.MULTILINE))
    missing = {key for key, value in list_keys(msgspec.to_builtins(read.deck)).items()
               if value is None}  # fmt: skip
    assert missing and missing <= set(keys)
    assert all(len(words) > 5 for words in keys.values())
    assert max(map(len, told.splitlines())) <= 100
    assert tomllib.loads(read.to_toml() + told) == tomllib.loads(read.to_toml())
    # a key that is given is told no more
    assert "run.max_steps" in keys
    given = read_deck(name, ("run.max_steps=3",))
    assert "# run.max_steps:" not in describe_unset(given.deck)
