"""How dt shrinks through a run: by how much, by which cell, where that lies, and what may help.

dt is compared with its largest value so far.  Each time that it has shrunk by another factor of
FACTOR a mark is made: a line of run.log, and an entry of the verdict.  Once, when it has shrunk
by MOST, the user reads what can be changed.

Steps that are short for other reasons do not count: the first five, the last two, those repeated
with a smaller dt (`retries` has them).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from runs.early_end.causes import FEWER_CELLS, MORE_BARRIER, MORE_SHARING, SMALLER_CFL, Setting
from runs.inspection.account import OWN_REASONS

FACTOR = math.sqrt(10.0)
MOST = 100.0
NEAR = 2  # cells: so near to a key node or a side is at it
SAMPLED = 50_000  # cells of a block from which medians are taken
SAME = 1e-6  # relative: so near to the step's rate is the rate of the cell that set it
OF_LINES = ("stretching", "tension", "touch")  # what limits dt and is no cell

_BESIDE = (MORE_SHARING, FEWER_CELLS)  # for cells that a line itself made flat
_INSIDE = (MORE_SHARING, MORE_BARRIER, FEWER_CELLS)  # those that the inside of a grid made flat
MEANINGS: dict[str, tuple[str, tuple[Setting, ...]]] = {  # what dt is limited by: words, what helps
    "hot": ("fast waves: the material is hot or moves fast, the cell is no thinner than others",
            (FEWER_CELLS,)),
    "crushed": ("crushed: all cells of the block have become thin", (FEWER_CELLS,)),
    "stretching": ("stretching: nodes of a line part fast", (SMALLER_CFL, FEWER_CELLS)),
    "touch": ("touch: bodies come to touch, node by node", (FEWER_CELLS,)),
    "tension": ("tension: the shortest capillary waves of a line are fast", (FEWER_CELLS,)),
    "corner": ("corner: at a key node, where lines meet", _BESIDE),
    "sliding": ("sliding contact: in the first cells beside it", _BESIDE),
    "line": ("line: the first cells beside an interface or a surface are squeezed", _INSIDE),
    "axis": ("axis: in the first cells beside the axis", _BESIDE),
    "wall": ("wall: in the first cells beside a wall", _BESIDE),
    "inside": ("inside: cells away from all lines are squeezed", _INSIDE),
}  # fmt: skip


def describe_settings(meaning: str) -> str:
    """The settings for one of MEANINGS, in a line."""
    _, settings = MEANINGS.get(meaning, ("", (FEWER_CELLS,)))
    words = [f"{setting.described.replace('`', '')}: {setting.words}" for setting in settings]
    return "; ".join([*words, "run.t_end ends the run before"])


def classify(block: Any, i: int, j: int) -> str:
    """Which of MEANINGS holds for a thin cell: by the segments of its block that it lies beside."""
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
        words, _ = MEANINGS.get(self.meaning, (self.meaning, ()))
        cell = f", {self.block} i={self.i}, j={self.j} at ({self.x:.4g}, {self.y:.4g}) m"
        return (
            f"dt is {self.shrunk:.3g} times below its largest: {self.dt:.3g} s at step "
            f"{self.step}, t = {self.t:.6g} s{cell if self.block else ''}; {words}"
        )


class StepTrend:
    """Follows dt; note: takes a line for run.log, say: one for the screen, both seldom."""

    def __init__(self, evolution: Any, note: Callable[[str], None], say: Callable[[str], None]):
        self.evolution, self.note, self.say = evolution, note, say
        self.largest = 0.0
        self.marks: list[Mark] = []
        self._next = 0.0
        self._told = False
        flow = getattr(evolution, "flow", None)
        self._usual = [] if flow is None else [_find_usual(block) for block in flow.blocks]

    def resume(self, history: Mapping[str, np.ndarray]) -> None:
        """Continue where a restarted run was, from its history."""
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
        return [asdict(mark) for mark in self.marks]


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
    rate, found = flow.clock.rate * (1.0 + SAME), (-1.0, 0, 0)
    for number, block in enumerate(flow.blocks):
        rates = np.where(block.rates <= rate, block.rates, -1.0)
        place = int(rates.argmax())
        if rates.flat[place] > found[0]:
            found = float(rates.flat[place]), number, place
    i, j = np.unravel_index(found[2], flow.blocks[found[1]].rates.shape)
    return found[1], int(i), int(j)
