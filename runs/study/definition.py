"""What a study is: a deck, settings over it, what is varied; from the command line or a TOML file.

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

import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import tomli_w
from msgspec import Meta

from problems.registry import PROBLEMS
from regrid.errors import BadInput
from runs.deck.checking import check_deck
from runs.deck.reading import read_toml
from runs.store.directory import STUDY_FILE, RunDirectory
from runs.study.points import (
    Point,
    flatten,
    list_points,
    make_product,
    read_values,
    write_value,
)

FILE = STUDY_FILE
MOST_POINTS = 1_000_000


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
    """A study: `source` as `runs.deck.reading.read_deck` takes it, with `settings`.

    vary: the values of each key, where the points are their product; {} where they are listed.
    shown: names of what pictures are of; () where the problem's results are.
    """

    source: str
    settings: tuple[str, ...]
    points: tuple[Point, ...]
    vary: Mapping[str, Sequence[Any]]
    shown: tuple[str, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """What is varied."""
        return tuple(key for key, _ in self.points[0].values)

    @property
    def deck(self) -> str:
        """The deck as a study file names it: under its full path where it is a file."""
        path = Path(self.source)
        return str(path.resolve()) if path.is_file() else self.source

    def to_toml(self) -> str:
        """A study file that means the same, its deck under its full path where it is a file."""
        table: dict[str, Any] = {"deck": self.deck}
        if self.shown:
            table["shown"] = list(self.shown)
        lines = [tomli_w.dumps(table)]
        if not self.vary:
            rows = (
                ", ".join(f'"{key}" = {write_value(value)}' for key, value in point.values)
                for point in self.points
            )
            lines.append("points = [\n" + "".join(f"  {{ {row} }},\n" for row in rows) + "]\n")
        if self.settings:
            pairs = (setting.partition("=") for setting in self.settings)
            lines.append("[set]\n" + "".join(f'"{key.strip()}" = {v}\n' for key, _, v in pairs))
        if self.vary:
            rows = (f'"{key}" = {write_value(list(v))}\n' for key, v in self.vary.items())
            lines.append("[vary]\n" + "".join(rows))
        return "\n".join(lines)


def make_definition(
    source: str,
    vary: Mapping[str, Any] | None = None,
    points: Sequence[Mapping[str, Any]] = (),
    settings: Mapping[str, Any] | None = None,
    shown: Sequence[str] = (),
) -> Definition:
    """A study from Python values; BadInput where nothing or too much is varied.

    vary: by key a sequence of values, the words that `--vary` takes ("1.2:3:7"), or one value.
    """
    vary = {key: _list_values(key, given) for key, given in flatten(vary or {}).items()}
    if bool(vary) == bool(points):
        raise BadInput(
            "a study varies something: give either `vary` (--vary KEY=VALUES), whose product it "
            "computes, or `points`"
        )
    count = 1
    for values in vary.values():
        count *= len(values)
    if count > MOST_POINTS:
        raise BadInput(f"vary: {count:.3g} points are too many, {MOST_POINTS:.0e} is the most")
    made = list_points(points) if points else make_product(vary)
    fixed = {key: write_value(value) for key, value in (settings or {}).items()}
    both = [key for key, _ in made[0].values if key in fixed]
    if both:
        raise BadInput(f"vary: {both[0]} is set, too; leave one of them out")
    texts = tuple(f"{key}={text}" for key, text in fixed.items())
    return Definition(source, texts, tuple(made), vary, tuple(shown))


def _list_values(key: str, given: Any) -> list[Any]:
    """The values of a key: words are read as those of --vary, what is no sequence is one value."""
    if isinstance(given, str):
        return read_values(given.strip(), f"vary: {key}")
    if isinstance(given, np.ndarray):
        given = given.tolist()
    return list(given) if isinstance(given, Iterable) else [given]


def is_study(source: str) -> Path | None:
    """The study file that `source` means: itself, or the one of a study's folder; else None.

    BadInput for any other folder.
    """
    path = Path(source)
    if path.is_dir() and source not in PROBLEMS:
        if (path / FILE).is_file():
            return path / FILE
        words = f"there is no {FILE} in it"
        if RunDirectory(path).deck.is_file():
            words = f"it is a run; shockgrid restart {shlex.quote(source)} goes on with it"
        raise BadInput(f"{source} is no study: {words}")
    if path.suffix != ".toml" or not path.is_file():
        return None
    table = read_toml(path)
    return path if "deck" in table and "problem" not in table else None


def check_same_deck(folder: Path, definition: Definition) -> None:
    """Raise BadInput where the study in `folder` is of another deck than `definition`.

    A deck file that was moved and kept its name is the same.
    """
    file = folder / FILE
    if not file.is_file():
        return
    there = read_toml(file).get("deck")
    if not isinstance(there, str):
        return
    beside, given = folder / there, definition.deck
    there = str(beside.resolve()) if beside.is_file() else there
    if there == given:
        return
    if (
        not Path(there).exists()
        and Path(there).parent != Path()
        and (Path(there).name == Path(given).name)
    ):
        return
    raise BadInput(
        f"{folder} holds a study of {there}, not of {given}; choose another folder with -o, or go "
        f"on with the study there: shockgrid study {shlex.quote(str(folder))}"
    )


def read_definition(path: Path) -> Definition:
    """The study in a file; BadInput with key, place and what would be right."""
    table = read_toml(path)
    check_deck(table, StudyFile, lambda key: str(path))
    file = msgspec.convert(table, StudyFile)
    vary = {}
    for key, given in flatten(file.vary).items():
        values = read_values(given, f"{path}: vary.{key}") if isinstance(given, str) else given
        if not isinstance(values, list):
            raise BadInput(
                f'{path}: vary.{key} = {given!r}; it has to be a list or a range such as "1:3:5"'
            )
        vary[key] = values
    beside = path.parent / file.deck
    source = str(beside) if beside.is_file() else file.deck
    try:
        return make_definition(source, vary, file.points, flatten(file.set), file.shown)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from error
