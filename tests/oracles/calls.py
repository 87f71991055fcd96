"""Calls of kernels and of all else in a step of a small run, and CPU time inside kernels.

A profiler sees every call of a kernel as one of the function that was compiled, or of its entry.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

from shockgrid.regrid.compilation.first_calls import KERNEL_CODES
from shockgrid.runs.deck.reading import read_deck

STEPS_DECK = "interface-instability"  # two blocks, a contact, walls and a piston
FIRST_STEPS = 20  # not counted: kernels are loaded, the first steps are short


class Calls:
    """Counts, while `sys.setprofile` holds it: calls of `kernels` and their seconds, `others`."""

    def __init__(self):
        self.codes = KERNEL_CODES
        self.kernels = self.others = 0
        self.seconds = self._begun = 0.0

    def __call__(self, frame, event: str, argument) -> None:
        called = argument if event.startswith("c_") else frame.f_code
        is_kernel = id(called) in self.codes
        if event in ("call", "c_call") and is_kernel:
            self.kernels += 1
            self._begun = time.process_time()
        elif event in ("return", "c_return") and is_kernel:
            self.seconds += time.process_time() - self._begun
        elif event in ("call", "c_call"):
            self.others += 1


def make_step(settings: tuple[str, ...]) -> Callable[[], None]:
    """A run of STEPS_DECK on one thread after its first steps; each call is a step."""
    problem = read_deck(STEPS_DECK, ("run.threads=1", *settings)).make_problem()
    evolution = problem.build()

    def step() -> None:
        evolution.advance()
        problem.measure(evolution)

    for _ in range(FIRST_STEPS):
        step()
    return step


def count_calls(step: Callable[[], None]) -> Calls:
    """The calls of one step."""
    calls = Calls()
    sys.setprofile(calls)
    try:
        step()
    finally:
        sys.setprofile(None)
    calls.others -= 1  # of `sys.setprofile` itself
    return calls
