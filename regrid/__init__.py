"""Grids as geometry: nodes, boundary polylines, weights; no density, no equation of state.

This package is an independent library.  It loads only numpy and numba; `__all__` lists its public
names, each of which is loaded when it is first used.

The files of the folder itself define the interfaces: errors, decorators of kernels, protocols,
sides, entry points of other packages, whole marches, and the registry of regridders.
Each subpackage imports only those to its left:

    compilation <- errors, jit, protocol, sides <- curves, spacings, measure
    <- algebraic
    <- barrier, domains, node_speeds <- equidistribution, given, marching <- variational <- registry
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shockgrid.regrid.algebraic import AlgebraicRegridder as AlgebraicRegridder
    from shockgrid.regrid.algebraic import transfinite_grid as transfinite_grid
    from shockgrid.regrid.barrier.regridder import BarrierRegridder as BarrierRegridder
    from shockgrid.regrid.barrier.repair import repair_grid as repair_grid
    from shockgrid.regrid.curves import redistribute as redistribute
    from shockgrid.regrid.domains import make_domain as make_domain
    from shockgrid.regrid.equidistribution.volumes import (
        EquidistributionRegridder3D as EquidistributionRegridder3D,
    )
    from shockgrid.regrid.errors import BadInput as BadInput
    from shockgrid.regrid.errors import RegridFailure as RegridFailure
    from shockgrid.regrid.given import find_start as find_start
    from shockgrid.regrid.hexahedra.regridder import BarrierRegridder3D as BarrierRegridder3D
    from shockgrid.regrid.marching import March as March
    from shockgrid.regrid.marching import choose_times as choose_times
    from shockgrid.regrid.marching import march as march
    from shockgrid.regrid.marching import march_domain as march_domain
    from shockgrid.regrid.measure.quality import Quality as Quality
    from shockgrid.regrid.measure.quality import compute_corner_areas as compute_corner_areas
    from shockgrid.regrid.measure.quality import find_bad_cells as find_bad_cells
    from shockgrid.regrid.measure.quality import measure_first_line_gap as measure_first_line_gap
    from shockgrid.regrid.measure.quality import measure_quality as measure_quality
    from shockgrid.regrid.protocol import Regridder as Regridder
    from shockgrid.regrid.protocol import RegridReport as RegridReport
    from shockgrid.regrid.protocol import RegridResult as RegridResult
    from shockgrid.regrid.registry import make_regridder as make_regridder
    from shockgrid.regrid.spacings import arc_spacing as arc_spacing
    from shockgrid.regrid.spacings import clustered_spacing as clustered_spacing
    from shockgrid.regrid.spacings import geometric_spacing as geometric_spacing
    from shockgrid.regrid.spacings import uniform_spacing as uniform_spacing

NAMES = {
    "shockgrid.regrid.algebraic": "AlgebraicRegridder transfinite_grid",
    "shockgrid.regrid.barrier.regridder": "BarrierRegridder",
    "shockgrid.regrid.barrier.repair": "repair_grid",
    "shockgrid.regrid.curves": "redistribute",
    "shockgrid.regrid.domains": "make_domain",
    "shockgrid.regrid.equidistribution.volumes": "EquidistributionRegridder3D",
    "shockgrid.regrid.errors": "BadInput RegridFailure",
    "shockgrid.regrid.given": "find_start",
    "shockgrid.regrid.hexahedra.regridder": "BarrierRegridder3D",
    "shockgrid.regrid.marching": "March choose_times march march_domain",
    "shockgrid.regrid.measure.quality": "Quality compute_corner_areas find_bad_cells "
    "measure_first_line_gap measure_quality",
    "shockgrid.regrid.protocol": "RegridReport RegridResult Regridder",
    "shockgrid.regrid.registry": "make_regridder",
    "shockgrid.regrid.spacings": "arc_spacing clustered_spacing geometric_spacing uniform_spacing",
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
