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
import types
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import tomli_w

from shockgrid.problems.deck import DIGESTS, Deck, DeckTable
from shockgrid.problems.registry import load_problem, read_docstring
from shockgrid.regrid.errors import BadInput, find_nearest
from shockgrid.runs.quantities import drop_units

UNKNOWN = object()  # the default of a key that has none
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
    one = msgspec.to_builtins(before)
    two = msgspec.to_builtins(now)
    known, known_now = (table.pop(DIGESTS, None) or {} for table in (one, two))

    def find_digest(digests: dict, name: Any) -> Any:
        return digests.get(name, name) if isinstance(name, str) else name

    return [
        found
        for found in find_changes(one, two)
        if find_digest(known, found.before) != find_digest(known_now, found.now)
    ]


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


# marks keys in a schema; editors pass it over
RUNTIME = "x-restart"
MAY_CHANGE = "may change"


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
    root = _without_null(root)
    parts = _without_null(parts)
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


def check_deck(table: dict[str, Any], kind: type, where: Where) -> None:
    """Raise BadInput with a line about each thing in `table` that a deck `kind` cannot take."""
    mistakes = [f"{where(key)}: {mistake}" for key, mistake in find_mistakes(table, kind, "", kind)]
    if mistakes:
        raise BadInput("\n".join(dict.fromkeys(mistakes)))


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
            known_tags = ", ".join(repr(one) for one in by_tag)
            beginning = f"{key}.{tag} = {show(value[tag])}; it must be" if tag in value else ""
            yield key, f"{beginning or f'{key} lacks the key {tag!r}:'} one of {known_tags}"
            return
        fields = {field.encode_name: field for field in msgspec.structs.fields(table)}
        prefix = f"{key}." if key else ""
        for name, part in value.items():
            if name in fields:
                found += find_mistakes(part, fields[name].type, prefix + name, deck)
            elif name != table.__struct_config__.tag_field:
                hint = _nearest_key(prefix + name, list_keys(deck))
                found.append((prefix + name, f"there is no key {prefix + name!r}{hint}"))
        for name, field in fields.items():
            if field.required and name not in value:
                found.append((prefix + name, f"the key {prefix + name!r} is missing"))
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
        wanted = f"a table, such as {key} = {{ material = {show(value)} }}"
    yield key, f"{key} = {show(value)}; it must be {wanted}"


def list_keys(deck: type) -> list[str]:
    """All dotted keys of a deck, tables before what is in them; in lists without the place."""
    return [
        f"{prefix}.{name}" if prefix else name
        for prefix, table in find_tables(deck)
        for name in table.__struct_fields__
    ]


def wants_text(kind: type, names: Sequence[str], value: Any) -> bool:
    """Does the field at the dotted key `names` of a deck take text, but nothing like `value`?"""
    for name in reversed(names):
        value = {name: value}
    try:
        msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        return str(error).startswith("Expected `str")
    return False


def resolve(schema: Part, part: Part) -> Part:
    """A part of the schema, or the definition that it refers to."""
    reference = part.get("$ref")
    return schema["$defs"][reference.rsplit("/", 1)[-1]] if reference else part


def _nearest_key(key: str, known: list[str]) -> str:
    """'; did you mean ...?': the same last name elsewhere first, else the likest spelling."""
    key = re.sub(r"\.\d+(?=\.)", "", key)  # places in lists
    last = key.rsplit(".", 1)[-1]
    same = [other for other in known if other.rsplit(".", 1)[-1] == last]
    nearest = find_nearest(key, same or known, cutoff=0.0 if same else 0.6)
    if nearest is None:
        lasts = {other.rsplit(".", 1)[-1]: other for other in reversed(known)}
        nearest = lasts.get(find_nearest(last, lasts, cutoff=0.6) or "")
    if nearest is not None:
        return f"; did you mean {nearest!r}?"
    prefix = key.rpartition(".")[0]
    beside = [other for other in known if other.rpartition(".")[0] == prefix]
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
        *others, last = map(show, part["enum"])
        return f"{', '.join(others)} or {last}" if others else last
    if "anyOf" in part:
        return " or ".join(dict.fromkeys(describe(schema, one) for one in part["anyOf"]))
    kind = part.get("type", "object")
    items = part.get("items", {})
    if kind == "array" and isinstance(items, list):
        alternatives = ", ".join(describe(schema, one) for one in items)
        return f"a list of {len(items)} values: {alternatives}"
    if kind == "array":
        low, high = part.get("minItems", 0), part.get("maxItems")
        count = f" of at least {low} values" if low else ""
        if high is not None:
            count = f" of {high} values" if low == high else f" of {low} to {high} values"
        if "properties" in (inner := resolve(schema, items)):
            return f"a list of tables, such as [{_show_table(schema, inner)}]"
        return f"a list{count}, each {describe(schema, items)}"
    if "properties" in part:
        return f"a table, such as {_show_table(schema, part)}"
    bounds = " and ".join(f"{bound} {part[k]:g}" for k, bound in BOUNDS.items() if k in part)
    bounds = f" of {bounds}" if bounds.startswith("at ") else bounds and f" {bounds}"
    form = f" of the form {part['pattern']}" if "pattern" in part else ""
    return TYPES.get(kind, "something else") + bounds + form


def _show_table(schema: Part, part: Part) -> str:
    """The first keys of a table as TOML, with their defaults."""
    known = [(name, one.get("default")) for name, one in part["properties"].items()][:3]
    return "{ " + ", ".join(f"{n} = {'...' if v is None else show(v)}" for n, v in known) + " }"


def show(value: Any) -> str:
    """A value as written in a deck, cut if it is long; None: the key is left out."""
    if value is None:
        text = "left out"
    elif isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = '"' + value.replace("\n", "\\n") + '"'
    elif isinstance(value, dict):
        text = "{...} (a table)"
    else:
        text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


# of a line; where its comment begins
DECK_LINE_WIDTH = 100
DECK_COMMENT_COLUMN = 34


def describe_deck(name: str, deck: Deck, t_unit: str = "s", only_set: bool = False) -> str:
    """The deck of problem `name` as TOML, each key with its meaning; those without a value are
    commented out.  t_unit: that of the problem; only_set: keys that differ from the defaults."""
    text = f"problem = {show(name)}\n"
    lines = _write_table(deck, "", type(deck)(), set()) if only_set else _write_table(deck, "")
    for line in lines:
        key, mark, comment = line.partition("# ")
        text += f"{key}{mark}{drop_units(comment, t_unit)}".rstrip() + "\n"
    if only_set:
        text += f"\n# all other keys have their defaults; list them: shockgrid check {name}\n"
    return text


def _find_defaults(table: DeckTable) -> Any:
    """The values that the keys of a table have where they are left out, as attributes."""
    defaults = {}
    for field in msgspec.structs.fields(table):
        if field.default is not msgspec.NODEFAULT:
            defaults[field.name] = field.default
        elif field.default_factory is not msgspec.NODEFAULT:
            defaults[field.name] = field.default_factory()
    return types.SimpleNamespace(**defaults)


def _write_table(
    table: DeckTable, path: str, default: Any = None, said: set[tuple[str, str]] | None = None
) -> Iterator[str]:
    """Lines of the keys of a table with the dotted name `path`, then of the tables in it.

    default: a table, or the like, of values; keys that have the same ones are left out.  said: the
    keys with their meanings so far, none of which is said twice.
    """

    def explain(line: str, words: str) -> list[str]:
        once = line.partition(" = ")[0], words
        if said is not None and once in said:
            return [line]
        if said is not None:
            said.add(once)
        return _explain(line, words)

    settings = table.__struct_config__
    tables = []
    if settings.tag_field:
        yield f"{settings.tag_field} = {show(settings.tag)}"
    for field in msgspec.structs.fields(table):
        value = getattr(table, field.name)
        if field.name == DIGESTS and (default is not None or not value):  # a run's own key
            continue
        usual = getattr(default, field.name, UNKNOWN)
        if default is not None and value == usual:
            continue
        part = make_parts(field.type)
        inner = resolve(part, part)
        description = (
            part.get("description", inner.get("description", "")).strip().partition("\n")[0]
        )
        entries = value if isinstance(value, list | tuple) else [value]
        head = f"{path}.{field.name}".lstrip(".")
        unset = value is None
        if entries and all(isinstance(entry, DeckTable) for entry in entries):
            tables.append(
                (f"[{head}]" if entries[0] is value else f"[[{head}]]", entries, description, usual)
            )
        elif unset and "properties" in inner:
            tables.append((f"# [{head}]", inner["properties"], description, None))
        else:
            form = f" ({describe(part, part)})" if unset or "enum" in inner else ""
            line = f"# {field.name} =" if unset else f"{field.name} = {_write_value(value)}"
            yield from explain(line, description.rstrip(".") + form)
    for line, entries, comment, usual in tables:
        for entry in entries if isinstance(entries, list | tuple) else ():
            known = None
            if default is not None:
                known = usual if type(usual) is type(entry) else _find_defaults(entry)
            yield from ("", *explain(line, comment))
            yield from _write_table(entry, line.strip("[]"), known, said)
        if isinstance(entries, Mapping):
            yield from ("", *_explain(line, comment))
            for name, one in entries.items():
                yield from _explain(
                    f"# {name} =", f"{one.get('description', '')} ({describe(part, one)})"
                )


def _explain(line: str, words: str) -> list[str]:
    """The line with its comment, which goes on below it, or stands above a long line."""
    above = len(line) >= DECK_COMMENT_COLUMN
    room = DECK_LINE_WIDTH - 2 - DECK_COMMENT_COLUMN * (not above)
    lines = [f"# {one}" for one in textwrap.wrap(words, room, break_on_hyphens=False)] or [""]
    if above:
        return [*lines, line]
    return [
        f"{line:{DECK_COMMENT_COLUMN}}{lines[0]}".rstrip(),
        *(" " * DECK_COMMENT_COLUMN + one for one in lines[1:]),
    ]


def _write_value(value: Any) -> str:
    """A value as TOML in one line."""
    value = msgspec.to_builtins(value)
    if isinstance(value, dict):
        lines = ((tomli_w.dumps({k: 0})[:-2], v) for k, v in value.items() if v is not None)
        pairs = [f"{key}{_write_value(one)}" for key, one in lines]
        return "{ " + ", ".join(pairs) + " }" if pairs else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_write_value, value))}]"
    return tomli_w.dumps({"value": value}).removeprefix("value = ").rstrip("\n")
