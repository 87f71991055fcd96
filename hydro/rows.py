"""Rows and columns of the arrays that all of `hydro` shares, by name.

State (4, ni + 2, nj + 2), also the first rows of what perimeters hold: RHO, U, V, P [kg/m³, m/s,
Pa]. Flux (6, faces): MASS, MOMENTUM_X, MOMENTUM_Y, ENERGY, per time and depth (or radian). In
axisymmetric flow the pressure's radial force is not in MOMENTUM_Y but by itself, per depth in PUSH
and per radian in HOOP (theory F9.5). Totals of a tile (tiles, 8): see below.
"""

from __future__ import annotations

import numpy as np

# Arrays of a block by their names: what its cells hold, which moves with the mass that crosses
# faces.  Some blocks have `carried` besides: `Block.held_arrays`.  Each has one of the same name
# with `_new` for the step.  Acceptance, restarts, ranks, cut blocks, refinement and remapping go
# through `Block.held_arrays` and `Block.step_arrays`.
HELD_ARRAYS = ("state", "void_energy")

RHO, U, V, P = range(4)
STATE_ROWS = 4

# index of the node at an end of a line: 0 is its first end, 1 its last
END_INDEX = (0, -1)

MASS, MOMENTUM_X, MOMENTUM_Y, ENERGY, PUSH, HOOP = range(6)
FLUX_ROWS = 6

# columns of what a tile of cells adds up to: least c² (negative where there is
# no sound speed), traces of first order (up to four a cell), mass, momentum, energy, cells with
# voids, emptied cells
(
    LEAST_C2,
    FIRST_ORDER,
    TOTAL_MASS,
    TOTAL_MOMENTUM_X,
    TOTAL_MOMENTUM_Y,
    TOTAL_ENERGY,
    VOIDED,
    EMPTIED,
) = range(8)
TOTAL_ROWS = 8
# of a block of two materials one more: the mass of the first
TOTAL_FIRST_MASS = 8
MIXED_TOTAL_ROWS = 9
CONSERVED = slice(TOTAL_MASS, VOIDED)
MOMENTUM_AND_ENERGY = slice(TOTAL_MOMENTUM_X, VOIDED)
NO_C2 = 1e300  # least c² of no cell at all


def make_held(ni: int, nj: int) -> dict[str, np.ndarray]:
    """Arrays of HELD_ARRAYS for ni × nj cells, zero: the state has a layer of ghosts around."""
    return {"state": np.zeros((STATE_ROWS, ni + 2, nj + 2)), "void_energy": np.zeros((ni, nj))}
