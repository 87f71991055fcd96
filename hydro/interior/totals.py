"""What the tiles of a block add up to, and whether all of it can be."""

from __future__ import annotations

import numpy as np

from hydro.rows import LEAST_C2
from regrid.jit import kernel


@kernel
def sum_tiles(tile_totals, sums):
    """Sums (7,) of the rows of `tile_totals` (tiles, 7), columns as in `hydro.rows`; c² the least.

    Returns whether all are finite and the least c² is positive.
    """
    sums[:] = tile_totals[0]
    least = sums[LEAST_C2]
    positive = least > 0.0
    for tile in range(1, tile_totals.shape[0]):
        for q in range(sums.shape[0]):
            sums[q] += tile_totals[tile, q]
        c2 = tile_totals[tile, LEAST_C2]
        positive &= c2 > 0.0
        least = least if least < c2 else c2
    sums[LEAST_C2] = least
    for q in range(sums.shape[0]):
        positive &= np.isfinite(sums[q])
    return positive
