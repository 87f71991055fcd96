"""Which rank computes which blocks, in words: before a run and in its log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shockgrid.hydro.interior.advance import TILE_ROWS
from shockgrid.hydro.ranks.cutting import Distribution, distribute_blocks, sum_cells
from shockgrid.hydro.ranks.messages import CELLS_DEEP
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.memory import estimate_memory
from shockgrid.regrid.errors import BadInput, suggest


def check_cut(cut: Mapping[str, int], names: Sequence[str]) -> None:
    """Raise BadInput where `run.cut` of a deck names a block that there is not."""
    for name in cut:
        if name not in names:
            raise BadInput(f"deck: run.cut: there is no block {name!r}{suggest(name, names)}")


def distribute_named_blocks(
    blocks: Sequence[tuple[str, Sequence[int]]],
    ranks: int,
    cut: Mapping[str, int],
    whole: bool = False,
) -> Distribution:
    """Share blocks, given as names and cells (ni, nj), among ranks; whole: none can be cut.

    Raises BadInput where `cut` names a block that there is not.
    """
    names = [name for name, _ in blocks]
    check_cut(cut, names)
    wanted = {names.index(name): count for name, count in cut.items()}
    cells = [(int(ni), int(nj)) for _, (ni, nj) in blocks]
    return distribute_blocks(cells, ranks, wanted, range(len(cells)) if whole else ())


def distribute_evolution(evolution: Simulation, ranks: int, cut: Mapping[str, int]) -> Distribution:
    """Share the blocks of a flow among ranks; those that a body source acts on are not cut.

    What a source adds is summed over whole blocks.  Raises BadInput as `distribute_named_blocks`.
    """
    blocks = [(block.name, (block.ni, block.nj)) for block in evolution.blocks]
    return distribute_named_blocks(blocks, ranks, cut, evolution.flow.source.function is not None)


MOST_NAMED_RANKS = 8  # ranks that are told one by one


def describe_map(
    blocks: Sequence[tuple[str, Sequence[int]]], ranks: int, cut: Mapping[str, int]
) -> list[str]:
    """Lines on how `ranks` ranks share blocks, given as names and cells (ni, nj): who has which,
    memory of each, the greatest speed-up: that of the cells alone, with nothing else to do and
    nobody to wait for.  cut: as in a deck's `run`.
    """
    cells = [(int(ni), int(nj)) for _, (ni, nj) in blocks]
    shares = distribute_named_blocks(blocks, ranks, cut)
    loads = sum_cells(cells, shares, ranks)
    total = sum(loads)
    pieces = name_pieces([name for name, _ in blocks], shares, ranks)
    lines = []
    memories = estimate_memories(cells, shares, ranks)
    for rank in range(min(ranks, MOST_NAMED_RANKS)):
        memory = memories[rank] / 1e6
        names = ", ".join(pieces[rank]) or "nothing"
        lines.append(f"rank {rank}: {names}; {loads[rank]} cells, about {memory:.0f} MB")
    if ranks > MOST_NAMED_RANKS:
        lines.append(f"and {ranks - MOST_NAMED_RANKS} more ranks")
    advice = ""
    idle = loads.count(0)
    if idle:
        advice = (
            f"; {idle} of {ranks} ranks would have nothing to do: blocks are cut between rows of "
            f"tiles, {TILE_ROWS} rows of cells each"
        )
    lines += [
        f"memory of all ranks about {sum(memories) / 1e6:.0f} MB",
        f"at most {total / max(loads):.3g} times as fast as one rank{advice}",
    ]
    return lines


def estimate_memories(
    cells: Sequence[tuple[int, int]], shares: Distribution, ranks: int
) -> list[float]:
    """Bytes that each rank takes at its peak, of blocks with these cells (ni, nj).

    The first rank and the owner of a cut block have whole blocks; the others their bands and the
    rows along the sides of all.
    """
    ring = sum(
        ni * nj - max(ni - 2 * CELLS_DEEP, 0) * max(nj - 2 * CELLS_DEEP, 0) for ni, nj in cells
    )
    held: list[list[int]] = [[ring] for _ in range(ranks)]
    held[0] = [ni * nj for ni, nj in cells]
    for (ni, nj), there, bounds in zip(cells, shares.places, shares.bounds, strict=True):
        for number, rank in enumerate(there):
            rows = ni if number == 0 else bounds[number + 1] - bounds[number]
            if rank > 0:
                held[rank].append(rows * nj)
    return [estimate_memory(sum(blocks), blocks) for blocks in held]


def describe_distribution(names: Sequence[str], shares: Distribution, ranks: int) -> str:
    """One line for run.log, of blocks with these names."""
    pieces = name_pieces(names, shares, ranks)
    lists = [f"{rank}: {', '.join(pieces[rank]) or '-'}" for rank in range(ranks)]
    return f"shared by {ranks} ranks of MPI; blocks of rank {'; '.join(lists)}"


def name_pieces(names: Sequence[str], shares: Distribution, ranks: int) -> list[list[str]]:
    """What each rank updates, in words: blocks, and rows of those that are cut."""
    pieces: list[list[str]] = [[] for _ in range(ranks)]
    for name, there, bounds in zip(names, shares.places, shares.bounds, strict=True):
        for number, rank in enumerate(there):
            rows = f"rows {bounds[number]}-{bounds[number + 1] - 1} of "
            home = ", which regrids it" if number == 0 else ""
            pieces[rank].append(name if len(there) == 1 else f"{rows}{name!r}{home}")
    return pieces
