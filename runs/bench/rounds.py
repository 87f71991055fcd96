"""Timings that hold: several rounds, a peer's between them where there is one."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

from runs.bench.peer import Peer


def time_rounds(
    call: Callable[[], object], count: int, times: int, rounds: int, peer: Peer | None
) -> dict[str, float]:
    """Best and median million cell updates a CPU second of `times` calls that make `count` each.

    With a peer each round has one of its runs beside it, and the ratio is of medians.
    """
    speeds, others = [], []
    for _ in range(rounds):
        start = time.process_time()
        for _ in range(times):
            call()
        speeds.append(count * times / (time.process_time() - start) / 1e6)
        if peer:
            others.append(peer.measure())
    return compare_speeds(speeds, others, peer)


def compare_speeds(speeds: list[float], others: list[float], peer: Peer | None) -> dict[str, float]:
    """Columns of a row: best, median, and the median over the peer's."""
    middle = statistics.median(speeds)
    row = {"best, million/s": max(speeds), "median, million/s": middle}
    if peer:
        row[f"{peer.name}, million/s"] = statistics.median(others)
        row[f"over {peer.name}"] = middle / statistics.median(others)
    return row
