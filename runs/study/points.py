"""The points of a study: what is varied, in words and as settings of a deck.

Values are those of TOML.  `--vary KEY=WORDS` takes `a:b:n` (n values from a to b), `a:b:n:log`
(with equal ratios), or a list `v1,v2,...` of TOML values, names without quotes among them.  Ranges
are rounded to six digits, so that a run's folder can be called by its values; whole ends give whole
numbers where all values are whole.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import tomli_w

from regrid.errors import BadInput
from regrid.text_files import TooMuch, cut, load_toml
from runs.deck.reading import parse_value

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
RANGE = re.compile(rf"({NUMBER}):({NUMBER}):(\d+)(?::(log))?")
MOST_VALUES = 100_000  # of one range
DIGITS = 6
LONGEST_NAME = 120  # of a folder
MOST_WHOLE = 1e15  # floats from here on keep their exponent
SHORT = 40  # a longer value is cut in a folder's name


@dataclass(frozen=True)
class Point:
    """One point: the varied keys with their values, in order."""

    values: tuple[tuple[str, Any], ...]

    @property
    def settings(self) -> tuple[str, ...]:
        """The point as settings of a deck, `key=value`."""
        return tuple(f"{key}={write_value(value)}" for key, value in self.values)

    @property
    def name(self) -> str:
        """The name of its folder: `mach=1.2,cells=32`; what is no plain word is cut and numbered.

        It depends on this point alone, so that other points can come and go.
        """
        name = ",".join(f"{key}={_shorten(value)}" for key, value in self.values)
        if len(name) > LONGEST_NAME:
            name = f"{name[:LONGEST_NAME]}-{_digest(name)}"
        return name or "deck"


def _shorten(value: Any) -> str:
    if isinstance(value, float) and value.is_integer() and abs(value) < MOST_WHOLE:
        value = int(value)  # 3.0 and 3 are one point
    text = value if isinstance(value, str) else write_value(value)
    plain = re.sub(r"[^\w.+-]+", "-", text)[:SHORT]
    return plain if plain == text else f"{plain.strip('-')}-{_digest(text)}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:6]


def write_value(value: Any) -> str:
    """A value as TOML in one place, tables in braces; BadInput for what TOML has no word for."""
    try:
        text = tomli_w.dumps({"list": [0, _make_plain(value)]})  # in a list tables are in braces
    except TypeError as error:
        raise BadInput(f"vary: {value!r} is no value of a deck") from error
    text = text[text.index("0,") + 2 : text.rindex("]")].strip().removesuffix(",")
    return re.sub(r"\n *", " ", text)  # a line's end within a text is written otherwise


def _make_plain(value: Any) -> Any:
    """Numbers of numpy as those of Python."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _make_plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_make_plain(entry) for entry in value]
    return value


def read_vary(text: str) -> tuple[str, list[Any]]:
    """Key and values of `KEY=WORDS`, as `--vary` takes it."""
    key, equals, words = text.partition("=")
    if not equals or not key.strip() or not words.strip():
        raise BadInput(
            f"--vary {text!r}: the form is KEY=A:B:N, KEY=A:B:N:log or KEY=V1,V2,..., such as "
            "mach=1.2:3:7"
        )
    return key.strip(), read_values(words.strip(), f"--vary {key.strip()}")


def read_values(words: str, where: str) -> list[Any]:
    """The values that `words` mean: a range, or a list; `where` begins the sentence of BadInput."""
    if match := RANGE.fullmatch(words):
        first, last, count, log = match.groups()
        return _spread(first, last, count, log, where)
    without_count = re.fullmatch(rf"{NUMBER}:{NUMBER}", words)
    if without_count or re.fullmatch(r"[^,'\"\[{]*:[^,'\"\[{]*:[^,'\"\[{]*", words):
        raise BadInput(
            f"{where} = {words}: a range is A:B:N or A:B:N:log, N a whole number, such as 1.2:3:7"
        )
    try:
        return list(load_toml(f"values = [{words}]")["values"])
    except TooMuch as error:
        raise BadInput(f"{where} = {cut(words)}: no list of values: {error}") from error
    except tomllib.TOMLDecodeError as error:
        if any(sign in words for sign in "[{\"'"):
            raise BadInput(f"{where} = {words}: no list of TOML values: {error}") from error
    return [parse_value(word) for word in words.split(",") if word.strip()]


def _spread(first: str, last: str, count: str, log: str | None, where: str) -> list[Any]:
    start, end = float(first), float(last)
    number = int(count) if len(count) < 10 else MOST_VALUES + 1
    if not 2 <= number <= MOST_VALUES or start == end:
        raise BadInput(
            f"{where} = {first}:{last}:{count}: a range has two different ends and 2 to "
            f"{MOST_VALUES} values"
        )
    if not (math.isfinite(start) and math.isfinite(end)):
        raise BadInput(f"{where} = {first}:{last}:{count}: the ends have to be finite")
    if log and (start <= 0.0 or end <= 0.0):
        raise BadInput(f"{where} = {first}:{last}:{count}:log: both ends have to be above 0")
    values = np.geomspace(start, end, number) if log else np.linspace(start, end, number)
    rounded = [float(f"{value:.{DIGITS}g}") for value in values]
    if len(set(rounded)) < number:  # closer than the digits tell
        rounded = values.tolist()
    whole = not any(sign in first + last for sign in ".eE")
    if whole and all(value == round(value) for value in rounded):
        return [round(value) for value in rounded]
    return rounded


def flatten(table: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Dotted keys of nested tables: `{second: {rho: [1, 2]}}` is `second.rho = [1, 2]`."""
    found: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, Mapping):
            found |= flatten(value, f"{above}{name}.")
        else:
            found[f"{above}{name}"] = value
    return found


def make_product(vary: Mapping[str, Sequence[Any]]) -> list[Point]:
    """All combinations, the last key fastest; BadInput for a key without or with equal values."""
    if (count := math.prod(map(len, vary.values()))) > MOST_VALUES:
        raise BadInput(f"vary: {count} points in all; a study has at most {MOST_VALUES}")
    for key, values in vary.items():
        if not values:
            raise BadInput(f"vary: {key} has no values")
        _check_different([Point(((key, value),)).name for value in values], "vary: there is")
    return [
        Point(tuple(zip(vary, values, strict=True))) for values in itertools.product(*vary.values())
    ]


def list_points(points: Iterable[Mapping[str, Any]]) -> list[Point]:
    """Points given one by one; BadInput where one lacks a key of the others, or two are equal."""
    points = list(points)
    for number, point in enumerate(points, start=1):
        if not isinstance(point, Mapping):
            raise BadInput(
                f"points: number {number} is {point!r}; it has to be a table of keys with values"
            )
    flat = [flatten(point) for point in points]
    keys = list(dict.fromkeys(key for point in flat for key in point))
    for number, point in enumerate(flat, start=1):
        missing = [key for key in keys if key not in point]
        if missing:
            raise BadInput(f"points: number {number} lacks {', '.join(missing)}")
    made = [Point(tuple((key, point[key]) for key in keys)) for point in flat]
    _check_different([point.name for point in made], "points: there is")
    return made


def _check_different(texts: Sequence[str], words: str) -> None:
    twice = next((text for text in texts if texts.count(text) > 1), None)
    if twice is not None:
        raise BadInput(f"{words} {twice} twice")
