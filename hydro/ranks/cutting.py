"""Which blocks are cut among ranks, and where: bands of whole rows of tiles.

A block is cut in its update alone; one of its ranks, its home, regrids all of it.  A step regrids
all blocks before it updates any, so that the two are shared out each by itself: the update as
evenly as rows of tiles can be, and homes to the ranks that have the least to regrid.  Any map gives
the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import NamedTuple

from hydro.interior.advance import TILE_ROWS

MOST_UNCUT = 1.2  # times a rank's fair share: a block of more is cut


class Piece(NamedTuple):
    """Rows first..last - 1 of cells of the block of this number."""

    number: int
    first: int
    last: int


class Shares(NamedTuple):
    """The ranks of each block, its home first, and the bounds of their bands, as rows of cells."""

    places: list[tuple[int, ...]]
    bounds: list[tuple[int, ...]]


def count_tile_rows(ni: int) -> int:
    """Rows of tiles that a block of ni rows of cells has: so many ranks may share it."""
    return -(-ni // TILE_ROWS)


def spread_evenly(tile_rows: int, bands: int) -> list[int]:
    """Rows of tiles in each of so many bands; the first have one more where it does not come out.

    Raises ValueError for more bands than rows, or none.
    """
    if not 1 <= bands <= tile_rows:
        raise ValueError(f"{tile_rows} rows of tiles cannot make {bands} bands")
    return [tile_rows // bands + (n < tile_rows % bands) for n in range(bands)]


def find_bounds(ni: int, tile_rows: Sequence[int]) -> tuple[int, ...]:
    """Bounds of the bands of a block of ni rows of cells that have so many rows of tiles."""
    return (0, *(min(ni, TILE_ROWS * stop) for stop in accumulate(tile_rows)))


def share_blocks(
    cells: Sequence[tuple[int, int]],
    ranks: int,
    wanted: Mapping[int, int] | None = None,
    whole: Sequence[int] = (),
) -> Shares:
    """Share blocks of these numbers of cells (ni, nj) among ranks, the largest block first.

    wanted: by a block's number, among how many ranks it is to be cut at most; a block that is not
    named is cut where it has more cells than MOST_UNCUT of a rank's fair share.  whole: numbers of
    blocks that cannot be cut.  Blocks of one size go in their order, ranks of one load likewise.
    Raises ValueError for fewer than one rank.
    """
    if ranks < 1:
        raise ValueError(f"{ranks} ranks; one at least is needed")
    sizes = [ni * nj for ni, nj in cells]
    fair, wanted = sum(sizes) / ranks, wanted or {}
    loads, homes = [0.0] * ranks, [0.0] * ranks
    places: list[tuple[int, ...]] = [(0,)] * len(cells)
    bounds: list[tuple[int, ...]] = [(0, ni) for ni, _ in cells]
    for number in sorted(range(len(cells)), key=lambda n: (-sizes[n], n)):
        size, rows = sizes[number], count_tile_rows(cells[number][0])
        order = sorted(range(ranks), key=lambda r: (loads[r], r))
        bands = 1 if number in whole else min(wanted.get(number, rows), rows, ranks)
        if number in wanted or bands == 1:
            taken = spread_evenly(rows, bands)
        elif size > MOST_UNCUT * fair:
            taken = _fill_up(rows, size / rows, [fair - loads[r] for r in order])
        else:
            taken = [rows]
        there = order[: len(taken)]
        home = min(range(len(there)), key=lambda k: (homes[there[k]], k))
        for listed in (there, taken):
            listed.insert(0, listed.pop(home))
        homes[there[0]] += size
        places[number] = tuple(there)
        bounds[number] = find_bounds(cells[number][0], taken)
        for k, rank in enumerate(there):
            first, last = bounds[number][k : k + 2]
            loads[rank] += (last - first) * cells[number][1]
    return Shares(places, bounds)


def _fill_up(rows: int, size: float, room: Sequence[float]) -> list[int]:
    """Rows of tiles for ranks that have `room` for cells, most first; a row has `size` cells.

    As few ranks as have room; what is left over goes to them one by one.
    """
    taken: list[int] = []
    left = rows
    for space in room:
        count = min(left, max(round(space / size), 0))
        if left == 0 or (count == 0 and taken):
            break
        taken.append(max(count, 1))
        left -= taken[-1]
    for extra in range(left):
        taken[extra % len(taken)] += 1
    return taken


def sum_cells(cells: Sequence[tuple[int, int]], shares: Shares, ranks: int) -> list[int]:
    """Cells that each rank updates."""
    loads = [0] * ranks
    for (_, nj), there, rows in zip(cells, shares.places, shares.bounds, strict=True):
        for rank, first, last in zip(there, rows, rows[1:], strict=False):
            loads[rank] += (last - first) * nj
    return loads
