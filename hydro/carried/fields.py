"""What a carried field is: its name, unit and first value, and the checks of these.

A carried field is a number per mass of a block's material, such as a fraction or a strain.  It goes
with the material through all faces, and nothing else changes it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shockgrid.regrid.errors import BadInput

FLOW_FIELDS = ("rho", "u", "v", "p", "e")


@dataclass(frozen=True)
class CarriedField:
    """A field that the cells of a block carry with their mass.

    name: an identifier, as in dumps and history; unit: of the number, "1" if it has none;
    long_name: what it is, in words; first: its value at the start, a number, an array (ni, nj) or a
    function of the cells' centres (x, y) [m]; least, most: bounds of what values mean anything.
    Raises BadInput for a name that is none or that the flow has already, and for bounds that hold
    no number.
    """

    name: str
    unit: str = "1"
    long_name: str = ""
    first: float | np.ndarray | Callable[..., Any] = 0.0
    least: float = -math.inf
    most: float = math.inf

    def __post_init__(self):
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise BadInput(
                f"a carried field is called {self.name!r}: its name has letters, digits and _ alone"
            )
        if self.name in FLOW_FIELDS:
            raise BadInput(f"a carried field is called {self.name!r}, which the flow has already")
        if not self.least < self.most:
            raise BadInput(
                f"carried field {self.name!r}: its least value {self.least!r} is not below its "
                f"greatest {self.most!r}"
            )

    def find_first(self, block: str, centres: np.ndarray) -> np.ndarray:
        """The values (ni, nj) at the start, at the centres (2, ni, nj) [m] of a block's cells.

        Raises BadInput for values that are no numbers, too many or too few, or out of bounds.
        """
        shape = centres.shape[1:]
        first_values = self.first(*centres) if callable(self.first) else self.first
        what = f"block {block!r}: carried field {self.name!r}"
        try:
            values = np.broadcast_to(np.asarray(first_values, dtype=np.float64), shape)
        except (TypeError, ValueError):
            raise BadInput(
                f"{what}: its first values have shape {np.shape(first_values)}; the block has "
                f"{shape[0]} x {shape[1]} cells"
            ) from None
        self.check(what, values)
        return values

    def check(self, what: str, values: Any) -> None:
        """Raise BadInput, which begins with `what`, where a value is none within the bounds."""
        inside = np.isfinite(values) & (values >= self.least) & (values <= self.most)
        if not np.all(inside):
            wrong = np.asarray(values)[~inside].flat[0]
            raise BadInput(
                f"{what}: a value is {wrong:g}; it must be a finite number between "
                f"{self.least:g} and {self.most:g}"
            )


def read_fields(block: str, fields: Sequence[CarriedField]) -> tuple[CarriedField, ...]:
    """The carried fields of a new block; raises BadInput where two have one name."""
    fields = tuple(fields)
    for field in fields:
        if not isinstance(field, CarriedField):
            raise BadInput(f"block {block!r}: {field!r} is no CarriedField")
    names = [field.name for field in fields]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise BadInput(f"block {block!r}: {names.count(twice[0])} carried fields are {twice[0]!r}")
    return fields


def read_values(
    what: str, fields: Sequence[CarriedField], values_given: Mapping[str, Any] | None
) -> np.ndarray:
    """A value of each field (n,), such as beyond an open side; raises BadInput where one lacks."""
    values_given = values_given or {}
    names = [field.name for field in fields]
    for name in values_given:
        if name not in names:
            known = ", ".join(names) or "none"
            raise BadInput(f"{what}: {name!r} is no carried field of the block; it has {known}")
    missing = [name for name in names if name not in values_given]
    if missing:
        raise BadInput(
            f"{what}: the block carries {missing[0]!r}; say with what value it comes in, such as "
            f"carried = {{{missing[0]} = 0}}"
        )
    values = np.array([float(values_given[field.name]) for field in fields])
    for field, value in zip(fields, values, strict=True):
        field.check(f"{what}: carried field {field.name!r}", value)
    return values


def check_same(
    what: str, fields: Sequence[CarriedField], other_fields: Sequence[CarriedField]
) -> None:
    """Raise BadInput, which begins with `what`, where blocks carry fields of other names."""
    names = [field.name for field in fields]
    other_names = [field.name for field in other_fields]
    if names != other_names:
        raise BadInput(
            f"{what}, and their carried fields differ: {', '.join(names) or 'none'}, and "
            f"{', '.join(other_names) or 'none'}; give both blocks the same in the same order"
        )
