"""Tasks for workers of the tests: they note that they ran, and die or fail if told."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


def note(folder: str, name: object) -> int:
    """Append a line to the task's file; how many there are now."""
    path = Path(folder, f"task-{name}")
    with open(path, "a") as file:
        file.write(f"{os.getpid()}\n")
    return len(path.read_text().splitlines())


def square(argument: tuple[str, int]) -> int:
    """The square of a number; 0 is an error."""
    folder, number = argument
    note(folder, number)
    if number == 0:
        raise ValueError("nothing to square")
    return number * number


def square_after_death(argument: tuple[str, int]) -> int:
    """As `square`, but the process of number 3 is killed the first time."""
    folder, number = argument
    times = note(folder, number)
    time.sleep(0.05)
    if number == 3 and times == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def square_or_die(argument: tuple[str, int]) -> int:
    """As `square`, but number 2 is killed every time."""
    folder, number = argument
    note(folder, number)
    time.sleep(0.05)
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def note_and_wait(folder: str) -> None:
    """Say which process this is, and do not end."""
    Path(folder, f"pid-{os.getpid()}").touch()
    time.sleep(600.0)
