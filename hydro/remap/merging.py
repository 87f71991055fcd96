"""Blocks of one material each laid on one block of two materials: what was a line is a field.

The grid of the new block covers all old ones.  Each of its cells takes from both what lies in it:
mass, momentum and total energy of linear fields as in every remapping (theory F12), and the volume.
So the mass of each material, momentum and energy stay the same to round-off, and the volume
fraction is what the line had cut off.  Theory F19.6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.conversion import compute_conserved
from shockgrid.hydro.eos.mixture import Mixture
from shockgrid.hydro.motion.following import ZoneFollowing
from shockgrid.hydro.remap.conserved import limit_slopes_to_states
from shockgrid.hydro.remap.overlay import compute_cell_moments, make_linear_fields, overlay_grids
from shockgrid.hydro.rows import HELD_ARRAYS, RHO
from shockgrid.regrid.errors import BadInput

MOST_LEFT_PART = 1e-9  # of the volume of both blocks, outside the new grid or not filled in it

# nodes (2, ni+1, nj+1) and what cells hold, by name -> blocks, links, what makes their regridders
Assemble = Callable[[np.ndarray, dict[str, Any]], tuple[list[Block], list, Callable[[], object]]]


def cut_block(
    block: Block, new_nodes: np.ndarray, period: float | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """What the cells (mi, mj) of a new grid take of a block, and the volume left outside.

    period: where its sides j_min and j_max are each other's image [m], along y; what is beyond one
    side of the new grid comes in through the other.  Returns conserved quantities (4, mi, mj) and
    volumes (mi, mj).
    """
    curved = block.geometry.curved
    volumes, centres = compute_cell_moments(block.nodes, curved)
    held = [block.get_inside(name) for name in HELD_ARRAYS]
    fields = make_linear_fields(compute_conserved(block.eos, *held), block.nodes, centres)
    limit_slopes_to_states(block.eos, fields, block.nodes, centres)
    overlay = overlay_grids(block.nodes, centres, fields, new_nodes, curved)
    used, taken, covered = overlay.used, overlay.taken, overlay.covered
    for shift in () if period is None else (period, -period):
        image = new_nodes + np.array([0.0, shift])[:, None, None]
        overlay = overlay_grids(block.nodes, centres, fields, image, curved)
        used = used + overlay.used
        taken = taken + overlay.taken
        covered = covered + overlay.covered
    left = float(np.abs(volumes - used[..., 0]).sum())
    return np.moveaxis(taken, -1, 0), covered[..., 0], left


def merge_states(
    first: Sequence[Block],
    second: Sequence[Block],
    eos: Mixture,
    new_nodes: np.ndarray,
    period: float | None = None,
) -> dict[str, Any]:
    """What cells of a block of two materials hold where blocks of the first and the second lay.

    period: as of `cut_block`.  Returns rho, u, v, p, and both fractions, (mi, mj) each.  Raises
    BadInput where the new grid (2, mi+1, mj+1) does not cover the same as all blocks together.
    """
    content, volume, left = cut_blocks(first, new_nodes, period)
    content_second, volume_second, left_second = cut_blocks(second, new_nodes, period)
    volumes, _ = compute_cell_moments(new_nodes, first[0].geometry.curved)
    short = float(np.abs(volumes - volume - volume_second).sum())
    if max(left + left_second, short) > MOST_LEFT_PART * volumes.sum():
        names = ", ".join(repr(block.name) for block in (*first, *second))
        raise BadInput(
            f"blocks {names}: the grid for all together does not cover "
            f"what they cover: {(left + left_second) / volumes.sum():.2g} of their volume is left, "
            f"{short / volumes.sum():.2g} is missing"
        )
    mass, momentum_x, momentum_y, energy = content + content_second
    mass_fraction = content[RHO] / mass
    volume_fraction = volume / (volume + volume_second)
    rho = mass / volumes
    u = momentum_x / mass
    v = momentum_y / mass
    mixed_eos = eos.with_fields(np.array([mass_fraction, volume_fraction]))
    p = mixed_eos.pressure(rho, energy / mass - 0.5 * (u * u + v * v))
    return {
        "rho": rho,
        "u": u,
        "v": v,
        "p": p,
        "mass_fraction": mass_fraction,
        "volume_fraction": volume_fraction,
    }


def cut_blocks(
    blocks: Sequence[Block], new_nodes: np.ndarray, period: float | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """What `cut_block` finds of several blocks, added up in their order."""
    content, volume, left = cut_block(blocks[0], new_nodes, period)
    for block in blocks[1:]:
        more_content, more_volume, more_left = cut_block(block, new_nodes, period)
        content = content + more_content
        volume = volume + more_volume
        left += more_left
    return content, volume, left


class Handover:
    """When the blocks of a simulation become one of two materials, and how.

    time: from which on [s], None: when the flow cannot go on otherwise; eos: of both materials;
    make_nodes: gives the grid (2, ni+1, nj+1) for all blocks; assemble: makes the new block with
    its sides and what makes its regridder; name: of the block; joined: labels of materials that
    become one, and its label; following: spaces the sides of the new block; period: of the flow
    along y [m], None: it has none.  Blocks of the first
    material are those with the material of the first block, or with its equation of state where
    the two differ.
    """

    def __init__(
        self,
        time: float | None,
        eos: Mixture,
        make_nodes: Callable[[Sequence[Block]], np.ndarray],
        assemble: Assemble,
        name: str,
        joined: Mapping[str, str] | None = None,
        following: ZoneFollowing | None = None,
        period: float | None = None,
    ):
        self.time = time
        self.eos = eos
        self.make_nodes = make_nodes
        self.assemble = assemble
        self.name = name
        self.joined = joined or {}
        self.following = following
        self.period = period
        self.first_nodes: np.ndarray | None = None  # of the new block, when it is there

    def is_due(self, t: float) -> bool:
        """Whether it is time to merge; true once only."""
        return self.first_nodes is None and self.time is not None and t >= self.time

    def merge(self, blocks: Sequence[Block]) -> tuple[list[Block], list, Callable[[], object]]:
        """The new block with the states of both, its links, and what makes its regridder."""
        nodes = self.make_nodes(blocks)
        first = [block for block in blocks if self._is_first(block, blocks[0])]
        second = [block for block in blocks if not self._is_first(block, blocks[0])]
        held = merge_states(first, second, self.eos, nodes, self.period)
        return self._assemble(nodes, held)

    def _is_first(self, block: Block, leading: Block) -> bool:
        """Whether a block is of the first material, as the leading one is."""
        if self.eos.first == self.eos.second:
            return block.material == leading.material
        return block.eos == self.eos.first

    def lay(self, state: Any) -> tuple[list[Block], list, Callable[[], object]] | None:
        """The new block of a restart point, whose state is not in it yet; None: both are apart."""
        nodes = state.get(f"{self.name}/first_nodes")
        if nodes is None:
            return None
        cells = state[f"{self.name}/state"]
        rho, u, v, p = cells
        # the block takes its own from the state later, to the last bit
        mass_fraction, volume_fraction = np.clip(state[f"{self.name}/carried"], 0.0, 1.0)
        held = {"rho": rho, "u": u, "v": v, "p": p}
        held |= {"mass_fraction": mass_fraction, "volume_fraction": volume_fraction}
        return self._assemble(np.asarray(nodes), held)

    def _assemble(
        self, nodes: np.ndarray, held: dict[str, Any]
    ) -> tuple[list[Block], list, Callable[[], object]]:
        assembled = self.assemble(nodes, held)
        self.first_nodes = nodes.copy()
        return assembled
