"""What a trial found, and what makes an outcome a defect, whatever the kind."""

from __future__ import annotations

import random
import re
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from soak.child import Done

ALLOWED = (0, 2, 3)  # exit codes of a command that was not killed: see runs/cli/main.py
# all but the end of a line and the tabulator: such characters steer a terminal
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f\x80-\x9f]")
MISTAKE = re.compile(r"a mistake in shockgrid itself \((\w+: [^\d/;)]*)")
COMPILING = re.compile(r"numba/core|llvmlite")


@dataclass(frozen=True)
class Outcome:
    """One trial's class in two or three words, whether it is a defect, and what shows it."""

    label: str
    defect: bool = False
    words: str = ""


class Kind(Protocol):
    """A kind of trial.  `wanted`: how many are asked for; `weight`: its share of the time."""

    name: str
    about: str
    wanted: int
    weight: float

    def prepare(self) -> None:
        """Make what all trials share; called once a process."""

    def attempt(self, number: int, folder: Path) -> Outcome:
        """Make trial `number` in an empty `folder`."""


def make_random(kind: str, seed: int, number: int) -> random.Random:
    """The chance of one trial, the same on every machine."""
    return random.Random(f"{kind}:{seed}:{number}")


def find_fault(done: Done, allowed: tuple[int, ...] = ALLOWED) -> Outcome | None:
    """The defect in how a command ended, if there is one; None where it ended as it should.

    At fault are: a traceback, an exit code that is not `allowed`, an error without a sentence, a
    warning of Python's, characters that steer a terminal, and no end within the time.
    """
    said = done.err.strip()
    if done.stuck:
        if COMPILING.search(done.err):
            return Outcome("kernels compiled past the bound")
        return Outcome("no end within the time", True, tell_last(done))
    if "Traceback" in said:
        return Outcome("traceback", True, tell_last(done))
    if done.code not in allowed:
        label = f"exit {done.code}"
        if mistake := MISTAKE.search(said):
            label += f": {textwrap.shorten(ascii(mistake[1])[1:-1], 60, placeholder=' ...')}"
        return Outcome(label, True, tell_last(done))
    if match := CONTROL.search(done.out.replace("\r", "") + done.err.replace("\r", "")):
        return Outcome("control characters", True, f"{match[0]!r} in {tell_last(done)}")
    if done.code and not said and not done.out.strip():
        return Outcome("an error without words", True, f"exit {done.code}")
    if "Warning:" in said:
        place = next(line for line in said.splitlines() if "Warning:" in line)
        return Outcome("a warning of Python's", True, place)
    return None


def tell_last(done: Done) -> str:
    """The last line that a command said, cut, after its exit code."""
    lines = (done.err.strip() or done.out.strip()).splitlines()
    return f"exit {done.code}: {ascii(lines[-1])[:300] if lines else '(nothing)'}"
