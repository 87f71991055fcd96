"""What the ranks of a run have said to each other: a line of the closing screen and of run.log."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from runs.ranks.world import World

NOTED = "ranks: "  # how the line of run.log begins; JSON follows


def describe_ranks(world: World | None, note: Callable[[str], None]) -> list[str]:
    """The line of the closing screen, none for a run in one process; all ranks have to be alive.

    note: takes the line of run.log, the books of all ranks (`hydro.ranks.messages.Book.gather`).
    """
    if world is None or world.ranks is None:
        return []
    books = world.ranks.count()
    note(NOTED + json.dumps(books))
    return [f"messages of ranks: {describe_books(books)}"]


def describe_books(books: Mapping[str, Any]) -> str:
    """Messages and megabytes of a step, and the part of it that the ranks wait for them."""
    steps, words = books["steps"], list[str]()
    if steps:
        kinds = [kind for kind, calls in books["calls"].items() if calls]
        calls = sum(books["calls"][kind] for kind in kinds) / steps
        sizes = [f"{kind} {books['bytes'][kind] / steps / 1e6:.2g}" for kind in kinds]
        words.append(f"{calls:.1f} a step, MB of {', '.join(sizes)}")
        parts = [
            100.0 * waited / seconds
            for waited, seconds in zip(books["waited"], books["seconds"], strict=True)
            if seconds > 0.0
        ]
        if parts:
            words.append(f"{min(parts):.0f}% to {max(parts):.0f}% of a step are waits for them")
    return "; ".join(words) or "none"


def read_books(log: str) -> dict[str, Any] | None:
    """The last line of a run.log about ranks as `describe_ranks` noted it; None without any."""
    found = [line for line in log.splitlines() if NOTED + "{" in line]
    return json.loads(found[-1].split(NOTED, 1)[1]) if found else None
