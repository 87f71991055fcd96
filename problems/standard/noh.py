"""Noh's problem: cold gas runs into its centre and stops in a shock.

Gas of density 1 moves with speed 1 towards the centre.  A shock moves outwards at (gamma - 1)/2;
behind it the gas is at rest with density ((gamma + 1)/(gamma - 1))^n in n dimensions, ahead of it
the density is (1 + t/r)^(n-1).  The grid is rectangular: a strip, a quarter of the plane, or for a
sphere the quarter beside the axis.  Outer sides are open, with the exact state beyond.  The problem
measures the final relative error of the density out to twice the shock's radius.

Note: every shock-capturing scheme overheats the first gas at the centre ("wall heating"); its
density remains too low.  Source: [Noh1987].
"""

import math
from typing import ClassVar

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, RunControl, key
from shockgrid.problems.initial_states import RadialProblem, Symmetry
from shockgrid.problems.references.exact_flows import DIMENSIONS
from shockgrid.problems.report import Report, Row
from shockgrid.regrid.measure.corners import compute_centres


class NohDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=0.6, cfl=0.8)
    geometry: key(Symmetry, "shape of the flow") = "cylindrical"
    cells: key(int, "cells along each side, 1 long", ge=8, le=MOST_CELLS) = 100
    gamma: key(float, "ratio of specific heats", ge=1.01, le=1000) = 5.0 / 3.0
    pressure: key(
        float, "of the cold gas (0 in theory); 1e-4 or more if the grid shrinks", ge=1e-8, le=0.01
    ) = 1e-6
    shrink: key(float, "rate of the grid's shrinking [1/s]; 0: fixed", ge=0, le=1e9) = 0.0
    limiter: Limiter = "monotonised-central"


class Noh(RadialProblem):
    Deck = NohDeck
    peers: ClassVar = {  # relative L1 of the density, as published by or measured on other codes
        "cylindrical": "Athena++ 0.036, pyro2 0.051, BookLeaf (polar grid) 0.033",
        "spherical": "PENNANT 0.14",
    }

    def __init__(self, deck: NohDeck):
        super().__init__(deck, DIMENSIONS[deck.geometry])
        self.shock_speed = 0.5 * (deck.gamma - 1.0)
        shock = self.shock_speed * deck.run.t_end
        size = 1.0 - deck.shrink * deck.run.t_end
        if shock > 0.9 * size:
            raise deck.error(
                "run.t_end",
                f"the shock is at r = {shock:.3g} then, the grid's end at {size:.3g}; end earlier",
            )

    def compute_density(self, r, t):
        n = self.dimensions
        gamma = self.deck.gamma
        before = (1.0 + t / np.maximum(r, 1e-12)) ** (n - 1)
        behind = ((gamma + 1.0) / (gamma - 1.0)) ** n
        return np.where(r < self.shock_speed * t, behind, before)

    def compute_stream(self, points: np.ndarray, t: float) -> tuple:
        """Exact rho, u, v, p of the oncoming gas at points (2, n)."""
        r = self.compute_radii(points)
        rise = (1.0 + t / r) ** (self.dimensions - 1)
        u, v = -points / r if self.dimensions > 1 else (-np.ones_like(r), np.zeros_like(r))
        return rise, u, v, self.deck.pressure * rise**self.deck.gamma

    def scale(self, nodes: np.ndarray, t: float) -> np.ndarray:
        """Nodes (2, ...) of the first grid at time t."""
        factor = 1.0 - self.deck.shrink * t
        return np.stack([factor * nodes[0], nodes[1] * (1.0 if self.dimensions == 1 else factor)])

    def make_grids(self, t=0.0):
        return {"gas": self.scale(self.lay_nodes(1.0), t)}

    def build(self):
        deck = self.deck
        nodes = self.make_grids()["gas"]
        start = self.compute_stream(compute_centres(nodes), 0.0)
        block = Block("gas", IdealGas(deck.gamma), nodes, *start, limiter=deck.limiter)
        for side in ("i_max", "j_max")[: self.dimensions]:
            first = block.side_line(side, nodes)

            def beyond(t, first=first):
                line = self.scale(first, t)
                return self.compute_stream(0.5 * (line[:, 1:] + line[:, :-1]), t)

            put(block, side, "inflow", state=beyond)
        return self.simulate([block], mesh="given" if deck.shrink > 0.0 else "fixed")

    def measure(self, evolution) -> dict[str, float]:
        """Mean density and pressure behind the shock; at the end the error of the density."""
        (block,) = evolution.blocks
        shock = self.shock_speed * evolution.t
        r = self.compute_radii(block.centres)
        weight = block.volume * ((r > 0.3 * shock) & (r < 0.8 * shock))
        row = dict.fromkeys(("density_behind", "pressure_behind"), math.nan)
        for name, cells in zip(row, (block.rho, block.p), strict=True):
            if weight.any():
                row[name] = float(np.average(cells, weights=weight))
        return {**row, "error_rho": self.measure_error(evolution, 2.0 * shock)}

    def report(self, run) -> Report:
        deck = self.deck
        t = run.t
        behind = float(self.compute_density(np.zeros(1), max(t, 1e-9))[0])
        reach = self.shock_speed * t
        p = self.shock_speed * behind
        label = f"relative error of the density, r < {2 * reach:.3g}"
        grid = f"grid shrinking at {deck.shrink:g} a second" if deck.shrink else "fixed grid"
        rows = [
            run.compare("density_behind", behind, "density behind the shock"),
            run.compare("pressure_behind", p, "pressure behind it"),
            Row("shock_radius", theory=reach),
            run.compare("error_rho", label=label),
        ]
        head = f"noh, {deck.geometry}, {deck.cells} cells per side, {grid}"
        return Report(head, rows, self.list_notes(run))

    def draw_noh(self, figure, run_data) -> None:
        """Density in the last dump out to twice the shock's radius, and against the radius."""
        dump = run_data.dumps[-1]
        high = float(self.compute_density(np.zeros(1), max(dump.t, 1e-9))[0])
        self.draw(figure, dump, max(2.0 * self.shock_speed * dump.t, 0.05), high=1.1 * high)
