"""A run's directory as data, with what a person asks of it: history, fields, curves, pictures."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.evolution import Evolution
from regrid.errors import BadInput, suggest
from runs.inspection.account import describe_time
from runs.interface.settings import check_options, make_table, with_known_options
from runs.march.runner import Ending, Runner
from runs.store.reader import RunData

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runs.interface.pictures import Curve, Times


class NoColumn(BadInput, KeyError):
    """A column that the history does not have; the sentence names those that are like it."""

    def __str__(self) -> str:
        return str(self.args[0])


class History(dict[str, np.ndarray]):
    """Columns of the history by name, (steps + 1,) each; `history.t` is `history["t"]`.

    Row 0 is the start, where only some columns have a value (nan, "" in a column of words).
    `units` maps columns to their SI unit, as far as it is known.  An unknown name raises
    AttributeError or, in brackets, BadInput, which here is a KeyError too.
    """

    def __init__(
        self, columns: Mapping[str, np.ndarray], units: Mapping[str, str], name: str = "history"
    ):
        super().__init__(columns)
        self.units = {key: unit for key, unit in units.items() if key in columns}
        self.name = name

    def __missing__(self, name: str) -> np.ndarray:
        raise NoColumn(f"the history has no column {name!r}{suggest(name, self)}")

    def __getattr__(self, name: str) -> np.ndarray:
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(str(error)) from None

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self})

    def __repr__(self) -> str:
        rows = len(next(iter(self.values()), ()))
        return f"<history of {self.name}: {rows} rows, {len(self)} columns: {', '.join(self)}>"

    def to_xarray(self) -> Any:
        """An xarray.Dataset over `step`, with `t` beside it and units as attributes.

        Raises BadInput where xarray is not installed.
        """
        xarray = _load("xarray")
        data = {
            name: ("step", values, {"units": self.units[name]} if name in self.units else {})
            for name, values in self.items()
        }
        return xarray.Dataset(data).set_coords(["step", "t"])

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with a row a step, `step` being its index.

        Raises BadInput where pandas is not installed.
        """
        return _load("pandas").DataFrame(dict(self)).set_index("step")


def _load(package: str) -> ModuleType:
    try:
        return importlib.import_module(package)
    except ImportError as error:
        words = f"{package} is not installed here: python -m pip install {package}"
        raise BadInput(f"to_{package} needs {package}, and {words}") from error


FIRST_SIGNAL = 128  # exit codes from here on: stopped by a signal
INTERRUPTED = 130


class OpenRun(RunData):
    """A run: `.deck`, `.history`, `.dumps[-1]["second"].rho`, `.problem`, and what follows.

    Everything is read at first use; a run that is still marching is opened again to
    see more of it.  `dumps` are in order of time; `reason` says why the run that was just made
    ended, and is "" where the directory was opened.
    """

    reason: str = ""
    final: Evolution | None = None  # the state in memory of the run that was just made

    @cached_property
    def history(self) -> History:
        """Columns of the history by name and by attribute; empty where no step was made."""
        return History(RunData(self.path).history, self._units, str(self.path))

    @property
    def _units(self) -> dict[str, str]:
        from runs.pictures.history import find_units

        return {"t": "s", "dt": "s"} | find_units(RunData(self.path))

    @property
    def theory(self) -> dict[str, float]:
        """What the problem's references say for the deck, by name, SI units; {} for nothing."""
        return self.problem.predict()

    @property
    def summary(self) -> str:
        """The summary; of an unfinished run, what the problem says of it so far."""
        if self.directory.summary.exists():
            return self.directory.summary.read_text(encoding="utf-8").rstrip("\n")
        return self.problem.summary(self.history, None) if len(self.history.get("t", ())) else ""

    def interface(self, t: float | None = None) -> Curve:
        """The curve between blocks of different materials in the dump nearest to `t` [s].

        Arrays x and y [m], and the time t of that dump; without `t` the last.  Raises BadInput
        where there is no dump, or no two materials touch.
        """
        from runs.interface.pictures import find_interface

        if not self.dumps:
            raise BadInput(f"{self.path} has no dump that can be read")
        dump = self.dumps[-1] if t is None else self.dump_at(t)
        return find_interface(dump.blocks, dump.t, str(dump.path))

    @with_known_options
    def plot(
        self,
        *fields: str,
        what: str | None = None,
        at: Times = None,
        mesh: bool = False,
        zoom: Sequence[float] | None = None,
        mirror: str | None = None,
        beside: str | Path | None = None,
        line: Sequence[float] | None = None,
        limits: Sequence[float] | None = None,
        colours: str | None = None,
    ) -> Figure:
        """The figure that `shockgrid plot` draws: fields (the density where none is named), ...

        what: "fields", "mesh", "interface", "history" (`fields` then are its columns), "gauges",
        "line" or a picture of the problem's own; a single word that is one of these may stand in
        place of a field.  at: times [s], "start" or "end"; mesh, zoom, mirror: see `Case.plot`;
        beside: the directory of another run, drawn to the same scale; line: x0, y0, x1, y1 [m], the
        fields along it are drawn; limits: low, high of the colours in SI units; colours: a colour
        map.  Raises BadInput for what there is not.
        """
        from runs.interface.pictures import draw_picture

        if what is None and len(fields) == 1 and fields[0] in self.pictures:
            what, fields = fields[0], ()
        return draw_picture(
            self, fields, what, at=at, mesh=mesh, zoom=zoom, mirror=mirror, beside=beside,
            line=line, limits=limits, colours=colours,
        )  # fmt: skip

    @property
    def pictures(self) -> list[str]:
        """Names for `what` of `plot`."""
        gauges = ["gauges"] if self.deck.gauge else []
        return ["mesh", "interface", "history", *gauges, *self.problem.figures()]

    def film(
        self,
        field: str | None = None,
        output: str | Path | None = None,
        zoom: Sequence[float] | None = None,
        **options: Any,
    ) -> Path:
        """Make a film of a field over the dumps, mp4 with ffmpeg, else GIF; returns its path.

        field: the density where none is named; output: FILE [DIR/film-FIELD.mp4 or .gif]; zoom: x0,
        x1, y0, y1 [m]; options: follow, mesh (bool), mirror "x" or "y", fps, dpi.  Raises BadInput.
        """
        from runs.interface.pictures import say_numbers
        from runs.pictures.film import make_film

        check_options("film", make_film, options)
        return make_film(self.path, field, output, zoom=say_numbers(zoom), **options)

    def report(self, output: str | Path | None = None, **options: Any) -> Path:
        """Write one HTML file that tells the run; returns its path [DIR/report.html].

        options: film (bool), dpi.  Raises BadInput where the extra `report` is not installed.
        """
        from runs.report.page import report

        check_options("report", report, options)
        return report(self.path, output, **options)

    @property
    def _state(self) -> str:
        if not self.dumps:
            return "no dump that can be read"
        last = self.dumps[-1]
        return f"{self.reason or last.finished or 'not finished'}: step {last.step}, " + (
            describe_time(last.t, last.t_unit)
        )

    def __repr__(self) -> str:
        return f"<run of {self.problem_name} in {self.path}: {self._state}>"

    def _repr_html_(self) -> str:
        rows = [("run", str(self.path)), ("problem", self.problem_name), ("state", self._state)]
        rows.append(("dumps", str(len(self.dumps))))
        rows += [(f"theory: {name}", f"{value:.6g}") for name, value in self.theory.items()]
        return make_table(rows)


def open_run(directory: str | Path) -> OpenRun:
    """The run in a directory; BadInput where there is none."""
    return OpenRun(directory)


def finish(runner: Runner, ending: Ending, quiet: bool) -> OpenRun:
    """The data of a run that has ended; KeyboardInterrupt or SystemExit where it was stopped."""
    if ending.exit_code >= FIRST_SIGNAL:
        words = f"{ending.reason}; {runner.directory} can be restarted from"
        raise (
            KeyboardInterrupt(words)
            if ending.exit_code == INTERRUPTED
            else SystemExit(ending.exit_code)
        )
    if not quiet:
        print(ending.screen)
    run = OpenRun(runner.directory.path)
    run.reason, run.final = ending.reason, runner.evolution
    return run
