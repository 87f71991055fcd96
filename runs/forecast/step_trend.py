"""How dt shrinks through a run: by how much, by which cell, where that lies, and what may help.

dt is compared with its largest value so far.  Each time that it has shrunk by another factor of
FACTOR a mark is made: a line of run.log, and an entry of the verdict.  Once, when it has shrunk
by so many factors, MOST, the user reads what can be changed.

Steps that are short for other reasons do not count: the first five, the last two, those repeated
with a smaller dt (`retries` has them).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from runs.early_end.causes import SHORT_STEPS, describe_settings
from runs.inspection.account import OWN_REASONS, measure_shrinkage

FACTOR = math.sqrt(10.0)
MOST = 4  # such factors: a hundredfold
NEAR = 2  # cells: so near to a key node or a side is at it
SAMPLED = 50_000  # cells of a block from which medians are taken
SAME = 1e-6  # relative: so near to the step's rate is the rate of the cell that set it
OF_LINES = ("stretching", "tension", "touch")  # what limits dt and is no cell


def classify(block: Any, i: int, j: int) -> str:
    """Which of SHORT_STEPS holds for a thin cell, by the segments that it lies beside."""
    ni, nj = block.nodes.shape[1] - 1, block.nodes.shape[2] - 1
    away = {"i_min": i, "i_max": ni - 1 - i, "j_min": j, "j_max": nj - 1 - j}
    along = {"i_min": j, "i_max": j, "j_min": i, "j_max": i}
    kinds = set()
    for one in block.segments:
        k = along[one.side]
        if away[one.side] >= NEAR or not one.start <= k < one.stop:
            continue
        at_end = min(k - one.start, one.stop - 1 - k) < NEAR
        if one.follows_flow and at_end and one.stop - one.start > 2 * NEAR:
            return "corner"
        kinds.add("line" if one.follows_flow and one.kind != "sliding" else one.kind)
    return next((kind for kind in ("sliding", "line", "axis", "wall") if kind in kinds), "inside")


class Mark(NamedTuple):
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
        words, _ = SHORT_STEPS.get(self.meaning, (self.meaning, ()))
        cell = f", {self.block} i={self.i}, j={self.j} at ({self.x:.4g}, {self.y:.4g}) m"
        return (
            f"dt is {self.shrunk:.3g} times below its largest: {self.dt:.3g} s at step "
            f"{self.step}, t = {self.t:.6g} s{cell if self.block else ''}; {words}"
        )


class StepTrend:
    """Follows dt; note: takes a line for run.log, say: one for the screen, both seldom."""

    def __init__(self, evolution: Any, note: Callable[[str], None], say: Callable[[str], None]):
        self.evolution, self.note, self.say = evolution, note, say
        self.largest, self.level = 0.0, 0  # level: times FACTOR below the largest
        self.marks: list[Mark] = []
        flow = getattr(evolution, "flow", None)
        self._usual = [] if flow is None else [_find_usual(block) for block in flow.blocks]

    def resume(self, history: Mapping[str, np.ndarray]) -> None:
        """Continue where a restarted run was, from its history."""
        if math.isfinite(shrunk := measure_shrinkage(history)):
            counts = ~np.isin(history["dt_limit"], OWN_REASONS)
            self.largest = float(np.nanmax(history["dt"][counts]))
            self.level = count_factors(shrunk)

    def follow(self, row: Mapping[str, Any]) -> None:
        """Take note of a step's history row."""
        dt = row.get("dt")
        if dt is None or row.get("dt_limit") in OWN_REASONS or not dt > 0.0:
            return
        self.largest = max(self.largest, dt)
        before, level = self.level, count_factors(self.largest / dt)
        if level <= before:
            return
        self.level, mark = level, self._make_mark(row)
        self.marks.append(mark)
        self.note(mark.describe())
        if level >= MOST > before:
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
        return Mark(*head, block.name, i, j, float(x), float(y), self._find_meaning(number, i, j))

    def _find_meaning(self, number: int, i: int, j: int) -> str:
        """Is the cell fast, or thin; if thin, where it lies."""
        block = self.evolution.flow.blocks[number]
        usual_speed, usual = self._usual[number]
        if usual_speed > 0.0:
            median = float(np.median(_sample(block)[0]))
            thinness = float(measure_thinness(block.nodes[:, i : i + 2, j : j + 2])[0, 0])
            faster = float(block.rates[i, j]) / thinness / usual_speed
            all_thinner, alone = median / usual, thinness / median
            if faster > max(all_thinner * alone, 1.0):
                return "hot"
            if all_thinner > max(alone, 2.0):
                return "crushed"
        return classify(block, i, j)

    def describe(self) -> list[dict[str, Any]]:
        """The marks as plain data."""
        return [mark._asdict() for mark in self.marks]


def count_factors(ratio: float) -> int:
    """How many times a ratio holds FACTOR."""
    return math.floor(math.log(ratio) / math.log(FACTOR) + 1e-9)


def _find_usual(block: Any) -> tuple[float, float]:
    """The usual speed [m/s] of waves (a cell's rate over its thinness) and thinness [1/m]."""
    thinness, rates = _sample(block)
    return float(np.median(rates / thinness)), float(np.median(thinness))


def _sample(block: Any) -> tuple[np.ndarray, np.ndarray]:
    """Thinness [1/m] and rates [1/s] of a block's cells, (n, nj): of every so many rows of cells
    where there are more than SAMPLED."""
    apart = max(1, block.rates.size // SAMPLED)
    rows = [measure_thinness(block.nodes[:, i : i + 2]) for i in range(0, len(block.rates), apart)]
    return np.concatenate(rows), block.rates[::apart]


def measure_thinness(nodes: np.ndarray) -> np.ndarray:
    """Both middle lengths of each cell over its area [1/m], (ni, nj), of nodes (2, ni+1, nj+1).

    Of a rectangle it is the sum of the inverse widths, as in the rate at which waves cross it.
    """
    along_i = np.diff(0.5 * (nodes[:, :, 1:] + nodes[:, :, :-1]), axis=1)
    along_j = np.diff(0.5 * (nodes[:, 1:, :] + nodes[:, :-1, :]), axis=2)
    area = np.abs(along_i[0] * along_j[1] - along_i[1] * along_j[0])
    return (np.hypot(*along_i) + np.hypot(*along_j)) / np.maximum(area, 1e-300)


def find_limiting_cell(flow: Any) -> tuple[int, int, int]:
    """Block, i and j of the cell that sets the next step.

    Cells that share their states are faster than that: it is the one whose rate is the clock's, or
    the nearest below.
    """
    most = flow.clock.rate * (1.0 + SAME)
    rates = [np.where(block.rates <= most, block.rates, -1.0) for block in flow.blocks]
    number = int(np.argmax([one.max() for one in rates]))
    i, j = np.unravel_index(rates[number].argmax(), rates[number].shape)
    return number, int(i), int(j)
