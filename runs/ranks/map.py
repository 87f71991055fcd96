"""Which rank computes which blocks, in words: before a run and in its log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hydro.interior.advance import TILE_ROWS
from hydro.ranks.cutting import Shares, sum_cells
from problems.size import estimate_memory
from runs.ranks.sharing import share_named_blocks

MOST_NAMED = 8  # ranks that are told one by one


def describe_map(
    blocks: Sequence[tuple[str, Sequence[int]]], ranks: int, cut: Mapping[str, int]
) -> list[str]:
    """Lines on how `ranks` ranks share blocks, given as names and cells (ni, nj): who has which,
    memory of each, how much faster than one.  cut: as in a deck's `run`.

    The first rank has all blocks in its memory, for the files.  The speed-up is that of the cells
    alone, with nothing else to do and nobody to wait for: no run is faster.
    """
    cells = [(int(ni), int(nj)) for _, (ni, nj) in blocks]
    shares = share_named_blocks(blocks, ranks, cut)
    loads = sum_cells(cells, shares, ranks)
    total, pieces = sum(loads), name_pieces([name for name, _ in blocks], shares, ranks)
    lines = []
    for rank in range(min(ranks, MOST_NAMED)):
        memory = estimate_memory(total if rank == 0 else loads[rank]) / 1e6
        words = ", ".join(pieces[rank]) or "nothing"
        lines.append(f"rank {rank}: {words}; {loads[rank]} cells, about {memory:.0f} MB")
    if ranks > MOST_NAMED:
        lines.append(f"and {ranks - MOST_NAMED} more ranks")
    lines.append(f"at most {total / max(loads):.3g} times as fast as one rank{_advise(loads)}")
    return lines


def _advise(loads: Sequence[int]) -> str:
    idle = sum(load == 0 for load in loads)
    if idle:
        return (
            f"; {idle} of {len(loads)} ranks would have nothing to do: blocks are cut between "
            f"rows of tiles, {TILE_ROWS} rows of cells each"
        )
    return ""


def describe_shares(names: Sequence[str], shares: Shares, ranks: int) -> str:
    """One line for run.log, of blocks with these names."""
    pieces = name_pieces(names, shares, ranks)
    words = [f"{rank}: {', '.join(pieces[rank]) or '-'}" for rank in range(ranks)]
    return f"shared by {ranks} ranks of MPI; blocks of rank {'; '.join(words)}"


def name_pieces(names: Sequence[str], shares: Shares, ranks: int) -> list[list[str]]:
    """What each rank updates, in words: blocks, and rows of those that are cut."""
    pieces: list[list[str]] = [[] for _ in range(ranks)]
    for name, there, bounds in zip(names, shares.places, shares.bounds, strict=True):
        for number, rank in enumerate(there):
            rows = f"rows {bounds[number]}-{bounds[number + 1] - 1} of "
            home = ", which regrids it" if number == 0 else ""
            pieces[rank].append(name if len(there) == 1 else f"{rows}{name!r}{home}")
    return pieces
