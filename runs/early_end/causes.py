"""Why runs end early or slow down, what each means and which settings have helped.

All of that is in `causes.toml`.  Errors name a cause by its id (`cause` of
`regrid.errors.RunFailure`); the run that ends prints what is there, and so does docs/limits.md.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shockgrid.regrid.errors import RunFailure


@dataclass(frozen=True)
class Setting:
    """A key of the deck and how to change it: its new value as text, or a factor; and `words`."""

    key: str
    change: str | float
    words: str

    def choose(self, present: Any) -> str | None:
        """What to write after `key=` where the deck has `present`; None where nothing is left."""
        if isinstance(self.change, str):
            return None if str(present).lower() == self.change else self.change
        if isinstance(present, bool) or not isinstance(present, int | float):
            return None
        wished = present * self.change
        wished = round(wished) if isinstance(present, int) else float(f"{wished:.3g}")
        return str(wished) if wished != present else None

    @property
    def described(self) -> str:
        """The change in words, `run.cfl` halved, and what it does."""
        sizes = {0.5: "halved", 2.0: "doubled", 10.0: "times 10"}
        if isinstance(self.change, str):
            return f"`{self.key}={self.change}`: {self.words}"
        return f"`{self.key}` {sizes[self.change]}: {self.words}"


@dataclass(frozen=True)
class Cause:
    """`name`: what is seen, in a word or two; `means`: why; `settings`: what has helped, the best
    first; `advice`: what else can be done.  All may have Markdown's marks of code, but no links."""

    name: str
    means: str
    settings: tuple[Setting, ...] = ()
    advice: str = ""


TABLE = tomllib.loads((Path(__file__).parent / "causes.toml").read_text(encoding="utf-8"))
SETTINGS = {name: Setting(**words) for name, words in TABLE["settings"].items()}


ENDS: dict[str, Cause] = {  # by the id that errors carry
    name: Cause(**words | {"settings": tuple(SETTINGS[one] for one in words.get("settings", ()))})
    for name, words in TABLE["causes"].items()
}
SHORT_STEPS = {  # by what limits dt, where that is no cell: what has helped
    "stretching": ("smaller-cfl", "fewer-cells"), "touch": ("fewer-cells",),
    "tension": ("fewer-cells",),
}  # fmt: skip
SMALL_CELLS = "more-sharing", "stronger-barrier", "fewer-cells"


def describe_settings(limit: str) -> str:
    """What can be changed where dt is short by a key of SHORT_STEPS, or by a cell, in a line."""
    names = SHORT_STEPS.get(limit, SMALL_CELLS)
    descriptions = [SETTINGS[name].described.replace("`", "") for name in names]
    return "; ".join([*descriptions, "run.t_end ends the run before"])


def name_failure(error: Exception) -> str:
    """Why a run has ended early in a word or two: the name of its cause, or what the system says of
    the disk; "" for what has no name."""
    if isinstance(error, RunFailure):
        return ENDS[error.cause].name if error.cause in ENDS else ""
    system = error.__cause__
    return str(system.strerror).lower() if isinstance(system, OSError) else ""
