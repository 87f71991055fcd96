"""The base of all problems: what a file in `problems/` says, and what is made of it.

A problem is one module.  The first line of its docstring is what `shockgrid list` prints, the
whole docstring is the head of its page in docs/problems.  It has a deck, the blocks that it starts
from (`build`), columns of the history (`measure`), the numbers that a run found beside theory
(`report`) and its own pictures (`draw_...`).  Screens, errors for `shockgrid verify`, the results
that studies draw and what the references say beforehand all follow from the report.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from problems.deck import Deck
from problems.evolution import Evolution
from problems.pictures import finish_panels
from regrid.errors import BadInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hydro.simulation import Simulation

# `run_data` is runs.store.reader.RunData; the import would point the wrong way, hence Any.
AnyDeck: TypeAlias = Deck  # inside Problem the name Deck is that of the problem's own
History: TypeAlias = Mapping[str, np.ndarray]
DrawFigure = Callable[["Figure", Any], None]


@dataclass(frozen=True)
class BlockPlan:
    """Size of a block that a deck asks for: cells each way, and the corners of its extent [m]."""

    name: str
    cells: tuple[int, int]
    low: tuple[float, float]
    high: tuple[float, float]

    def make_nodes(self) -> np.ndarray:
        """Nodes (2, ni + 1, nj + 1) of even cells in a rectangle of this extent [m]."""
        lines = map(np.linspace, self.low, self.high, np.add(self.cells, 1))
        return np.array(np.meshgrid(*lines, indexing="ij"))


def plan_blocks(grids: Mapping[str, np.ndarray]) -> list[BlockPlan]:
    """Sizes of blocks whose first nodes (2, ni + 1, nj + 1) are made, by name."""
    plans = []
    for name, nodes in grids.items():
        low, high = ((float(x), float(y)) for x, y in (nodes.min((1, 2)), nodes.max((1, 2))))
        plans.append(BlockPlan(name, (nodes.shape[1] - 1, nodes.shape[2] - 1), low, high))
    return plans


@dataclass(frozen=True)
class Row:
    """One number of a report: as computed and by theory, NaN where unknown, in SI units.

    A number that belongs to a column of `measure` has its name.  `label`: its words on the screen,
    which has no line for it without, and shows it over `unit` (1e9 for GPa).  Its error is relative
    to `size` (left out: the theory), or the number itself where theory is 0 or unknown; `error` is
    the name that `shockgrid verify` has for it.  Studies draw rows that are `studied`.  Beside the
    numbers stand the `source` of the theory, and `off`, words in place of the difference.
    """

    name: str
    computed: float = math.nan
    theory: float = math.nan
    label: str = ""
    unit: float = 1.0
    digits: int = 6
    error: str = ""
    size: float = 0.0
    studied: bool = False
    source: str = ""
    off: str = ""

    @property
    def difference(self) -> float:
        """Computed less theory over `size`; NaN where there is nothing to relate it to."""
        size = self.size or abs(self.theory)
        return (self.computed - self.theory) / size if size else math.nan

    def find_error(self) -> float:
        """Size of the error."""
        bare = math.isnan(self.theory) or not (self.theory or self.size)
        return abs(self.computed) if bare else abs(self.difference)

    def format(self, width: int) -> str:
        """The line on the screen, the label as wide as `width`; "-" for what is not known."""
        numbers = [self.computed, self.theory]
        words = [f"{x / self.unit:.{self.digits}g}" if math.isfinite(x) else "-" for x in numbers]
        if math.isnan(self.theory):
            words[1] = ""
        off = f"{100.0 * self.difference:+.3f} %" if math.isfinite(self.difference) else ""
        line = f"{words[0]:>14} {words[1]:>14} {self.off or off:>12}"
        return f"  {self.label:{width}} {line}   {self.source}".rstrip()


@dataclass(frozen=True)
class Report:
    """What a run has found: a head, rows in a table, and sentences below them.

    A head that takes long to compute is a function, called when the report is shown.
    """

    head: str | Callable[[], str] = ""
    rows: Sequence[Row] = field(default_factory=list)
    notes: Sequence[str] = field(default_factory=list)

    def __str__(self) -> str:
        shown = [row for row in self.rows if row.label]
        lines = [self.head() if callable(self.head) else self.head]
        if shown:
            width = max(30, *(len(row.label) for row in shown))
            lines.append(f"  {'':{width}} {'computed':>14} {'theory':>14} {'difference':>12}")
            lines += [row.format(width) for row in shown]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


class NoHistory(dict):
    """The history of a run that has not begun: each of its columns is one NaN."""

    def __missing__(self, name: str) -> np.ndarray:
        return np.full(1, math.nan)


def align(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table, its first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    first = [f"  {row[0]:{widths[0]}}" for row in rows]
    return [
        "   ".join([head, *map(str.rjust, row[1:], widths[1:])]).rstrip()
        for head, row in zip(first, rows, strict=True)
    ]


def get_last(history: History, name: str) -> float:
    """The last value of a column; NaN where there is none."""
    column = history.get(name)
    return float(column[-1]) if column is not None and len(column) else math.nan


def find_most(history: History, name: str) -> float:
    """The greatest value of a column; NaN where there is none."""
    column = history.get(name, np.empty(0))
    return float(np.nanmax(column)) if np.isfinite(column).any() else math.nan


def find_crossing(x: np.ndarray, values: np.ndarray, level: float) -> float:
    """The last place where `values` (n,) at `x` (n,) fall below a level, linear between two; NaN
    where none is above it, or the last one still is."""
    over = np.flatnonzero(values > level)
    if over.size == 0 or over[-1] + 1 == values.size:
        return math.nan
    i = over[-1]
    part = (values[i] - level) / (values[i] - values[i + 1])
    return float(x[i] + part * (x[i + 1] - x[i]))


def average_plateau(edges: np.ndarray, values: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    """Means (k,) of `values` (k, n) over the cells between `edges` (n + 1) with their centres in
    the middle half of a plateau that reaches from one of `ends` to the other; NaN without any."""
    middle, length = 0.5 * (ends[0] + ends[1]), abs(ends[1] - ends[0])
    inside = np.abs(0.5 * (edges[1:] + edges[:-1]) - middle) < 0.25 * length
    if not inside.any():
        return np.full(len(values), math.nan)
    return np.average(np.asarray(values)[:, inside], axis=1, weights=np.diff(edges)[inside])


def reduce_between(
    reduce: Callable, x: np.ndarray, values: np.ndarray, low: float, high: float, least: int = 1
) -> float:
    """What `reduce`, such as np.mean, makes of values (n,) at places x between two; NaN of fewer
    than `least`."""
    chosen = values[(x > low) & (x < high)]
    return float(reduce(chosen)) if chosen.size >= least else math.nan


def measure_below(line: np.ndarray, curved: bool) -> float:
    """Area [m2] between a line (2, n) and y = 0, or where `curved` the volume per radian [m3]."""
    x, y = line
    near, far = y[:-1], y[1:]
    height = far * far + far * near + near * near if curved else far + near
    return float((np.diff(x) * height).sum()) / (6.0 if curved else 2.0)


def find_frequency(t: np.ndarray, values: np.ndarray) -> float:
    """Angular frequency [1/s] by the times t (n,) at which a wave's values are 0; NaN of fewer than
    two such times."""
    change = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    if change.size < 2:
        return math.nan
    part = values[change] / (values[change] - values[change + 1])
    zeros = t[change] + part * (t[change + 1] - t[change])
    return math.pi * (change.size - 1) / float(zeros[-1] - zeros[0])


def find_growth_rate(t: np.ndarray, values: np.ndarray) -> float:
    """Rate [1/s] of a growth as cosh(rate t) from values (n,) at three times, a third of the last
    apart: a1 + a3 = 2 a2 cosh(rate T); NaN where there is none."""
    first, middle, last = np.interp([t[-1] / 3.0, t[-1] / 1.5, t[-1]], t, values)
    ratio = (first + last) / (2.0 * middle)
    return math.acosh(ratio) / (t[-1] / 3.0) if ratio > 1.0 else math.nan


def fit_slope(x: np.ndarray, y: np.ndarray, chosen: Any = slice(None), least: int = 3) -> float:
    """Slope of the straight line nearest to the `chosen` of the points x, y (n,); NaN of fewer than
    `least`."""
    x, y = x[chosen], y[chosen]
    return float(np.polyfit(x, y, 1)[0]) if x.size >= least else math.nan


def compare(
    history: History, name: str, theory: float = math.nan, label: str = "", **more: Any
) -> Row:
    """The row of a column's last value; `more`: further fields of the row."""
    return Row(name, get_last(history, name), theory, label, **more)


def find_time(history: History, condition: np.ndarray) -> float:
    """The first time [s] at which a condition (n,) on the rows of a history holds; NaN if never."""
    met = np.flatnonzero(condition)
    return float(history["t"][met[0]]) if met.size else math.nan


def say_unreached(history: History, name: str) -> list[str]:
    """A sentence where a column that is measured at the end time has no value."""
    known = not math.isnan(get_last(history, name))
    return [] if known else ["the error is measured at the end time, which was not reached"]


class Problem:
    """One problem with one deck: blocks to run, measurements, references, pictures."""

    Deck: ClassVar[type[Deck]] = Deck
    units: ClassVar[Mapping[str, str]] = {}  # of the columns of `measure` that have one
    t_unit: str = "s"  # of t: "1" where the deck's numbers have no units; or "iterations"
    counted: ClassVar[tuple[str, ...]] = ()  # own numbers, keys: their product is the cells of all
    measures_sides: ClassVar[bool] = False  # `measure` reads cells along sides alone: `reads_cells`

    def __init__(self, deck: AnyDeck):
        """Keep the deck; a subclass checks here what no single field can (raises BadInput)."""
        self.deck = deck

    @functools.cached_property
    def t_end(self) -> float:
        """End time [s]: the deck's."""
        assert self.deck.run.t_end is not None
        return self.deck.run.t_end

    def find_units(self) -> dict[str, str]:
        """Units of t, dt and the columns of `measure`; "1" where the deck's numbers have none."""
        units = {"t": "s", "dt": "s", **self.units}
        if self.t_unit != "1":
            return units
        return {name: unit if unit.startswith("deg") else "1" for name, unit in units.items()}

    def scale_time(self, t: float) -> str:
        """Time t [s] as pictures name it, such as `k c t = 3`; "" where that is t alone."""
        return ""

    def check_end(self, last: float, words: str) -> None:
        """Raise BadInput where the end time is beyond `last` [s], when what `words` say is so."""
        wanted = f"at t = {last:g} {words}, the run must end before"
        self.deck.refuse(self.t_end > last, "run.t_end", wanted)

    def build(self) -> Evolution:
        """The initial state, ready for its first step."""
        raise NotImplementedError

    def simulate(
        self, blocks: Sequence, links: Sequence = (), kind: Any = None, **options: Any
    ) -> Simulation:
        """The flow of these blocks to the end time, with the deck's run, regrid and void_fill.

        mesh: as there; any other word: the nodes are those of `make_grids` at the time.  kind: a
        class derived from Simulation.  first_dt: bound on the first step
        [s], of a flow that knows of no wave yet.
        """
        from hydro.simulation import Simulation  # slow to load; a deck is not

        run, regrid = self.deck.run, getattr(self.deck, "regrid", None)
        fill = getattr(self.deck, "void_fill", None)
        chosen: dict[str, Any] = {"t_end": self.t_end, "cfl": run.cfl, "threads": run.threads}
        chosen["small_cells"] = run.small_cells
        if fill is not None:
            chosen["void_fill"] = (fill.pressure, fill.gamma)
        mesh, own = options.get("mesh", "regrid"), type(self).make_grids is not Problem.make_grids
        if own and isinstance(mesh, str) and mesh not in ("regrid", "fixed"):
            options["mesh"] = lambda name, t: self.make_grids(t)[name]
        if regrid is not None:
            chosen["make_regridder"] = lambda: regrid.make(threads=run.threads)
        chosen |= options
        first_dt = chosen.pop("first_dt", math.inf)
        simulation = (kind or Simulation)(list(blocks), list(links), **chosen)
        simulation.clock.retry_dt = first_dt
        return simulation

    def list_boxes(self) -> list[BlockPlan]:
        """The blocks where they are rectangles of even cells, or may be planned as such."""
        return []

    def make_grids(self, t: float = 0.0) -> dict[str, np.ndarray]:
        """Nodes (2, ni + 1, nj + 1) [m] of the blocks by name at the start, and at time t where
        their motion is given: those of the boxes; {} where `build` is the only way to know."""
        return {box.name: box.make_nodes() for box in self.list_boxes()}

    def plan(self) -> tuple[float, list[BlockPlan]] | None:
        """End time and blocks of the run without allocating it, after all checks of the deck; None
        where they are unknown before `build`."""
        if not (boxes := self.list_boxes()):
            check_memory(self)
            boxes = plan_blocks(self.make_grids())
        return (self.t_end, boxes) if boxes else None

    def estimate_cells(self) -> int:
        """Cells of all blocks by arithmetic alone, or somewhat more: asked before `plan` and
        `build`, so that too many are refused before an array of them is made."""
        if self.counted:
            return math.prod(getattr(self, n, None) or getattr(self.deck, n) for n in self.counted)
        known = self.list_boxes() or type(self).plan is not Problem.plan
        plan = self.plan() if known else None
        return sum(math.prod(block.cells) for block in plan[1]) if plan else 0

    def measure(self, evolution: Evolution) -> dict[str, float]:
        """Extra history columns, evaluated before the first and after every step: cheap, same
        keys always, a function of the evolution's state alone (a restart must give the same)."""
        return {}

    @property
    def reads_cells(self) -> bool:
        """Does `measure` read cells' states besides three rows along every side, or nodes inside?

        On several ranks of MPI the first one, which measures, then receives all of all blocks after
        every step.  What `measure_block` of a `hydro.simulation.Simulation` finds does not count.
        """
        return not (self.measures_sides or type(self).measure is Problem.measure)

    def report(self, history: History, final: Evolution | None = None) -> Report:
        """What was computed, beside what theory says: the one method for all numbers of a run.

        `history` maps columns to arrays; before a run it is a `NoHistory`, which is false, and rows
        have their theory alone; `final` is the state at the end, None when only the run directory
        is at hand.  The runner prints time, steps and conservation itself.
        """
        return Report()

    def cautions(self, history: History | None = None) -> list[str]:
        """Sentences on where this deck's results are not to be trusted; none where they are.

        Without a `history` from the deck alone: shown by `check`, by `--dry-run` and before the
        first step.  With that of a run also from what the run shows: in the summary and by `info`.
        A sentence names the quantity, how far it is off or why nobody knows, and what to change.
        """
        return []

    def say_restart(self, directory: str) -> str:
        """The command that continues a stopped run in `directory`, quoted for a shell."""
        return f"shockgrid restart {directory}"

    def say_repeat(self) -> str:
        """How its runs are made again where the deck alone does not do it; "" where it does."""
        return ""

    def figures(self) -> dict[str, DrawFigure]:
        """Pictures of this problem by name: its methods `draw_<name>(figure, run_data)`, to which
        legends and fine lines are added.

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

    def summary(self, history: History, final: Evolution | None) -> str:
        """The report as text."""
        return str(self.report(history or NoHistory(), final))

    def predict(self) -> dict[str, float]:
        """What the references say for this deck, by name; none where unknown."""
        rows = self.report(NoHistory()).rows
        return {row.name: float(row.theory) for row in rows if not math.isnan(row.theory)}

    def errors(self, history: History) -> dict[str, float]:
        """Errors of a whole run against the references by name, for `shockgrid verify`."""
        return {row.error: row.find_error() for row in self.report(history).rows if row.error}

    def results(self, history: History) -> dict[str, tuple[float, float]]:
        """What a whole run was made to find, by name: as computed, and by theory.

        For studies, which draw the first of them over what is varied.
        """
        rows = self.report(history).rows if history else []
        return {row.name: (row.computed, row.theory) for row in rows if row.studied}


LARGE = 100_000  # cells
PROGRAM = 190e6  # bytes of the program with its libraries and kernels, measured
RUN_BYTES = 640  # a cell at the peak of a run, measured,
LARGE_BYTES = 350  # of blocks of LARGE cells and more, two even ones, with solves; without 200


def estimate_memory(cells: int, blocks: Sequence[int] = ()) -> float:
    """Bytes that a run of so many cells takes at its peak; `blocks`: the cells of each, if known.

    Without them it is taken for a run of large blocks from LARGE cells on.
    """
    blocks = blocks or [cells]
    return PROGRAM + sum(n * (LARGE_BYTES if n >= LARGE else RUN_BYTES) for n in blocks)


def find_memory() -> float | None:
    """Bytes of memory that this process may have; None where the system does not say (Windows)."""
    try:
        import resource

        memory = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    except (ImportError, AttributeError, OSError, ValueError):
        return None
    return memory if limit == resource.RLIM_INFINITY else min(memory, float(limit))


def check_memory(problem: Problem) -> None:
    """Raise BadInput for a problem whose cells the memory does not hold."""
    cells, memory = problem.estimate_cells(), find_memory()
    if memory is None or (wanted := estimate_memory(cells)) <= memory:
        return
    fit = max(0.0, cells * (memory - PROGRAM) / (wanted - PROGRAM))
    raise BadInput(
        f"deck: {cells:.4g} cells need about {wanted / 1e9:.3g} GB of memory, where "
        f"{memory / 1e9:.3g} GB are there; take fewer cells, at most about {fit:.2g} fit"
    )
