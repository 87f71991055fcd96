"""Past runs that foretell the cost of others: those that are delivered, and this machine's own.

A past run is known by its flow: its problem and those keys of its deck that differ from the
problem's defaults, without cells, `run`, `output` and gauges.  The table past_runs.json beside this
file is delivered and knows steps alone, which are the same on any machine; runs that finish here
are kept in the cache directory, with the wall time of their steps.

The traps: what is kept is a convenience.  A cache that cannot be read or written is none, and
nothing of a run depends on it but words.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from regrid.errors import BadInput
from runs.forecast.time_left import Course, make_course
from runs.store.files import write_atomically

DELIVERED = Path(__file__).with_name("past_runs.json")
KEPT = 300  # runs of this machine
SURE = 1.4  # a step's wall time may be so many times what it was in runs before, or less
UNSURE = 0.25  # power of the ratio of cells by which that grows
LEAST_STEPS = 40  # of a run that says something about others
OTHER = ("run", "output", "gauge", "cells")  # keys of a deck that leave the flow as it is


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


def name_flow(problem: str, deck: Any) -> str:
    """The problem and those keys of its deck that make it another flow than by default."""
    try:
        usual = msgspec.to_builtins(type(deck)())
    except (BadInput, TypeError):
        usual = {}
    given = msgspec.to_builtins(deck)
    return "; ".join([problem, *_list_changes(given, usual, "")])


def _list_changes(given: Mapping[str, Any], usual: Mapping[str, Any], head: str) -> list[str]:
    changes = []
    for key in sorted(given):
        if not head and key in OTHER:
            continue
        value, other = given[key], usual.get(key)
        if isinstance(value, dict) and isinstance(other, dict):
            changes += _list_changes(value, other, f"{head}{key}.")
        elif value != other:
            changes.append(f"{head}{key}={value}")
    return changes


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
        same = [run for run in runs if run.flow == flow]
        if same:
            return min(same, key=lambda run: abs(math.log(run.cells / max(cells, 1))))
    return None


def find_like(problem: str, cells: int, own: bool = True) -> PastRun | None:
    """A past run of the same problem with another deck: the one of its defaults, if it is there."""
    runs = [*(read_own() if own else []), *read_delivered()]
    like = [run for run in runs if run.problem == problem]
    like = [run for run in like if run.flow == problem] or like
    return min(like, key=lambda run: abs(math.log(run.cells / max(cells, 1))), default=None)


def find_seconds(kernels: str, problem: str, cells: int) -> tuple[float, float] | None:
    """Wall time [s] of a step of so many cells on this machine; None where it is not known.

    With it a factor up and down to where it may be: the wider, the further the cells are from those
    of runs before.

    From runs of the same kernels, or else of the same problem: a power of the number of cells
    through the nearest ones below and above.
    """
    runs = [run for run in read_own() if run.seconds > 0.0]
    for chosen in (
        [run for run in runs if run.kernels == kernels],
        [run for run in runs if run.problem == problem],
    ):
        if chosen:
            known = [(run.cells, run.seconds) for run in chosen]
            far = min(abs(math.log(number / max(cells, 1))) for number, _ in known)
            return _interpolate(known, cells), SURE * math.exp(UNSURE * far)
    return None


def _interpolate(known: Sequence[tuple[int, float]], cells: int) -> float:
    """A step's seconds at `cells` from pairs of cells and seconds."""
    by_cells: dict[int, list[float]] = {}
    for number, seconds in known:
        by_cells.setdefault(number, []).append(math.log(seconds))
    x = np.log(sorted(by_cells))
    y = np.array([np.mean(by_cells[number]) for number in sorted(by_cells)])
    wanted = math.log(max(cells, 1))
    nearest = int(np.abs(x - wanted).argmin())
    far = np.abs(x - x[nearest])
    power = 0.8
    if far.max() > math.log(2.0):
        other = int(np.where(far > math.log(2.0), np.abs(x - wanted), np.inf).argmin())
        power = float(np.clip((y[other] - y[nearest]) / (x[other] - x[nearest]), 0.2, 1.1))
    return math.exp(y[nearest] + power * (wanted - x[nearest]))


def measure_finest(blocks: Sequence[Any]) -> float:
    """The least width [m] of planned blocks over their cells, in either direction."""
    widths = [
        (high - low) / count
        for block in blocks
        for low, high, count in zip(block.low, block.high, block.cells, strict=True)
    ]
    return float(min((width for width in widths if width > 0.0), default=0.0))


def make_past_run(
    flow: str,
    problem: str,
    cells: int,
    t_end: float,
    finest: float,
    first_dt: float,
    history: Mapping[str, np.ndarray],
    kernels: str = "",
) -> PastRun | None:
    """A past run from the history of a whole run; None where it is too short to say anything."""
    steps, times = history["step"], history["t"]
    if len(steps) < LEAST_STEPS or "seconds_step" not in history or not first_dt > 0.0:
        return None
    seconds = np.nan_to_num(history["seconds_step"])
    course = make_course(steps, times, seconds, first_dt)
    usual = float(np.median(seconds[2:]))
    return PastRun(
        flow, problem, cells, float(t_end), finest, first_dt, int(steps[-1]),
        tuple(round(value, 4) for value in course.dt),
        tuple(round(value, 3) for value in course.work), usual, kernels,
    )  # fmt: skip
