"""Noh's problem: cold gas runs into its centre and stops in a shock.

Gas of density 1 moves with speed 1 towards the centre.  A shock moves outwards at (gamma - 1)/2;
behind it the gas is at rest with density ((gamma + 1)/(gamma - 1))^n in n dimensions, ahead of it
the density is (1 + t/r)^(n-1).  The grid is rectangular: a strip, a quarter of the plane, or for a
sphere the quarter beside the axis.  Outer sides are open, with the exact state beyond.  The problem
measures the final relative error of the density out to twice the shock's radius.

Note: every shock-capturing scheme overheats the first gas at the centre ("wall heating"); its
density remains too low.  Source: [Noh1987].
"""

import functools
import math

import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos import IdealGas
from problems.deck import MOST_CELLS, Deck, Limiter, RunControl, key
from problems.initial_states import RadialFlow, Symmetry
from problems.problem import Problem, Report, Row, compare, get_last, say_unreached
from problems.references.exact_flows import DIMENSIONS
from regrid.errors import BadInput
from regrid.measure.corners import compute_centres

# relative L1 of the density at 100 x 100 cells, as published by or measured on other codes
PEERS = {
    "cylindrical": "Athena++ .036, pyro2 .051, BookLeaf (polar grid) .033",
    "spherical": "PENNANT .14",
}


class NohDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=0.6, cfl=0.8)
    geometry: key(Symmetry, "shape of the flow") = "cylindrical"
    cells: key(int, "cells along each side, 1 long", ge=8, le=MOST_CELLS) = 100
    gamma: key(float, "ratio of specific heats", ge=1.01) = 5.0 / 3.0
    pressure: key(float, "of the cold gas; exact theory has 0", ge=1e-8, le=0.01) = 1e-6
    shrink: key(float, "rate at which the grid shrinks to the centre [1/s]; 0: fixed", ge=0) = 0.0
    limiter: Limiter = "monotonised-central"


class Noh(Problem):
    Deck = NohDeck
    counted = ("cells", "cells")

    def __init__(self, deck: NohDeck):
        super().__init__(deck)
        self.flow, self.dimensions = RadialFlow(deck.geometry), DIMENSIONS[deck.geometry]
        self.shock_speed = 0.5 * (deck.gamma - 1.0)
        shock, size = self.shock_speed * deck.run.t_end, 1.0 - deck.shrink * deck.run.t_end
        if shock > 0.9 * size:
            raise BadInput(
                f"deck: at run.t_end = {deck.run.t_end:g} the shock is at r = {shock:.3g} and the "
                f"grid ends at {size:.3g} (shrink = {deck.shrink:g}); end earlier or shrink less"
            )

    def compute_density(self, r: np.ndarray, t: float) -> np.ndarray:
        """Exact density at radii r and time t."""
        n, gamma = self.dimensions, self.deck.gamma
        before = (1.0 + t / np.maximum(r, 1e-12)) ** (n - 1)
        behind = ((gamma + 1.0) / (gamma - 1.0)) ** n
        return np.where(r < self.shock_speed * t, behind, before)

    def compute_stream(self, points: np.ndarray, t: float) -> tuple:
        """Exact rho, u, v, p of the oncoming gas at points (2, n)."""
        r = self.flow.compute_radii(points)
        rise = (1.0 + t / r) ** (self.dimensions - 1)
        u, v = -points / r if self.dimensions > 1 else (-np.ones_like(r), np.zeros_like(r))
        return rise, u, v, self.deck.pressure * rise**self.deck.gamma

    def make_grids(self, t=0.0):
        nodes, factor = self.flow.make_nodes(self.deck.cells, 1.0), 1.0 - self.deck.shrink * t
        factors = np.reshape((factor, 1.0 if self.dimensions == 1 else factor), (2, 1, 1))
        return {"gas": nodes * factors}

    def build(self):
        deck, nodes = self.deck, self.make_grids()["gas"]
        start = self.compute_stream(compute_centres(nodes), 0.0)
        block = Block("gas", IdealGas(deck.gamma), nodes, *start, limiter=deck.limiter)
        for side in ("i_max", "j_max")[: self.dimensions]:

            def beyond(t, side=side):
                line = block.side_line(side, self.make_grids(t)["gas"])
                return self.compute_stream(0.5 * (line[:, 1:] + line[:, :-1]), t)

            put(block, side, "inflow", state=beyond)
        self.flow.close(block)
        mesh = "given" if deck.shrink > 0.0 else "fixed"
        return self.simulate([block], mesh=mesh, geometry=self.flow.geometry)

    def measure(self, evolution) -> dict[str, float]:
        """Mean density and pressure behind the shock; at the end the error of the density."""
        (block,) = evolution.blocks
        t, shock = evolution.t, self.shock_speed * evolution.t
        r = self.flow.compute_radii(block.centres)
        weight = block.volume * ((r > 0.3 * shock) & (r < 0.8 * shock))
        row = dict.fromkeys(("density_behind", "pressure_behind", "error_rho"), math.nan)
        if weight.any():
            state = {"density_behind": block.state[0], "pressure_behind": block.state[3]}
            for name, cells in state.items():
                row[name] = float(np.average(cells[1:-1, 1:-1], weights=weight))
        if evolution.finished is not None:
            exact = functools.partial(self.compute_density, t=t)
            row["error_rho"] = self.flow.measure_error(block, exact, 2.0 * shock)
        return row

    def report(self, history, final=None) -> Report:
        deck, t = self.deck, get_last(history, "t") if history else self.t_end
        behind = float(self.compute_density(np.zeros(1), max(t, 1e-9))[0])
        reach, p = self.shock_speed * t, self.shock_speed * behind
        words = f"relative error of the density, r < {2 * reach:.3g}"
        grid = f"grid shrinking at {deck.shrink:g} a second" if deck.shrink else "fixed grid"
        rows = [
            compare(history, "density_behind", behind, "density behind the shock"),
            compare(history, "pressure_behind", p, "pressure behind it"),
            Row("shock_radius", theory=reach),
            compare(history, "error_rho", label=words),
        ]
        notes = say_unreached(history, "error_rho")
        if deck.cells == 100 and deck.geometry in PEERS:
            notes.append(f"other codes: {PEERS[deck.geometry]}")
        return Report(f"noh, {deck.geometry}, {deck.cells} cells per side, {grid}", rows, notes)

    def draw_noh(self, figure, run_data) -> None:
        """Density in the last dump out to twice the shock's radius, and against the radius."""
        dump, exact = run_data.dumps[-1], self.compute_density
        high = float(exact(np.zeros(1), max(dump.t, 1e-9))[0])
        reach = max(2.0 * self.shock_speed * dump.t, 0.05)
        self.flow.draw(figure, dump, functools.partial(exact, t=dump.t), reach, high=1.1 * high)
