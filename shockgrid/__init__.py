"""The public Python interface: `import shockgrid as sg`, then `sg.load`, `sg.run`, `sg.open`, ...

Each name is imported when it is first used.  May import: `regrid`, `hydro`, `problems`, `runs`,
and only inside functions, so that `import shockgrid` loads nothing heavy.

These four lie inside this package once it is installed (`shockgrid.regrid`, ...) and beside it in
the repository; docstrings and pages name their modules without the leading `shockgrid`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shockgrid import testing
    from shockgrid.hydro.block import Block
    from shockgrid.hydro.boundary import Segment, put
    from shockgrid.hydro.carried.fields import CarriedField
    from shockgrid.hydro.eos import (
        JWL,
        EquationOfState,
        IdealGas,
        MieGruneisen,
        PhaseTransition,
        StiffenedGas,
        Tabular,
    )
    from shockgrid.hydro.eos.materials import find_material
    from shockgrid.hydro.links import join, slide
    from shockgrid.hydro.simulation import Simulation
    from shockgrid.hydro.sources import make_gravity as gravity
    from shockgrid.hydro.strength.laws.base import StrengthLaw
    from shockgrid.problems.deck import Deck, DeckTable, Output, Regrid, RunControl, key
    from shockgrid.problems.initial_states import make_plane_grid, put_walls, shock
    from shockgrid.problems.pictures import draw_field
    from shockgrid.problems.problem import Problem
    from shockgrid.problems.report import Report, Row
    from shockgrid.regrid.algebraic import AlgebraicRegridder, transfinite_grid
    from shockgrid.regrid.barrier.regridder import BarrierRegridder
    from shockgrid.regrid.errors import BadInput, RegridFailure, RunFailure
    from shockgrid.regrid.jit import inlined
    from shockgrid.regrid.registry import make_regridder
    from shockgrid.runs.inspection.compare import compare
    from shockgrid.runs.inspection.info import inspect
    from shockgrid.runs.interface import grid
    from shockgrid.runs.interface.calls import plot, register, restart, run, verify
    from shockgrid.runs.interface.case import Case, Hook, OpenRun, load
    from shockgrid.runs.interface.case import open_run as open
    from shockgrid.runs.pictures.film import make_film as film
    from shockgrid.runs.report import report
    from shockgrid.runs.study.study import Study, study

    __version__: str

MODULES = {
    "AlgebraicRegridder": "shockgrid.regrid.algebraic",
    "BadInput": "shockgrid.regrid.errors",
    "BarrierRegridder": "shockgrid.regrid.barrier.regridder",
    "Block": "shockgrid.hydro.block",
    "CarriedField": "shockgrid.hydro.carried.fields",
    "Case": "shockgrid.runs.interface.case",
    "Deck": "shockgrid.problems.deck",
    "DeckTable": "shockgrid.problems.deck",
    "EquationOfState": "shockgrid.hydro.eos.base",
    "Hook": "shockgrid.runs.interface.case",
    "IdealGas": "shockgrid.hydro.eos.gases",
    "JWL": "shockgrid.hydro.eos.jwl",
    "MieGruneisen": "shockgrid.hydro.eos.mie_gruneisen",
    "OpenRun": "shockgrid.runs.interface.case",
    "Output": "shockgrid.problems.deck",
    "PhaseTransition": "shockgrid.hydro.eos.phase_transition",
    "Problem": "shockgrid.problems.problem",
    "Regrid": "shockgrid.problems.deck",
    "RegridFailure": "shockgrid.regrid.errors",
    "Report": "shockgrid.problems.report",
    "Row": "shockgrid.problems.report",
    "RunControl": "shockgrid.problems.deck",
    "RunFailure": "shockgrid.regrid.errors",
    "Segment": "shockgrid.hydro.boundary",
    "Simulation": "shockgrid.hydro.simulation",
    "Study": "shockgrid.runs.study.study",
    "StiffenedGas": "shockgrid.hydro.eos.gases",
    "StrengthLaw": "shockgrid.hydro.strength.laws.base",
    "Tabular": "shockgrid.hydro.eos.tabular",
    "compare": "shockgrid.runs.inspection.compare",
    "draw_field": "shockgrid.problems.pictures",
    "film": "shockgrid.runs.pictures.film",
    "find_material": "shockgrid.hydro.eos.materials",
    "gravity": "shockgrid.hydro.sources",
    "grid": "shockgrid.runs.interface",
    "inlined": "shockgrid.regrid.jit",
    "inspect": "shockgrid.runs.inspection.info",
    "join": "shockgrid.hydro.links",
    "key": "shockgrid.problems.deck",
    "load": "shockgrid.runs.interface.case",
    "make_plane_grid": "shockgrid.problems.initial_states",
    "make_regridder": "shockgrid.regrid.registry",
    "open": "shockgrid.runs.interface.case",
    "plot": "shockgrid.runs.interface.calls",
    "put": "shockgrid.hydro.boundary",
    "put_walls": "shockgrid.problems.initial_states",
    "register": "shockgrid.runs.interface.calls",
    "report": "shockgrid.runs.report",
    "restart": "shockgrid.runs.interface.calls",
    "run": "shockgrid.runs.interface.calls",
    "shock": "shockgrid.problems.initial_states",
    "slide": "shockgrid.hydro.links",
    "study": "shockgrid.runs.study.study",
    "testing": "shockgrid",
    "transfinite_grid": "shockgrid.regrid.algebraic",
    "verify": "shockgrid.runs.interface.calls",
}
ELSEWHERE = {
    "film": "make_film",
    "gravity": "make_gravity",
    "open": "open_run",
}  # other names there
SUBMODULES = ("grid", "testing")  # names that are modules themselves
# functions that commands call, too: their messages name options
OF_COMMANDS = ("compare", "film", "inspect", "report", "study")

__all__ = [
    "JWL",
    "AlgebraicRegridder",
    "BadInput",
    "BarrierRegridder",
    "Block",
    "CarriedField",
    "Case",
    "Deck",
    "DeckTable",
    "EquationOfState",
    "Hook",
    "IdealGas",
    "MieGruneisen",
    "OpenRun",
    "Output",
    "PhaseTransition",
    "Problem",
    "Regrid",
    "RegridFailure",
    "Report",
    "Row",
    "RunControl",
    "RunFailure",
    "Segment",
    "Simulation",
    "StiffenedGas",
    "StrengthLaw",
    "Study",
    "Tabular",
    "__version__",
    "compare",
    "draw_field",
    "film",
    "find_material",
    "gravity",
    "grid",
    "inlined",
    "inspect",
    "join",
    "key",
    "load",
    "make_plane_grid",
    "make_regridder",
    "open",
    "plot",
    "put",
    "put_walls",
    "register",
    "report",
    "restart",
    "run",
    "shock",
    "slide",
    "study",
    "testing",
    "transfinite_grid",
    "verify",
]


def __getattr__(name: str) -> object:
    """Import a public name."""
    if name == "__version__":
        value: object = _find_version()
    elif name in MODULES:
        if name in SUBMODULES:
            value = importlib.import_module(f"{MODULES[name]}.{name}")
        else:
            value = getattr(importlib.import_module(MODULES[name]), ELSEWHERE.get(name, name))
        if name in OF_COMMANDS and callable(value):
            from shockgrid.runs.interface.wording import said_in_python

            value = said_in_python()(value)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _find_version() -> str:
    """The version of the installed distribution; in a bare checkout that of pyproject.toml."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("shockgrid")
    except PackageNotFoundError:
        import tomllib
        from pathlib import Path

        try:
            text = Path(__file__).parents[1].joinpath("pyproject.toml").read_text(encoding="utf-8")
            return tomllib.loads(text)["project"]["version"]
        except (OSError, KeyError, tomllib.TOMLDecodeError):
            return "unknown"
