"""What a run costs: memory and disk before it starts, the time left, and that its steps become
short.  docs/performance.md says how.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.problems.memory import estimate_memory
from shockgrid.problems.problem import Problem, plan_blocks
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.reading import ReadDeck
from shockgrid.runs.early_end.causes import SHORT_STEPS, describe_settings
from shockgrid.runs.inspection.account import OWN_REASONS
from shockgrid.runs.quantities import count, describe_bytes
from shockgrid.runs.store.directory import KEPT_RESTARTS

DUMP_BYTES = 64  # a cell in a dump: nodes, five fields and a rate
BLOCK_BYTES = 30_000  # of a block in a dump, for the form of the file; measured
ROW_BYTES = 600  # of a step in history.csv; measured
TIGHT_DISK_PART = 0.9  # part of the free disk that a run may be foretold to fill without a word

FIRST_STEPS = 12  # until there is a word: the first five are shortened on purpose
MARK_GROWTH = 1.03  # of the steps from mark to mark: a few hundred marks for any run
STEEPEST_LOG_CHANGE = 4.0  # change of a logarithm, at most, that is foretold from a fit alone
UNUSUAL_STEP_FACTOR = 4.0  # times the usual wall time of a step: no speed, but an event
# what was left over what was foretold, at its least and most, at the very start of runs
LEAST_LEFT_FACTOR = 0.8
MOST_LEFT_FACTOR = 3.0

FALLEN_STEP_FACTOR = 100.0  # times below its largest value: dt is worth a word


@dataclass(frozen=True)
class Size:
    """Cells of all blocks, which are named with their cells both ways, the end [s], and bytes of
    memory and of a dump."""

    cells: int
    blocks: tuple[tuple[str, tuple[int, ...]], ...]
    t_end: float
    memory: float
    dump: float


def drop_events(seconds: np.ndarray) -> np.ndarray:
    """Wall times [s] of steps (n,), those of far slower ones made usual: kernels that compile when
    they are first needed, another program on the machine."""
    usual = float(np.median(seconds))
    return np.where(seconds <= UNUSUAL_STEP_FACTOR * usual, seconds, usual)


def measure_size(problem: Problem, evolution: Any = None) -> Size:
    """The size of a run from its evolution as built, else from its problem's plan; where it has
    none, it is built."""
    plan = problem.plan() if evolution is None else None
    if plan is None:
        evolution = evolution or problem.build()
        plan = evolution.t_end, plan_blocks({b.name: b.nodes for b in evolution.blocks})
    t_end, planned = plan
    sizes = [math.prod(block.cells) for block in planned]
    named = tuple((block.name, tuple(block.cells)) for block in planned)
    dump = float(DUMP_BYTES * sum(sizes) + BLOCK_BYTES * len(planned))
    memory = estimate_memory(sum(sizes), sizes) + problem.estimate_solver_memory(sum(sizes))
    return Size(sum(sizes), named, float(t_end), memory, dump)


def foretell(
    read: ReadDeck, problem: Problem, evolution: Any = None, output: str | None = None
) -> tuple[list[str], list[str]]:
    """Lines on the cost of a run of a checked deck into the folder `output`, and cautions on the
    disk.

    evolution: as built, where it is.  Raises BadInput where it is, and the disk does not hold two
    dumps, which a run cannot do without.
    """
    with read.numbers_in_reach():
        size = measure_size(problem, evolution)
    wanted = read.deck.output
    cells = f"{size.cells} cells in {count(len(size.blocks), 'block')}"
    if getattr(read.deck, "refine", False):
        cells += " initially, more where the interface needs them later (refine)"
    between = max(wanted.dumps - 1, 0)  # besides the first and the last
    if wanted.every is not None:
        between = size.t_end // wanted.every if math.isfinite(size.t_end) else 0
    dumps = 2 + between + len(wanted.times)
    restarts = KEPT_RESTARTS + 1 if wanted.restart_every else 0
    disk = (dumps + restarts) * size.dump
    folder = Path(output or "out")
    free = find_free(folder)
    a_dump, needed, there = map(describe_bytes, (size.dump, disk, free))
    shortage = (
        f"the run will need about {needed} of disk, two dumps of {a_dump} at least, where {there} "
        f"are free (the disk of {folder}): free some, choose another folder with -o, or take fewer "
        "dumps (output.dumps) or lighter ones (output.fields, output.precision, output.compression)"
    )
    if free < 2.0 * size.dump and evolution is not None:
        raise BadInput(shortage)
    return [
        f"cost: {cells}; the time left is said from the third second of a run on",
        f"cost: memory about {describe_bytes(size.memory)}; disk about {needed} and "
        f"{ROW_BYTES} B per step ({count(round(dumps), 'dump')} of {a_dump}"
        f"{f', {there} free' * math.isfinite(free)})",
    ], [f"caution: {shortage}"] * (disk > TIGHT_DISK_PART * free)


def find_free(folder: Path) -> float:
    """Free bytes of the disk that a folder, which may not be there yet, would lie on; or nan."""
    folder = folder.absolute()
    try:
        usage = shutil.disk_usage(next(p for p in (folder, *folder.parents) if p.exists()))
    except OSError:
        return math.nan
    return float(usage.free) if usage.total else math.nan  # nothing in all: such as /proc


class TimeLeft:
    """Marks of a run, and the wall time that they foretell."""

    def __init__(self, t_end: float):
        self.t_end = t_end
        self.marks: list[tuple[float, float, float]] = []  # step, t, wall time
        self._next = 0.0

    def note(self, step: int, t: float, wall: float) -> None:
        """Take note of a step that ended at time `t` [s] and wall time `wall` [s]."""
        if step >= self._next:
            self._next = step * MARK_GROWTH + 1.0
            self.marks.append((step, t, wall))

    def foretell(self, step: int, t: float, wall: float) -> tuple[float, float, float] | None:
        """Wall time left [s] after the step that has just ended: the least, the likely, the most;
        None where nothing is known yet."""
        if not self.marks or step - self.marks[0][0] < FIRST_STEPS:
            return None
        fresh = [(step, t, wall)] * (step > self.marks[-1][0])
        steps, times, walls = np.array([*self.marks, *fresh], dtype=float).T
        if not (math.isfinite(self.t_end) and t > times[0]):
            return None
        # dt may collapse
        counts = np.diff(steps)
        flow = np.maximum(np.diff(times), 1e-300)
        each = drop_events(np.diff(walls) / counts)
        half = slice(max(int(np.searchsorted(steps, steps.mean())) - 1, 0), None)
        a_step = np.average(each[half], weights=counts[half])
        # the trend of steps a second of the flow, believed in for about as long as it was seen
        middles = 0.5 * (times[1:] + times[:-1])[half] - t
        memory = t - times[half][0]
        rates = np.log(counts / flow)[half]
        weights = np.sqrt(counts[half])
        slope, level = np.polyfit(middles, rates, 1, w=weights)
        ahead = np.linspace(0.0, max(self.t_end - t, 0.0), 200)
        trend = np.clip(
            slope * memory * (1.0 - np.exp(-ahead / memory)),
            -STEEPEST_LOG_CHANGE,
            STEEPEST_LOG_CHANGE,
        )
        left = float(np.trapezoid(np.exp(level + trend), ahead)) * a_step
        unknown = math.sqrt(max(1.0 - t / self.t_end, 0.0))
        return left * LEAST_LEFT_FACTOR**unknown, left, left * MOST_LEFT_FACTOR**unknown


class ShortSteps:
    """Says once where dt has fallen FALLEN_STEP_FACTOR times below its largest value; say: takes
    the line.

    Steps that are short on purpose do not count: the first five, the last two, those repeated with
    a smaller dt.
    """

    def __init__(self, evolution: Any, say: Callable[[str], None]):
        self.evolution = evolution
        self.say = say
        self.largest = 0.0
        self.told = False

    def follow(self, row: Mapping[str, Any]) -> None:
        """Take note of a step's history row."""
        dt = row.get("dt")
        limit = row.get("dt_limit")
        if self.told or dt is None or limit in OWN_REASONS or not dt > 0.0:
            return
        self.largest = max(self.largest, dt)
        if self.largest < FALLEN_STEP_FACTOR * dt:
            return
        self.told = True
        where = ""
        if limit not in SHORT_STEPS and math.isfinite(row.get("fastest_i", math.nan)):
            block = self.evolution.blocks[int(row["fastest_block"])].name
            where = f"; fastest cell: {block}, i={row['fastest_i']}, j={row['fastest_j']}"
        step = self.evolution.step
        t = self.evolution.t
        self.say(
            f"dt is {self.largest / dt:.3g} times below its largest: {dt:.3g} s at step {step}, "
            f"t = {t:.6g} s, limited by {limit or 'step'}{where}; what can be changed: "
            f"{describe_settings(str(limit))}"
        )
