"""Calls of kernels and of all else in a step of a small run, and their processor time."""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path

from result_tables import Tables

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from oracles.calls import STEPS_DECK, count_calls, make_step

COUNTED_STEPS = 50  # of each round, with the profiler and without


def measure_steps(tables: Tables, rounds: int) -> None:
    """Table `steps`: medians of a step of STEPS_DECK, with two blocks."""
    step = make_step(())
    counted = []
    whole = []
    for _ in range(rounds):
        counted += [count_calls(step) for _ in range(COUNTED_STEPS)]
        for _ in range(COUNTED_STEPS):
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
