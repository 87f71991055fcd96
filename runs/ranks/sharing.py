"""Which blocks of a run are cut among how many ranks: what the deck wants, and what can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hydro.ranks.cutting import Shares, share_blocks
from hydro.simulation import Simulation
from regrid.errors import BadInput, suggest


def check_cut(cut: Mapping[str, int], names: Sequence[str]) -> None:
    """Raise BadInput where `run.cut` of a deck names a block that there is not."""
    for name in cut:
        if name not in names:
            raise BadInput(f"deck: run.cut: there is no block {name!r}{suggest(name, names)}")


def share_named_blocks(
    blocks: Sequence[tuple[str, Sequence[int]]],
    ranks: int,
    cut: Mapping[str, int],
    whole: bool = False,
) -> Shares:
    """Share blocks, given as names and cells (ni, nj), among ranks; whole: none can be cut.

    Raises BadInput where `cut` names a block that there is not.
    """
    names = [name for name, _ in blocks]
    check_cut(cut, names)
    wanted = {names.index(name): count for name, count in cut.items()}
    cells = [(int(ni), int(nj)) for _, (ni, nj) in blocks]
    return share_blocks(cells, ranks, wanted, range(len(cells)) if whole else ())


def share_evolution(evolution: Simulation, ranks: int, cut: Mapping[str, int]) -> Shares:
    """Share the blocks of a flow among ranks; those that a body source acts on are not cut.

    What a source adds is summed over whole blocks.  Raises BadInput as `share_named_blocks`.
    """
    blocks = [(block.name, (block.ni, block.nj)) for block in evolution.blocks]
    return share_named_blocks(blocks, ranks, cut, evolution.flow.source.law is not None)
