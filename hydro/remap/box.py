"""A flow whose blocks fill a rectangle, laid on one block of two materials.

Any number of blocks of two equations of state may do so, however they lie.  The sides of the new
block are those of the old ones: what bounds them along one side of the rectangle must be of one
kind.  `hydro.remap.merging` says what the new cells hold.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import Inflow, Piston, Segment, put
from shockgrid.hydro.eos.base import EquationOfState
from shockgrid.hydro.eos.mixture import SEEN_FIELDS, mix
from shockgrid.hydro.mixture.phases import make_fraction_fields
from shockgrid.hydro.remap.merging import Handover
from shockgrid.hydro.rows import RHO
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import SIDE_NAMES

ON_SIDE = 1e-9  # of the rectangle's size: nodes that lie on its side
KINDS = ("wall", "inflow", "outflow", "piston")  # of sides that a new block can have
# of a rectangle: the coordinate that is the same along a side, and whether it is the greatest
SIDES_OF_BOX = {"i_min": (0, False), "i_max": (0, True), "j_min": (1, False), "j_max": (1, True)}


class Material(NamedTuple):
    """One of the two: its equation of state, a usual density [kg/m3]."""

    eos: EquationOfState
    density: float
    labels: tuple[str, ...]  # of its blocks

    @property
    def name(self) -> str:
        """Its name in the history."""
        return "+".join(self.labels)


class Bound(NamedTuple):
    """What bounds a side: kind, options, and whether material of the first kind comes in."""

    kind: str
    options: dict[str, Any]
    part_of_first: float


def find_materials(blocks: Sequence[Block]) -> tuple[Material, Material]:
    """The two materials of blocks, the first block's first; blocks of one equation of state are of
    one material.

    Raises BadInput where there are not two, or where one of them has strength.
    """
    for block in blocks:
        if block.strength is not None:
            raise BadInput(
                f"block {block.name!r}: a solid cannot share cells with another material; leave "
                "handover out"
            )
    kinds = list(dict.fromkeys(block.eos for block in blocks))
    if len(kinds) != 2:
        raise BadInput(
            f"handover lays two materials on one grid, and there are {len(kinds)} equations of "
            "state here"
        )
    found = []
    for eos in kinds:
        own = [block for block in blocks if block.eos == eos]
        labels = tuple(dict.fromkeys(block.material for block in own))
        density = max(float(block.state[RHO, 1:-1, 1:-1].max()) for block in own)
        found.append(Material(eos, density, labels))
    return found[0], found[1]


def find_box(blocks: Sequence[Block]) -> tuple[np.ndarray, np.ndarray]:
    """The lower left and the upper right corner (2,) [m] of a rectangle around all blocks."""
    low = np.min([block.nodes.min(axis=(1, 2)) for block in blocks], axis=0)
    high = np.max([block.nodes.max(axis=(1, 2)) for block in blocks], axis=0)
    return low, high


def find_bounds_of_box(blocks: Sequence[Block], first: EquationOfState) -> dict[str, Bound]:
    """What bounds each side of the rectangle that the blocks fill.

    Raises BadInput where that is not of one kind, or of a kind that one block cannot have.
    """
    low, high = find_box(blocks)
    reach = ON_SIDE * float((high - low).max())
    found: dict[str, list[Bound]] = {name: [] for name in SIDE_NAMES}
    for block in blocks:
        for segment in block.segments:
            if segment.linked:
                continue
            side = _find_side(segment, (low, high), reach)
            if side is None or segment.kind not in KINDS:
                raise BadInput(
                    f"{segment}: handover lays blocks on one rectangle, whose sides are walls, "
                    "pistons or open; this side is none of them"
                )
            found[side].append(_describe_bound(segment, first))
    for side, bounds in found.items():
        kinds = {(bound.kind, str(bound.options)) for bound in bounds}
        if len(kinds) != 1:
            raise BadInput(
                f"handover: the side {side} of the rectangle around all blocks is bounded by "
                f"{len(kinds)} things; by one it must be"
            )
    return {side: bounds[0] for side, bounds in found.items()}


def _find_side(segment: Segment, box: tuple[np.ndarray, np.ndarray], reach: float) -> str | None:
    line = segment.line(segment.block.nodes)
    for name, (axis, is_high) in SIDES_OF_BOX.items():
        if np.abs(line[axis] - box[is_high][axis]).max() <= reach:
            return name
    return None


def _describe_bound(segment: Segment, first: EquationOfState) -> Bound:
    options: dict[str, Any] = {}
    if isinstance(segment, Piston):
        options = {"velocity": segment.velocity}
    elif isinstance(segment, Inflow):
        moves = any(segment.velocity(0.0))
        options = {"state": segment.state}
        options |= {"velocity": segment.velocity(0.0)} if moves else {}
    return Bound(segment.kind, options, float(segment.block.eos == first))


def make_box_nodes(blocks: Sequence[Block], size: float) -> np.ndarray:
    """Nodes (2, ni + 1, nj + 1) [m] of even cells of about that size in the rectangle."""
    low, high = find_box(blocks)
    lines = [
        np.linspace(start, end, max(1, round((end - start) / size)) + 1)
        for start, end in zip(low, high, strict=True)
    ]
    return np.array(np.meshgrid(*lines, indexing="ij"))


def make_box_handover(
    blocks: Sequence[Block],
    size: float,
    make_regridder: Callable[[], object] | None,
    time: float | None = None,
    name: str = "both",
) -> Handover:
    """When and how blocks that fill a rectangle become one with cells of about `size` [m].

    blocks: as they are at the start; time: from which on [s], None: when the flow cannot go on
    otherwise; name: of the new block.  Raises BadInput where that cannot be.
    """
    first, second = find_materials(blocks)
    names = first.name, second.name
    mixture = mix(first.eos, second.eos, (first.density, second.density), names)
    bounds = find_bounds_of_box(blocks, first.eos)
    limiter = blocks[0].limiter

    def assemble(nodes: np.ndarray, held: dict[str, Any]):
        state = [held[quantity] for quantity in ("rho", "u", "v", "p")]
        fields = make_fraction_fields(held["mass_fraction"], held["volume_fraction"])
        material = "+".join(names)
        block = Block(
            name, mixture, nodes, *state, material=material, limiter=limiter, carried=fields
        )
        for side, bound in bounds.items():
            options = bound.options
            if bound.kind == "inflow":
                options = options | {"carried": dict.fromkeys(SEEN_FIELDS, bound.part_of_first)}
            put(block, side, bound.kind, **options)
        return [block], [], make_regridder

    joined = {label: material.name for material in (first, second) for label in material.labels}
    return Handover(time, mixture, lambda old: make_box_nodes(old, size), assemble, name, joined)
