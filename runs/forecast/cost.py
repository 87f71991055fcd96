"""What a run will cost: before it starts, and how long it still takes while it marches.

Steps come from those of a past run of the same flow, scaled with the first stable dt, or where
nothing is built yet with the width of the finest cells.  The wall time of a step comes from runs
that finished on this machine; where there was none, it is said to be unknown.

A past run is known by its flow: its problem and those keys of its deck that differ from the
problem's defaults, without cells, `run`, `output` and gauges.  past_runs.json beside this file is
delivered and knows steps alone; runs that finish here are kept in the cache directory, with the
wall time of their steps.  A cache that cannot be read or written is none.

While a run marches, what is left is found in two ways: from the trend of the steps a second of the
flow takes, believed in for about as long as it has been seen; and from the share of its steps and
of its wall time that a past run of the same flow had taken by the same part of the end time.
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
from problems.problem import Problem, estimate_memory, plan_blocks
from regrid.errors import BadInput
from runs.deck.checking import find_changes
from runs.deck.reading import ReadDeck
from runs.inspection.account import count
from runs.store.directory import KEPT_RESTARTS
from runs.store.files import write_atomically

DUMP_BYTES = 64  # a cell in a dump: nodes, five fields and a rate
BLOCK_BYTES = 30_000  # of a block in a dump, for the form of the file; measured
ROW_BYTES = 600  # of a step in history.csv; measured
# steps over those foretold, at the least and most: from a run of this flow to this time, or else
SAME, LIKE = (0.75, 1.5), (0.5, 5.0)
MOST_NAMED = 6  # blocks in a line
TIGHT = 0.9  # part of the free disk that a run may be foretold to fill without a word

DELIVERED = Path(__file__).with_name("past_runs.json")
KEPT = 300  # runs of this machine
SURE = 1.4  # a step's wall time may be so many times what it was in runs before, or less
UNSURE = 0.25  # power of the ratio of cells by which that grows
WORK = 0.8  # power of the number of cells with which a step's wall time grows
LEAST_STEPS = 40  # of a run that says something about others
OTHER = ("run", "output", "gauge", "cells")  # keys of a deck that leave the flow as it is

FIRST_STEPS = 12  # until there is a word: the first five are shortened on purpose
GROWTH = 1.03  # of the steps from mark to mark: a few hundred marks for any run
STEEPEST = 4.0  # change of a logarithm, at most, that is foretold from a fit alone
UNUSUAL = 4.0  # times the usual wall time of a step: no speed, but an event
POINTS = 200  # of the integral
PARTS = 20  # of the time of a past run
# what was left over what was foretold, at its least and most, at the very start of runs
FITTED, REMEMBERED = (0.8, 3.0), (0.65, 1.8)


class Course(NamedTuple):
    """Shares of a past run's steps and wall time that were over at PARTS + 1 equal parts of t_end:
    where it ended before, the last ones are 1."""

    steps: tuple[float, ...]
    walls: tuple[float, ...]


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
        if not (self.marks and math.isfinite(self.t_end) and t > self.marks[0][1]):
            return None
        if step - self.marks[0][0] < FIRST_STEPS:
            return None
        fresh = [(step, t, wall)] * (step > self.marks[-1][0])
        steps, times, walls = np.array([*self.marks, *fresh], dtype=float).T
        counts, seconds = np.diff(steps), drop_events(np.diff(steps), np.diff(walls))
        half = slice(max(int(np.searchsorted(steps, steps.mean())) - 1, 0), None)
        end, parts = self.t_end, np.linspace(0.0, 1.0, PARTS + 1)
        if self.course is not None:  # a run may end before its end time
            end *= parts[np.searchsorted(self.course.steps, 1.0)]
        ahead, memory = np.linspace(0.0, max(end - t, 0.0), POINTS), t - times[half][0]
        middles, flow = 0.5 * (times[1:] + times[:-1])[half] - t, np.diff(times)[half]
        level, slope = fit_line(middles, np.log(counts[half] / flow), counts[half])
        gone = memory * (1.0 - np.exp(-ahead / memory))

        def follow(slope: float) -> float:
            logs = level + np.clip(slope * gone, -STEEPEST, STEEPEST)
            return float(np.trapezoid(np.exp(logs), ahead))

        left, limits = follow(slope), FITTED
        a_step = seconds[half].sum() / counts[half].sum()
        found = [left * a_step, follow(0.0) * a_step]
        if self.course is not None:
            ends = times[0] / self.t_end, t / self.t_end
            known = [
                cost * (1.0 - now) / max(now - first, 1e-9)
                for cost, shares in zip((counts.sum(), seconds.sum()), self.course, strict=True)
                for first, now in [np.interp(ends, parts, shares)]
            ]
            share, limits = step / (step + known[0]), REMEMBERED
            left = left**share * known[0] ** (1.0 - share)
            found = [found[0] ** share * known[1] ** (1.0 - share), known[1]]
        unknown = math.sqrt(max(1.0 - t / self.t_end, 0.0))
        ends = [*(found[0] * limit**unknown for limit in limits), *found]
        return Forecast(float(found[0]), float(min(ends)), float(max(ends)), float(left))


def fit_line(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Value at x = 0 and slope of the line through points (n,), less the slope's standard error.

    The value is that of the last quarter of the weight: so a bend does not throw it off.
    """
    if len(x) < 4:
        return float(y[-1]), 0.0
    (slope, _), errors = np.polyfit(x, y, 1, w=np.sqrt(weights), cov=True)
    slope = math.copysign(max(abs(slope) - math.sqrt(errors[0, 0]), 0.0), slope)
    late = weights * (weights.cumsum() >= 0.75 * weights.sum())
    return float(np.average(y - slope * x, weights=late)), float(slope)


def drop_events(counts: np.ndarray, walls: np.ndarray) -> np.ndarray:
    """Wall times [s] of stretches (n,) of `counts` steps, those of far slower steps made usual:
    kernels that compile when they are first needed, another program on the machine."""
    each = walls / counts
    usual = float(np.median(each))
    return np.where(each <= UNUSUAL * usual, walls, usual * counts)


class PastRun(msgspec.Struct, frozen=True):
    """One run: its flow and how it went.

    finest: the least width [m] of a block over its cells; first_dt: the first stable step [s];
    seconds: wall time [s] of a step here, 0 where it is of another machine; kernels: what the wall
    time of a step depends on beside the cells.
    """

    flow: str
    cells: int
    t_end: float
    finest: float
    first_dt: float
    steps: int
    course: Course
    seconds: float = 0.0
    kernels: str = ""

    @property
    def problem(self) -> str:
        return self.flow.partition("; ")[0]

    def is_off(self, cells: int) -> float:
        """How far the number of cells is from another, as the size of a logarithm."""
        return abs(math.log(self.cells / max(cells, 1)))


def name_flow(problem: str, deck: Any) -> str:
    """The problem and those keys of its deck that make it another flow than by default."""
    try:
        usual = msgspec.to_builtins(type(deck)())
    except (BadInput, TypeError):
        usual = {}
    changes = [one for one in find_changes(usual, msgspec.to_builtins(deck))
               if one.key.partition(".")[0] not in OTHER]  # fmt: skip
    return "; ".join([problem, *sorted(f"{one.key}={one.now}" for one in changes)])


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
def read_delivered() -> list[PastRun]:
    """The runs that come with shockgrid."""
    return msgspec.json.decode(DELIVERED.read_bytes(), type=list[PastRun])


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
    """The past run of a flow whose cells are nearest in number, of this machine (`own`) first; if
    there is none, one of the same problem: with the deck of its defaults, if it is there."""
    mine, problem = (read_own() if own else []), flow.partition("; ")[0]
    for runs, name in (
        (mine, flow),
        (read_delivered(), flow),
        ([*mine, *read_delivered()], problem),
    ):
        if same := [run for run in runs if run.flow == name]:
            return min(same, key=lambda run: run.is_off(cells))
    like = [run for run in [*mine, *read_delivered()] if run.problem == problem]
    return min(like, key=lambda run: run.is_off(cells), default=None)


def find_seconds(kernels: str, problem: str, cells: int) -> tuple[float, float] | None:
    """Wall time [s] of a step of so many cells on this machine, and a factor up and down to where
    it may be, from runs of the same kernels, or else of the same problem; None without any."""
    runs = [run for run in read_own() if run.seconds > 0.0]
    alike = [run for run in runs if run.kernels == kernels]
    alike = alike or [run for run in runs if run.problem == problem]
    if not alike:
        return None
    nearest = min(alike, key=lambda run: run.is_off(cells))
    seconds = nearest.seconds * (max(cells, 1) / nearest.cells) ** WORK
    return seconds, SURE * math.exp(UNSURE * nearest.is_off(cells))


def make_past_run(
    flow: str, cells: int, t_end: float, finest: float, first_dt: float,
    history: Mapping[str, np.ndarray], kernels: str = "",
) -> PastRun | None:  # fmt: skip
    """A past run from the history of a whole run; None where it is too short to say anything."""
    steps, times = history["step"], history["t"]
    if len(steps) < LEAST_STEPS or "seconds_step" not in history or not first_dt > 0.0:
        return None
    seconds = drop_events(np.ones(len(steps)), np.nan_to_num(history["seconds_step"]))
    parts = np.linspace(0.0, float(t_end), PARTS + 1)
    shares = [
        tuple((np.interp(parts, times, done) / max(done[-1], 1e-300)).round(4).tolist())
        for done in (steps, seconds.cumsum())
    ]
    usual = float(np.median(seconds[2:]))
    return PastRun(
        flow, cells, float(t_end), finest, first_dt, int(steps[-1]), Course(*shares), usual, kernels
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
        built = blocks or evolution.blocks
        planned = plan_blocks({block.name: block.nodes for block in built})
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


def foretell_steps(
    read: ReadDeck, size: Size, first_dt: float | None, own: bool = True
) -> tuple[float, float, float] | None:
    """Steps of a run: the least, the likely, the most; None where nothing is known.

    first_dt: the first stable step [s], None where nothing is built; own: from runs of this machine
    too.
    """
    if not math.isfinite(size.t_end) or size.t_end <= 0.0:
        return None
    flow, limits = name_flow(read.problem, read.deck), LIKE
    past = find_past(flow, size.cells, own)
    if first_dt is not None:
        steps = size.t_end / first_dt
        if past is not None:
            steps *= past.steps * past.first_dt / past.t_end
    elif past is not None and past.flow == flow and size.finest > 0.0:
        steps = past.steps * (size.t_end / past.t_end) * (past.finest / size.finest)
    else:  # the speeds of another flow are others: without a first step it tells nothing
        return None
    if past is not None and past.flow == flow and 0.95 < size.t_end / past.t_end < 1.05:
        limits = SAME
    bound = read.deck.run.max_steps
    most = math.inf if bound is None else float(bound)
    low, likely, high = (min(factor * steps, most) for factor in (limits[0], 1.0, limits[1]))
    return low, likely, high


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
    size, steps = cost.size, "steps and time are unknown before the start: no run of this flow yet"
    if cost.steps is not None:
        low, likely, high = (max(round(float(f"{number:.2g}")), 1) for number in cost.steps)
        steps = f"about {likely}{f' ({low} to {high})' * (low < high)} steps; "
        if cost.seconds is None:
            steps += "the time of a step on this computer is not known yet"
        else:
            steps += (
                f"time stepping will take {describe_seconds_range(*cost.seconds)} on this machine"
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
