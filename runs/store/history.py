"""history.csv, one row a step, and the restart point up to which it is whole.

A row is appended, and the file flushed ten times a second and before each dump, so that a kill
leaves it readable, with all rows that a restart needs.

The first row is step 0, where only some columns have a value; an empty field reads as nan (as ""
in a column of words).  A last line without its end is an incomplete write; reading drops it.
Numbers are written with the digits that they need to read back to the same bits.

Before each dump a line goes into `history.sums` beside it: the step of the last row, and the CRC-32
of the whole file so far.  So a change of the rows up to a dump is seen, and rows that are missing;
what follows the last sum that fits is not trusted, and a restart computes it again.
"""

from __future__ import annotations

import contextlib
import os
import time
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from shockgrid.problems.evolution import Evolution, adopt_cells, get_lists_in_state, get_start_row
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.store.directory import RunDirectory
from shockgrid.runs.store.dumps import has_state, open_dump, read_state
from shockgrid.runs.store.files import disk_errors, write_atomically

STEP_TIME = "seconds_step"  # a column that the runner adds
FLUSH_EVERY = 0.1  # wall seconds between two flushes
PLAIN = {int, float, str}  # types, exactly, that are encoded as they are
encode = msgspec.json.Encoder().encode


@dataclass
class Rows:
    """What a history file holds.

    columns: names, None where the first line is lost or there is no file;
    rows: step and line, up to what is damaged; fault: what that is, "" for nothing.
    """

    path: Path
    columns: list[str] | None = None
    rows: list[tuple[int, str]] = field(default_factory=list)
    fault: str = ""

    @property
    def last(self) -> int:
        """Step of the last row; -1 without any."""
        return self.rows[-1][0] if self.rows else -1

    def check(self, words: str = "") -> None:
        """Raise BadInput where something is damaged or cut out; `words`: what to do."""
        if self.fault:
            raise BadInput("; ".join([f"{self.path} {self.fault}", *filter(None, [words])]))

    def drop_foreign(self, step: int, t: float) -> None:
        """Trust no row where that of `step` has another time than the dump of that step, `t`."""
        text = dict(self.rows).get(step)
        if text is not None and self.columns is not None and "t" in self.columns:
            if float(text.split(",")[self.columns.index("t")]) != t:
                self.rows = []
                self.columns = None
                self.fault = f"has a row of step {step} that is not of t = {t:.6g} s"


def read_rows(path: Path, newest: int = 0) -> Rows:
    """The rows of a file up to the first that is damaged; BadInput where it cannot be opened.

    newest: step of the last dump, up to which there have to be rows.
    """
    found = Rows(path)
    sums = read_sums(path)  # first: of a live run the rows are ahead of them
    with disk_errors(path):
        lines = path.read_bytes().split(b"\n")[:-1] if path.exists() else []  # the last is torn
    if lines and lines[0].endswith(b",crc32"):  # of earlier versions: a sum in each row
        lines = [line.rpartition(b",")[0] for line in lines]
    if lines:
        names = lines[0].decode("utf-8", "replace").split(",")
        if "step" not in names:
            found.fault = "is damaged in its first line, that of the names"
            return found
        found.columns = names
        _take_rows(found, lines[1:])
    if newest and found.last < newest and not found.fault:
        there = (
            f"ends at step {found.last}" if found.rows else "is empty" if lines else "is missing"
        )
        found.fault = f"{there}, the dumps go to step {newest}"
    if lines:
        _check_sums(found, lines, sums)
    return found


def _take_rows(found: Rows, lines: Sequence[bytes]) -> None:
    """Read the rows up to the first that has other fields than there are columns, or a step that
    is not behind the one before."""
    columns = found.columns or []
    place = columns.index("step")
    for number, line in enumerate(lines, start=2):
        fields = line.decode("utf-8", "replace").split(",")
        try:
            step = int(fields[place])
        except (ValueError, IndexError):
            step = -1
        if len(fields) != len(columns) or step <= found.last:
            after = f"step {found.last}" if found.rows else "its names"
            found.fault = f"is damaged, or lacks rows, from line {number} on (after {after})"
            return
        found.rows.append((step, ",".join(fields)))


def get_sums_path(path: Path) -> Path:
    """The file of the sums of a history or a table of gauges."""
    return path.with_suffix(".sums")


def read_sums(path: Path) -> dict[int, int]:
    """CRC-32 of a history up to each step at which a dump was written; {} where none are known."""
    sums = {}
    with contextlib.suppress(OSError):
        for line in get_sums_path(path).read_text("utf-8", "replace").split("\n")[:-1]:
            with contextlib.suppress(ValueError):
                step, crc = line.split(",")
                sums[int(step)] = int(crc, 16)
    return sums


def _check_sums(found: Rows, lines: Sequence[bytes], sums: Mapping[int, int]) -> None:
    """Keep the rows up to the last sum that fits, where a later one does not."""
    crc = zlib.crc32(lines[0] + b"\n")
    good = -1
    checked = 0
    for (step, _), line in zip(found.rows, lines[1:], strict=False):
        crc = zlib.crc32(line + b"\n", crc)
        if step in sums:
            if sums[step] != crc:
                break
            good = step
            checked += 1
    if checked < len(sums):
        after = f"step {good}" if good >= 0 else "its names"
        found.fault = found.fault or f"is damaged, or lacks rows, after {after}"
        found.rows = [row for row in found.rows if row[0] <= good]


class HistoryWriter:
    """Appends rows to a history file; columns are fixed by the first row with a dt."""

    def __init__(self, path: Path, columns: list[str] | None = None):
        self.path = path
        self.columns = columns
        self._names = set(columns or ())
        self._waiting: list[dict[str, Any]] = []
        self._crc = zlib.crc32(path.read_bytes()) if columns is not None else 0  # of the whole file
        self._last = -1  # step of the last row that was added
        self._flush_at = 0.0  # on the monotonic clock
        with disk_errors(path):
            self._file = open(path, "a", encoding="utf-8", newline="")

    def start(self, row: Mapping[str, Any]) -> None:
        """Take the row of the start; it is written once the first step tells all columns."""
        self._waiting.append(dict(row))

    def append(self, row: Mapping[str, Any]) -> None:
        """Write one step; raises BadInput when the columns have changed."""
        rows = [row]
        lines = []
        now = time.monotonic()
        if self.columns is None:
            new_columns = [name for one in self._waiting for name in one if name not in row]
            self.columns = [*row, *dict.fromkeys(new_columns)]
            self._names = set(self.columns)
            rows = [*self._waiting, row]
            self._waiting = []
            lines = [",".join(self.columns)]
        elif row.keys() != self._names:
            raise BadInput(f"{self.path}: {describe_change(self.columns, row)}")
        for one in rows:
            lines.append(format_row([one.get(name, "") for name in self.columns]).decode())
            self._last = int(one["step"])
        text = "\n".join(lines) + "\n"
        self._crc = zlib.crc32(text.encode("utf-8"), self._crc)
        with disk_errors(self.path):
            self._file.write(text)
            if now >= self._flush_at:
                self._file.flush()
                self._flush_at = now + FLUSH_EVERY

    def sync(self) -> None:
        """Force the rows to the disk, and note their sum: called before a dump, which must not
        outlive its rows."""
        with disk_errors(self.path):
            self._file.flush()
            os.fsync(self._file.fileno())
        if self._last >= 0:
            sums = get_sums_path(self.path)
            with disk_errors(sums), open(sums, "a", encoding="utf-8", newline="") as file:
                file.write(f"{self._last},{self._crc:08x}\n")

    def close(self) -> None:
        """Close the file; more rows cannot follow."""
        with contextlib.suppress(OSError):  # of rows after the last dump
            self._file.close()


def format_row(values: list[Any]) -> bytes:
    """The values between commas; in words commas, quotes and line ends are replaced."""
    if PLAIN.issuperset(map(type, values)):
        text = encode(values)[1:-1].replace(b'"', b"")
        # without nan, inf and what words may hold
        if b"null" not in text and b"\\" not in text and text.count(b",") == len(values) - 1:
            return text
    return ",".join([_format_value(value) for value in values]).encode("utf-8")


def _format_value(value: Any) -> str:
    if isinstance(value, str):
        return value.replace(",", ";").replace('"', "'").replace("\n", " ")
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return str(int(value))
    return repr(float(value))


def describe_change(before: Iterable[str], now: Iterable[str]) -> str:
    """A sentence on the columns that are missing `now` or new; both are names of columns."""
    before = list(before)
    now = list(now)
    missing = [name for name in before if name not in now]
    new = [name for name in now if name not in before]
    kinds = (("without", missing), ("with", new))
    changes = " and ".join(f"{word} {', '.join(names)}" for word, names in kinds if names)
    return (
        f"the columns of a history stay the same through a run, and this one would go on {changes}"
    )


def read_history(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history file: whole numbers, floats or words; {} where there is none.

    Raises BadInput where it is damaged or rows are cut out.
    """
    found = read_rows(path)
    found.check()
    return read_columns(found)


def read_columns(found: Rows) -> dict[str, np.ndarray]:
    """The columns of those rows of a history that are whole."""
    if found.columns is None:
        return {}
    columns = zip(*(line.split(",") for _, line in found.rows), strict=True)
    named = zip(found.columns, columns if found.rows else [()] * len(found.columns), strict=True)
    return {name: _to_array(column) for name, column in named}


def _to_array(texts: tuple[str, ...]) -> np.ndarray:
    with contextlib.suppress(ValueError, OverflowError):
        return np.array([int(text) for text in texts], dtype=np.int64)
    with contextlib.suppress(ValueError):
        return np.array([float(text) if text else np.nan for text in texts], dtype=np.float64)
    return np.array(texts, dtype=str)


def check_columns(path: Path, evolution: Evolution, measured: Iterable[str]) -> None:
    """Raise BadInput where a continued run would have other columns than the history at `path`.

    measured: names of the columns that the deck and the problem add to those of the evolution.
    Columns that are missing are found in flows alone, which tell their rows before a step.
    """
    names = read_rows(path).columns
    if names is None:
        return
    tell: Any = getattr(evolution, "compute_row", None)
    now = [*(tell("start", 0) if tell else {}), *get_start_row(evolution), *measured]
    missing = [name for name in names if name not in (*now, "step", STEP_TIME)]
    if [name for name in now if name not in names] or (tell and missing):
        kept = [name for name in names if not (tell and name in missing)]
        now = list(dict.fromkeys([*kept, *now]))
        raise BadInput(
            f"{path}: {describe_change(names, now)}; give the restart what the run had "
            "(measure in Python, output.columns in the deck)"
        )


def truncate_history(path: Path, step: int, found: Rows) -> list[str] | None:
    """Let the file have those of the rows up to `step`; the columns, None if none are known.

    Raises BadInput where rows up to `step` are lost.
    """
    sums = get_sums_path(path)
    if found.columns is None or (step == 0 and not found.rows):
        sums.unlink(missing_ok=True)
        path.unlink(missing_ok=True)
        return None
    if found.last < step:
        found.check()
        raise BadInput(
            f"{found.path} ends at step {found.last}, before the restart point of step {step}; "
            "choose an earlier one with --at"
        )
    kept = [line for number, line in found.rows if number <= step]
    # the sums first: rows without a sum are read, sums without their rows are a fault
    known = [f"{number},{crc:08x}" for number, crc in read_sums(path).items() if number <= step]
    write_atomically(sums, "\n".join([*known, ""]))
    write_atomically(path, "\n".join([",".join(found.columns), *kept, ""]))
    return found.columns


def find_restart_point(
    directory: RunDirectory, at: int | None, say=lambda text: None, tables: Sequence[Path] = ()
) -> tuple[dict[str, Any], int, list[Rows]]:
    """State and step of the last restart point that can be read, or of step `at`; rows of `tables`.

    tables: the history, and the table of gauges of a deck that has some.  Where one of them is
    damaged, or ends before a point, the point is one from before that; at step 0 they start again.
    """
    points = [entry for entry in directory.list_points() if not is_light(entry[1])]
    newest = points[-1][0] if points else 0
    found = [read_rows(path, newest) for path in tables]
    if at is not None:
        steps = ", ".join(str(step) for step in sorted({step for step, _ in points})) or "none"
        points = [entry for entry in points if entry[0] == at]
        if not points:
            raise BadInput(f"{directory} has no restart point of step {at}; there are: {steps}")
    for step, path in reversed(points):
        try:
            for rows in found:
                with open_dump(path) as file:
                    rows.drop_foreign(step, float(file.attrs["t"]))
            behind = [rows for rows in found if step and rows.last < step]
            if not behind:
                return read_state(path), step, found
            if at is not None:
                behind[0].check("choose an earlier restart point with --at")
        except BadInput as error:
            if at is not None:
                raise
            say(f"skipped: {error}")
    if not directory.list_points():
        raise BadInput(
            f"nothing was computed yet in {directory}, so there is nothing to continue; start it "
            f"again: shockgrid run {directory.quoted}/deck.toml -o {directory.quoted} --force"
        )
    for rows in found:
        rows.check("no restart point is earlier; start the run again")
    raise BadInput(f"{directory} has no readable restart point; start the run again")


def is_light(path: Path) -> bool:
    """Is the dump at `path` one without a state?"""
    try:
        return not has_state(path)
    except BadInput:  # torn: told of when it is read
        return False


def restore(
    evolution: Evolution, state: dict[str, Any], directory: RunDirectory, step: int
) -> None:
    """Give `state` to a freshly built evolution; BadInput where the two do not fit."""
    adopt_cells(evolution, state)
    expected = evolution.get_state()
    missing = sorted(set(expected) - set(state))
    if missing:
        raise BadInput(
            f"the restart point of step {step} in {directory} was written by another version: "
            f"it lacks {', '.join(missing[:4])}"
        )
    lists = get_lists_in_state(evolution)
    for name, value in expected.items():
        shape = np.shape(value)
        stored = np.shape(state[name])
        differs = shape[1:] != stored[1:] if name in lists else shape != stored
        if differs:
            raise BadInput(
                f"the restart point of step {step} in {directory} has {name} of shape {stored}, "
                f"with this deck it would be {shape}: the deck's changes change the grid; "
                "begin a new run instead"
            )
    evolution.set_state(state)
    if evolution.step != step:
        raise BadInput(f"the restart point of step {step} holds step {evolution.step}")
