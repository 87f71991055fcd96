"""Squeezed cells of a block that is cut among ranks: what its home needs of the others' rows."""

from __future__ import annotations

import numpy as np

from hydro.block import Block
from hydro.ranks.cut_block import CutBlock
from hydro.small_cells.rates import choose_bin, count_crowding, keep_bin, scan_rates
from hydro.small_cells.redistribution import MOST_REACH

TOUCHED_REACH = MOST_REACH + 1  # rows beyond a squeezed cell that its redistribution reads


def get_read(block: Block) -> tuple[np.ndarray, ...]:
    """The arrays that redistribution reads, besides those that it writes."""
    return block.rates, block.start, block.void_energy


def get_shared(block: Block) -> tuple[np.ndarray, ...]:
    """The arrays that redistribution mends."""
    return block.state_new, block.void_energy_new, block.rates_new


def find_most_crowded_of_bands(
    cut: CutBlock, share: float, far_out: float, counts: np.ndarray, kept: np.ndarray
) -> float:
    """`rates.find_most_crowded` of all bands of a block, the same on all of its ranks.

    counts (BINS,), kept (cells,): scratch.
    """
    block = cut.block
    crowding = block.crowding[slice(*cut.band)]
    count_crowding(crowding, counts)
    every = np.sum(cut.group.allgather(counts), axis=0)
    bin, rank, low = choose_bin(every, block.ni * block.nj, share, far_out)
    if bin < 0:
        return np.inf
    if rank < 0:
        return far_out * low
    size = keep_bin(crowding, bin, kept)
    found = np.concatenate(cut.group.allgather(kept[:size].copy()))
    return far_out * float(np.sort(found)[rank])


def scan_rates_of_bands(cut: CutBlock, most_crowded: float) -> tuple[float, int, int, float]:
    """`rates.scan_rates` of the new state of all bands of a block, the same on all of its ranks."""
    block, (first, last) = cut.block, cut.band
    rate, i, j, bulk = scan_rates(
        block.rates_new[first:last], block.crowding[first:last], most_crowded
    )
    found = cut.group.allgather((rate, first + i, j, bulk))
    most = max(found, key=lambda band: band[0])  # the first of them, as in the whole block
    return *most[:3], max(band[3] for band in found)
