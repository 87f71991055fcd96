"""Numbers in words for a person: units with prefixes, times, shares, counts."""

from __future__ import annotations

import re

from shockgrid.problems.prefixes import pick_prefix


def describe_time(t: float, unit: str = "s", digits: int = 6) -> str:
    """`t = 1.5 s`; `t = 1.5` without a unit; what counts something else: `13 iterations`."""
    return f"t = {add_unit(t, unit, digits)}" if is_time(unit) else add_unit(t, unit, digits)


def is_time(unit: str) -> bool:
    """Is this a unit of time, or "1" for a time without unit?  Steady problems count iterations."""
    return unit in ("s", "1")


def add_unit(number: float, unit: str, digits: int = 6) -> str:
    """`1.5 m`; the number alone where the unit is "1"."""
    return f"{number:.{digits}g}" if unit == "1" else f"{number:.{digits}g} {unit}"


BETWEEN_COLUMNS = re.compile(r"(?<=\S)  +(?=\S)")
UNITS = re.compile(
    r"(?<=\d) (?:s|m|m/s|Pa|kg/m3)(?![\w/])|"  # behind a number, in brackets
    r" ?\[(?:1/)?(?:s|m|Pa|kg|N|J|K)\d?(?:/(?:kg|m|s|K)\d?)*\]"
)


def drop_units(words: str, t_unit: str) -> str:
    """The words without SI units where the unit of time is "1": the deck's numbers have none.

    In a line of a table the columns stay where they are.
    """
    if t_unit != "1":
        return words
    lines = []
    for line in words.split("\n"):
        shorter = UNITS.sub("", line)
        gap = BETWEEN_COLUMNS.search(shorter)
        if gap:
            room = " " * (len(line) - len(shorter))
            shorter = shorter[: gap.end()] + room + shorter[gap.end() :]
        lines.append(shorter)
    return "\n".join(lines)


def describe_seconds(low: float, high: float | None = None) -> str:
    """A wall time, or a range, in the unit a person would choose: `34 s`, `6 to 9 min`."""
    high = low if high is None else high
    units = ((86400.0, "days"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))
    size, unit = next((pair for pair in units if high >= 1.5 * pair[0]), units[-1])
    first, last = (f"{one:.2g}" if one < 100 else f"{one:.0f}" for one in (low / size, high / size))
    return f"{first} {unit}" if first == last else f"{first} to {last} {unit}"


def describe_bytes(number: float) -> str:
    """A number of bytes in the unit a person would choose."""
    factor, unit = pick_prefix(number, "B")
    return f"{number * factor:.3g} {unit}"


def describe_share(share: float) -> str:
    """A share in per cent; a small one is not called nothing."""
    return "<1%" if 0 < share < 0.01 else f"{share:.0%}"


def count(number: int, thing: str) -> str:
    """`1 block`, `2 blocks`."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
