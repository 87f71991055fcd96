"""Programmed burn of an explosive: the speed, the peak and the wave behind the front.

A bar of explosive burns from a plane at its left end, or a square from its lower left corner.  The
front moves at the speed D of the material's Chapman–Jouguet state and releases its heat over a few
cells.  Behind it, "wall": the products come to rest, the pressure peaks at pCJ at the front and
falls behind it in Taylor's wave, which is known exactly; "piston": the end moves at the CJ
particle speed and the state behind the front is the CJ state itself.  With `clock` below 1 the
front is lit on that part of the path only and continues by itself.

The problem measures the position of the front, where the pressure is half of pCJ, its speed over
the last half of the path, the mean pressure behind it (piston) or its peak (wall, point), and the
mean error of the pressure against Taylor's wave (wall).  Note: the peak of an unsupported wave is
as sharp as the front is thin, and converges to pCJ from below; behind a spreading front, where the
pressure falls as a square root, with order 1/2 only.
"""

import math
from typing import ClassVar, Literal

import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos import JWL
from hydro.eos.materials import find_material
from hydro.sources import ProgrammedBurn
from problems.deck import MOST_CELLS, Deck, Limiter, Regrid, RunControl, key
from problems.initial_states import put_walls
from problems.pictures import make_panels, spread_dumps
from problems.problem import BlockPlan, Problem, Report, Row, compare, find_crossing, get_last
from problems.references.exact_flows import compute_taylor_wave
from regrid.errors import BadInput

WAY = 0.9  # of the length that the front goes, where no end time is given
AMBIENT = 1e5  # pressure of the explosive at rest [Pa]


class DetonationDeck(Deck, kw_only=True):
    run: RunControl = RunControl(cfl=0.6)
    regrid: Regrid = Regrid()
    explosive: key(str, "a JWL material of the library") = "TNT"
    behind: key(
        Literal["piston", "wall", "point"],
        "piston: the left end moves at the CJ particle speed; wall: it rests; point: a square lit "
        "at its corner, between walls",
    ) = "piston"
    length: key(float, "of the bar or square [m]", ge=1e-9, le=1e6) = 0.1
    cells: key(int, "cells along the length", ge=20, le=MOST_CELLS) = 200
    front: key(float, "width of the front in cells", ge=1, le=100) = 4.0
    clock: key(float, "part of the path that is lit; the front then goes on", gt=0, le=1) = 1.0
    limiter: Limiter = "van-leer"


class Detonation(Problem):
    Deck = DetonationDeck
    units: ClassVar = {"front": "m", "pressure": "Pa"}
    measures_sides = True

    def __init__(self, deck: DetonationDeck):
        super().__init__(deck)
        self.eos = eos = find_material(deck.explosive).eos
        if not isinstance(eos, JWL):
            raise BadInput(
                f"deck: explosive is {deck.explosive!r}, a {eos.kind}; it must be a JWL material "
                "such as TNT or Comp-B"
            )
        self.speed, self.pressure, rho = eos.find_detonation()
        self.particle_speed = self.speed * (1.0 - eos.rho0 / rho)
        self.t_end = deck.run.t_end or WAY * deck.length / self.speed
        self.taylor_wave = compute_taylor_wave(eos) if deck.behind == "wall" else None

    def list_boxes(self):
        length, cells = self.deck.length, self.deck.cells
        rows = cells if self.deck.behind == "point" else 4
        return [BlockPlan("explosive", (cells, rows), (0.0, 0.0), (length, length / cells * rows))]

    def build(self):
        deck, eos, size = self.deck, self.eos, self.deck.length / self.deck.cells
        nodes = self.make_grids()["explosive"]
        named = {"material": deck.explosive, "limiter": deck.limiter}
        block = Block("explosive", eos, nodes, eos.rho0, 0.0, 0.0, AMBIENT, **named)

        def follow(t):
            """The material's speed as it burns at the piston, which keeps up with the front: it
            rises in a straight line through less and less of it.  A start at once would send a
            shock ahead of the burning."""
            rise = self.speed / self.particle_speed
            part = rise * -math.expm1(-self.particle_speed / (deck.front * size) * t)
            return self.particle_speed * min(part, 1.0), 0.0

        if deck.behind == "piston":
            put(block, "i_min", "piston", velocity=follow)
        put_walls(block)
        along = None if deck.behind == "point" else (1.0, 0.0)
        made_for = deck.run.t_set_up or self.t_end
        stop = math.inf if deck.clock == 1.0 else deck.clock * made_for
        burn = ProgrammedBurn((0.0, 0.0), along, deck.front * size, clock_stop=stop)
        simulation = self.simulate([block], source=burn)
        simulation.clock.retry_dt = 0.05 * size / self.speed  # the explosive knows of no front yet
        return simulation

    def measure(self, evolution) -> dict[str, float]:
        """Place of the front on the lower side, pressure behind it or at its peak, mean error.

        The last, of `wall`, is the mean of |p - exact| over the mean of p exact in the whole bar.
        """
        (block,) = evolution.blocks
        x, p = block.centres[0][:, 0], block.state[3, 1:-1, 1]
        front, pressure = find_crossing(x, p, 0.5 * self.pressure), float(p.max())
        if self.deck.behind == "piston" and math.isfinite(front):
            back = float(block.nodes[0, 0, 0])
            inside = (x > back + 0.3 * (front - back)) & (x < back + 0.8 * (front - back))
            pressure = float(p[inside].mean()) if inside.any() else math.nan
        row = {"front": front, "pressure": pressure}
        if self.deck.behind != "wall":
            return row
        exact = self.taylor_wave.compute_state(x / max(evolution.t, 1e-300))[0]
        error = np.abs(p - exact).sum() / exact.sum() if exact.any() else math.nan
        return {**row, "taylor_error": float(error)}

    def report(self, history, final=None) -> Report:
        deck, found = self.deck, math.nan
        t, front = history["t"], history["front"]
        late = (t > 0.5 * t[-1]) & np.isfinite(front)
        if late.sum() > 2:  # a straight line through the last half of the run
            found = float(np.polyfit(t[late], front[late], 1)[0])
        words = "pressure behind it [GPa]" if deck.behind == "piston" else "peak pressure [GPa]"
        pressure = get_last(history, "pressure")
        rows = [
            Row("speed", found, self.speed, "speed of the front [m/s]", error="cj_speed"),
            Row("pressure", pressure, self.pressure, words, 1e9, error="cj_pressure"),
        ]
        if deck.behind == "wall":
            label = "Taylor's wave: mean error of p"
            rows.append(compare(history, "taylor_error", label=label, digits=3, error="taylor"))
        head = f"detonation, {deck.explosive}, {deck.cells} cells, {deck.behind}"
        return Report(f"{head}; theory: Chapman-Jouguet", rows)

    def draw_detonation(self, figure, run_data) -> None:
        """Pressure along the lower side at several times, the place of the front over time."""
        left, right = make_panels(figure, 11.5, 4.6, 1, 2)
        for dump in spread_dumps(run_data, 5):
            bar = dump["explosive"]
            x, label = bar.centres[0][:, 0], f"{1e6 * dump.t:.3g} µs"
            left.plot(1e3 * x, 1e-9 * bar.p[:, 0], lw=1.4, label=label)
            if self.taylor_wave and dump.t > 0.0:
                x = np.linspace(0.0, 1.001 * self.speed * dump.t, 2000)
                p = self.taylor_wave.compute_state(x / dump.t)[0]
                left.plot(1e3 * x, 1e-9 * p, "k", lw=0.7)
        left.axhline(1e-9 * self.pressure, color="k", ls="--", lw=0.8, label="pCJ")
        left.set(xlabel="x [mm]", ylabel="pressure [GPa]")
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
        t, front = run_data.history["t"], run_data.history["front"]
        size = 1e3 * self.deck.length / self.deck.cells
        right.plot(1e6 * t, 1e3 * (self.speed * t - front), lw=1.2, label="D t - front")
        right.axhline(size, color="k", ls=":", lw=0.8, label="size of a cell")
        right.set(xlabel="t [µs]", ylabel="front, where p = pCJ/2, behind D t [mm]")
