"""Triple point: three gases in a shock tube, whose contacts roll up into a vortex.

A tube of 7 x 3: on the left gas at pressure 1 (rho 1, g 1.5), on the right pressure 0.1, below
y = 1.5 rho 1 and g 1.4, above it rho 0.125 and g 1.5.  The shock is faster in the light gas above
than in the heavy one below; where the three gases meet, the contacts roll up.  Each gas is a block,
its contacts are grid lines, and the point where all three meet is a node of all.

The problem measures the states beside the left contact far from the point, against the plane
Riemann problems left|bottom and left|top, and the mass of each gas.  Note: a contact of zero
thickness rolls up without end, and at the point a block's corner would open beyond a straight
angle, which `hydro.motion.constraints` prevents.  Finer grids wind further, and the position of the
point does not converge.
"""

import math
from typing import ClassVar

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.motion.line import LineRule
from shockgrid.problems.deck import (
    MOST_CELLS,
    Deck,
    HandoverKey,
    Limiter,
    RefinementKey,
    Regrid,
    RunControl,
    key,
)
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.riemann import solve_riemann
from shockgrid.problems.report import Report, Row
from shockgrid.problems.signals import average_plateau

# equation of state; density, velocity, pressure; lower left and upper right corner
GASES = {
    "left": (IdealGas(1.5), (1.0, 0.0, 1.0), (0.0, 0.0), (1.0, 3.0)),
    "bottom": (IdealGas(1.4), (1.0, 0.0, 0.1), (1.0, 0.0), (7.0, 1.5)),
    "top": (IdealGas(1.5), (0.125, 0.0, 0.1), (1.0, 1.5), (7.0, 3.0)),
}
EARLY_TIME_PART = 0.25  # until then the states beside the walls have not felt the point


class TriplePointDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=5.0, cfl=0.8)
    regrid: Regrid = Regrid(epsilon=0.1, options={"strengthening": 1.0, "curves": False})
    cells: key(int, "cells in a length of 1, an even number", ge=4, le=MOST_CELLS) = 10
    thickness: key(float | None, "smoothing length. If left out: 0.75 of a cell", ge=0, le=1) = None
    relax: key(float, "fraction of the way to even node spacing in a step", ge=0, le=1) = 0.05
    handover: HandoverKey = False
    handover_refinement: RefinementKey = 2
    limiter: Limiter = "van-leer"


class TriplePoint(Problem):
    Deck = TriplePointDeck
    t_unit = "1"
    units: ClassVar = {"point_x": "m", "point_y": "m"}

    def __init__(self, deck: TriplePointDeck):
        super().__init__(deck)
        if deck.cells % 2:
            raise deck.error("cells", "it must be even, the point is half a length up")
        left = GASES["left"][:2]  # plane Riemann solutions with the other two
        self.exact = {name: solve_riemann(*left, *GASES[name][:2]) for name in ("bottom", "top")}

    def list_boxes(self):
        boxes = []
        for name, (_, _, low, high) in GASES.items():
            i, j = (round(self.deck.cells * size) for size in np.subtract(high, low))
            boxes.append(BlockPlan(name, (i, j), low, high))
        return boxes

    def build(self):
        deck = self.deck
        blocks = []
        for name, nodes in self.make_grids().items():
            eos, (rho, u, p), *_ = GASES[name]
            blocks.append(Block(name, eos, nodes, rho, u, 0.0, p, limiter=deck.limiter))
        left, bottom, top = blocks
        pairs = (
            ((left, "i_max", 0, bottom.nj), (bottom, "i_min")),
            ((left, "i_max", bottom.nj, left.nj), (top, "i_min")),
            ((bottom, "j_max"), (top, "j_min")),
        )
        links = [join("interface", *pair) for pair in pairs]
        put_walls(*blocks)
        rule = LineRule(relax=deck.relax, thickness=deck.thickness)
        handover = self.make_handover(blocks, 1.0 / deck.cells)
        return self.simulate(blocks, links, line_rule=rule, handover=handover)

    def measure(self, evolution) -> dict[str, float]:
        """Where the point is; early on, star states beside the contacts at the walls.

        All nan where the gases are on one grid.
        """
        if len(evolution.blocks) == 1:
            return dict.fromkeys(("point_x", "point_y", *self.list_stars()), math.nan)
        left, bottom, top = evolution.blocks
        row = {"point_x": float(top.nodes[0, 0, 0]), "point_y": float(top.nodes[1, 0, 0])}
        for name, block, j in (("bottom", bottom, 0), ("top", top, -1)):
            exact = self.exact[name]
            t = evolution.t
            far = max(abs(exact.left_wave.head), exact.right_wave.head) * t
            for side, gas, wave in (("l", left, exact.left_wave), ("r", block, exact.right_wave)):
                edges = gas.nodes[0, :, j] - 1.0
                cells = gas.state[[0, 1, 3], 1:-1, 1:-1][..., j]
                means = average_plateau(edges, cells, (exact.u * t, wave.tail * t))
                known = 0.1 < t < EARLY_TIME_PART and far < 0.9
                for q, mean in zip(("rho", "u", "p"), means, strict=True):
                    row[f"{q}_{name}_{side}"] = float(mean) if known else math.nan
        return row

    def list_stars(self) -> dict[str, float]:
        """Exact states beside the left contact at the walls, by columns."""
        stars = {}
        for name, exact in self.exact.items():
            for side, rho in (("l", exact.rho_left), ("r", exact.rho_right)):
                values = {"rho": rho, "u": exact.u, "p": exact.p}
                stars |= {f"{q}_{name}_{side}": float(value) for q, value in values.items()}
        return stars

    def report(self, run) -> Report:
        history = run.history
        rows = []
        stars = self.list_stars()
        known = np.isfinite([history[name] for name in stars]).all(axis=0)
        last = int(np.flatnonzero(known)[-1]) if np.any(known) else None
        for name, theory in stars.items():
            q, gas, side = name.split("_")
            label = "" if last is None else f"{q} {gas}, {'left' if side == 'l' else 'right'}"
            found = math.nan if last is None else float(history[name][last])
            rows.append(Row(name, found, theory, label, digits=5))
        off = [abs(row.difference) for row in rows if row.name[0] in "pu"]
        masses = [values for name, values in history.items() if name.startswith("total_mass_")]
        lost = max(float(np.ptp(mass) / mass[0]) for mass in masses)
        rows += [Row("star", max(off), error="star"), Row("mass", lost, error="mass")]
        head = f"triple-point, {self.deck.cells} cells in a length of 1"
        if last is not None:
            head += f"; states beside the left contact at the walls, t = {history['t'][last]:.3f}"
        followed = np.flatnonzero(np.isfinite(history["point_x"]))[-1]
        x, y = history["point_x"][followed], history["point_y"][followed]
        t = history["t"][followed]
        where = f"t = {t:.3g}: the point is at x = {x:.4f}, y = {y:.4f}"
        return Report(head, rows, [where])
