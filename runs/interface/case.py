"""A problem with its deck, to inspect, step, run and draw: what `shockgrid.load` returns.

Keywords are settings of the deck, `cells=32, run={"t_end": 1e-3}` or `"run.t_end": 1e-3`: they
become the words of `--set`, so that the command line and Python have the same checks.

Note: blocks are built when they are first asked for, which may compile kernels for a minute;
their arrays are live.
"""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.deck import Deck
from problems.evolution import (
    BlockView,
    Evolution,
    Scalar,
    get_long_names,
    get_material,
    get_node_fields,
    is_axisymmetric,
)
from problems.problem import Problem, check_memory
from regrid.errors import BadInput, suggest
from runs.deck.reading import ReadDeck, read_deck, resolve_deck
from runs.inspection.account import describe_cautions
from runs.interface.opened import Curve, Drawn, OpenRun, find_interface, finish, make_table
from runs.march.compiling import compiling
from runs.march.launching import check_requests
from runs.march.runner import Runner
from runs.ranks.started import check_single
from runs.store.directory import create_directory
from runs.store.reader import BlockData, Fields, Snapshot, Table
from runs.study.definition import flatten, write_settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def make_settings(keywords: Mapping[str, Any]) -> tuple[str, ...]:
    """`key=value` for each value, keys of tables joined by dots.

    Raises BadInput for None and for values that no deck can hold.
    """
    return write_settings(flatten(keywords))


SAID = (  # on the command line, in Python
    ("--set: ", ""),
    (" and --set", " and the keywords"),
    ("--set ", ""),
    ("choose another with -o, or --force to", "choose another, or force=True to"),
    ("choose another with -o", "choose another"),
    ("choose another folder with -o", "choose another folder"),
    ("another directory with -o", "another directory"),
    ("choose an earlier one with --at", "choose an earlier one with at="),
)


@contextmanager
def said_in_python() -> Iterator[None]:
    """Sentences of BadInput that name options of the command line name keywords instead."""
    try:
        yield
    except BadInput as error:
        words = str(error)
        for option, keyword in SAID:
            words = words.replace(option, keyword)
        raise BadInput(words) from error


HookFunction = Callable[[Any], Any]  # of the case; None, or words on why to stop


def is_count(value: object) -> bool:
    """Is it a whole number of at least 1?"""
    return type(value) is int and value >= 1


class Hook:
    """A function to be called every `steps` steps or every `time` [s], after each step
    where neither is given.

    Times are multiples of `time`; a call is made after the first step past one.  Raises BadInput
    where both are given, or one that is not positive.
    """

    def __init__(
        self, function: HookFunction, *, steps: int | None = None, time: float | None = None
    ):
        if not callable(function):
            raise BadInput(f"a hook is a function of the case, not a {type(function).__name__}")
        if steps is not None and time is not None:
            raise BadInput(
                "a hook is called every so many steps or every so many seconds, not both"
            )
        if steps is not None and not is_count(steps):
            raise BadInput(f"steps = {steps!r} of a hook: a whole number of at least 1 is wanted")
        if time is not None and not (math.isfinite(time) and time > 0.0):
            raise BadInput(f"time = {time!r} s of a hook: a positive number is wanted")
        self.function, self.steps, self.time = function, steps, time

    def is_due(self, case: Any, t_before: float) -> bool:
        """Is it to be called after the step from `t_before` to the time of the case?"""
        if self.time is not None:
            return math.floor(case.t / self.time) > math.floor(t_before / self.time)
        return case.step % (self.steps or 1) == 0


HooksGiven = Sequence[Hook | HookFunction] | Hook | HookFunction


def join_hooks(case: Any, given: HooksGiven) -> Callable[[float], str | None]:
    """What a runner calls after each step, from a time [s] on: all hooks that are due.

    It returns the first reason to stop, and raises BadInput where a hook returns neither None nor
    text.
    """
    several = given if isinstance(given, Sequence) else [given]
    hooks = [hook if isinstance(hook, Hook) else Hook(hook) for hook in several]

    def call(t_before: float) -> str | None:
        for hook in [one for one in hooks if one.is_due(case, t_before)]:
            reason = hook.function(case)
            if reason is not None and not isinstance(reason, str):
                name = getattr(hook.function, "__name__", "hook")
                raise BadInput(
                    f"{name} returned {reason!r}: a hook returns None, or words on why to stop"
                )
            if reason:
                return reason
        return None

    return call


def _view(block: BlockView, axes: tuple[str, str]) -> BlockData:
    """A block of a flow in memory: each array is a view of now, and cannot be written to."""

    def lock(values: np.ndarray) -> np.ndarray:
        view = values.view()
        view.flags.writeable = False
        return view

    def make_fields(get: Callable[[], Mapping[str, np.ndarray]]) -> Fields:
        return Fields(f"block {block.name!r}", get(), lambda name: lock(get()[name]))

    def get_rates() -> dict[str, np.ndarray]:
        rates = getattr(block, "rates", None)
        return {} if rates is None else {"rates": rates}

    words = get_long_names(block)
    return BlockData(
        block.name,
        get_material(block),
        axes,
        lambda: lock(block.nodes),
        make_fields(lambda: block.cell_fields),
        make_fields(lambda: get_node_fields(block)),
        make_fields(get_rates),
        block.units,
        {name: words.get(name, name) for name in (*block.cell_fields, *get_node_fields(block))},
    )


class Blocks(dict[str, BlockData]):
    """The blocks of a flow by name, in their order; BadInput for a name that none has."""

    def __missing__(self, name: str) -> BlockData:
        raise BadInput(f"there is no block {name!r}{suggest(str(name), self)}")

    def __repr__(self) -> str:
        return f"<blocks: {', '.join(self)}>"


class Case(Drawn):
    """One problem with one deck, at the time that it has been marched to."""

    history = Table({}, "history of a case")  # with `skipped`: a case is drawn as a run is
    skipped: tuple[str, ...] = ()
    pictures = ("mesh", "interface", "line")

    def __init__(self, read: ReadDeck, problem: Problem):
        self.read = read
        self.problem, self.problem_name = problem, read.label
        self.path = Path(read.label)  # as it is named in messages
        self._runs = False

    @property
    def name(self) -> str:
        """The name of the problem, or of the file that it is in."""
        return self.read.label

    @property
    def deck(self) -> Deck:
        """The checked deck: `case.deck.run.t_end` and so on; it cannot be changed."""
        return self.read.deck

    @property
    def deck_text(self) -> str:
        """The deck as TOML, every key with its value, as `shockgrid check` prints it."""
        return self.read.to_toml()

    @property
    def theory(self) -> dict[str, float]:
        """What the problem's references say for this deck, by name, SI units; {} for nothing."""
        return self.problem.predict()

    @property
    def cautions(self) -> list[str]:
        """Sentences on where results of this deck are not to be trusted."""
        return self.problem.cautions()

    @cached_property
    def simulation(self) -> Evolution:
        """What marches: a `shockgrid.Simulation` in a flow.  Raises BadInput for a bad deck.

        It is made when it is first asked for.  What is changed here changes the run.
        """
        with self.read.numbers_in_reach():
            check_memory(self.problem)
            return self.problem.build()

    @property
    def blocks(self) -> Blocks:
        """The blocks by name: `case.blocks["second"].rho`, (ni, nj) without ghost cells.

        The arrays are views of live data, not to be written to: see `runs.interface.case`.
        """
        axes = ("x", "r") if is_axisymmetric(self.simulation) else ("x", "y")
        return Blocks({block.name: _view(block, axes) for block in self.simulation.blocks})

    @property
    def dumps(self) -> list[Snapshot]:
        """The present state alone, as pictures take it."""
        state = Snapshot(self.path, self.t, self.simulation.t_end, self.problem.t_unit, self.step)
        state.blocks = list(self.blocks.values())
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
        """Why the flow is at its end, or None."""
        return self.simulation.finished

    def measure(self) -> dict[str, float]:
        """The problem's own columns of the history, of the present state."""
        return self.problem.measure(self.simulation)

    def advance(self, steps: int = 1) -> dict[str, Scalar]:
        """Make `steps` steps, fewer where the end comes first; the history row of the last.

        Raises BadInput at the end and from a hook, RunFailure with block, cell and time.
        """
        if self._runs:
            raise BadInput("a hook sees the run between two steps; it cannot advance it")
        if not is_count(steps):
            raise BadInput(f"advance({steps!r}): a whole number of steps, at least 1, is wanted")
        if self.finished:
            raise BadInput(f"{self.name} is at its end already: {self.finished}")
        row: dict[str, Scalar] = {}
        for _ in range(steps):
            row = self.simulation.advance()
            if self.simulation.finished is not None:
                break
        return {"step": self.step, **row, **self.measure()}

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
        """March to the end, from the state that the case has, into a run directory; its data.

        directory: left out, out/<problem>-<n>.  dumps, max_steps: in place of the deck's.  hooks:
        functions of the case called after each step, or `Hook`s, or one of them.  force:
        replace the run that is in the directory.  quiet: no progress and no summary.
        Raises BadInput for a directory that is not empty and on several ranks of MPI, RunFailure
        where the physics fails, KeyboardInterrupt where it was stopped; then the directory can be
        restarted from.
        """
        if self._runs:
            raise BadInput("a hook cannot start the run that it is called from")
        if self.finished:
            raise BadInput(f"{self.name} is at its end already: {self.finished}")
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
            check_memory(self.problem)
            check_requests(read, self.simulation)
            self.measure()
        with said_in_python():
            wanted = None if directory is None else str(directory)
            place = create_directory(wanted, self.name, force)
        if not quiet:
            head = f"{read.problem} ({read.origin}) in {place}"
            print("\n".join([head, *describe_cautions(self.problem)]), file=sys.stderr)
        runner = Runner(read, place, self.problem, self.simulation, quiet, after_step=after_step)
        return self.march(runner, runner.start, quiet)

    def march(self, runner: Runner, start: Any, quiet: bool) -> OpenRun:
        """Let a runner of this case `start`, which gives an ending; the data of its directory."""
        self._runs = True
        try:
            ending = start()
        finally:
            self._runs = False
        return finish(runner, ending, quiet)

    def interface(self) -> Curve:
        """The curve between blocks of different materials now: arrays x, y [m], and t [s]."""
        return find_interface(list(self.blocks.values()), self.t, self.name)

    def plot(self, *fields: str, **options: Any) -> Figure:
        """The figure of the present state; fields and options: `OpenRun.plot`.

        what: "fields", "mesh", "interface" or "line".  Raises BadInput for what there is not.
        """
        what = options.get("what") or (fields[0] if len(fields) == 1 else "")
        if what in ("history", "gauges") or what in self.problem.figures():
            raise BadInput(
                f"{what!r} is a picture of a run's directory: run the case, and plot its data; "
                f"the state in memory shows fields, {', '.join(self.pictures)}"
            )
        if options.get("at") is not None:
            raise BadInput("at: the state in memory has one time; run the case, and plot its data")
        return super().plot(*fields, **options)

    def __repr__(self) -> str:
        if "simulation" not in self.__dict__:
            return f"<case {self.name} ({self.read.origin}), not built yet>"
        names = ", ".join(self.blocks)
        return f"<case {self.name}: t = {self.t:.6g} s, step {self.step}, blocks {names}>"

    def _repr_html_(self) -> str:
        rows = [("problem", self.name), ("deck", self.read.origin)]
        if "simulation" in self.__dict__:
            rows += [("t", f"{self.t:.6g} s of {self.simulation.t_end:.6g} s")]
            rows += [("step", str(self.step))]
            for name, block in self.blocks.items():
                ni, nj = block.cells
                rows.append((f"block {name}", f"{block.material}, {ni} x {nj} cells"))
        return make_table(rows, self.theory)


def load(deck: str | Path, **settings: Any) -> Case:
    """A problem, a packaged deck, a deck's file or a problem's own file, with `settings` over it.

    settings: keys of the deck, as `--set` takes them: `cells=32, run={"t_end": 1e-3}` or
    `**{"run.t_end": 1e-3}`.  Raises BadInput with a sentence about each thing that is wrong.
    """
    with said_in_python():
        read = read_deck(str(deck), make_settings(settings))
        return Case(read, read.make_problem())
