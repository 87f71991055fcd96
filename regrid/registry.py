"""All regridders by name, one line each; a regridder is imported when it is used.

A regridder is a class with keyword options that follows the protocol `regrid.protocol.Regridder`,
or `FlowAwareRegridder` if it may follow a flow.  `tests/property/test_regridders.py` runs the same
tests for every entry.
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
from collections import ChainMap
from numbers import Integral, Real
from typing import Any

from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.plug_ins import PlugIns
from shockgrid.regrid.protocol import Regridder

OWN: dict[str, str] = {
    "barrier": "shockgrid.regrid.barrier.regridder:BarrierRegridder",
    "barrier-i": "shockgrid.regrid.barrier.regridder:StraightAlongI",
    "barrier-j": "shockgrid.regrid.barrier.regridder:StraightAlongJ",
    "barrier-both": "shockgrid.regrid.barrier.regridder:StraightBothWays",
    "quasi-1d": "shockgrid.regrid.algebraic:QuasiOneDimensionalRegridder",
    "transfinite": "shockgrid.regrid.algebraic:TransfiniteRegridder",
    "displacement": "shockgrid.regrid.algebraic:DisplacementRegridder",
    "equidistribution": "shockgrid.regrid.equidistribution.areas:EquidistributionRegridder",
    "brackbill-saltzman": "shockgrid.regrid.variational:VariationalRegridder",
    "ivanenko-charakhchyan": "shockgrid.regrid.variational:IvanenkoCharakhchyanRegridder",
    "node-speed": "shockgrid.regrid.variational:NodeSpeedRegridder",
    "winslow": "shockgrid.regrid.winslow:WinslowRegridder",
}
# where each is, "module:class"; of an installed package, the class itself
REGRIDDERS: ChainMap[str, Any] = ChainMap(OWN, PlugIns("shockgrid.regridders"))  # type: ignore


KINDS = {"float": Real, "int": Integral, "str": str}  # of options, by their annotation


def load_regridder(name: str) -> type[Regridder]:
    """The class behind a name; raises BadInput with the nearest name, or where an import fails."""
    if name not in REGRIDDERS:
        raise BadInput(f"regridder: there is none called '{name}'{suggest(name, REGRIDDERS)}")
    entry = REGRIDDERS[name]
    if not isinstance(entry, str):
        return entry
    module, _, attribute = entry.partition(":")
    return getattr(importlib.import_module(module), attribute)


def find_usable() -> list[str]:
    """Names of all regridders, without those of packages that cannot be imported."""
    names = list(OWN)
    for name in (name for name in REGRIDDERS if name not in OWN):
        with contextlib.suppress(BadInput):
            load_regridder(name)
            names.append(name)
    return names


def make_regridder(name: str, **options: Any) -> Regridder:
    """A regridder for one block; BadInput for a name, an option or a value that is none."""
    regridder = load_regridder(name)
    if "weight" in options and not takes_weight(name):
        weighted = ", ".join(sorted(filter(takes_weight, find_usable())))
        raise BadInput(f"regridder '{name}' takes no weight; those that do are: {weighted}")
    return call_with_options(regridder, name, options)


def call_with_options(maker: Any, name: str, options: dict[str, Any]) -> Any:
    """The regridder that a class makes; BadInput for an option or a value that is none."""
    annotations = find_options(maker)
    for option, value in options.items():
        if option not in annotations:
            hint = suggest(option, list(annotations))
            raise BadInput(f"regridder '{name}' has no option '{option}'{hint}")
        wanted = KINDS.get(annotations[option].removesuffix(" | None"))
        if wanted and value is not None and (type(value) is bool or not isinstance(value, wanted)):
            kind = {Real: "a number", Integral: "a whole number", str: "a word"}[wanted]
            raise BadInput(f"regridder '{name}': {option} = {value!r}; it must be {kind}")
    return maker(**options)


def find_options(maker: Any) -> dict[str, str]:
    """Names of the options of a regridder's class, and their annotations.

    Options that the class takes together, as `**numbers`, are listed in its attribute `numbers`.
    """
    options: dict[str, str] = {}
    for name, parameter in inspect.signature(maker).parameters.items():
        if parameter.kind is inspect.Parameter.VAR_KEYWORD:
            options |= maker.numbers
        else:
            options[name] = str(parameter.annotation)
    return options


def takes_weight(name: str) -> bool:
    """Whether this regridder has an option called weight."""
    return "weight" in inspect.signature(load_regridder(name)).parameters
