"""How long a run still takes, from how its steps have gone so far.

What is left of a cost (wall time, or steps) is the integral of what a second of the flow costs,

    left = integral of cost rate (t') dt' from now to t_end,    log rate(t') = log rate + trend,

where the trend comes from two sides:

- *fitted*: the slope of the log of the rate over the latter half of the steps, less its own
  uncertainty, and believed in for about as long as it has been seen: it dies out over the time that
  the fit covers;
- *remembered*: the course that the rate took in a past run of the same deck, at the level of this
  one.

The two are weighed by the part of the steps that the run has made: what is remembered counts most
at the start, what is seen counts more with every step.  Their distance, and what runs have taught
about the unforeseen, is the range that is said.

The trap: wall time has jumps that are no trend (kernels that compile when they are first needed, a
dump, another program on the machine).  Stretches of far slower steps count as usual ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

LEAST_STEPS = 12  # until there is a word: the first five are shortened on purpose
GROWTH = 1.03  # of the steps from mark to mark: a few hundred marks for any run
WINDOW = 0.5  # part of the steps so far that the trend is fitted to
MEMORY = 1.0  # times the time that the fit covers: how long its trend is believed in
STEEPEST = 4.0  # change of a logarithm, at most, that is foretold from a fit alone
UNUSUAL = 4.0  # times the usual wall time of a step: no speed, but an event
POINTS = 200  # of the integral
PARTS = 20  # of the time of a past run
# what the cost left was, at its least and most, over what was foretold, at the very start of runs
UNFORESEEN = {"fitted": (0.8, 3.0), "remembered": (0.65, 1.8)}


@dataclass(frozen=True)
class Course:
    """How a past run went, in equal parts of the time from 0 to its end: means in each part.

    dt: over the first stable dt; work: wall time of a step over that of the first parts.
    """

    dt: tuple[float, ...]
    work: tuple[float, ...]


@dataclass(frozen=True)
class Forecast:
    """Wall time left [s], likely and within a range, and the steps that are likely left."""

    seconds: float
    low: float
    high: float
    steps: float


class TimeLeft:
    """Marks of a run, and what they foretell.

    course: of a past run of this deck; None where there is none.
    """

    def __init__(self, t_end: float, course: Course | None = None):
        self.t_end = t_end
        self.course = course
        self._t: list[float] = []
        self._step: list[int] = []
        self._wall: list[float] = []
        self._next = 0.0

    def note(self, step: int, t: float, wall: float) -> None:
        """Take note of a step that ended at time `t` [s] and wall time `wall` [s]."""
        if step < self._next:
            return
        self._next = step * GROWTH + 1.0
        self._t.append(t)
        self._step.append(step)
        self._wall.append(wall)

    def count_marks(self) -> int:
        """How many marks are kept."""
        return len(self._t)

    def foretell(self, step: int, t: float, wall: float) -> Forecast | None:
        """What is left after the step that has just ended; None where nothing is known yet."""
        if not math.isfinite(self.t_end) or len(self._t) < 3 or not t > self._t[0]:
            return None
        if step - self._step[0] < LEAST_STEPS:
            return None
        if t >= self.t_end:
            return Forecast(0.0, 0.0, 0.0, 0.0)
        fresh = step > self._step[-1]
        steps, times, walls = (
            np.array([*marks, now] if fresh else marks, dtype=float)
            for marks, now in ((self._step, step), (self._t, t), (self._wall, wall))
        )
        since = steps[-1] - WINDOW * (steps[-1] - steps[0])
        first = max(min(int(np.searchsorted(steps, since)), len(steps) - 4), 0)
        all_times, all_counts = times, np.diff(steps)
        all_seconds = drop_events(all_counts, np.diff(walls))
        times, counts, seconds = times[first:], all_counts[first:], all_seconds[first:]
        unknown = math.sqrt(1.0 - times[-1] / self.t_end)
        ahead = np.linspace(0.0, self.t_end - times[-1], POINTS)
        middles, lengths = 0.5 * (times[1:] + times[:-1]) - times[-1], np.diff(times)
        dt = fit_line(middles, np.log(lengths / counts), counts)
        work = fit_line(middles, np.log(seconds / counts), counts)
        memory = MEMORY * (times[-1] - times[0])
        believed = memory * (1.0 - np.exp(-ahead / memory))

        def follow(slope: float) -> float:
            gone = np.clip(slope * believed, -STEEPEST, STEEPEST)
            return integrate(ahead, gone - dt.level)

        sure = shrink(work.slope, 2.0 * work.error)
        slopes = (sure - shrink(dt.slope, dt.error), sure - dt.slope, 0.0)
        a_step = seconds.sum() / counts.sum()
        found = [a_step * follow(slope) for slope in slopes]
        steps_left, kind = follow(-shrink(dt.slope, dt.error)), "fitted"
        if self.course is not None:
            kind = "remembered"
            past_dt = -np.log(self.course.dt)
            past = past_dt + np.log(self.course.work)
            # at the level of the whole run so far: dips of dt come earlier or later than there
            remembered = self._remember(all_times, all_seconds.sum(), past)
            steps_left = self._remember(all_times, all_counts.sum(), past_dt)
            share = step / (step + steps_left)
            likely = found[0] ** share * remembered ** (1.0 - share)
            found = [likely, remembered]
        limits = [found[0] * limit**unknown for limit in UNFORESEEN[kind]]
        ends = found[0], min(*limits, *found), max(*limits, *found), steps_left
        return Forecast(*(float(end) for end in ends))

    def _remember(self, times: np.ndarray, cost: float, past: np.ndarray) -> float:
        """What is left of a cost, as in a past run, of which the stretch of `times` took `cost`.

        times (n,) [s]; past (parts,): log of the cost rate over equal parts of the past run's time.
        """
        parts = (np.arange(len(past)) + 0.5) / len(past)
        inside = np.linspace(times[0], times[-1], POINTS)
        ahead = np.linspace(times[-1], self.t_end, POINTS)
        there = integrate(inside, np.interp(inside / self.t_end, parts, past))
        return cost * integrate(ahead, np.interp(ahead / self.t_end, parts, past)) / there


def integrate(x: np.ndarray, logs: np.ndarray) -> float:
    """The integral over x (n,) of what has the logarithms (n,)."""
    return float(np.trapezoid(np.exp(logs), x))


class Trend(NamedTuple):
    """A line through points: its value at x = 0, its slope and the slope's standard error."""

    level: float
    slope: float
    error: float


def shrink(value: float, by: float) -> float:
    """The value brought nearer to zero, at most to it."""
    return math.copysign(max(abs(value) - by, 0.0), value)


def fit_line(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> Trend:
    """The line through points (n,) of which the last is at x < 0, near 0.

    Its level is corrected by what the last quarter of the weight lies over it: so a bend does not
    throw it off.
    """
    total = weights.sum()
    middle, mean = (weights @ x) / total, (weights @ y) / total
    spread = float(weights @ (x - middle) ** 2)
    if len(x) < 3 or spread <= 0.0:
        return Trend(float(y[-1]), 0.0, 0.0)
    slope = float(weights @ ((x - middle) * (y - mean))) / spread
    rest = y - mean - slope * (x - middle)
    # neighbours are not independent: their number is taken as few
    error = math.sqrt(float(weights @ rest**2) / spread / max(min(len(x), 8) - 2, 1))
    late = weights * (weights.cumsum() >= 0.75 * total)
    return Trend(float((late @ (y - slope * x)) / late.sum()), slope, error)


def drop_events(counts: np.ndarray, walls: np.ndarray) -> np.ndarray:
    """Wall times [s] of stretches (n,) of `counts` steps, those of far slower steps made usual."""
    each = walls / counts
    usual = float(np.median(each))
    return np.where(each <= UNUSUAL * usual, walls, usual * counts)


def make_course(
    steps: np.ndarray, times: np.ndarray, seconds: np.ndarray, first_dt: float
) -> Course:
    """The course of a whole run: steps, times [s] and wall times [s] of all rows (n,).

    first_dt: its first stable dt [s].  A part's work is the median of its steps: of what else went
    on on the machine nothing is kept.  Parts that no step ended in have that of their neighbours.
    """
    edges = np.linspace(0.0, times[-1], PARTS + 1)
    counts = np.diff(np.interp(edges, times, steps))
    part = np.clip(np.searchsorted(edges, times[1:]) - 1, 0, PARTS - 1)
    known = np.unique(part)
    medians = [np.median(seconds[1:][part == one]) for one in known]
    work = np.maximum(np.interp(np.arange(PARTS), known, medians), 1e-9)
    dt = edges[1] / np.maximum(counts, 1e-9) / first_dt
    return Course(tuple(dt.tolist()), tuple((work / np.median(work[:4])).tolist()))
