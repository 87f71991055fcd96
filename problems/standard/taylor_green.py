"""Taylor–Green vortex: a steady cell of turning gas with an energy source, on a moving grid.

In the unit square between walls u = sin(pi x) cos(pi y), v = -cos(pi x) sin(pi y), rho = 1 and
p = 1 + (cos 2 pi x + cos 2 pi y)/4 stay as they are when heat is added and taken away as
rho de/dt = pi/(4 (g - 1)) (cos 3 pi x cos pi y - cos pi x cos 3 pi y).  Grids that move with
computed velocities tangle at about t = 0.75.  Here the grid swings, with its largest distortion
at that time, rests, or follows the exact paths, on which its corners close to 15 degrees by then.
The problem measures the mean errors of velocity and pressure.

Note: without the source the flow is no solution and the error does not fall with the cells;
a grid that is back at its start when the error is taken tests little.
"""

import math
from typing import Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.pictures import Colours, draw_field, find_dump, make_panels
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.exact_flows import (
    CELL_GAMMA,
    compute_cell,
    compute_cell_velocity,
    follow_cell,
    heat_cell,
)
from shockgrid.problems.report import Report
from shockgrid.regrid.measure.corners import compute_centres

SWING_PERIOD = 0.6  # of the swinging grid [s]: at t = 0.75 it is as far as it goes
PATH_STEPS = 12  # of Runge and Kutta along the paths that nodes follow


class TaylorGreenDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=0.75, cfl=0.8)
    cells: key(int, "cells along each side of the unit square", ge=4, le=MOST_CELLS) = 32
    mesh: key(Literal["swing", "follow", "fixed"], "follow: the flow; fixed: at rest") = "swing"
    amplitude: key(float, "of the swinging nodes; the square is 1 wide", ge=0, le=0.2) = 0.1
    limiter: Limiter = "monotonised-central"


class TaylorGreen(Problem):
    Deck = TaylorGreenDeck
    t_unit = "1"
    counted = ("cells", "cells")

    def make_grids(self, t=0.0):
        """Nodes swing as the vortex turns, back and forth, or are on the paths of gas."""
        cells = self.deck.cells, self.deck.cells
        nodes = BlockPlan("square", cells, (0.0, 0.0), (1.0, 1.0)).make_nodes()
        if self.deck.mesh == "follow":
            return {"square": follow_cell(nodes, t, PATH_STEPS)}
        swing = self.deck.amplitude * math.sin(2.0 * math.pi * t / SWING_PERIOD)
        return {"square": nodes + swing * compute_cell_velocity(nodes)}

    def build(self):
        gas = IdealGas(CELL_GAMMA)
        nodes = self.make_grids()["square"]
        flow = compute_cell(*compute_centres(nodes))
        block = Block("square", gas, nodes, 1.0, *flow, limiter=self.deck.limiter)
        put_walls(block)
        return self.simulate([block], mesh=self.deck.mesh, source=heat_cell)

    def measure(self, evolution) -> dict[str, float]:
        """Mean errors of velocity and pressure against the values at the cells' centres."""
        (block,) = evolution.blocks
        u, v, p = compute_cell(*block.centres)
        error_velocity = np.hypot(block.u - u, block.v - v)
        errors = {"error_velocity": error_velocity, "error_p": np.abs(block.p - p)}
        return {name: float((e * block.volume).sum()) for name, e in errors.items()}

    def report(self, run) -> Report:
        n = self.deck.cells
        t = f", t = {run.t:.3g}" if run.begun else ""
        fields = {"error_velocity": "the velocity", "error_p": "the pressure"}
        rows = [
            run.compare(name, label=f"mean error of {field}", digits=3)
            for name, field in fields.items()
        ]
        return Report(f"taylor-green, {n} x {n}, grid {self.deck.mesh}{t}", rows)

    def draw_taylor_green(self, figure, run_data) -> None:
        """Pressure with the grid at two times and the velocity's error in the last dump."""
        *panels, right = make_panels(figure, 13.0, 4.2, 1, 3)
        last = run_data.dumps[-1]
        every = max(1, self.deck.cells // 16)
        options = {"every": every, "title": "t"}
        for axis, part in zip(panels, (0.25, 1.0), strict=True):
            dump = find_dump(run_data, part * last.t)
            draw_field(axis, dump, "p", Colours(low=0.5, high=1.5), bar="pressure", **options)

        def compute_error(block):
            u, v, _ = compute_cell(*block.centres)
            return np.hypot(block.u - u, block.v - v)

        options["bar"] = "error of the velocity"
        draw_field(right, last, compute_error, Colours(low=0.0, map="magma_r"), **options)
