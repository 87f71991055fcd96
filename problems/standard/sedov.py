"""Sedov's blast wave: the energy of a point in cold gas; plane, cylinder or sphere.

All energy is at first in the cell at the centre (in the cells along the wall of a plane blast), as
pressure, and such that the shock is at radius 1 at t = 1.  The grid is rectangular and knows
nothing of the centre.  Its nodes go with the gas ("follow"), which takes the cells to where the
gas is, or rest ("fixed").  Measured are the radius of the shock, the mean of where grid lines from
the outside first meet half of the density's rise, and at the end the relative error of the density
against the exact solution.

The trap: conservation of energy is half the test.  It is the sum over all cells that drives the
shock, and a scheme that gains a tenth is a fortieth out.  In the plane the whole centre is one cell
of gas when nodes follow; the grid is better left at rest.  Source: [Sedov1959], [Kamm2000].
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.formulas.geometry import compute_volumes, find_geometry
from hydro.simulation import Simulation
from problems.deck import MOST_CELLS, Deck, Limiter, RunControl
from problems.field_panel import draw_field
from problems.initial_states.radial_flows import (
    close_inside,
    compute_radii,
    draw_radial,
    find_flow_geometry,
    make_nodes,
    measure_error,
)
from problems.problem import Problem
from problems.references.sedov import SedovBlast
from regrid.errors import BadInput
from regrid.measure.corners import compute_centres

# of the whole energy in the part that is computed: half a line, a quarter, a quarter a radian
SHARES = {"plane": 0.5, "cylindrical": 0.25, "spherical": 0.25 / math.pi}
LEAST_RISE = 1e-3  # of the density over that of the cold gas: less is no shock
PEERS = {"cylindrical": "BookLeaf .018", "spherical": "PENNANT gains 11 % of energy"}


class SedovDeck(Deck, kw_only=True):
    """Deck of `sedov`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=1.0, cfl=0.8))
    geometry: Annotated[
        Literal["plane", "cylindrical", "spherical"], Meta(description="shape of the blast")
    ] = "cylindrical"
    cells: Annotated[int, Meta(ge=8, le=MOST_CELLS, description="cells along each side")] = 100
    size: Annotated[float, Meta(gt=0, description="length of the sides")] = 1.2
    gamma: Annotated[float, Meta(ge=1.01, description="ratio of specific heats")] = 1.4
    pressure: Annotated[
        float, Meta(gt=0, le=0.01, description="of the cold gas; exact theory has 0")
    ] = 1e-8
    mesh: (
        Annotated[
            Literal["follow", "fixed"],
            Meta(
                description="nodes go with the gas, or rest; left out: follow, but fixed if plane"
            ),
        ]
        | None
    ) = None
    limiter: Limiter = "van-leer"


class Sedov(Problem):
    """One block."""

    Deck = SedovDeck

    def __init__(self, deck: SedovDeck):
        super().__init__(deck)
        alpha = SedovBlast(deck.geometry, deck.gamma).alpha
        self.blast = SedovBlast(deck.geometry, deck.gamma, energy=alpha)
        self.follows = (
            deck.mesh or ("fixed" if deck.geometry == "plane" else "follow")
        ) == "follow"
        self.simulation: Simulation | None = None
        end = self.blast.radius(deck.run.t_end)
        if end < deck.size / deck.cells:
            cell = deck.size / deck.cells
            raise BadInput(
                f"deck: at run.t_end = {deck.run.t_end:g} the shock is at r = {end:.3g}, inside "
                f"the first cell, {cell:.3g} long; end later, or take a smaller size or more cells"
            )
        if end > 0.95 * deck.size:
            raise BadInput(
                f"deck: at run.t_end = {deck.run.t_end:g} the shock is at r = {end:.3g}; the sides "
                f"are {deck.size:g} long, and its like on the far side would come back"
            )

    def estimate_cells(self) -> int:
        return self.deck.cells**2

    def build(self) -> Simulation:
        deck = self.deck
        nodes = make_nodes(deck.geometry, deck.cells, deck.size)
        geometry = find_flow_geometry(deck.geometry)
        volume = compute_volumes(find_geometry(geometry), nodes)
        pressure = np.full(volume.shape, deck.pressure)
        first = np.index_exp[:1, :] if deck.geometry == "plane" else np.index_exp[:1, :1]
        energy = SHARES[deck.geometry] * self.blast.energy
        if deck.geometry == "plane":
            energy *= nodes[1, 0, -1]
        pressure[first] += (deck.gamma - 1.0) * energy / volume[first].sum()
        block = Block("gas", IdealGas(deck.gamma), nodes, 1, 0, 0, pressure, limiter=deck.limiter)
        for side in close_inside(block, deck.geometry):
            put(block, side, "wall")
        self.simulation = Simulation(
            [block],
            [],
            t_end=deck.run.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            mesh=self.follow if self.follows else "fixed",
            geometry=geometry,
        )
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

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Radius of the shock and at the end the error."""
        (block,) = evolution.blocks
        r = compute_radii(self.deck.geometry, compute_centres(block.nodes))
        rho = block.state[0, 1:-1, 1:-1]
        row = {
            "shock_radius": find_shock_radius(r, rho),
            "most_density": float(rho.max()),
            "error_rho": math.nan,
        }
        if evolution.finished is not None:
            row["error_rho"] = measure_error(
                self.deck.geometry, block, lambda r: self.blast.sample(r, evolution.t)[0]
            )
        return row

    def errors(self, history) -> dict[str, float]:
        """Largest relative change of the total energy."""
        energy = np.asarray(history["total_energy"])
        return {"energy": float(np.abs(energy / energy[0] - 1.0).max())}

    def predict(self) -> dict[str, float]:
        """Radius of the shock [m] at the end time, and the greatest density behind it."""
        gamma = self.deck.gamma
        radius = float(self.blast.radius(self.deck.run.t_end))
        return {"shock_radius": radius, "most_density": (gamma + 1.0) / (gamma - 1.0)}

    def summary(self, history, final) -> str:
        deck, t = self.deck, float(history["t"][-1])
        jump = (deck.gamma + 1.0) / (deck.gamma - 1.0)
        lines = [
            f"sedov, {deck.geometry}, {deck.cells} cells a side, "
            + ("nodes follow the gas" if self.follows else "fixed grid"),
            f"  shock at r = {history['shock_radius'][-1]:.4g} ({self.blast.radius(t):.4g}), "
            f"greatest density {history['most_density'][-1]:.3g} ({jump:.3g})",
            f"  energy changed by {self.errors(history)['energy']:.1e} of itself",
        ]
        error = history["error_rho"][-1]
        if math.isnan(error):
            lines.append("  the error is measured at the end time, which was not reached")
        else:
            lines.append(f"  relative error of the density: {error:.4f}")
            if deck.cells == 100 and deck.geometry in PEERS:
                lines[-1] += f" ({PEERS[deck.geometry]})"
        return "\n".join(lines)

    def figures(self):
        return {"sedov": functools.partial(draw_sedov, self)}


def find_shock_radius(r: np.ndarray, rho: np.ndarray) -> float:
    """Mean radius of the shock in the density (ni, nj) at the radii r of the cells' centres.

    On every grid line that crosses it, inwards from the far side, where the density first is half
    way from 1, the cold gas ahead, to the greatest of all; in a straight line between centres.
    0 where nothing is denser than the cold gas.
    """
    rise = float(rho.max()) - 1.0
    if not rise > LEAST_RISE:
        return 0.0
    found: list[float] = []
    for radii, density in ((r, rho), (r.T, rho.T)):
        over = density > 1.0 + 0.5 * rise
        last = density.shape[0] - 1 - np.argmax(over[::-1], axis=0)
        for line in np.flatnonzero(over.any(axis=0) & ~over[-1]):
            i = last[line]
            one, two = density[i : i + 2, line]
            part = (one - 1.0 - 0.5 * rise) / (one - two)
            found.append(radii[i, line] + part * (radii[i + 1, line] - radii[i, line]))
    return float(np.mean(found)) if found else 0.0


def draw_sedov(problem: Sedov, figure, run_data) -> None:
    """Density in the last dump with the grid, and against the radius."""
    dump = run_data.dumps[-1]
    left, right = figure.subplots(1, 2)
    picture = draw_field(left, dump, "rho", low=0.0, every=max(1, problem.deck.cells // 33))
    figure.colorbar(picture, ax=left, shrink=0.7, label="density")
    r = np.linspace(1e-3, problem.deck.size, 2000)
    exact = problem.blast.sample(r, max(dump.t, 1e-9))[0]
    draw_radial(right, dump.blocks[0], problem.deck.geometry, r, exact)
    right.set_xlim(0.0, problem.deck.size)
    figure.suptitle(f"sedov, {problem.deck.geometry}, t = {dump.t:.3g}")
