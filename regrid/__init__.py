"""Grids as geometry: nodes, boundary polylines, weights; no density, no equation of state.

A library of its own: numpy and numba are all that it loads, and `__all__` has its public names,
each loaded when it is first asked for.

The folder's own files are the contract: errors, compiling, reports, protocols, sides, names that
other packages bring, whole marches, the registry
of regridders.
Rooms, each importing only those to its left:

    errors, jit, protocol, sides <- curves, measure <- algebraic
    <- barrier, domains, node_speeds <- equidistribution, given, marching <- variational <- registry
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regrid.algebraic import AlgebraicRegridder, transfinite_grid
    from regrid.barrier.regridder import BarrierRegridder
    from regrid.barrier.repair import repair_grid
    from regrid.curves import arc_law, clustered_law, geometric_law, redistribute, uniform_law
    from regrid.domains.plane import make_domain
    from regrid.errors import BadInput, RegridFailure
    from regrid.given import find_start
    from regrid.marching import March, choose_times, march, march_domain
    from regrid.measure.quality import (
        Quality,
        compute_corner_areas,
        find_bad_cells,
        measure_first_line_gap,
        measure_quality,
    )
    from regrid.protocol import Regridder, RegridReport, RegridResult
    from regrid.registry import make_regridder

MODULES = {
    "AlgebraicRegridder": "regrid.algebraic",
    "BadInput": "regrid.errors",
    "BarrierRegridder": "regrid.barrier.regridder",
    "March": "regrid.marching",
    "Quality": "regrid.measure.quality",
    "RegridFailure": "regrid.errors",
    "RegridReport": "regrid.protocol",
    "RegridResult": "regrid.protocol",
    "Regridder": "regrid.protocol",
    "arc_law": "regrid.curves",
    "choose_times": "regrid.marching",
    "clustered_law": "regrid.curves",
    "compute_corner_areas": "regrid.measure.quality",
    "find_bad_cells": "regrid.measure.quality",
    "find_start": "regrid.given",
    "geometric_law": "regrid.curves",
    "make_domain": "regrid.domains.plane",
    "make_regridder": "regrid.registry",
    "march": "regrid.marching",
    "march_domain": "regrid.marching",
    "measure_first_line_gap": "regrid.measure.quality",
    "measure_quality": "regrid.measure.quality",
    "redistribute": "regrid.curves",
    "repair_grid": "regrid.barrier.repair",
    "transfinite_grid": "regrid.algebraic",
    "uniform_law": "regrid.curves",
}

__all__ = [
    "AlgebraicRegridder",
    "BadInput",
    "BarrierRegridder",
    "March",
    "Quality",
    "RegridFailure",
    "RegridReport",
    "RegridResult",
    "Regridder",
    "arc_law",
    "choose_times",
    "clustered_law",
    "compute_corner_areas",
    "find_bad_cells",
    "find_start",
    "geometric_law",
    "make_domain",
    "make_regridder",
    "march",
    "march_domain",
    "measure_first_line_gap",
    "measure_quality",
    "redistribute",
    "repair_grid",
    "transfinite_grid",
    "uniform_law",
]


def __getattr__(name: str) -> object:
    """A public name, imported now."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(importlib.import_module(MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
