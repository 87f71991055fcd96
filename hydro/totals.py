"""Totals of a block's tiles in a step, and their sums: what the ledger and the checks read.

The update writes one row per tile.  One more row, `rest`, takes what else changes the sums: polygon
cells of sliding contacts, redistributed cells and body sources.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shockgrid.hydro.interior.update import sum_tiles
from shockgrid.hydro.rows import (
    CONSERVED,
    EMPTIED,
    LEAST_C2,
    MOMENTUM_AND_ENERGY,
    NO_C2,
    TOTAL_ROWS,
    VOIDED,
)


class Sums(NamedTuple):
    """Sums over the tiles of a block, in the order of the columns of `hydro.rows`.

    least_c2: the least c² [m²/s²]; first_order: traces of first order, up to four a cell;
    mass, momentum, energy: per depth, in axisymmetric flow per radian [kg/m, N s/m, J/m; kg, N s,
    J]; voided: cells with voids; emptied: cells of fragments that have given up almost all of their
    mass; first_mass: that of the first material in a block of two.
    """

    least_c2: float
    first_order: float
    mass: float
    momentum_x: float
    momentum_y: float
    energy: float
    voided: float
    emptied: float
    first_mass: float = 0.0


class TileTotals:
    """Totals of `tiles` tiles: `rows` (tiles + 1, columns), columns as in `hydro.rows`.

    of_tiles: the rows that the update writes; rest: the last row, see above; array (columns,): the
    sums, as kernels and other ranks write them.
    """

    def __init__(self, tiles: int, columns: int = TOTAL_ROWS):
        self.rows = np.zeros((tiles + 1, columns))
        self.of_tiles = self.rows[:-1]
        self.rest = self.rows[-1]
        self.rest[LEAST_C2] = NO_C2
        self.array = np.zeros(columns)
        self._sums: Sums | None = None  # of the array, while it is valid

    def start_update(self) -> None:
        """Before the update: no cell beside those of the tiles yet."""
        self._sums = None
        self.rest[LEAST_C2] = NO_C2
        self.rest[VOIDED] = 0.0
        self.rest[EMPTIED] = 0.0

    def add_redistributed(self, least_c2: float, voided: int) -> None:
        """Take in the cells that redistribution has changed: their least c², voids gained."""
        self._sums = None
        self.rest[LEAST_C2] = min(self.rest[LEAST_C2], least_c2)
        self.rest[VOIDED] += voided

    def add_source(self, gained: np.ndarray, has_polygons: bool) -> None:
        """Add momentum x, y and energy (3,) of a body source after the update.

        has_polygons: whether polygon cells have written their part of this step before.
        """
        self._sums = None
        if not has_polygons:
            self.rest[CONSERVED] = 0.0
        self.rest[MOMENTUM_AND_ENERGY] += gained

    def sum_up(self) -> bool:
        """Sum the tiles; returns whether the state is valid.  See `sum_tiles`."""
        is_valid = sum_tiles(self.rows, self.array)
        self.read_array()
        return is_valid

    def read_array(self) -> None:
        """Read the sums from `array`, where a kernel or another rank has written them."""
        self._sums = Sums(*self.array.tolist())

    @property
    def sums(self) -> Sums:
        """The sums in the last step."""
        if self._sums is None:
            self.sum_up()
            assert self._sums is not None
        return self._sums

    def find_lost(self) -> list[str]:
        """Names of the conserved quantities whose sums are not finite numbers."""
        names = np.array(("mass", "momentum x", "momentum y", "energy"))
        return list(names[~np.isfinite(self.rows[:, CONSERVED]).all(axis=0)])
