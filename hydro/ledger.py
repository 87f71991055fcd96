"""Conserved totals and the inflow through the boundary, step by step.

The totals are the mass of each material and the momentum and energy of all blocks, with the energy
of round voids that resist their closing (theory F16.7).  Blocks that
exchange mass through seams have one material (`hydro.links.name_materials`).  The boundary
part is the time integral of the inward fluxes through all segments that are not linked to another
segment.  Contributions of body sources and of surface tension are counted as inflow.  The
difference total - boundary is constant to round-off.  In axisymmetric flow all quantities are per
radian.  Radial momentum is not conserved and has no column.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.mixture import MASS_FRACTION
from shockgrid.hydro.rim import CARRIED_FLUX, ENERGY, MASS, MOMENTUM_X, MOMENTUM_Y
from shockgrid.regrid.jit import kernel


@kernel(allocates=False)
def sum_fluxes(rim, spans):
    """Mass, momentum x and y, and energy that leave through the faces `spans` (n, 2) in a second.

    rim: rows of `hydro.rim`, a column a face.
    """
    mass = 0.0
    momentum_x = 0.0
    momentum_y = 0.0
    energy = 0.0
    for span in range(spans.shape[0]):
        for face in range(spans[span, 0], spans[span, 1]):
            mass += rim[MASS, face]
            momentum_x += rim[MOMENTUM_X, face]
            momentum_y += rim[MOMENTUM_Y, face]
            energy += rim[ENERGY, face]
    return mass, momentum_x, momentum_y, energy


def sum_first_flux(block: Block) -> float:
    """Mass of the first material that leaves a block of two in a second."""
    flux = block.rim.get_carried(CARRIED_FLUX)[MASS_FRACTION]
    return float(sum(flux[first:last].sum() for first, last in block.plan.counted))


def split_mass(masses: dict[str, float], names: tuple[str, str], mass: float, first: float) -> None:
    """Add the mass of two materials of these names, of which `first` is the first one's."""
    one, two = names
    masses[one] += first
    masses[two] += mass - first


class Ledger:
    """Running boundary integrals, and the totals of the blocks, by the label of their material.

    joined: labels of materials that are counted as one, and the label of that one.
    """

    def __init__(self, blocks: list[Block], joined: Mapping[str, str] | None = None):
        self.blocks = blocks
        joined = joined or {}
        self.labels = {
            block.material: joined.get(block.material, block.material) for block in blocks
        }
        labels = [
            name
            for block in blocks
            for name in block.eos.material_names or (self.labels[block.material],)
        ]
        self.materials = list(dict.fromkeys(labels))
        self.mass_in = dict.fromkeys(self.materials, 0.0)
        self.momentum_in = np.zeros(2)
        self.energy_in = 0.0
        self.energy_in_voids = 0.0

    def add_boundary(self, dt: float) -> None:
        """Add what came in during a step from the fluxes of the perimeters."""
        for block in self.blocks:
            mass, momentum_x, momentum_y, energy = sum_fluxes(block.rim.rows, block.plan.counted)
            names = block.eos.material_names
            if names is None:
                self.mass_in[self.labels[block.material]] -= dt * mass
            else:
                first = sum_first_flux(block)
                split_mass(self.mass_in, names, -dt * mass, -dt * first)
            self.momentum_in[0] -= dt * momentum_x
            self.momentum_in[1] -= dt * momentum_y
            self.energy_in -= dt * energy

    def add_source(self, gained: np.ndarray) -> None:
        """Add momentum x, y and energy (3,) that a body source has brought."""
        self.momentum_in += gained[:2]
        self.energy_in += float(gained[2])

    def count_energy_of_voids(self, work: float, energy: float) -> None:
        """Take the work of voids that resist their closing out of the boundary's energy: it is
        theirs."""
        self.energy_in -= work
        self.energy_in_voids = energy

    def compute_row(self) -> dict[str, float]:
        """Columns `total_*` and `boundary_*` of the history."""
        sums = {name: 0.0 for name in self.materials}
        momentum_x = momentum_y = energy = 0.0
        for block in self.blocks:
            total = block.totals.sums
            names = block.eos.material_names
            if names is None:
                sums[self.labels[block.material]] += total.mass
            else:
                split_mass(sums, names, total.mass, total.first_mass)
            momentum_x += total.momentum_x
            momentum_y += total.momentum_y
            energy += total.energy
        # radial momentum is not conserved
        has_momentum_y = not self.blocks[0].geometry.curved
        row = {f"total_mass_{name}": value for name, value in sums.items()}
        row["total_momentum_x"] = momentum_x
        if has_momentum_y:
            row["total_momentum_y"] = momentum_y
        row["total_energy"] = energy + self.energy_in_voids
        row |= {f"boundary_mass_{name}": value for name, value in self.mass_in.items()}
        row["boundary_momentum_x"] = float(self.momentum_in[0])
        if has_momentum_y:
            row["boundary_momentum_y"] = float(self.momentum_in[1])
        row["boundary_energy"] = self.energy_in
        return row

    def get_state(self) -> dict[str, float]:
        """The running integrals, for a restart point."""
        state = {f"ledger/mass_{name}": value for name, value in self.mass_in.items()}
        return state | {
            "ledger/momentum_x": float(self.momentum_in[0]),
            "ledger/momentum_y": float(self.momentum_in[1]),
            "ledger/energy": self.energy_in,
            "ledger/energy_in_voids": self.energy_in_voids,
        }

    def set_state(self, state) -> None:
        """Take up the running integrals of a restart point."""
        for name in self.materials:
            self.mass_in[name] = float(state[f"ledger/mass_{name}"])
        self.momentum_in = np.array(
            [float(state["ledger/momentum_x"]), float(state["ledger/momentum_y"])]
        )
        self.energy_in = float(state["ledger/energy"])
        self.energy_in_voids = float(state["ledger/energy_in_voids"])
