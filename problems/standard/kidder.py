"""Kidder's shell: isentropic compression of a ring between two given pressures.

A quarter of a ring of gas, g = 2, r from 0.9 to 1, at rest, with pressure 0.1 inside and 10 outside
and the same entropy everywhere, p = 1e5 rho².  Under the pressures p(t) = p(0) h⁻⁴ on its two free
surfaces, h = sqrt(1 - t²/tau²), it shrinks in similarity: every radius is h times its first one.
At the end, tau sqrt(3)/2, h is one half.  Measured are the radii of both surfaces and the density.

The trap: the surfaces are loaded by gas of their own pressure; a wrong release law shows as a
first-order error of the outer radius.  Source: [Kidder1976], the shell case n = 2.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.simulation import Simulation
from problems.deck import Deck, Regrid, RunControl
from problems.field_panel import draw_field
from problems.problem import Problem
from regrid.errors import BadInput
from regrid.measure.centres import compute_centres

GAMMA, ENTROPY = 2.0, 1e5
RADII = (0.9, 1.0)
PRESSURES = (0.1, 10.0)
DENSITIES = tuple(math.sqrt(p / ENTROPY) for p in PRESSURES)
# tau² = (g - 1)/2 (r2² - r1²)/(c2² - c1²), c² = g s rho
TAU = math.sqrt(
    0.5
    * (GAMMA - 1.0)
    * (RADII[1] ** 2 - RADII[0] ** 2)
    / (GAMMA * ENTROPY * (DENSITIES[1] - DENSITIES[0]))
)


def compute_shrinking(t: float) -> float:
    """h(t), the ratio of any radius to its first one; t in seconds, below TAU."""
    return math.sqrt(1.0 - (t / TAU) ** 2)


def compute_first_density(r: np.ndarray) -> np.ndarray:
    """Density at t = 0 [kg/m³] at the radii r [m]."""
    part = (r * r - RADII[0] ** 2) / (RADII[1] ** 2 - RADII[0] ** 2)
    return (1.0 - part) * DENSITIES[0] + part * DENSITIES[1]


def compute_layers(nodes: np.ndarray) -> np.ndarray:
    """Mean radius (ni, nj) of every cell's four nodes [m].

    The shell is a polygon, whose faces lie nearer to the centre than its nodes by 9 % of the
    shell's thickness at 12 rays: the state of a cell is that of its layer, not of its centre.
    """
    r = np.hypot(*nodes)
    return compute_centres(r)


class KidderDeck(Deck, kw_only=True):
    """Deck of `kidder`."""

    run: RunControl = msgspec.field(
        default_factory=lambda: RunControl(t_end=TAU * math.sqrt(0.75), cfl=0.6)
    )
    regrid: Regrid = msgspec.field(default_factory=Regrid)
    cells: Annotated[int, Meta(ge=4, description="cells through the shell")] = 20
    rays: Annotated[int, Meta(ge=4, description="cells around the quarter of the ring")] = 60


class Kidder(Problem):
    """One block with two free surfaces."""

    Deck = KidderDeck

    def __init__(self, deck: KidderDeck):
        super().__init__(deck)
        if deck.run.t_end >= TAU:
            raise BadInput(
                f"deck: run.t_end is {deck.run.t_end:g}; the shell has collapsed to the centre at "
                f"{TAU:g} s, before which the run must end"
            )

    def build(self) -> Simulation:
        deck = self.deck
        radius = np.linspace(*RADII, deck.cells + 1)[:, None]
        angle = np.linspace(0.0, 0.5 * math.pi, deck.rays + 1)[None, :]
        nodes = np.array([radius * np.cos(angle), radius * np.sin(angle)])
        nodes[0, :, -1], nodes[1, :, 0] = 0.0, 0.0
        rho = compute_first_density(compute_layers(nodes))
        block = Block("shell", IdealGas(GAMMA), nodes, rho, 0.0, 0.0, ENTROPY * rho**GAMMA)
        for side, pressure in zip(("i_min", "i_max"), PRESSURES, strict=True):
            put(
                block,
                side,
                "free-surface",
                pressure=lambda t, first=pressure: first * compute_shrinking(t) ** -4,
            )
        put(block, "j_min", "wall")
        put(block, "j_max", "wall")
        return Simulation(
            [block],
            [],
            t_end=deck.run.t_end,
            cfl=deck.run.cfl,
            threads=deck.run.threads,
            make_regridder=lambda: deck.regrid.make(threads=deck.run.threads),
        )

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Relative errors of both radii, how round they are, and of the density."""
        (block,) = evolution.blocks
        h = compute_shrinking(evolution.t)
        row = {}
        for side, edge, first in (("inner", 0, RADII[0]), ("outer", -1, RADII[1])):
            radius = np.hypot(*block.nodes[:, edge, :])
            row[f"{side}_error"] = abs(float(radius.mean()) / (h * first) - 1.0)
            row[f"{side}_roundness"] = float(np.ptp(radius)) / (h * first)
        r = compute_layers(block.nodes)
        exact = compute_first_density(r / h) / h**2
        error = np.abs(block.state[0, 1:-1, 1:-1] / exact - 1.0)
        row["error_rho"] = float(np.average(error, weights=block.volume))
        return row

    def summary(self, history, final) -> str:
        h, deck = compute_shrinking(float(history["t"][-1])), self.deck
        lines = [f"kidder, {deck.cells} x {deck.rays} cells: shrunk to {h:.4g} of the first radii"]
        for side, first in zip(("inner", "outer"), RADII, strict=True):
            lines.append(
                f"  {side} radius off by {history[f'{side}_error'][-1]:.2e} of {h * first:.4g}, "
                f"round to {history[f'{side}_roundness'][-1]:.1e}"
            )
        lines.append(f"  density off by {history['error_rho'][-1]:.2e} in the mean")
        return "\n".join(lines)

    def figures(self):
        return {"kidder": functools.partial(draw_kidder, self)}


def draw_kidder(problem: Kidder, figure, run_data) -> None:
    """Shell at the start, on the way and at the end; radii over time; how far they are off."""
    figure.set_size_inches(11.5, 5.0)
    left, right = figure.subplots(1, 2)
    dumps = run_data.dumps
    high = max(float(block.cell_fields["rho"].max()) for block in dumps[-1].blocks)
    middle = min(dumps, key=lambda dump: abs(compute_shrinking(dump.t) - 0.75))
    for dump in (dumps[0], middle, dumps[-1]):
        picture = draw_field(left, dump, "rho", low=0.0, high=high, every=4)
        radius = RADII[1] * compute_shrinking(dump.t)
        left.text(0.02, 1.01 * radius, f"{1e3 * dump.t:.3g} ms", fontsize="small")
    figure.colorbar(picture, ax=left, shrink=0.8, label="density [kg/m3]")
    left.set_xlim(0.0, 1.08)
    left.set_ylim(0.0, 1.08)
    left.set_xlabel("x [m]")
    left.set_ylabel("y [m]")
    times = np.array([dump.t for dump in dumps])
    h = np.sqrt(1.0 - (times / TAU) ** 2)
    for edge, first, words in ((-1, RADII[1], "outer"), (0, RADII[0], "inner")):
        radius = [np.hypot(*dump.blocks[0].nodes[:, edge, :]).mean() for dump in dumps]
        right.plot(1e3 * times, radius, "o", ms=4, label=f"{words} surface")
        right.plot(1e3 * times, first * h, "k", lw=0.8, label="exact" if edge == 0 else None)
    right.set_xlabel("t [ms]")
    right.set_ylabel("radius [m]")
    right.legend(frameon=False)
