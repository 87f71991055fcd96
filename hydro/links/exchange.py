"""The one place through which anything passes between blocks.

A link joins two segments face by face.  What one sends the other finds in its own numbering of
faces; nothing else of the partner is ever touched, so that a block could live in another process if
the swaps sent their messages instead of copying them.  A sliding contact
(`hydro.sliding.contact`) joins lines whose nodes do not match: both sides send it their rows and
lines, it sends back contact states, fluxes and the slave's nodes.
"""

from __future__ import annotations

from hydro.links.link import Link
from hydro.sliding.contact import SlidingContact


class Exchange:
    """All links and sliding contacts of a simulation."""

    def __init__(self, links: list[Link | SlidingContact]):
        self.links = [link for link in links if isinstance(link, Link)]
        self.contacts = [link for link in links if isinstance(link, SlidingContact)]

    def cut_contacts(self) -> None:
        """What sliding contacts must know of the grid of the step's start."""
        for contact in self.contacts:
            contact.cut()

    def swap_cells(self) -> None:
        """Every side gets the states of the cells across its links."""
        for link in self.links:
            link.swap(link.leader.block.cells, link.follower.block.cells)

    def swap_traces(self) -> None:
        """Every side gets the traces from across its links."""
        for link in self.links:
            link.swap(link.leader.block.traces, link.follower.block.traces)

    def solve_contacts_at_cells(self) -> None:
        """Contact states of sliding contacts from the cells beside them, on the old grid."""
        for contact in self.contacts:
            contact.solve_at_cells()

    def solve_contacts_at_traces(self) -> None:
        """Contact states of sliding contacts from the traces of both sides, on the old grid."""
        for contact in self.contacts:
            contact.solve_at_traces()

    def fill_contact_flux(self, dt: float) -> None:
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
