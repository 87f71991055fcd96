"""Joining blocks: `join` for lines with matching nodes, `slide` for sliding contacts."""

from __future__ import annotations

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.links.link import Link
from hydro.sliding.contact import SlidingContact
from regrid.errors import BadInput

Place = tuple[Block, str] | tuple[Block, str, int, int]


def join(kind: str, leader: Place, follower: Place) -> Link:
    """Link two places (block, side[, start, stop]) by segments of a linked kind.

    Nodes must match (up to a shift for "periodic"), in either order; raises BadInput otherwise.
    """
    pair = []
    for place in (leader, follower):
        block, side, *faces = place
        pair.append(put(block, side, kind, *faces))
    if not pair[0].linked:
        raise BadInput(f"segments of kind {kind!r} cannot be joined; use `put`")
    if kind == "sliding":
        raise BadInput("segments of kind 'sliding' are joined by `slide`, not by `join`")
    return Link(*pair)


def slide(master: Place | list[Place], slave: Place | list[Place]) -> SlidingContact:
    """A sliding contact between two places (block, side[, start, stop]), or lists of them in order.

    The slave's nodes lie on the master's line; the ends of the slave may lie anywhere on it.
    Raises BadInput where they do not.
    """
    chains = []
    for places in (master, slave):
        places = places if isinstance(places, list) else [places]
        chains.append([put(block, side, "sliding", *faces) for block, side, *faces in places])
    return SlidingContact(*chains)
