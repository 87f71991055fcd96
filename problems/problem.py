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
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from shockgrid.problems.deck import Deck
from shockgrid.problems.evolution import Evolution
from shockgrid.problems.pictures import finish_panels
from shockgrid.regrid.errors import BadInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shockgrid.hydro.simulation import Simulation

# `run_data` is runs.store.reader.RunData; the import would point the wrong way, hence Any.
AnyDeck: TypeAlias = Deck  # inside Problem the name Deck means the problem's own deck
History: TypeAlias = Mapping[str, np.ndarray]
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


@dataclass(frozen=True)
class Row:
    """One number of a report: as computed and by theory, NaN where unknown, in SI units.

    A number with a column of `measure` is named like it.  `label`: its text in the summary, which
    omits rows without one and shows the number over `unit` (1e9 for GPa).  Its error is relative to
    `size` (default: the theory), or the number itself if theory is 0 or unknown; `error` is its
    name in `shockgrid verify`.  Studies draw rows that are `studied`.  `source` is that of the
    theory; `off` is a text in place of the difference.
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
        """Computed minus theory, over `size` or the theory; NaN if undefined.

        Over the theory it is positive where the number is too large in magnitude, whatever its
        sign.
        """
        size = self.size or self.theory
        return (self.computed - self.theory) / size if size else math.nan

    def find_error(self) -> float:
        """Magnitude of the error."""
        bare = math.isnan(self.theory) or not (self.theory or self.size)
        return abs(self.computed) if bare else abs(self.difference)

    def format(self, width: int) -> str:
        """The line in the summary, the label padded to `width`; "-" for unknown numbers."""
        numbers = [self.computed, self.theory]
        texts = [f"{x / self.unit:.{self.digits}g}" if math.isfinite(x) else "-" for x in numbers]
        if math.isnan(self.theory):
            texts[1] = ""
        off = f"{100.0 * self.difference:+.3f} %" if math.isfinite(self.difference) else ""
        line = f"{texts[0]:>14} {texts[1]:>14} {self.off or off:>12}"
        return f"  {self.label:{width}} {line}   {self.source}".rstrip()


@dataclass(frozen=True)
class Report:
    """The results of a run: a head, rows in a table, and sentences below them.

    A head that takes long to compute is a function, called when the report is printed.
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
    """The history of a run that has not started: each of its columns is one NaN."""

    def __missing__(self, name: str) -> np.ndarray:
        return np.full(1, math.nan)


def align(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table, its first column aligned left, the others right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    first = [f"  {row[0]:{widths[0]}}" for row in rows]
    return [
        "   ".join([head, *map(str.rjust, row[1:], widths[1:])]).rstrip()
        for head, row in zip(first, rows, strict=True)
    ]


def get_last(history: History, name: str) -> float:
    """The last value of a column; NaN if there is none."""
    column = history.get(name)
    return float(column[-1]) if column is not None and len(column) else math.nan


def find_most(history: History, name: str) -> float:
    """The largest value of a column; NaN if there is none."""
    column = history.get(name, np.empty(0))
    return float(np.nanmax(column)) if np.isfinite(column).any() else math.nan


def find_crossing(x: np.ndarray, values: np.ndarray, level: float) -> float:
    """The last x at which `values` (n,) at `x` (n,) fall below a level, by linear interpolation;
    NaN if none is above it, or the last one still is."""
    over = np.flatnonzero(values > level)
    if over.size == 0 or over[-1] + 1 == values.size:
        return math.nan
    i = over[-1]
    part = (values[i] - level) / (values[i] - values[i + 1])
    return float(x[i] + part * (x[i + 1] - x[i]))


def average_plateau(edges: np.ndarray, values: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    """Means (k,) of `values` (k, n) over the cells between `edges` (n + 1) with their centres in
    the middle half of a plateau that reaches from one of `ends` to the other; NaN without any."""
    middle = 0.5 * (ends[0] + ends[1])
    length = abs(ends[1] - ends[0])
    inside = np.abs(0.5 * (edges[1:] + edges[:-1]) - middle) < 0.25 * length
    if not inside.any():
        return np.full(len(values), math.nan)
    return np.average(np.asarray(values)[:, inside], axis=1, weights=np.diff(edges)[inside])


def reduce_between(
    reduce: Callable, x: np.ndarray, values: np.ndarray, low: float, high: float, least: int = 1
) -> float:
    """`reduce`, such as np.mean, of the values (n,) with x between two bounds; NaN for fewer than
    `least`."""
    chosen = values[(x > low) & (x < high)]
    return float(reduce(chosen)) if chosen.size >= least else math.nan


def measure_below(line: np.ndarray, curved: bool) -> float:
    """Area [m2] between a line (2, n) and y = 0, or if `curved` the volume per radian [m3]."""
    x, y = line
    near = y[:-1]
    far = y[1:]
    height = far * far + far * near + near * near if curved else far + near
    return float((np.diff(x) * height).sum()) / (6.0 if curved else 2.0)


def find_frequency(t: np.ndarray, values: np.ndarray) -> float:
    """Angular frequency [1/s] from the zero crossings of a wave's values at times t (n,); NaN for
    fewer than two."""
    change = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    if change.size < 2:
        return math.nan
    part = values[change] / (values[change] - values[change + 1])
    zeros = t[change] + part * (t[change + 1] - t[change])
    return math.pi * (change.size - 1) / float(zeros[-1] - zeros[0])


def find_growth_rate(t: np.ndarray, values: np.ndarray) -> float:
    """Rate [1/s] of a growth as cosh(rate t) from values (n,) at three times, a third of the last
    apart: a1 + a3 = 2 a2 cosh(rate T); NaN if there is none."""
    first, middle, last = np.interp([t[-1] / 3.0, t[-1] / 1.5, t[-1]], t, values)
    ratio = (first + last) / (2.0 * middle)
    return math.acosh(ratio) / (t[-1] / 3.0) if ratio > 1.0 else math.nan


def fit_slope(x: np.ndarray, y: np.ndarray, chosen: Any = slice(None), least: int = 3) -> float:
    """Slope of the least-squares line through the `chosen` points x, y (n,); NaN for fewer than
    `least`."""
    x, y = x[chosen], y[chosen]
    return float(np.polyfit(x, y, 1)[0]) if x.size >= least else math.nan


def compare(
    history: History, name: str, theory: float = math.nan, label: str = "", **more: Any
) -> Row:
    """The row of a column's last value; `more`: further fields of the row."""
    return Row(name, get_last(history, name), theory, label, **more)


def find_time(history: History, condition: np.ndarray) -> float:
    """The first time [s] at which a condition (n,) on the rows of a history holds, or NaN."""
    met = np.flatnonzero(condition)
    return float(history["t"][met[0]]) if met.size else math.nan


def keep_until(history: History, t: float) -> History:
    """The rows of a history up to the time `t` [s], the first at least: as far as theory goes."""
    if not history:
        return history
    rows = max(1, int(np.searchsorted(history["t"], t, side="right")))
    return {name: column[:rows] for name, column in history.items()}


def say_unreached(history: History, name: str) -> list[str]:
    """A sentence if a column that is measured at the end time has no value."""
    known = not math.isnan(get_last(history, name))
    return [] if known else ["the error is measured at the end time, which was not reached"]


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
            check_memory(self)
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

    def measure(self, evolution: Evolution) -> dict[str, float]:
        """Extra history columns, evaluated before the first and after every step: cheap, with fixed
        keys, a function of the evolution's state alone (restarts must give the same)."""
        return {}

    def measures(self) -> bool:
        """Whether `measure` has anything to measure."""
        return type(self).measure is not Problem.measure

    def report(self, history: History, final: Evolution | None = None) -> Report:
        """Computed results compared with theory: the one method for all numbers of a run.

        `history` maps columns to arrays; before a run it is a `NoHistory`, which is false, and rows
        have theory only; `final` is the state at the end, None if only the run directory is
        available.  The runner prints time, steps and conservation itself.
        """
        return Report()

    def cautions(self, history: History | None = None) -> list[str]:
        """Sentences on why this deck's results may be unreliable; none if they are reliable.

        Without a `history` they follow from the deck alone: shown by `check`, by `--dry-run` and
        before the first step.  With that of a run they also use its results (summary and `info`).
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

    def summary(self, history: History, final: Evolution | None) -> str:
        """The report as text."""
        return str(self.report(history or NoHistory(), final))

    def predict(self) -> dict[str, float]:
        """Predictions of the references for this deck, by name; none if unknown."""
        rows = self.report(NoHistory()).rows
        return {row.name: float(row.theory) for row in rows if not math.isnan(row.theory)}

    def errors(self, history: History) -> dict[str, float]:
        """Errors of a complete run against the references by name, for `shockgrid verify`."""
        return {row.error: row.find_error() for row in self.report(history).rows if row.error}

    def results(self, history: History) -> dict[str, tuple[float, float]]:
        """The main results of a complete run by name: computed value and theory.

        For studies, which plot the first of them over the varied keys.
        """
        rows = self.report(history).rows if history else []
        return {row.name: (row.computed, row.theory) for row in rows if row.studied}


LARGE_GRID_CELLS = 100_000  # cells
PROGRAM_BYTES = 190e6  # bytes of the program with its libraries and kernels, measured
RUN_BYTES = 640  # per cell at the peak of a run, measured,
# for blocks of LARGE_GRID_CELLS cells and more, two equal ones, with solves; without: 200
LARGE_BYTES = 350


def estimate_memory(cells: int, blocks: Sequence[int] = ()) -> float:
    """Peak memory [bytes] of a run with `cells` cells; `blocks`: the cells of each, if known.

    Without `blocks`, LARGE_GRID_CELLS cells and more are assumed to be in large blocks.
    """
    blocks = blocks or [cells]
    return PROGRAM_BYTES + sum(
        n * (LARGE_BYTES if n >= LARGE_GRID_CELLS else RUN_BYTES) for n in blocks
    )


def find_memory() -> float | None:
    """Memory [bytes] available to this process; None if the system does not tell (Windows)."""
    try:
        import resource

        memory = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    except (ImportError, AttributeError, OSError, ValueError):
        return None
    return memory if limit == resource.RLIM_INFINITY else min(memory, float(limit))


def check_memory(problem: Problem) -> None:
    """Raise BadInput for a problem that does not fit into memory."""

    def need(count: float) -> float:
        return estimate_memory(int(count)) + problem.estimate_solver_memory(int(count))

    cells = problem.estimate_cells()
    memory = find_memory()
    if memory is None or (wanted := need(cells)) <= memory:
        return
    fit = float(cells)
    while fit > 1.0 and need(fit) > memory:
        fit *= 0.98
    raise BadInput(
        f"deck: {cells:.4g} cells need about {wanted / 1e9:.3g} GB of memory, where "
        f"{memory / 1e9:.3g} GB are there; take fewer cells, at most about {fit:.2g} fit"
    )
