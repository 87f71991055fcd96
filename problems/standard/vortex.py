"""Isentropic vortex in a periodic square: the order of accuracy of smooth flow.

The vortex of `problems.references.exact_flows` moves once through the square of 10 x 10, on a
grid at rest or on one that swings smoothly while the flow passes.  At the end the problem measures
the mean error of the cells' densities against the exact averages.

Note: at t = 10 the exact solution is the start; a code that does nothing has no error, so see
the picture too.
"""

import math
from typing import Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, RunControl, key
from shockgrid.problems.initial_states import swing_square
from shockgrid.problems.pictures import Colours, draw_field
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.exact_flows import Vortex as ExactVortex
from shockgrid.problems.report import Report

# mean |rho - exact| at t = 10, beta 5, on a fixed grid; computed independently
FIXED_GRID_ERRORS = {32: 6.73e-3, 64: 1.60e-3, 128: 3.66e-4, 256: 8.85e-5}


class VortexDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=10.0, cfl=0.8)
    cells: key(int, "cells along each side", ge=4, le=MOST_CELLS) = 64
    beta: key(float, "strength; above 10.08 the centre would be colder than 0", ge=0, le=10) = 5.0
    mesh: key(Literal["swing", "fixed"], "grid swinging smoothly, or at rest") = "swing"
    amplitude: key(float, "of the swinging nodes; the square is 10 wide", ge=0, le=1) = 0.5
    limiter: Limiter = "monotonised-central"


class Vortex(Problem):
    Deck = VortexDeck
    t_unit = "1"

    def __init__(self, deck: VortexDeck):
        super().__init__(deck)
        self.exact = ExactVortex(beta=deck.beta)

    def list_boxes(self):
        n = self.deck.cells
        period = float(self.exact.period)
        return [BlockPlan("square", (n, n), (0.0, 0.0), (period, period))]

    def make_grids(self, t=0.0):
        """Every node swings about its position, twice during the run."""
        deck = self.deck
        period = self.exact.period
        swing = deck.amplitude * math.sin(2.0 * (2.0 * math.pi / period) * t)
        return {"square": swing_square(deck.cells, 0.0, period, swing)}

    def build(self):
        deck = self.deck
        gas = IdealGas(self.exact.gamma)
        nodes = self.make_grids()["square"]
        state = self.exact.compute_cell_averages(nodes)
        block = Block("square", gas, nodes, *state, limiter=deck.limiter)
        links = [join("periodic", (block, f"{d}_min"), (block, f"{d}_max")) for d in "ij"]
        return self.simulate([block], links, mesh=deck.mesh)

    def measure(self, evolution) -> dict[str, float]:
        """Mean error of the density, at the end only (the exact averages cost many steps)."""
        if evolution.finished is None:
            return {"error_rho": math.nan}
        (block,) = evolution.blocks
        exact = self.exact.compute_cell_averages(block.nodes, evolution.t)[0]
        error = np.abs(block.rho - exact)
        return {"error_rho": float(np.average(error, weights=block.volume))}

    def report(self, run) -> Report:
        deck = self.deck
        error = run.last("error_rho")
        rows = [run.compare("error_rho", label="mean error of the density", digits=3)]
        notes = run.say_unreached("error_rho")
        known = FIXED_GRID_ERRORS.get(deck.cells)
        if known and not notes and deck.beta == 5.0 and deck.run.t_end == 10.0:
            notes = [f"{error / known:.2f} of the reference on a fixed grid, {known:.3g}"]
        return Report(f"vortex, {deck.cells} x {deck.cells}, grid {deck.mesh}", rows, notes)

    def draw_vortex(self, figure, run_data) -> None:
        """Density in the last dump with the grid, and its error."""
        dump = run_data.dumps[-1]
        n = self.deck.cells
        square = dump["square"]
        error = square.rho - self.exact.compute_cell_averages(square.nodes, dump.t)[0]
        left, right = figure.subplots(1, 2)
        most = np.abs(error).max()
        every = max(1, n // 32)
        draw_field(left, dump, "rho", every=every, bar="density")
        colours = Colours(low=-most, high=most, map="RdBu_r")
        draw_field(right, dump, lambda _: error, colours, every=every, bar="density - exact")
        figure.suptitle(f"{n} x {n}, t = {dump.t:.4g}")
