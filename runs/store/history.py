"""history.csv: one row a step, appended and flushed, so that a kill leaves it readable.

The first row is step 0, where only some columns have a value; an empty field reads as nan (as ""
in a column of words).  A last line without its end is a torn write and is dropped on reading.
Numbers are written with `repr`, so that they read back to the same bits.  The last column of the
file has the rows' checksums (`runs.store.history_rows`); readers do not see it.

A history that was lost and made again from the dumps lacks the columns that only a step tells: it
is provisional, and the next step writes it anew with all columns.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from problems.evolution import Evolution, get_start_row
from regrid.errors import BadInput
from runs.store.files import disk_errors, write_atomically
from runs.store.history_rows import SUM, Rows, read_rows, seal_more, seal_rows

STEP_TIME = "seconds_step"  # a column of every step; a history without it is provisional
NUMBERS = (int, float)  # types, exactly, whose repr is what the file holds


class HistoryWriter:
    """Appends rows to a history file; columns are fixed by the first row with a dt."""

    def __init__(self, path: Path, columns: list[str] | None = None):
        self.path = path
        self.columns = columns
        self._waiting: list[dict[str, Any]] = []
        self._replaces = columns is None and bool(read_rows(path).rows)  # a provisional file
        self._last = None if columns is None else read_rows(path).last  # step of the last row
        self._order: tuple[str, ...] = ()  # names of the row that was checked last
        with disk_errors(path):
            self._file = open(path, "a", encoding="utf-8", newline="")

    def start(self, row: Mapping[str, Any]) -> None:
        """Take a row of the start; it is written once the first step tells all columns.

        All rows of a provisional file are to be given so: it is replaced then.
        """
        self._waiting.append(dict(row))

    def append(self, row: Mapping[str, Any]) -> None:
        """Write one step and flush; raises BadInput when the columns have changed."""
        rows = [row]
        new = self.columns is None
        if self.columns is None:
            first = [name for one in self._waiting for name in one if name not in row]
            self.columns = [*row, *dict.fromkeys(first)]
            rows, self._waiting = [*self._waiting, row], []
        elif tuple(row) != self._order and (
            len(row) != len(self.columns) or any(name not in row for name in self.columns)
        ):
            raise BadInput(f"{self.path}: {describe_change(self.columns, row)}")
        self._order = tuple(row)
        texts = [(int(one["step"]), format_row(self.columns, one)) for one in rows]
        head = ",".join([*self.columns, SUM])
        lines = [*[head] * new, *seal_more(head, texts, self._last)]
        self._last = texts[-1][0]
        if self._replaces:
            self._replace(lines)
            return
        with disk_errors(self.path):
            self._file.write("\n".join(lines) + "\n")
            self._file.flush()

    def _replace(self, lines: Sequence[str]) -> None:
        """Put these lines in place of the provisional file; more rows follow them."""
        self.close()
        write_atomically(self.path, "\n".join([*lines, ""]))
        with disk_errors(self.path):
            self._file = open(self.path, "a", encoding="utf-8", newline="")
        self._replaces = False

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


def format_row(columns: Sequence[str], row: Mapping[str, Any]) -> str:
    """The text of a row without its checksum; empty for what the row does not have."""
    values = [row.get(name, "") for name in columns]
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


def read_history(path: Path, words: str = "") -> dict[str, np.ndarray]:
    """The columns of a history file: whole numbers, floats or words; {} where there is none.

    Raises BadInput where it is damaged or rows are cut out; `words` then say what to do.
    """
    found = read_rows(path)
    found.check(words)
    return read_columns(found)


def read_columns(found: Rows) -> dict[str, np.ndarray]:
    """The columns of those rows of a history that are whole, without their checksums."""
    if found.columns is None:
        return {}
    names, rows = found.columns, list(csv.reader(text for _, text in found.rows))
    for (step, _), row in zip(found.rows, rows, strict=True):
        if len(row) != len(names):
            raise BadInput(f"{found.path}, step {step}: {len(row)} values for {len(names)} columns")
    columns = zip(*rows, strict=True) if rows else [()] * len(names)
    history = {name: _to_array(column) for name, column in zip(names, columns, strict=True)}
    for name in ("step", "t"):
        if name not in history or history[name].dtype.kind not in "fi":
            raise BadInput(
                f"{found.path} is damaged: its column {name!r} is missing or holds no numbers"
            )
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


def list_texts(columns: Sequence[str], rows: Iterable[tuple[int, str]]) -> list[dict[str, str]]:
    """Rows of a file, steps and texts, as what `HistoryWriter.start` takes."""
    return [dict(zip(columns, text.split(","), strict=True)) for _, text in rows]


def is_provisional(columns: Sequence[str]) -> bool:
    """Does a history with these columns lack those of its steps?"""
    return STEP_TIME not in columns


def check_columns(path: Path, evolution: Evolution, measured: Iterable[str]) -> None:
    """Raise BadInput where a run that goes on would have other columns than the history at `path`.

    measured: names of the columns that the deck and the problem add to those of the evolution.
    Columns that are missing are found in flows alone, which tell their rows before a step.
    """
    names = read_rows(path).columns
    if names is None:
        return
    tell: Any = getattr(evolution, "compute_row", None)
    own = tell("start", 0) if tell else {}
    if is_provisional(names):
        tell, own = (
            True,
            {name: None for name in ("t", *own) if name == "t" or name.startswith("boundary_")},
        )
    now = [*own, *get_start_row(evolution), *measured]
    missing = [name for name in names if name not in (*now, "step", STEP_TIME)]
    if [name for name in now if name not in names] or (tell and missing):
        kept = [name for name in names if not (tell and name in missing)]
        now = list(dict.fromkeys([*kept, *now]))
        raise BadInput(
            f"{path}: {describe_change(names, now)}; give the restart what the run had "
            "(measure in Python, output.columns in the deck)"
        )


def truncate_history(path: Path, step: int) -> list[str] | None:
    """Drop all rows after `step` (and a torn line); return the columns, None if none are known.

    Raises BadInput where the file is damaged or ends before `step`.
    """
    found = read_rows(path)
    found.check()
    if found.columns is None:
        path.unlink(missing_ok=True)
        return None
    kept = [(number, text) for number, text in found.rows if number <= step]
    last = kept[-1][0] if kept else 0
    if last < step:
        raise BadInput(
            f"{path} ends at step {last}, before the restart point of step {step}; "
            "choose an earlier one with --at"
        )
    write_rows(path, found.columns, kept)
    return found.columns


def write_rows(path: Path, columns: Sequence[str], rows: Iterable[tuple[int, str]]) -> None:
    """Write a history file anew: steps and texts of rows, which get their checksums."""
    write_atomically(path, "\n".join([*seal_rows(columns, rows), ""]))
