"""Calls of kernels and of all else in a step of a small run, CPU time inside and outside kernels.

A profiler sees every call of a kernel as one of the function that was compiled, or of its entry.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from result_tables import Tables

from shockgrid.regrid.compilation.first_calls import KERNEL_CODES
from shockgrid.runs.deck.reading import read_deck

STEPS_DECK = "interface-instability"  # two blocks, a contact, walls and a piston
FIRST_STEPS = 20  # not counted: kernels are loaded, the first steps are short
STEPS_STEPS = 50  # of each round, with the profiler and without


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


def measure_steps(tables: Tables, rounds: int) -> None:
    """Table `steps`: medians of a step of STEPS_DECK, with two blocks."""
    step = make_step(())
    counted = []
    whole = []
    for _ in range(rounds):
        counted += [count_calls(step) for _ in range(STEPS_STEPS)]
        for _ in range(STEPS_STEPS):
            start = time.process_time()
            step()
            whole.append(time.process_time() - start)
    kernels = statistics.median(calls.seconds for calls in counted)
    tables.add(
        "steps",
        case=f"{STEPS_DECK}, two blocks",
        **{
            "calls of kernels": statistics.median_high(calls.kernels for calls in counted),
            "other calls": statistics.median_high(calls.others for calls in counted),
            "kernels, us": 1e6 * kernels,
            "outside kernels, us": 1e6 * (statistics.median(whole) - kernels),
        },
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    found = Tables(parser)
    measure_steps(found, found.options.rounds)
    found.write()
