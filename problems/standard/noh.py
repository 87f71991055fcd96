"""Noh's problem: cold gas runs into its centre and stops in a shock.

Gas of density 1 moves with speed 1 towards the centre.  A shock runs out from there at
(gamma - 1)/2; behind it the gas is at rest with density ((gamma + 1)/(gamma - 1))^n in n
dimensions, before it density is (1 + t/r)^(n-1).  The grid is rectangular and knows nothing of the
centre: a strip, a quarter of the plane, or for a sphere the quarter beside the axis.  Outer sides
are open, with the exact state beyond.  Measured at the end is the relative error of the density
out to twice the shock's radius.

The trap: the first gas at the centre is heated too much by any scheme that captures shocks ("wall
heating"); density is too low there for ever.  Source: [Noh1987].
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
from problems.references.sedov import DIMENSIONS
from regrid.errors import BadInput
from regrid.measure.corners import compute_centres

# relative L1 of the density at 100 x 100 cells, as published by or measured on other codes
PEERS = {
    "cylindrical": "Athena++ .036, pyro2 .051, BookLeaf (polar grid) .033",
    "spherical": "PENNANT .14",
}


class NohDeck(Deck, kw_only=True):
    """Deck of `noh`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=0.6, cfl=0.8))
    geometry: Annotated[
        Literal["plane", "cylindrical", "spherical"], Meta(description="shape of the flow")
    ] = "cylindrical"
    cells: Annotated[
        int, Meta(ge=8, le=MOST_CELLS, description="cells along each side, 1 long")
    ] = 100
    gamma: Annotated[float, Meta(ge=1.01, description="ratio of specific heats")] = 5.0 / 3.0
    pressure: Annotated[
        float, Meta(ge=1e-8, le=0.01, description="of the cold gas; exact theory has 0")
    ] = 1e-6
    shrink: Annotated[
        float,
        Meta(ge=0, description="rate at which the grid shrinks to the centre [1/s]; 0: fixed"),
    ] = 0.0
    limiter: Limiter = "monotonised-central"


class Noh(Problem):
    """One block."""

    Deck = NohDeck

    def __init__(self, deck: NohDeck):
        super().__init__(deck)
        self.dimensions = DIMENSIONS[deck.geometry]
        self.shock_speed = 0.5 * (deck.gamma - 1.0)
        size = 1.0 - deck.shrink * deck.run.t_end
        if self.shock_speed * deck.run.t_end > 0.9 * size:
            raise BadInput(
                f"deck: at run.t_end = {deck.run.t_end:g} the shock is at r = "
                f"{self.shock_speed * deck.run.t_end:.3g} and the grid ends at {size:.3g} "
                f"(shrink = {deck.shrink:g}); end earlier or shrink less"
            )

    def compute_density(self, r: np.ndarray, t: float) -> np.ndarray:
        """Exact density at radii r and time t."""
        n, gamma = self.dimensions, self.deck.gamma
        before = (1.0 + t / np.maximum(r, 1e-12)) ** (n - 1)
        behind = ((gamma + 1.0) / (gamma - 1.0)) ** n
        return np.where(r < self.shock_speed * t, behind, before)

    def compute_stream(self, points: np.ndarray, t: float) -> tuple:
        """Exact rho, u, v, p of the oncoming gas at points (2, n)."""
        r = compute_radii(self.deck.geometry, points)
        rise = (1.0 + t / r) ** (self.dimensions - 1)
        u, v = -points / r
        if self.dimensions == 1:
            u, v = -np.ones_like(r), np.zeros_like(r)
        return rise, u, v, self.deck.pressure * rise**self.deck.gamma

    def make_block_nodes(self, name: str, t: float) -> np.ndarray:
        """Nodes at time t."""
        nodes = make_nodes(self.deck.geometry, self.deck.cells, 1.0)
        factor = 1.0 - self.deck.shrink * t
        return nodes * (np.reshape((factor, 1.0), (2, 1, 1)) if self.dimensions == 1 else factor)

    def estimate_cells(self) -> int:
        return self.deck.cells**2

    def build(self) -> Simulation:
        deck = self.deck
        nodes = self.make_block_nodes("gas", 0.0)
        start = self.compute_stream(compute_centres(nodes), 0.0)
        block = Block("gas", IdealGas(deck.gamma), nodes, *start, limiter=deck.limiter)
        for side in close_inside(block, deck.geometry):

            def beyond(t, side=side):
                line = block.side_line(side, self.make_block_nodes("gas", t))
                return self.compute_stream(0.5 * (line[:, 1:] + line[:, :-1]), t)

            put(block, side, "inflow", state=beyond)
        return Simulation(
            [block],
            [],
            t_end=deck.run.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            mesh=self.make_block_nodes if deck.shrink > 0.0 else "fixed",
            geometry=find_flow_geometry(deck.geometry),
        )

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Mean density and pressure behind the shock; at the end the error of the density."""
        (block,) = evolution.blocks
        t, shock = evolution.t, self.shock_speed * evolution.t
        r = compute_radii(self.deck.geometry, compute_centres(block.nodes))
        middle = (r > 0.3 * shock) & (r < 0.8 * shock)
        row = {"density_behind": math.nan, "pressure_behind": math.nan, "error_rho": math.nan}
        if middle.any():
            weight = block.volume * middle
            rho, _, _, p = block.state[:, 1:-1, 1:-1]
            row["density_behind"] = float((rho * weight).sum() / weight.sum())
            row["pressure_behind"] = float((p * weight).sum() / weight.sum())
        if evolution.finished is not None:
            row["error_rho"] = measure_error(
                self.deck.geometry, block, lambda r: self.compute_density(r, t), 2.0 * shock
            )
        return row

    def predict(self) -> dict[str, float]:
        """Density and pressure behind the shock, and its radius [m], at the end time."""
        t = float(self.deck.run.t_end)
        behind = float(self.compute_density(np.zeros(1), t)[0])
        return {
            "density_behind": behind,
            "pressure_behind": 0.5 * (self.deck.gamma - 1.0) * behind,
            "shock_radius": self.shock_speed * t,
        }

    def summary(self, history, final) -> str:
        deck, t = self.deck, float(history["t"][-1])
        behind = float(self.compute_density(np.zeros(1), max(t, 1e-9))[0])
        pressure = 0.5 * (deck.gamma - 1.0) * behind
        lines = [
            f"noh, {deck.geometry}, {deck.cells} cells a side, "
            + (f"grid shrinking at {deck.shrink:g} a second" if deck.shrink else "fixed grid"),
            f"  behind the shock: density {history['density_behind'][-1]:.4g} ({behind:.4g}), "
            f"pressure {history['pressure_behind'][-1]:.4g} ({pressure:.4g})",
        ]
        error = history["error_rho"][-1]
        if math.isnan(error):
            lines.append("  the error is measured at the end time, which was not reached")
        else:
            lines.append(
                f"  relative error of the density in r < {2.0 * self.shock_speed * t:.3g}: "
                f"{error:.4f}"
            )
            if deck.cells == 100 and deck.geometry in PEERS:
                lines[-1] += f" ({PEERS[deck.geometry]})"
        return "\n".join(lines)

    def figures(self):
        return {"noh": functools.partial(draw_noh, self)}


def draw_noh(problem: Noh, figure, run_data) -> None:
    """Density in the last dump out to twice the shock's radius, and against the radius."""
    figure.set_size_inches(11.5, 4.8)
    dump = run_data.dumps[-1]
    left, right = figure.subplots(1, 2)
    high = float(problem.compute_density(np.zeros(1), max(dump.t, 1e-9))[0])
    picture = draw_field(left, dump, "rho", low=0.0, high=1.1 * high)
    figure.colorbar(picture, ax=left, shrink=0.8, label="density [kg/m3]")
    reach = max(2.0 * problem.shock_speed * dump.t, 0.05)
    if problem.deck.geometry != "plane":
        left.set_xlim(0.0, reach)
        left.set_ylim(0.0, reach)
    r = np.linspace(1e-3, 1.0, 1000)
    draw_radial(right, dump.blocks[0], problem.deck.geometry, r, problem.compute_density(r, dump.t))
    right.set_xlim(0.0, reach)
    right.set_xlabel("x [m]" if problem.deck.geometry == "plane" else "r [m]")
    right.set_ylabel("density [kg/m3], every cell; exact in black")
    figure.suptitle(f"{problem.deck.geometry}, t = {dump.t:.3g} s", fontsize="medium")
