"""Groups of history columns that a deck names in `output.columns`.

A name is that of an installed package's group, of one registered in this process
(`shockgrid.register`), or `FILE.py:FUNCTION`.  The function takes the flow after a step and returns
numbers by column name; its attribute `units`, if it has one, gives the units of the columns.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from shockgrid.hydro.history import INSTALLED, REGISTERED, ColumnGroup
from shockgrid.problems.deck import COLUMNS_OF_FILE
from shockgrid.problems.problem_file import read_function
from shockgrid.regrid.errors import BadInput, suggest


def find_columns(names: Iterable[str]) -> list[ColumnGroup]:
    """The groups of these names; BadInput with the nearest name, or what is wrong with a file."""
    return [find_group(name) for name in names]


def find_group(name: str) -> ColumnGroup:
    """The group of a name; BadInput as `find_columns`."""
    if of_file := COLUMNS_OF_FILE.fullmatch(name):
        return read_function(*of_file.groups(), "a group of history columns takes the flow")
    known = {**REGISTERED, **dict.fromkeys(INSTALLED)}
    if name not in known:
        raise BadInput(
            f"deck: output.columns: there is no group of history columns {name!r}"
            f"{suggest(name, known)}; it must be one of an installed package, or FILE.py:FUNCTION"
        )
    return REGISTERED[name] if name in REGISTERED else INSTALLED[name]


def find_column_units(names: Sequence[str]) -> dict[str, str]:
    """Units by column name, of those groups that give them."""
    units: dict[str, str] = {}
    for group in find_columns(names):
        units |= getattr(group, "units", {})
    return units
