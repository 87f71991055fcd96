"""A run directory as data: deck, history, dumps, each read when it is first asked for."""

from __future__ import annotations

import contextlib
import importlib
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.problems.problem import Problem
from shockgrid.problems.report import align
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.measure.corners import compute_centres
from shockgrid.runs.deck.reading import ReadDeck, read_toml
from shockgrid.runs.quantities import describe_time
from shockgrid.runs.store.directory import (
    RunDirectory,
    check_deck,
    check_noted,
    open_directory,
    read_run_deck,
    read_verdict,
)
from shockgrid.runs.store.dumps import damage_told, open_dump, read_state
from shockgrid.runs.store.history import read_columns, read_history, read_rows

MOST_ROWS = 30  # of a table on the screen


class NotThere(BadInput, KeyError):
    """A field or a column that is asked for and is not there."""

    def __str__(self) -> str:  # that of KeyError would put it in quotes
        return str(self.args[0])


class Table(dict[str, np.ndarray]):
    """Columns by name, one value a row; `table.t` is `table["t"]`.  It prints as a table.

    `units` maps columns to their SI unit, as far as it is known.  An unknown name raises
    AttributeError or, in brackets, BadInput, which here is a KeyError too.
    """

    def __init__(
        self,
        columns: Mapping[str, np.ndarray],
        name: str = "table",
        index: str = "",
        find_units: Callable[[], Mapping[str, str]] = dict,
    ):
        super().__init__(columns)
        self.name = name
        self._index = index
        self._find_units = find_units

    @property
    def units(self) -> dict[str, str]:
        return {key: unit for key, unit in self._find_units().items() if key in self}

    def __missing__(self, name: str) -> np.ndarray:
        raise NotThere(f"the {self.name} has no column {name!r}{suggest(str(name), self)}")

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):  # asked for by copies, before there is anything
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(str(error)) from None

    def __reduce__(self) -> tuple:
        return Table, (dict(self), self.name, self._index, self._find_units)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self})

    def __repr__(self) -> str:
        rows = len(next(iter(self.values()), ()))
        return f"<{self.name}: {rows} rows, {len(self)} columns: {', '.join(self)}>"

    def __str__(self) -> str:
        return "\n".join(self.make_rows(list(self)))

    def make_rows(self, names: Sequence[str]) -> list[str]:
        """The table in words: the heads, then MOST_ROWS of the rows at most."""

        def say(value: Any) -> str:
            if isinstance(value, np.floating):
                return "-" if np.isnan(value) else f"{value:.6g}"
            return str(value)

        cells = [[name, *map(say, self[name][:MOST_ROWS])] for name in names]
        rows = align(list(zip(*cells, strict=True)))
        more = len(self[names[0]]) - MOST_ROWS if names else 0
        return [*rows, f"  ... and {more} more"] if more > 0 else rows

    def to_xarray(self) -> Any:
        """An xarray.Dataset over the rows, units as attributes.

        Raises BadInput where xarray is not installed.
        """
        units = self.units
        index = self._index
        data = {
            name: (index or "row", values, {"units": units[name]} if name in units else {})
            for name, values in self.items()
        }
        dataset = load_package("xarray", "to_xarray").Dataset(data)
        return dataset.set_coords([name for name in (index, "t") if index and name in self])

    def to_pandas(self) -> Any:
        """A pandas.DataFrame, a row each; `step` is the index of a history.

        Raises BadInput where pandas is not installed.
        """
        frame = load_package("pandas", "to_pandas").DataFrame(dict(self))
        return frame.set_index(self._index) if self._index in self else frame


def load_package(name: str, call: str) -> Any:
    """An optional package; BadInput that says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise BadInput(
            f"{call} needs {name}, which is not installed here: python -m pip install {name}"
        ) from error


class Fields(Mapping[str, np.ndarray]):
    """Fields of a block by name; an array is read when it is asked for, once if it is to be kept.

    read: gives the array of a name; it can be copied to another process where it is no closure.
    """

    def __init__(
        self, where: str, names: Iterable[str], read: Callable[[str], np.ndarray], keep=False
    ):
        self._where = where
        self._names = tuple(names)
        self._read = read
        self._keep = keep
        self._known: dict[str, np.ndarray] = {}

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._names:
            there = ", ".join(self._names) or "none"
            raise NotThere(
                f"{self._where} has no field {name!r}; there are: {there} "
                "(output.fields of a deck chooses those of dumps)"
            )
        if name in self._known:
            return self._known[name]
        values = self._read(name)
        if self._keep:
            self._known[name] = values
        return values

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


@dataclass(repr=False, eq=False)
class BlockData:
    """A block of a dump or of a flow in memory: `nodes` (2, ni+1, nj+1) [m], and its fields.

    SI units.  `cell_fields` (ni, nj) and `node_fields` (ni+1, nj+1) by name; each is an attribute
    too: `block.rho`.  An unknown name raises AttributeError with those that there are.
    """

    name: str
    material: str
    axes: tuple[str, str]  # their names on pictures: x and y, or x and r
    get_nodes: Callable[[], np.ndarray]
    cell_fields: Fields
    node_fields: Fields
    state_fields: Fields  # of the cells, beside what is drawn: `rates` [1/s]
    units: Mapping[str, str]
    long_names: Mapping[str, str]

    @property
    def nodes(self) -> np.ndarray:
        """Nodes (2, ni+1, nj+1) [m]."""
        return self.get_nodes()

    @property
    def centres(self) -> np.ndarray:
        """Middles of the cells (2, ni, nj) [m]."""
        return compute_centres(self.nodes)

    @property
    def cells(self) -> tuple[int, int]:
        """Cells along i and along j."""
        _, ni, nj = self.nodes.shape
        return ni - 1, nj - 1

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_") or "node_fields" not in self.__dict__:
            raise AttributeError(name)
        for fields in (self.cell_fields, self.node_fields):
            if name in fields:
                return fields[name]
        known = [*self.cell_fields, *self.node_fields]
        raise AttributeError(f"block {self.name!r} has no field {name!r}{suggest(name, known)}")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.cell_fields, *self.node_fields})

    def __repr__(self) -> str:
        ni, nj = self.cells
        return f"<block {self.name}: {self.material}, {ni} x {nj} cells>"


def _read_array(path: Path, group: str, name: str) -> np.ndarray:
    with open_dump(path) as file, damage_told(path, f"{group}/{name}"):
        return file[group][name][()]


def _read_block(path: Path, group: Any) -> BlockData:
    """The block of a dump's group; an array is read at its first use."""
    name: str = group.name.rsplit("/", 1)[-1]
    nodes = np.stack([group["x"][()], group["y"][()]])
    radial = str(group["y"].attrs.get("long_name", "")).startswith("r ")
    cells = tuple(n - 1 for n in nodes.shape[1:])
    fields = {n: d for n, d in group.items() if d.ndim == 2 and n not in ("x", "y")}
    state = group.file.get(f"state/{name}", {})

    def make_fields(there: Mapping[str, Any], shape: tuple, folder: str = "blocks") -> Fields:
        names = [n for n, data in there.items() if getattr(data, "shape", ()) == shape]
        read = partial(_read_array, path, f"{folder}/{name}")
        return Fields(f"{path}: block {name!r}", names, read, keep=True)

    return BlockData(
        name,
        str(group.attrs["material"]),
        ("x", "r" if radial else "y"),
        nodes.view,
        make_fields(fields, cells),
        make_fields(fields, nodes.shape[1:]),
        make_fields(state, cells, "state"),
        {n: str(data.attrs.get("units", "1")) for n, data in fields.items()},
        {n: str(data.attrs.get("long_name", n)) for n, data in fields.items()},
    )


class Snapshot:
    """A state at one time: `t`, `t_unit`, `t_end`, `step`, and its `blocks`; `state["gas"].rho`."""

    is_restart_point = False  # by wall time, and no dump of the deck's?
    run: Any = None  # the `RunData` that it is from

    def __init__(self, path: Path, t: float, t_end: float, t_unit: str, step: int):
        self.path = path
        self.t = t
        self.t_end = t_end
        self.t_unit = t_unit
        self.step = step

    blocks: list[BlockData]

    def __fspath__(self) -> str:
        return str(self.path)

    @property
    def length_unit(self) -> str:
        """Unit of the nodes: "m", or "1" where the deck's numbers have no units."""
        return "1" if self.t_unit == "1" else "m"

    @property
    def scaled_time(self) -> str:
        """The time as pictures of the problem name it, such as `k c t = 3`; "" where that is t."""
        try:
            return "" if self.run is None else self.run.problem.scale_time(self.t)
        except BadInput:  # a deck of another version can still be drawn
            return ""

    @property
    def axes(self) -> tuple[str, str]:
        """Names of the plane's coordinates: x and y, or x and r in axisymmetric flow."""
        return self.blocks[0].axes if self.blocks else ("x", "y")

    @property
    def cells(self) -> int:
        """Cells of all blocks together."""
        return sum(math.prod(block.cells) for block in self.blocks)

    def block(self, name: str) -> BlockData:
        """The block called `name`."""
        for block in self.blocks:
            if block.name == name:
                return block
        names = ", ".join(block.name for block in self.blocks)
        raise BadInput(f"{self.path} has no block {name!r}; there are: {names}")

    def __getitem__(self, name: str) -> BlockData:
        return self.block(name)

    def field_names(self) -> list[str]:
        """Names of the fields of cells that any block has, in their order."""
        return list(dict.fromkeys(name for block in self.blocks for name in block.cell_fields))

    def __repr__(self) -> str:
        names = ", ".join(block.name for block in self.blocks)
        return f"<state of step {self.step}, {describe_time(self.t, self.t_unit)}, blocks {names}>"


class Dump(Snapshot):
    """One dump, besides a `Snapshot`: `problem`, `finished`, `deck_text`, `provenance`."""

    def __init__(self, path: str | os.PathLike, run: Any = None):
        path = Path(path)
        self.run = run
        with open_dump(path) as file, damage_told(path, "its attributes"):
            at = file.attrs
            unit = str(at.get("t_unit", "s"))
            super().__init__(path, float(at["t"]), float(at["t_end"]), unit, int(at["step"]))
            self.problem = str(at["problem"])
            self.finished = str(at["finished"])
            self.deck_text = str(at["deck"])
            made = dict(file["provenance"].attrs) if "provenance" in file else {}
            self.has_state = "state" in file  # can a run go on from it?  Not so for light dumps
        self.provenance = {name: str(value) for name, value in made.items()}  # what made it
        self.is_restart_point = path.name.startswith("restart")

    @cached_property
    def blocks(self) -> list[BlockData]:  # type: ignore[override]
        with open_dump(self.path) as file, damage_told(self.path, "its blocks"):
            return [_read_block(self.path, group) for group in file["blocks"].values()]

    def state(self) -> dict[str, Any]:
        """The restart state."""
        return read_state(self.path)


UNITS_OF_CONTACTS = {"contact_length": "m", "void_area": "m2"}  # columns of any problem


class RunData:
    """Lazy access to a run directory: `.deck`, `.history`, `.dumps`, `.problem`.

    What is damaged raises BadInput when it is asked for.  `lenient`: damaged dumps are left out and
    a damaged deck or summary is taken as it is; the sentences stand in `skipped`.
    """

    def __init__(self, path: str | os.PathLike, lenient: bool = False):
        self.lenient = lenient
        self.skipped: list[str] = []  # sentences about what is damaged
        self.directory: RunDirectory = open_directory(path)
        self.path = self.directory.path
        self.table = read_toml(self.directory.deck)
        self.problem_name = str(self.table.get("problem", ""))
        self.said: list[str] = []  # sentences about what is wrong and harms nothing
        for check in (check_deck, lambda home: check_noted(home, home.summary)):
            try:
                self.said += filter(None, [check(self.directory)])
            except BadInput as error:
                if not lenient:
                    raise
                self.skipped.append(str(error))

    def __fspath__(self) -> str:
        return str(self.path)

    def __getstate__(self) -> dict[str, Any]:
        """For another process: all but what holds functions, which it reads again."""
        left_out = ("read_deck", "deck", "problem", "final")
        return {name: value for name, value in self.__dict__.items() if name not in left_out}

    @cached_property
    def read_deck(self) -> ReadDeck:
        """The checked deck with its problem's name, to build the problem again."""
        return read_run_deck(self.directory)

    @cached_property
    def deck(self) -> Any:
        """The typed deck of the run."""
        return self.read_deck.deck

    @cached_property
    def problem(self) -> Problem:
        """The problem of the run, for its figures and summary."""
        return self.read_deck.make_problem()

    @cached_property
    def history(self) -> Table:
        """Columns of the history, (steps + 1,) each; empty where no step was made.

        Row 0 is the start, where only some columns have a value (nan, "" in a column of words).
        Raises BadInput where it is damaged, rows are cut out or it ends before the last dump.
        """
        points = self.directory.list_points()  # first: of a live run the history is ahead of them
        found = read_rows(self.directory.history, points[-1][0] if points else 0)
        found.check(f"shockgrid restart {self.directory.quoted} cuts it back and computes it again")
        return Table(read_columns(found), "history", "step", self.find_units)

    def find_units(self) -> dict[str, str]:
        """Units of the history's columns: those of every run, of the problem and of the groups
        that the deck names."""
        seconds = (name for name in self.history if name.startswith("seconds_"))
        units = dict.fromkeys(("t", "dt", *seconds), "s")
        try:
            own = self.problem.find_units()
            units |= (UNITS_OF_CONTACTS if own["t"] != "1" else {}) | own
        except BadInput:  # a deck of another version can still be drawn
            return units
        if not (columns := self.problem.deck.output.columns):
            return units
        from shockgrid.problems.column_groups import find_column_units  # slow to load

        try:
            return units | find_column_units(columns)
        except BadInput:  # a file of columns that is gone
            return units

    @property
    def theory(self) -> dict[str, float]:
        """What the problem's references say for the deck, by name, SI units; {} for nothing."""
        return self.problem.theory()

    @property
    def summary(self) -> str:
        """The summary; of an unfinished run, what the problem says of it so far."""
        if self.directory.summary.exists():
            return self.directory.summary.read_text(encoding="utf-8").rstrip("\n")
        return self.problem.summary(self.history, None) if len(self.history.get("t", ())) else ""

    @cached_property
    def verdict(self) -> dict[str, Any] | None:
        """How the run ended (`status`, `name`, `reason`) and what limits `trust`; None: it did not.

        Made by `runs.inspection.account`.
        """
        return read_verdict(self.directory)

    @cached_property
    def gauges(self) -> Table:
        """Columns of the gauges' table; empty where the deck has no gauges."""
        return Table(read_history(self.directory.gauges), "table of gauges", "step")

    @cached_property
    def outputs(self) -> list[Dump]:
        """The dumps that the deck asks for, in order of time."""
        read = (self._try(path) for _, path in self.directory.list_points("dump"))
        return [dump for dump in read if dump]

    @cached_property
    def dumps(self) -> list[Dump]:
        """`outputs`, and after them the last restart point where it is newer than all of them.

        So the last dump shows the last state that is known of a run that was stopped or failed.
        """
        last = self.outputs[-1].step if self.outputs else -1
        newer = [path for step, path in self.directory.list_points("restart") if step > last]
        read = (self._try(path) for path in reversed(newer))
        return [*self.outputs, *[dump for dump in read if dump][:1]]

    @property
    def restart_step(self) -> int | None:
        """Step of the last restart point that can be read; None where there is none."""
        for step, path in reversed(self.directory.list_points()):
            with contextlib.suppress(BadInput):  # torn
                if Dump(path).has_state:
                    return step
        return None

    def _try(self, path: Path) -> Dump | None:
        try:
            return Dump(path, self)
        except BadInput as error:
            if not path.exists():  # an old restart point of a run that goes on meanwhile
                return None
            if not self.lenient:
                raise BadInput(f"{error}; move it elsewhere to see the others") from error
            if str(error) not in self.skipped:
                self.skipped.append(str(error))
            return None

    def dump_at(self, t: float | None = None) -> Dump:
        """The dump nearest to time `t`, else the last; BadInput for what is no number."""
        if not self.dumps:
            raise BadInput(f"{self.path} has no dump that can be read")
        if t is None:
            return self.dumps[-1]
        if not isinstance(t, int | float | np.number) or not math.isfinite(t):
            raise BadInput(f"{t!r} is not a time; give a number")
        return min(self.dumps, key=lambda dump: abs(dump.t - t))
