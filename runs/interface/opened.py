"""A run's directory as data that can be drawn: what `shockgrid.open` and `shockgrid.run` return."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from problems.evolution import Evolution
from problems.problem import Problem
from regrid.errors import BadInput
from runs.inspection.account import describe_time
from runs.march.runner import Ending, Runner
from runs.store.reader import BlockData, RunData

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIRST_SIGNAL = 128  # exit codes from here on: stopped by a signal
INTERRUPTED = 130


def make_table(rows: Sequence[tuple[str, str]], theory: Mapping[str, float]) -> str:
    """HTML of two columns, what and its value, `theory` the last rows."""
    rows = [*rows, *((f"theory: {name}", f"{value:.6g}") for name, value in theory.items())]
    lines = "".join(
        f"<tr><th style='text-align:left'>{html.escape(what)}</th>"
        f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
        for what, value in rows
    )
    return f"<table>{lines}</table>"


class Drawn:
    """What can be drawn: the dumps of a run, or the present state of a case."""

    problem: Problem

    @property
    def pictures(self) -> Sequence[str]:
        """Words for `what` of `plot`."""
        raise NotImplementedError

    def plot(
        self,
        *fields: str,
        what: str | None = None,
        at: float | str | Sequence[float] | None = None,
        mesh: bool = False,
        zoom: Sequence[float] | None = None,
        mirror: str | None = None,
        beside: str | Path | None = None,
        line: Sequence[float] | None = None,
        limits: Sequence[float] | None = None,
        colours: str | None = None,
    ) -> Figure:
        """The figure that `shockgrid plot` draws: fields (the density where none is named), ...

        what: "fields", "mesh", "interface", "line", of a run also "history" (`fields` then are its
        columns), "gauges" or a picture of the problem's own; a single word that is one of these may
        stand in place of a field.  at: times [s] of dumps, "start" or "end"; mesh: draw the grid
        over the fields; zoom: x0, x1, y0, y1 [m]; mirror: "x" or "y" completes a half domain;
        beside: the directory of another run, drawn to the same scale; line: x0, y0, x1, y1 [m], the
        fields along it are drawn; limits: low, high of the colours in SI units; colours: a colour
        map.  Raises BadInput for what there is not.
        """
        from runs.pictures.command import Wanted, fill_figure, new_figure

        if what is None and len(fields) == 1 and fields[0] in self.pictures:
            what, fields = fields[0], ()
        if mirror not in (None, "x", "y"):
            raise BadInput(f"mirror = {mirror!r}: 'x' or 'y' is wanted")
        if at is not None and not isinstance(at, str):
            at = say_numbers(np.atleast_1d(np.asarray(at, float)))
        wanted = Wanted(
            fields,
            what,
            at,
            mesh,
            say_numbers(zoom),
            mirror,
            None if beside is None else str(beside),
            say_numbers(line),
            say_numbers(limits),
            colours,
        )
        fill_figure(figure := new_figure(), self, wanted)  # type: ignore[arg-type]
        return figure


def say_numbers(numbers: Sequence[float] | np.ndarray | None) -> str | None:
    """Numbers as an option of the command line gives them."""
    return None if numbers is None else ",".join(repr(float(value)) for value in numbers)


class Curve(NamedTuple):
    """Where two materials meet at time t [s]: x and y [m], one array each, along the line.

    Where there are several lines a nan stands between them.
    """

    x: np.ndarray
    y: np.ndarray
    t: float


def find_interface(blocks: Sequence[BlockData], t: float, where: str) -> Curve:
    """The lines between blocks of different materials; BadInput where there are none."""
    from runs.pictures.curves import find_curves

    lines = [curve[:2] for curve in find_curves(blocks).values()]
    if not lines:
        raise BadInput(f"{where}: no two materials touch, so there is no interface")
    gap = np.full((2, 1), np.nan)
    x, y = np.concatenate([part for line in lines for part in (gap, line)][1:], axis=1)
    return Curve(x, y, t)


class OpenRun(Drawn, RunData):
    """A run: `.deck`, `.history`, `.dumps[-1]["second"].rho`, `.problem`, and what follows.

    Everything is read at first use; a run that is still marching is opened again to
    see more of it.  `dumps` are in order of time; `reason` says why the run that was just made
    ended, and is "" where the directory was opened.
    """

    reason: str = ""
    final: Evolution | None = None  # the state in memory of the run that was just made

    def interface(self, t: float | None = None) -> Curve:
        """The curve between blocks of different materials in the dump nearest to `t` [s].

        Arrays x and y [m], and the time t of that dump; without `t` the last.  Raises BadInput
        where there is no dump, or no two materials touch.
        """
        dump = self.dump_at(t)
        return find_interface(dump.blocks, dump.t, str(dump.path))

    @property
    def pictures(self) -> list[str]:
        """Words for `what` of `plot`."""
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
        from runs.pictures.film import make_film

        return make_film(self.path, field, output, zoom=say_numbers(zoom), **options)

    def report(self, output: str | Path | None = None, **options: Any) -> Path:
        """Write one HTML file that tells the run; returns its path [DIR/report.html].

        options: film (bool), dpi.  Raises BadInput where the extra `report` is not installed.
        """
        from runs.report import report

        return report(self.path, output, **options)

    @property
    def _state(self) -> str:
        if not self.dumps:
            return "no dump that can be read"
        last = self.dumps[-1]
        ending = self.reason or last.finished or "not finished"
        return f"{ending}: step {last.step}, {describe_time(last.t, last.t_unit)}"

    def __repr__(self) -> str:
        return f"<run of {self.problem_name} in {self.path}: {self._state}>"

    def _repr_html_(self) -> str:
        rows = [("run", str(self.path)), ("problem", self.problem_name), ("state", self._state)]
        rows.append(("dumps", str(len(self.dumps))))
        return make_table(rows, self.theory)


def open_run(directory: str | os.PathLike) -> OpenRun:
    """The run in a directory, or one that is opened already; BadInput where there is none."""
    if isinstance(directory, OpenRun):
        return directory
    try:
        path = os.fspath(directory)
    except TypeError:
        words = f"a {type(directory).__name__} is not the directory of a run"
        raise BadInput(f"{words}; a case gets one by its run()") from None
    return OpenRun(path)


def finish(runner: Runner, ending: Ending, quiet: bool) -> OpenRun:
    """The data of a run that has ended; KeyboardInterrupt or SystemExit where it was stopped."""
    if ending.exit_code == INTERRUPTED:
        raise KeyboardInterrupt(f"{ending.reason}; {runner.directory} can be restarted from")
    if ending.exit_code >= FIRST_SIGNAL:
        raise SystemExit(ending.exit_code)
    if not quiet:
        print(ending.screen)
    run = OpenRun(runner.directory.path)
    run.reason, run.final = ending.reason, runner.evolution
    return run
