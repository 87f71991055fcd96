"""Isentropic vortex in a periodic square: the order of accuracy of smooth flow.

The vortex of `problems.references.vortex` is carried once through the square of 10 x 10, on a
grid at rest or on one that swings smoothly while the flow passes.  Measured at the end is the mean
error of the cells' densities against the exact averages.

The trap: at t = 10 the exact solution is the start; a code that does nothing has no error, so look
at the picture too.
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
from problems.initial_states.rectangular_grids import swing_square
from problems.problem import BlockPlan, Problem
from problems.references.vortex import Vortex as ExactVortex

# mean |rho - exact| at t = 10, beta 5, on a fixed grid; computed independently
FIXED_GRID_ERRORS = {32: 6.73e-3, 64: 1.60e-3, 128: 3.66e-4, 256: 8.85e-5}


class VortexDeck(Deck, kw_only=True):
    """Deck of `vortex`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=10.0, cfl=0.8))
    cells: Annotated[int, Meta(ge=4, le=MOST_CELLS, description="cells along each side")] = 64
    beta: Annotated[float, Meta(ge=0, description="strength of the vortex")] = 5.0
    mesh: Annotated[
        Literal["swing", "fixed"], Meta(description="grid swinging smoothly, or at rest")
    ] = "swing"
    amplitude: Annotated[
        float, Meta(ge=0, le=1, description="of the swinging nodes; the square is 10 wide")
    ] = 0.5
    limiter: Limiter = "monotonised-central"


class Vortex(Problem):
    """One periodic block."""

    Deck = VortexDeck

    def __init__(self, deck: VortexDeck):
        super().__init__(deck)
        self.exact = ExactVortex(beta=deck.beta)

    def make_block_nodes(self, name: str, t: float) -> np.ndarray:
        """Nodes at time t: every node swings about its position, twice during the run."""
        deck, period = self.deck, self.exact.period
        swing = deck.amplitude * math.sin(2.0 * (2.0 * math.pi / period) * t)
        return swing_square(deck.cells, 0.0, period, swing)

    def plan(self) -> tuple[float, list[BlockPlan]]:
        """End time and size of the square."""
        n, period = self.deck.cells, float(self.exact.period)
        return self.deck.run.t_end, [BlockPlan("square", (n, n), (0.0, 0.0), (period, period))]

    def build(self) -> Simulation:
        deck = self.deck
        nodes = self.make_block_nodes("square", 0.0)
        block = Block(
            "square",
            IdealGas(self.exact.gamma),
            nodes,
            *self.exact.compute_cell_averages(nodes),
            limiter=deck.limiter,
        )
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
        """Mean error of the density, at the end only (the exact averages cost many steps)."""
        if evolution.finished is None:
            return {"error_rho": math.nan}
        (block,) = evolution.blocks
        exact = self.exact.compute_cell_averages(block.nodes, evolution.t)[0]
        volume = block.volume
        error = np.abs(block.state[0, 1:-1, 1:-1] - exact)
        return {"error_rho": float((error * volume).sum() / volume.sum())}

    def summary(self, history, final) -> str:
        deck = self.deck
        error = history["error_rho"][-1]
        if math.isnan(error):
            return "vortex: the error is measured at the end time, which was not reached"
        line = f"vortex, {deck.cells} x {deck.cells}, grid {deck.mesh}: mean |drho| = {error:.3g}"
        known = FIXED_GRID_ERRORS.get(deck.cells)
        if known is not None and deck.beta == 5.0 and deck.run.t_end == 10.0:
            line += f", {error / known:.2f} of the reference on a fixed grid, {known:.3g}"
        return line

    def figures(self):
        return {"vortex": functools.partial(draw_vortex, self)}


def draw_vortex(problem: Vortex, figure, run_data) -> None:
    """Density in the last dump with the grid, and its error."""
    dump = run_data.dumps[-1]
    (block,) = dump.blocks
    rho = block.cell_fields["rho"]
    exact = problem.exact.compute_cell_averages(block.nodes, dump.t)[0]
    every = max(1, problem.deck.cells // 32)
    x, y = block.nodes
    panels = ((rho, "density", "viridis"), (rho - exact, "density - exact", "RdBu_r"))
    for axis, (values, title, colours) in zip(figure.subplots(1, 2), panels, strict=True):
        most = np.abs(values).max() if values is not rho else None
        picture = axis.pcolormesh(
            x, y, values, cmap=colours, vmin=None if most is None else -most, vmax=most
        )
        figure.colorbar(picture, ax=axis, shrink=0.8)
        axis.plot(x[::every].T, y[::every].T, color="k", lw=0.2)
        axis.plot(x[:, ::every], y[:, ::every], color="k", lw=0.2)
        axis.set_aspect("equal")
        axis.set_title(title, fontsize="medium")
    figure.suptitle(f"{problem.deck.cells} x {problem.deck.cells}, t = {dump.t:.4g}")
