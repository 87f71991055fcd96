"""The kernels of a block's phases, and their scratch.

They are made for an equation of state, a limiter, a flux and a geometry, with stress or without;
blocks that agree in these share them.
"""

from __future__ import annotations

from typing import Any

from shockgrid.hydro.formulas.geometry import PLANE, Geometry
from shockgrid.hydro.formulas.reconstruction import FIRST_ORDER_LIMITER
from shockgrid.hydro.interior.advance import allocate_scratch, make_flow_kernels
from shockgrid.hydro.perimeter.strips import make_side_kernels


class BlockKernels:
    """Kernels of one block: `flow` for its inside, `sides` for its perimeter.

    scratch: of the rows of cells, as `hydro.interior.scratch` lays it out, once a thread.
    """

    def __init__(self, eos_class: type, limiter: str, flux: str, is_solid: bool = False):
        self.eos_class = eos_class
        self.is_solid = is_solid
        self.limiter = limiter
        self.flux = flux
        self.geometry = PLANE
        self.is_first_order = False
        self.scratch = allocate_scratch(1)
        self._choose()

    def set_geometry(self, geometry: Geometry) -> None:
        """Plane or axisymmetric flow, at the order of the scheme."""
        self.geometry = geometry
        self.is_first_order = False
        self._choose()

    def use_first_order(self, lowered: bool) -> None:
        """Set whether the following steps take cells for constant, as a last resort."""
        if lowered != self.is_first_order:
            self.is_first_order = lowered
            self._choose()

    def use_threads(self, threads: int) -> None:
        """Let there be scratch for so many threads: more than one."""
        if self.scratch.shape[0] != threads:
            self.scratch = allocate_scratch(threads)

    def _choose(self) -> None:
        limiter = FIRST_ORDER_LIMITER if self.is_first_order else self.limiter
        variant: tuple[Any, ...] = self.eos_class, limiter, self.geometry, self.flux
        variant = (*variant, self.is_solid)
        self.flow = make_flow_kernels(*variant)
        self.sides = make_side_kernels(*variant)
