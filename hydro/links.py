"""All exchange between blocks: links of matching lines, and sliding contacts in their order.

A link joins two segments face by face.  It solves the contact between them once and writes the
result into both rims; it changes nothing else in either block.  A sliding contact
(`hydro.sliding.contact`) joins lines whose nodes do not match.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import Linked, Sliding, put
from shockgrid.hydro.carried.fields import check_same
from shockgrid.hydro.eos.base import is_same_material
from shockgrid.hydro.perimeter.contacts import (
    AT_CELLS,
    AT_FLUX,
    AT_TRACES,
    pass_seam,
    solve_link,
)
from shockgrid.hydro.sliding.contact import SlidingContact
from shockgrid.hydro.strength.sides import stick_together
from shockgrid.regrid.errors import BadInput

# of the least of the cells' edges beside a link: nodes of both sides so near are one
LARGEST_CLOSED_GAP = 1e-4
# of the link's extent
ROUND_OFF_GAP = 1e-9
MOST_JOINED_NAMES = 3  # of materials in one label


class Link:
    """Two linked segments, `leader` and `follower`, and how their nodes correspond.

    The follower's nodes, in reverse order if `reverse`, are the leader's plus `shift`;
    `passes_mass`: material crosses from one block to the other.
    """

    def __init__(self, leader: Linked, follower: Linked):
        self.leader, self.follower = leader, follower
        self.segments = [leader, follower]
        _check_materials(leader, follower)
        leader_line = leader.line(leader.block.nodes)
        follower_line = follower.line(follower.block.nodes)
        if leader_line.shape != follower_line.shape:
            raise BadInput(
                f"{leader.kind}: {leader} has {leader_line.shape[1] - 1} faces and {follower} has "
                f"{follower_line.shape[1] - 1}; they must be as many, or be a "
                "sliding contact (slide)"
            )
        misfits = [
            _misfit(leader_line, follower_line[:, ::order], leader.is_shifted) for order in (1, -1)
        ]
        self.reverse = bool(misfits[1][0].max() < misfits[0][0].max())
        gaps, self.shift = misfits[self.reverse]
        worst = int(gaps.argmax())
        closed_gap = LARGEST_CLOSED_GAP * min(map(measure_least_cell, (leader, follower)))
        if gaps[worst] > max(closed_gap, ROUND_OFF_GAP * np.ptp(leader_line, axis=1).max()):
            x, y = leader_line[:, worst]
            raise BadInput(
                f"{leader.kind}: nodes of {leader} and of {follower} do not match: the largest gap "
                f"is {gaps[worst]:.3g} m at node {leader.start + worst}, ({x:.6g}, {y:.6g}); cut "
                f"both sides the same way, from the same points or formula (gaps of rounded "
                f"coordinates, up to {closed_gap:.1g} m, are closed)"
            )
        follower.has_own_line = False
        order = (follower.last - 1, -1) if self.reverse else (follower.first, 1)
        pairs = (leader.first, *order, leader.last - leader.first)
        self._rims = leader.block.rim.rows, follower.block.rim.rows, pairs
        self._wave_laws = leader.block.wave_law, follower.block.wave_law
        # set by `hydro.motion.sides`, for `add_layer_flux`: the velocities of the line's nodes
        # beside those of its contact, and whether the line is closed
        self.layer = np.empty((2, 0)), False
        self.passes_mass = leader.passes_mass
        # of solids that stick together: seams and bonds
        self._sticking: tuple | None = None
        leader_stress = leader.block.stress
        follower_stress = follower.block.stress
        if leader_stress is not None and follower_stress is not None and leader.sticks:
            self._sticking = (
                leader_stress.list_for_link(leader.block),
                follower_stress.list_for_link(follower.block),
                pairs,
            )
        # make matching nodes bitwise equal
        follower_line[...] = self.arrange_for_follower(leader_line)

    def arrange_for_follower(self, line: np.ndarray) -> np.ndarray:
        """Nodes of the leader's line in the follower's order and position."""
        return (line + self.shift[:, None])[:, :: -1 if self.reverse else 1]

    def solve(self, stage: int, dt: float) -> None:
        """Contact states of both sides in a stage of `hydro.perimeter.contacts`, with ghosts
        AT_CELLS and fluxes AT_FLUX; for a seam only these."""
        curved = self.leader.block.geometry.curved
        if not self.passes_mass:
            speeds, closed = self.layer
            layer = speeds, self.reverse, closed
            solve_link.entry(*self._rims, *self._wave_laws, layer, stage, curved)
        elif stage != AT_TRACES:
            pass_seam(*self._rims, stage, curved)
        if self._sticking is not None:
            one, other, pairs = self._sticking
            stick_together(one, other, pairs, stage, self.passes_mass, curved)

    def copy_line_to_follower(self) -> None:
        """Copy the leader's new nodes to the follower."""
        line = self.leader.line(self.leader.block.nodes_new)
        self.follower.line(self.follower.block.nodes_new)[...] = self.arrange_for_follower(line)


def _check_materials(leader: Linked, follower: Linked) -> None:
    """Raise BadInput where mass passes between two materials, and for bonds of what bears no
    shear."""
    leader_eos = leader.block.eos
    follower_eos = follower.block.eos
    is_bonded = leader.sticks and not leader.passes_mass
    for segment in (leader, follower):
        if is_bonded and segment.block.strength is None:
            raise BadInput(
                f"{leader.kind}: {leader} and {follower} are bonded, and the material of block "
                f"{segment.block.name!r} has no strength; only solids bear shear"
            )
    if leader.passes_mass and leader.block.strength != follower.block.strength:
        raise BadInput(
            f"{leader.kind}: material passes between {leader} and {follower}, and its strength "
            f"differs: {leader.block.strength} and {follower.block.strength}"
        )
    if leader.passes_mass and not is_same_material(leader_eos, follower_eos):
        raise BadInput(
            f"{leader.kind}: material passes between {leader} and {follower}, and their equations "
            f"of state differ: {leader_eos} and {follower_eos}; join two materials by an interface"
        )
    if leader.passes_mass:
        check_same(
            f"{leader.kind}: material passes between {leader} and {follower}",
            leader.block.carried_fields,
            follower.block.carried_fields,
        )


def measure_least_cell(segment: Linked) -> float:
    """The least edge [m] along a segment and across it; those that are points do not count."""
    nodes = segment.block.nodes
    within = nodes[:, 1:-1] if segment.side.startswith("i") else nodes[:, :, 1:-1]
    line = segment.line(nodes)
    edges = np.append(np.diff(line, axis=1), segment.line(within) - line, axis=1)
    lengths = np.hypot(*edges)
    return float(lengths[lengths > 0.0].min())


def _misfit(
    leader_line: np.ndarray, follower_line: np.ndarray, periodic: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Distances (n + 1,) [m] of matching nodes, and the shift between the lines."""
    difference = follower_line - leader_line
    shift = difference.mean(axis=1) if periodic else np.zeros(2)
    return np.hypot(*(difference - shift[:, None])), shift


class Exchange:
    """All links and sliding contacts of a simulation."""

    def __init__(self, links: list[Link | SlidingContact]):
        self.links = [link for link in links if isinstance(link, Link)]
        self.contacts = [link for link in links if isinstance(link, SlidingContact)]
        self.all: list[Any] = [*self.links, *self.contacts]

    def divide_contacts(self) -> None:
        """Prepare sliding contacts on the grid at the start of the step."""
        for contact in self.contacts:
            contact.divide_into_pieces()

    def fill_ghosts(self, t: float, dt: float) -> None:
        """Contact states from the cells on the old grid, with the ghosts that stand for them."""
        self._solve(AT_CELLS, dt)

    def fill_speeds(self, t: float, dt: float) -> None:
        """Contact states from the traces on the old grid, with which the lines move."""
        self._solve(AT_TRACES, dt)

    def fill_fluxes(self, t: float, dt: float) -> None:
        """Contact states from the traces between both grids, and the fluxes of both sides."""
        self._solve(AT_FLUX, dt)

    def _solve(self, stage: int, dt: float) -> None:
        for link in self.all:
            link.solve(stage, dt)

    def accept(self) -> None:
        """Accept the step."""
        for contact in self.contacts:
            contact.accept()


def name_materials(blocks: Sequence[Block], links: Sequence[Link | SlidingContact]) -> None:
    """Give one material's label to all blocks between which mass passes, as through seams.

    Blocks that bring several labels share these, joined by "+", so that the ledger keeps one
    balance of their mass.
    """
    numbers = {id(block): number for number, block in enumerate(blocks)}
    joined = [link for link in links if isinstance(link, Link) and link.passes_mass]
    leaders = [numbers[id(link.leader.block)] for link in joined]
    followers = [numbers[id(link.follower.block)] for link in joined]
    graph = coo_array((np.ones(len(joined)), (leaders, followers)), shape=(len(blocks),) * 2)
    count, bodies = connected_components(graph, directed=False)
    for body in range(count):
        members = [
            block
            for block, body_of_block in zip(blocks, bodies, strict=True)
            if body_of_block == body
        ]
        labels = list(dict.fromkeys(block.material for block in members))
        unnamed = len(labels) - MOST_JOINED_NAMES
        if unnamed > 0:
            labels[MOST_JOINED_NAMES:] = [f"{unnamed} more"]
        for block in members:
            block.material = "+".join(labels)


Faces = tuple[Block, str] | tuple[Block, str, int, int]


def join(kind: str, leader: Faces, follower: Faces, **options: Any) -> Link:
    """Link two runs of faces (block, side[, start, stop]) by segments of a linked kind.

    Nodes must match (up to a shift for "periodic") in either order; otherwise raises BadInput.
    options: options of the kind, such as `tension` [N/m] of an interface.
    """
    leader_segment, follower_segment = (
        put(block, side, kind, *faces, **options) for block, side, *faces in (leader, follower)
    )
    if not isinstance(leader_segment, Linked) or not isinstance(follower_segment, Linked):
        raise BadInput(f"segments of kind {kind!r} cannot be joined; use `put`")
    if leader_segment.is_sliding:
        raise BadInput("segments of kind 'sliding' are joined by `slide`, not by `join`")
    return Link(leader_segment, follower_segment)


def slide(leader: Faces | list[Faces], follower: Faces | list[Faces]) -> SlidingContact:
    """A sliding contact between two runs of faces (block, side[, start, stop]), or lists.

    The follower's nodes lie on the leader's line; the ends of the follower may lie anywhere on it.
    Raises BadInput otherwise.
    """
    chains = []
    for runs in (leader, follower):
        runs = runs if isinstance(runs, list) else [runs]
        chain = [put(block, side, "sliding", *faces) for block, side, *faces in runs]
        chains.append(cast("list[Sliding]", chain))
    return SlidingContact(*chains)
