"""The tables that decks share; each problem's Deck is a struct that adds its own fields.

A deck is a TOML file: `problem = "name"` and the fields of that problem's Deck.  Every field has
a default, a description and, where it can be said of one field alone, its bounds: the JSON schema
for editors is made from them.  Note: msgspec checks bounds and types when a deck is *read*
(`runs.deck.reading`), not when a struct is made in Python.

A problem's own deck reads:

    class MyDeck(Deck, kw_only=True):
        run: RunControl = RunControl(t_end=1e-3)
        mach: key(float, "Mach number of the shock", gt=1) = 1.2
"""

from __future__ import annotations

import collections
import contextlib
import hashlib
import operator
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Union, get_args

import msgspec
from msgspec import Meta

from shockgrid.regrid.equidistribution.weights import FIELDS, GEOMETRY, Expression
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.text_files import load_toml, read_text

if TYPE_CHECKING:
    from shockgrid.hydro.eos.materials import Material
    from shockgrid.regrid.protocol import Regridder

MOST_CELLS = 100_000  # along a side: arrays of one line stay small, whatever a deck says


def key(kind: Any, description: str, **bounds: Any) -> Any:
    """The annotation of a deck's key: its type, its description in the schema, its bounds.

    Of a type such as `float | None` the bounds are those of the number.
    """
    parts = [one for one in get_args(kind) if one is not type(None)]
    if len(parts) == len(get_args(kind)):
        return Annotated[kind, Meta(description=description, **bounds)]
    return key(Union[tuple(parts)], description, **bounds) | None  # noqa: UP007


Name = Annotated[str, Meta(pattern="^[A-Za-z][A-Za-z0-9_-]*$")]
Options = dict[str, bool | int | float | str]
NONE: Any = msgspec.field(default_factory=dict)  # of a key that is a table by name: no entry
Limiter = key(  # the names of hydro.formulas.reconstruction.LIMITERS
    Literal[
        "low-mach",
        "monotonised-central",
        "van-leer",
        "smooth-low-mach",
        "smooth-shear",
        "generalised-minmod",
        "minmod",
    ],
    "slope limiter, from sharp to smooth; the first three are steep: sharp fronts, with a sawtooth "
    "of single cells behind shocks; low-mach: monotonised-central, except for the velocity where "
    "the flow turns or shears without jumps, and smaller jumps of the velocity at faces where the "
    "flow is slow; smooth-low-mach: generalised-minmod with both; smooth-shear: with the first of "
    "both. Materials with a phase transition have no steep one: generalised-minmod stands for it",
)


class DeckTable(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """A table of a deck: frozen (`msgspec.structs.replace` changes a copy), no unknown keys.

    Where a deck gives some keys of a table, the keys left out come from the problem's default table
    if the class says `merges = True` (as for `run`), else from the class: a material given again
    must not inherit the density of the default one.  `keeps_defaults` may say so table by table.

    `runtime` names the keys that a restart may change, for they say how to march and not from
    what; another value of any other key is another run.

    `overruled` names keys that have no effect where another dotted key of the deck is set.

    `absent`, of a whole deck, says what the decks of runs meant that were begun before a key was.
    """

    merges: ClassVar[bool] = False
    overruled: ClassVar[dict[str, str]] = {}
    absent: ClassVar[dict[str, str | float]] = {}
    runtime: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def keeps_defaults(cls, table: Mapping[str, Any]) -> bool:
        """Do the keys that this table of a deck leaves out come from the problem's default?"""
        return cls.merges

    def error(self, name: str, words: str) -> BadInput:
        """The error about the key `name` (dotted): its value, and the sentence `words`."""
        value = operator.attrgetter(name)(self)
        shown = f"{value:g}" if isinstance(value, float) else repr(value)
        return BadInput(f"deck: {name} = {shown}; {words}")

    @contextlib.contextmanager
    def blame(self, name: str, words: str) -> Iterator[None]:
        """Say of an error of theory within this context that the value of key `name` is why."""
        try:
            yield
        except (BadInput, ValueError) as error:
            raise self.error(name, f"{words} ({error})") from error


class RunControl(DeckTable, kw_only=True):
    """How long and how to march."""

    merges = True
    runtime = ("t_end", "max_steps", "cfl", "small_cells", "threads", "cut")

    t_end: key(float | None, "end time [s]. If left out: the problem's", ge=1e-300, le=1e300) = None
    t_set_up: key(
        float | None,
        "end time [s] that lengths and motions are made for. If left out: t_end",
        ge=1e-300,
        le=1e300,
    ) = None
    max_steps: key(
        int | None, "greatest number of steps. If left out: no limit", ge=0, le=2**63 - 1
    ) = None
    cfl: key(float, "fraction of the stable time step", ge=1e-3, le=1) = 0.5
    small_cells: key(
        float | None,
        "fraction of cells that may be too small for a step, by state redistribution. If left out: "
        "0.05 where grids are rebuilt in every step, else 0",
        ge=0,
        le=0.1,
    ) = None
    threads: key(
        int | None,
        "threads; results stay the same. If left out: one per large block",
        ge=1,
        le=1024,
    ) = None
    cut: key(
        dict[str, Annotated[int, Meta(ge=1, le=1024)]],
        "largest number of MPI ranks that share a block, by its name. If left out: by its size",
    ) = {}


class Output(DeckTable, kw_only=True):
    """What a run leaves behind."""

    merges = True
    runtime = (
        "dumps", "every", "times", "fields", "precision", "compression", "restart_every", "columns",
    )  # fmt: skip

    dumps: key(int, "number of dumps after the first; 0: one at the end", ge=0, le=1_000_000) = 20
    every: key(float | None, "time [s] from dump to dump, in place of `dumps`", ge=1e-300) = None
    times: key(list[Annotated[float, Meta(gt=0)]], "times [s] of further dumps") = []
    fields: key(list[str], "fields in light dumps, such as rho and p; none: all there are") = []
    precision: key(Literal["double", "single"], "precision of light dumps") = "double"
    compression: key(int, "level of gzip for light dumps; 0: none", ge=0, le=9) = 0
    restart_every: key(float, "wall seconds between restart points; 0: none", ge=0) = 300.0
    columns: key(tuple[str, ...], "groups of history columns: a name, or FILE.py:FUNCTION") = ()

    @property
    def light(self) -> bool:
        """Are dumps pictures alone (light), all but the last, and not restart points too?"""
        return bool(self.fields) or self.precision != "double" or self.compression > 0


Coordinate = Annotated[float, Meta(ge=-1e12, le=1e12)]  # [m]


class Gauge(DeckTable, kw_only=True):
    """A point, or a line of points, at which the flow is written down after every step."""

    name: key(Name, "head of its columns in gauges.csv; a line's add _1, _2, ...", max_length=40)
    at: key(tuple[Coordinate, Coordinate], "place [x, y] [m], a line's first one")
    to: key(tuple[Coordinate, Coordinate] | None, "a line's last place [x, y] [m]") = None
    count: key(int, "points of a line, evenly from `at` to `to`", ge=1, le=10000) = 1
    moves: key(bool, "true: moves with the material; false: fixed in space") = False
    fields: key(
        list[str],
        "what is recorded: rho, u, v, p, e, the sound speed c, the temperature T, carried fields",
        min_length=1,
    ) = msgspec.field(default_factory=lambda: ["rho", "u", "v", "p"])


class VoidFill(DeckTable, kw_only=True):
    """The gas that a void holds from when bodies that meet close it off: p V^gamma stays."""

    merges = True

    pressure: key(float, "when it is closed off [Pa]; 0: nothing in it", ge=0, le=1e20) = 0.0
    gamma: key(float, "of the gas", gt=1, le=10) = 1.4


# keys of decks whose blocks may become one of two materials
HandoverKey = key(
    bool, "where the lines can no longer be followed, go on with both materials on one grid"
)
RefinementKey = key(int, "with handover: how much finer the grid of both materials is", ge=1, le=16)


class Regrid(DeckTable, kw_only=True):
    """Which regridder rebuilds the blocks, and with what options."""

    merges = True
    runtime = ("name", "epsilon", "method", "edge_lengths", "weight", "options")

    name: key(str, "name in the registry of regridders") = "barrier"
    epsilon: key(float, "weight of the orthogonality term of the barrier", ge=1e-12, lt=1) = 1e-3
    method: key(Literal["newton", "sweeps"], "a Newton step, or the paper's iteration") = "newton"
    edge_lengths: key(Literal["conditional", "unit"], "for a line's weights") = "conditional"
    weight: key(str, "where cells are to be small: a formula such as 1 + 5*|grad(rho)|/max") = ""
    options: key(Options, "more options of the regridder, passed on unchanged") = {}

    def check_weight(self, fields: tuple[str, ...] = FIELDS) -> None:
        """Raise BadInput for a weight that is no formula or has names other than `fields`'."""
        if self.weight:
            Expression(self.weight).check_names((*GEOMETRY, *fields))

    def make(self, **fixed: Any) -> Regridder:
        """A regridder for one block; `fixed` are options the problem sets (threads, family).

        Raises BadInput for names and options that do not exist.
        """
        from shockgrid.regrid.registry import make_regridder  # numba is slow to load; a deck is not

        if "name" in self.options:
            raise BadInput('regrid.options has "name"; the regridder is named by regrid.name')
        fixed = {name: value for name, value in fixed.items() if value is not None}
        chosen = {**fixed, **self.options}
        if self.weight:
            chosen["weight"] = self.weight
        if self.name.startswith("barrier"):
            own = ("epsilon", "method", "edge_lengths")
            chosen = {name: getattr(self, name) for name in own} | chosen
        return make_regridder(self.name, **chosen)


class Deck(DeckTable, kw_only=True):
    """What every problem's deck has."""

    run: RunControl = RunControl()
    output: Output = Output()
    gauge: key(list[Gauge], "points at which the flow is recorded after every step") = []
    digests: key(dict[str, str], "sha256 of the files, which a run stores by itself") = NONE

    def find_files(self, folder: Path) -> Deck:
        """The same deck with full paths of the files that it names, and with their digests.

        folder: that of the deck.  Materials of a file, and the tables that they name, are found in
        every deck; a deck with other files places these (`place_own_files`).
        """
        names: list[str] = []
        placed = _place_columns(_place_materials(self, folder, names), folder, names)
        placed = placed.place_own_files(folder, names)
        digests = compute_digests(names, self.digests)
        return msgspec.structs.replace(placed, digests=digests)

    def place_own_files(self, folder: Path, names: list[str]) -> Deck:
        """The same deck with full paths of the files that only this kind of deck can name; these
        are appended to `names`."""
        return self

    def find_cautions(self) -> list[str]:
        """Cautions that follow from keys which all decks of its kind have."""
        return []


MOST_POINTS = 10_000  # of all gauges together


def place_gauges(tables: Iterable[Gauge]) -> list[Gauge]:
    """The points of the `[[gauge]]` tables in their order, a gauge without `to` each.

    Raises BadInput for a name that comes twice and for a line without `to` or of one point.
    """
    tables = list(tables)
    if (count := sum(gauge.count for gauge in tables)) > MOST_POINTS:
        raise BadInput(f"deck: gauge: {count} points in all; at most {MOST_POINTS} are followed")
    points: list[Gauge] = []
    for number, gauge in enumerate(tables):
        key = f"deck: gauge.{number} ({gauge.name!r})"
        if (gauge.to is None) != (gauge.count == 1):
            missing = "a line needs its end `to`" if gauge.to is None else "give `count` above 1"
            raise BadInput(f"{key}: count = {gauge.count}; {missing}")
        fields = list(dict.fromkeys(gauge.fields))
        for k in range(gauge.count):
            part = k / (gauge.count - 1) if gauge.to else 0.0
            ends = zip(gauge.at, gauge.to or gauge.at, strict=True)
            at = tuple((1.0 - part) * first + part * last for first, last in ends)
            name = f"{gauge.name}_{k + 1}" if gauge.to else gauge.name
            alone = {"name": name, "at": at, "to": None, "count": 1, "fields": fields}
            points.append(msgspec.structs.replace(gauge, **alone))
    for name, count in collections.Counter(point.name for point in points).items():
        if count > 1:
            raise BadInput(f"deck: {count} gauges are called {name!r}; give them different names")
    return points


DIGESTS = "digests"  # key of every deck


def place_file(name: str, folder: Path) -> str:
    """The full path of file `name`, from `folder` where it is relative; ~ is the home folder."""
    return str((folder / Path(name).expanduser()).resolve())


def find_file(name: str, folder: Path) -> str:
    """The full path of file `name` in `folder` or, where it is not there, from here."""
    placed = place_file(name, folder)
    here = place_file(name, Path())
    return here if Path(here).is_file() and not Path(placed).is_file() else placed


OWN_MATERIAL = re.compile(r"([^\n]+\.toml):([^:\n]+)")  # FILE.toml:NAME


def _place_materials(value: Any, folder: Path, names: list[str]) -> Any:
    """A part of a deck, its materials of files with full paths; the files are appended to `names`.

    Also those of tables that a material needs: in such a file, or in a material that is written in
    the deck itself.
    """
    if isinstance(value, DeckTable):
        parts = {name: getattr(value, name) for name in value.__struct_fields__}
        placed = {name: _place_materials(part, folder, names) for name, part in parts.items()}
        changed = {name: part for name, part in placed.items() if part is not parts[name]}
        return msgspec.structs.replace(value, **changed) if changed else value
    if isinstance(value, list | tuple):
        entries = [_place_materials(entry, folder, names) for entry in value]
        changes = any(new is not old for new, old in zip(entries, value, strict=True))
        return type(value)(entries) if changes else value
    if isinstance(value, dict) and "eos" in value and isinstance(value.get(TABLE_KEY), str):
        names.append(find_file(value[TABLE_KEY], folder))
        return {**value, TABLE_KEY: names[-1]}
    if isinstance(value, str) and (found := OWN_MATERIAL.fullmatch(value)):
        file = find_file(found[1], folder)
        tables = _list_tables(file, found[2])
        if tables is not None:
            names += [file, *tables]
            return f"{file}:{found[2]}"
    return value


COLUMNS_OF_FILE = re.compile(r"([^\n]+\.py):(\w+)")  # FILE.py:FUNCTION in output.columns


def _place_columns(deck: Deck, folder: Path, names: list[str]) -> Deck:
    """The deck with full paths of the files of its history columns; these are appended."""
    placed = []
    for name in deck.output.columns:
        if of_file := COLUMNS_OF_FILE.fullmatch(name):
            names.append(find_file(of_file[1], folder))
            name = f"{names[-1]}:{of_file[2]}"
        placed.append(name)
    if not placed:
        return deck
    output = msgspec.structs.replace(deck.output, columns=tuple(placed))
    return msgspec.structs.replace(deck, output=output)


TABLE_KEY = "path"  # of a material: its file with a table of pressures


def _list_tables(file: str, name: str) -> list[str] | None:
    """The files with tables that material `name` of a file needs; None where it cannot be read."""
    from shockgrid.hydro.eos.materials import (
        find_name,  # loads numba, which most decks' names do not need
    )

    try:
        table = load_toml(read_text(file))[find_name(f"{file}:{name}")].get(TABLE_KEY)
    except (OSError, ValueError, KeyError, AttributeError, BadInput):  # reported where it is used
        return None
    return [place_file(table, Path(file).parent)] if isinstance(table, str) else []


def compute_digests(names: Iterable[str], known: Mapping[str, str]) -> dict[str, str]:
    """The digests (sha256) of those of the files that can be read; known ones are kept."""
    return {
        name: known.get(name) or hashlib.sha256(Path(name).read_bytes()).hexdigest()
        for name in dict.fromkeys(names)
        if name in known or Path(name).is_file()
    }


def check_digests(digests: Mapping[str, str]) -> None:
    """Raise BadInput for a file that is gone or is no longer the one of its digest."""
    for name, digest in digests.items():
        if not Path(name).is_file():
            raise BadInput(f"{name}, which the deck names, is gone")
        if compute_digests([name], {})[name] != digest:
            raise BadInput(
                f"{name} has changed since this deck was stored (key digests)"
                ": restore the file, or start a new run"
            )


def check_solid(key: str, label: str, material: Material) -> None:
    """Raise BadInput for a body's material that burns, or has no sound speed at p = 0."""
    eos = material.eos
    rho = material.rho0
    if eos.kind == "jwl":
        why = "an explosive, known by its burnt products; nothing burns here, use an inert material"
        raise BadInput(f"deck: {key} is {label!r}, {why}")
    if not float(eos.sound_speed(rho, 0.0)) > 0.0:
        why = "which has no sound speed at p = 0; it must be a condensed material"
        if eos.kind == "tabular":
            why = f"whose table must hold p = 0 at its density, {rho:g} kg/m3"
        raise BadInput(f"deck: {key} is {label!r}, {why}")
