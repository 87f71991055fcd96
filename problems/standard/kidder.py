"""Kidder's shell: isentropic compression of a slab, ring or sphere by given pressures.

Gas with g = 1 + 2/n between the radii 0.9 and 1 is at rest, with pressure 0.1 inside and 10
outside and uniform entropy, p = s rho^g.  Under the pressures p(t) = p(0) h^-(n + 2) on its two
free surfaces, h = sqrt(1 - t²/tau²), it contracts self-similarly: every radius is h times its
initial value, every density h^-n times.  n is the number of dimensions: 1 for a slab that moves
towards the plane x = 0, 2 for a quarter of a ring, 3 for a quarter of a sphere's section beside the
axis, in axisymmetric flow.  At the end, tau sqrt(3)/2, h is one half.  The problem measures the
radii of both surfaces, mean and worst ray, and the density.

Note: the surfaces are loaded by gas at their own pressure; a wrong pressure there shows as a
first-order error of the outer radius.  Source: [Kidder1976], the shells n = 1, 2, 3.
"""

import math
from typing import Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.problems.deck import MOST_CELLS, Deck, Regrid, RunControl, key
from shockgrid.problems.initial_states import RadialProblem
from shockgrid.problems.pictures import Colours, draw_field, make_panels
from shockgrid.problems.references.exact_flows import RADII, Shell
from shockgrid.problems.report import Report
from shockgrid.regrid.measure.corners import compute_centres

END = math.sqrt(0.75)  # of tau: h is one half
SHAPES = {1: "slab", 2: "ring", 3: "sphere"}


class KidderDeck(Deck, kw_only=True):
    run: RunControl = RunControl(cfl=0.6)
    regrid: Regrid = Regrid()
    n: key(Literal[1, 2, 3], "dimensions; 1: slab, 2: ring, 3: sphere at an axis") = 2
    cells: key(int, "cells through the shell", ge=4, le=MOST_CELLS) = 20
    rays: key(int, "cells along a quarter of the shell, 1 m of a slab", ge=4, le=MOST_CELLS) = 60


class Kidder(RadialProblem):
    Deck = KidderDeck
    counted = ("cells", "rays")

    def __init__(self, deck: KidderDeck):
        super().__init__(deck, deck.n)
        self.shell = Shell(deck.n)
        self.t_end = deck.run.t_end or END * self.shell.tau
        self.check_end(0.9999 * self.shell.tau, "the shell has collapsed to the centre")

    def compute_layers(self, nodes: np.ndarray) -> np.ndarray:
        """Mean radius (ni, nj) of every cell's four nodes [m].

        The shell is a polygon, whose faces lie nearer to the centre than its nodes by 9 % of the
        shell's thickness at 12 rays: the state of a cell is that of its layer, not of its centre.
        """
        return compute_centres(self.compute_radii(nodes))

    def make_grids(self, t=0.0):
        radius = np.linspace(*RADII, self.deck.cells + 1)[:, None]
        part = np.linspace(0.0, 1.0, self.deck.rays + 1)
        if self.deck.n == 1:
            return {"shell": np.array(np.broadcast_arrays(radius, part))}
        angle = np.linspace(0.0, 0.5 * math.pi, self.deck.rays + 1)
        nodes = np.array([radius * np.cos(angle), radius * np.sin(angle)])
        nodes[0, :, -1] = 0.0
        nodes[1, :, 0] = 0.0
        return {"shell": nodes}

    def build(self):
        shell = self.shell
        nodes = self.make_grids()["shell"]
        rho = shell.compute_density(self.compute_layers(nodes), 0.0)
        p = shell.entropy * rho**shell.gamma
        block = Block("shell", IdealGas(shell.gamma), nodes, rho, 0.0, 0.0, p)
        put(block, "i_min", "free-surface", pressure=lambda t: shell.compute_pressures(t)[0])
        put(block, "i_max", "free-surface", pressure=lambda t: shell.compute_pressures(t)[1])
        return self.simulate([block])

    def measure(self, evolution) -> dict[str, float]:
        """Relative errors of both radii, how round they are, and of the density."""
        (block,) = evolution.blocks
        h = self.shell.compute_shrinking(evolution.t)
        row = {}
        for side, edge, first in (("inner", 0, RADII[0]), ("outer", -1, RADII[1])):
            part = self.compute_radii(block.nodes[:, edge, :]) / (h * first)
            row[f"{side}_error"] = abs(float(part.mean()) - 1.0)
            row[f"{side}_worst"] = float(np.abs(part - 1.0).max())
            row[f"{side}_roundness"] = float(np.ptp(part))
        exact = self.shell.compute_density(self.compute_layers(block.nodes), evolution.t)
        error = np.abs(block.rho / exact - 1.0)
        return {**row, "error_rho": float(np.average(error, weights=block.volume))}

    def report(self, run) -> Report:
        deck = self.deck
        h = self.shell.compute_shrinking(run.t) if run.begun else 0.5
        kinds = {"error": "relative error", "worst": "at the worst ray", "roundness": "round to"}
        labels = {
            f"{side}_{kind}": f"{side} radius, {label}"
            for side in ("inner", "outer")
            for kind, label in kinds.items()
        } | {"error_rho": "mean error of the density"}
        rows = [run.compare(name, label=label, digits=3) for name, label in labels.items()]
        head = f"kidder, {SHAPES[deck.n]} of {deck.cells} x {deck.rays} cells: shrunk to {h:.4g}"
        return Report(f"{head} of the first radii", rows)

    def draw_kidder(self, figure, run_data) -> None:
        """Shell at the start, on the way and at the end; radii over time; how far they are off."""
        left, right = make_panels(figure, 11.5, 5.0, 1, 2)
        dumps = run_data.dumps
        shrink = self.shell.compute_shrinking
        high = float(dumps[-1]["shell"].rho.max())
        for h, bar in ((1.0, ""), (0.75, ""), (0.5, "density")):
            dump = min(dumps, key=lambda dump: abs(shrink(dump.t) - h))
            draw_field(left, dump, "rho", Colours(low=0.0, high=high), every=4, bar=bar)
            label = f"t = {dump.t / self.shell.tau:.3g} tau"
            outer = 1.01 * RADII[1] * shrink(dump.t)
            if self.deck.n == 1:
                left.text(outer, 0.5, label, rotation=90, va="center", fontsize="small")
            else:
                left.text(0.02, outer, label)
        times, h = np.array([(dump.t / self.shell.tau, shrink(dump.t)) for dump in dumps]).T
        for edge, place, exact in ((-1, "outer", None), (0, "inner", "exact")):
            radius = [self.compute_radii(d["shell"].nodes[:, edge, :]).mean() for d in dumps]
            right.plot(times, radius, "o", ms=4, label=f"{place} surface")
            right.plot(times, RADII[edge] * h, "k", lw=0.8, label=exact)
        right.set(xlabel="t / tau", ylabel="radius")
