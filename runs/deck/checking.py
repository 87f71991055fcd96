"""Telling what is wrong with a deck in words: unknown keys, wrong types, bounds.

msgspec would refuse the same decks at the first mistake; here each refusal names the full key,
where it was given, the value, and what would be right, an unknown key gets the nearest known one,
and all mistakes are told at once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import Any

from msgspec import NODEFAULT, inspect

from regrid.errors import BadInput, find_nearest

Where = Callable[[str], str]  # dotted key -> words for where it was given


def check_deck(table: dict[str, Any], kind: type, where: Where) -> None:
    """Raise BadInput with a line about each thing in `table` that a deck `kind` cannot take."""
    root = inspect.type_info(kind)
    known = list(known_keys(root))
    mistakes = list(_check_struct(table, root, "", known, where))
    if mistakes:
        raise BadInput("\n".join(mistakes))


def known_keys(struct: inspect.StructType, prefix: str = "") -> Iterator[str]:
    """All dotted keys of a deck, tables before what is in them."""
    for field in struct.fields:
        key = prefix + field.encode_name
        yield key
        for inner in _structs_of(field.type):
            yield from known_keys(inner, key + ".")


def find_kind(deck: type, names: list[str]) -> inspect.Type | None:
    """The type of the field at the dotted key `names` of a deck; None where there is none."""
    return _kind_at(inspect.type_info(deck), names)


def _kind_at(kind: inspect.Type, names: list[str]) -> inspect.Type | None:
    kind = _plain(kind)
    if not names:
        return kind
    inner: list[tuple[inspect.Type, list[str]]] = []
    if isinstance(kind, inspect.StructType):
        inner = [(one.type, names[1:]) for one in kind.fields if one.encode_name == names[0]]
    elif isinstance(kind, inspect.UnionType):
        inner = [(part, names) for part in kind.types]
    elif isinstance(kind, inspect.ListType | inspect.VarTupleType) and names[0].isdigit():
        inner = [(kind.item_type, names[1:])]
    elif isinstance(kind, inspect.DictType):
        inner = [(kind.value_type, names[1:])]
    found = (_kind_at(part, rest) for part, rest in inner)
    return next((one for one in found if one is not None), None)


def _structs_of(kind: inspect.Type) -> list[inspect.StructType]:
    kind = _plain(kind)
    if isinstance(kind, inspect.StructType):
        return [kind]
    if isinstance(kind, inspect.UnionType):
        return [struct for part in kind.types for struct in _structs_of(part)]
    if isinstance(kind, inspect.ListType | inspect.VarTupleType | inspect.FrozenSetType):
        return _structs_of(kind.item_type)
    return []


def _plain(kind: inspect.Type) -> inspect.Type:
    return _plain(kind.type) if isinstance(kind, inspect.Metadata) else kind


def _check_struct(
    table: dict[str, Any],
    struct: inspect.StructType,
    prefix: str,
    known: list[str],
    where: Where,
) -> Iterator[str]:
    fields = {field.encode_name: field for field in struct.fields}
    for name, value in table.items():
        key = prefix + name
        if name == struct.tag_field:
            continue
        if name not in fields:
            yield f"{where(key)}: there is no key {key!r}{_nearest_key(key, known)}"
        else:
            yield from _check_value(value, fields[name].type, key, known, where)
    for name, field in fields.items():
        if field.required and name not in table and field.default is NODEFAULT:
            yield f"{where(prefix + name)}: the key {prefix + name!r} is missing"


def _nearest_key(key: str, known: list[str]) -> str:
    """'; did you mean ...?': the same last name elsewhere first, else the likest spelling."""
    key = re.sub(r"\.\d+(?=\.)", "", key)  # places in lists
    last = key.rsplit(".", 1)[-1]
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


def _check_value(
    value: Any, kind: inspect.Type, key: str, known: list[str], where: Where
) -> Iterator[str]:
    kind = _plain(kind)
    if isinstance(kind, inspect.UnionType):
        parts = [_plain(part) for part in kind.types]
        structs = [part for part in parts if isinstance(part, inspect.StructType)]
        if isinstance(value, dict) and structs:
            yield from _check_tagged(value, structs, key, known, where)
            return
        several = [part for part in parts if not isinstance(part, inspect.NoneType)]
        if len(several) == 1:
            yield from _check_value(value, several[0], key, known, where)
            return
    elif isinstance(kind, inspect.StructType) and isinstance(value, dict):
        yield from _check_tagged(value, [kind], key, known, where)
        return
    elif isinstance(kind, inspect.DictType) and isinstance(value, dict):
        for name, entry in value.items():
            yield from _check_value(entry, kind.value_type, f"{key}.{name}", known, where)
        return
    elif isinstance(kind, inspect.ListType | inspect.VarTupleType) and isinstance(value, list):
        for index, entry in enumerate(value):
            yield from _check_value(entry, kind.item_type, f"{key}.{index}", known, where)
    elif isinstance(kind, inspect.TupleType) and isinstance(value, list):
        for index, (entry, part) in enumerate(zip(value, kind.item_types, strict=False)):
            yield from _check_value(entry, part, f"{key}.{index}", known, where)
    if isinstance(value, dict) and not accepts(value, kind):
        inner = ", ".join(f"{key}.{name}" for name in value) or "{}"
        start = where(inner.split(", ")[0])
        yield f"{start}: {inner}: {key} is a value, not a table: {describe(kind)}"
    elif not accepts(value, kind):
        wanted = describe(kind)
        if isinstance(value, float) and not math.isfinite(value):
            wanted += ", finite"
        yield f"{where(key)}: {key} = {show(value)}; it has to be {wanted}"


def _check_tagged(
    value: dict[str, Any],
    structs: list[inspect.StructType],
    key: str,
    known: list[str],
    where: Where,
) -> Iterator[str]:
    tag_field = structs[0].tag_field
    struct = structs[0]
    if tag_field is not None:
        tag = value.get(tag_field)
        chosen = [one for one in structs if one.tag == tag]
        if not chosen:
            choices = ", ".join(repr(one.tag) for one in structs)
            given = f"{key}.{tag_field} = {show(tag)}" if tag_field in value else f"{key} lacks"
            end = "it has to be" if tag_field in value else f"the key {tag_field!r}:"
            joint = "; " if tag_field in value else " "
            yield f"{where(key)}: {given}{joint}{end} one of {choices}"
            return
        struct = chosen[0]
    yield from _check_struct(value, struct, key + ".", known, where)


def accepts(value: Any, kind: inspect.Type) -> bool:
    """Whether a TOML value is of this kind and within its bounds (finite, if a number)."""
    match _plain(kind):
        case inspect.AnyType():
            return True
        case inspect.NoneType():
            return value is None
        case inspect.BoolType():
            return isinstance(value, bool)
        case inspect.IntType() as number:
            return isinstance(value, int) and not isinstance(value, bool) and _within(value, number)
        case inspect.FloatType() as number:
            if isinstance(value, bool) or not isinstance(value, int | float):
                return False
            return math.isfinite(value) and _within(value, number)
        case inspect.StrType() as text:
            if not isinstance(value, str):
                return False
            low, high = text.min_length or 0, text.max_length
            matches = text.pattern is None or re.search(text.pattern, value) is not None
            return low <= len(value) and (high is None or len(value) <= high) and matches
        case inspect.LiteralType(values):
            return any(value == one and type(value) is type(one) for one in values)
        case inspect.EnumType(cls):
            return value in [one.value for one in cls]
        case inspect.UnionType(types):
            return any(accepts(value, one) for one in types)
        case inspect.ListType() | inspect.VarTupleType() as entries:
            if not isinstance(value, list):
                return False
            low, high = entries.min_length or 0, entries.max_length
            return low <= len(value) and (high is None or len(value) <= high)
        case inspect.TupleType(item_types):
            return isinstance(value, list) and len(value) == len(item_types)
        case inspect.StructType() | inspect.DictType():
            return isinstance(value, dict)
    return True  # some other kind: msgspec itself has the last word


def _within(value: float, number: inspect.IntType | inspect.FloatType) -> bool:
    return not (
        (number.gt is not None and not value > number.gt)
        or (number.ge is not None and not value >= number.ge)
        or (number.lt is not None and not value < number.lt)
        or (number.le is not None and not value <= number.le)
        or (number.multiple_of is not None and value % number.multiple_of != 0)
    )


def describe(kind: inspect.Type) -> str:
    """What a value of this kind looks like, in words."""
    match _plain(kind):
        case inspect.BoolType():
            return "true or false"
        case inspect.IntType() as number:
            return "a whole number" + _bounds(number)
        case inspect.FloatType() as number:
            return "a number" + _bounds(number)
        case inspect.StrType() as text:
            return "text" + (f" of the form {text.pattern}" if text.pattern else "")
        case inspect.LiteralType(values):
            return _any_of([show(one) for one in values])
        case inspect.EnumType(cls):
            return _any_of([show(one.value) for one in cls])
        case inspect.UnionType(types):
            parts = [one for one in types if not isinstance(_plain(one), inspect.NoneType)]
            return " or ".join(dict.fromkeys(describe(one) for one in parts))
        case inspect.ListType() | inspect.VarTupleType() as entries:
            low, high = entries.min_length, entries.max_length
            count = f" of {low or 0} to {high} values" if high is not None else ""
            if high is None and low:
                count = f" of at least {low} values"
            elif low == high and high is not None:
                count = f" of {high} values"
            return f"a list{count}, each {describe(entries.item_type)}"
        case inspect.TupleType(item_types):
            words = ", ".join(describe(one) for one in item_types)
            return f"a list of {len(item_types)} values: {words}"
        case inspect.StructType():
            return "a table"
        case inspect.DictType():
            return "a table"
    return "something else"


def _any_of(words: list[str]) -> str:
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " or " + words[-1]


def _bounds(number: inspect.IntType | inspect.FloatType) -> str:
    parts = []
    if number.gt is not None:
        parts.append(f"greater than {number.gt:g}")
    if number.ge is not None:
        parts.append(f"at least {number.ge:g}")
    if number.lt is not None:
        parts.append(f"less than {number.lt:g}")
    if number.le is not None:
        parts.append(f"at most {number.le:g}")
    return " " + " and ".join(parts) if parts else ""


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
