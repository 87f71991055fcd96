"""Two blocks of one material each laid on one block of two materials: what was a line is a field.

The grid of the new block covers both old ones.  Each of its cells takes from both what lies in it:
mass, momentum and total energy of linear fields as in every remapping (theory F12), and the volume.
So the mass of each material, momentum and energy stay the same to round-off, and the volume
fraction is what the line had cut off.  Theory F19.6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.conversion import compute_conserved
from shockgrid.hydro.eos.mixture import Mixture
from shockgrid.hydro.remap.conserved import limit_slopes_to_states
from shockgrid.hydro.remap.overlay import compute_cell_moments, make_linear_fields, overlay_grids
from shockgrid.hydro.rows import HELD_ARRAYS, RHO
from shockgrid.regrid.errors import BadInput

MOST_LEFT_PART = 1e-9  # of the volume of both blocks, outside the new grid or not filled in it

# nodes (2, ni+1, nj+1) and what cells hold, by name -> blocks, links, what makes their regridders
Assemble = Callable[[np.ndarray, dict[str, Any]], tuple[list[Block], list, Callable[[], object]]]


def cut_block(block: Block, new_nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """What the cells (mi, mj) of a new grid take of a block, and the volume left outside.

    Returns conserved quantities (4, mi, mj) and volumes (mi, mj).
    """
    curved = block.geometry.curved
    volumes, centres = compute_cell_moments(block.nodes, curved)
    held = [block.get_inside(name) for name in HELD_ARRAYS]
    fields = make_linear_fields(compute_conserved(block.eos, *held), block.nodes, centres)
    limit_slopes_to_states(block.eos, fields, block.nodes, centres)
    overlay = overlay_grids(block.nodes, centres, fields, new_nodes, curved)
    left = float(np.abs(volumes - overlay.used[..., 0]).sum())
    return np.moveaxis(overlay.taken, -1, 0), overlay.covered[..., 0], left


def merge_states(
    first: Block, second: Block, eos: Mixture, new_nodes: np.ndarray
) -> dict[str, Any]:
    """What cells of a block of two materials hold where these two blocks have been.

    Returns rho, u, v, p, and both fractions, (mi, mj) each.  Raises BadInput where the new grid
    (2, mi+1, mj+1) does not cover the same as both blocks together.
    """
    content, volume, left = cut_block(first, new_nodes)
    content_second, volume_second, left_second = cut_block(second, new_nodes)
    volumes, _ = compute_cell_moments(new_nodes, first.geometry.curved)
    short = float(np.abs(volumes - volume - volume_second).sum())
    if max(left + left_second, short) > MOST_LEFT_PART * volumes.sum():
        raise BadInput(
            f"blocks {first.name!r} and {second.name!r}: the grid for both together does not cover "
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


class Handover:
    """When the two blocks of a simulation become one of two materials, and how.

    time: from which on [s], None: when the flow cannot go on otherwise; eos: of both materials;
    make_nodes: gives the grid (2, ni+1, nj+1) for both blocks; assemble: makes the new block with
    its sides and what makes its regridder; name: of the block.
    """

    def __init__(
        self,
        time: float | None,
        eos: Mixture,
        make_nodes: Callable[[Sequence[Block]], np.ndarray],
        assemble: Assemble,
        name: str,
    ):
        self.time = time
        self.eos = eos
        self.make_nodes = make_nodes
        self.assemble = assemble
        self.name = name
        self.first_nodes: np.ndarray | None = None  # of the new block, when it is there

    def is_due(self, t: float) -> bool:
        """Whether it is time to merge; true once only."""
        return self.first_nodes is None and self.time is not None and t >= self.time

    def merge(self, blocks: Sequence[Block]) -> tuple[list[Block], list, Callable[[], object]]:
        """The new block with the states of both, its links, and what makes its regridder."""
        nodes = self.make_nodes(blocks)
        first, second = blocks
        held = merge_states(first, second, self.eos, nodes)
        return self._assemble(nodes, held)

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
