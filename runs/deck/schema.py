"""The JSON schema of a problem's deck: completion and checking in editors that know TOML.

Defaults made by factories are not seen by msgspec; they are filled in from the default deck.
"""

from __future__ import annotations

import json
from typing import Any

import msgspec

from problems.registry import load_problem, read_docstring
from runs.deck.runtime_keys import find_tables

RUNTIME, MAY_CHANGE = "x-restart", "may change"  # marks keys in a schema; editors pass it over


def make_schema(problem: str) -> dict[str, Any]:
    """The schema of the decks of `problem` as a plain dict, ready for json."""
    schema = make_parts(load_problem(problem).Deck)
    schema["properties"] = {
        "problem": {"const": problem, "description": "the problem this deck is for"},
        **schema["properties"],
    }
    head = {
        "title": f"shockgrid deck: {problem}",
        "description": read_docstring(problem).split("\n\n")[0].strip(),
        "required": ["problem"],
    }
    parts = schema.pop("$defs")
    for _, table in find_tables(load_problem(problem).Deck):
        for name in table.runtime:
            parts.get(table.__name__, schema)["properties"][name][RUNTIME] = MAY_CHANGE
    return {**schema, **head, "$defs": parts}


def make_parts(kind: type) -> dict[str, Any]:
    """The schema of a deck's own fields, without the key problem, by which decks are checked."""
    (outline,), parts = msgspec.json.schema_components([kind], ref_template="#/$defs/{name}")
    name = outline["$ref"].rsplit("/", 1)[-1]
    root = parts.pop(name)
    root, parts = _without_null(root), _without_null(parts)
    needed = any(field.required for field in msgspec.structs.fields(kind))
    default = {} if needed else _without_null(msgspec.to_builtins(kind()))
    for key, value in default.items():
        entry = root["properties"][key]
        if "default" not in entry:
            entry["default"] = value
    return {"$schema": "http://json-schema.org/draft-07/schema#", **root, "$defs": parts}


def _without_null(part: Any) -> Any:
    """The same with every null left out: TOML has no word for it, a key is left out instead.

    Lists of fixed length are written the way draft 7 has them, which editors know.
    """
    if isinstance(part, list):
        return [_without_null(entry) for entry in part]
    if not isinstance(part, dict):
        return part
    part = {key: _without_null(value) for key, value in part.items() if value is not None}
    if "prefixItems" in part:
        part["items"] = part.pop("prefixItems")
    choices = [entry for entry in part.pop("anyOf", []) if entry != {"type": "null"}]
    if len(choices) == 1:
        return choices[0] | part
    return part | ({"anyOf": choices} if choices else {})


def schema_text(problem: str) -> str:
    """The schema as JSON text."""
    return json.dumps(make_schema(problem), indent=2, default=str) + "\n"
