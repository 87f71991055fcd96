"""A limit of wall time: a run ends in time for what has to be written at its end."""

from __future__ import annotations

import re
import time

from regrid.errors import BadInput

MARGIN = 2.0  # times the longest of the last steps and the longest write: time left for both
REMEMBERED = 50  # steps
FORM = re.compile(r"(?:(\d+(?:\.\d+)?)h)?(?:(\d+(?:\.\d+)?)m)?(?:(\d+(?:\.\d+)?)s?)?")
CLOCK = re.compile(r"(\d+):([0-5]\d):([0-5]\d)")


def parse_duration(text: str) -> float:
    """Seconds [s] of a duration: 2h, 90m, 1h30m, 1:30:00 or a number of seconds.

    Raises BadInput for anything else, and for no time at all.
    """
    word = text.strip()
    clock, form = CLOCK.fullmatch(word), FORM.fullmatch(word)
    parts = clock.groups() if clock else form.groups() if form else ()
    seconds = sum(
        float(part) * scale
        for part, scale in zip(parts, (3600.0, 60.0, 1.0), strict=False)
        if part is not None
    )
    if not 0.0 < seconds < float("inf"):
        raise BadInput(
            f"--max-wall {text!r} is no time; write 2h, 90m, 1h30m, 1:30:00 or seconds, above 0"
        )
    return seconds


class WallLimit:
    """Wall time that a run may take, counted from when this is made.

    The first step, for which kernels may be compiled, counts for the time that has gone and not for
    how long steps are.  At least one step is made, so that runs in a queue come to their end.
    """

    def __init__(self, text: str):
        self.text = text
        self.end = time.monotonic() + parse_duration(text)
        self._steps: list[float] = []
        self._write = 0.0
        self._made = 0

    def __str__(self) -> str:
        return f"--max-wall {self.text}"

    @property
    def reached(self) -> bool:
        """Would one more step, and the restart point after it, come too late?"""
        if not self._made:
            return False
        needed = MARGIN * (max(self._steps, default=0.0) + self._write)
        return time.monotonic() + needed >= self.end

    def note_step(self, seconds: float) -> None:
        """Remember how long a step has taken [s]."""
        self._made += 1
        if self._made > 1:
            self._steps = [*self._steps[1 - REMEMBERED :], seconds]

    def note_write(self, seconds: float) -> None:
        """Remember how long a restart point has taken [s]."""
        self._write = max(self._write, seconds)
