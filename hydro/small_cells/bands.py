"""Squeezed cells of a block that is cut among ranks: what its home needs of the others' rows."""

from __future__ import annotations

import numpy as np

from hydro.block import Block
from hydro.ranks.cut_block import CutBlock
from hydro.small_cells.rates import choose_bin, count_crowding, keep_bin
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
    table = np.empty((len(cut.bands), len(counts)), dtype=counts.dtype)
    cut.group.Allgather(counts, table)
    bin, rank, low = choose_bin(table.sum(axis=0), block.ni * block.nj, share, far_out)
    if bin < 0:
        return np.inf
    if rank < 0:
        return far_out * low
    size = keep_bin(crowding, bin, kept)
    found = np.concatenate(cut.group.allgather(kept[:size].copy()))
    return far_out * float(np.sort(found)[rank])
