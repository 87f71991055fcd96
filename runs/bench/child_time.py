"""CPU time of the commands that this process has started and that have ended."""

from __future__ import annotations

from typing import NamedTuple

from regrid.errors import BadInput

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]


class ChildTime(NamedTuple):
    """Seconds of CPU time of all ended child processes so far."""

    user: float
    system: float


def read_child_time() -> ChildTime:
    """User and system time of ended child processes; BadInput where the system keeps no count."""
    if resource is None:
        raise BadInput(
            "bench: this system does not tell the CPU time of a command that has ended; "
            "take --runs none and leave out --peer"
        )
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return ChildTime(used.ru_utime, used.ru_stime)
