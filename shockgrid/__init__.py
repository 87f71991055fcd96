"""The public Python interface: `import shockgrid as sg`, then `sg.load`, `sg.run`, `sg.open`, ...

Each name is imported when it is first used.  May import: `regrid`, `hydro`, `problems`, `runs`,
and only inside functions, so that `import shockgrid` loads nothing heavy and another package
called `runs` is detected before it is run.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hydro.block import Block
    from hydro.boundary import Segment, put
    from hydro.carried.fields import CarriedField
    from hydro.eos import (
        JWL,
        EquationOfState,
        IdealGas,
        MieGruneisen,
        PhaseTransition,
        StiffenedGas,
        Tabular,
    )
    from hydro.eos.materials import find_material
    from hydro.links import join, slide
    from hydro.simulation import Simulation
    from hydro.sources import make_gravity as gravity
    from hydro.strength.laws.base import StrengthLaw
    from problems.deck import Deck, DeckTable, Output, Regrid, RunControl, key
    from problems.initial_states import make_plane_grid, put_walls, shock
    from problems.pictures import draw_field
    from problems.problem import Problem, Report, Row
    from problems.problem import compare as compare_column
    from regrid.algebraic import AlgebraicRegridder, transfinite_grid
    from regrid.barrier.regridder import BarrierRegridder
    from regrid.errors import BadInput, RegridFailure, RunFailure
    from regrid.jit import inlined
    from regrid.registry import make_regridder
    from runs.inspection.compare import compare
    from runs.inspection.info import inspect
    from runs.interface import grid
    from runs.interface.calls import plot, register, restart, run, verify
    from runs.interface.case import Case, Hook, OpenRun, load
    from runs.interface.case import open_run as open
    from runs.pictures.film import make_film as film
    from runs.report import report
    from runs.study.study import Study, study
    from shockgrid import testing

    __version__: str

MODULES = {
    "AlgebraicRegridder": "regrid.algebraic",
    "BadInput": "regrid.errors",
    "BarrierRegridder": "regrid.barrier.regridder",
    "Block": "hydro.block",
    "CarriedField": "hydro.carried.fields",
    "Case": "runs.interface.case",
    "Deck": "problems.deck",
    "DeckTable": "problems.deck",
    "EquationOfState": "hydro.eos.base",
    "Hook": "runs.interface.case",
    "IdealGas": "hydro.eos.gases",
    "JWL": "hydro.eos.jwl",
    "MieGruneisen": "hydro.eos.mie_gruneisen",
    "OpenRun": "runs.interface.case",
    "Output": "problems.deck",
    "PhaseTransition": "hydro.eos.phase_transition",
    "Problem": "problems.problem",
    "Regrid": "problems.deck",
    "RegridFailure": "regrid.errors",
    "Report": "problems.problem",
    "Row": "problems.problem",
    "RunControl": "problems.deck",
    "RunFailure": "regrid.errors",
    "Segment": "hydro.boundary",
    "Simulation": "hydro.simulation",
    "Study": "runs.study.study",
    "StiffenedGas": "hydro.eos.gases",
    "StrengthLaw": "hydro.strength.laws.base",
    "Tabular": "hydro.eos.tabular",
    "compare": "runs.inspection.compare",
    "compare_column": "problems.problem",
    "draw_field": "problems.pictures",
    "film": "runs.pictures.film",
    "find_material": "hydro.eos.materials",
    "gravity": "hydro.sources",
    "grid": "runs.interface",
    "inlined": "regrid.jit",
    "inspect": "runs.inspection.info",
    "join": "hydro.links",
    "key": "problems.deck",
    "load": "runs.interface.case",
    "make_plane_grid": "problems.initial_states",
    "make_regridder": "regrid.registry",
    "open": "runs.interface.case",
    "plot": "runs.interface.calls",
    "put": "hydro.boundary",
    "put_walls": "problems.initial_states",
    "register": "runs.interface.calls",
    "report": "runs.report",
    "restart": "runs.interface.calls",
    "run": "runs.interface.calls",
    "shock": "problems.initial_states",
    "slide": "hydro.links",
    "study": "runs.study.study",
    "testing": "shockgrid",
    "transfinite_grid": "regrid.algebraic",
    "verify": "runs.interface.calls",
}
ELSEWHERE = {
    "compare_column": "compare",
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
    "compare_column",
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
    """Import a public name; ImportError if another package hides one of shockgrid's."""
    if name == "__version__":
        value: object = _find_version()
    elif name in MODULES:
        from shockgrid.shadowing import find_shadow

        if shadow := find_shadow():
            raise ImportError(shadow)
        if name in SUBMODULES:
            value = importlib.import_module(f"{MODULES[name]}.{name}")
        else:
            value = getattr(importlib.import_module(MODULES[name]), ELSEWHERE.get(name, name))
        if name in OF_COMMANDS and callable(value):
            from runs.interface.wording import said_in_python

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
