"""The results of a run compared with theory: rows, their table, and the run that they are about."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

import numpy as np

from shockgrid.problems.evolution import Evolution
from shockgrid.problems.signals import find_time

History: TypeAlias = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Row:
    """One number of a report: as computed and by theory, NaN where unknown, in SI units.

    A number with a column of `measure` is named like it.  `label`: its text in the summary, which
    omits rows without one and shows the number over `unit` (1e9 for GPa).  Its error is relative to
    `size` (default: the theory), or the number itself if theory is 0 or unknown; `error` is its
    name in `shockgrid verify`.  Studies draw rows that are `studied`.  `source` is that of the
    theory; `off` is a text in place of the difference.
    """

    name: str
    computed: float = math.nan
    theory: float = math.nan
    label: str = ""
    unit: float = 1.0
    digits: int = 6
    error: str = ""
    size: float = 0.0
    studied: bool = False
    source: str = ""
    off: str = ""

    @property
    def difference(self) -> float:
        """Computed minus theory, over `size` or the theory; NaN if undefined.

        Over the theory it is positive where the number is too large in magnitude, whatever its
        sign.
        """
        size = self.size or self.theory
        return (self.computed - self.theory) / size if size else math.nan

    def find_error(self) -> float:
        """Magnitude of the error."""
        bare = math.isnan(self.theory) or not (self.theory or self.size)
        return abs(self.computed) if bare else abs(self.difference)

    def format(self, width: int) -> str:
        """The line in the summary, the label padded to `width`; "-" for unknown numbers."""
        numbers = [self.computed, self.theory]
        texts = [f"{x / self.unit:.{self.digits}g}" if math.isfinite(x) else "-" for x in numbers]
        if math.isnan(self.theory):
            texts[1] = ""
        off = f"{100.0 * self.difference:+.3f} %" if math.isfinite(self.difference) else ""
        line = f"{texts[0]:>14} {texts[1]:>14} {self.off or off:>12}"
        return f"  {self.label:{width}} {line}   {self.source}".rstrip()


@dataclass(frozen=True)
class Report:
    """The results of a run: a head, rows in a table, and sentences below them.

    A head that takes long to compute is a function, called when the report is printed.
    """

    head: str | Callable[[], str] = ""
    rows: Sequence[Row] = field(default_factory=list)
    notes: Sequence[str] = field(default_factory=list)

    def __str__(self) -> str:
        shown = [row for row in self.rows if row.label]
        lines = [self.head() if callable(self.head) else self.head]
        if shown:
            width = max(30, *(len(row.label) for row in shown))
            lines.append(f"  {'':{width}} {'computed':>14} {'theory':>14} {'difference':>12}")
            lines += [row.format(width) for row in shown]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


class NoHistory(dict):
    """The history of a run that has not begun: each of its columns is one NaN."""

    def __missing__(self, name: str) -> np.ndarray:
        return np.full(1, math.nan)


class HasEnd(Protocol):
    """What a run needs of its problem: the end time [s]."""

    @property
    def t_end(self) -> float: ...


class RunSoFar:
    """What a run has found so far, as `Problem.report` and `Problem.cautions` receive it.

    history: columns by name, (rows,) each; final: the state at the end, None if only the run
    directory is at hand; begun: whether there is a history.  Before that every column is one NaN,
    so that a report has theory alone.
    """

    def __init__(
        self, problem: HasEnd, history: History | None = None, final: Evolution | None = None
    ):
        self._problem = problem
        self.begun = bool(history)
        self.history: History = history if history else NoHistory()
        self.final = final

    @property
    def t(self) -> float:
        """The time of the last row [s]; before the run the end time."""
        return self.last("t") if self.begun else self._problem.t_end

    def last(self, name: str) -> float:
        """The last value of a column; NaN if there is none."""
        column = self.history.get(name)
        return float(column[-1]) if column is not None and len(column) else math.nan

    def most(self, name: str) -> float:
        """The largest value of a column; NaN if there is none."""
        column = self.history.get(name, np.empty(0))
        return float(np.nanmax(column)) if np.isfinite(column).any() else math.nan

    def find_time(self, condition: np.ndarray) -> float:
        """The first time [s] at which a condition (rows,) on the history holds, or NaN."""
        return find_time(self.history["t"], condition)

    def until(self, t: float) -> RunSoFar:
        """The same up to the time `t` [s], with the first row at least: as far as theory goes."""
        if not self.begun:
            return self
        rows = max(1, int(np.searchsorted(self.history["t"], t, side="right")))
        earlier = {name: column[:rows] for name, column in self.history.items()}
        return RunSoFar(self._problem, earlier, self.final)

    def compare(self, name: str, theory: float = math.nan, label: str = "", **more: Any) -> Row:
        """The row of a column's last value; `more`: further fields of the row."""
        return Row(name, self.last(name), theory, label, **more)

    def say_unreached(self, name: str) -> list[str]:
        """A sentence if a column that is measured at the end time has no value."""
        known = not math.isnan(self.last(name))
        return [] if known else ["the error is measured at the end time, which was not reached"]


def align(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table, its first column aligned left, the others right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    first = [f"  {row[0]:{widths[0]}}" for row in rows]
    return [
        "   ".join([head, *map(str.rjust, row[1:], widths[1:])]).rstrip()
        for head, row in zip(first, rows, strict=True)
    ]
