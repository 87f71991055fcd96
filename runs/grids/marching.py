"""Marching a family of grids along with a named domain, step by step, and what came of it."""

from __future__ import annotations

import inspect
from typing import Any

from regrid.domains import MovingDomain
from regrid.errors import BadInput, RegridFailure
from regrid.marching import March, march_domain
from regrid.registry import find_usable, load_regridder, make_regridder

__all__ = ["March", "make_family", "march", "parse_options", "takes_weight", "warm_up"]


def parse_options(words: tuple[str, ...]) -> dict[str, Any]:
    """`--option key=value` as a dictionary; numbers and true/false are taken as such."""
    options: dict[str, Any] = {}
    for word in words:
        key, sign, text = word.partition("=")
        if not sign or not key.strip():
            raise BadInput(f"--option {word}: write key=value, such as --option epsilon=1e-3")
        options[key.strip().replace("-", "_")] = _read_value(text.strip())
    return options


def _read_value(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return {"true": True, "false": False}.get(text.lower(), text)


def make_family(name: str, options: dict[str, Any], weight: str | None = None):
    """A regridder of the registry; BadInput for a weight given to a family that takes none."""
    if weight is None:
        return make_regridder(name, **options)
    if not takes_weight(name):
        able = ", ".join(family for family in find_usable() if takes_weight(family))
        raise BadInput(f"--weight: the family '{name}' takes none; these do: {able}")
    return make_regridder(name, **{"weight": _read_value(weight), **options})


def takes_weight(name: str) -> bool:
    """Has this family an option called weight?"""
    return "weight" in inspect.signature(load_regridder(name).__init__).parameters


def march(domain: MovingDomain, regridder, steps: int, end: float = 1.0) -> March:
    """March `domain` from s = 0 to `end` in equal steps; stops at the first step without a grid.

    A grid handed back with a cell that is not convex ends the march as well.  Compiling is not in
    its times.
    """
    warm_up(domain, regridder)
    return march_domain(regridder, domain, steps, end=end)


def warm_up(domain: MovingDomain, regridder) -> None:
    """One call outside the clock: compiling is not regridding."""
    try:
        regridder.regrid(domain.start, domain.boundary(1e-6))
    except RegridFailure:
        pass
