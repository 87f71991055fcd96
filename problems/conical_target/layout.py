"""Blocks of `conical-target` and how they touch: shared nodes, or lines that slide on each other.

The shell's front may be a disc that leaves a ring of lead at the impactor (`cover` less than
`radius`), or close the shell.  Of a sliding pair lead and graphite carry the line and steel
follows; on the cone's side lead carries it, at the impact face the impactor follows.  So where
materials meet on a line they are all on the side that carries it.  The trap: a corner of a block
is an end of two contacts; the one that moves it must be placed before the one that is laid on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hydro.boundary.registry import put
from hydro.links.join import join, slide
from problems.problem import BlockPlan

if TYPE_CHECKING:
    from hydro.block import Block
    from problems.conical_target.deck import ConicalTargetDeck
    from problems.conical_target.ripple import Ripple

LEAST_CELLS = 4  # through a part
MATERIALS = {
    "impactor": "impactor", "front": "shell", "ring": "target", "cone": "filling",
    "beside": "target", "behind": "target", "side": "shell",
}  # fmt: skip


@dataclass(frozen=True)
class Counts:
    """Cells of the parts: along the radius up to `shell`, along the axis the others."""

    within: int  # from the axis to the cone's edge
    covered: int  # from there to the rim of the shell's front
    ring: int  # from there to the shell's side; 0 where the front closes the shell
    shell: int
    impactor: int
    front: int
    along: int  # the cone
    behind: int

    @property
    def inside(self) -> int:
        """From the axis to the shell's side."""
        return self.within + self.covered + self.ring


class Layout:
    """Sizes, nodes and contacts of the blocks."""

    def __init__(self, deck: ConicalTargetDeck, ripple: Ripple | None = None):
        self.deck, self.ripple = deck, ripple
        self.open = deck.cover < deck.radius

    def count_cells(self, length: float) -> int:
        """Cells along a part of that length [m], square ones where it is not very short."""
        return max(LEAST_CELLS, round(length * self.deck.cells / self.deck.radius))

    def count_parts(self) -> Counts:
        """Cells along the parts of the set-up that the deck's resolution asks for."""
        deck, count = self.deck, self.count_cells
        within = count(deck.base)
        ring = count(deck.radius - deck.cover) if self.open else 0
        return Counts(
            within,
            max(LEAST_CELLS, deck.cells - within - ring),
            ring,
            count(deck.side),
            count(deck.thickness),
            count(deck.front),
            count(deck.cone),
            count(deck.length - deck.cone),
        )

    def plan(self) -> list[BlockPlan]:
        """Sizes of the blocks."""
        deck, parts = self.deck, self.count_parts()
        after, end = deck.front + deck.cone, deck.front + deck.length
        outer, wide = deck.radius + deck.side, parts.inside + parts.shell
        beside = parts.covered + parts.ring
        rim = (parts.within + parts.covered, deck.cover) if self.open else (wide, outer)
        start, rows = (0.0, parts.front) if self.open else (deck.front, 0)
        plans = {
            "impactor": ((parts.impactor, wide), (-deck.thickness, 0.0), (0.0, outer)),
            "front": ((parts.front, rim[0]), (0.0, 0.0), (deck.front, rim[1])),
            "ring": ((parts.front, parts.ring), (0.0, deck.cover), (deck.front, deck.radius)),
            "cone": ((parts.along, parts.within), (deck.front, 0.0), (after, deck.base)),
            "beside": ((parts.along, beside), (deck.front, deck.tip), (after, deck.radius)),
            "behind": ((parts.behind, parts.within + beside), (after, 0.0), (end, deck.radius)),
            "side": (
                (rows + parts.along + parts.behind, parts.shell),
                (start, deck.radius),
                (end, outer),
            ),
        }
        if not self.open:
            del plans["ring"]
        return [BlockPlan(name, *plan) for name, plan in plans.items()]

    def make_nodes(self) -> dict[str, np.ndarray]:
        """Nodes of the blocks at the impact."""
        deck, parts = self.deck, self.count_parts()
        part = np.linspace(0, 1, parts.within + 1)
        rim = (min(deck.cover, deck.radius) - deck.base) / (deck.radius - deck.base)
        part_beside = np.linspace(0, rim, parts.covered + 1)
        if self.open:
            part_beside = np.append(part_beside, np.linspace(rim, 1, parts.ring + 1)[1:])
        outside = np.linspace(deck.radius, deck.radius + deck.side, parts.shell + 1)

        def radii(split):
            return np.concatenate((split * part, (split + (deck.radius - split) * part_beside)[1:]))

        def box(x, r):
            return np.array(np.meshgrid(x, r, indexing="ij"))

        before = np.linspace(0.0, deck.front, parts.front + 1)
        along = np.linspace(deck.front, deck.front + deck.cone, parts.along + 1)
        behind = np.linspace(deck.front + deck.cone, deck.front + deck.length, parts.behind + 1)
        edge = deck.base + (deck.tip - deck.base) * ((along - deck.front) / deck.cone)[:, None]
        whole = np.concatenate((radii(deck.base), outside[1:]))
        cut = parts.within + parts.covered if self.open else whole.size - 1
        line = np.array([along, edge[:, 0]])
        shift = self.ripple.compute_shift(line)[:, :, None] if self.ripple else np.zeros((2, 1, 1))
        wide = part_beside.size
        nodes = {
            "impactor": box(np.linspace(-deck.thickness, 0, parts.impactor + 1), whole),
            "front": box(before, whole[: cut + 1]),
            "ring": box(before, whole[cut : parts.inside + 1]),
            "cone": np.array([np.repeat(along[:, None], part.size, 1), edge * part]) + shift * part,
            "beside": np.array(
                [np.repeat(along[:, None], wide, 1), edge + (deck.radius - edge) * part_beside]
            )
            + shift * (1.0 - part_beside),
            "behind": box(behind, radii(deck.tip)),
            "side": box(
                np.concatenate((before[:-1] if self.open else before[:0], along, behind[1:])),
                outside,
            ),
        }
        if not self.open:
            del nodes["ring"]
        return nodes

    def find_following(self) -> set[tuple[str, str]]:
        """Blocks and sides whose nodes are laid on the line of others."""
        sides = {
            "impactor": [("impactor", "i_max")],
            "front": [("front", "i_max"), *([("front", "j_max")] if self.open else [])],
            "side": [("side", "j_min")],
            "cone": [("cone", "j_max")],
        }
        contact = self.deck.contact
        chosen = (sides[name] for name in sides if getattr(contact, name) == "sliding")
        return {side for group in chosen for side in group}

    def connect(self, blocks: dict[str, Block]) -> list:
        """Links and contacts of all blocks, the walls, the axis and the free surface."""
        impactor, front, side = blocks["impactor"], blocks["front"], blocks["side"]
        cone, beside, behind = blocks["cone"], blocks["beside"], blocks["behind"]
        contact, parts = self.deck.contact, self.count_parts()
        inner, inside = parts.within, parts.inside
        cut = inner + parts.covered
        links = [join("seam", (beside, "i_max"), (behind, "i_min", inner, inside))]
        links += touch(contact.cone, [(beside, "j_min")], (cone, "j_max"))
        links += touch("joined", [(cone, "i_max")], (behind, "i_min", 0, inner))
        under = [(cone, "i_min"), (beside, "i_min", 0, parts.covered)]
        around = [(beside, "j_max"), (behind, "j_max")]
        face = [(front, "i_min")]
        if self.open:
            ring = blocks["ring"]
            links.append(join("seam", (ring, "i_max"), (beside, "i_min", parts.covered, None)))
            links += touch(contact.front, under, (front, "i_max"))
            links += touch(contact.front, [(ring, "j_min")], (front, "j_max"))
            around = [(ring, "j_max"), *around]
            face = [*face, (ring, "i_min"), (side, "i_min")]
        else:
            links.append(join("seam", (front, "i_max", cut, front.nj), (side, "i_min")))
            links += touch(contact.front, under, (front, "i_max", 0, cut))
        links += touch(contact.side, around, (side, "j_min"))
        links += touch(contact.impactor, face, (impactor, "i_max"))
        for block in (impactor, front, cone, behind):
            put(block, "j_min", "axis")
        for block in (impactor, side) if self.open else (impactor, front, side):
            put(block, "j_max", "wall")
        put(impactor, "i_min", "free-surface")
        put(behind, "i_max", "wall")
        put(side, "i_max", "wall")
        return links


def touch(how: str, carrying: list[tuple], following: tuple) -> list:
    """Links between places (block, side[, start, stop]) in order and the place along them all."""
    if how == "sliding":
        return [slide(carrying, following)]
    block, side, *span = following
    start = span[0] if span else 0
    links = []
    for faces in carrying:
        count = faces[3] - faces[2] if len(faces) > 2 else faces[0].side_faces(faces[1])[1]
        links.append(join("interface", faces, (block, side, start, start + count)))
        start += count
    return links
