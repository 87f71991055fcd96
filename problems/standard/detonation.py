"""Programmed burn of an explosive: the speed, the peak and the wave behind the front.

A bar of explosive burns from a plane at its left end, or a square from its lower left corner.  The
front moves at the speed D of the material's Chapman–Jouguet state and releases its heat over a few
cells.  Behind a "wall" the products come to rest; the pressure peaks at pCJ at the front and falls
behind it in Taylor's wave, which is known exactly.  With a "piston" the end moves at the CJ
particle speed, and the state behind the front is the CJ state itself.  With `clock` below 1 the
programmed burn covers that part of the path only, and the front continues by itself.

The problem measures the position of the front, where the pressure is half of pCJ, its speed over
the last half of the path, the mean pressure behind it (piston) or its peak (wall, point), and the
mean error of the pressure against Taylor's wave (wall).  Note: the peak of an unsupported wave is
as sharp as the front is thin, and converges to pCJ from below; behind a spreading front, where the
pressure falls as a square root, with order 1/2 only.
"""

import math
from typing import ClassVar, Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.burn import FRONT_LEAD_FRACTION, ProgrammedBurn
from shockgrid.hydro.eos import JWL
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, Regrid, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.pictures import choose_even_dumps, draw_profiles, make_panels
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.exact_flows import compute_taylor_wave, follow_burn
from shockgrid.problems.report import Report, Row
from shockgrid.problems.signals import find_crossing, fit_slope


class DetonationDeck(Deck, kw_only=True):
    run: RunControl = RunControl(cfl=0.6)
    regrid: Regrid = Regrid()
    explosive: key(str, "a JWL material of the library") = "TNT"
    behind: key(
        Literal["piston", "wall", "point"],
        "the left end: at the CJ particle speed, at rest; point: a square lit at its corner",
    ) = "piston"
    length: key(float, "of the bar or square [m]", ge=1e-9, le=1e6) = 0.1
    cells: key(int, "cells along the length", ge=20, le=MOST_CELLS) = 200
    front: key(float, "width of the front in cells", ge=1, le=100) = 4.0
    clock: key(float, "part of the path that is lit; the front then goes on", ge=1e-12, le=1) = 1.0
    limiter: Limiter = "van-leer"


class Detonation(Problem):
    Deck = DetonationDeck
    units: ClassVar = {"front": "m", "pressure": "Pa"}

    def __init__(self, deck: DetonationDeck):
        super().__init__(deck)
        self.eos = eos = find_material(deck.explosive).eos
        if not isinstance(eos, JWL):
            raise deck.error("explosive", "it must be a JWL material such as TNT")
        self.speed, self.pressure, rho = eos.find_detonation()
        self.particle_speed = self.speed * (1.0 - eos.rho0 / rho)
        self.size = deck.length / deck.cells
        self.t_end = deck.run.t_end or 0.9 * deck.length / self.speed
        self.wave = compute_taylor_wave(eos) if deck.behind == "wall" else None

    def list_boxes(self):
        rows = self.deck.cells if self.deck.behind == "point" else 4
        high = self.deck.length, self.size * rows
        return [BlockPlan("explosive", (self.deck.cells, rows), (0.0, 0.0), high)]

    def build(self):
        deck = self.deck
        eos = self.eos
        nodes = self.make_grids()["explosive"]
        width = deck.front * self.size
        named = {"material": deck.explosive, "limiter": deck.limiter}
        block = Block("explosive", eos, nodes, eos.rho0, 0.0, 0.0, 1e5, **named)
        if deck.behind == "piston":
            velocity = follow_burn(self.speed, self.particle_speed, width)
            put(block, "i_min", "piston", velocity=velocity)
        put_walls(block)
        along = None if deck.behind == "point" else (1.0, 0.0)
        stop = math.inf if deck.clock == 1.0 else deck.clock * (deck.run.t_set_up or self.t_end)
        burn = ProgrammedBurn((0.0, 0.0), along, width, clock_stop=stop)
        return self.simulate([block], source=burn, first_dt=0.05 * self.size / self.speed)

    def measure(self, evolution) -> dict[str, float]:
        """Place of the front on the lower side, pressure behind it or at its peak, mean error."""
        (block,) = evolution.blocks
        x = block.centres[0][:, 0]
        p = block.p[:, 0]
        front = find_crossing(x, p, 0.5 * self.pressure)
        pressure = float(p.max())
        if self.deck.behind == "piston" and math.isfinite(front):
            back = float(block.nodes[0, 0, 0])
            inside = (x > back + 0.3 * (front - back)) & (x < back + 0.8 * (front - back))
            pressure = float(p[inside].mean()) if inside.any() else math.nan
        row = {"front": front, "pressure": pressure}
        if self.wave:
            row["taylor_error"] = self.wave.measure_error(x, p, evolution.t)
        return row

    def report(self, run) -> Report:
        deck = self.deck
        lead = FRONT_LEAD_FRACTION * deck.front * self.size
        arrival = (deck.length - lead) / self.speed
        notes = []
        if run.begun and run.t > arrival:
            run = run.until(arrival)
            notes.append(
                f"the front meets the far wall at t = {arrival:.4g} s: compared up to there"
            )
        t = run.history["t"]
        front = run.history["front"]
        speed = fit_slope(t, front, (t > 0.5 * t[-1]) & np.isfinite(front))
        rows = [
            Row("speed", speed, self.speed, "speed of the front [m/s]", error="cj_speed"),
            run.compare(
                "pressure",
                self.pressure,
                "pressure behind it [GPa]" if deck.behind == "piston" else "peak pressure [GPa]",
                unit=1e9,
                error="cj_pressure",
            ),
        ]
        if deck.behind == "wall":
            rows.append(
                run.compare(
                    "taylor_error",
                    label="Taylor's wave: mean error of p",
                    digits=3,
                    error="taylor",
                )
            )
        head = f"detonation, {deck.explosive}, {deck.cells} cells, {deck.behind}"
        return Report(f"{head}; theory: Chapman-Jouguet", rows, notes)

    def draw_detonation(self, figure, run_data) -> None:
        """Pressure along the lower side at several times, the place of the front over time."""
        left, right = make_panels(figure, 11.5, 4.6, 1, 2)
        draw_profiles(left, choose_even_dumps(run_data, 5), "p", 1e9, self.wave)
        left.axhline(1e-9 * self.pressure, color="k", ls="--", lw=0.8, label="pCJ")
        left.set(xlabel="x [mm]", ylabel="pressure [GPa]")
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
        t = run_data.history["t"]
        front = run_data.history["front"]
        right.plot(1e6 * t, 1e3 * (self.speed * t - front), lw=1.2, label="D t - front")
        right.axhline(1e3 * self.size, color="k", ls=":", lw=0.8, label="size of a cell")
        right.set(xlabel="t [µs]", ylabel="front, where p = pCJ/2, behind D t [mm]")
