"""Grids as geometry: nodes, boundary polylines, weights; no density, no equation of state.

This package is an independent library.  It loads only numpy and numba; `__all__` lists its public
names, each of which is loaded when it is first used.

The files of the folder itself define the interfaces: errors, decorators of kernels, protocols,
sides, entry points of other packages, whole marches, and the registry of regridders.
Each subpackage imports only those to its left:

    compilation <- errors, jit, protocol, sides <- curves, measure <- algebraic
    <- barrier, domains, node_speeds <- equidistribution, given, marching <- variational <- registry
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regrid.algebraic import AlgebraicRegridder as AlgebraicRegridder
    from regrid.algebraic import transfinite_grid as transfinite_grid
    from regrid.barrier.regridder import BarrierRegridder as BarrierRegridder
    from regrid.barrier.repair import repair_grid as repair_grid
    from regrid.curves import arc_spacing as arc_spacing
    from regrid.curves import clustered_spacing as clustered_spacing
    from regrid.curves import geometric_spacing as geometric_spacing
    from regrid.curves import redistribute as redistribute
    from regrid.curves import uniform_spacing as uniform_spacing
    from regrid.domains import make_domain as make_domain
    from regrid.equidistribution.volumes import (
        EquidistributionRegridder3D as EquidistributionRegridder3D,
    )
    from regrid.errors import BadInput as BadInput
    from regrid.errors import RegridFailure as RegridFailure
    from regrid.given import find_start as find_start
    from regrid.hexahedra.regridder import BarrierRegridder3D as BarrierRegridder3D
    from regrid.marching import March as March
    from regrid.marching import choose_times as choose_times
    from regrid.marching import march as march
    from regrid.marching import march_domain as march_domain
    from regrid.measure.quality import Quality as Quality
    from regrid.measure.quality import compute_corner_areas as compute_corner_areas
    from regrid.measure.quality import find_bad_cells as find_bad_cells
    from regrid.measure.quality import measure_first_line_gap as measure_first_line_gap
    from regrid.measure.quality import measure_quality as measure_quality
    from regrid.protocol import Regridder as Regridder
    from regrid.protocol import RegridReport as RegridReport
    from regrid.protocol import RegridResult as RegridResult
    from regrid.registry import make_regridder as make_regridder

NAMES = {
    "regrid.algebraic": "AlgebraicRegridder transfinite_grid",
    "regrid.barrier.regridder": "BarrierRegridder",
    "regrid.barrier.repair": "repair_grid",
    "regrid.curves": "arc_spacing clustered_spacing geometric_spacing redistribute uniform_spacing",
    "regrid.domains": "make_domain",
    "regrid.equidistribution.volumes": "EquidistributionRegridder3D",
    "regrid.errors": "BadInput RegridFailure",
    "regrid.given": "find_start",
    "regrid.hexahedra.regridder": "BarrierRegridder3D",
    "regrid.marching": "March choose_times march march_domain",
    "regrid.measure.quality": "Quality compute_corner_areas find_bad_cells "
    "measure_first_line_gap measure_quality",
    "regrid.protocol": "RegridReport RegridResult Regridder",
    "regrid.registry": "make_regridder",
}
MODULES = {name: module for module, names in NAMES.items() for name in names.split()}
__all__ = sorted(MODULES)


def __getattr__(name: str) -> object:
    """A public name, imported now."""
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(importlib.import_module(MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
