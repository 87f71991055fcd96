"""Sedov's blast wave: energy released in a plane, on a line or at a point of cold gas.

All energy is initially in the cell at the centre, or in the cells along the wall of a plane blast,
as pressure, so that the shock is at radius 1 at t = 1.  The grid is rectangular.  Its nodes move
with the gas ("follow"), which concentrates cells where the gas is, or rest ("fixed").  The problem
measures the radius of the shock, the mean position where grid lines from the outside first reach
half of the density's rise, and at the end the relative error of the density against the exact
solution.

Note: the test is sensitive to energy conservation.  The total over all cells drives the shock, and
a scheme that gains a tenth has a radius error of a fortieth.  In the plane the whole centre is one
cell of gas when nodes follow; use a grid at rest.  Source: [Sedov1959], [Kamm2000].
"""

import math
from typing import ClassVar, Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.formulas.geometry import compute_volumes, find_geometry
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, RunControl, key
from shockgrid.problems.initial_states import RadialProblem, Symmetry, follow_gas
from shockgrid.problems.references.exact_flows import DIMENSIONS, SedovBlast
from shockgrid.problems.report import Report, Row

# of the whole energy in the part that is computed: half a line, a quarter, a quarter a radian
SHARES = {"plane": 0.5, "cylindrical": 0.25, "spherical": 0.25 / math.pi}


class SedovDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=1.0, cfl=0.8)
    geometry: key(Symmetry, "shape of the blast") = "cylindrical"
    cells: key(int, "cells along each side", ge=8, le=MOST_CELLS) = 100
    size: key(float, "length of the sides", ge=1e-9, le=1e9) = 1.2
    gamma: key(float, "ratio of specific heats", ge=1.01, le=1000) = 1.4
    pressure: key(float, "of the cold gas; exact theory has 0", ge=1e-12, le=0.01) = 1e-8
    mesh: key(
        Literal["follow", "fixed"] | None, "nodes follow the gas, or rest. If left out: plane: rest"
    ) = None
    limiter: Limiter = "van-leer"


class Sedov(RadialProblem):
    Deck = SedovDeck
    peers: ClassVar = {"cylindrical": "BookLeaf 0.018", "spherical": "PENNANT gains 11 % of energy"}

    def __init__(self, deck: SedovDeck):
        super().__init__(deck, DIMENSIONS[deck.geometry])
        alpha = SedovBlast(deck.geometry, deck.gamma).alpha
        self.blast = SedovBlast(deck.geometry, deck.gamma, energy=alpha)
        self.mesh = deck.mesh or ("fixed" if deck.geometry == "plane" else "follow")
        end = self.blast.radius(deck.run.t_end)
        if end < deck.size / deck.cells:
            raise deck.error(
                "run.t_end", "the shock is in the first cell then; end later, or take smaller cells"
            )
        if end > 0.95 * deck.size:
            raise deck.error(
                "run.t_end",
                f"the shock is at r = {end:.3g} then, and sides of {deck.size:g} send it back",
            )

    def compute_density(self, r, t):
        return self.blast.sample(r, t)[0]

    def make_grids(self, t=0.0):
        return {"gas": self.lay_nodes(self.deck.size)}

    def build(self):
        deck = self.deck
        nodes = self.make_grids()["gas"]
        volume = compute_volumes(find_geometry(self.geometry), nodes)
        pressure = np.full(volume.shape, deck.pressure)
        first = np.index_exp[:1, :1]
        energy = SHARES[deck.geometry] * self.blast.energy
        if deck.geometry == "plane":
            first = np.index_exp[:1, :]
            energy = energy * nodes[1, 0, -1]
        pressure[first] += (deck.gamma - 1.0) * energy / volume[first].sum()
        block = Block("gas", IdealGas(deck.gamma), nodes, 1, 0, 0, pressure, limiter=deck.limiter)
        follow = lambda name, t: follow_gas(block, t - simulation.t)  # noqa: E731
        mesh = follow if self.mesh == "follow" else "fixed"
        simulation = self.simulate([block], mesh=mesh)
        return simulation

    def measure(self, evolution) -> dict[str, float]:
        """Radius of the shock and at the end the error."""
        (block,) = evolution.blocks
        most = float(block.rho.max())
        found = {"shock_radius": self.find_shock(block), "most_density": most}
        return {**found, "error_rho": self.measure_error(evolution)}

    def report(self, run) -> Report:
        deck = self.deck
        energy = run.history["total_energy"]
        t = run.t
        jump = (deck.gamma + 1.0) / (deck.gamma - 1.0)
        change = float(np.abs(energy / energy[0] - 1.0).max())
        rows = [
            run.compare("shock_radius", self.blast.radius(t), "radius of the shock"),
            run.compare("most_density", jump, "greatest density"),
            Row("energy", change, label="relative change of the energy", error="energy", digits=2),
            run.compare("error_rho", label="relative error of the density", digits=4),
        ]
        grid = "nodes follow the gas" if self.mesh == "follow" else "fixed grid"
        head = f"sedov, {deck.geometry}, {deck.cells} cells per side, {grid}"
        return Report(head, rows, self.list_notes(run))

    def draw_sedov(self, figure, run_data) -> None:
        """Density in the last dump with the grid, and against the radius."""
        dump = run_data.dumps[-1]
        self.draw(figure, dump, self.deck.size, every=max(1, self.deck.cells // 33))
