"""A problem with its deck, to inspect, step, run and draw: what `shockgrid.load` returns.

Note: blocks are built when they are first asked for, which may compile kernels for a minute;
their arrays are live (`runs.interface.case`).
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
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
from regrid.errors import BadInput, find_nearest, suggest
from regrid.measure.corners import compute_centres
from runs.deck.reading import ReadDeck, read_deck, resolve_deck
from runs.inspection.account import describe_cautions
from runs.interface.settings import (
    Hooks,
    HooksGiven,
    is_count,
    make_settings,
    make_table,
    said_in_python,
    with_known_options,
)
from runs.march.launching import check_requests
from runs.march.progress import patience
from runs.march.runner import Runner
from runs.ranks.started import check_single
from runs.store.directory import create_directory
from runs.store.reader import get_field

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runs.interface.opened import OpenRun
    from runs.interface.pictures import Curve


def lock(values: np.ndarray) -> np.ndarray:
    """A view of an array through which nothing can be written."""
    view = values.view()
    view.flags.writeable = False
    return view


class LockedFields(Mapping[str, np.ndarray]):
    """Fields by name, each a view through which nothing can be written."""

    def __init__(self, fields: Mapping[str, np.ndarray]):
        self._fields = fields

    def __getitem__(self, name: str) -> np.ndarray:
        return lock(self._fields[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)


class LiveBlock:
    """One block: `nodes` (2, ni+1, nj+1) [m], and its fields `rho`, `u`, `v`, `p`, `e`, (ni, nj).

    SI units; a field of another name is an attribute too.  An unknown name raises AttributeError
    with those that there are.
    """

    def __init__(self, block: BlockView, axes: tuple[str, str] = ("x", "y")):
        self._block = block
        self.name: str = block.name
        self.material: str = get_material(block)
        self.axes = axes
        self.units: Mapping[str, str] = block.units
        fields = {*block.cell_fields, *get_node_fields(block)}
        told = get_long_names(block)
        self.long_names: Mapping[str, str] = {name: told.get(name, name) for name in fields}

    @property
    def nodes(self) -> np.ndarray:
        """Nodes (2, ni+1, nj+1) [m], a view."""
        return lock(self._block.nodes)

    @property
    def centres(self) -> np.ndarray:
        """Middles of the cells (2, ni, nj) [m], computed now."""
        return compute_centres(self._block.nodes)

    @property
    def cells(self) -> tuple[int, int]:
        """Cells along i and along j."""
        ni, nj = (size - 1 for size in self._block.nodes.shape[1:])
        return ni, nj

    @property
    def cell_fields(self) -> Mapping[str, np.ndarray]:
        """Fields of the cells by name, (ni, nj) each: views, and what is computed from them."""
        return LockedFields(self._block.cell_fields)

    @property
    def node_fields(self) -> Mapping[str, np.ndarray]:
        """Fields at the nodes by name, (ni+1, nj+1) each; none in most flows."""
        return LockedFields(get_node_fields(self._block))

    @property
    def state_fields(self) -> Mapping[str, np.ndarray]:
        """What is kept of the cells besides: their rates [1/s], (ni, nj), in flows."""
        rates = getattr(self._block, "rates", None)
        return LockedFields({} if rates is None else {"rates": rates})

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):
            raise AttributeError(name)
        return get_field(self, name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.cell_fields, *self.node_fields})

    def __repr__(self) -> str:
        ni, nj = self.cells
        return f"<block {self.name}: {self.material}, {ni} x {nj} cells>"


class Blocks(Mapping[str, LiveBlock]):
    """The blocks of a flow by name, in their order; BadInput for a name that none has."""

    def __init__(self, blocks: Sequence[BlockView], axes: tuple[str, str]):
        self._blocks = {block.name: LiveBlock(block, axes) for block in blocks}

    def __getitem__(self, name: str) -> LiveBlock:
        try:
            return self._blocks[name]
        except KeyError:
            raise BadInput(f"there is no block {name!r}{suggest(name, self._blocks)}") from None

    def __contains__(self, name: Any) -> bool:
        return name in self._blocks

    def __iter__(self) -> Iterator[str]:
        return iter(self._blocks)

    def __len__(self) -> int:
        return len(self._blocks)

    def __repr__(self) -> str:
        return f"<blocks: {', '.join(self._blocks)}>"


LIVE_PICTURES = ("fields", "mesh", "interface", "line")  # of the state in memory


class Case:
    """One problem with one deck, at the time that it has been marched to."""

    def __init__(self, read: ReadDeck, problem: Problem):
        self.read = read
        self.problem = problem
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
        return Blocks(self.simulation.blocks, self._axes)

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
        after_step = Hooks(self, hooks)  # refused before there is a directory
        output = {"dumps": dumps} if dumps is not None else {}
        run = {"max_steps": max_steps} if max_steps is not None else {}
        read = self._change({"output": output, "run": run})
        most = read.deck.run.max_steps
        if most is not None and 0 < self.step >= most:
            raise BadInput(
                f"{self.name} has made {self.step} steps already, and max_steps = {most}: nothing "
                "is left to do; give a larger one, or make a new simulation"
            )
        with patience(quiet):
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
        from runs.interface.opened import finish

        self._runs = True
        try:
            ending = start()
        finally:
            self._runs = False
        return finish(runner, ending, quiet)

    def _change(self, keywords: dict[str, Any]) -> ReadDeck:
        """The deck with other values for a run of the same blocks."""
        settings = make_settings(keywords)
        if not settings:
            return self.read
        with said_in_python():
            return self._resolve(settings)

    def _resolve(self, settings: tuple[str, ...]) -> ReadDeck:
        table = tomllib.loads(self.read.to_toml())
        return resolve_deck(table, self.read.origin, settings, self.read.file)

    def interface(self) -> Curve:
        """The curve between blocks of different materials now: arrays x, y [m], and t [s]."""
        from runs.interface.pictures import find_interface

        return find_interface(list(self.blocks.values()), self.t, self.name)

    @with_known_options
    def plot(
        self,
        *fields: str,
        what: str | None = None,
        mesh: bool = False,
        zoom: Sequence[float] | None = None,
        mirror: str | None = None,
        beside: str | Path | None = None,
        line: Sequence[float] | None = None,
        limits: Sequence[float] | None = None,
        colours: str | None = None,
    ) -> Figure:
        """The figure of the present state: fields (the density where none is named) or grids.

        what: "fields", "mesh", "interface" or "line"; a single word that is one of these may stand
        in place of a field.  mesh: draw the grid over the fields; zoom: x0, x1, y0, y1 [m]; mirror:
        "x" or "y" completes a half domain; beside: the directory of a run, its dump nearest in time
        drawn to the same scale; line: x0, y0, x1, y1 [m], the fields along it are drawn; limits:
        low, high of the colours in SI units; colours: a colour map.  Raises BadInput for what there
        is not.
        """
        from runs.interface.pictures import draw_picture

        live = _LiveRun(self)
        fields, what = self._choose_picture(fields, what, live.dumps[0])
        return draw_picture(
            live, fields, what, mesh=mesh, zoom=zoom, mirror=mirror, beside=beside, line=line,
            limits=limits, colours=colours,
        )  # fmt: skip

    def _choose_picture(
        self, fields: tuple[str, ...], what: str | None, state: Any
    ) -> tuple[tuple[str, ...], str | None]:
        """Fields and `what` of a picture; BadInput with the names there are for any other."""
        from runs.pictures.fields import list_fields

        known = list_fields(state)
        if what is None and len(fields) == 1 and not set(fields[0].split(",")) <= set(known):
            what, fields = fields[0], ()
        if what is None or what in LIVE_PICTURES:
            return fields, what
        if what in ("history", "gauges") or what in self.problem.figures():
            raise BadInput(
                f"{what!r} is a picture of a run's directory: run the case, and plot its data; "
                f"the state in memory shows {', '.join(LIVE_PICTURES)}"
            )
        shown = ", ".join([*known, *LIVE_PICTURES])
        nearest = find_nearest(what, [*known, *LIVE_PICTURES])
        hint = f"; did you mean {nearest!r}?" if nearest else ""
        raise BadInput(
            f"there is no field or picture {what!r} of {self.name}; there are: {shown}{hint}"
        )

    @property
    def _axes(self) -> tuple[str, str]:
        return ("x", "r") if is_axisymmetric(self.simulation) else ("x", "y")

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
        rows += [(f"theory: {name}", f"{value:.6g}") for name, value in self.theory.items()]
        return make_table(rows)


@dataclass
class _LiveDump:
    """The present state with what pictures ask of a dump."""

    path: str
    t: float
    t_end: float
    step: int
    t_unit: str
    blocks: list[LiveBlock]
    axes: tuple[str, str]
    is_restart_point: bool = False

    def field_names(self) -> list[str]:
        return list(dict.fromkeys(name for block in self.blocks for name in block.cell_fields))


class _LiveRun:
    """A case with what pictures ask of a run."""

    def __init__(self, case: Case):
        simulation, blocks = case.simulation, list(case.blocks.values())
        self.path, self.problem, self.problem_name = Path(case.name), case.problem, case.name
        self.history: dict[str, Any] = {}
        self.skipped: list[str] = []
        state = case.t, simulation.t_end, case.step, case.problem.t_unit
        self.dumps = [_LiveDump(case.name, *state, blocks, case._axes)]


def load(deck: str | Path, **settings: Any) -> Case:
    """A problem, a packaged deck, a deck's file or a problem's own file, with `settings` over it.

    settings: keys of the deck, as `--set` takes them: `cells=32, run={"t_end": 1e-3}` or
    `**{"run.t_end": 1e-3}`.  Raises BadInput with a sentence about each thing that is wrong.
    """
    with said_in_python():
        read = read_deck(str(deck), make_settings(settings))
        return Case(read, read.make_problem())
