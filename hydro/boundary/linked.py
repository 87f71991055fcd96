"""Segments with a segment on the far side: interface, sliding contact, seam, periodic."""

from __future__ import annotations

import numpy as np

from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.perimeter.contact_states import fill_contact
from hydro.perimeter.ghosts import fill_ghosts_from_face
from hydro.perimeter.layer_flux import add_layer_flux
from hydro.perimeter.rows import (
    AT_FACE,
    CELL_C,
    CELL_LENGTH,
    CELL_ROWS,
    GHOST_LENGTH,
    TRACE_C,
    TRACE_ROWS,
)
from hydro.rows import STATE_ROWS


class Linked(Segment):
    """Segment with another block's (or its own block's) segment on the far side.

    `inbox` holds, in this block's numbering of faces, what the partner sent last;
    `leads` marks the left one of the pair.  Filled by `hydro.links.exchange`.
    """

    linked = True

    def __init__(self, block, side, start, stop):
        super().__init__(block, side, start, stop)
        self.inbox = np.ones((max(CELL_ROWS, TRACE_ROWS), block.traces.shape[1]))
        self.partner_law = block.wave_law
        self.leads = True


class Interface(Linked):
    """Contact of two materials with matching nodes: a grid line that both blocks share."""

    kind = "interface"
    motion = NodeMotion.FLOW
    layer: tuple[np.ndarray, bool, bool] | None = None  # of a smoothed line: see `add_layer_flux`

    def _fill(self, source, other, row):
        block = self.block
        fill_contact(
            source, row, block.wave_law, other, row, self.partner_law, self.leads,
            block.faces, self.first, self.last, block.surface,
        )  # fmt: skip

    def fill_ghosts(self, t):
        block = self.block
        self._fill(block.cells[AT_FACE], self.inbox[AT_FACE], CELL_C)
        fill_ghosts_from_face(
            block.cells, block.faces, block.surface, self.first, self.last, block.ghosts
        )

    def fill_speeds(self, t):
        self._fill(self.block.traces, self.inbox, TRACE_C)

    def fill_flux(self, t):
        block = self.block
        self._fill(block.traces, self.inbox, TRACE_C)
        block.fill_material_flux(self.spans)
        if self.layer is not None:
            add_layer_flux(block.traces, block.areas, *self.layer, self.first, block.flux)


class Sliding(Linked):
    """One side of a sliding contact, or a part of one; its nodes match nobody's.

    `hydro.sliding.contact` writes its surface states and fluxes.  The master's side (`leads`) moves
    with the contact, the slave's follows.
    """

    kind = "sliding"
    motion = NodeMotion.FLOW

    def fill_ghosts(self, t):
        block = self.block
        fill_ghosts_from_face(
            block.cells, block.faces, block.surface, self.first, self.last, block.ghosts
        )

    def fill_flux(self, t):
        """Nothing: the contact has written it."""


class Seam(Linked):
    """Cut between blocks of one material: material and grid lines pass through."""

    kind = "seam"
    motion = NodeMotion.JOIN
    ends_flow = True

    def fill_ghosts(self, t):
        block, span = self.block, slice(self.first, self.last)
        block.ghosts[:STATE_ROWS, span] = self.inbox[:STATE_ROWS, span]
        block.ghosts[GHOST_LENGTH, span] = self.inbox[CELL_LENGTH, span]

    def fill_flux(self, t):
        block = self.block
        block.fill_through_flux(self.inbox, self.leads, self.first, self.last)


class Periodic(Seam):
    """Seam to the opposite side of the domain, one period away."""

    kind = "periodic"
    ends_flow = False
