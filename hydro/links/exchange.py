"""The one place through which anything passes between blocks.

A link joins two segments face by face.  What one sends the other finds in its own numbering of
faces; nothing else of the partner is ever touched, so that a block could live in another process if
`swap` and `swap_lines` sent their messages instead of copying them.  A sliding contact
(`hydro.sliding.contact`) joins lines whose nodes do not match: both sides send it their rows and
lines, it sends back contact states, fluxes and the slave's nodes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hydro.sliding.contact import SlidingContact
from regrid.errors import BadInput

if TYPE_CHECKING:
    from hydro.block import Block
    from hydro.boundary.segment import Linked

Place = tuple["Block", str] | tuple["Block", str, int, int]


class Link:
    """Two linked segments, `leader` and `follower`, and how their nodes correspond.

    The follower's nodes, in reverse order when `reverse`, are the leader's plus `shift`.
    """

    def __init__(self, leader: Linked, follower: Linked):
        self.leader, self.follower = leader, follower
        self.segments = [leader, follower]
        one, two = leader.line(leader.block.nodes), follower.line(follower.block.nodes)
        if one.shape != two.shape:
            raise BadInput(
                f"{leader.kind}: {leader} has {one.shape[1] - 1} faces and {follower} has "
                f"{two.shape[1] - 1}; they must be as many"
            )
        misses = [_misfit(one, two[:, ::order], leader.kind == "periodic") for order in (1, -1)]
        self.reverse = misses[1][0] < misses[0][0]
        miss, self.shift = misses[self.reverse]
        if miss > 1e-9:
            raise BadInput(
                f"{leader.kind}: nodes of {leader} and of {follower} do not match "
                f"(they are up to {miss:.1e} of the segment's length apart)"
            )
        follower.leads = False
        leader.partner_law = follower.block.wave_law
        follower.partner_law = leader.block.wave_law
        # make matching nodes the same to the last bit
        two[...] = self.to_follower(one)

    def to_follower(self, line: np.ndarray) -> np.ndarray:
        """Nodes of the leader's line as the follower has them."""
        return (line + self.shift[:, None])[:, :: -1 if self.reverse else 1]

    def swap(self, name: str) -> None:
        """Each side's rows of the block array `name` into the other's inbox."""
        order = -1 if self.reverse else 1
        for sender, receiver in ((self.leader, self.follower), (self.follower, self.leader)):
            message = getattr(sender.block, name)[:, sender.first : sender.last]
            receiver.inbox[: message.shape[0], receiver.first : receiver.last] = message[:, ::order]

    def swap_line(self) -> None:
        """The leader's new nodes become the follower's."""
        line = self.leader.line(self.leader.block.nodes_new)
        self.follower.line(self.follower.block.nodes_new)[...] = self.to_follower(line)


def _misfit(one: np.ndarray, two: np.ndarray, periodic: bool) -> tuple[float, np.ndarray]:
    """Largest distance of matching nodes over the line's size, and the shift between them."""
    difference = two - one
    shift = difference.mean(axis=1) if periodic else np.zeros(2)
    size = np.ptp(one, axis=1).max()
    return float(np.abs(difference - shift[:, None]).max() / size), shift


class Exchange:
    """All links and sliding contacts of a simulation."""

    def __init__(self, links: list[Link | SlidingContact]):
        self.links = [link for link in links if isinstance(link, Link)]
        self.contacts = [link for link in links if isinstance(link, SlidingContact)]

    def start(self) -> None:
        """What sliding contacts must know of the grid of the step's start."""
        for contact in self.contacts:
            contact.cut()

    def swap(self, name: str) -> None:
        """Exchange the rows of a perimeter array ("cells" or "traces") over every link."""
        for link in self.links:
            link.swap(name)

    def solve(self, name: str) -> None:
        """Contact states of sliding contacts from the perimeter array `name`, on the old grid."""
        for contact in self.contacts:
            contact.solve(name)

    def fill_flux(self, dt: float) -> None:
        """Fluxes through sliding contacts, both grids being known."""
        for contact in self.contacts:
            contact.fill_flux(dt)

    def swap_lines(self) -> None:
        """Give every follower the new nodes of its leader's line."""
        for link in self.links:
            link.swap_line()

    def accept(self) -> None:
        """The step stands."""
        for contact in self.contacts:
            contact.accept()


def join(kind: str, leader: Place, follower: Place) -> Link:
    """Link two places (block, side[, start, stop]) by segments of a linked kind.

    Nodes must match (up to a shift for "periodic"), in either order; raises BadInput otherwise.
    """
    pair = []
    for place in (leader, follower):
        block, side, *faces = place
        pair.append(block.put(side, kind, *faces))
    if not pair[0].linked:
        raise BadInput(f"segments of kind {kind!r} cannot be joined; use `Block.put`")
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
        chains.append([block.put(side, "sliding", *faces) for block, side, *faces in places])
    return SlidingContact(*chains)
