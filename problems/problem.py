"""The base of all problems: what a file in `problems/` defines, and how it is used.

A problem is one module.  The first line of its docstring is what `shockgrid list` prints, the
whole docstring is the head of its page in docs/problems.  It has a deck, the initial blocks
(`build`), columns of the history (`measure`), the results of a run compared with theory (`report`)
and its own pictures (`draw_...`).  Summaries, errors for `shockgrid verify`, results for studies
and predictions of the references all follow from the report.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from shockgrid.problems.deck import Deck
from shockgrid.problems.evolution import Evolution
from shockgrid.problems.memory import check_memory
from shockgrid.problems.pictures import finish_panels
from shockgrid.problems.report import History, Report, RunSoFar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shockgrid.hydro.simulation import Simulation

# `run_data` is runs.store.reader.RunData; the import would point the wrong way, hence Any.
AnyDeck: TypeAlias = Deck  # inside Problem the name Deck means the problem's own deck
DrawFigure = Callable[["Figure", Any], None]


@dataclass(frozen=True)
class BlockPlan:
    """Size of a block defined by a deck: cells each way, and the corners of its extent [m]."""

    name: str
    cells: tuple[int, int]
    low: tuple[float, float]
    high: tuple[float, float]

    def make_nodes(self) -> np.ndarray:
        """Nodes (2, ni + 1, nj + 1) of uniform cells in a rectangle of this extent [m]."""
        lines = map(np.linspace, self.low, self.high, np.add(self.cells, 1))
        return np.array(np.meshgrid(*lines, indexing="ij"))


def plan_blocks(grids: Mapping[str, np.ndarray]) -> list[BlockPlan]:
    """Sizes of blocks with the given initial nodes (2, ni + 1, nj + 1), by name."""
    plans = []
    for name, nodes in grids.items():
        low, high = ((float(x), float(y)) for x, y in (nodes.min((1, 2)), nodes.max((1, 2))))
        plans.append(BlockPlan(name, (nodes.shape[1] - 1, nodes.shape[2] - 1), low, high))
    return plans


class Problem:
    """One problem with one deck: blocks to run, measurements, references, pictures."""

    Deck: ClassVar[type[Deck]] = Deck
    units: ClassVar[Mapping[str, str]] = {}  # of columns of `measure` with a unit
    t_unit: str = "s"  # of t: "1" if the deck is dimensionless; or "iterations"
    counted: ClassVar[tuple[str, ...]] = ()  # keys or attributes: their product is all cells

    def __init__(self, deck: AnyDeck):
        """Keep the deck; a subclass checks combinations of fields here (raises BadInput)."""
        self.deck = deck

    @functools.cached_property
    def t_end(self) -> float:
        """End time [s]: the deck's."""
        assert self.deck.run.t_end is not None
        return self.deck.run.t_end

    def find_units(self) -> dict[str, str]:
        """Units of t, dt and the columns of `measure`; "1" if the deck is dimensionless."""
        units = {"t": "s", "dt": "s", **self.units}
        if self.t_unit != "1":
            return units
        return {name: unit if unit.startswith("deg") else "1" for name, unit in units.items()}

    def scale_time(self, t: float) -> str:
        """Time t [s] as pictures name it, such as `k c t = 3`; "" if that is t alone."""
        return ""

    def check_end(self, last: float, words: str) -> None:
        """Raise BadInput if the end time is beyond `last` [s], the time of the event in `words`."""
        wanted = f"at t = {last:g} {words}, the run must end before"
        if self.t_end > last:
            raise self.deck.error("run.t_end", wanted)

    def build(self) -> Evolution:
        """The initial state, ready for the first step."""
        raise NotImplementedError

    def simulate(
        self, blocks: Sequence, links: Sequence = (), kind: Any = None, **options: Any
    ) -> Simulation:
        """The flow of these blocks to the end time, with the deck's run, regrid and void_fill.

        mesh: as there; any other word: the nodes are those of `make_grids` at that time.  kind: a
        class derived from Simulation.  first_dt: bound on the first step [s], for a flow without
        waves initially.
        """
        from shockgrid.hydro.simulation import Simulation  # slow to load; a deck is not

        run = self.deck.run
        regrid = getattr(self.deck, "regrid", None)
        fill = getattr(self.deck, "void_fill", None)
        chosen: dict[str, Any] = {"t_end": self.t_end, "cfl": run.cfl, "threads": run.threads}
        chosen["small_cells"] = run.small_cells
        if fill is not None:
            chosen["void_fill"] = (fill.pressure, fill.gamma)
        mesh = options.get("mesh", "regrid")
        own = type(self).make_grids is not Problem.make_grids
        if own and isinstance(mesh, str) and mesh not in ("regrid", "fixed"):
            options["mesh"] = lambda name, t: self.make_grids(t)[name]
        if regrid is not None:
            chosen["make_regridder"] = lambda: regrid.make(threads=run.threads)
        chosen |= options
        first_dt = chosen.pop("first_dt", math.inf)
        simulation = (kind or Simulation)(list(blocks), list(links), **chosen)
        simulation.clock.retry_dt = first_dt
        return simulation

    def make_handover(self, blocks: Sequence, size: float) -> Any:
        """What lays these blocks, which fill a rectangle, on one of two materials where they can
        no longer be followed; None where the deck does not say so.

        size: of the blocks' cells [m].
        """
        deck: Any = self.deck
        if not deck.handover:
            return None
        from shockgrid.hydro.remap.box import make_box_handover  # with scipy: slow to load

        return make_box_handover(
            blocks,
            size / deck.handover_refinement,
            lambda: deck.regrid.make(threads=deck.run.threads),
        )

    def list_boxes(self) -> list[BlockPlan]:
        """The blocks if they are rectangles of uniform cells, or may be planned as such."""
        return []

    def make_grids(self, t: float = 0.0) -> dict[str, np.ndarray]:
        """Nodes (2, ni + 1, nj + 1) [m] of the blocks by name, initially or at time t if their
        motion is given: those of the boxes; {} if only `build` can determine them."""
        return {box.name: box.make_nodes() for box in self.list_boxes()}

    def plan(self) -> tuple[float, list[BlockPlan]] | None:
        """End time and blocks of the run without allocating it, after all checks of the deck; None
        if they are unknown before `build`."""
        if not (boxes := self.list_boxes()):
            self.check_memory()
            boxes = plan_blocks(self.make_grids())
        return (self.t_end, boxes) if boxes else None

    def estimate_cells(self) -> int:
        """Cells of all blocks by arithmetic alone, or slightly more: used before `plan` and
        `build`, so that too many are refused before any array is allocated."""
        if self.counted:
            return math.prod(getattr(self, n, None) or getattr(self.deck, n) for n in self.counted)
        known = self.list_boxes() or type(self).plan is not Problem.plan
        plan = self.plan() if known else None
        return sum(math.prod(block.cells) for block in plan[1]) if plan else 0

    def estimate_solver_memory(self, cells: int) -> float:
        """Bytes of factorised matrices, where the problem has some, at the peak."""
        return 0.0

    def check_memory(self) -> None:
        """Raise BadInput for a problem that does not fit into memory."""
        check_memory(self.estimate_cells(), self.estimate_solver_memory)

    def measure(self, evolution: Evolution) -> dict[str, float]:
        """Extra history columns, evaluated before the first and after every step: cheap, with fixed
        keys, a function of the evolution's state alone (restarts must give the same)."""
        return {}

    def measures(self) -> bool:
        """Whether `measure` has anything to measure."""
        return type(self).measure is not Problem.measure

    def report(self, run: RunSoFar) -> Report:
        """Computed results compared with theory: the one method for all numbers of a run.

        Before a run (`run.begun` is False) the rows have theory only.  The runner prints time,
        steps and conservation itself.
        """
        return Report()

    def cautions(self, run: RunSoFar) -> list[str]:
        """Sentences on why this deck's results may be unreliable; none if they are reliable.

        Before a run they follow from the deck alone: shown by `check`, by `--dry-run` and before
        the first step.  Of a run that has begun they also use its results (summary and `info`).
        A sentence names the quantity, its error or why that is unknown, and what to change.
        """
        return []

    def say_restart(self, directory: str) -> str:
        """The command that continues a stopped run in `directory`, quoted for a shell."""
        return f"shockgrid restart {directory}"

    def say_repeat(self) -> str:
        """How to repeat its runs if the deck alone is not sufficient; otherwise ""."""
        return ""

    def figures(self) -> dict[str, DrawFigure]:
        """Pictures of this problem by name: its methods `draw_<name>(figure, run_data)`, with
        legends and fine lines added.

        `run_data` (runs.store.reader.RunData) has `.deck`, `.history` (dict of arrays), `.dumps`.
        """
        own = [name for kind in reversed(type(self).__mro__) for name in vars(kind)]
        drawn = [name for name in dict.fromkeys(own) if name.startswith("draw_")]
        return {name[5:].replace("_", "-"): self._finish(getattr(self, name)) for name in drawn}

    @staticmethod
    def _finish(draw: DrawFigure) -> DrawFigure:
        def draw_whole(figure, run_data):
            draw(figure, run_data)
            finish_panels(figure)

        return draw_whole

    def report_on(self, history: History | None = None, final: Evolution | None = None) -> Report:
        """The report of a run with this history and final state; without them theory alone."""
        return self.report(RunSoFar(self, history, final))

    def cautions_on(self, history: History | None = None) -> list[str]:
        """The cautions about a run with this history; without one, about the deck alone."""
        return self.deck.find_cautions() + self.cautions(RunSoFar(self, history))

    def summary(self, history: History, final: Evolution | None = None) -> str:
        """The report as text."""
        return str(self.report_on(history, final))

    def theory(self) -> dict[str, float]:
        """What the references predict for this deck, by name; nothing if they are unknown."""
        rows = self.report_on().rows
        return {row.name: float(row.theory) for row in rows if not math.isnan(row.theory)}

    def errors(self, history: History) -> dict[str, float]:
        """Errors of a complete run against the references by name, for `shockgrid verify`."""
        rows = self.report_on(history).rows
        return {row.error: row.find_error() for row in rows if row.error}

    def results(self, history: History) -> dict[str, tuple[float, float]]:
        """The main results of a complete run by name: computed value and theory.

        For studies, which plot the first of them over the varied keys.
        """
        rows = self.report_on(history).rows if history else []
        return {row.name: (row.computed, row.theory) for row in rows if row.studied}
