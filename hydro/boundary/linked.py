"""Segments with a segment on the far side: interface, sliding contact, seam, periodic.

What lies between the two is the link's: `hydro.links.link`, `hydro.sliding.contact`.
"""

from __future__ import annotations

from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.perimeter.contacts import fill_ghosts_from_faces


class Linked(Segment):
    """Segment with another block's (or its own block's) segment on the far side.

    Ghosts, contact states and fluxes are the link's.
    """

    linked = True


class Interface(Linked):
    """Contact of two materials with matching nodes: a grid line that both blocks share.

    tension: surface tension [N/m], `hydro.motion.tension`.
    """

    kind = "interface"
    motion = NodeMotion.FLOW

    def __init__(self, block, side, start, stop, tension=0.0):
        super().__init__(block, side, start, stop)
        self.tension = self.check_tension(tension)


class Sliding(Linked):
    """One side of a sliding contact, or a part of one; its nodes match nobody's.

    The master's side moves with the contact, the slave's follows.
    """

    kind = "sliding"
    motion = NodeMotion.FLOW

    def fill_ghosts(self, t):
        fill_ghosts_from_faces(self.block.rim.rows, self.spans)


class Seam(Linked):
    """Cut between blocks of one material: material and grid lines pass through."""

    kind = "seam"
    motion = NodeMotion.JOIN
    ends_flow = True


class Periodic(Seam):
    """Seam to the opposite side of the domain, one period away."""

    kind = "periodic"
    ends_flow = False
