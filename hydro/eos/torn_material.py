"""Condensed material that has been torn: what all equations of state with a strength share.

Pieces with gaps between them pull with the tension of the pieces times the part of an area that
they fill, rho/rho0, as in a porous body [CarrollHolt1972].  With the full strength a cell that
holds a hundredth of its full mass would be pulled a hundred times as hard as the solid.
"""

from __future__ import annotations

import functools
from typing import Any

from regrid.jit import inlined


@inlined
def compute_whole_ratio(ratio, p, strength):
    """rho0/rho that the sound speed sees: of the whole pieces where material is torn.

    From half the tension at which it tears on it goes from that of a body expanded as a whole to 1,
    that of pieces with gaps between them: a cell that holds a hundredth of its full mass would else
    carry waves a hundred times as fast as the solid and stop the time step.  In compression, and at
    no tension, it is the ratio itself (a strength of 0 too).
    """
    excess = 0.5 * ((ratio - 1.0) + abs(ratio - 1.0))
    inverse = (1.0 + excess) / (strength + 1e-300)
    left = 2.0 + (p - abs(p)) * inverse  # 2 at p = 0, 1 at half the tension, 0 at it
    left = 0.5 * (left + abs(left))
    whole = 0.5 * (1.0 + left - abs(1.0 - left))
    return ratio - excess * (1.0 - whole)


@inlined
def compute_strength_left(ratio):
    """Part of its strength that material has at the density rho0/ratio (theory F4.11)."""
    return 1.0 / (1.0 + 0.5 * ((ratio - 1.0) + abs(ratio - 1.0)))


@functools.cache
def make_least_pressure(eos_class):
    """`least(rho, parameters)` of a class of equations of state: the tension at which it tears.

    A class without `strength_left_part` has the same tension at all densities.
    """
    least_pressure_part = eos_class.least_pressure_part
    strength_left_part: Any = getattr(eos_class, "strength_left_part", None)

    @inlined
    def keep(rho, parameters):
        return least_pressure_part(parameters)

    @inlined
    def weaken(rho, parameters):
        return least_pressure_part(parameters) * strength_left_part(rho, parameters)

    return keep if strength_left_part is None else weaken
