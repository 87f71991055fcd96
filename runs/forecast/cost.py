"""What a run will cost: before it starts, and how long it still takes while it marches.

Steps come from the first stable dt, or where nothing is built yet from the width of the finest
cells, and from how dt went in a past run of the same flow or problem.  The wall time of a step
comes from runs that finished on this machine; where there was none, it is said to be unknown.

A past run is known by its flow: its problem and those keys of its deck that differ from the
problem's defaults, without cells, `run`, `output` and gauges.  past_runs.json beside this file is
delivered and knows steps alone; runs that finish here are kept in the cache directory, with the
wall time of their steps.  A cache that cannot be read or written is none.

While a run marches, what is left is the integral of what a second of the flow costs,

    left = integral of cost rate (t') dt' from now to t_end,    log rate(t') = log rate + trend,

with the trend fitted to the latter half of the steps, believed in for about as long as it has been
seen, and that of a past run of the same deck, weighed by the part of the steps that is made.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from problems.deck import Output
from problems.problem import BlockPlan, Problem, estimate_memory
from regrid.errors import BadInput
from runs.deck.reading import ReadDeck
from runs.inspection.account import count
from runs.store.directory import KEPT_RESTARTS
from runs.store.files import write_atomically

DUMP_BYTES = 64  # a cell in a dump: nodes, five fields and a rate
BLOCK_BYTES = 30_000  # of a block in a dump, for the form of the file; measured
ROW_BYTES = 600  # of a step in history.csv; measured
# steps over those foretold, at the least and most, by what they are foretold from
RANGES = {"same": (0.75, 1.5), "like": (0.5, 5.0), "nothing": (0.5, 5.0)}
MOST_NAMED = 6  # blocks in a line
TIGHT = 0.9  # part of the free disk that a run may be foretold to fill without a word

DELIVERED = Path(__file__).with_name("past_runs.json")
KEPT = 300  # runs of this machine
SURE = 1.4  # a step's wall time may be so many times what it was in runs before, or less
UNSURE = 0.25  # power of the ratio of cells by which that grows
LEAST_STEPS = 40  # of a run that says something about others
OTHER = ("run", "output", "gauge", "cells")  # keys of a deck that leave the flow as it is

FIRST_STEPS = 12  # until there is a word: the first five are shortened on purpose
GROWTH = 1.03  # of the steps from mark to mark: a few hundred marks for any run
STEEPEST = 4.0  # change of a logarithm, at most, that is foretold from a fit alone
UNUSUAL = 4.0  # times the usual wall time of a step: no speed, but an event
POINTS = 200  # of the integral
PARTS = 20  # of the time of a past run
# what the cost left was, at its least and most, over what was foretold, at the very start of runs
UNFORESEEN = {"fitted": (0.8, 3.0), "remembered": (0.65, 1.8)}


class Course(NamedTuple):
    """How a past run went, in equal parts of the time from 0 to its end: means in each part.

    dt: over the first stable dt; work: wall time of a step over that of the first parts.
    """

    dt: tuple[float, ...]
    work: tuple[float, ...]


class Forecast(NamedTuple):
    """Wall time left [s], likely and within a range, and the steps that are likely left."""

    seconds: float
    low: float
    high: float
    steps: float


class TimeLeft:
    """Marks of a run, and what they foretell; course: of a past run of this deck, if any."""

    def __init__(self, t_end: float, course: Course | None = None):
        self.t_end, self.course = t_end, course
        self.marks: list[tuple[float, float, float]] = []  # step, t, wall time
        self._next = 0.0

    def note(self, step: int, t: float, wall: float) -> None:
        """Take note of a step that ended at time `t` [s] and wall time `wall` [s]."""
        if step >= self._next:
            self._next = step * GROWTH + 1.0
            self.marks.append((step, t, wall))

    def foretell(self, step: int, t: float, wall: float) -> Forecast | None:
        """What is left after the step that has just ended; None where nothing is known yet."""
        if not math.isfinite(self.t_end) or len(self.marks) < 3 or not t > self.marks[0][1]:
            return None
        if step - self.marks[0][0] < FIRST_STEPS:
            return None
        if t >= self.t_end:
            return Forecast(0.0, 0.0, 0.0, 0.0)
        fresh = [(step, t, wall)] * (step > self.marks[-1][0])
        steps, times, walls = np.array([*self.marks, *fresh], dtype=float).T
        counts, seconds = np.diff(steps), drop_events(np.diff(steps), np.diff(walls))
        half = int(np.searchsorted(steps, 0.5 * (steps[0] + steps[-1])))
        part = slice(max(min(half, len(steps) - 4), 0), None)
        middles = 0.5 * (times[1:] + times[:-1])[part] - t
        rates = np.log(counts[part] / np.diff(times)[part])  # steps a second of the flow
        level, slope = fit_line(middles, rates, counts[part])
        a_step = seconds[part].sum() / counts[part].sum()
        ahead, memory = np.linspace(0.0, self.t_end - t, POINTS), t - times[part][0]
        gone = memory * (1.0 - np.exp(-ahead / memory))

        def follow(slope: float) -> float:
            return _integrate(ahead, level + np.clip(slope * gone, -STEEPEST, STEEPEST))

        kind, left = "fitted", follow(slope)
        found = [left * a_step, follow(0.0) * a_step]
        if self.course is not None:
            kind, share = "remembered", step / (step + self._remember(times, counts.sum(), False))
            remembered = self._remember(times, seconds.sum(), True)
            left = left**share * self._remember(times, counts.sum(), False) ** (1.0 - share)
            found = [found[0] ** share * remembered ** (1.0 - share), remembered]
        unknown = math.sqrt(1.0 - t / self.t_end)
        limits = [found[0] * limit**unknown for limit in UNFORESEEN[kind]]
        ends = found[0], min(*limits, *found), max(*limits, *found), left
        return Forecast(*(float(end) for end in ends))

    def _remember(self, times: np.ndarray, cost: float, work: bool) -> float:
        """What is left of a cost (of steps, or of their work), as in a past run, of which the
        stretch of `times` took `cost`."""
        assert self.course is not None
        past = np.log(self.course.work if work else np.ones(PARTS)) - np.log(self.course.dt)
        parts = (np.arange(len(past)) + 0.5) / len(past)
        done, left = (
            _integrate(x := np.linspace(*ends, POINTS), np.interp(x / self.t_end, parts, past))
            for ends in ((times[0], times[-1]), (times[-1], self.t_end))
        )
        return cost * left / done


def _integrate(x: np.ndarray, logs: np.ndarray) -> float:
    """The integral over x (n,) of what has the logarithms (n,)."""
    return float(np.trapezoid(np.exp(logs), x))


def fit_line(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Value at x = 0 and slope of the line through points (n,), less the slope's standard error.

    The value is that of the last quarter of the weight: so a bend does not throw it off.
    """
    total = weights.sum()
    middle, mean = (weights @ x) / total, (weights @ y) / total
    spread = float(weights @ (x - middle) ** 2)
    if len(x) < 3 or spread <= 0.0:
        return float(y[-1]), 0.0
    slope = float(weights @ ((x - middle) * (y - mean))) / spread
    rest = y - mean - slope * (x - middle)
    # neighbours are not independent: their number is taken as few
    error = math.sqrt(float(weights @ rest**2) / spread / max(min(len(x), 8) - 2, 1))
    late = weights * (weights.cumsum() >= 0.75 * total)
    level = float((late @ (y - slope * x)) / late.sum())
    return level, math.copysign(max(abs(slope) - error, 0.0), slope)


def drop_events(counts: np.ndarray, walls: np.ndarray) -> np.ndarray:
    """Wall times [s] of stretches (n,) of `counts` steps, those of far slower steps made usual:
    kernels that compile when they are first needed, another program on the machine."""
    each = walls / counts
    usual = float(np.median(each))
    return np.where(each <= UNUSUAL * usual, walls, usual * counts)


def make_course(
    steps: np.ndarray, times: np.ndarray, seconds: np.ndarray, first_dt: float
) -> Course:
    """The course of a whole run: steps, times [s] and wall times [s] of all rows (n,).

    first_dt: its first stable dt [s].  A part's work is the median of its steps; parts that no step
    ended in have that of their neighbours.
    """
    edges = np.linspace(0.0, times[-1], PARTS + 1)
    counts = np.diff(np.interp(edges, times, steps))
    part = np.clip(np.searchsorted(edges, times[1:]) - 1, 0, PARTS - 1)
    known = np.unique(part)
    medians = [np.median(seconds[1:][part == one]) for one in known]
    work = np.maximum(np.interp(np.arange(PARTS), known, medians), 1e-9)
    dt = edges[1] / np.maximum(counts, 1e-9) / first_dt
    return Course(tuple(dt.tolist()), tuple((work / np.median(work[:4])).tolist()))


class PastRun(msgspec.Struct, frozen=True):
    """One run: its flow and how it went.

    finest: the least width [m] of a block over its cells; first_dt: the first stable step [s]; dt,
    work: see `Course`; seconds: wall time [s] of a step here, 0 where it is of another machine;
    kernels: what the wall time of a step depends on beside the cells.
    """

    flow: str
    problem: str
    cells: int
    t_end: float
    finest: float
    first_dt: float
    steps: int
    dt: tuple[float, ...]
    work: tuple[float, ...]
    seconds: float = 0.0
    kernels: str = ""

    @property
    def course(self) -> Course:
        return Course(self.dt, self.work)

    def is_off(self, cells: int) -> float:
        """How far the number of cells is from another, as the size of a logarithm."""
        return abs(math.log(self.cells / max(cells, 1)))


def name_flow(problem: str, deck: Any) -> str:
    """The problem and those keys of its deck that make it another flow than by default."""
    try:
        usual = msgspec.to_builtins(type(deck)())
    except (BadInput, TypeError):
        usual = {}

    def list_changes(given: Mapping[str, Any], usual: Mapping[str, Any], head: str) -> list[str]:
        changes = []
        for key in sorted(given):
            value, other = given[key], usual.get(key)
            if not head and key in OTHER:
                continue
            if isinstance(value, dict) and isinstance(other, dict):
                changes += list_changes(value, other, f"{head}{key}.")
            elif value != other:
                changes.append(f"{head}{key}={value}")
        return changes

    return "; ".join([problem, *list_changes(msgspec.to_builtins(deck), usual, "")])


def name_kernels(evolution: Any) -> str:
    """What the wall time of a step depends on, beside the cells: materials, geometry, regridder."""
    flow = getattr(evolution, "flow", None)
    if flow is None:
        return type(evolution).__name__
    kinds = sorted({type(block.eos).__name__ for block in flow.blocks})
    makers = {type(maker).__name__ for maker in getattr(flow.motion, "regridders", []) if maker}
    geometry = "axisymmetric" if evolution.geometry.curved else "plane"
    return ", ".join([*kinds, *sorted(makers), geometry])


def find_home() -> Path:
    """Where this machine's past runs are kept: beside the compiled kernels."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(os.environ.get("SHOCKGRID_CACHE_DIR") or os.path.join(home, "shockgrid"))


@functools.cache
def read_delivered() -> tuple[PastRun, ...]:
    """The runs that come with shockgrid."""
    return tuple(msgspec.json.decode(DELIVERED.read_bytes(), type=list[PastRun]))


def read_own() -> list[PastRun]:
    """The runs that finished on this machine, the newest last; [] where none can be read."""
    try:
        text = (find_home() / DELIVERED.name).read_bytes()
        return msgspec.json.decode(text, type=list[PastRun])
    except (OSError, msgspec.MsgspecError):
        return []


def keep_run(run: PastRun) -> None:
    """Keep a run of this machine in place of one of the same flow with the same cells."""
    others = [one for one in read_own() if (one.flow, one.cells) != (run.flow, run.cells)]
    with contextlib.suppress(OSError, BadInput):
        home = find_home()
        home.mkdir(parents=True, exist_ok=True)
        text = msgspec.json.encode([*others, run][-KEPT:])
        write_atomically(home / DELIVERED.name, text, durable=False)


def find_past(flow: str, cells: int, own: bool = True) -> PastRun | None:
    """The past run of a flow whose cells are nearest in number; `own`: this machine's first."""
    for runs in (read_own() if own else [], read_delivered()):
        if same := [run for run in runs if run.flow == flow]:
            return min(same, key=lambda run: run.is_off(cells))
    return None


def find_like(problem: str, cells: int, own: bool = True) -> PastRun | None:
    """A past run of the same problem with another deck: the one of its defaults, if it is there."""
    runs = [*(read_own() if own else []), *read_delivered()]
    like = [run for run in runs if run.problem == problem]
    like = [run for run in like if run.flow == problem] or like
    return min(like, key=lambda run: run.is_off(cells), default=None)


def find_seconds(kernels: str, problem: str, cells: int) -> tuple[float, float] | None:
    """Wall time [s] of a step of so many cells on this machine, and a factor up and down to where
    it may be; None where it is not known.

    From runs of the same kernels, or else of the same problem: a power of the number of cells
    through the nearest one and another of twice or half as many.
    """
    runs = [run for run in read_own() if run.seconds > 0.0]
    runs = [run for run in runs if run.kernels == kernels] or [
        run for run in runs if run.problem == problem
    ]
    if not runs:
        return None
    first, *others = sorted(runs, key=lambda run: run.is_off(cells))
    power = 0.8
    for other in others:
        if (apart := math.log(other.cells / first.cells)) and abs(apart) > math.log(2.0):
            power = min(max(math.log(other.seconds / first.seconds) / apart, 0.2), 1.1)
            break
    seconds = first.seconds * (max(cells, 1) / first.cells) ** power
    return seconds, SURE * math.exp(UNSURE * first.is_off(cells))


def make_past_run(
    flow: str, problem: str, cells: int, t_end: float, finest: float, first_dt: float,
    history: Mapping[str, np.ndarray], kernels: str = "",
) -> PastRun | None:  # fmt: skip
    """A past run from the history of a whole run; None where it is too short to say anything."""
    steps, times = history["step"], history["t"]
    if len(steps) < LEAST_STEPS or "seconds_step" not in history or not first_dt > 0.0:
        return None
    seconds = np.nan_to_num(history["seconds_step"])
    course = make_course(steps, times, seconds, first_dt)
    dt, work = (tuple(round(v, 4) for v in course.dt), tuple(round(v, 3) for v in course.work))
    usual, end = float(np.median(seconds[2:])), int(steps[-1])
    return PastRun(
        flow, problem, cells, float(t_end), finest, first_dt, end, dt, work, usual, kernels
    )


@dataclass(frozen=True)
class Size:
    """Cells of all blocks, which are named with their cells both ways, and their least width [m].

    t_end: the end [s]; memory, dump: bytes.
    """

    cells: int
    blocks: tuple[tuple[str, tuple[int, ...]], ...]
    finest: float
    t_end: float
    memory: float
    dump: float


@dataclass(frozen=True)
class Cost:
    """A size with steps and seconds as (low, likely, high), None where unknown, and disk [bytes].

    free: bytes of the disk that are free, nan where unknown; grows: may grid lines be
    added on the way, so that memory, dumps and steps are those of the beginning?
    """

    size: Size
    steps: tuple[float, float, float] | None
    seconds: tuple[float, float, float] | None
    dumps: float
    disk: float
    free: float
    grows: bool = False


def measure_size(problem: Problem, evolution: Any = None, blocks: Sequence[Any] = ()) -> Size:
    """The size of a run from its problem's plan, or from its built blocks where it has none.

    evolution: as built; blocks: of a dump.  With neither, a problem without a plan is built.
    """
    plan = problem.plan() if evolution is None and not blocks else None
    if plan is not None:
        t_end, planned = plan
    else:
        evolution = evolution or (None if blocks else problem.build())
        t_end = evolution.t_end if evolution is not None else math.nan
        planned = [_plan_block(block) for block in blocks or evolution.blocks]
    sizes = [math.prod(block.cells) for block in planned]
    widths = [
        (high - low) / number
        for block in planned
        for low, high, number in zip(block.low, block.high, block.cells, strict=True)
    ]
    finest = float(min((width for width in widths if width > 0.0), default=0.0))
    named = tuple((block.name, tuple(block.cells)) for block in planned)
    dump = float(DUMP_BYTES * sum(sizes) + BLOCK_BYTES * len(planned))
    return Size(sum(sizes), named, finest, float(t_end), estimate_memory(sum(sizes), sizes), dump)


def _plan_block(block: Any) -> BlockPlan:
    flat = block.nodes.reshape(len(block.nodes), -1)
    cells = tuple(size - 1 for size in block.nodes.shape[1:])
    return BlockPlan(block.name, cells, tuple(flat.min(axis=1)), tuple(flat.max(axis=1)))


def foretell_steps(
    read: ReadDeck, size: Size, first_dt: float | None, own: bool = True
) -> tuple[float, float, float] | None:
    """Steps of a run: the least, the likely, the most; None where nothing is known.

    first_dt: the first stable step [s], None where nothing is built; own: from runs of this machine
    too.
    """
    if not math.isfinite(size.t_end) or size.t_end <= 0.0:
        return None
    flow, kind = name_flow(read.problem, read.deck), "same"
    past = find_past(flow, size.cells, own)
    other_flow = past is None  # its speeds are others: without a first step it tells nothing
    if past is None:
        past, kind = find_like(read.problem, size.cells, own), "like"
    if past is None and first_dt is not None:
        steps, kind = size.t_end / first_dt, "nothing"
    elif past is None:
        return None
    elif first_dt is not None:
        steps = size.t_end / first_dt * float(np.mean(1.0 / np.asarray(past.dt)))
    elif not other_flow and size.finest > 0.0 and past.finest > 0.0:
        steps = past.steps * (size.t_end / past.t_end) * (past.finest / size.finest)
    else:
        return None
    if past is not None and not 0.95 < size.t_end / past.t_end < 1.05:
        kind = "like"
    low, high = RANGES[kind]
    bound = read.deck.run.max_steps
    limit = math.inf if bound is None else float(bound)
    return min(low * steps, limit), min(steps, limit), min(high * steps, limit)


def count_dumps(output: Output, t_end: float) -> float:
    """How many dumps a run of `t_end` [s] will leave, its first and last counted."""
    if not math.isfinite(t_end):
        return 2.0 + len(output.times)
    if output.every is not None:
        return 2 + t_end // output.every + len(output.times)
    return output.dumps + 1 + len(output.times) + (output.dumps == 0)


def estimate_cost(
    read: ReadDeck, problem: Problem, evolution: Any = None, folder: Path | None = None
) -> Cost:
    """The cost of a run of a checked deck into a folder; `evolution`: as built, where it is."""
    with read.numbers_in_reach():
        size = measure_size(problem, evolution)
    clock = getattr(evolution, "clock", None)
    steps = foretell_steps(read, size, None if clock is None else clock.first_stable_dt)
    kernels = "" if evolution is None else name_kernels(evolution)
    a_step, seconds = find_seconds(kernels, read.problem, size.cells), None
    if steps and a_step:
        low, likely, high = (a_step[0] * number for number in steps)
        seconds = low / a_step[1], likely, high * a_step[1]
    dumps = count_dumps(read.deck.output, size.t_end)
    restarts = KEPT_RESTARTS + 1 if read.deck.output.restart_every else 0
    disk = (dumps + restarts) * size.dump + ROW_BYTES * (steps[1] if steps else 0.0)
    grows = bool(getattr(read.deck, "refine", False))
    return Cost(size, steps, seconds, dumps, disk, find_free(folder), grows)


def find_free(folder: Path | None) -> float:
    """Free bytes of the disk that a folder, which may not be there yet, would lie on; or nan."""
    place = (folder or Path("out")).absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    try:
        usage = shutil.disk_usage(place)
    except OSError:
        return math.nan
    return float(usage.free) if usage.total else math.nan  # nothing in all: such as /proc


def check_disk(cost: Cost, folder: Path | None = None) -> list[str]:
    """A caution where the disk will likely not hold the run.

    Raises BadInput where it does not hold two dumps, which a run cannot do without.
    """
    where = f"the disk of {folder or Path('out')}"
    if cost.free < 2.0 * cost.size.dump:
        raise BadInput(
            f"{where} has {describe_bytes(cost.free)} free, and a run needs two dumps of "
            f"{describe_bytes(cost.size.dump)} at the least; free some, choose another folder with "
            "-o or take fewer cells"
        )
    if not cost.disk > TIGHT * cost.free:
        return []
    return [
        f"caution: the run will need about {describe_bytes(cost.disk)} of disk, where "
        f"{describe_bytes(cost.free)} are free ({where}): free some, or take fewer dumps "
        "(output.dumps) or lighter ones (output.fields, output.precision, output.compression)"
    ]


def foretell(read: ReadDeck, output: str | None = None) -> list[str]:
    """Lines on the cost of a run of a checked deck into `output`, of which nothing is built."""
    folder = Path(output) if output else None
    cost = estimate_cost(read, read.make_problem(), None, folder)
    try:
        cautions = check_disk(cost, folder)
    except BadInput as error:
        cautions = [f"caution: {error}"]
    return [*describe_cost(cost), *cautions]


def describe_cost(cost: Cost) -> list[str]:
    """Lines for `run --dry-run` and for the first lines of a run."""
    size, steps = (
        cost.size,
        "steps and time are unknown before the start: no earlier run of this flow",
    )
    if cost.steps is not None:
        low, likely, high = (_round(number) for number in cost.steps)
        steps = f"about {likely}{f' ({low} to {high})' * (low < high)} steps"
        if cost.seconds is None:
            steps += "; the time of a step on this computer is not known yet"
        else:
            steps += (
                f"; time stepping will take {describe_seconds_range(*cost.seconds)} on this machine"
            )
    told = [f"{name} {' x '.join(map(str, cells))}" for name, cells in size.blocks[:MOST_NAMED]]
    more = len(size.blocks) - len(told)
    cells = f"{size.cells} cells ({', '.join(told)}{f' and {more} more blocks' if more else ''})"
    if cost.grows:
        cells += " initially, more where the interface needs them later (refine)"
    free = "" if math.isnan(cost.free) else f", {describe_bytes(cost.free)} free"
    return [
        f"cost: {cells}; {steps}",
        f"cost: memory about {describe_bytes(size.memory)}; disk about "
        f"{describe_bytes(cost.disk)} ({count(round(cost.dumps), 'dump')} of "
        f"{describe_bytes(size.dump)}{free})",
    ]


def _round(number: float) -> int:
    """To two digits."""
    scale = 10 ** max(math.floor(math.log10(max(number, 1.0))) - 1, 0)
    return max(round(number / scale) * scale, 1)


def describe_seconds_range(low: float, likely: float, high: float) -> str:
    """Wall times [s] in one unit: `6 to 9 min`; one number where they are the same in words."""
    units = ((86400.0, "days"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))
    size, unit = next((pair for pair in units if likely >= 1.5 * pair[0]), units[-1])
    first, last = (
        f"{one / size:.2g}" if one < 100 * size else f"{one / size:.0f}" for one in (low, high)
    )
    return f"{first} {unit}" if first == last else f"{first} to {last} {unit}"


def describe_bytes(number: float) -> str:
    """A number of bytes in the unit a person would choose."""
    for size, unit in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB")):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{number / 1e3:.3g} kB"
