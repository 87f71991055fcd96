"""Programmed burn of an explosive: the speed, the peak and the wave behind the front.

A bar of explosive burns from a plane at its left end on, or a square from its lower left corner.
The front goes at the speed D of the material's Chapman–Jouguet state and brings its heat over a
few cells.  Behind it, "wall": the products come to rest, the pressure has its peak, pCJ, at the
front and falls behind it in Taylor's wave, known in full; "piston": the end is pushed at the CJ
particle speed and the state behind the front is the CJ state itself.  With `clock` below 1 the
front is lit on that part of the way only and runs by itself from there.

Measured are the place of the front where the pressure is half of pCJ, its speed over the last
half of the way, the mean pressure behind it (piston) or its peak (wall, point), and the mean error
of the pressure against Taylor's wave (wall).  The trap: the peak of an unsupported wave is as sharp
as the front is thin: it comes to pCJ from below, with the cells; behind a spreading front, where
the pressure falls off like a square root, with order 1/2 only.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import JWL
from hydro.eos.materials import find_material
from hydro.simulation import Simulation
from hydro.sources import ProgrammedBurn
from problems.deck import MOST_CELLS, Deck, Limiter, Regrid, RunControl
from problems.field_panel import draw_field
from problems.initial_states.rectangular_grids import make_plane_grid
from problems.problem import Problem
from problems.references.taylor_wave import TaylorWave, compute_taylor_wave
from regrid.errors import BadInput
from regrid.measure.corners import compute_centres

WAY = 0.9  # of the length that the front goes, where no end time is given
AMBIENT = 1e5  # pressure of the explosive at rest [Pa]


class DetonationDeck(Deck, kw_only=True):
    """Deck of `detonation`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(cfl=0.6))
    regrid: Regrid = msgspec.field(default_factory=Regrid)
    explosive: Annotated[str, Meta(description="a JWL material of the library")] = "TNT"
    behind: Annotated[
        Literal["piston", "wall", "point"],
        Meta(
            description="piston: the left end goes at the CJ particle speed; wall: it rests; "
            "point: a square lit at its corner, between walls"
        ),
    ] = "piston"
    length: Annotated[float, Meta(ge=1e-9, le=1e6, description="of the bar or square [m]")] = 0.1
    cells: Annotated[int, Meta(ge=20, le=MOST_CELLS, description="cells along the length")] = 200
    front: Annotated[float, Meta(ge=1, le=100, description="width of the front in cells")] = 4.0
    clock: Annotated[
        float, Meta(gt=0, le=1, description="part of the way that is lit; then the front runs free")
    ] = 1.0
    limiter: Limiter = "van-leer"


class Detonation(Problem):
    """One block of explosive."""

    Deck = DetonationDeck
    units: ClassVar = {"front": "m", "pressure": "Pa"}

    def __init__(self, deck: DetonationDeck):
        super().__init__(deck)
        self.material = find_material(deck.explosive)
        if not isinstance(self.material.eos, JWL):
            raise BadInput(
                f"deck: explosive is {deck.explosive!r}, a {self.material.eos.kind}; it must be a "
                "JWL material such as TNT or Comp-B"
            )
        self.speed, self.pressure, self.rho = self.material.eos.find_detonation()
        self.particle_speed = self.speed * (1.0 - self.material.eos.rho0 / self.rho)

    @functools.cached_property
    def taylor_wave(self) -> TaylorWave:
        """The exact wave behind a plane front with a wall at its start."""
        return compute_taylor_wave(self.material.eos)

    @property
    def t_end(self) -> float:
        """End time: the deck's, or when the front has gone most of the way."""
        return self.deck.run.t_end or WAY * self.deck.length / self.speed

    def make_piston(self, width: float):
        """Velocity of the piston as a function of time: that of the material as it burns there.

        Through the front the speed rises in a straight line, over less and less of the front as
        the piston goes along with it.  A piston that started at once would send a shock ahead of
        the burning.
        """
        pace = self.particle_speed / width  # of the front that the piston keeps up with in the end

        def velocity(t):
            part = self.speed / self.particle_speed * -math.expm1(-pace * t)
            return self.particle_speed * min(part, 1.0), 0.0

        return velocity

    def estimate_cells(self) -> int:
        deck = self.deck
        return deck.cells * (deck.cells if deck.behind == "point" else 4)

    def build(self) -> Simulation:
        deck, eos = self.deck, self.material.eos
        made_for = deck.run.t_set_up or self.t_end
        size = deck.length / deck.cells
        rows = deck.cells if deck.behind == "point" else 4
        nodes = make_plane_grid(
            np.linspace(0.0, deck.length, deck.cells + 1), size * np.arange(rows + 1.0)
        )
        block = Block(
            "explosive", eos, nodes, eos.rho0, 0.0, 0.0, AMBIENT,
            material=deck.explosive, limiter=deck.limiter,
        )  # fmt: skip
        if deck.behind == "piston":
            put(block, "i_min", "piston", velocity=self.make_piston(deck.front * size))
        else:
            put(block, "i_min", "wall")
        for side in ("i_max", "j_min", "j_max"):
            put(block, side, "wall")
        simulation = Simulation(
            [block],
            [],
            t_end=self.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            make_regridder=lambda: deck.regrid.make(threads=deck.run.threads),
            source=ProgrammedBurn(
                (0.0, 0.0),
                None if deck.behind == "point" else (1.0, 0.0),
                deck.front * size,
                clock_stop=math.inf if deck.clock == 1.0 else deck.clock * made_for,
            ),
        )
        simulation.clock.retry_dt = 0.05 * size / self.speed  # the explosive knows of no front yet
        return simulation

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Place of the front on the lower side, pressure behind it or at its peak, mean error.

        The last, of `wall`, is the mean of |p - exact| over the mean of p exact in the whole bar.
        """
        (block,) = evolution.blocks
        x = compute_centres(block.nodes)[0][:, 0]
        p = block.state[3, 1:-1, 1]
        over = np.flatnonzero(p > 0.5 * self.pressure)
        front = math.nan
        if over.size and over[-1] + 1 < x.size:
            i = over[-1]
            part = (p[i] - 0.5 * self.pressure) / (p[i] - p[i + 1])
            front = float(x[i] + part * (x[i + 1] - x[i]))
        pressure = float(p.max())
        if self.deck.behind == "piston" and math.isfinite(front):
            back = float(block.nodes[0, 0, 0])
            inside = (x > back + 0.3 * (front - back)) & (x < back + 0.8 * (front - back))
            pressure = float(p[inside].mean()) if inside.any() else math.nan
        row = {"front": front, "pressure": pressure}
        if self.deck.behind == "wall":
            exact = self.taylor_wave.compute_state(x / max(evolution.t, 1e-300))[0]
            total = float(exact.sum())
            row["taylor_error"] = float(np.abs(p - exact).sum()) / total if total else math.nan
        return row

    def watch(self, evolution):
        """Only cells along the lower side are measured."""
        return {}

    def errors(self, history) -> dict[str, float]:
        """Relative errors of the speed, of the pressure and of Taylor's wave."""
        found = {
            "cj_speed": abs(self.find_late_speed(history) / self.speed - 1.0),
            "cj_pressure": abs(float(history["pressure"][-1]) / self.pressure - 1.0),
        }
        if self.deck.behind == "wall":
            found["taylor"] = float(history["taylor_error"][-1])
        return found

    def find_late_speed(self, history) -> float:
        """Speed [m/s] of the front over the last half of the run, by a straight line."""
        t, front = history["t"], history["front"]
        late = (t > 0.5 * t[-1]) & np.isfinite(front)
        return float(np.polyfit(t[late], front[late], 1)[0]) if late.sum() > 2 else math.nan

    def predict(self) -> dict[str, float]:
        """Speed [m/s] and pressure [Pa] of Chapman and Jouguet."""
        return {"speed": float(self.speed), "pressure": float(self.pressure)}

    def summary(self, history, final) -> str:
        deck, speed = self.deck, self.find_late_speed(history)
        pressure = history["pressure"][-1]
        return (
            f"detonation, {deck.explosive}, {deck.cells} cells, {deck.behind}:\n"
            f"  speed {speed:.6g} m/s, Chapman-Jouguet {self.speed:.6g} "
            f"({100 * (speed / self.speed - 1.0):+.3f} %)\n"
            f"  {'pressure behind' if deck.behind == 'piston' else 'peak pressure'} "
            f"{pressure / 1e9:.5g} GPa, Chapman-Jouguet {self.pressure / 1e9:.5g} "
            f"({100 * (pressure / self.pressure - 1.0):+.2f} %)"
            + (
                f"\n  Taylor's wave: mean error of the pressure {history['taylor_error'][-1]:.3g}"
                if deck.behind == "wall"
                else ""
            )
        )

    def figures(self):
        return {"detonation": functools.partial(draw_detonation, self)}


def draw_detonation(problem: Detonation, figure, run_data) -> None:
    """Pressure at several times (or the last), and the place of the front over time."""
    figure.set_size_inches(11.5, 4.6)
    left, right = figure.subplots(1, 2)
    if problem.deck.behind == "point":
        dump = run_data.dumps[-1]
        picture = draw_field(left, dump, lambda block: block.cell_fields["p"] / 1e9, every=10)
        figure.colorbar(picture, ax=left, shrink=0.8, label="pressure [GPa]")
        left.set_xlabel("x [m]")
        left.set_ylabel("y [m]")
        left.set_title(f"t = {1e6 * dump.t:.3g} µs", fontsize="medium")
    else:
        label = "Taylor's wave"
        for dump in run_data.dumps[-1 :: -max(1, len(run_data.dumps) // 5)][4::-1]:
            (block,) = dump.blocks
            x = compute_centres(block.nodes)[0][:, 0]
            words = f"{1e6 * dump.t:.3g} µs"
            left.plot(1e3 * x, block.cell_fields["p"][:, 0] / 1e9, lw=1.4, label=words)
            if problem.deck.behind == "wall" and dump.t > 0.0:
                position = np.append(problem.taylor_wave.pace, problem.speed) * dump.t
                exact = np.append(problem.taylor_wave.p, 0.0)
                position, exact = np.append(0.0, position), np.append(exact[0], exact)
                left.plot(1e3 * position, exact / 1e9, "k", lw=0.7, label=label)
                label = None
        left.axhline(problem.pressure / 1e9, color="k", ls="--", lw=0.8, label="pCJ")
        left.set_xlabel("x [mm]")
        left.set_ylabel("pressure [GPa]")
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
    t, front = run_data.history["t"], run_data.history["front"]
    size = 1e3 * problem.deck.length / problem.deck.cells
    right.plot(1e6 * t, 1e3 * (problem.speed * t - front), lw=1.2, label="D t - front")
    right.axhline(size, color="k", ls=":", lw=0.8, label="size of a cell")
    right.set_xlabel("t [µs]")
    right.set_ylabel("front, where p = pCJ/2, behind D t [mm]")
    right.set_ylim(bottom=min(0.0, right.get_ylim()[0]))
    right.legend(loc="best", frameon=False)
