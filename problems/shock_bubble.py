"""A shock in air meets a round bubble of a light or heavy gas, on an O-grid of blocks.

Half a shock tube: the axis of the bubble is a line of symmetry, the tube's wall lies above.  The
bubble is a square in the middle and three blocks around it, the air three blocks from the bubble
out to a box and two to the tube's ends; inside a gas the blocks are joined by seams, the bubble's
surface is an interface, a grid line from the first step to the last.  The sizes are those of Haas
and Sturtevant's experiment, diameter 50 mm in a tube of 89 mm, Mach 1.22; "helium" is helium with
28 % of air by mass (g 1.648), "R22" the heavy refrigerant (g 1.249).

Measured are the bubble's ends on the axis, its volume and the speed of its upwind end against that
of the plane contact, which it has at first.  The trap: the run ends where the grid of a block has
no valid place left, in the light gas when the air's jet has nearly come through.
Source: Haas & Sturtevant (1987); the gases as flow solvers take them since Quirk & Karni (1996).
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.eos import IdealGas
from hydro.exchange import join
from hydro.grid_motion import LineRule
from hydro.simulation import Simulation
from problems.deck import Deck, Regrid, RunControl
from problems.mixed_states import mix_states
from problems.plane_grids import draw_field
from problems.problem import Problem
from problems.references.hugoniot import shock_with_mach
from problems.references.riemann import solve_riemann
from regrid.area_fractions import compute_area_fractions

PRESSURE, AIR_DENSITY, AIR = 101325.0, 1.225, IdealGas(1.4)
GASES = {"helium": (0.2228, IdealGas(1.648)), "R22": (3.863, IdealGas(1.249))}
RADIUS, HALF_HEIGHT = 0.025, 0.0445
CORE = 0.5  # half width of the middle square over the radius
UPWIND, DOWNWIND = 0.0455, 0.11  # lengths of the tube before and behind the box [m]
GAP = 0.1  # first distance of shock and bubble over the radius


class ShockBubbleDeck(Deck, kw_only=True):
    """Deck of `shock-bubble`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(cfl=0.8))
    regrid: Regrid = msgspec.field(default_factory=Regrid)
    gas: Annotated[Literal["helium", "R22"], Meta(description="in the bubble")] = "helium"
    mach: Annotated[float, Meta(gt=1, le=5, description="Mach number of the shock in air")] = 1.22
    cells: Annotated[
        int, Meta(ge=4, description="cells along a half side of the middle square")
    ] = 12
    damping: Annotated[
        float, Meta(ge=0, description="of the bubble surface's shortest waves, hydro.grid_motion")
    ] = 4.0
    limiter: Annotated[str, Meta(description="monotonised-central, van-leer or minmod")] = (
        "van-leer"
    )


def blend(first: np.ndarray, second: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Nodes (2, part.size, n) of straight lines from the nodes `first` (2, n) to `second`."""
    return first[:, None, :] * (1.0 - part[:, None]) + second[:, None, :] * part[:, None]


class ShockBubble(Problem):
    """Nine blocks: a bubble of four, air of five."""

    Deck = ShockBubbleDeck
    units: ClassVar = {"upwind": "m", "downwind": "m", "volume": "m2", "upwind_speed": "m/s"}

    def __init__(self, deck: ShockBubbleDeck):
        super().__init__(deck)
        self.shock = shock_with_mach(AIR, AIR_DENSITY, PRESSURE, deck.mach)
        self.rho, self.eos = GASES[deck.gas]
        self.arrival = GAP * RADIUS / self.shock.shock_speed
        self.contact = solve_riemann(
            AIR,
            (self.shock.rho, self.shock.particle_speed, self.shock.p),
            self.eos,
            (self.rho, 0.0, PRESSURE),
        )

    @property
    def t_end(self) -> float:
        """End time: the deck's, or about when the bubble is at its flattest."""
        return self.deck.run.t_end or self.arrival + 4.6 * RADIUS / self.shock.shock_speed

    def make_grids(self) -> dict[str, np.ndarray]:
        """First nodes of the nine blocks."""
        n, half = self.deck.cells, CORE * RADIUS
        size = half / n
        across = np.linspace(-1.0, 1.0, 2 * n + 1)
        # sides of the middle square, its upper corners drawn in to make the angles there wide
        bulge = 0.12 * half * (1.0 - across**2)
        up = across[n:]
        square = {
            "west": np.array([np.full(n + 1, -half) - bulge[n:], half * up]),
            "north": np.array([half * across, np.full(2 * n + 1, half) + bulge]),
            "east": np.array([np.full(n + 1, half) + bulge[n:], half * up]),
        }
        turn = 0.25 * math.pi
        circle = {
            "west": RADIUS * np.array([-np.cos(turn * up), np.sin(turn * up)]),
            "north": RADIUS * np.array([np.sin(turn * across), np.cos(turn * across)]),
            "east": RADIUS * np.array([np.cos(turn * up), np.sin(turn * up)]),
        }
        high = HALF_HEIGHT
        box = {
            "west": np.array([np.full(n + 1, -high), high * up]),
            "north": np.array([high * across, np.full(2 * n + 1, high)]),
            "east": np.array([np.full(n + 1, high), high * up]),
        }
        inner = np.linspace(0.0, 1.0, round((RADIUS - half) / size) + 1)
        outer = np.linspace(0.0, 1.0, round(1.2 * (high - RADIUS) / size) + 1)
        rows = np.linspace(-1.0, 1.0, 2 * n + 1)[:, None]
        columns = np.linspace(0.0, 1.0, n + 1)[None, :]
        core = np.array([
            half * rows + 0.0 * columns + 0.12 * half * rows * (1.0 - columns**2),
            half * columns + 0.12 * half * columns * (1.0 - rows**2),
        ])  # fmt: skip
        grids = {"core": core}
        for place in ("west", "north", "east"):
            grids[place] = blend(square[place], circle[place], inner)
            grids["air-" + place] = blend(circle[place], box[place], outer)
        step = high / n
        for name, first, last in (
            ("upwind", -high - UPWIND, -high),
            ("downwind", high, high + DOWNWIND),
        ):
            places = np.linspace(first, last, round((last - first) / step) + 1)
            nodes = np.empty((2, places.size, n + 1))
            nodes[0], nodes[1] = places[:, None], box["east"][1]
            grids[name] = nodes
        # i and j have to turn counter-clockwise: those whose lines run the other way are turned
        for name in ("north", "air-north", "west", "air-west"):
            flip = name.endswith("north")
            grids[name] = grids[name][:, :, ::-1] if flip else grids[name][:, ::-1, :]
        return {name: np.ascontiguousarray(nodes) for name, nodes in grids.items()}

    def build(self) -> Simulation:
        deck, blocks = self.deck, {}
        place = -RADIUS - GAP * RADIUS
        for name, nodes in self.make_grids().items():
            bubble = name in ("core", "west", "north", "east")
            if bubble:
                state = (self.rho, 0.0, 0.0, PRESSURE)
            else:
                part = compute_area_fractions(nodes, place)
                state = mix_states(
                    AIR,
                    part,
                    (self.shock.rho, self.shock.particle_speed, 0.0, self.shock.p),
                    (AIR_DENSITY, 0.0, 0.0, PRESSURE),
                )
            blocks[name] = Block(
                name,
                self.eos if bubble else AIR,
                nodes,
                *state,
                material=deck.gas if bubble else "air",
                limiter=deck.limiter,
            )
        b = blocks
        seams = [
            join("seam", (b["west"], "i_max"), (b["core"], "i_min")),
            join("seam", (b["east"], "i_min"), (b["core"], "i_max")),
        ]
        surfaces = [
            join("interface", (b["west"], "i_min"), (b["air-west"], "i_max")),
            join("interface", (b["east"], "i_max"), (b["air-east"], "i_min")),
        ]
        top = join("interface", (b["north"], "i_max"), (b["air-north"], "i_min"))
        links = [
            *seams,
            *surfaces,
            join("seam", (b["north"], "i_min"), (b["core"], "j_max")),
            top,
            join("seam", (b["upwind"], "i_max"), (b["air-west"], "i_min")),
            join("seam", (b["air-east"], "i_max"), (b["downwind"], "i_min")),
        ]
        for air in ("", "air-"):
            links += [
                join("seam", (b[air + "west"], "j_max"), (b[air + "north"], "j_max")),
                join("seam", (b[air + "north"], "j_min"), (b[air + "east"], "j_max")),
            ]
        for name in ("core", "west", "east", "air-west", "air-east", "upwind", "downwind"):
            b[name].put("j_min", "wall")
        b["air-north"].put("i_max", "wall")
        b["upwind"].put("j_max", "wall")
        b["downwind"].put("j_max", "wall")
        b["downwind"].put("i_max", "wall")
        state = (self.shock.rho, self.shock.particle_speed, 0.0, self.shock.p)
        b["upwind"].put("i_min", "inflow", state=state)
        simulation = Simulation(
            list(blocks.values()),
            links,
            t_end=self.t_end,
            cfl=deck.run.cfl,
            threads=deck.run.threads,
            line_rule=LineRule(damping=deck.damping),
            make_regridder=lambda: deck.regrid.make(threads=deck.run.threads),
        )
        west, east = (link.leader for link in surfaces)
        for side in (west, east):  # else the vortex takes these points into the fold of the jet
            simulation.motion.let_slide(side, top.leader)
        # left to the gas, the middle square would be run over by the jet
        for link in seams:
            simulation.motion.carry(link.leader, west, east)
        return simulation

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Places of the bubble's ends on the axis, its area (half the bubble) and height."""
        blocks = {block.name: block for block in evolution.blocks}
        west, north, east = (blocks[name] for name in ("west", "north", "east"))
        gas = ("core", "west", "north", "east")
        return {
            "upwind": float(west.nodes[0, 0, 0]),
            "downwind": float(east.nodes[0, -1, 0]),
            "height": max(
                float(line[1].max())
                for line in (west.nodes[:, 0], north.nodes[:, -1], east.nodes[:, -1])
            ),
            "volume": sum(float(blocks[name].volume.sum()) for name in gas),
        }

    def find_upwind_speed(self, t: np.ndarray, upwind: np.ndarray) -> float:
        """Mean speed [m/s] of the upwind end while the shock goes a quarter of a radius on."""
        start = self.arrival + 0.05 * RADIUS / self.shock.shock_speed
        end = self.arrival + 0.3 * RADIUS / self.shock.shock_speed
        if t[-1] < end:
            return math.nan
        first, last = np.interp([start, end], t, upwind)
        return (last - first) / (end - start)

    def errors(self, history) -> dict[str, float]:
        """Relative difference of the upwind end's first speed from the plane contact's."""
        speed = self.find_upwind_speed(history["t"], history["upwind"])
        return {"upwind_speed": abs(speed / self.contact.u - 1.0)}

    def summary(self, history, final) -> str:
        t = history["t"]
        speed, exact = self.find_upwind_speed(t, history["upwind"]), self.contact.u
        volume = history["volume"]
        return (
            f"shock-bubble, {self.deck.gas} in air, Mach {self.deck.mach:g}, "
            f"t = {(t[-1] - self.arrival) * 1e6:.4g} us after the shock's arrival:\n"
            f"  upwind end at first {speed:.5g} m/s, plane contact {exact:.5g} "
            f"({100 * (speed / exact - 1.0):+.2f} %)\n"
            f"  bubble from x = {1e3 * history['upwind'][-1]:.3f} to "
            f"{1e3 * history['downwind'][-1]:.3f} mm on the axis, "
            f"{1e3 * history['height'][-1]:.3f} mm high, "
            f"{volume[-1] / volume[0]:.4f} of its first volume"
        )

    def figures(self):
        return {"shock-bubble": functools.partial(draw_shock_bubble, self)}


def draw_shock_bubble(problem: ShockBubble, figure, run_data) -> None:
    """Density at four times, above it the grid mirrored below the axis."""
    last = run_data.dumps[-1].t
    for axis, part in zip(figure.subplots(2, 2).ravel(), (0.0, 0.35, 0.7, 1.0), strict=True):
        dump = min(run_data.dumps, key=lambda d, t=part * last: abs(d.t - t))
        picture = draw_field(axis, dump, "rho")
        figure.colorbar(picture, ax=axis, shrink=0.6)
        for block in dump.blocks:
            x, y = block.nodes
            colour = "C3" if block.material == problem.deck.gas else "0.4"
            axis.plot(x.T, -y.T, color=colour, lw=0.2)
            axis.plot(x, -y, color=colour, lw=0.2)
        axis.set_title(f"t = {1e6 * dump.t:.4g} us", fontsize="medium")
        axis.set_xlim(-0.05, 0.09)
