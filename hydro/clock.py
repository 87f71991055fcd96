"""The time of a flow, the limits on its next step, and the wall time of a step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shockgrid.regrid.compilation.first_calls import read_clock

START_FACTORS = (0.05, 0.1, 0.2, 0.4, 0.7)  # of the stable dt: the first steps of a run
STEP_RECOVERY = 1.3  # growth of the step after it was cut
MOST_STRETCHING = 0.25  # relative displacement of neighbouring line nodes over their distance


@dataclass
class Clock:
    """Time and step of a flow, and what limits the next step; all in seconds or per second.

    t_end: end of the run; rate: the largest of all cells but those that share their states, summed
    over both grid directions: its inverse is the time in which waves cross that cell; cfl: the part
    of this time that is the stable dt; first_stable_dt: that at the start; stretch_rate: relative
    stretching of lines per time in the last step; retry_dt: bound on the step after one was
    rejected, recovering; tension_dt: that of the shortest capillary waves.
    """

    t_end: float
    cfl: float
    rate: float
    t: float = 0.0
    step: int = 0
    dt: float = 0.0
    retry_dt: float = np.inf
    stretch_rate: float = 0.0
    tension_dt: float = np.inf
    first_stable_dt: float = field(init=False)

    def __post_init__(self):
        self.first_stable_dt = self.cfl / self.rate

    def choose_dt(self) -> tuple[float, str]:
        """The next step and what limits it.  Theory F7.1."""
        stable_dt = self.cfl / self.rate
        dt = stable_dt
        dt_limit = "sound"
        if self.stretch_rate * dt > MOST_STRETCHING:
            dt = MOST_STRETCHING / self.stretch_rate
            dt_limit = "stretching"
        if dt > self.tension_dt:
            dt = self.tension_dt
            dt_limit = "tension"
        # the first steps are parts of what is allowed, whatever limits that
        if self.step < len(START_FACTORS):
            dt = dt * START_FACTORS[self.step]
            dt_limit = "start"
        if dt > self.retry_dt:
            dt = self.retry_dt
            dt_limit = "retry"
        # two equal steps to the end rather than a long one and a tiny one
        time_left = self.t_end - self.t
        if dt >= time_left:
            dt = time_left
            dt_limit = "t_end"
        elif 2.0 * dt > time_left:
            dt = 0.5 * time_left
            dt_limit = "t_end"
        return dt, dt_limit

    def compute_fraction(self, dt: float) -> float:
        """dt over the stable dt."""
        return dt * self.rate / self.cfl

    def tick(self, dt: float, dt_limit: str, rate: float, stretching: float) -> bool:
        """Add an accepted step of length dt; returns whether it was the last."""
        self.retry_dt = STEP_RECOVERY * dt if dt_limit == "retry" else np.inf
        last = dt >= self.t_end - self.t
        self.t = self.t_end if last else self.t + dt
        self.dt = dt
        self.step += 1
        self.rate = rate
        self.stretch_rate = stretching / dt
        return last

    def get_state(self) -> dict[str, float | int]:
        """All that the next step depends on, under names that no block's arrays have."""
        return {
            "clock/t": self.t,
            "clock/step": self.step,
            "clock/dt": self.dt,
            "clock/retry_dt": self.retry_dt,
            "clock/rate": self.rate,
            "clock/stretch_rate": self.stretch_rate,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take up a state of `get_state`."""
        self.t = float(state["clock/t"])
        self.step = int(state["clock/step"])
        self.dt = float(state["clock/dt"])
        self.retry_dt = float(state["clock/retry_dt"])
        self.rate = float(state["clock/rate"])
        self.stretch_rate = float(state["clock/stretch_rate"])


class TimedPart:
    """A block of code whose wall seconds are added up, but for those of compiling kernels."""

    __slots__ = ("begun", "seconds")

    def __init__(self):
        self.seconds = 0.0
        self.begun = 0.0

    def __enter__(self):
        self.begun = read_clock()

    def __exit__(self, *failure):
        self.seconds += read_clock() - self.begun


class Stopwatch:
    """Adds up wall seconds of the parts of a step: `with stopwatch("flow"): ...`."""

    def __init__(self):
        self.parts: dict[str, TimedPart] = {}

    def __call__(self, part: str) -> TimedPart:
        """The part of that name, to be timed by `with`."""
        timed = self.parts.get(part)
        if timed is None:
            timed = self.parts[part] = TimedPart()
        return timed

    def take(self, parts: tuple[str, ...]) -> dict[str, float]:
        """Seconds of the parts since the last call, as history columns."""
        seconds = {f"seconds_{part}": self(part).seconds for part in parts}
        for timed in self.parts.values():
            timed.seconds = 0.0
        return seconds
