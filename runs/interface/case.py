"""A problem with its deck (`Case`), to inspect, step, run and plot, and a run as data (`OpenRun`).

`shockgrid.load` returns the first, `shockgrid.open` and `shockgrid.run` the second.  Keywords are
settings of the deck, `cells=32, run={"t_end": 1e-3}` or `"run.t_end": 1e-3`.  They are passed on
like `--set`, so the command line and Python make the same checks.

Note: blocks are built at their first use, which may take a minute to compile kernels.  Their
arrays are live.
"""

from __future__ import annotations

import math
import os
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from shockgrid.problems.evolution import (
    BlockView,
    Evolution,
    Scalar,
    get_long_names,
    get_material,
    get_node_fields,
    is_axisymmetric,
)
from shockgrid.problems.problem import Problem
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.runs.deck.reading import ReadDeck, read_deck, resolve_deck
from shockgrid.runs.interface.wording import said_in_python
from shockgrid.runs.march.compiling import compiling
from shockgrid.runs.march.launching import start_runner
from shockgrid.runs.march.runner import Ending, Runner
from shockgrid.runs.quantities import describe_time
from shockgrid.runs.ranks.started import check_single
from shockgrid.runs.store.reader import BlockData, Fields, RunData, Snapshot, Table
from shockgrid.runs.study.definition import flatten, write_settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FIRST_SIGNAL = 128  # exit codes from here on: stopped by a signal
EXIT_INTERRUPTED = 130


class Drawn:
    """Common methods for plots: of the dumps of a run, or of the current state of a case."""

    problem: Problem
    pictures: Sequence[str]  # words for `what` of `plot`

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
        """The figure that `shockgrid plot` draws; the field is the density if none is named.

        what: "fields", "mesh", "interface" or "line"; for a run also "history" (`fields` are then
        its columns), "gauges" or a picture specific to the problem.  One of these words may also be
        given in place of a field.  at: times [s] of dumps, "start" or "end"; mesh: draw the grid
        over the fields; zoom: x0, x1, y0, y1 [m]; mirror: "x" or "y" adds the mirrored half,
        of the field alone; beside: the directory of another run, drawn to the same scale; line:
        x0, y0, x1, y1 [m], plots the fields along it; limits: range of the colours in units of the
        deck; colours: a colour map.  Raises BadInput for unknown fields, times or pictures.
        """
        from shockgrid.runs.pictures.command import Wanted, fill_figure, new_figure

        if what is None and len(fields) == 1 and fields[0] in self.pictures:
            what = fields[0]
            fields = ()
        if mirror not in (None, "x", "y"):
            raise BadInput(f"mirror = {mirror!r}: it must be 'x' or 'y'")
        wanted = Wanted(fields, what, at, mesh, zoom, mirror, beside, line, limits, colours)
        with said_in_python():
            fill_figure(figure := new_figure(), self, wanted)  # type: ignore[arg-type]
        return figure


class Curve(NamedTuple):
    """The curve between two materials at time t [s]: arrays x and y [m] along the line.

    Several lines are separated by nan.
    """

    x: np.ndarray
    y: np.ndarray
    t: float


def find_interface(blocks: Sequence[BlockData], t: float, where: str) -> Curve:
    """The lines between blocks of different materials; BadInput if there are none."""
    from shockgrid.runs.pictures.curves import find_curves

    lines = [curve[:2] for curve in find_curves(blocks).values()]
    if not lines:
        raise BadInput(f"{where}: no two materials touch, so there is no interface")
    gap = np.full((2, 1), np.nan)
    x, y = np.concatenate([part for line in lines for part in (gap, line)][1:], axis=1)
    return Curve(x, y, t)


class OpenRun(Drawn, RunData):
    """A run as data: `.deck`, `.history`, `.dumps[-1]["second"].rho`, `.problem` and more.

    Everything is read at first use.  To see more of a run that is still in progress, open it
    again.  `dumps` are in order of time; `reason` is why a run ended that was just computed, "" for
    a directory that was opened.
    """

    reason: str = ""
    final: Evolution | None = None  # the state in memory of the run that was just computed

    def interface(self, t: float | None = None) -> Curve:
        """The curve between blocks of different materials in the dump nearest to `t` [s].

        It has arrays x and y [m] and the time t of that dump; the default is the last dump.  Raises
        BadInput if there is no dump, or if no two materials touch.
        """
        dump = self.dump_at(t)
        return find_interface(dump.blocks, dump.t, str(dump.path))

    @property
    def pictures(self) -> list[str]:  # type: ignore[override]
        """The values that `what` of `plot` may have."""
        gauges = ["gauges"] if self.deck.gauge else []
        return ["mesh", "interface", "history", *gauges, *self.problem.figures()]

    def film(
        self, field: str | None = None, output: str | Path | None = None, **options: Any
    ) -> Path:
        """Make a film of a field, one frame per dump: mp4 with ffmpeg, else GIF; returns its path.

        field: the density by default; output: FILE [DIR/film-FIELD.mp4 or .gif];
        options: zoom (x0, x1, y0, y1 [m]), follow, mesh (bool), mirror "x" or "y", fps, dpi.
        Raises BadInput.
        """
        from shockgrid.runs.pictures.film import make_film

        with said_in_python():
            return make_film(self.path, field, output, **options)

    def report(self, output: str | Path | None = None, **options: Any) -> Path:
        """Write a report of the run in one HTML file; returns its path [DIR/report.html].

        options: film (bool), dpi.  Raises BadInput if the extra `report` is not installed.
        """
        from shockgrid.runs.report import report

        with said_in_python():
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


def open_run(directory: str | os.PathLike) -> OpenRun:
    """The run in a directory, or one that is already open; BadInput if there is none."""
    if isinstance(directory, OpenRun):
        return directory
    try:
        path = os.fspath(directory)
    except TypeError:
        raise BadInput(
            f"a {type(directory).__name__} is not the directory of a run"
            "; a case gets one by its run()"
        ) from None
    return OpenRun(path)


def finish(runner: Runner, ending: Ending, quiet: bool) -> OpenRun:
    """The data of a run that has ended; KeyboardInterrupt or SystemExit if it was stopped."""
    if ending.exit_code == EXIT_INTERRUPTED:
        raise KeyboardInterrupt(f"{ending.reason}; {runner.directory} can be restarted from")
    if ending.exit_code >= FIRST_SIGNAL:
        raise SystemExit(ending.exit_code)
    if not quiet:
        print(ending.screen)
    run = OpenRun(runner.directory.path)
    run.reason = ending.reason
    run.final = runner.evolution
    return run


def make_settings(keywords: Mapping[str, Any]) -> tuple[str, ...]:
    """`key=value` for each value, tables with dots; BadInput for values that TOML lacks."""
    return write_settings(flatten(keywords))


def say(text: str) -> None:
    """Print a line to standard error."""
    print(text, file=sys.stderr)


HookFunction = Callable[[Any], Any]  # of the case; returns None, or why to stop


def is_count(value: object) -> bool:
    """Whether the value is a whole number of at least 1."""
    return type(value) is int and value >= 1


class Hook:
    """A function to be called every `steps` steps or every `time` [s]; by default
    after each step.

    With `time` it is called after the first step past each multiple of it.  Raises BadInput
    if both are given, or one that is not positive.
    """

    def __init__(
        self, function: HookFunction, *, steps: int | None = None, time: float | None = None
    ):
        if not callable(function):
            raise BadInput(f"a hook is a function of the case, not a {type(function).__name__}")
        if steps is not None and time is not None:
            raise BadInput("a hook is called every so many steps or seconds: steps= or time=")
        if steps is not None and not is_count(steps):
            raise BadInput(f"steps = {steps!r} of a hook: it must be a whole number of at least 1")
        if time is not None and not 0.0 < time < math.inf:
            raise BadInput(f"time = {time!r} s of a hook: it must be a positive number")
        self.function = function
        self.steps = steps or 1
        self.time = time

    def is_due(self, case: Any, t_before: float) -> bool:
        """Whether to call it after the step from `t_before` to the time of the case."""
        if self.time is not None:
            return math.floor(case.t / self.time) > math.floor(t_before / self.time)
        return case.step % self.steps == 0


HooksGiven = Sequence[Hook | HookFunction] | Hook | HookFunction


def join_hooks(case: Any, given: HooksGiven) -> Callable[[float], str | None]:
    """Return a function that calls all hooks that are due after a step from a given time [s].

    It returns the first reason to stop, and raises BadInput if a hook returns neither None nor
    text.
    """
    several = given if isinstance(given, Sequence) else [given]
    hooks = [hook if isinstance(hook, Hook) else Hook(hook) for hook in several]

    def call(t_before: float) -> str | None:
        for hook in hooks:
            reason = hook.function(case) if hook.is_due(case, t_before) else None
            if not isinstance(reason, str | None):
                name = getattr(hook.function, "__name__", "hook")
                raise BadInput(
                    f"{name} returned {reason!r}: a hook returns None, or text on why to stop"
                )
            if reason:
                return reason
        return None

    return call


def _view(block: BlockView, axes: tuple[str, str], has_units: bool) -> BlockData:
    """A block of a flow in memory: each array is a read-only view of the current state."""

    def lock(values: np.ndarray) -> np.ndarray:
        view = values.view()
        view.flags.writeable = False
        return view

    def make_fields(get: Callable[[], Mapping[str, np.ndarray]]) -> Fields:
        return Fields(f"block {block.name!r}", get(), lambda name: lock(get()[name]))

    long_names = get_long_names(block)
    rates = getattr(block, "rates", None)
    return BlockData(
        block.name,
        get_material(block),
        axes,
        lambda: lock(block.nodes),
        make_fields(lambda: block.cell_fields),
        make_fields(lambda: get_node_fields(block)),
        make_fields(lambda: {} if rates is None else {"rates": block.rates}),  # type: ignore[attr-defined]
        block.units if has_units else dict.fromkeys(block.units, "1"),
        {
            name: long_names.get(name, name)
            for name in (*block.cell_fields, *get_node_fields(block))
        },
    )


class Blocks(dict[str, BlockData]):
    """The blocks of a flow by name, in their order; BadInput for an unknown name."""

    def __missing__(self, name: str) -> BlockData:
        raise BadInput(f"there is no block {name!r}{suggest(str(name), self)}")

    def __repr__(self) -> str:
        return f"<blocks: {', '.join(self)}>"


class Case(Drawn):
    """One problem with one deck, and its current state.

    `name` is that of the problem or of its file.  `deck` has been checked and cannot be
    changed: `case.deck.run.t_end`.
    """

    history = Table({}, "history of a case")  # with `skipped`: a case is drawn as a run is
    skipped: tuple[str, ...] = ()
    pictures = ("mesh", "interface", "line")

    def __init__(self, read: ReadDeck, problem: Problem):
        self.read = read
        self.problem = problem
        self.deck = read.deck
        self.name = self.problem_name = read.label
        self.path = Path(read.label)  # its name in messages
        self._runs = False

    @property
    def deck_text(self) -> str:
        """The deck as TOML, every key with its value, as `shockgrid check` prints it."""
        return self.read.to_toml()

    @property
    def theory(self) -> dict[str, float]:
        """The problem's reference values for this deck, by name, in SI units; {} if none."""
        return self.problem.theory()

    @property
    def cautions(self) -> list[str]:
        """Sentences that say where results of this deck may be wrong."""
        return self.problem.cautions_on()

    @cached_property
    def simulation(self) -> Evolution:
        """The solver: for a flow a `shockgrid.Simulation`.  Raises BadInput for a bad deck.

        It is made at its first use.  Changes to it change the run.
        """
        with said_in_python(), self.read.numbers_in_reach():
            self.problem.check_memory()
            return self.problem.build()

    @property
    def blocks(self) -> Blocks:
        """The blocks by name: `case.blocks["second"].rho`, (ni, nj) without ghost cells.

        The arrays are read-only views of live data: see `runs.interface.case`.
        """
        axes = ("x", "r") if is_axisymmetric(self.simulation) else ("x", "y")
        units = self.problem.t_unit != "1"
        return Blocks({b.name: _view(b, axes, units) for b in self.simulation.blocks})

    def __getitem__(self, name: str) -> BlockData:
        """A block by its name, as of a dump: `case["second"].rho`."""
        return self.blocks[name]

    @property
    def dumps(self) -> list[Snapshot]:
        """The current state only, in the form that pictures use."""
        state = Snapshot(self.path, self.t, self.simulation.t_end, self.problem.t_unit, self.step)
        state.blocks = list(self.blocks.values())
        state.run = self
        return [state]

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.simulation.t

    @property
    def step(self) -> int:
        """Number of the last step."""
        return self.simulation.step

    @property
    def finished(self) -> str | None:
        """The reason why the flow has ended, or None."""
        return self.simulation.finished

    def measure(self) -> dict[str, float]:
        """The history columns that are specific to the problem, for the current state."""
        return self.problem.measure(self.simulation)

    def advance(self, steps: int = 1) -> dict[str, Scalar]:
        """Make `steps` steps, or fewer if the run ends; returns the history row of the last.

        Raises BadInput at the end and from a hook, RunFailure with block, cell and time.
        """
        self._check_ready("a hook sees the run between two steps; it cannot advance it")
        if not is_count(steps):
            raise BadInput(f"advance({steps!r}): a whole number of steps, at least 1, is wanted")
        row: dict[str, Scalar] = {}
        for _ in range(steps):
            row = self.simulation.advance()
            if self.simulation.finished is not None:
                break
        return {"step": self.step, **row, **self.measure()}

    def _check_ready(self, words: str) -> None:
        if self._runs:
            raise BadInput(words)
        if self.finished:
            raise BadInput(f"{self.name} has already finished ({self.finished})")

    def run(
        self,
        directory: str | Path | None = None,
        *,
        dumps: int | None = None,
        max_steps: int | None = None,
        hooks: HooksGiven = (),
        force: bool = False,
        quiet: bool = True,
    ) -> OpenRun:
        """Run from the current state to the end, into a run directory; returns the run as data.

        directory: default out/<problem>-<n>.  dumps, max_steps: override the deck.  hooks: one
        function or `Hook`, or a list of them; a function is called with the case after each step.
        force: replace the run that is in the directory.  quiet: no progress and no summary.
        Raises BadInput for a directory that is not empty and on several ranks of MPI, RunFailure
        if the run fails, KeyboardInterrupt if it is stopped; after the last two the directory can
        be restarted from.
        """
        self._check_ready("a hook cannot start the run that it is called from")
        check_single("Case.run", "run DECK")
        after_step = join_hooks(self, hooks)  # refused before there is a directory
        given = {"output.dumps": dumps, "run.max_steps": max_steps}
        settings = make_settings({key: value for key, value in given.items() if value is not None})
        read = self.read
        if settings:
            with said_in_python():
                table = tomllib.loads(read.to_toml())
                read = resolve_deck(table, read.origin, settings, read.file)
        most = read.deck.run.max_steps
        if most is not None and 0 < self.step >= most:
            raise BadInput(
                f"{self.name} has made {self.step} steps already, and max_steps = {most}: nothing "
                "is left to do; give a larger one, or make a new simulation"
            )
        with compiling(quiet):
            self.measure()
        with said_in_python():
            wanted = None if directory is None else str(directory)
            built = self.problem, self.simulation
            runner = start_runner(read, wanted, force, quiet, say, built=built)
        runner.after_step = after_step
        return self.march(runner, runner.start, quiet)

    def march(self, runner: Runner, start: Any, quiet: bool) -> OpenRun:
        """Run `start`, a method of a runner of this case; return the data of its directory."""
        self._runs = True
        try:
            ending = start()
        finally:
            self._runs = False
        return finish(runner, ending, quiet)

    def interface(self) -> Curve:
        """The current curve between blocks of different materials: arrays x, y [m], and t [s]."""
        return find_interface(list(self.blocks.values()), self.t, self.name)

    def plot(self, *fields: str, **options: Any) -> Figure:
        """A figure of the current state; for fields and options see `OpenRun.plot`.

        what: "fields", "mesh", "interface" or "line".  Raises BadInput for unknown ones.
        """
        what = options.get("what") or (fields[0] if len(fields) == 1 else "")
        if what in ("history", "gauges") or what in self.problem.figures():
            raise BadInput(
                f"{what!r} is a picture of a run's directory: run the case, and plot its data; "
                f"the state in memory shows fields, {', '.join(self.pictures)}"
            )
        options.pop("at", None)  # the state in memory has one time
        return super().plot(*fields, **options)

    def __repr__(self) -> str:
        if "simulation" not in self.__dict__:
            return f"<case {self.name} ({self.read.origin}), not built yet>"
        names = ", ".join(self.blocks)
        when = describe_time(self.t, self.problem.t_unit)
        return f"<case {self.name}: {when}, step {self.step}, blocks {names}>"


def load(deck: str | Path, **settings: Any) -> Case:
    """Load a problem, a packaged deck, a deck file or a Python file with a problem, as a `Case`.

    settings: keys of the deck, as for `--set`: `cells=32, run={"t_end": 1e-3}` or
    `**{"run.t_end": 1e-3}`.  Raises BadInput with a sentence about each mistake.
    """
    with said_in_python():
        read = read_deck(str(deck), make_settings(settings))
        return Case(read, read.make_problem())
