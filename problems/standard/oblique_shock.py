"""Supersonic flow onto a wedge: angle and pressure of the oblique shock against theory.

Gas comes in from the left at Mach `mach` along a wall that rises by `angle` from x = 0 on; the grid
follows the wall.  The flow becomes steady with a straight shock from the corner, whose angle beta
is the weak solution of tan(angle) = 2 cot(beta) (M² sin² beta - 1)/(M² (g + cos 2 beta) + 2).
The problem measures the pressure on the wall, and the angle of the line of half the pressure jump.

Note: above the largest angle of attached shocks there is no such solution, and shockgrid refuses
the deck.
Source of the relation: any text on gas dynamics, e.g. NACA report 1135 (1953), equation 148.
"""

import math
from typing import ClassVar

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, RunControl, key
from shockgrid.problems.pictures import draw_field, make_panels
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.shock_polars import (
    Body,
    ShockPolar,
    search_pressure,
    solve_collision,
)
from shockgrid.problems.report import Report
from shockgrid.problems.signals import find_crossing, fit_slope

# length before the wedge; it is 1 long, and the top is 1 above its start
LAST_TIME_PART = 0.1  # of the time: in it a steady flow does not change
STEADY_CHANGE = 0.005  # relative change in that time: less is steady
LENGTH_BEFORE_WEDGE = 0.25


class ObliqueShockDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=3.0, cfl=0.8)
    mach: key(float, "Mach number of the stream", ge=1.001, le=100) = 2.5
    angle: key(float, "of the wedge [degrees]", ge=0.1, lt=60) = 15.0
    gamma: key(float, "ratio of specific heats", ge=1.01, le=1000) = 1.4
    cells: key(int, "cells along the stream", ge=16, le=MOST_CELLS) = 100
    limiter: Limiter = "van-leer"


class ObliqueShock(Problem):
    """One block on a grid at rest; density 1 and sound speed 1 in the stream."""

    Deck = ObliqueShockDeck
    t_unit = "1"
    units: ClassVar = {"shock_angle": "degrees"}

    def __init__(self, deck: ObliqueShockDeck):
        super().__init__(deck)
        self.angle = math.radians(deck.angle)
        self.ahead = 1.0 / deck.gamma
        gas = Body(IdealGas(deck.gamma), 1.0, self.ahead)
        fall = deck.mach * math.tan(self.angle)
        found = solve_collision(gas, None, fall, self.angle)  # as a plate thrown onto a rigid wedge
        if not found.attached:
            most = math.degrees(search_pressure([ShockPolar(gas, deck.mach)], fall)[2])
            raise deck.error(
                "angle",
                f"at Mach {deck.mach:g} the shock stays attached up to {most:.4g} degrees only",
            )
        self.beta = found.plate.wave_angle
        self.pressure = found.p
        if math.tan(self.beta) >= 1.0:
            raise deck.error(
                "angle",
                f"the shock, at {math.degrees(self.beta):.3g} degrees, leaves through the top",
            )

    def make_grids(self, t=0.0):
        """Straight upright lines between the wall and the top."""
        cells = self.deck.cells
        before = round(cells * LENGTH_BEFORE_WEDGE / (1.0 + LENGTH_BEFORE_WEDGE))
        upstream = np.linspace(-LENGTH_BEFORE_WEDGE, 0.0, before + 1)[:-1]
        x = np.concatenate([upstream, np.linspace(0.0, 1.0, cells - before + 1)])[:, None]
        wall = math.tan(self.angle) * np.maximum(x, 0.0)
        y = wall + (1.0 - wall) * np.linspace(0.0, 1.0, round(0.8 * cells) + 1)
        return {"gas": np.array([np.broadcast_to(x, y.shape), y])}

    def estimate_cells(self) -> int:
        return self.deck.cells * round(0.8 * self.deck.cells)

    def build(self):
        deck = self.deck
        state = (1.0, self.deck.mach, 0.0, self.ahead)
        gas = IdealGas(deck.gamma)
        nodes = self.make_grids()["gas"]
        block = Block("gas", gas, nodes, *state, limiter=deck.limiter)
        for side in ("i_min", "j_max"):
            put(block, side, "inflow", state=state)
        put(block, "i_max", "outflow")
        put(block, "j_min", "wall")
        return self.simulate([block], mesh="fixed")

    def measure(self, evolution) -> dict[str, float]:
        """Pressure on the last half of the wedge over the exact one, and the shock's angle."""
        (block,) = evolution.blocks
        x, y = block.centres
        p = block.p
        x = x[:, 0]
        level = 0.5 * (self.ahead + self.pressure)
        heights = np.array([find_crossing(*column, level) for column in zip(y, p, strict=True)])
        chosen = (x > 0.3) & (x < 0.9) & np.isfinite(heights)
        slope = math.degrees(math.atan(fit_slope(x, heights, chosen)))
        off = abs(slope / math.degrees(self.beta) - 1.0)
        ratio = float(p[x > 0.5, 0].mean()) / self.pressure
        return {"wall_pressure_ratio": ratio, "shock_angle": slope, "shock_angle_error": off}

    def report(self, run) -> Report:
        deck = self.deck
        beta = math.degrees(self.beta)
        labels = "angle of the shock [degrees]", "pressure on the wall over exact"
        notes = [f"exact pressure: {self.pressure / self.ahead:.5g} of the stream's"]
        more = {}
        change = self.measure_change(run.history)
        if change > STEADY_CHANGE:
            more = {"off": "--", "source": "not steady yet"}
            notes.append(
                f"in the last {LAST_TIME_PART:.0%} of the time they changed by up to "
                f"{100.0 * change:.2g} %: theory is of the steady flow, which a later run.t_end has"
            )
        rows = [
            run.compare("shock_angle", beta, labels[0], error="angle", **more),
            run.compare("wall_pressure_ratio", 1.0, labels[1], error="pressure", **more),
        ]
        head = f"oblique-shock, Mach {deck.mach:g} on {deck.angle:g} degrees, {deck.cells} cells"
        return Report(head, rows, notes)

    @staticmethod
    def measure_change(history) -> float:
        """Largest relative change of angle and pressure over the last part of the time."""
        t = history["t"]
        columns = [history[name] for name in ("shock_angle", "wall_pressure_ratio")]
        before = [np.interp((1.0 - LAST_TIME_PART) * t[-1], t, column) for column in columns]
        pairs = zip(columns, before, strict=True)
        return max(abs(float(column[-1] / old - 1.0)) for column, old in pairs)

    def draw_oblique_shock(self, figure, run_data) -> None:
        """Pressure with the grid and the exact shock, and pressure along the wall."""
        left, right = make_panels(figure, 11.5, 4.6, 1, 2, width_ratios=(1.3, 1.0))
        dump = run_data.dumps[-1]
        end = math.tan(self.beta)
        draw_field(left, dump, "p", every=5, bar="pressure")
        left.plot((0.0, 1.0), (0.0, end), "r--", lw=1.5, zorder=5, label="exact shock")
        x = dump["gas"].centres[0][:, 0]
        p = dump["gas"].p[:, 0]
        right.plot(x, p, ".-", ms=4, lw=0.8, label="computed")
        exact = (float(p[0]),) * 2 + (self.pressure,) * 2
        right.plot((x[0], 0.0, 0.0, 1.0), exact, "k--", lw=0.9, label="exact")
        right.set(xlabel="x", ylabel="pressure on the wall")
