"""The phases of a step on a block of two materials, and the arrays that they need.

They are called in place of those of `hydro.phases`, in the same order.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.eos.mixture import MASS_FRACTION, SEEN_FIELDS, VOLUME_FRACTION, Mixture
from shockgrid.hydro.formulas.reconstruction import FIRST_ORDER_LIMITER
from shockgrid.hydro.mixture.sides import make_gather, make_trace_sides, place_layers
from shockgrid.hydro.mixture.slopes import (
    AT_CENTRE,
    MARK_ROWS,
    MIXED_QUANTITIES,
    SLOPE_PARTS,
    fill_lengths,
    make_fill_slopes,
)
from shockgrid.hydro.mixture.update import FLUX_PARTS, make_mixed_update
from shockgrid.hydro.rows import RHO, P, U, V
from shockgrid.regrid.errors import BadInput

LONG_NAMES = {
    "mass_fraction": "mass fraction of the first material",
    "volume_fraction": "volume fraction of the first material",
}


def make_fraction_fields(mass_fraction: Any, volume_fraction: Any) -> list[CarriedField]:
    """The carried fields of a block of two materials, with their first values.

    Each a number, an array (ni, nj) or a function of the cells' centres (x, y) [m].
    """
    first = {"mass_fraction": mass_fraction, "volume_fraction": volume_fraction}
    return [
        CarriedField(name, "1", LONG_NAMES[name], first[name], 0.0, 1.0) for name in SEEN_FIELDS
    ]


class MixedCells:
    """What a block of two materials needs in its steps; made by the block.

    eos: its equation of state; limiter, flux: those of the block; shape: its cells (ni, nj).
    """

    def __init__(self, eos: Mixture, limiter: str, flux: str, shape: tuple[int, int]):
        ni, nj = shape
        self.limiter = limiter
        self.flux = flux
        self.eos_class = type(eos)
        self.laws = eos.first.wave_law, eos.second.wave_law
        self.lengths = np.ones((ni + 2, nj + 2)), np.ones((ni + 2, nj + 2))
        self.found = (
            np.zeros((MIXED_QUANTITIES, SLOPE_PARTS, ni, nj)),
            np.zeros((MARK_ROWS, ni, nj)),
        )
        self.scratch = np.zeros((3, FLUX_PARTS, nj + 1))

    def gather(self, block: Any) -> None:
        """Phase 2, before the couplings fill what is beyond the sides."""
        plan = block.plan
        fill_lengths(block.nodes, self.lengths)
        gather = make_gather(self.eos_class)
        gather(
            self._list_start(block), block.nodes, self.lengths, block.parameters, plan.walls,
            plan.wall_speeds, block.rim.rows,
        )  # fmt: skip

    def predict(self, block: Any, half_dt: float) -> None:
        """Phase 2, after the couplings: slopes and values at mid-time."""
        place_layers(self._list_start(block), self.lengths, block.rim.rows)
        limiter = FIRST_ORDER_LIMITER if block.kernels.is_first_order else self.limiter
        fill_slopes = make_fill_slopes(self.eos_class, limiter, self.flux)
        fill_slopes(
            self._list_start(block), block.nodes, self.lengths, half_dt, block.parameters,
            self._find_rows(block), self.found,
        )  # fmt: skip

    def _fill_without_slopes(self, block: Any) -> None:
        """The cells' own values for traces; a step of no length moves nothing by them."""
        state, carried = (array[:, 1:-1, 1:-1] for array in self._list_start(block))
        slopes, marks = self.found
        slopes[...] = 0.0
        marks[...] = 0.0
        first = state[RHO] * carried[MASS_FRACTION]
        values = first, state[RHO] - first, state[U], state[V], state[P], carried[VOLUME_FRACTION]
        slopes[:, AT_CENTRE] = values

    def trace(self, block: Any, dt: float) -> None:
        """Phase 6: traces on the moved faces, fluxes of walls and open sides."""
        plan = block.plan
        trace_sides = make_trace_sides(self.eos_class)
        trace_sides(
            self._list_cells(block), 1.0 / dt, block.parameters, self.laws, plan.walls, plan.opened,
            block.rim.rows,
        )  # fmt: skip

    def update(self, block: Any, dt: float) -> None:
        """Phase 6, after the couplings' fluxes: the new state and its totals."""
        if dt == 0.0:  # rates and totals alone, before anything is known of the sides
            self._fill_without_slopes(block)
        update_mixed = make_mixed_update(self.eos_class, self.limiter)
        block.totals.start_update()
        update_mixed(
            self._list_cells(block), (block.state_new, block.carried_new), block.rim.rows, dt,
            block.parameters, self._find_rows(block), self.scratch,
            (block.totals.of_tiles, block.rates_new),
        )  # fmt: skip

    @staticmethod
    def _list_start(block: Any) -> tuple[np.ndarray, np.ndarray]:
        """State and fractions that a step starts from."""
        return block.start, block.get_start("carried")

    def _list_cells(self, block: Any) -> tuple:
        """What cells hold, their nodes before and after, slopes and marks."""
        return self._list_start(block), (block.nodes, block.nodes_new), self.found

    @staticmethod
    def _find_rows(block: Any) -> tuple[int, int]:
        return block.rows.start, block.rows.stop


def check_geometry(block: Any) -> None:
    """Raise BadInput for a block of two materials in axisymmetric flow."""
    if block.geometry.curved:
        raise BadInput(
            f"block {block.name!r}: its cells hold two materials, which plane flow alone can have"
        )
