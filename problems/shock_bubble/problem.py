"""A shock in air meets a round bubble of a light or heavy gas, on an O-grid of blocks.

Half a shock tube: the axis of the bubble is a line of symmetry, the tube's wall lies above.  The
bubble is a barrel in the middle and three blocks around it, the air three blocks from the bubble
out to a box and two to the tube's ends; inside a gas the blocks are joined by seams, the bubble's
surface is an interface, a grid line from the first step to the last.  The sizes are those of Haas
and Sturtevant's experiment, diameter 50 mm in a tube of 89 mm, Mach 1.22; "helium" is helium with
28 % of air by mass (g 1.648), "R22" the heavy refrigerant (g 1.249).

Measured are the bubble's ends on the axis, its rearmost point, height and volume, the shocks along
axis and wall, and from them the velocities that experiment and computations have published.  The
trap: a straight seam leads from the surface to the box's corner, and where its end on the surface
lies decides how far the bubble may curl before it is cut.  The run ends when the air's jet has
come through the light gas, which no grid line can follow.
Source: [HaasSturtevant1987]; the gases as flow solvers take them since [QuirkKarni1996].
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
from hydro.eos import IdealGas
from hydro.links.join import join
from hydro.motion.line import LineRule
from hydro.simulation import Simulation
from problems.deck import MOST_CELLS, Deck, Limiter, Output, Regrid, RunControl
from problems.initial_states.mixed_states import mix_states
from problems.problem import Problem
from problems.references.hugoniot import shock_with_mach
from problems.references.riemann import solve_riemann
from problems.shock_bubble.report import (
    FEATURES,
    FOCUS,
    MICRO,
    draw_shadowgraphs,
    draw_space_time,
    find_focus,
    fit_velocity,
    make_summary,
)
from regrid.algebraic import fill_from_sides
from regrid.measure.cells import compute_area_fractions

PRESSURE, AIR_DENSITY, AIR = 101325.0, 1.225, IdealGas(1.4)
GASES = {"helium": (0.2228, IdealGas(1.648)), "R22": (3.863, IdealGas(1.249))}
RADIUS, HALF_HEIGHT = 0.025, 0.0445
# The barrel over the radius: its half width on the axis, its corners', its top's distance.
CORE, CORNER, CROWN = 0.5, 0.68, 0.7
# Degrees from the axis where the three blocks around the bubble meet: the seam that leads from
# there to the box's corner has to stay clear of the lobe that curls over it.
JOINT = {"helium": 70.0, "R22": 38.0}
PICTURE = {"helium": 427e-6, "R22": 417e-6}  # a photograph after the shock's arrival [s]
UPWIND, DOWNWIND = 0.1, 0.16  # lengths of the tube before and behind the box [m]
GAP = 0.1  # first distance of shock and bubble over the radius


class ShockBubbleDeck(Deck, kw_only=True):
    """Deck of `shock-bubble`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(cfl=0.8))
    output: Output = msgspec.field(default_factory=lambda: Output(dumps=40))
    regrid: Regrid = msgspec.field(default_factory=Regrid)
    gas: Annotated[Literal["helium", "R22"], Meta(description="in the bubble")] = "helium"
    mach: Annotated[float, Meta(ge=1.001, le=5, description="Mach number of the shock in air")] = (
        1.22
    )
    cells: Annotated[
        int, Meta(ge=4, le=MOST_CELLS, description="cells along 45 degrees of the bubble's surface")
    ] = 12
    thickness: (
        Annotated[
            float,
            Meta(
                ge=0,
                le=1.0,
                description="shorter waves of the surface decay [m]; left out: .75 of a first cell",
            ),
        ]
        | None
    ) = None
    limiter: Limiter = "van-leer"


def blend(first: np.ndarray, second: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Nodes (2, part.size, n) of straight lines from the nodes `first` (2, n) to `second`."""
    return first[:, None, :] * (1.0 - part[:, None]) + second[:, None, :] * part[:, None]


def find_front(rows: list[tuple[np.ndarray, np.ndarray]], level: float) -> float:
    """Where the pressure first falls below `level` along rows of cells one after the other [m].

    rows: places of the nodes (n + 1) and pressures of the cells between them (n); linear between
    the cells' middles; the last node's place where the pressure does not fall.
    """
    x = np.concatenate([0.5 * (nodes[1:] + nodes[:-1]) for nodes, _ in rows])
    p = np.concatenate([pressure for _, pressure in rows])
    below = np.flatnonzero(p < level)
    if below.size == 0 or below[0] == 0:
        return float(rows[-1][0][-1] if below.size == 0 else rows[0][0][0])
    k = int(below[0])
    return float(x[k - 1] + (x[k] - x[k - 1]) * (p[k - 1] - level) / (p[k - 1] - p[k]))


class ShockBubble(Problem):
    """Nine blocks: a bubble of four, air of five."""

    Deck = ShockBubbleDeck
    units: ClassVar = {
        **dict.fromkeys(("upwind", "downwind", "rear", "height", "axis_front", "wall_front"), "m"),
        "volume": "m2",
        "upwind_speed": "m/s",
    }

    def __init__(self, deck: ShockBubbleDeck):
        super().__init__(deck)
        self.shock = shock_with_mach(AIR, AIR_DENSITY, PRESSURE, deck.mach)
        self.rho, self.eos = GASES[deck.gas]
        self.far_end = HALF_HEIGHT + DOWNWIND
        self.arrival = GAP * RADIUS / self.shock.shock_speed
        self.contact = solve_riemann(
            AIR,
            (self.shock.rho, self.shock.particle_speed, self.shock.p),
            self.eos,
            (self.rho, 0.0, PRESSURE),
        )

    @property
    def t_end(self) -> float:
        """End time: the deck's, or that of the experiment's picture with the jet formed."""
        return self.deck.run.t_end or self.arrival + PICTURE[self.deck.gas]

    def make_grids(self) -> dict[str, np.ndarray]:
        """First nodes of the nine blocks."""
        n, high, joint = self.deck.cells, HALF_HEIGHT, math.radians(JOINT[self.deck.gas])
        core = CORE * RADIUS
        size = core / n
        columns = max(4, round(1.2 * RADIUS * (math.pi - 2.0 * joint) / size))
        up = np.linspace(0.0, 1.0, round(n * joint / (0.25 * math.pi)) + 1)
        across = np.linspace(-1.0, 1.0, columns + 1)
        x, y = CORNER * RADIUS * math.cos(joint), CORNER * RADIUS * math.sin(joint)
        mirror = np.array([[-1.0], [1.0]])
        east = np.array([x + (core - x) * (1.0 - up**2), y * up])
        top = (CROWN * RADIUS - y) * (1.0 - across**2)
        barrel = {"west": mirror * east, "north": np.array([x * across, y + top]), "east": east}
        turn = 0.5 * math.pi - joint
        arc = RADIUS * np.array([np.cos(joint * up), np.sin(joint * up)])
        over = RADIUS * np.array([np.sin(turn * across), np.cos(turn * across)])
        circle = {"west": mirror * arc, "north": over, "east": arc}
        side = np.array([np.full(up.size, high), high * up])
        lid = np.array([high * across, np.full(across.size, high)])
        box = {"west": mirror * side, "north": lid, "east": side}
        inner = np.linspace(0.0, 1.0, round((RADIUS - core) / size) + 1)
        outer = np.linspace(0.0, 1.0, round(1.2 * (high - RADIUS) / size) + 1)
        middle = np.zeros((2, across.size, up.size))
        middle[0, :, 0] = core * across
        middle[:, 0], middle[:, -1] = barrel["west"], barrel["east"]
        middle[:, :, -1] = barrel["north"]
        fill_from_sides(middle.copy(), middle)
        grids = {"core": middle}
        for position in ("west", "north", "east"):
            grids[position] = blend(barrel[position], circle[position], inner)
            grids["air-" + position] = blend(circle[position], box[position], outer)
        step = 2.0 * size
        for name, first, last in (
            ("upwind", -high - UPWIND, -high),
            ("downwind", high, high + DOWNWIND),
        ):
            positions = np.linspace(first, last, round((last - first) / step) + 1)
            nodes = np.empty((2, positions.size, up.size))
            nodes[0], nodes[1] = positions[:, None], box["east"][1]
            grids[name] = nodes
        # i and j have to turn counter-clockwise: those whose lines run the other way are turned
        for name in ("north", "air-north", "west", "air-west"):
            flip = name.endswith("north")
            grids[name] = grids[name][:, :, ::-1] if flip else grids[name][:, ::-1, :]
        return {name: np.ascontiguousarray(nodes) for name, nodes in grids.items()}

    def estimate_cells(self) -> int:
        """The cells of `make_grids`, counted."""
        n, joint = self.deck.cells, math.radians(JOINT[self.deck.gas])
        size = CORE * RADIUS / n
        up = 1 + math.ceil(n * joint / (0.25 * math.pi))
        columns = max(4, math.ceil(1.2 * RADIUS * (math.pi - 2.0 * joint) / size))
        across = (RADIUS - CORE * RADIUS + 1.2 * (HALF_HEIGHT - RADIUS)) / size + 2.0
        tube = 0.5 * (UPWIND + DOWNWIND) / size + 2.0
        return columns * up + math.ceil(across * (2 * up + columns) + tube * up)

    def build(self) -> Simulation:
        deck, blocks = self.deck, {}
        position = -RADIUS - GAP * RADIUS
        for name, nodes in self.make_grids().items():
            bubble = name in ("core", "west", "north", "east")
            if bubble:
                state = (self.rho, 0.0, 0.0, PRESSURE)
            else:
                part = compute_area_fractions(nodes, position)
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
            put(b[name], "j_min", "wall")
        put(b["air-north"], "i_max", "wall")
        put(b["upwind"], "j_max", "wall")
        put(b["downwind"], "j_max", "wall")
        put(b["downwind"], "i_max", "wall")
        state = (self.shock.rho, self.shock.particle_speed, 0.0, self.shock.p)
        put(b["upwind"], "i_min", "inflow", state=state)
        simulation = Simulation(
            list(blocks.values()),
            links,
            t_end=self.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            line_rule=LineRule(thickness=deck.thickness),
            make_regridder=lambda: deck.regrid.make(threads=deck.run.threads),
            measure_block=lambda block: (float(block.volume.sum()),),
        )
        west, east = (link.leader for link in surfaces)
        for side in (west, east):  # else the vortex takes these points into the fold of the jet
            simulation.motion.let_slide(side, top.leader)
        # left to the gas, the middle square would be run over by the jet
        for link in seams:
            simulation.motion.carry(link.leader, west, east)
        return simulation

    def watch(self, evolution: Simulation) -> dict:
        """The bubble's outline, the axis and the wall: sides; volumes are for who has the block."""
        return {}

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Places of the bubble's ends and of the shocks [m], the area of half the bubble [m2].

        `rear` is the bubble's rearmost point, on the axis or not; a shock is where the pressure
        first falls to the mean of both sides (at the wall) or to 1.05 of that ahead (on the axis,
        where it is weakened by refraction), from the tube's beginning on.
        """
        blocks = {block.name: block for block in evolution.blocks}
        volumes = dict(zip(blocks, evolution.measured, strict=True))
        west, north, east = (blocks[name] for name in ("west", "north", "east"))
        gas = ("core", "west", "north", "east")
        lines = (west.nodes[:, 0], north.nodes[:, -1], east.nodes[:, -1])
        names = ("upwind", "air-west", "west", "core", "east", "air-east", "downwind")
        axis = [(blocks[name].nodes[0, :, 0], blocks[name].state[3, 1:-1, 1]) for name in names]
        lid = blocks["air-north"]
        wall = [
            (blocks["upwind"].nodes[0, :, -1], blocks["upwind"].state[3, 1:-1, -2]),
            (lid.nodes[0, -1, ::-1], lid.state[3, -2, -2:0:-1]),
            (blocks["downwind"].nodes[0, :, -1], blocks["downwind"].state[3, 1:-1, -2]),
        ]
        return {
            "upwind": float(west.nodes[0, 0, 0]),
            "downwind": float(east.nodes[0, -1, 0]),
            "rear": min(float(line[0].min()) for line in lines),
            "height": max(float(line[1].max()) for line in lines),
            "volume": sum(volumes[name][0] for name in gas),
            "axis_front": find_front(axis, 1.05 * PRESSURE),
            "wall_front": find_front(wall, 0.5 * (PRESSURE + self.shock.p)),
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
        """Relative differences of velocities from the experiment's, by the features' names.

        Those that the experiment has not are compared with the fixed grid's.  `upwind_speed`: of
        the upwind end's first speed from the plane contact's; `focus`: of the time at which the
        heavy bubble's downwind end turns from the fixed grid's.
        """
        speed = self.find_upwind_speed(history["t"], history["upwind"])
        found = {"upwind_speed": abs(speed / self.contact.u - 1.0)}
        for feature in FEATURES[self.deck.gas]:
            alone = math.isnan(feature.measured)
            reference = feature.fixed_grid if alone else feature.measured
            found[feature.words] = abs(fit_velocity(self, history, feature) / reference - 1.0)
        if self.deck.gas in FOCUS:
            found["focus"] = abs(find_focus(self, history) / MICRO / FOCUS[self.deck.gas] - 1.0)
        return found

    def summary(self, history, final) -> str:
        return make_summary(self, history)

    def figures(self):
        return {
            "shock-bubble": functools.partial(draw_shadowgraphs, self),
            "space-time": functools.partial(draw_space_time, self),
        }
