"""A run directory as data: deck, history, dumps, each read when it is first asked for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from problems.problem import Problem
from regrid.errors import BadInput, suggest
from regrid.measure.corners import compute_centres
from runs.deck.reading import ReadDeck, read_toml
from runs.store.directory import RunDirectory, open_directory
from runs.store.dumps import damage_told, has_state, open_dump, read_state
from runs.store.guards import (
    check_deck,
    check_summary,
    read_rows_beside_dumps,
    read_run_deck,
    read_verdict,
)
from runs.store.history import read_columns, read_history


class MissingField(BadInput, KeyError):
    """A dump does not hold a field that is asked for."""

    def __str__(self) -> str:  # that of KeyError would put it in quotes
        return str(self.args[0])


class Fields(Mapping[str, np.ndarray]):
    """The fields of a block in a dump, by name; an array is read at its first use."""

    def __init__(self, path: Path, block: str, names: Sequence[str], folder: str = "blocks"):
        self._path, self._block, self._names = path, block, tuple(names)
        self._folder = folder
        self._read: dict[str, np.ndarray] = {}

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._names:
            there = ", ".join(self._names) or "none"
            raise MissingField(
                f"{self._path}: block {self._block!r} has no field {name!r}; there are: {there} "
                "(output.fields of a deck chooses them)"
            )
        if name not in self._read:
            with open_dump(self._path) as file, damage_told(self._path, f"{self._block}/{name}"):
                self._read[name] = file[self._folder][self._block][name][()]
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def get_field(block: Any, name: str) -> np.ndarray:
    """A field of a block's cells or nodes; AttributeError that says which there are."""
    for fields in (block.cell_fields, block.node_fields):
        if name in fields:
            return fields[name]
    known = [*block.cell_fields, *block.node_fields]
    raise AttributeError(f"block {block.name!r} has no field {name!r}{suggest(name, known)}")


class DumpBlock:
    """A block in a dump; has what problems.evolution.BlockView asks for."""

    def __init__(self, path: Path, group: Any):
        self.name: str = group.name.rsplit("/", 1)[-1]
        self.material: str = str(group.attrs["material"])
        self.nodes = np.stack([group["x"][()], group["y"][()]])
        radial = str(group["y"].attrs.get("long_name", "")).startswith("r ")
        self.axes: tuple[str, str] = ("x", "r" if radial else "y")  # their names on pictures
        fields = {n: d for n, d in group.items() if d.ndim == 2 and n not in ("x", "y")}
        at_nodes = [n for n, d in fields.items() if d.shape == self.nodes.shape[1:]]
        self.cell_fields = Fields(path, self.name, [n for n in fields if n not in at_nodes])
        self.node_fields = Fields(path, self.name, at_nodes)
        state = group.file.get(f"state/{self.name}", {})  # of the cells, beside what is drawn
        cells = tuple(n - 1 for n in self.nodes.shape[1:])
        stored = [n for n, d in state.items() if getattr(d, "shape", ()) == cells]
        self.state_fields = Fields(path, self.name, stored, "state")
        self.units = {name: str(data.attrs.get("units", "1")) for name, data in fields.items()}
        self.long_names = {n: str(d.attrs.get("long_name", n)) for n, d in fields.items()}

    @property
    def centres(self) -> np.ndarray:
        """Middles of the cells (2, ni, nj) [m]."""
        return compute_centres(self.nodes)

    def __getattr__(self, name: str) -> np.ndarray:
        """A field by its name: `block.rho`; AttributeError with what there is."""
        if name.startswith("_") or "node_fields" not in self.__dict__:
            raise AttributeError(name)
        return get_field(self, name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.cell_fields, *self.node_fields})

    def __repr__(self) -> str:
        ni, nj = (size - 1 for size in self.nodes.shape[1:])
        return f"<block {self.name}: {self.material}, {ni} x {nj} cells>"


class Dump:
    """One dump: `t`, `t_unit`, `step`, `problem`, `finished`, `deck_text`, lazily `blocks`."""

    def __init__(self, path: Path | str):
        self.path = Path(path)
        with open_dump(self.path) as file, damage_told(self.path, "its attributes"):
            self.t = float(file.attrs["t"])
            self.t_end = float(file.attrs["t_end"])
            self.t_unit = str(file.attrs.get("t_unit", "s"))
            self.step = int(file.attrs["step"])
            self.problem = str(file.attrs["problem"])
            self.finished = str(file.attrs["finished"])
            self.deck_text = str(file.attrs["deck"])
            made = dict(file["provenance"].attrs) if "provenance" in file else {}
        self.provenance = {name: str(words) for name, words in made.items()}  # what made it

    @cached_property
    def blocks(self) -> list[DumpBlock]:
        with open_dump(self.path) as file, damage_told(self.path, "its blocks"):
            return [DumpBlock(self.path, group) for group in file["blocks"].values()]

    @property
    def axes(self) -> tuple[str, str]:
        """Names of the plane's coordinates: x and y, or x and r in axisymmetric flow."""
        return self.blocks[0].axes if self.blocks else ("x", "y")

    @property
    def is_restart_point(self) -> bool:
        """Is this no dump of the deck's, but a restart point by wall time?"""
        return self.path.name.startswith("restart")

    def block(self, name: str) -> DumpBlock:
        """The block called `name`."""
        for block in self.blocks:
            if block.name == name:
                return block
        names = ", ".join(block.name for block in self.blocks)
        raise BadInput(f"{self.path} has no block {name!r}; there are: {names}")

    @cached_property
    def has_state(self) -> bool:
        """Can a run go on from it?  Not so for light dumps."""
        return has_state(self.path)

    def __getitem__(self, name: str) -> DumpBlock:
        return self.block(name)

    def __repr__(self) -> str:
        names = ", ".join(block.name for block in self.blocks)
        return f"<dump of step {self.step}, t = {self.t:.6g} {self.t_unit}, blocks {names}>"

    def state(self) -> dict[str, Any]:
        """The restart state."""
        return read_state(self.path)

    def field_names(self) -> list[str]:
        """Names of the fields of cells that any block has, in their order."""
        return list(dict.fromkeys(name for block in self.blocks for name in block.cell_fields))


class RunData:
    """Lazy access to a run directory: `.deck`, `.history`, `.dumps`, `.problem`.

    What is damaged raises BadInput when it is asked for.  `lenient`: damaged dumps are left out and
    a damaged deck or summary is taken as it is; the sentences stand in `skipped`.
    """

    def __init__(self, path: Path | str, lenient: bool = False):
        self.lenient = lenient
        self.skipped: list[str] = []  # sentences about what is damaged
        self.directory: RunDirectory = open_directory(path)
        self.path = self.directory.path
        self.table = read_toml(self.directory.deck)
        self.problem_name = str(self.table.get("problem", ""))
        self.said: list[str] = []  # sentences about what is wrong and harms nothing
        for check in (check_deck, check_summary):
            try:
                self.said += filter(None, [check(self.directory)])
            except BadInput as error:
                if not lenient:
                    raise
                self.skipped.append(str(error))

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
    def history(self) -> dict[str, np.ndarray]:
        """Columns of the history; {} where no step was made.

        Raises BadInput where it is damaged, rows are cut out or it ends before the last dump.
        """
        found = read_rows_beside_dumps(self.directory)
        found.check(f"shockgrid restart {self.directory.quoted} cuts it back and computes it again")
        return read_columns(found)

    @cached_property
    def verdict(self) -> dict[str, Any] | None:
        """How the run ended (`status`, `name`, `reason`) and what limits `trust`; None: it did not.

        Made by `runs.inspection.account`; `dt_trend` tells how dt fell, by which cell.
        """
        return read_verdict(self.directory)

    @cached_property
    def gauges(self) -> dict[str, np.ndarray]:
        """Columns of the gauges' table; {} where the deck has no gauges."""
        return read_history(self.directory.gauges)

    @cached_property
    def outputs(self) -> list[Dump]:
        """The dumps that the deck asks for, in order of time."""
        read = (self._try(path) for _, path in self.directory.list_files("dump"))
        return [dump for dump in read if dump]

    @cached_property
    def dumps(self) -> list[Dump]:
        """`outputs`, and after them the last restart point where it is newer than all of them.

        So the last dump shows the last state that is known of a run that was stopped or failed.
        """
        last = self.outputs[-1].step if self.outputs else -1
        newer = [path for step, path in self.directory.list_files("restart") if step > last]
        read = (self._try(path) for path in reversed(newer))
        return [*self.outputs, *[dump for dump in read if dump][:1]]

    @property
    def restart_step(self) -> int | None:
        """Step of the last restart point that can be read; None where there is none."""
        for step, path in reversed(self.directory.list_points()):
            try:
                if Dump(path).has_state:
                    return step
            except BadInput:  # torn
                continue
        return None

    def _try(self, path: Path) -> Dump | None:
        try:
            return Dump(path)
        except BadInput as error:
            if not path.exists():  # an old restart point of a run that goes on meanwhile
                return None
            if not self.lenient:
                words = f"{error}; move it elsewhere to see the others"
                raise BadInput(words) from error
            if str(error) not in self.skipped:
                self.skipped.append(str(error))
            return None

    def dump_at(self, t: float) -> Dump:
        """The dump nearest to time `t`; BadInput for what is no number."""
        if not isinstance(t, int | float | np.number) or not math.isfinite(t):
            raise BadInput(f"{t!r} is not a time; give a number")
        if not self.dumps:
            raise BadInput(f"{self.path} has no dump that can be read")
        return min(self.dumps, key=lambda dump: abs(dump.t - t))
