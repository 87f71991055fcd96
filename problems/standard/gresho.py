"""Gresho's vortex: a steady round flow with a kinked profile, and how much of it is lost.

The speed around the centre rises as 5 r to r = 0.2, falls as 2 - 5 r to r = 0.4 and is zero beyond;
the pressure balances it.  After one turn (t = 0.4 pi) everything should be as it was.  The
problem measures the remaining kinetic energy, initially 0.0837758041, and the mean error of the
speed.  The grid is at rest or swings smoothly while the flow turns.

Note: the corners of the profile make it a test of dissipation, not of order.
"""

import math
from typing import Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, RunControl, key
from shockgrid.problems.initial_states import swing_square
from shockgrid.problems.pictures import Colours, draw_field, make_panels
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.exact_flows import GAUSS, average_points
from shockgrid.problems.report import Report, Row

CORE_TURN_TIME = 0.4 * math.pi  # of the core [s]
KINETIC_ENERGY = 8.0 * math.pi / 300.0


def compute_flow(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """u, v, p (3, ...) of the steady flow of density 1 around the origin."""
    r = np.hypot(x, y)
    inner = r < 0.2
    ring = (r >= 0.2) & (r < 0.4)
    r_ring = np.where(ring, r, 0.3)
    turn = np.where(inner, 5.0, np.where(ring, 2.0 / r_ring - 5.0, 0.0))  # speed over r
    p_ring = 9.0 - 4.0 * math.log(0.2) + 12.5 * r_ring**2 - 20.0 * r_ring + 4.0 * np.log(r_ring)
    p = np.where(inner, 5.0 + 12.5 * r * r, np.where(ring, p_ring, 3.0 + 4.0 * math.log(2.0)))
    return np.array([-turn * y, turn * x, p])


class GreshoDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=CORE_TURN_TIME, cfl=0.8)
    cells: key(int, "cells along each side of the unit square", ge=8, le=MOST_CELLS) = 40
    mesh: key(Literal["fixed", "swing"], "grid at rest, or swinging smoothly") = "fixed"
    amplitude: key(float, "of the swinging nodes; the square is 1 wide", ge=0, le=0.1) = 0.03
    limiter: Limiter = "low-mach"


class Gresho(Problem):
    Deck = GreshoDeck
    t_unit = "1"
    counted = ("cells", "cells")

    def make_grids(self, t=0.0):
        """Every node swings about its position, twice in a turn."""
        swing = self.deck.amplitude * math.sin(2.0 * (2.0 * math.pi) * t / CORE_TURN_TIME)
        return {"square": swing_square(self.deck.cells, -0.5, 1.0, swing)}

    def build(self):
        deck = self.deck
        nodes = self.make_grids()["square"]
        flow = average_points(nodes, GAUSS, lambda point, area: (compute_flow(*point), area))
        block = Block("square", IdealGas(1.4), nodes, 1.0, *flow, limiter=deck.limiter)
        links = [join("periodic", (block, f"{d}_min"), (block, f"{d}_max")) for d in "ij"]
        return self.simulate([block], links, mesh=deck.mesh)

    def measure(self, evolution) -> dict[str, float]:
        """Kinetic energy over that of the start (cell means), and mean error of the velocity."""
        (block,) = evolution.blocks
        u = block.u
        v = block.v
        exact_u, exact_v, _ = compute_flow(*block.centres)
        error = np.average(np.hypot(u - exact_u, v - exact_v), weights=block.volume)
        energy = (0.5 * block.rho * (u * u + v * v) * block.volume).sum()
        return {"kinetic_energy": float(energy), "error_velocity": float(error)}

    def report(self, run) -> Report:
        deck = self.deck
        energy = run.history["kinetic_energy"]
        lost = 1.0 - float(energy[-1] / energy[0])
        turns = f", {run.t / CORE_TURN_TIME:.3g} turns" if run.begun else ""
        rows = [
            run.compare("kinetic_energy", KINETIC_ENERGY, "kinetic energy [J/m]", digits=7),
            Row("lost", lost, label="part lost since the start", digits=3, error="lost"),
            run.compare("error_velocity", 0.0, "mean error of the velocity", digits=3),
        ]
        head = f"gresho, {deck.cells} x {deck.cells}, grid {deck.mesh}{turns}"
        return Report(head, rows, ["bar: 2 % lost after one turn at 40 x 40"])

    def draw_gresho(self, figure, run_data) -> None:
        """Speed at the start and at the end, and against the radius."""
        speed = lambda block: np.hypot(block.u, block.v)  # noqa: E731
        *panels, right = make_panels(figure, 12.0, 4.0, 1, 3)
        for axis, dump in zip(panels, (run_data.dumps[0], run_data.dumps[-1]), strict=True):
            title = f"speed, t = {dump.t:.3g}"
            draw_field(axis, dump, speed, Colours(low=0.0, high=1.0), every=2, title=title)
        square = run_data.dumps[-1]["square"]
        right.plot(np.hypot(*square.centres).ravel(), speed(square).ravel(), ".", ms=2)
        right.plot([0.0, 0.2, 0.4, 0.7], [0.0, 1.0, 0.0, 0.0], "k", lw=0.8)
        right.set(xlabel="r", ylabel="speed", box_aspect=1.0)
