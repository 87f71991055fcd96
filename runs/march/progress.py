"""How a run is getting on: a bar in a terminal, now and then a line elsewhere."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Mapping
from typing import Any

from problems.evolution import Evolution
from regrid.text_files import escape_controls
from runs.forecast.cost import describe_seconds_range
from runs.forecast.time_left import TimeLeft
from runs.inspection.account import count_cells
from runs.inspection.units import describe_time

PATIENCE = 3.0  # wall seconds before a person is told what takes so long
REMINDER = 60.0  # wall seconds until the person is told again
LINE_EVERY = 15.0  # wall seconds between lines when there is no terminal
FIRST_WORD = 3.0  # wall seconds after the first step until the whole run is foretold
WORTH_A_WORD = 30.0  # wall seconds of a run that is foretold in a line of its own
BAR = "{desc} {percentage:3.0f}%|{bar:12}| {elapsed}{postfix}"


@contextlib.contextmanager
def patience(quiet: bool, stream=None):
    """Say that kernels are being compiled, now and then, while they are in the block.

    Kernels that come from the disk, which takes a second or so, are not spoken of.
    """
    if quiet:
        yield
        return
    stream, done, began = stream or sys.stderr, threading.Event(), time.monotonic()
    with watch_compiler() as compiled:

        def say():
            words = "compiling kernels, once on this machine: a minute, several on a busy one ..."
            wait = PATIENCE
            while not done.wait(wait):
                if not compiled:
                    continue
                print(words, file=stream, flush=True)
                wait = REMINDER
                words = f"still compiling kernels ({time.monotonic() - began + REMINDER:.0f} s) ..."

        threading.Thread(target=say, daemon=True).start()
        try:
            yield
        finally:
            done.set()


@contextlib.contextmanager
def watch_compiler():
    """A list that is not empty once numba has begun to compile something in the block."""
    if "numba" not in sys.modules:
        yield []
        return
    from numba.core.event import install_recorder

    with install_recorder("numba:compile") as recorder:
        yield recorder.buffer


class Progress:
    """Shows time, steps, dt and its limiter, cell updates a second and the worst corner."""

    def __init__(self, evolution: Evolution, quiet: bool = False, stream=None, t_unit: str = "s"):
        self.t_unit = t_unit
        self.stream = stream or sys.stderr
        self.quiet = quiet
        self.cells = count_cells(evolution)
        self.bar = None
        self._t = evolution.t
        self.left = TimeLeft(evolution.t_end)
        self._left_said = (-1.0, "?")  # wall time, words
        self._foretold = False
        self._began = self._said = time.monotonic()
        self.steps = 0
        self._first_seconds = 0.0
        if not quiet and self.stream.isatty():
            from tqdm import tqdm

            self.bar = tqdm(
                total=evolution.t_end,
                initial=evolution.t,
                bar_format=BAR,
                file=self.stream,
                dynamic_ncols=True,
                mininterval=0.2,
            )

    def update(self, evolution: Evolution, row: Mapping[str, Any]) -> None:
        """Take note of a step."""
        self.steps += 1
        now = time.monotonic()
        if self.steps == 1:
            self._first_seconds = now - self._began  # loading or compiling kernels: not speed
        self.left.note(self.steps, evolution.t, now)
        if self.quiet:
            return
        if not self._foretold and now - self._began - self._first_seconds > FIRST_WORD:
            self._foretell(evolution, now)
        if self.bar is not None:
            self.bar.set_description_str(self.say_time(evolution.t), refresh=False)
            left = self.remaining(evolution, now)
            words = f"{left} left, {self.describe(evolution, row, now)}"
            self.bar.set_postfix_str(words, refresh=False)
            self.bar.update(min(evolution.t, evolution.t_end) - self._t)
            self._t = min(evolution.t, evolution.t_end)
        elif now - self._said >= LINE_EVERY:
            self._said = now
            share = evolution.t / evolution.t_end
            left = self.remaining(evolution, now)
            self.say(
                f"{self.say_time(evolution.t)} of {evolution.t_end:.4g} ({share:.0%}), "
                f"{left} left, {self.describe(evolution, row, now)}"
            )

    def say_time(self, t: float) -> str:
        return describe_time(t, self.t_unit, 4)

    def describe(self, evolution: Evolution, row: Mapping[str, Any], now: float) -> str:
        """Steps, dt, speed and corner quality in a few words."""
        words = [f"step {evolution.step}"]
        if "dt" in row:
            limit = f" ({row['dt_limit']})" if row.get("dt_limit") else ""
            words.append(f"dt {row['dt']:.2e} s{limit}")
        running = now - self._began - self._first_seconds
        if self.steps > 1 and running > 0:
            rate = (self.steps - 1) * self.cells / running
            words.append(f"{rate / 1e6:.2f} Mcells/s" if rate > 1e5 else f"{rate:.0f} cells/s")
        if "least_scaled_jacobian" in row:
            words.append(f"corner {row['least_scaled_jacobian']:.3f}")
        return ", ".join(words)

    def remaining(self, evolution: Evolution, now: float) -> str:
        """Wall time left in words, a range where it is uncertain; anew once a second."""
        since, words = self._left_said
        if now - since >= 1.0:
            found = self.left.foretell(self.steps, evolution.t, now)
            words = describe_seconds_range(found.low, found.seconds, found.high) if found else "?"
            self._left_said = now, words
        return words

    def _foretell(self, evolution: Evolution, now: float) -> None:
        """Say once, from the speed of the first steps, how long the run will take."""
        found = self.left.foretell(self.steps, evolution.t, now)
        if found is None:
            return
        self._foretold = True
        if found.seconds < WORTH_A_WORD:
            return
        ends = describe_seconds_range(found.low, found.seconds, found.high)
        a_step = (now - self._began - self._first_seconds) / max(self.steps - 1, 1)
        self.say(f"measured: {a_step * 1e3:.3g} ms a step; {ends} to the end")

    def say(self, text: str) -> None:
        """A line for the person, above the bar if there is one; nothing when quiet."""
        text = escape_controls(text)
        if self.quiet:
            return
        if self.bar is not None:
            self.bar.write(text, file=self.stream)
        else:
            print(text, file=self.stream, flush=True)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
            self.bar = None
