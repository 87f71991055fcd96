"""Gresho's vortex: a steady round flow with a kinked profile; how much of it is worn away.

The speed around the centre rises as 5 r to r = 0.2, falls as 2 - 5 r to r = 0.4 and is zero beyond;
the pressure balances it.  After one turn (t = 0.4 pi) everything should be as it was.  Measured is
the kinetic energy left, 0.0837758041 at the start, and the mean error of the speed.  The grid is at
rest or swings smoothly while the flow turns.

The trap: the corners of the profile make it a test of dissipation, not of order.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.eos import IdealGas
from hydro.links.join import join
from hydro.simulation import Simulation
from problems.deck import MOST_CELLS, Deck, Limiter, RunControl
from problems.field_panel import draw_field
from problems.initial_states.rectangular_grids import swing_square
from problems.problem import Problem
from regrid.measure.corners import compute_centres

TURN = 0.4 * math.pi  # of the core [s]
KINETIC_ENERGY = 8.0 * math.pi / 300.0
POINTS = 4  # Gauss points each way for the cell averages of the start


def compute_flow(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """u, v, p (3, ...) of the steady flow of density 1 around the origin."""
    r = np.hypot(x, y)
    inner, ring = r < 0.2, (r >= 0.2) & (r < 0.4)
    r_ring = np.where(ring, r, 0.3)
    turn = np.where(inner, 5.0, np.where(ring, 2.0 / r_ring - 5.0, 0.0))  # speed over r
    p_ring = 9.0 - 4.0 * math.log(0.2) + 12.5 * r_ring**2 - 20.0 * r_ring + 4.0 * np.log(r_ring)
    p = np.where(inner, 5.0 + 12.5 * r * r, np.where(ring, p_ring, 3.0 + 4.0 * math.log(2.0)))
    return np.array([-turn * y, turn * x, p])


def average(nodes: np.ndarray) -> np.ndarray:
    """Means (3, ni, nj) of `compute_flow` over the cells of `nodes`, by Gauss points."""
    abscissae, weights = np.polynomial.legendre.leggauss(POINTS)
    total, volume = 0.0, 0.0
    a, b, c, d = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
    for s, weight_s in zip(0.5 * (1.0 + abscissae), weights, strict=True):
        for q, weight_q in zip(0.5 * (1.0 + abscissae), weights, strict=True):
            point = (1 - s) * (1 - q) * a + s * (1 - q) * b + s * q * c + (1 - s) * q * d
            along = (1 - q) * (b - a) + q * (c - d)
            across = (1 - s) * (d - a) + s * (c - b)
            weight = weight_s * weight_q * (along[0] * across[1] - along[1] * across[0])
            total = total + weight * compute_flow(*point)
            volume = volume + weight
    return total / volume


class GreshoDeck(Deck, kw_only=True):
    """Deck of `gresho`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=TURN, cfl=0.8))
    cells: Annotated[
        int, Meta(ge=8, le=MOST_CELLS, description="cells along each side of the unit square")
    ] = 40
    mesh: Annotated[
        Literal["fixed", "swing"], Meta(description="grid at rest, or swinging smoothly")
    ] = "fixed"
    amplitude: Annotated[
        float, Meta(ge=0, le=0.1, description="of the swinging nodes; the square is 1 wide")
    ] = 0.03
    limiter: Limiter = "low-mach"


class Gresho(Problem):
    """One periodic block."""

    Deck = GreshoDeck

    def make_block_nodes(self, name: str, t: float) -> np.ndarray:
        """Nodes at time t: every node swings about its position, twice in a turn."""
        swing = self.deck.amplitude * math.sin(2.0 * (2.0 * math.pi) * t / TURN)
        return swing_square(self.deck.cells, -0.5, 1.0, swing)

    def estimate_cells(self) -> int:
        return self.deck.cells**2

    def build(self) -> Simulation:
        deck = self.deck
        nodes = self.make_block_nodes("square", 0.0)
        u, v, p = average(nodes)
        block = Block("square", IdealGas(1.4), nodes, 1.0, u, v, p, limiter=deck.limiter)
        links = [
            join("periodic", (block, "i_min"), (block, "i_max")),
            join("periodic", (block, "j_min"), (block, "j_max")),
        ]
        return Simulation(
            [block],
            links,
            t_end=deck.run.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            mesh="fixed" if deck.mesh == "fixed" else self.make_block_nodes,
        )

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Kinetic energy over that of the start (cell means), and mean error of the velocity."""
        (block,) = evolution.blocks
        rho, u, v, _ = block.state[:, 1:-1, 1:-1]
        volume = block.volume
        energy = float((0.5 * rho * (u * u + v * v) * volume).sum())
        exact_u, exact_v, _ = compute_flow(*compute_centres(block.nodes))
        error = np.hypot(u - exact_u, v - exact_v)
        return {
            "kinetic_energy": energy,
            "error_velocity": float((error * volume).sum() / volume.sum()),
        }

    def errors(self, history) -> dict[str, float]:
        """The part of the kinetic energy that is lost."""
        energy = history["kinetic_energy"]
        return {"lost": 1.0 - float(energy[-1] / energy[0])}

    def predict(self) -> dict[str, float]:
        """Kinetic energy, which stays [J/m], and the error of the velocity: 0."""
        return {"kinetic_energy": KINETIC_ENERGY, "error_velocity": 0.0}

    def summary(self, history, final) -> str:
        energy, t = history["kinetic_energy"], float(history["t"][-1])
        return (
            f"gresho, {self.deck.cells} x {self.deck.cells}, grid {self.deck.mesh}, "
            f"{t / TURN:.3g} turns: kinetic energy {energy[-1]:.7g}, {energy[-1] / energy[0]:.2%} "
            f"of the start's (bar 98 % after one turn at 40 x 40), "
            f"{energy[-1] / KINETIC_ENERGY:.2%} of {KINETIC_ENERGY:.9f};\n"
            f"  mean error of the velocity {history['error_velocity'][-1]:.3g}"
        )

    def figures(self):
        return {"gresho": functools.partial(draw_gresho, self)}


def draw_gresho(problem: Gresho, figure, run_data) -> None:
    """Speed at the start and at the end, and against the radius."""

    def speed(block):
        return np.hypot(block.cell_fields["u"], block.cell_fields["v"])

    left, middle, right = figure.subplots(1, 3)
    for axis, dump in ((left, run_data.dumps[0]), (middle, run_data.dumps[-1])):
        draw_field(axis, dump, speed, low=0.0, high=1.0, every=2)
        axis.set_title(f"speed, t = {dump.t:.3g}", fontsize="medium")
    (block,) = run_data.dumps[-1].blocks
    r = np.hypot(*compute_centres(block.nodes))
    right.plot(r.ravel(), speed(block).ravel(), ".", ms=2)
    right.plot([0.0, 0.2, 0.4, 0.7], [0.0, 1.0, 0.0, 0.0], "k", lw=0.8)
    right.set_xlabel("r")
