"""The rows of a history file, each judged by its own checksum.

The last column, `crc32`, is the CRC-32 of the file's first line, the step of the row before and
the row's text: so a row that was changed is seen, and so is one that lacks the row before it.  A
row whose predecessor is known to be lost (`seal_rows` wrote it so) counts as whole; the gap is a
fact then, and no damage.

Files without that column, from before it was there, are judged by their steps alone.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from regrid.errors import BadInput

SUM = "crc32"
SHOWN = 4  # places of damage that a sentence names


@dataclass
class Rows:
    """What a history file holds.

    columns: names without that of the sums, None where the first line is lost or there is no file;
    rows: step and text without its sum, of the rows that are whole; faults: sentences on what is
    damaged or cut out; gaps: first and last step of stretches that are known to be lost.
    """

    path: Path
    columns: list[str] | None = None
    rows: list[tuple[int, str]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    gaps: list[tuple[int, int]] = field(default_factory=list)

    @property
    def last(self) -> int:
        """Step of the last row; -1 without any."""
        return self.rows[-1][0] if self.rows else -1

    def check(self, words: str = "") -> None:
        """Raise BadInput where something is damaged or cut out."""
        if self.faults:
            raise BadInput(
                "; ".join([f"{self.path} {' and '.join(self.faults)}", *filter(None, [words])])
            )


def read_rows(path: Path) -> Rows:
    """The rows of a file, judged; BadInput where it cannot be opened."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return Rows(path)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from error
    lines = content.split(b"\n")[:-1]  # what follows the last line's end is torn
    if not lines:
        return Rows(path)
    names = lines[0].decode("utf-8", "replace").split(",")
    if names[-1] == SUM:
        return _judge_sealed(path, lines, names[:-1])
    if _is_nearly(names[-1]):
        return Rows(path, faults=["is damaged in its first line, that of the names"])
    return _judge_bare(path, lines, names)


def seal_rows(columns: Sequence[str], rows: Iterable[tuple[int, str]], after: int | None = None):
    """The lines of a file, its first one included, each row with its checksum.

    after: step of the row before the first, None where there is none.
    """
    head = ",".join([*columns, SUM])
    yield head
    yield from seal_more(head, rows, after)


def seal_more(head: str, rows: Iterable[tuple[int, str]], after: int | None):
    """Lines for rows that follow the one of step `after` in a file with this first line."""
    start = zlib.crc32(head.encode("utf-8"))
    for step, text in rows:
        yield f"{text},{_sum(start, after, text.encode('utf-8'))}"
        after = step


def _sum(start: int, after: int | None, text: bytes) -> int:
    before = b"" if after is None else str(after).encode("ascii")
    return zlib.crc32(before + b":" + text, start)


def _judge_sealed(path: Path, lines: list[bytes], columns: list[str]) -> Rows:
    found = Rows(path, columns)
    start, where = zlib.crc32(lines[0]), _find_step(columns)
    damaged, cut, last = [], [], None
    for number, line in enumerate(lines[1:], start=2):
        text, _, digits = line.rpartition(b",")
        step = _read_step(text, where)
        if step is None or not digits.isdigit():
            damaged.append(number)
            continue
        stored = int(digits)
        if (last is None or step > last) and stored == _sum(start, last, text):
            first = 0 if last is None else last + 1
            if step > first:
                found.gaps.append((first, step - 1))
        elif (last is None or step > last) and stored == _sum(start, step - 1, text):
            if last is None or step > last + 1:
                cut.append((0 if last is None else last + 1, step - 1))
        else:
            damaged.append(number)
            continue
        found.rows.append((step, text.decode("utf-8")))
        last = step
    if damaged and len(damaged) == len(lines) - 1:
        found.columns = None
        found.faults = ["is damaged in its first line, that of the names, or in all others"]
        return found
    _tell(found, damaged, cut)
    return found


def _judge_bare(path: Path, lines: list[bytes], columns: list[str]) -> Rows:
    """Rows without checksums: those of the right width with steps that go up by one."""
    while lines and lines[-1].count(b",") != len(columns) - 1:
        lines.pop()
    found, where = Rows(path, columns), _find_step(columns)
    damaged, cut, last = [], [], None
    if where is None and lines:
        return Rows(path, faults=["is damaged in its first line, that of the names"])
    for number, line in enumerate(lines[1:], start=2):
        step = _read_step(line, where) if line.count(b",") == len(columns) - 1 else None
        if step is None or (last is not None and step <= last):
            damaged.append(number)
            continue
        if last is not None and step > last + 1:
            cut.append((last + 1, step - 1))
        found.rows.append((step, line.decode("utf-8", "replace")))
        last = step
    _tell(found, damaged, cut)
    return found


def _tell(found: Rows, damaged: list[int], cut: list[tuple[int, int]]) -> None:
    if damaged:
        found.faults.append(f"is damaged in {say_stretches(damaged, damaged, 'line')}")
    if cut:
        firsts, lasts = zip(*cut, strict=True)
        found.faults.append(f"lacks the rows of {say_stretches(firsts, lasts, 'step')}")


def _find_step(columns: Sequence[str]) -> int | None:
    return columns.index("step") if "step" in columns else None


def _read_step(text: bytes, where: int | None) -> int | None:
    """The step in a row's text; None where it has none."""
    try:
        return int(text.split(b",")[where if where is not None else -1])
    except (ValueError, IndexError):
        return None


def _is_nearly(name: str) -> bool:
    """Is this the name of the sums with a character or two changed?"""
    return len(name) == len(SUM) and sum(a == b for a, b in zip(name, SUM, strict=True)) >= 3


def say_stretches(firsts: Sequence[int], lasts: Sequence[int], word: str) -> str:
    """Numbered things in words, neighbours as one stretch: "lines 3 to 7, 9"."""
    stretches: list[list[int]] = []
    for first, last in zip(firsts, lasts, strict=True):
        if stretches and first == stretches[-1][1] + 1:
            stretches[-1][1] = last
        else:
            stretches.append([first, last])
    told = [f"{a} to {b}" if b > a else f"{a}" for a, b in stretches[:SHOWN]]
    more = f" and {len(stretches) - SHOWN} more" if len(stretches) > SHOWN else ""
    many = len(stretches) > 1 or stretches[0][1] > stretches[0][0]
    return f"{word}{'s' * many} {', '.join(told)}{more}"
