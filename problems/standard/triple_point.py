"""Triple point: three gases in a shock tube, whose contacts roll up into a vortex.

A tube of 7 x 3: on the left gas under pressure 1 (rho 1, g 1.5), on the right pressure 0.1, below
y = 1.5 rho 1 and g 1.4, above it rho 0.125 and g 1.5.  The shock runs faster through the light gas
above than through the heavy one below; where the three gases meet, the contacts roll up.  Each gas
is a block, its contacts are grid lines, and the point where all three meet is a node of all.

Measured are the states beside the left contact far from the point, against the plane Riemann
problems left|bottom and left|top, and the mass of each gas.  The trap: a contact of no thickness
rolls up without end, and at the point a block's corner would open beyond a straight angle, where
`hydro.motion.constraints` holds it; finer grids wind further, and where the point is does not
converge.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.links.join import join
from hydro.motion.line import LineRule
from hydro.simulation import Simulation
from problems.deck import MOST_CELLS, Deck, Limiter, Regrid, RunControl
from problems.field_panel import draw_field
from problems.initial_states.rectangular_grids import make_plane_grid
from problems.problem import BlockPlan, Problem
from problems.references.riemann import solve_riemann
from regrid.errors import BadInput

# density, pressure, gamma; x from and to; y from and to
GASES = {
    "left": (1.0, 1.0, 1.5, (0.0, 1.0), (0.0, 3.0)),
    "bottom": (1.0, 0.1, 1.4, (1.0, 7.0), (0.0, 1.5)),
    "top": (0.125, 0.1, 1.5, (1.0, 7.0), (1.5, 3.0)),
}
EARLY = 0.25  # until then the states beside the walls have not felt the point


class TriplePointDeck(Deck, kw_only=True):
    """Deck of `triple-point`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=5.0, cfl=0.8))
    regrid: Regrid = msgspec.field(
        default_factory=lambda: Regrid(epsilon=0.1, options={"strengthening": 1.0, "curves": False})
    )
    cells: Annotated[
        int, Meta(ge=4, le=MOST_CELLS, description="cells in a length of 1, an even number")
    ] = 10
    thickness: (
        Annotated[
            float,
            Meta(
                ge=0,
                le=1.0,
                description="shorter waves of contacts decay; left out: 0.75 of a first cell",
            ),
        ]
        | None
    ) = None
    relax: Annotated[
        float, Meta(ge=0, le=1, description="part of the way to even spacing of nodes in a step")
    ] = 0.05
    limiter: Limiter = "van-leer"


class TriplePoint(Problem):
    """Three blocks; the left one's far side is cut at the triple point."""

    Deck = TriplePointDeck
    units: ClassVar = {"point_x": "m", "point_y": "m"}

    def __init__(self, deck: TriplePointDeck):
        super().__init__(deck)
        if deck.cells % 2:
            raise BadInput(
                f"deck: cells is {deck.cells}; it must be even, the point is half a length up"
            )

    def count_cells(self, span: tuple[float, float]) -> int:
        """Cells along a side."""
        return round(self.deck.cells * (span[1] - span[0]))

    def plan(self):
        """End time and sizes of the blocks."""
        plans = [
            BlockPlan(name, (self.count_cells(x), self.count_cells(y)), (x[0], y[0]), (x[1], y[1]))
            for name, (_, _, _, x, y) in GASES.items()
        ]
        return self.deck.run.t_end, plans

    def build(self) -> Simulation:
        deck, blocks = self.deck, {}
        for name, (rho, p, gamma, x, y) in GASES.items():
            nodes = make_plane_grid(
                *(np.linspace(*span, self.count_cells(span) + 1) for span in (x, y))
            )
            blocks[name] = Block(
                name, IdealGas(gamma), nodes, rho, 0.0, 0.0, p, limiter=deck.limiter
            )
        left, bottom, top = blocks.values()
        links = [
            join("interface", (left, "i_max", 0, bottom.nj), (bottom, "i_min")),
            join("interface", (left, "i_max", bottom.nj, left.nj), (top, "i_min")),
            join("interface", (bottom, "j_max"), (top, "j_min")),
        ]
        for block, sides in (
            (left, ("i_min", "j_min", "j_max")),
            (bottom, ("i_max", "j_min")),
            (top, ("i_max", "j_max")),
        ):
            for side in sides:
                put(block, side, "wall")
        return Simulation(
            list(blocks.values()),
            links,
            t_end=deck.run.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            line_rule=LineRule(relax=deck.relax, thickness=deck.thickness),
            make_regridder=lambda: deck.regrid.make(threads=deck.run.threads),
        )

    @functools.cached_property
    def exact(self):
        """Plane Riemann solutions of the left gas with the other two."""
        rho, p, gamma = GASES["left"][:3]
        return {
            name: solve_riemann(
                IdealGas(gamma), (rho, 0.0, p),
                IdealGas(GASES[name][2]), (GASES[name][0], 0.0, GASES[name][1]),
            )
            for name in ("bottom", "top")
        }  # fmt: skip

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Where the point is; early on, star states beside the contacts at the walls."""
        left, bottom, top = evolution.blocks
        row = {"point_x": float(top.nodes[0, 0, 0]), "point_y": float(top.nodes[1, 0, 0])}
        for name, block, j in (("bottom", bottom, 0), ("top", top, -1)):
            exact, t = self.exact[name], evolution.t
            far = max(abs(exact.left_wave.head), exact.right_wave.head) * t
            known = 0.1 < t < EARLY and far < 0.9
            x = 1.0 + exact.u * t
            for side, gas, wave in (("l", left, exact.left_wave), ("r", block, exact.right_wave)):
                edges = gas.nodes[0, :, j]
                middle = 0.5 * (edges[1:] + edges[:-1])
                width = abs(wave.tail - exact.u) * t
                position = x + (0.5 if side == "r" else -0.5) * width
                inside = np.abs(middle - position) < 0.25 * width
                known = known and bool(inside.any())
                for q, label in ((0, "rho"), (1, "u"), (3, "p")):
                    value = gas.state[q, 1:-1, j - 1 if j < 0 else 1]
                    row[f"{label}_{name}_{side}"] = (
                        float(value[inside].mean()) if known else math.nan
                    )
        return row

    def watch(self, evolution):
        """Only cells along sides are measured."""
        return {}

    def find_last_star(self, history) -> int | None:
        """Row of the history with the latest star states; None where there are none."""
        known = np.isfinite(history["p_top_r"]) & np.isfinite(history["p_bottom_r"])
        return int(np.flatnonzero(known)[-1]) if known.any() else None

    def errors(self, history) -> dict[str, float]:
        """Largest relative errors of pressure and velocity beside the contacts, and of masses."""
        last = self.find_last_star(history)
        star = math.nan
        if last is not None:
            star = max(
                abs(float(history[f"{label}_{name}_{side}"][last]) / value - 1.0)
                for name, exact in self.exact.items()
                for side in "lr"
                for label, value in (("p", exact.p), ("u", exact.u))
            )
        masses = [history[f"total_mass_{name}"] for name in GASES]
        return {"star": star, "mass": max(float(np.ptp(m) / m[0]) for m in masses)}

    def predict(self) -> dict[str, float]:
        """Exact states beside the left contact at the walls, by the columns of measured ones."""
        found = {}
        for name, exact in self.exact.items():
            for side, rho in (("l", exact.rho_left), ("r", exact.rho_right)):
                for label, value in (("rho", rho), ("u", exact.u), ("p", exact.p)):
                    found[f"{label}_{name}_{side}"] = float(value)
        return found

    def summary(self, history, final) -> str:
        lines = [f"triple-point, {self.deck.cells} cells in a length of 1:"]
        last = self.find_last_star(history)
        if last is not None:
            lines.append(
                f"  states beside the left contact at the walls, t = {history['t'][last]:.3f}:"
            )
            for name, exact in self.exact.items():
                words = []
                for side, rho in (("l", exact.rho_left), ("r", exact.rho_right)):
                    for label, value in (("rho", rho), ("u", exact.u), ("p", exact.p)):
                        found = history[f"{label}_{name}_{side}"][last]
                        words.append(f"{label} {found:.5g} ({100 * (found / value - 1):+.2f} %)")
                lines.append(f"    {name}: " + ", ".join(words))
        lines.append(
            f"  t = {history['t'][-1]:.3g}: the point is at x = {history['point_x'][-1]:.4f}, "
            f"y = {history['point_y'][-1]:.4f}"
        )
        return "\n".join(lines)

    def figures(self):
        return {"triple-point": functools.partial(draw_triple_point, self)}


def draw_triple_point(problem: TriplePoint, figure, run_data) -> None:
    """Density with the contacts, and the grid around the vortex, at the end."""
    dump = run_data.dumps[-1]
    blocks = {block.name: block for block in dump.blocks}
    line = blocks["top"].nodes[:, :, 0]
    contact = blocks["left"].nodes[:, -1, :]
    figure.set_size_inches(9.0, 6.6)
    top, below = figure.subplots(2, 1, sharex=True, sharey=True)
    picture = draw_field(
        top, dump, lambda block: np.log10(block.cell_fields["rho"]), lines=(line, contact)
    )
    figure.colorbar(picture, ax=(top, below), shrink=0.6, label="log10 of density in kg/m3")
    for block, colour in zip(dump.blocks, ("C0", "C1", "C2"), strict=True):
        x, y = block.nodes
        below.plot(x.T, y.T, color=colour, lw=0.25)
        below.plot(x, y, color=colour, lw=0.25)
    below.set_aspect("equal")
    below.set_xlabel("x [m]")
    below.set_ylabel("y [m]")
    top.set_xlabel("")
    top.set_title(f"t = {dump.t:.3g} s", fontsize="medium")
