"""Why runs end early or slow down, what each means and which settings have helped: the one source.

Errors name a cause by its id (`cause` of `regrid.errors.RunFailure`); the run that ends prints what
is here, and so does docs/limits.md.  A setting stands here only where it has helped in a run of a
packaged problem; docs/notes/decisions.md has the runs, and those that did not help.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Setting:
    """A key of the deck and how to change it.

    `value`: as after `--set key=`; or `factor` on what the deck has, not beyond `least` and `most`.
    `words`: what it does, for the page.
    """

    key: str
    words: str
    value: str = ""
    factor: float = 1.0
    least: float = 0.0
    most: float = float("inf")

    def choose(self, present: Any) -> str | None:
        """What to write after `key=` where the deck has `present`; None where nothing is left."""
        if self.value:
            return None if str(present).lower() == self.value.lower() else self.value
        if isinstance(present, bool) or not isinstance(present, int | float):
            return None
        wished = min(max(present * self.factor, self.least), self.most)
        if isinstance(present, int):
            wished = round(wished)
        if wished == present or (wished > present) != (self.factor > 1.0):
            return None
        return f"{wished:.3g}" if isinstance(wished, float) else str(wished)

    @property
    def described(self) -> str:
        """The change in words: `run.cfl` halved."""
        if self.value:
            return f"`{self.key}={self.value}`"
        sizes = {0.5: "halved", 2.0: "doubled", 10.0: "times 10"}
        return f"`{self.key}` {sizes.get(self.factor, f'times {self.factor:g}')}"


@dataclass(frozen=True)
class Cause:
    """Why a run ends early or slows down.

    `says`: what is seen or said; `means`: why; `settings`: what has helped, the best first;
    `advice`: what else can be done, "" for nothing.
    """

    says: str
    means: str
    settings: tuple[Setting, ...] = ()
    advice: str = ""


SMALLER_CFL = Setting("run.cfl", "shorter steps: lines move less in each", factor=0.5)
MORE_BARRIER = Setting(
    "regrid.epsilon", "more barrier keeps cells thicker", factor=10.0, most=1e-2
)
MORE_SHARING = Setting("run.small_cells", "more cells share their states", value="0.1")
FEWER_CELLS = Setting("cells", "larger cells fold later", factor=0.5)
MORE_CELLS = Setting("cells", "finer cells", factor=2.0)

ENDS: dict[str, Cause] = {
    "no-state": Cause(
        "density or sound speed is no longer positive",
        "a torn cell is nearly empty, or a shock meets vacuum",
        (SMALLER_CFL,),
        "a material with a strength; an end before the material tears (`run.t_end`)",
    ),
}
SLOW: dict[str, Cause] = {}


def settings_for(cause: str) -> tuple[Setting, ...]:
    """Settings that have helped against a cause, the best first; none for an unknown id."""
    found = CAUSES.get(cause)
    return found.settings if found else ()


CAUSES = {**ENDS, **SLOW}
