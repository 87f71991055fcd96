"""What a run will cost, said before it starts: cells, steps, wall time, memory and disk.

Steps come from the first stable dt, or where nothing is built yet from the width of the finest
cells, and from how dt went in a past run of the same flow or problem (`runs.forecast.past_runs`).
The wall time of a step comes from runs that finished on this machine; where there was none, it is
said to be unknown.  Each number has a range, as wide as what it comes from is uncertain.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from problems.deck import Output
from problems.problem import BlockPlan, Problem, estimate_memory
from regrid.errors import BadInput
from runs.deck.reading import ReadDeck
from runs.forecast.past_runs import (
    find_like,
    find_past,
    find_seconds,
    measure_finest,
    name_flow,
    name_kernels,
)
from runs.inspection.account import count
from runs.store.directory import KEPT_RESTARTS

DUMP_BYTES = 64  # a cell in a dump: nodes, five fields and a rate
BLOCK_BYTES = 30_000  # of a block in a dump, for the form of the file; measured
ROW_BYTES = 600  # of a step in history.csv; measured
# steps over those foretold, at the least and most, by what they are foretold from
RANGES = {"same": (0.75, 1.5), "like": (0.5, 5.0), "nothing": (0.5, 5.0)}
MOST_NAMED = 6  # blocks in a line
TIGHT = 0.9  # part of the free disk that a run may be foretold to fill without a word


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

    free: bytes of the disk that are free, nan where that cannot be told; grows: may grid lines be
    added on the way, so that memory, dumps and steps of a flow never run before are those of its
    beginning?
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
        if not blocks:
            evolution = evolution or problem.build()
            blocks = evolution.blocks
        t_end = evolution.t_end if evolution is not None else math.nan
        planned = [_plan_block(block) for block in blocks]
    cells = sum(math.prod(block.cells) for block in planned)
    dump = float(DUMP_BYTES * cells + BLOCK_BYTES * len(planned))
    finest = measure_finest(planned)
    named = tuple((block.name, tuple(block.cells)) for block in planned)
    memory = estimate_memory(cells, [math.prod(block.cells) for block in planned])
    return Size(cells, named, finest, float(t_end), memory, dump)


def _plan_block(block: Any) -> BlockPlan:
    nodes = block.nodes
    cells = tuple(size - 1 for size in nodes.shape[1:])
    flat = nodes.reshape(len(nodes), -1)
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
    if past is not None and not 0.95 < size.t_end / past.t_end < 1.05:
        kind = "like"
    if past is None:
        if first_dt is None:
            return None
        steps, kind = size.t_end / first_dt, "nothing"
    elif first_dt is not None:
        steps = size.t_end / first_dt * float(np.mean(1.0 / np.asarray(past.dt)))
    elif not other_flow and size.finest > 0.0 and past.finest > 0.0:
        steps = past.steps * (size.t_end / past.t_end) * (past.finest / size.finest)
    else:
        return None
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
    """Free bytes [bytes] of the disk that a folder, which may not be there yet, would lie on."""
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
    if cost.disk > TIGHT * cost.free:
        return [
            f"caution: the run will want about {describe_bytes(cost.disk)} of disk, where "
            f"{describe_bytes(cost.free)} are free ({where}): free some, or take fewer dumps "
            "(output.dumps) or lighter ones (output.fields, output.precision, output.compression)"
        ]
    return []


def foretell(read: ReadDeck, output: str | None = None) -> list[str]:
    """Lines on the cost of a run of a checked deck into `output`, of which nothing is built."""
    folder = Path(output) if output else None
    cost = estimate_cost(read, read.make_problem(), None, folder)
    try:
        cautions = check_disk(cost, folder)
    except BadInput as error:
        cautions = [f"caution: {error}"]
    return [*describe_cost(cost), *cautions]


def describe_blocks(size: Size) -> str:
    """Cells by block, all of them where they are few."""
    told = [f"{name} {' x '.join(map(str, cells))}" for name, cells in size.blocks[:MOST_NAMED]]
    more = len(size.blocks) - len(told)
    return f"{size.cells} cells ({', '.join(told)}{f' and {more} more blocks' if more else ''})"


def describe_cost(cost: Cost) -> list[str]:
    """Lines for `run --dry-run` and for the first lines of a run."""
    if cost.steps is None:
        steps = "steps and time are known when it begins: there was no run of this flow"
    else:
        steps = f"about {describe_range(cost.steps)} steps"
        if cost.seconds is None:
            steps += "; how long one takes on this machine is not known yet"
        else:
            steps += f", {describe_seconds_range(*cost.seconds)} of steps on this machine"
    free = "" if math.isnan(cost.free) else f", {describe_bytes(cost.free)} free"
    cells = describe_blocks(cost.size)
    if cost.grows:
        cells += " at first, more where the interface comes to need them (refine)"
    return [
        f"cost: {cells}; {steps}",
        f"cost: memory about {describe_bytes(cost.size.memory)}; disk about "
        f"{describe_bytes(cost.disk)} ({count(round(cost.dumps), 'dump')} of "
        f"{describe_bytes(cost.size.dump)}{free})",
    ]


def describe_range(numbers: tuple[float, float, float]) -> str:
    """`600 (450 to 900)`; a single number where there is no range."""
    low, likely, high = (_round(number) for number in numbers)
    return f"{likely}" if low == high else f"{likely} ({low} to {high})"


def _round(number: float) -> int:
    """To two digits."""
    if number < 10:
        return max(round(number), 1)
    scale = 10 ** (math.floor(math.log10(number)) - 1)
    return round(number / scale) * scale


def describe_seconds_range(low: float, likely: float, high: float) -> str:
    """Wall times [s] in one unit: `6 to 9 min`; one number where they are the same in words."""
    units = ((86400.0, "days"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))
    size, unit = next((pair for pair in units if likely >= 1.5 * pair[0]), units[-1])
    first, last = (f"{one / size:.2g}" if one < 100 * size else f"{one / size:.0f}"
                   for one in (low, high))  # fmt: skip
    return f"{first} {unit}" if first == last else f"{first} to {last} {unit}"


def describe_bytes(number: float) -> str:
    """A number of bytes in the unit a person would choose."""
    for size, unit in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB")):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{number / 1e3:.3g} kB"
