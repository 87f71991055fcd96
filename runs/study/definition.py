"""Definition of a study: a deck, settings and varied keys, from the command line or a TOML file.

deck = "interface-instability"      # a problem, a packaged deck, a file (beside this one)
shown = ["growth_rate"]             # what pictures are of; left out: the problem's results
[set]                               # keys of the deck, the same for all points
cells = 32
[vary]                              # the product of these, ...
mach = "1.1:10:10:log"
second.rho = [0.1, 3, 20]

points = [{ mach = 1.2, cells = 32 }, ...]      # ... or points one by one instead
"""

from __future__ import annotations

import hashlib
import itertools
import math
import re
import shlex
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import tomli_w
from msgspec import Meta

from shockgrid.problems.registry import PROBLEMS
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.text_files import TooMuch, cut, load_toml
from shockgrid.runs.deck.checking import check_deck
from shockgrid.runs.deck.reading import parse_value, read_toml
from shockgrid.runs.store.directory import STUDY_FILE, RunDirectory

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
RANGE = re.compile(rf"({NUMBER}):({NUMBER}):(\d+)(?::(log))?")
LIKE_RANGE = re.compile(rf"{NUMBER}:{NUMBER}|[^,'\"\[{{]*:[^,'\"\[{{]*:[^,'\"\[{{]*")
MOST_VALUES = 100_000  # of one range
VALUE_DIGITS = 6
LONGEST_NAME = 120  # of a folder
MOST_WHOLE = 1e15  # floats from here on keep their exponent
SHORT_NAME_CHARACTERS = 40  # a longer value is cut in a folder's name


class Point(dict[str, Any]):
    """One point: the varied keys with their values, in order."""

    @property
    def name(self) -> str:
        """The name of its folder, such as `mach=1.2,cells=32`; other characters are hashed.

        It does not depend on other points, so these can be added or removed.
        """
        name = ",".join(f"{key}={_shorten(value)}" for key, value in self.items())
        if len(name) > LONGEST_NAME:
            name = f"{name[:LONGEST_NAME]}-{_digest(name)}"
        return name or "deck"


def _shorten(value: Any) -> str:
    if isinstance(value, float) and value.is_integer() and abs(value) < MOST_WHOLE:
        value = int(value)  # 3.0 and 3 are one point
    text = value if isinstance(value, str) else write_value(value)
    plain = re.sub(r"[^\w.+-]+", "-", text)[:SHORT_NAME_CHARACTERS]
    return plain if plain == text else f"{plain.strip('-')}-{_digest(text)}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:6]


def write_value(value: Any, key: str = "vary") -> str:
    """A value as TOML in one place, tables in braces; BadInput for what TOML cannot express."""
    try:
        text = tomli_w.dumps({"list": [0, _make_plain(value)]})  # in a list tables are in braces
    except TypeError as error:
        raise BadInput(f"{key} = {value!r}: a deck cannot hold this; give a number or text, or "
                       "leave it out") from error  # fmt: skip
    text = text[text.index("0,") + 2 : text.rindex("]")].strip().removesuffix(",")
    return re.sub(r"\n *", " ", text)  # a line's end within a text is written otherwise


def _make_plain(value: Any) -> Any:
    """Numbers of numpy as those of Python, paths as text."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _make_plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_make_plain(entry) for entry in value]
    return str(value) if isinstance(value, Path) else value


def make_column(values: Sequence[Any]) -> np.ndarray:
    """Values of a key: whole numbers, floats, or text (tables and lists as TOML)."""
    kinds = {type(value) for value in values}
    if kinds == {int}:
        return np.array(values, dtype=np.int64)
    if kinds <= {int, float}:
        return np.array(values, dtype=float)
    return np.array([v if isinstance(v, str) else write_value(v) for v in values], dtype=str)


def read_vary(text: str) -> tuple[str, list[Any]]:
    """Key and values of `KEY=WORDS`, as `--vary` takes it."""
    key, equals, values = text.partition("=")
    if not equals or not key.strip() or not values.strip():
        raise BadInput(
            f"--vary {text!r}: the form is KEY=A:B:N, KEY=A:B:N:log or KEY=V1,V2,..., such as "
            "mach=1.2:3:7"
        )
    return key.strip(), read_values(values.strip(), f"--vary {key.strip()}")


def read_values(words: str, where: str) -> list[Any]:
    """The values given by `words`: a range or a list; `where` starts the message of BadInput."""
    if LIKE_RANGE.fullmatch(words):
        match = RANGE.fullmatch(words)
        values = _list_range(*match.groups()) if match else []
        if not values:
            raise BadInput(
                f"{where} = {words}: a range is A:B:N or A:B:N:log, such as 1.2:3:7, with two "
                f"different finite ends, above 0 for log, and N from 2 to {MOST_VALUES}"
            )
        return values
    try:
        return list(load_toml(f"values = [{words}]")["values"])
    except (TooMuch, tomllib.TOMLDecodeError) as error:
        if isinstance(error, TooMuch) or any(sign in words for sign in "[{\"'"):
            raise BadInput(f"{where} = {cut(words)}: not a list of values: {error}") from error
    return [parse_value(word) for word in words.split(",") if word.strip()]


def _list_range(first: str, last: str, count: str, log: str | None) -> list[Any]:
    """The values of a range; [] if it is not one."""
    start, end = float(first), float(last)
    number = int(count) if len(count) < 10 else 0
    good = 2 <= number <= MOST_VALUES and start != end and math.isfinite(start - end)
    if not good or (log and min(start, end) <= 0.0):
        return []
    values = np.geomspace(start, end, number) if log else np.linspace(start, end, number)
    rounded = [float(f"{value:.{VALUE_DIGITS}g}") for value in values]
    if len(set(rounded)) < number:  # closer than the digits resolve
        rounded = values.tolist()
    whole = not set(".eE") & set(first + last) and all(value.is_integer() for value in rounded)
    return [int(value) for value in rounded] if whole else rounded


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
        _check_different([Point({key: value}) for value in values], "vary")
    return [Point(zip(vary, values, strict=True)) for values in itertools.product(*vary.values())]


def list_points(points: Iterable[Mapping[str, Any]]) -> list[Point]:
    """Points given one by one; BadInput if one lacks a key of the others, or two are equal."""
    given = list(points)
    if wrong := [point for point in given if not isinstance(point, Mapping)]:
        raise BadInput(f"points: {wrong[0]!r} must be a table of keys with values")
    flat = [flatten(point) for point in given]
    keys = list(dict.fromkeys(key for point in flat for key in point))
    for number, point in enumerate(flat, start=1):
        if missing := [key for key in keys if key not in point]:
            raise BadInput(f"points: number {number} lacks {', '.join(missing)}")
    made = [Point({key: point[key] for key in keys}) for point in flat]
    _check_different(made, "points")
    return made


def _check_different(points: Sequence[Point], what: str) -> None:
    name, times = Counter(point.name for point in points).most_common(1)[0]
    if times > 1:
        raise BadInput(f"{what}: there is {name} twice")


FILE = STUDY_FILE


class StudyFile(msgspec.Struct, kw_only=True, forbid_unknown_fields=True):
    """A study file, as `check_deck` checks it."""

    deck: Annotated[str, Meta(min_length=1, description="problem, packaged deck or deck file")]
    set: dict[str, Any] = msgspec.field(default_factory=dict)
    vary: dict[str, Any] = msgspec.field(default_factory=dict)
    points: list[dict[str, Any]] = msgspec.field(default_factory=list)
    shown: Annotated[list[str], Meta(description="quantities of the picture")] = msgspec.field(
        default_factory=list
    )


@dataclass(frozen=True)
class Definition:
    """A study: `source` as for `runs.deck.reading.read_deck`, `fixed` keys of all points.

    vary: the values of each key if the points are their product; {} if they are listed. shown:
    names of plotted quantities; () for the problem's results.  function: computes a point from its
    values and the fixed ones as keywords, in place of a deck.
    """

    source: str
    fixed: Mapping[str, Any]
    points: tuple[Point, ...]
    vary: Mapping[str, Sequence[Any]]
    shown: tuple[str, ...] = ()
    function: Callable[..., Mapping[str, float]] | None = None

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied keys."""
        return tuple(self.points[0])

    @property
    def settings(self) -> tuple[str, ...]:
        """The fixed keys as `read_deck` takes them."""
        return write_settings(self.fixed)

    @property
    def deck(self) -> str:
        """The deck as a study file names it: by its full path if it is a file."""
        path = Path(self.source)
        return str(path.resolve()) if path.is_file() else self.source

    def to_toml(self) -> str:
        """An equivalent study file, with the full path of its deck if that is a file."""
        points = [] if self.vary else self.points
        parts = {"shown": self.shown, "points": points, "set": self.fixed, "vary": self.vary}
        given = {name: _make_plain(part) for name, part in parts.items() if part}
        return tomli_w.dumps({"deck": self.deck, **given})


def write_settings(values: Mapping[str, Any]) -> tuple[str, ...]:
    """Values by key as settings of a deck, `key=value`; BadInput for values that TOML lacks."""
    return tuple(f"{key}={write_value(value, key)}" for key, value in values.items())


def make_definition(
    source: str | Callable[..., Mapping[str, float]],
    vary: Mapping[str, Any] | None = None,
    points: Sequence[Mapping[str, Any]] = (),
    fixed: Mapping[str, Any] | None = None,
    shown: Sequence[str] = (),
) -> Definition:
    """A study from Python values; BadInput if nothing or too much is varied.

    vary: by key a sequence of values, a text as for `--vary` ("1.2:3:7"), or one value.
    """
    vary = {key: _list_values(key, given) for key, given in flatten(vary or {}).items()}
    if bool(vary) == bool(points):
        raise BadInput(
            "a study varies something: give either `vary` (--vary KEY=VALUES), whose product it "
            "computes, or `points`"
        )
    made = tuple(list_points(points) if points else make_product(vary))
    fixed = dict(fixed or {})
    if both := [key for key in made[0] if key in fixed]:
        raise BadInput(f"vary: {both[0]} is set, too; leave one of them out")
    if isinstance(source, str):
        write_settings(fixed)  # refused here for what no deck can hold
        return Definition(source, fixed, made, vary, tuple(shown))
    name = f"{source.__module__}:{getattr(source, '__qualname__', repr(source))}"
    return Definition(name, fixed, made, vary, tuple(shown), source)


def _list_values(key: str, given: Any) -> list[Any]:
    """The values of a key: text is read as for --vary, anything but a sequence is one value."""
    if isinstance(given, str):
        return read_values(given.strip(), f"vary: {key}")
    if isinstance(given, np.ndarray):
        given = given.tolist()
    return list(given) if isinstance(given, Iterable) else [given]


def is_study(source: str) -> Path | None:
    """The study file of `source`: itself, or the one in a study's folder; otherwise None.

    BadInput for any other folder.
    """
    path = Path(source)
    if path.is_dir() and source not in PROBLEMS:
        if (path / FILE).is_file():
            return path / FILE
        reason = f"there is no {FILE} in it"
        if RunDirectory(path).deck.is_file():
            reason = f"it is a run; continue it with shockgrid restart {shlex.quote(source)}"
        raise BadInput(f"{source} is not a study: {reason}")
    if path.suffix != ".toml" or not path.is_file():
        return None
    table = read_toml(path)
    return path if "deck" in table and "problem" not in table else None


def check_same_deck(folder: Path, definition: Definition) -> None:
    """Raise BadInput if the study in `folder` is of a deck of another name than `definition`."""
    file = folder / FILE
    given = definition.deck
    there = str(read_toml(file).get("deck")) if file.is_file() else given
    if Path(there).name != Path(given).name:
        raise BadInput(
            f"{folder} holds a study of {there}, not of {given}; choose another folder with -o, or "
            f"continue the study there: shockgrid study {shlex.quote(str(folder))}"
        )


def read_definition(path: Path) -> Definition:
    """The study in a file; BadInput with key, place and what is expected."""
    table = read_toml(path)
    check_deck(table, StudyFile, lambda key: str(path))
    file = msgspec.convert(table, StudyFile)
    beside = path.parent / file.deck
    source = str(beside) if beside.is_file() else file.deck
    try:
        return make_definition(source, file.vary, file.points, flatten(file.set), file.shown)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from error
