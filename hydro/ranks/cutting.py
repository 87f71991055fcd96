"""Blocks that several ranks update: which are cut, where, and what their ranks tell each other.

A block is cut in its update alone, into bands of whole rows of tiles; the first of its ranks, its
owner, regrids all of it and has all of its nodes, sums and failures.  A step regrids all blocks
before it updates any, so that the two are shared out each by itself: the update as evenly as rows
of tiles can be, and homes to the ranks that have the least to regrid.

The others of a block's ranks have the rows of their band and GHOST_ROWS beyond it.  Rows travel
from array to array, as they lie in memory.  What hangs together across bands - squeezed cells that
share their states, the edge of crowding - is done by the owner with the rows that it concerns, so
that a cut changes no bit.

Note: all ranks of a block have to make the same calls, in the order of the blocks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.interior.advance import TILE_ROWS, count_tiles
from shockgrid.hydro.interior.update import sum_tiles

MOST_UNCUT = 1.2  # times a rank's fair share: a block of more is cut
GHOST_ROWS = 2  # of cells beyond a band, which its update reads
Rows = tuple[int, int]  # first, and the one after the last


class Piece(NamedTuple):
    """Rows first..last - 1 of cells of the block of this number."""

    number: int
    first: int
    last: int


class Distribution(NamedTuple):
    """The ranks of each block, its owner first, and the bounds of their bands, as rows of cells."""

    places: list[tuple[int, ...]]
    bounds: list[tuple[int, ...]]


def count_tile_rows(ni: int) -> int:
    """Rows of tiles that a block of ni rows of cells has: so many ranks may share it."""
    return -(-ni // TILE_ROWS)


def divide_evenly(tile_rows: int, bands: int) -> list[int]:
    """Rows of tiles in each of so many bands; the first have one more where it does not come out.

    Raises ValueError for more bands than rows, or none.
    """
    if not 1 <= bands <= tile_rows:
        raise ValueError(f"{tile_rows} rows of tiles cannot make {bands} bands")
    return [tile_rows // bands + (n < tile_rows % bands) for n in range(bands)]


def find_bounds(ni: int, tile_rows: Sequence[int]) -> tuple[int, ...]:
    """Bounds of the bands of a block of ni rows of cells that have so many rows of tiles."""
    return (0, *(min(ni, TILE_ROWS * stop) for stop in accumulate(tile_rows)))


def distribute_blocks(
    cells: Sequence[tuple[int, int]],
    ranks: int,
    wanted: Mapping[int, int] | None = None,
    whole: Sequence[int] = (),
) -> Distribution:
    """Share blocks of these numbers of cells (ni, nj) among ranks, the largest block first.

    wanted: by a block's number, among how many ranks it is to be cut at most; a block that is not
    named is cut where it has more cells than MOST_UNCUT of a rank's fair share.  whole: numbers of
    blocks that cannot be cut.  Blocks of one size go in their order, ranks of one load likewise.
    Raises ValueError for fewer than one rank.
    """
    if ranks < 1:
        raise ValueError(f"{ranks} ranks; one at least is needed")
    # cells that each rank has so far, and those of the blocks that it owns
    sizes = [ni * nj for ni, nj in cells]
    fair_share = sum(sizes) / ranks
    wanted = wanted or {}
    loads = [0.0] * ranks
    owned_cells = [0.0] * ranks
    places: list[tuple[int, ...]] = [(0,)] * len(cells)
    bounds: list[tuple[int, ...]] = [(0, ni) for ni, _ in cells]
    for number in sorted(range(len(cells)), key=lambda n: (-sizes[n], n)):
        size = sizes[number]
        rows = count_tile_rows(cells[number][0])
        # the largest block first, to the ranks with least to do
        order = sorted(range(ranks), key=lambda r: (loads[r], r))
        bands = 1 if number in whole else min(wanted.get(number, rows), rows, ranks)
        if number in wanted or bands == 1:
            tile_rows_of_bands = divide_evenly(rows, bands)
        elif size > MOST_UNCUT * fair_share:
            tile_rows_of_bands = _fill_up(rows, size / rows, [fair_share - loads[r] for r in order])
        else:
            tile_rows_of_bands = [rows]
        # its owner is the one that owns least
        sharers = order[: len(tile_rows_of_bands)]
        owner = min(range(len(sharers)), key=lambda k: (owned_cells[sharers[k]], k))
        for listed in (sharers, tile_rows_of_bands):
            listed.insert(0, listed.pop(owner))
        owned_cells[sharers[0]] += size
        places[number] = tuple(sharers)
        bounds[number] = find_bounds(cells[number][0], tile_rows_of_bands)
        for k, rank in enumerate(sharers):
            first, last = bounds[number][k : k + 2]
            loads[rank] += (last - first) * cells[number][1]
    return Distribution(places, bounds)


def _fill_up(rows: int, size: float, room: Sequence[float]) -> list[int]:
    """Rows of tiles for ranks that have `room` for cells, most first; a row has `size` cells.

    As few ranks as have room.  What is left over goes, row by row, to the one with most room left,
    and to a further one where this takes more than half a row from the largest load.
    """
    tile_rows_of_bands: list[int] = []
    rows_left = rows
    for space in room:
        count = min(rows_left, max(round(space / size), 0))
        if rows_left == 0 or (count == 0 and tile_rows_of_bands):
            break
        tile_rows_of_bands.append(max(count, 1))
        rows_left -= tile_rows_of_bands[-1]
    for _ in range(rows_left):
        room_left = [
            space - count * size for space, count in zip(room, tile_rows_of_bands, strict=False)
        ]
        emptiest = max(range(len(tile_rows_of_bands)), key=lambda k: (room_left[k], -k))
        if (
            len(tile_rows_of_bands) < len(room)
            and room[len(tile_rows_of_bands)] - room_left[emptiest] > 0.5 * size
        ):
            tile_rows_of_bands.append(1)
        else:
            tile_rows_of_bands[emptiest] += 1
    return tile_rows_of_bands


def sum_cells(cells: Sequence[tuple[int, int]], shares: Distribution, ranks: int) -> list[int]:
    """Cells that each rank updates."""
    loads = [0] * ranks
    for (_, nj), sharers, rows in zip(cells, shares.places, shares.bounds, strict=True):
        for rank, first, last in zip(sharers, rows, rows[1:], strict=False):
            loads[rank] += (last - first) * nj
    return loads


class CutBlock:
    """The part of a rank in a block that is cut.

    group: the communicator of the block's ranks alone, the owner first; bounds: of their bands.
    """

    def __init__(self, group: Any, block: Block, bounds: Sequence[int]):
        self.group = group
        self.block = block
        self.bands: list[Rows] = list(pairwise(bounds))
        self.is_owner = group.rank == 0
        self.band = self.bands[group.rank]

    # --- rows of arrays ------------------------------------------------------------------------

    def send_rows(self, array: np.ndarray, have: Sequence[Rows], need: Sequence[Rows]) -> None:
        """Give every rank the rows that it needs from the ranks that have them.

        array: (..., rows, columns), the same rows on all ranks; have, need: rows of each rank.
        """
        me = self.group.rank
        requests = []
        for tag, plane in enumerate(array.reshape(-1, *array.shape[-2:])):
            for other_rank in range(len(self.bands)):
                if other_rank == me:
                    continue
                first, last = _find_common(have[other_rank], need[me])
                if first < last:
                    requests.append(self.group.Irecv(plane[first:last], source=other_rank, tag=tag))
                first, last = _find_common(have[me], need[other_rank])
                if first < last:
                    requests.append(self.group.Isend(plane[first:last], dest=other_rank, tag=tag))
        for request in requests:
            request.Wait()

    def gather_rows(self, array: np.ndarray, rows: Rows | None = None) -> None:
        """Send the owner these rows, all of them if None, of an array (ni, nj) or of a state."""
        shift = self.block.count_ghosts(array)
        rows = (0, self.block.ni) if rows is None else rows
        self.send_rows(array, _shift(self.bands, shift), _shift(self._at_owner(rows), shift))

    def return_rows(self, array: np.ndarray, rows: Rows) -> None:
        """Return these rows of the owner to the ranks in whose bands they lie."""
        shift = self.block.count_ghosts(array)
        need = [_find_common(band, rows) for band in self.bands]
        need[0] = (0, 0)
        self.send_rows(array, _shift(self._at_owner(rows), shift), _shift(need, shift))

    def _at_owner(self, rows: Rows) -> list[Rows]:
        return [rows] + [(0, 0)] * (len(self.bands) - 1)

    # --- phases of a step ----------------------------------------------------------------------

    def bring_sound_speeds(self) -> None:
        """Send the owner the sound speeds of all cells at the start of the step."""
        if not self.is_owner:  # it computes its own when it regrids
            self.block.compute_sound_speed(self.block.start)
        self.gather_rows(self.block.rates_new)  # where they are computed

    def bring_fields(self) -> None:
        """Send the owner the states of all cells at the start of the step."""
        for array in self.block.list_starts(self.block.held_arrays):
            self.gather_rows(array)

    def send_nodes(self) -> None:
        """Give every rank the new nodes of its band, with those of its ghost rows."""
        ni = self.block.ni
        need = [(max(a - GHOST_ROWS, 0), min(b + GHOST_ROWS, ni) + 1) for a, b in self.bands]
        need[0] = (0, 0)
        self.send_rows(self.block.nodes_new, self._at_owner((0, ni + 1)), need)

    def exchange_ghost_rows(self) -> None:
        """Give every rank the new states of its ghost rows."""
        ni = self.block.ni
        block = self.block
        need = [(max(a - GHOST_ROWS, 0), min(b + GHOST_ROWS, ni)) for a, b in self.bands]
        for array in block.list_new(block.held_arrays):
            shift = block.count_ghosts(array)
            self.send_rows(array, _shift(self.bands, shift), _shift(need, shift))

    def bring_totals(self) -> None:
        """Send the owner the totals of all tiles."""
        totals = self.block.totals.rows
        nj = self.block.nj
        tiles = [(count_tiles(a, nj), count_tiles(b, nj)) for a, b in self.bands]
        self.send_rows(totals, tiles, self._at_owner((0, len(totals) - 1)))

    def bring_failed(self) -> None:
        """Send the owner the new states of all cells, where they are not admissible."""
        totals = self.block.totals
        is_valid = self.is_owner and sum_tiles(totals.rows, np.empty(totals.array.size))
        if not self.group.bcast(is_valid, root=0):
            self.gather_rows(self.block.state_new)

    # --- squeezed cells --------------------------------------------------------------------------

    def find_rows_above(self, limit: float, reach: int) -> Rows:
        """The rows from the first to the last that hold a rate above `limit`, `reach` more on
        either side; none, (0, 0), where there is no such rate."""
        first, last = self.band
        rows_found = np.flatnonzero((self.block.rates[first:last] > limit).any(axis=1)) + first
        own_range = (int(rows_found[0]), int(rows_found[-1])) if len(rows_found) else None
        rows = [row for pair in self.group.allgather(own_range) if pair for row in pair]
        if not rows:
            return 0, 0
        return max(min(rows) - reach, 0), min(max(rows) + reach + 1, self.block.ni)


def _find_common(rows: Rows, other_rows: Rows) -> Rows:
    return max(rows[0], other_rows[0]), min(rows[1], other_rows[1])


def _shift(rows: Sequence[Rows], by: int) -> list[Rows]:
    return [(first + by, last + by) for first, last in rows]
