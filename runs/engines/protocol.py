"""What an engine is: something that computes tasks, several at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

Task = Callable[[Any], Any]


class Engine(Protocol):
    """What computes tasks; `workers`: how many at once."""

    workers: int

    def compute(self, task: Task, arguments: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """Yield (number of the argument, result or exception), in the order in which they end."""
        ...
