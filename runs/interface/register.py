"""Names for what a script or a notebook defines, so that decks of this process can say them.

`sg.register("averaged", Averaged)`; then `regrid={"name": "averaged"}`.  A registered name is known
in this process alone.
"""

from __future__ import annotations

import re
from collections.abc import MutableMapping
from typing import Any

from hydro.boundary.registry import SEGMENTS
from hydro.boundary.segment import Segment
from hydro.eos import EQUATIONS_OF_STATE
from hydro.eos.base import EquationOfState
from problems.problem import Problem
from problems.registry import PROBLEMS
from regrid.errors import BadInput
from regrid.registry import REGRIDDERS

NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
_OWN: dict[tuple[str, str], str] = {}  # what was registered here: kind and name, and its class


def register(name: str, thing: type) -> None:
    """Make a class known by name: a problem, an equation of state, a boundary kind, a regridder.

    A regridder is a class with a method `regrid(previous, boundary)`.  The same name may be given
    again by the same class, written anew.  Raises BadInput for another class, for a name that is
    taken, and for one that is not of small letters, digits and hyphens.
    """
    if not isinstance(thing, type):
        raise BadInput(f"{name!r}: a class is registered, not a {type(thing).__name__}")
    if not NAME.fullmatch(name):
        raise BadInput(f"{name!r} is no name: small letters, digits and hyphens are wanted")
    place = f"{thing.__module__}:{thing.__qualname__}"
    registry: MutableMapping[str, Any]
    value: Any
    if issubclass(thing, Problem):
        kind, registry, value = "problem", PROBLEMS, place
    elif issubclass(thing, EquationOfState):
        kind, registry, value = "equation of state", EQUATIONS_OF_STATE, thing
    elif issubclass(thing, Segment):
        kind, registry, value = "boundary kind", SEGMENTS, thing
    elif callable(getattr(thing, "regrid", None)):
        kind, registry, value = "regridder", REGRIDDERS, place
    else:
        raise BadInput(
            f"{thing.__name__} is no problem, equation of state, boundary kind or regridder: it is "
            "derived from none of them and has no method regrid"
        )
    if "<locals>" in place:
        raise BadInput(f"{thing.__qualname__}: a class inside a function cannot be registered")
    if name in registry and _OWN.get((kind, name)) != place:
        raise BadInput(f"there is a {kind} {name!r} already; choose another name")
    registry[name] = value
    _OWN[kind, name] = place
