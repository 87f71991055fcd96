"""How dt shrinks through a run: by how much, by which cell, and what that cell means.

dt is compared with its largest value so far.  Each time that it has shrunk by another factor of
FACTOR a mark is made: a line of run.log, and an entry of the verdict.  Once, when it has shrunk
by MOST, the person is told what can be changed.

Steps that are short for other reasons do not count: the first five, the last two, those repeated
with a smaller dt (`retries` has them).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from runs.forecast.advice import describe_settings
from runs.forecast.meaning import WORDS, Stretch, classify
from runs.inspection.verdict import OWN_REASONS

FACTOR = math.sqrt(10.0)
MOST = 100.0
SAMPLED = 50_000  # cells of a block from which medians are taken
SLAB = 32  # rows of cells that are measured at a time
OF_LINES = ("stretching", "tension", "touch")  # what limits dt and is no cell
SAME = 1e-6  # relative: so near to the step's rate is the rate of the cell that set it


@dataclass(frozen=True)
class Mark:
    """dt [s] at a step and its part of the largest so far; the cell, its centre [m], its meaning.

    block is "" where dt is limited by no cell.
    """

    step: int
    t: float
    dt: float
    shrunk: float
    block: str
    i: int
    j: int
    x: float
    y: float
    meaning: str

    def describe(self) -> str:
        """One line for run.log and the screen."""
        words = WORDS.get(self.meaning, self.meaning)
        cell = f", {self.block} i={self.i}, j={self.j} at ({self.x:.4g}, {self.y:.4g}) m"
        return (
            f"dt is {self.shrunk:.3g} times below its largest: {self.dt:.3g} s at step "
            f"{self.step}, t = {self.t:.6g} s{cell if self.block else ''}; {words}"
        )


class StepTrend:
    """Follows dt.

    note: takes a line for run.log; say: takes a line for the screen.  Both are called seldom.
    """

    def __init__(self, evolution: Any, note: Callable[[str], None], say: Callable[[str], None]):
        self.evolution, self.note, self.say = evolution, note, say
        self.largest = 0.0
        self.marks: list[Mark] = []
        self._next = 0.0
        self._told = False
        self._usual = _find_usual(evolution)

    def resume(self, history: Mapping[str, np.ndarray]) -> None:
        """Take up where a run that goes on was, from its history."""
        dts, limits = history.get("dt"), history.get("dt_limit")
        if dts is None or limits is None or dts.dtype.kind != "f":
            return
        counts = dts[np.isfinite(dts) & ~np.isin(limits, OWN_REASONS)]
        if counts.size:
            self.largest = float(counts.max())
            shrunk = float((np.maximum.accumulate(counts) / counts).max())
            passed = math.floor(math.log(shrunk) / math.log(FACTOR) + 1e-9)
            self._next = self.largest / FACTOR ** (passed + 1)
            self._told = shrunk >= MOST

    def follow(self, row: Mapping[str, Any]) -> None:
        """Take note of a step's history row."""
        dt = row.get("dt")
        if dt is None or (dt > self._next and dt <= self.largest):
            return
        if row.get("dt_limit") in OWN_REASONS or not dt > 0.0:
            return
        if dt > self.largest:
            deepest = self.largest / self._next if self._next else FACTOR
            self.largest, self._next = dt, dt / deepest
            return
        mark = self._make_mark(row)
        self.marks.append(mark)
        while dt <= self._next:
            self._next /= FACTOR
        self.note(mark.describe())
        if mark.shrunk >= MOST and not self._told:
            self._told = True
            self.say(f"{mark.describe()}; what can be changed: {describe_settings(mark.meaning)}")

    def _make_mark(self, row: Mapping[str, Any]) -> Mark:
        evolution = self.evolution
        head = evolution.step, evolution.t, float(row["dt"]), self.largest / float(row["dt"])
        flow = getattr(evolution, "flow", None)
        if flow is None or row.get("dt_limit") in OF_LINES:
            limit = str(row.get("dt_limit") or "step")
            return Mark(*head, "", 0, 0, math.nan, math.nan, limit)
        number, i, j = find_limiting_cell(flow)
        block = flow.blocks[number]
        x, y = block.nodes[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
        meaning = self._find_meaning(number, i, j)
        return Mark(*head, block.name, i, j, float(x), float(y), meaning)

    def _find_meaning(self, number: int, i: int, j: int) -> str:
        """Is the cell fast, or thin; if thin, why."""
        block = self.evolution.flow.blocks[number]
        usual_speed, usual = self._usual[number]
        if usual_speed > 0.0:
            median = float(np.median(sample_cells(block)[0]))
            thinness = float(measure_thinness(block.nodes[:, i : i + 2, j : j + 2])[0, 0])
            faster = float(block.rates[i, j]) / thinness / usual_speed
            all_thinner, alone = median / usual, thinness / median
            if faster > max(all_thinner * alone, 1.0):
                return "hot"
            if all_thinner > max(alone, 2.0):
                return "crushed"
        return classify(block.nodes, i, j, list_stretches(block))

    def describe(self) -> list[dict[str, Any]]:
        """The marks as plain data."""
        return [asdict(mark) for mark in self.marks]


def _find_usual(evolution: Any) -> list[tuple[float, float]]:
    """`_find_usual_of` all blocks."""
    flow = getattr(evolution, "flow", None)
    return [] if flow is None else [_find_usual_of(block) for block in flow.blocks]


def _find_usual_of(block: Any) -> tuple[float, float]:
    """The usual speed [m/s] of waves (a cell's rate over its thinness) and thinness [1/m]."""
    thinness, rates = sample_cells(block)
    return float(np.median(rates / thinness)), float(np.median(thinness))


def sample_cells(block: Any) -> tuple[np.ndarray, np.ndarray]:
    """Thinness [1/m] and rates [1/s] of a block's cells, (n, nj): of every so many rows of cells
    where there are more than SAMPLED."""
    apart = max(1, block.rates.size // SAMPLED)
    if apart == 1:
        return measure_thinness(block.nodes), block.rates
    rows = [measure_thinness(block.nodes[:, i : i + 2]) for i in range(0, len(block.rates), apart)]
    return np.concatenate(rows), block.rates[::apart]


def measure_thinness(nodes: np.ndarray) -> np.ndarray:
    """Both middle lengths of each cell over its area [1/m], (ni, nj), of nodes (2, ni+1, nj+1).

    Of a rectangle it is the sum of the inverse widths, as in the rate at which waves cross it.
    """
    out = np.empty([size - 1 for size in nodes.shape[1:]])
    for first in range(0, len(out), SLAB):
        rows = nodes[:, first : first + SLAB + 1]
        middle_i = 0.5 * (rows[:, :, 1:] + rows[:, :, :-1])
        middle_j = 0.5 * (rows[:, 1:, :] + rows[:, :-1, :])
        along_i, along_j = np.diff(middle_i, axis=1), np.diff(middle_j, axis=2)
        area = np.abs(along_i[0] * along_j[1] - along_i[1] * along_j[0])
        out[first : first + SLAB] = (np.hypot(*along_i) + np.hypot(*along_j)) / np.maximum(
            area, 1e-300
        )
    return out


def find_limiting_cell(flow: Any) -> tuple[int, int, int]:
    """Block, i and j of the cell that sets the next step.

    Cells that share their states are faster than that: it is the one whose rate is the clock's, or
    the nearest below.
    """
    rate, found = flow.clock.rate * (1.0 + SAME), (-1.0, 0, 0)
    for number, block in enumerate(flow.blocks):
        rates = np.where(block.rates <= rate, block.rates, -1.0)
        place = int(rates.argmax())
        if rates.flat[place] > found[0]:
            found = float(rates.flat[place]), number, place
    i, j = np.unravel_index(found[2], flow.blocks[found[1]].rates.shape)
    return found[1], int(i), int(j)


def list_stretches(block: Any) -> list[Stretch]:
    """The parts of a block's sides."""
    return [
        Stretch(segment.side, segment.start, segment.stop, segment.kind, segment.follows_flow)
        for segment in block.segments
    ]
