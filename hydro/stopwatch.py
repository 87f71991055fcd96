"""Wall time of the phases of a step."""

from __future__ import annotations

import time


class Phase:
    """A block of code whose wall seconds are added up."""

    __slots__ = ("begun", "seconds")

    def __init__(self):
        self.seconds, self.begun = 0.0, 0.0

    def __enter__(self):
        self.begun = time.perf_counter()

    def __exit__(self, *failure):
        self.seconds += time.perf_counter() - self.begun


class Stopwatch:
    """Adds up wall seconds by phase: `with watch("flow"): ...`."""

    def __init__(self):
        self.phases: dict[str, Phase] = {}

    def __call__(self, phase: str) -> Phase:
        """The phase of that name, to be timed by `with`."""
        found = self.phases.get(phase)
        if found is None:
            found = self.phases[phase] = Phase()
        return found

    def take(self, phases: tuple[str, ...]) -> dict[str, float]:
        """Seconds of the phases since the last call, as history columns."""
        taken = {f"seconds_{phase}": self(phase).seconds for phase in phases}
        for phase in self.phases.values():
            phase.seconds = 0.0
        return taken
