"""Telling what is wrong with a deck in words: unknown keys, wrong types, bounds.

msgspec checks a deck against the types and constraints of its class; where it refuses, the deck is
gone through key by key, so that all mistakes are reported at once, each in a sentence with the full
key, where it was given, the value and what would be right; an unknown key gets the nearest known
one.  The JSON schema that msgspec makes of the same types is for editors, and for the words.
"""

from __future__ import annotations

import json
import math
import re
import textwrap
import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from problems.deck import Deck, DeckTable
from problems.registry import load_problem, read_docstring
from regrid.errors import BadInput, find_nearest

DIGESTS = "digests"
UNIONS = (typing.Union, type(int | str))


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
    """The dotted keys of a deck `kind` that a restart may change, the deck's own first; `output.*`
    stands for a whole table."""
    keys = []
    for key, table in find_tables(kind):
        whole = key and len(table.runtime) == len(table.__struct_fields__)
        names = ["*"] if whole else table.runtime
        keys += [f"{key}.{name}" if key else name for name in names]
    return keys


def is_runtime_key(key: str, kind: type[Deck]) -> bool:
    """May a restart change the dotted `key`, or all that is in it?"""
    allowed = [one.removesuffix(".*") for one in list_runtime_keys(kind)]
    return any(key == one or key.startswith(f"{one}.") for one in allowed)


def find_differences(before: Deck, now: Deck) -> list[Difference]:
    """Where two decks of one problem differ, by the order of the keys of `before`; files that they
    name are the same where their digests are."""
    one, two = msgspec.to_builtins(before), msgspec.to_builtins(now)
    known, known_now = (table.pop(DIGESTS, None) or {} for table in (one, two))

    def is_same_file(found: Difference) -> bool:
        names = found.before, found.now
        given = all(isinstance(name, str) for name in names) and names[0] in known
        return given and known[names[0]] == known_now.get(names[1])

    return [found for found in find_changes(one, two) if not is_same_file(found)]


def find_changes(before: Any, now: Any, key: str = "") -> Iterator[Difference]:
    """Where two trees of plain tables, lists and values differ, and with which values."""
    if isinstance(before, dict) and isinstance(now, dict):
        for name in dict.fromkeys((*before, *now)):
            inner = f"{key}.{name}" if key else name
            yield from find_changes(before.get(name), now.get(name), inner)
    elif isinstance(before, list | tuple) and isinstance(now, list | tuple):
        if len(before) != len(now) or not any(isinstance(one, dict) for one in before):
            if list(before) != list(now):
                yield Difference(key, before, now)
            return
        for place, (one, two) in enumerate(zip(before, now, strict=True)):
            yield from find_changes(one, two, f"{key}.{place}")
    elif before != now:
        yield Difference(key, before, now)


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


def make_parts(kind: Any) -> dict[str, Any]:
    """The schema of a type: of a deck's own fields, without the key problem."""
    (root,), parts = msgspec.json.schema_components([kind], ref_template="#/$defs/{name}")
    root, parts = _without_null(root), _without_null(parts)
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        root = parts.pop(kind.__name__)
        needed = any(field.required for field in msgspec.structs.fields(kind))
        for key, value in ({} if needed else _without_null(msgspec.to_builtins(kind()))).items():
            root["properties"][key].setdefault("default", value)
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


Where = Callable[[str], str]  # dotted key -> words for where it was given
Part = Mapping[str, Any]  # of a schema
TYPES = {
    "boolean": "true or false", "integer": "a whole number", "number": "a number", "string": "text",
    "object": "a table",
}  # fmt: skip
BOUNDS = {
    "exclusiveMinimum": "greater than", "minimum": "at least", "exclusiveMaximum": "less than",
    "maximum": "at most",
}  # fmt: skip

REPLACED = {  # the last name of a key of older decks: what took its place, and what that is
    "damping": ("thickness", "waves of a contact much shorter decay [m]")
}


def check_deck(table: dict[str, Any], kind: type, where: Where) -> None:
    """Raise BadInput with a line about each thing in `table` that a deck `kind` cannot take."""
    told = [f"{where(key)}: {words}" for key, words in find_mistakes(table, kind, "", kind)]
    if told:
        raise BadInput("\n".join(dict.fromkeys(told)))


def takes(value: Any, kind: Any) -> bool:
    """Is `value` one of the type `kind`, and every number in it finite?"""
    try:
        msgspec.convert(value, kind)
    except msgspec.ValidationError:
        return False
    return _is_finite(value)


def _is_finite(value: Any) -> bool:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return all(map(_is_finite, inner)) and not (
        isinstance(value, float) and not math.isfinite(value)
    )


def list_choices(kind: Any) -> list[Any]:
    """The types that a value of `kind` may have, without their constraints."""
    if hasattr(kind, "__metadata__"):  # Annotated
        return list_choices(kind.__origin__)
    inner = typing.get_args(kind) if typing.get_origin(kind) in UNIONS else ()
    return [choice for one in inner for choice in list_choices(one)] or [kind]


def find_mistakes(value: Any, kind: Any, key: str, deck: type) -> Iterator[tuple[str, str]]:
    """What of a value, at the dotted `key` of a `deck`, is not of its type: keys and sentences."""
    if takes(value, kind):
        return
    choices = list_choices(kind)
    tables = [one for one in choices if isinstance(one, type) and issubclass(one, msgspec.Struct)]
    found: list[tuple[str, str]] = []
    if isinstance(value, dict) and tables:
        tag = tables[0].__struct_config__.tag_field
        by_tag = {one.__struct_config__.tag: one for one in tables}
        table = by_tag.get(value.get(tag)) if tag else tables[0]
        if table is None:
            words = ", ".join(repr(one) for one in by_tag)
            told = f"{key}.{tag} = {show(value[tag])}; it must be" if tag in value else ""
            yield key, f"{told or f'{key} lacks the key {tag!r}:'} one of {words}"
            return
        found += _find_in_table(value, table, f"{key}." if key else "", deck)
    for one in choices:
        inner = typing.get_args(one)
        if isinstance(value, dict) and typing.get_origin(one) is dict:
            pairs = [(f"{key}.{name}", part, inner[1]) for name, part in value.items()]
        elif isinstance(value, list) and typing.get_origin(one) in (list, tuple):
            alike = inner[:1] * len(value) if inner[1:] in ((), (...,)) else inner
            pairs = [
                (f"{key}.{k}", *pair) for k, pair in enumerate(zip(value, alike, strict=False))
            ]
        else:
            continue
        for name, part, part_kind in pairs:
            found += find_mistakes(part, part_kind, name, deck)
    yield from found
    if found:
        return
    if isinstance(value, dict):
        inner = ", ".join(f"{key}.{name}" for name in value) or "{}"
        yield inner.split(", ")[0], f"{inner}: {key} is a value, not a table: {describe_type(kind)}"
        return
    wanted = describe_type(kind) + ", finite" * (not _is_finite(value))
    if isinstance(value, str) and any("material" in one.__struct_fields__ for one in tables):
        wanted += f", such as {key} = {{ material = {show(value)} }}"
    yield key, f"{key} = {show(value)}; it must be {wanted}"


def _find_in_table(
    value: dict[str, Any], table: type, prefix: str, deck: type
) -> Iterator[tuple[str, str]]:
    """Unknown keys, mistakes in those that are known, missing ones."""
    fields = {field.encode_name: field for field in msgspec.structs.fields(table)}
    for name, part in value.items():
        full = prefix + name
        if name in fields:
            yield from find_mistakes(part, fields[name].type, full, deck)
        elif name != table.__struct_config__.tag_field:
            yield full, f"there is no key {full!r}{_nearest_key(full, list_keys(deck))}"
    for name, field in fields.items():
        if field.required and name not in value:
            yield prefix + name, f"the key {prefix + name!r} is missing"


def list_keys(deck: type) -> list[str]:
    """All dotted keys of a deck, tables before what is in them; in lists without the place."""
    return [
        f"{prefix}.{name}" if prefix else name
        for prefix, table in find_tables(deck)
        for name in table.__struct_fields__
    ]


def find_type(kind: Any, names: list[str]) -> Any:
    """The type of what lies at the dotted key `names` in a value of `kind`; None where nothing."""
    if not names:
        return kind
    for one in list_choices(kind):
        inner = typing.get_args(one)
        if isinstance(one, type) and issubclass(one, msgspec.Struct):
            inner = {field.name: field.type for field in msgspec.structs.fields(one)}.get(names[0])
        elif typing.get_origin(one) is dict:
            inner = inner[1]
        elif names[0].isdigit() and inner:
            inner = inner[min(int(names[0]), len(inner) - 1)] if inner[-1] is not ... else inner[0]
        if inner and (found := find_type(inner, names[1:])) is not None:
            return found
    return None


def wants_text(kind: type, key: str, value: Any) -> bool:
    """Does the field at the dotted `key` of a deck take text, but nothing like `value`?"""
    found = list_choices(find_type(kind, key.split(".")))
    like = {bool: (bool,), int: (int, float), float: (float,)}[type(value)]
    return str in found and not set(like) & set(found)


def resolve(schema: Part, part: Part) -> Part:
    """A part of the schema, or the definition that it refers to."""
    reference = part.get("$ref")
    return schema["$defs"][reference.rsplit("/", 1)[-1]] if reference else part


def _nearest_key(key: str, known: list[str]) -> str:
    """'; did you mean ...?': the same last name elsewhere first, else the likest spelling."""
    key = re.sub(r"\.\d+(?=\.)", "", key)  # places in lists
    last = key.rsplit(".", 1)[-1]
    successor, meaning = REPLACED.get(last, ("", ""))
    successor = key.removesuffix(last) + successor
    if meaning and successor in known:
        return f" any more; {successor!r} replaced it: {meaning}"
    same = [other for other in known if other.rsplit(".", 1)[-1] == last]
    by_key = find_nearest(key, same or known, cutoff=0.0 if same else 0.6)
    if by_key is not None:
        return f"; did you mean {by_key!r}?"
    prefix = key.rpartition(".")[0]
    beside = [other for other in known if other.rpartition(".")[0] == prefix]
    lasts = {other.rsplit(".", 1)[-1]: other for other in reversed(known)}
    by_last = find_nearest(last, lasts, cutoff=0.6)
    if by_last is not None:
        return f"; did you mean {lasts[by_last]!r}?"
    return f"; known there are: {', '.join(beside)}" if beside else ""


def describe_type(kind: Any) -> str:
    """What a value of a type looks like, in words."""
    part = make_parts(kind)
    return describe(part, part)


def describe(schema: Part, part: Part) -> str:
    """What a value that suits a part of the schema looks like, in words."""
    part = resolve(schema, part)
    if part.keys() <= {"$schema", "$defs"}:
        return "a value"
    if "enum" in part:
        return _any_of([show(one) for one in part["enum"]])
    if "anyOf" in part:
        return " or ".join(dict.fromkeys(describe(schema, one) for one in part["anyOf"]))
    kind = part.get("type", "object")
    if kind == "array":
        return _describe_list(schema, part)
    bounds = " and ".join(f"{words} {part[k]:g}" for k, words in BOUNDS.items() if k in part)
    bounds = f" of {bounds}" if bounds.startswith("at ") else bounds and f" {bounds}"
    form = f" of the form {part['pattern']}" if "pattern" in part else ""
    return TYPES.get(kind, "something else") + bounds + form


def _describe_list(schema: Part, part: Part) -> str:
    items = part.get("items", {})
    if isinstance(items, list):
        words = ", ".join(describe(schema, one) for one in items)
        return f"a list of {len(items)} values: {words}"
    low, high = part.get("minItems", 0), part.get("maxItems")
    count = f" of at least {low} values" if low else ""
    if high is not None:
        count = f" of {high} values" if low == high else f" of {low} to {high} values"
    return f"a list{count}, each {describe(schema, items)}"


def _any_of(words: list[str]) -> str:
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " or " + words[-1]


def show(value: Any) -> str:
    """A value as it stands in a deck, cut where it is long."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = '"' + value.replace("\n", "\\n") + '"'
    elif isinstance(value, dict):
        text = "{...} (a table)"
    else:
        text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


WIDTH = 100  # of a line
HEAD = "# keys without a value, and what that means or what they could be:"


def describe_unset(deck: Deck) -> str:
    """Comment lines on the keys of a deck without a value; "" where all have one."""
    lines = []
    for key, words in _find_unset(deck, ""):
        lines += textwrap.wrap(
            f"{key}: {words}", WIDTH, initial_indent="# ", subsequent_indent="#     "
        )
    return "".join(f"{line}\n" for line in (["", HEAD, *lines] if lines else []))


def _find_unset(table: Any, prefix: str) -> Iterator[tuple[str, str]]:
    """Dotted keys of a table with their words; the keys of a table that is left out after it."""
    for field in msgspec.structs.fields(table) if isinstance(table, DeckTable) else ():
        key, value = prefix + field.name, getattr(table, field.name)
        if value is not None:
            entries = value if isinstance(value, list | tuple) else ()
            yield from _find_unset(value, f"{key}.")
            for k, entry in enumerate(entries):
                yield from _find_unset(entry, f"{key}.{k}.")
            continue
        part = make_parts(field.type)
        inner = resolve(part, part)
        words = part.get("description", inner.get("description", "")).strip().partition("\n")[0]
        is_table = "properties" in inner
        yield key, f"{words.rstrip('.')} ({'a table' if is_table else describe(part, part)})"
        for name, inside in inner["properties"].items() if is_table else ():
            yield f"{key}.{name}", f"{inside.get('description', '')} ({describe(part, inside)})"
