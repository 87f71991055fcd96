"""Sedov's blast wave: the energy of a point in cold gas; plane, cylinder or sphere.

All energy is initially in the cell at the centre (in the cells along the wall of a plane blast), as
pressure, so that the shock is at radius 1 at t = 1.  The grid is rectangular.  Its nodes move
with the gas ("follow"), which concentrates cells where the gas is, or rest ("fixed").  The problem
measures the radius of the shock, the mean position where grid lines from the outside first reach
half of the density's rise, and at the end the relative error of the density against the exact
solution.

Note: energy conservation is half the test.  The total over all cells drives the shock, and a scheme
that gains a tenth has a radius error of a fortieth.  In the plane the whole centre is one cell of
gas when nodes follow; use a grid at rest.  Source: [Sedov1959], [Kamm2000].
"""

from __future__ import annotations

import math
from typing import Literal

import msgspec
import numpy as np

from hydro.block import Block
from hydro.eos import IdealGas
from hydro.formulas.geometry import compute_volumes, find_geometry
from problems.deck import MOST_CELLS, Deck, Limiter, RunControl, key
from problems.initial_states import RadialFlow, put_walls
from problems.problem import Problem, Report, Row, compare, find_crossing, get_last, say_unreached
from problems.references.exact_flows import SedovBlast
from regrid.errors import BadInput
from regrid.measure.corners import compute_centres

# of the whole energy in the part that is computed: half a line, a quarter, a quarter a radian
SHARES = {"plane": 0.5, "cylindrical": 0.25, "spherical": 0.25 / math.pi}
LEAST_RISE = 1e-3  # of the density over that of the cold gas: less is no shock
PEERS = {"cylindrical": "BookLeaf .018", "spherical": "PENNANT gains 11 % of energy"}


class SedovDeck(Deck, kw_only=True):
    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=1.0, cfl=0.8))
    geometry: key(Literal["plane", "cylindrical", "spherical"], "shape of the blast") = (
        "cylindrical"
    )
    cells: key(int, "cells along each side", ge=8, le=MOST_CELLS) = 100
    size: key(float, "length of the sides", gt=0) = 1.2
    gamma: key(float, "ratio of specific heats", ge=1.01) = 1.4
    pressure: key(float, "of the cold gas; exact theory has 0", gt=0, le=0.01) = 1e-8
    mesh: (
        key(
            Literal["follow", "fixed"],
            "nodes go with the gas, or rest; left out: follow, but fixed if plane",
        )
        | None
    ) = None
    limiter: Limiter = "van-leer"


class Sedov(Problem):
    """One block."""

    Deck = SedovDeck
    picture = "sedov"

    def __init__(self, deck: SedovDeck):
        super().__init__(deck)
        self.flow = RadialFlow(deck.geometry)
        alpha = SedovBlast(deck.geometry, deck.gamma).alpha
        self.blast = SedovBlast(deck.geometry, deck.gamma, energy=alpha)
        self.mesh = deck.mesh or ("fixed" if deck.geometry == "plane" else "follow")
        end, cell = self.blast.radius(deck.run.t_end), deck.size / deck.cells
        where = f"deck: at run.t_end = {deck.run.t_end:g} the shock is at r = {end:.3g}"
        if end < cell:
            raise BadInput(
                f"{where}, inside the first cell, {cell:.3g} long; end later, or take a smaller "
                "size or more cells"
            )
        if end > 0.95 * deck.size:
            raise BadInput(
                f"{where}; the sides are {deck.size:g} long, and its mirror image would come back"
            )

    def estimate_cells(self) -> int:
        return self.deck.cells**2

    def build(self):
        deck, flow = self.deck, self.flow
        nodes = flow.make_nodes(deck.cells, deck.size)
        volume = compute_volumes(find_geometry(flow.geometry), nodes)
        pressure = np.full(volume.shape, deck.pressure)
        first = np.index_exp[:1, :] if deck.geometry == "plane" else np.index_exp[:1, :1]
        energy = SHARES[deck.geometry] * self.blast.energy
        if deck.geometry == "plane":
            energy *= nodes[1, 0, -1]
        pressure[first] += (deck.gamma - 1.0) * energy / volume[first].sum()
        block = Block("gas", IdealGas(deck.gamma), nodes, 1, 0, 0, pressure, limiter=deck.limiter)
        put_walls(block, *flow.close_inside(block))
        mesh = self.follow if self.mesh == "follow" else "fixed"
        self.simulation = self.simulate([block], mesh=mesh, geometry=flow.geometry)
        return self.simulation

    def follow(self, name: str, t: float) -> np.ndarray:
        """Nodes at time t, moved with the mean velocity of the four cells around, by impedance.

        Weights rho c, as in a contact between sound waves: cold gas has no say before the shock.
        With the masses as weights the nodes at the shock's foot set off late.
        """
        (block,) = self.simulation.blocks
        rho, u, v, p = block.state[:, 1:-1, 1:-1]
        impedance = rho * block.eos.sound_speed(rho, p)
        around = np.zeros((3, block.ni + 2, block.nj + 2))
        around[:, 1:-1, 1:-1] = impedance, impedance * u, impedance * v
        for edge, beside in ((0, 1), (-1, -2)):  # mirror images beyond the sides
            around[:, edge] = around[:, beside]
            around[1, edge] *= -1.0
            around[:, :, edge] = around[:, :, beside]
            around[2, :, edge] *= -1.0
        total = (around[:, 1:, 1:] + around[:, :-1, :-1]) + (
            around[:, 1:, :-1] + around[:, :-1, 1:]
        )
        return block.nodes + (t - self.simulation.t) * (total[1:] / total[0])

    def measure(self, evolution) -> dict[str, float]:
        """Radius of the shock and at the end the error."""
        (block,) = evolution.blocks
        r = self.flow.compute_radii(compute_centres(block.nodes))
        rho, error = block.state[0, 1:-1, 1:-1], math.nan
        if evolution.finished is not None:
            exact = lambda r: self.blast.sample(r, evolution.t)[0]  # noqa: E731
            error = self.flow.measure_error(block, exact)
        found = {"shock_radius": find_shock_radius(r, rho), "most_density": float(rho.max())}
        return {**found, "error_rho": error}

    def report(self, history, final=None) -> Report:
        deck, energy = self.deck, np.asarray(history.get("total_energy", [math.nan]))
        t = get_last(history, "t") if history else self.t_end
        jump = (deck.gamma + 1.0) / (deck.gamma - 1.0)
        change = float(np.abs(energy / energy[0] - 1.0).max())
        rows = [
            compare(history, "shock_radius", self.blast.radius(t), "radius of the shock [m]"),
            compare(history, "most_density", jump, "greatest density [kg/m3]"),
            Row("energy", change, label="relative change of the energy", error="energy", digits=2),
            compare(history, "error_rho", label="relative error of the density", digits=4),
        ]
        notes = say_unreached(history, "error_rho")
        if deck.cells == 100 and deck.geometry in PEERS:
            notes.append(f"other codes: {PEERS[deck.geometry]}")
        grid = "nodes follow the gas" if self.mesh == "follow" else "fixed grid"
        return Report(f"sedov, {deck.geometry}, {deck.cells} cells a side, {grid}", rows, notes)

    def draw(self, figure, run_data) -> None:
        """Density in the last dump with the grid, and against the radius."""
        dump = run_data.dumps[-1]
        exact = lambda r: self.blast.sample(r, max(dump.t, 1e-9))[0]  # noqa: E731
        self.flow.draw(figure, dump, exact, self.deck.size, every=max(1, self.deck.cells // 33))


def find_shock_radius(r: np.ndarray, rho: np.ndarray) -> float:
    """Mean radius of the shock in the density (ni, nj) at the radii r of the cells' centres.

    On every grid line that crosses it, inwards from the far side, where the density first is half
    way from 1, the cold gas ahead, to the greatest of all; in a straight line between centres.
    0 where nothing is denser than the cold gas.
    """
    rise = float(rho.max()) - 1.0
    if not rise > LEAST_RISE:
        return 0.0
    found = [
        find_crossing(radii[:, line], density[:, line], 1.0 + 0.5 * rise)
        for radii, density in ((r, rho), (r.T, rho.T))
        for line in range(density.shape[1])
    ]
    return float(np.nanmean(found)) if np.isfinite(found).any() else 0.0
