"""history.csv: one row a step, appended and flushed, so that a kill leaves it readable.

The first row is step 0, where only some columns have a value; an empty field reads as nan (as ""
in a column of words).  A last line without its end is a torn write and is dropped on reading.
Numbers are written with `repr`, so that they read back to the same bits.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from problems.evolution import Evolution, get_start_row
from regrid.errors import BadInput
from runs.store.files import disk_errors, write_atomically

NUMBERS = (int, float)  # types, exactly, whose repr is what the file holds


class HistoryWriter:
    """Appends rows to a history file; columns are fixed by the first row with a dt."""

    def __init__(self, path: Path, columns: list[str] | None = None):
        self.path = path
        self.columns = columns
        self._waiting: dict[str, Any] | None = None
        self._order: tuple[str, ...] = ()  # names of the row that was checked last
        with disk_errors(path):
            self._file = open(path, "a", encoding="utf-8", newline="")

    def start(self, row: Mapping[str, Any]) -> None:
        """Take the row of step 0; it is written once the first step tells all columns."""
        self._waiting = dict(row)

    def append(self, row: Mapping[str, Any]) -> None:
        """Write one step and flush; raises BadInput when the columns have changed."""
        lines = []
        if self.columns is None:
            first = self._waiting or {}
            self.columns = list(row) + [name for name in first if name not in row]
            lines.append(",".join(self.columns))
            if self._waiting is not None:
                lines.append(self._format(first))
                self._waiting = None
        elif tuple(row) != self._order and (
            len(row) != len(self.columns) or any(name not in row for name in self.columns)
        ):
            raise BadInput(f"{self.path}: {describe_change(self.columns, row)}")
        self._order = tuple(row)
        lines.append(self._format(row))
        with disk_errors(self.path):
            self._file.write("\n".join(lines) + "\n")
            self._file.flush()

    def sync(self) -> None:
        """Force the rows to the disk: called before a dump, which must not outlive its rows."""
        with disk_errors(self.path):
            self._file.flush()
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file; more rows cannot follow."""
        try:
            self._file.close()
        except OSError:
            pass  # what could not be flushed has been reported by `append`

    def _format(self, row: Mapping[str, Any]) -> str:
        values = [row.get(name, "") for name in self.columns or ()]
        return ",".join(
            [repr(value) if type(value) in NUMBERS else _format_value(value) for value in values]
        )


def describe_change(before: Iterable[str], now: Iterable[str]) -> str:
    """A sentence on the columns that are missing `now` or new; both are names of columns."""
    now = list(now)
    missing = [name for name in before if name not in now]
    new = [name for name in now if name not in before]
    told = [
        f"{word} {', '.join(names)}"
        for word, names in (("without", missing), ("with", new))
        if names
    ]
    return (
        f"the columns of a history stay the same through a run, and this one would go on "
        f"{' and '.join(told)}"
    )


def _format_value(value: Any) -> str:
    if isinstance(value, str):
        return value.replace(",", ";").replace('"', "'").replace("\n", " ")
    if isinstance(value, bool | np.bool_):
        return str(int(value))
    if isinstance(value, int | np.integer):
        return str(int(value))
    return repr(float(value))


def read_lines(path: Path) -> list[str]:
    """All whole lines of a history file; [] when there is none."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return []
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from error
    lines = text.split("\n")[:-1]  # what follows the last line's end is torn
    if not lines:
        return []
    width = lines[0].count(",")
    while lines and lines[-1].count(",") != width:
        lines.pop()
    return lines


def read_history(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history file: whole numbers, floats or words."""
    lines = read_lines(path)
    if not lines:
        return {}
    rows = list(csv.reader(lines))
    names = rows[0]
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise BadInput(f"{path}, line {number}: {len(row)} values for {len(names)} columns")
    columns = zip(*rows[1:], strict=True) if len(rows) > 1 else [()] * len(names)
    history = {name: _to_array(column) for name, column in zip(names, columns, strict=True)}
    for name in ("step", "t"):
        if name not in history or history[name].dtype.kind not in "fi":
            raise BadInput(f"{path} is damaged: its column {name!r} is missing or holds no numbers")
    return history


def _to_array(texts: tuple[str, ...]) -> np.ndarray:
    try:
        return np.array([int(text) for text in texts], dtype=np.int64)
    except (ValueError, OverflowError):
        pass
    try:
        return np.array([float(text) if text else np.nan for text in texts], dtype=np.float64)
    except ValueError:
        return np.array(texts, dtype=str)


def check_columns(path: Path, evolution: Evolution, measured: Iterable[str]) -> None:
    """Raise BadInput where a run that goes on would have other columns than the history at `path`.

    measured: names of the columns that the deck and the problem add to those of the evolution.
    Columns that are missing are found in flows alone, which tell their rows before a step.
    """
    lines = read_lines(path)
    if not lines:
        return
    names = lines[0].split(",")
    tell = getattr(evolution, "compute_row", None)
    own = tell("start", 0) if tell else {}
    now = [*own, *get_start_row(evolution), *measured]
    missing = [name for name in names if name not in (*now, "step", "seconds_step")]
    if [name for name in now if name not in names] or (tell and missing):
        kept = [name for name in names if not (tell and name in missing)]
        now = list(dict.fromkeys([*kept, *now]))
        raise BadInput(
            f"{path}: {describe_change(names, now)}; give the restart what the run had "
            "(measure in Python, output.columns in the deck)"
        )


def truncate_history(path: Path, step: int) -> list[str] | None:
    """Drop all rows after `step` (and a torn line); return the columns, None if none are known."""
    lines = read_lines(path)
    if not lines:
        path.unlink(missing_ok=True)
        return None
    names = lines[0].split(",")
    where = names.index("step")
    kept = [lines[0]] + [line for line in lines[1:] if int(line.split(",")[where]) <= step]
    last = int(kept[-1].split(",")[where]) if len(kept) > 1 else 0
    if last < step:
        raise BadInput(
            f"{path} ends at step {last}, before the restart point of step {step}; "
            "choose an earlier one with --at"
        )
    write_atomically(path, "\n".join(kept) + "\n")
    return names
