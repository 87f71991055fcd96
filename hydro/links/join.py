"""Joining blocks: `join` for lines with matching nodes, `slide` for sliding contacts."""

from __future__ import annotations

from typing import Any, cast

from hydro.block import Block
from hydro.boundary.kinds import Linked, Sliding
from hydro.boundary.registry import put
from hydro.links.link import Link
from hydro.sliding.contact import SlidingContact
from regrid.errors import BadInput

Faces = tuple[Block, str] | tuple[Block, str, int, int]


def join(kind: str, leader: Faces, follower: Faces, **options: Any) -> Link:
    """Link two runs of faces (block, side[, start, stop]) by segments of a linked kind.

    Nodes must match (up to a shift for "periodic"), in either order; raises BadInput otherwise.
    options: of the kind, such as `tension` [N/m] of an interface.
    """
    one, two = (
        put(block, side, kind, *faces, **options) for block, side, *faces in (leader, follower)
    )
    if not isinstance(one, Linked) or not isinstance(two, Linked):
        raise BadInput(f"segments of kind {kind!r} cannot be joined; use `put`")
    if kind == "sliding":
        raise BadInput("segments of kind 'sliding' are joined by `slide`, not by `join`")
    return Link(one, two)


def slide(master: Faces | list[Faces], slave: Faces | list[Faces]) -> SlidingContact:
    """A sliding contact between two runs of faces (block, side[, start, stop]), or lists.

    The slave's nodes lie on the master's line; the ends of the slave may lie anywhere on it.
    Raises BadInput where they do not.
    """
    chains = []
    for runs in (master, slave):
        runs = runs if isinstance(runs, list) else [runs]
        chain = [put(block, side, "sliding", *faces) for block, side, *faces in runs]
        chains.append(cast("list[Sliding]", chain))
    return SlidingContact(*chains)
