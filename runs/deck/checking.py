"""Telling what is wrong with a deck in words: unknown keys, wrong types, bounds.

The JSON schema that editors are given says what a deck may hold, and jsonschema finds what breaks
it; here each refusal becomes a sentence with the full key, where it was given, the value and what
would be right, an unknown key gets the nearest known one, and all mistakes are reported at once.

Note: jsonschema takes 0.3 s to be imported.  A deck that msgspec takes, from whose types the
schema is made, needs no words, and is not shown to it.
"""

from __future__ import annotations

import json
import math
import re
import textwrap
import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec

from problems.deck import Deck, DeckTable
from problems.registry import load_problem, read_docstring
from regrid.errors import BadInput, find_nearest

if TYPE_CHECKING:
    from jsonschema import ValidationError


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
    try:
        msgspec.convert(table, kind)
        if _is_finite(table):
            return
    except msgspec.ValidationError:
        pass
    schema = make_parts(kind)
    told = list(_Words(schema, where).tell_all(_find_errors(schema, table)))
    order = list(table)
    told.sort(key=lambda one: order.index(one[0]) if one[0] in order else len(order))
    if told:
        raise BadInput("\n".join(dict.fromkeys(sentence for _, sentence in told)))


def _is_finite(value: Any) -> bool:
    if isinstance(value, dict):
        return all(map(_is_finite, value.values()))
    if isinstance(value, list):
        return all(map(_is_finite, value))
    return not isinstance(value, float) or math.isfinite(value)


def _find_errors(schema: Part, table: dict[str, Any]) -> list[ValidationError]:
    """What breaks the schema.

    Numbers have to be finite, and 2.0 is no whole number, as in TOML.
    """
    from jsonschema.validators import extend, validator_for

    def is_integer(checker, value) -> bool:
        return isinstance(value, int) and not isinstance(value, bool)

    def is_number(checker, value) -> bool:
        return is_integer(checker, value) or (isinstance(value, float) and math.isfinite(value))

    base = validator_for(schema)
    types = base.TYPE_CHECKER.redefine_many({"integer": is_integer, "number": is_number})
    return list(extend(base, type_checker=types)(schema).iter_errors(table))


class _Words:
    """Sentences about errors of jsonschema, each after the first name of the key it is about."""

    def __init__(self, schema: Part, where: Where):
        self.schema, self.where = schema, where
        self.known = list(known_keys(schema))

    def tell_all(self, errors: list[ValidationError]) -> Iterator[tuple[str, str]]:
        for error in errors:
            yield from self.tell(error)

    def tell(self, error: ValidationError) -> Iterator[tuple[str, str]]:
        key = ".".join(map(str, error.absolute_path))
        prefix = f"{key}." if key else ""
        match error.validator:
            case "additionalProperties" if error.validator_value is False:
                for name in error.instance:
                    if name not in error.schema.get("properties", {}):
                        full = prefix + name
                        nearest = _nearest_key(full, self.known)
                        words = f"{self.where(full)}: there is no key {full!r}{nearest}"
                        yield full.split(".")[0], words
            case "required":
                for name in error.validator_value:
                    if name not in error.instance:
                        full = prefix + name
                        yield full.split(".")[0], f"{self.where(full)}: the key {full!r} is missing"
            case "anyOf":
                yield from self.tell_choice(error, key)
            case _:
                yield key.split(".")[0], self.tell_value(error, key)

    def tell_choice(self, error: ValidationError, key: str) -> Iterator[tuple[str, str]]:
        """Of a value that may be of several kinds: what is wrong with it as the one it looks like.

        That is the table with its tag, or the only kind that is a table or a list as it is.
        """
        choices = [resolve(self.schema, part) for part in error.validator_value]
        tag = error.schema.get("discriminator", {}).get("propertyName")
        value = error.instance
        if isinstance(value, dict) and tag:
            tags = [choice["properties"][tag]["enum"][0] for choice in choices]
            if value.get(tag) not in tags:
                words = ", ".join(repr(one) for one in tags)
                told = f"{key} lacks the key {tag!r}: one of {words}"
                if tag in value:
                    told = f"{key}.{tag} = {show(value[tag])}; it has to be one of {words}"
                yield key.split(".")[0], f"{self.where(key)}: {told}"
                return
            chosen = [tags.index(value[tag])]
        else:
            looks = {dict: "object", list: "array"}.get(type(value))
            chosen = [k for k, one in enumerate(choices) if looks and one.get("type") == looks]
        if len(chosen) == 1:
            inner = [one for one in error.context or () if one.schema_path[0] == chosen[0]]
            yield from self.tell_all(inner)
            return
        yield key.split(".")[0], self.tell_value(error, key)

    def tell_value(self, error: ValidationError, key: str) -> str:
        value, part = error.instance, error.schema
        wanted = describe(self.schema, part)
        if isinstance(value, dict) and "object" not in _list_types(self.schema, part):
            inner = ", ".join(f"{key}.{name}" for name in value) or "{}"
            start = self.where(inner.split(", ")[0])
            return f"{start}: {inner}: {key} is a value, not a table: {wanted}"
        if isinstance(value, float) and not math.isfinite(value):
            wanted += ", finite"
        keys = resolve(self.schema, part).get("properties", {})
        if isinstance(value, str) and "material" in keys:
            wanted += f", such as {key} = {{ material = {show(value)} }}"
        return f"{self.where(key)}: {key} = {show(value)}; it has to be {wanted}"


def resolve(schema: Part, part: Part) -> Part:
    """A part of the schema, or the definition that it refers to."""
    reference = part.get("$ref")
    return schema["$defs"][reference.rsplit("/", 1)[-1]] if reference else part


def known_keys(schema: Part, part: Part | None = None, prefix: str = "") -> Iterator[str]:
    """All dotted keys of a deck, tables before what is in them; in lists without the place."""
    part = resolve(schema, schema if part is None else part)
    for name, inner in part.get("properties", {}).items():
        if prefix + name == "problem" or _is_tag(inner):
            continue
        yield prefix + name
        yield from known_keys(schema, inner, f"{prefix}{name}.")
    for inner in part.get("anyOf", ()):
        yield from known_keys(schema, inner, prefix)
    if isinstance(part.get("items"), dict):
        yield from known_keys(schema, part["items"], prefix)


def _is_tag(part: Part) -> bool:
    """Is this the key that tells one kind of table from another?"""
    return len(part.get("enum", ())) == 1 and "default" not in part and "description" not in part


def find_part(schema: Part, names: list[str]) -> Part | None:
    """The part of the schema for the dotted key `names`; None where there is none."""
    return next(_find_parts(schema, schema, names), None)


def _find_parts(schema: Part, part: Part, names: list[str]) -> Iterator[Part]:
    part = resolve(schema, part)
    if not names:
        yield part
        return
    name, *rest = names
    inner: list[tuple[Part, list[str]]] = [(one, names) for one in part.get("anyOf", ())]
    items, others = part.get("items"), part.get("additionalProperties")
    if name in part.get("properties", {}):
        inner.append((part["properties"][name], rest))
    elif isinstance(others, dict):
        inner.append((others, rest))
    if name.isdigit() and isinstance(items, dict):
        inner.append((items, rest))
    elif name.isdigit() and isinstance(items, list) and int(name) < len(items):
        inner.append((items[int(name)], rest))
    for one, following in inner:
        yield from _find_parts(schema, one, following)


def wants_text(kind: type, key: str, value: Any) -> bool:
    """Does the field at the dotted `key` of a deck take text, but nothing like `value`?"""
    schema = make_parts(kind)
    part = find_part(schema, key.split("."))
    types = _list_types(schema, part) if part is not None else set()
    given = {bool: {"boolean"}, int: {"integer", "number"}, float: {"number"}}.get(type(value))
    return "string" in types and not types & (given or set())


def _list_types(schema: Part, part: Part) -> set[str]:
    part = resolve(schema, part)
    found = {_name_type(one) for one in part.get("enum", ())}
    for inner in part.get("anyOf", ()):
        found |= _list_types(schema, inner)
    return found | ({part["type"]} if "type" in part else set())


def _name_type(value: Any) -> str:
    names = {bool: "boolean", int: "integer", float: "number", str: "string"}
    return names.get(type(value), "object")


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


def describe(schema: Part, part: Part) -> str:
    """What a value that suits a part of the schema looks like, in words."""
    part = resolve(schema, part)
    if "enum" in part:
        return _any_of([show(one) for one in part["enum"]])
    if "anyOf" in part:
        return " or ".join(dict.fromkeys(describe(schema, one) for one in part["anyOf"]))
    kind = part.get("type", "object")
    if kind == "array":
        return _describe_list(schema, part)
    bounds = " and ".join(f"{words} {part[k]:g}" for k, words in BOUNDS.items() if k in part)
    form = f" of the form {part['pattern']}" if "pattern" in part else ""
    return TYPES.get(kind, "something else") + (f" {bounds}" if bounds else "") + form


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
