"""Wall time of the phases of a step."""

from __future__ import annotations

import time
from contextlib import contextmanager


class Stopwatch:
    """Adds up wall seconds by phase: `with watch("flow"): ...`."""

    def __init__(self):
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, phase: str):
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[phase] = self.seconds.get(phase, 0.0) + time.perf_counter() - start

    def take(self, phases: tuple[str, ...]) -> dict[str, float]:
        """Seconds of the phases since the last call, as history columns."""
        taken = {f"seconds_{phase}": self.seconds.get(phase, 0.0) for phase in phases}
        self.seconds.clear()
        return taken
