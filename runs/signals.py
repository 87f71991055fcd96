"""Signals that end a run or ask for a restart point, as far as this system has them."""

from __future__ import annotations

import contextlib
import os
import signal

# Ctrl-C, a scheduler or kill, the end of the terminal or its connection, the limit of CPU time
STOPPING = ("SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU")
POINT = "SIGUSR1"  # asks for a restart point, and the run continues


def find_numbers(*names: str) -> list[int]:
    """The numbers of the signals that there are; SIGHUP is left out where it is ignored (nohup)."""
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    hang_up = getattr(signal, "SIGHUP", None)
    return [
        number
        for number in numbers
        if number != hang_up or signal.getsignal(number) != signal.SIG_IGN
    ]


def is_hang_up(number: int) -> bool:
    """Is it the signal that the terminal is gone?"""
    return number == getattr(signal, "SIGHUP", None)


def list_terminals() -> list[int]:
    """Standard output and error, those of them that are a terminal."""
    return [handle for handle in (1, 2) if os.isatty(handle)]


def leave_terminals(handles: list[int]) -> None:
    """Let what goes to terminals that are gone go nowhere: writing there would be an error."""
    with contextlib.suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for handle in handles:
            os.dup2(nowhere, handle)
        os.close(nowhere)
