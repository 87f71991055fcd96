"""A shock in air meets a round bubble of a light or heavy gas, on an O-grid of blocks.

Half a shock tube: the axis of the bubble is a line of symmetry, the tube's wall lies above.  The
bubble is a barrel-shaped block in the middle and three blocks around it; the air has three blocks
from the bubble out to a box and two to the tube's ends.  Seams join blocks of one gas; the bubble's
surface is an interface, a grid line throughout the run.  The sizes are those of Haas
and Sturtevant's experiment, diameter 50 mm in a tube of 89 mm, Mach 1.22; "helium" is helium with
28 % of air by mass (g 1.648), "R22" the heavy refrigerant (g 1.249).

The problem measures the bubble's ends on the axis, its rearmost point, height and volume, and the
shocks along axis and wall.  Straight-line fits to these give the velocities that experiment and
computations have published.  Most of them change during the fit, so the window matters more than
the scheme; the summary prints the windows.  Note: a straight seam runs from the surface to
the box's corner, and its end on the surface decides how far the bubble may curl before it cuts the
seam.  The run ends when the air jet has come through the light gas, which no grid line can follow.
Source: [HaasSturtevant1987], table 2, and [QuirkKarni1996], table 3, for the velocities of the
light gas; the gases as flow solvers take them since then.  Of the heavy gas's velocities only the
incident shock's is quoted elsewhere, so the others are compared with a fixed grid alone.
"""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.motion.line import LineRule
from shockgrid.hydro.motion.smoothing import THICK_CELLS
from shockgrid.problems.deck import (
    MOST_CELLS,
    Deck,
    HandoverKey,
    Limiter,
    Output,
    RefinementKey,
    Regrid,
    RunControl,
    key,
)
from shockgrid.problems.initial_states import make_plane_grid, mix_states, put_walls
from shockgrid.problems.pictures import (
    Colours,
    draw_field,
    draw_grid,
    find_dump,
    make_panels,
    trace_contact,
)
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.hugoniot import shock_with_mach
from shockgrid.problems.references.riemann import solve_riemann
from shockgrid.problems.report import Report, Row, align
from shockgrid.problems.signals import find_time
from shockgrid.regrid.algebraic import fill_from_sides
from shockgrid.regrid.measure.cells import compute_area_fractions

SECONDS_PER_MICROSECOND = 1e-6
AIR_PRESSURE = 101325.0
AIR_DENSITY = 1.225
AIR = IdealGas(1.4)
GASES = {"helium": (0.2228, IdealGas(1.648)), "R22": (3.863, IdealGas(1.249))}
BUBBLE_RADIUS = 0.025
HALF_HEIGHT = 0.0445
# The barrel over the radius: its half width on the axis, its corners', its top's distance.
CORE_PART = 0.5
CORNER_PART = 0.68
CROWN_PART = 0.7
# Smoothing length of the surface over the radius.  With 0.75 of a cell alone, finer cells follow
# ever finer lobes of the unstable surface, until one runs over the end of a border of blocks.
LEAST_SMOOTHING_RADII = 0.05
# Degrees from the axis where the three blocks around the bubble meet: the seam that leads from
# there to the box's corner has to stay clear of the lobe that curls over it.
JOINT = {"helium": 70.0, "R22": 38.0}
PICTURE = {"helium": 427e-6, "R22": 417e-6}  # a photograph after the shock's arrival [s]
# lengths of the tube before and behind the box [m]
UPWIND_LENGTH = 0.1
DOWNWIND_LENGTH = 0.16
FIRST_GAP_RADII = 0.1  # first distance of shock and bubble over the radius
BUBBLE = ("core", "west", "north", "east")
# of gradients that are drawn, from those that 1 % of a picture's nodes exceed
DRAWN_GRADIENT_DECADES = 1.3
# Times of photographs [us] after the shock's arrival; 340 added.
PHOTOGRAPHS = {
    "helium": (32, 62, 102, 245, 340, 427, 674),
    "R22": (55, 115, 187, 247, 318, 417, 1020),
}


class Feature(NamedTuple):
    """A velocity: what, its history column, window, and what others have for it [m/s].

    Window in microseconds after the shock's arrival; a name stands for the moment the refracted
    shock leaves the bubble, `exit`, some microseconds added.  measured: Haas and Sturtevant's;
    computed: Quirk and Karni's; both NaN where no publication at hand repeats the number.
    fixed_grid: on 200 cells per diameter, of tests/oracles/bubble_on_fixed_grid.py.
    """

    words: str
    column: str
    window: tuple[float | str, float | str]
    measured: float
    computed: float
    fixed_grid: float


FEATURES = {
    "helium": (
        Feature("incident shock", "wall_front", (0, 50), 410, 422, 415.2),
        Feature("refracted shock", "axis_front", (5, "exit"), 900, 943, 939.7),
        Feature("transmitted shock", "axis_front", ("exit+10", 250), 393, 377, 375.4),
        Feature("upwind end", "upwind", (0, 50), 170, 178, 176.7),
        Feature("jet of air", "upwind", (100, 250), 230, 227, 215.7),
        Feature("downwind end", "downwind", ("exit+10", 250), 145, 146, 131.7),
        Feature("rearmost point", "rear", (300, 1000), 113, math.nan, 110.2),
    ),
    "R22": (
        Feature("incident shock", "wall_front", (0, 100), 415, math.nan, 415.2),
        Feature("refracted shock", "axis_front", (5, 170), math.nan, math.nan, 241.6),
        Feature("transmitted shock", "axis_front", (202, 250), math.nan, math.nan, 453.7),
        Feature("upwind end", "upwind", (0, 200), math.nan, math.nan, 70.2),
        Feature("upwind end to 400 µs", "upwind", (0, 400), math.nan, math.nan, 65.0),
        Feature("upwind end from 400 µs", "upwind", (400, 1000), math.nan, math.nan, 85.9),
        Feature("downwind end", "downwind", (200, 400), math.nan, math.nan, 91.9),
        Feature("downwind end from 400 µs", "downwind", (400, 1000), math.nan, math.nan, 71.5),
    ),
}
# When the heavy bubble's downwind end, which the shock in the air had pushed upwind, turns:
# microseconds after the shock's arrival, on the fixed grid.
FOCUS = {"R22": 200.8}
LINKS = (
    ("seam", "west", "i_max", "core", "i_min"),
    ("seam", "east", "i_min", "core", "i_max"),
    ("interface", "west", "i_min", "air-west", "i_max"),
    ("interface", "east", "i_max", "air-east", "i_min"),
    ("seam", "north", "i_min", "core", "j_max"),
    ("interface", "north", "i_max", "air-north", "i_min"),
    ("seam", "upwind", "i_max", "air-west", "i_min"),
    ("seam", "air-east", "i_max", "downwind", "i_min"),
    ("seam", "west", "j_max", "north", "j_max"),
    ("seam", "north", "j_min", "east", "j_max"),
    ("seam", "air-west", "j_max", "air-north", "j_max"),
    ("seam", "air-north", "j_min", "air-east", "j_max"),
)
AXIS = ("upwind", "air-west", "west", "core", "east", "air-east", "downwind")
OUTLINE = {"west": 0, "north": -1, "east": -1}  # the row of nodes on the bubble's surface


class ShockBubbleDeck(Deck, kw_only=True):
    run: RunControl = RunControl(cfl=0.8)
    output: Output = Output(dumps=40)
    regrid: Regrid = Regrid()
    gas: key(Literal["helium", "R22"], "in the bubble") = "helium"
    mach: key(float, "Mach number of the shock in air", ge=1.001, le=5) = 1.22
    cells: key(int, "cells along 45 degrees of the bubble's surface", ge=4, le=MOST_CELLS) = 12
    thickness: key(
        float | None,
        "smoothing length. If left out: 0.75 of a cell, at least 0.05 radii",
        ge=0,
        le=1,
    ) = None
    handover: HandoverKey = False
    handover_refinement: RefinementKey = 2
    limiter: Limiter = "van-leer"


class ShockBubble(Problem):
    Deck = ShockBubbleDeck
    places = "upwind", "downwind", "rear", "height", "axis_front", "wall_front"
    units: ClassVar = {**dict.fromkeys(places, "m"), "volume": "m2"}

    def __init__(self, deck: ShockBubbleDeck):
        super().__init__(deck)
        self.shock = shock = shock_with_mach(AIR, AIR_DENSITY, AIR_PRESSURE, deck.mach)
        self.behind = shock.rho, shock.particle_speed, 0.0, shock.p
        self.rho, self.eos = GASES[deck.gas]
        self.far_end = HALF_HEIGHT + DOWNWIND_LENGTH
        self.arrival = FIRST_GAP_RADII * BUBBLE_RADIUS / shock.shock_speed
        self.t_end = deck.run.t_end or self.arrival + PICTURE[deck.gas]
        # velocities of the experiment, at whose Mach number alone they are known
        self.features = FEATURES[deck.gas] if deck.mach == self.Deck().mach else ()
        air = shock.rho, shock.particle_speed, shock.p
        self.contact = solve_riemann(AIR, air, self.eos, (self.rho, 0.0, AIR_PRESSURE))

    def make_grids(self, t=0.0):
        n = self.deck.cells
        high = HALF_HEIGHT
        joint = math.radians(JOINT[self.deck.gas])
        core = CORE_PART * BUBBLE_RADIUS
        size = core / n
        columns = max(4, round(1.2 * BUBBLE_RADIUS * (math.pi - 2.0 * joint) / size))
        up = np.linspace(0.0, 1.0, round(n * joint / (0.25 * math.pi)) + 1)
        across = np.linspace(-1.0, 1.0, columns + 1)
        x, y = (
            CORNER_PART * BUBBLE_RADIUS * math.cos(joint),
            CORNER_PART * BUBBLE_RADIUS * math.sin(joint),
        )
        mirror = np.array([[-1.0], [1.0]])
        east = np.array([x + (core - x) * (1.0 - up**2), y * up])
        top = (CROWN_PART * BUBBLE_RADIUS - y) * (1.0 - across**2)
        barrel = {"west": mirror * east, "north": np.array([x * across, y + top]), "east": east}
        turn = 0.5 * math.pi - joint
        arc = BUBBLE_RADIUS * np.array([np.cos(joint * up), np.sin(joint * up)])
        over = BUBBLE_RADIUS * np.array([np.sin(turn * across), np.cos(turn * across)])
        circle = {"west": mirror * arc, "north": over, "east": arc}
        side = np.array([np.full(up.size, high), high * up])
        lid = np.array([high * across, np.full(across.size, high)])
        box = {"west": mirror * side, "north": lid, "east": side}
        inner = round((BUBBLE_RADIUS - core) / size) + 1
        outer = round(1.2 * (high - BUBBLE_RADIUS) / size) + 1
        middle = np.zeros((2, across.size, up.size))
        middle[0, :, 0] = core * across
        middle[:, 0] = barrel["west"]
        middle[:, -1] = barrel["east"]
        middle[:, :, -1] = barrel["north"]
        fill_from_sides(middle.copy(), middle)
        grids = {"core": middle}
        for place in ("west", "north", "east"):
            grids[place] = np.linspace(barrel[place], circle[place], inner, axis=1)
            grids["air-" + place] = np.linspace(circle[place], box[place], outer, axis=1)
        step = 2.0 * size
        ends = {
            "upwind": (-high - UPWIND_LENGTH, -high),
            "downwind": (high, high + DOWNWIND_LENGTH),
        }
        for name, (first, last) in ends.items():
            positions = np.linspace(first, last, round((last - first) / step) + 1)
            grids[name] = make_plane_grid(positions, box["east"][1])
        # i and j have to turn counter-clockwise: those whose lines run the other way are turned
        for name in ("north", "air-north", "west", "air-west"):
            flip = name.endswith("north")
            grids[name] = grids[name][:, :, ::-1] if flip else grids[name][:, ::-1, :]
        return {name: np.ascontiguousarray(nodes) for name, nodes in grids.items()}

    def choose_thickness(self, surface: list[np.ndarray]) -> float:
        """Smoothing length [m] of the bubble's surface, whose parts are lines of nodes (2, n)."""
        if self.deck.thickness is not None:
            return self.deck.thickness
        segments = np.concatenate([np.hypot(*np.diff(line, axis=1)) for line in surface])
        return max(THICK_CELLS * float(segments.mean()), LEAST_SMOOTHING_RADII * BUBBLE_RADIUS)

    def estimate_cells(self) -> int:
        return 34 * (self.deck.cells + 2) ** 2

    def build(self):
        deck = self.deck
        blocks = {}
        ahead = AIR_DENSITY, 0.0, 0.0, AIR_PRESSURE
        for name, nodes in self.make_grids().items():
            eos = self.eos
            state = (self.rho, 0.0, 0.0, AIR_PRESSURE)
            material = deck.gas
            if name not in BUBBLE:
                part = compute_area_fractions(
                    nodes, -BUBBLE_RADIUS - FIRST_GAP_RADII * BUBBLE_RADIUS
                )
                eos = AIR
                state = mix_states(AIR, part, self.behind, ahead)
                material = "air"
            blocks[name] = Block(name, eos, nodes, *state, material=material, limiter=deck.limiter)
        put(blocks["upwind"], "i_min", "inflow", state=self.behind)
        links = [
            join(kind, (blocks[one], side), (blocks[other], other_side))
            for kind, one, side, other, other_side in LINKS
        ]
        put_walls(*blocks.values())
        surface = [blocks[name].nodes[:, row] for name, row in OUTLINE.items()]
        size = CORE_PART * BUBBLE_RADIUS / deck.cells
        simulation = self.simulate(
            blocks.values(),
            links,
            line_rule=LineRule(thickness=self.choose_thickness(surface)),
            handover=self.make_handover(list(blocks.values()), size),
        )
        west_seam, east_seam, west, east, _, top = (link.leader for link in links[:6])
        for side in (west, east):  # else the vortex takes these points into the fold of the jet
            simulation.motion.sides.let_slide(side, top)
        # left to the gas, the middle square would be run over by the jet
        for seam in (west_seam, east_seam):
            simulation.motion.sides.tie_seam(seam, west, east)
        return simulation

    def measure(self, evolution) -> dict[str, float]:
        """Places of the bubble's ends and of the shocks [m], the area of half the bubble [m2].

        `rear` is the bubble's rearmost point, on the axis or not; a shock is where the pressure
        first falls to the mean of both sides (at the wall) or to 1.05 of that ahead (on the axis,
        where it is weakened by refraction), from the tube's beginning on.
        """
        if len(evolution.blocks) == 1:
            return self._measure_field(evolution.blocks[0])
        blocks = {block.name: block for block in evolution.blocks}
        lines = west, _, east = [blocks[name].nodes[:, row] for name, row in OUTLINE.items()]
        axis = [(blocks[name].nodes[0, :, 0], blocks[name].p[:, 0]) for name in AXIS]
        lid = blocks["air-north"]
        wall = [
            (blocks["upwind"].nodes[0, :, -1], blocks["upwind"].p[:, -1]),
            (lid.nodes[0, -1, ::-1], lid.p[-1, ::-1]),
            (blocks["downwind"].nodes[0, :, -1], blocks["downwind"].p[:, -1]),
        ]
        return {
            "upwind": float(west[0, 0]),
            "downwind": float(east[0, 0]),
            "rear": min(float(line[0].min()) for line in lines),
            "height": max(float(line[1].max()) for line in lines),
            "volume": sum(float(blocks[name].volume.sum()) for name in BUBBLE),
            "axis_front": find_front(axis, 1.05 * AIR_PRESSURE),
            "wall_front": find_front(wall, 0.5 * (AIR_PRESSURE + self.shock.p)),
        }

    def _measure_field(self, block) -> dict[str, float]:
        """The same, of a block of both gases: the bubble ends where it fills half of a cell.

        No ends on the axis, nan, where the jet of air has come through.
        """
        x, y = np.concatenate(trace_contact(block), axis=1)
        lowest_row = 0.5 * (block.nodes[1, 0, 0] + block.nodes[1, 0, 1])
        on_axis = x[y <= lowest_row + 1e-9 * HALF_HEIGHT]
        on_axis = on_axis if on_axis.size else np.array([math.nan])
        bubble = block.volume * block.cell_fields["volume_fraction"]
        nodes = block.nodes[0]
        p = block.p
        return {
            "upwind": float(on_axis.min()),
            "downwind": float(on_axis.max()),
            "rear": float(x.min()),
            "height": float(y.max()),
            "volume": float(bubble.sum()),
            "axis_front": find_front([(nodes[:, 0], p[:, 0])], 1.05 * AIR_PRESSURE),
            "wall_front": find_front(
                [(nodes[:, -1], p[:, -1])], 0.5 * (AIR_PRESSURE + self.shock.p)
            ),
        }

    def find_focus(self, history) -> float:
        """When the refracted shock comes to its focus at the downwind end and turns it [us after
        the shock's arrival]; NaN before."""
        since = (history["t"] - self.arrival) / SECONDS_PER_MICROSECOND
        inside = np.flatnonzero((since > 100.0) & (since < 250.0))
        known = since[-1] >= 250.0
        return float(since[inside[np.argmin(history["downwind"][inside])]]) if known else math.nan

    def fit_velocity(self, history, feature: Feature) -> tuple[tuple[float, float] | None, float]:
        """A feature's window [s] in a run and the slope [m/s] of the straight line through its
        places there; None and NaN where the run is not there yet.

        A window is complete when the run has passed its end; of the rearmost point's, a third
        suffices.  The line is fitted to equally many places in equal times.
        """
        leaves = find_time(history["t"], history["axis_front"] > history["downwind"])
        start, end = (
            leaves + float(mark.partition("+")[2] or 0.0) * SECONDS_PER_MICROSECOND
            if isinstance(mark, str)  # from the refracted shock's exit on
            else self.arrival + mark * SECONDS_PER_MICROSECOND
            for mark in feature.window
        )
        last = float(history["t"][-1])
        if feature.column == "rear" and last > start + 100.0 * SECONDS_PER_MICROSECOND:
            end = min(end, last)
        if not start < end <= last * (1.0 + 1e-12):
            return None, math.nan
        t = np.linspace(start, end, 101)
        places = np.interp(t, history["t"], history[feature.column])
        return (start, end), float(np.polyfit(t - t[0], places, 1)[0])

    def report(self, run) -> Report:
        """Errors are those of velocities against the experiment's, or the fixed grid's where it has
        none; of the upwind end's first speed against the plane contact's; of the focus' time."""
        history = run.history
        if not run.begun:
            return Report()
        deck = self.deck
        t = history["t"]
        volume = history["volume"]
        first = math.nan
        # the upwind end while the shock goes a quarter of a radius on
        start, end = (
            self.arrival + part * BUBBLE_RADIUS / self.shock.shock_speed for part in (0.05, 0.3)
        )
        if t[-1] >= end:
            first = float(np.diff(np.interp([start, end], t, history["upwind"]))[0]) / (end - start)
        rows = [Row("first_upwind_speed", first, self.contact.u, error="upwind_speed")]
        # columns of others' velocities, where anybody has one of this gas
        others = [
            (title, column)
            for title, column in (
                ("fixed grid", "fixed_grid"),
                ("measured", "measured"),
                ("computed", "computed"),
            )
            if any(math.isfinite(getattr(feature, column)) for feature in self.features)
        ]
        table = [["velocities [m/s]", "here", *(title for title, _ in others), "window [µs]"]]
        for feature in self.features:
            name = feature.words
            known = feature.fixed_grid if math.isnan(feature.measured) else feature.measured
            window, speed = self.fit_velocity(history, feature)
            rows.append(Row(name, speed, known, error=name))
            if window:
                begin, end = ((time - self.arrival) / SECONDS_PER_MICROSECOND for time in window)
                of_others = [getattr(feature, column) for _, column in others]
                texts = ["" if math.isnan(x) else f"{x:g}" for x in of_others]
                table.append([name, f"{speed:.1f}", *texts, f"{begin:.0f}-{end:.0f}"])
        if self.features and deck.gas in FOCUS:
            rows.append(Row("focus", self.find_focus(history), FOCUS[deck.gas], error="focus"))
        lines = [
            f"shock-bubble, {deck.gas} in air, Mach {deck.mach:g}, "
            f"t = {(t[-1] - self.arrival) / SECONDS_PER_MICROSECOND:.4g} µs "
            "after the shock's arrival:"
        ]
        lines += align(table) if len(table) > 1 else []
        ends = [1e3 * run.last(name) for name in ("upwind", "downwind", "height")]
        notes = [
            f"plane waves: shock {self.shock.shock_speed:.1f}, refracted shock "
            f"{self.contact.right_wave.head:.1f}, contact {self.contact.u:.1f} m/s; the upwind "
            f"end initially {first:.1f}",
            f"bubble from x = {ends[0]:.2f} to {ends[1]:.2f} mm on the axis, {ends[2]:.2f} mm "
            f"high, {volume[-1] / volume[0]:.4f} of its first volume",
        ]
        return Report("\n".join(lines), rows, notes)

    def draw_shock_bubble(self, figure, run_data) -> None:
        """Density gradients as a shadowgraph shows them, the grid mirrored below, at the times of
        the experiment's photographs and at the end."""
        last = run_data.dumps[-1]
        chosen = {}
        for time in PHOTOGRAPHS[self.deck.gas]:
            wanted = self.arrival + time * SECONDS_PER_MICROSECOND
            dump = find_dump(run_data, wanted)
            if dump.t > self.arrival and wanted <= last.t * (1.0 + 1e-12):
                chosen[dump.t] = dump
        dumps = list({**chosen, last.t: last}.values())
        columns = min(3, len(dumps))
        rows = -(-len(dumps) // columns)
        panels = make_panels(figure, 4.2 * columns, 3.9 * rows, rows, columns, squeeze=False)
        for axis in panels.ravel()[len(dumps) :]:
            axis.remove()
        for axis, dump in zip(panels.ravel(), dumps, strict=False):
            draw_shadowgraph(axis, self.deck.gas, dump)
            axis.set_title(
                f"{(dump.t - self.arrival) / SECONDS_PER_MICROSECOND:.0f} µs", fontsize="medium"
            )

    def draw_space_time(self, figure, run_data) -> None:
        """Places of the bubble's ends and of the shocks over time, and the measured velocities."""
        history = run_data.history
        axis = make_panels(figure, 7.5, 6.0)
        t = (history["t"] - self.arrival) / SECONDS_PER_MICROSECOND
        inside = history["axis_front"] < self.far_end - 1e-3
        columns = {
            "upwind": ("upwind end, then jet", "C3"),
            "rear": ("rearmost point", "C1"),
            "downwind": ("downwind end", "C0"),
            "axis_front": ("shock on the axis", "C2"),
            "wall_front": ("shock at the wall", "0.5"),
        }
        for name, (label, colour) in columns.items():
            places = np.where(inside, history[name], np.nan) if "front" in name else history[name]
            axis.plot(1e3 * places, t, color=colour, label=label)
        for feature in self.features:
            window, _ = self.fit_velocity(history, feature)
            if window is None or math.isnan(feature.measured):
                continue
            ends = np.array(window)
            at = np.interp(np.linspace(*window, 101), history["t"], history[feature.column]).mean()
            places = at + feature.measured * (ends - ends.mean())
            axis.plot(1e3 * places, (ends - self.arrival) / SECONDS_PER_MICROSECOND, "k--", lw=1.0)
        axis.plot([], [], "k--", lw=1.0, label="measured velocities")
        far = 1e3 * max(float(history["downwind"].max()) + 0.03, 0.08)
        axis.set(xlim=(-40.0, far), ylim=(min(t[0], 0.0), t[-1]))
        axis.set(xlabel="x [mm]", ylabel="time after the shock's arrival [µs]")
        axis.set_title(f"{self.deck.gas}, {self.deck.cells} cells", fontsize="medium")


def find_front(rows: list[tuple[np.ndarray, np.ndarray]], level: float) -> float:
    """Where the pressure first falls below `level` [m], linear between the middles of cells.

    rows: places of the nodes (n + 1) and pressures of the cells (n), one row after the other.
    """
    x = np.concatenate([0.5 * (nodes[1:] + nodes[:-1]) for nodes, _ in rows])
    p = np.concatenate([pressure for _, pressure in rows])
    below = np.flatnonzero(p < level)
    if below.size == 0 or below[0] == 0:
        return float(rows[-1][0][-1] if below.size == 0 else rows[0][0][0])
    k = int(below[0])
    return float(x[k - 1] + (x[k] - x[k - 1]) * (p[k - 1] - level) / (p[k - 1] - p[k]))


def compute_slope(block) -> np.ndarray:
    """Size of the gradient of the density's logarithm in the cells (ni, nj) of a block [1/m]."""
    fields = *block.centres, np.log(block.rho)
    (x_i, x_j), (y_i, y_j), (rho_i, rho_j) = (np.gradient(values) for values in fields)
    slopes = np.array([rho_i * y_j - rho_j * y_i, rho_j * x_i - rho_i * x_j])
    return np.hypot(*slopes / (x_i * y_j - x_j * y_i))


def draw_shadowgraph(axis, gas: str, dump) -> None:
    """One time: gradients above the axis, the grid below it, the bubble's surface around."""
    blocks = {block.name: block for block in dump.blocks}
    slopes = np.concatenate([compute_slope(block).ravel() for block in dump.blocks])
    most = float(np.percentile(slopes, 99.0))

    def darken(block):
        return np.log10(np.maximum(compute_slope(block) / most, 1e-9))

    colours = Colours(low=-DRAWN_GRADIENT_DECADES, high=0.2, map="Greys")
    draw_field(axis, dump, darken, colours, mm=True)
    for block in dump.blocks:
        x, y = 1e3 * block.nodes
        draw_grid(axis, np.array([x, -y]), color="C0" if block.material == gas else "0.6")
    if len(blocks) == 1:
        lines = [1e3 * curve for curve in trace_contact(dump.blocks[0])]
    else:
        lines = [1e3 * blocks[name].nodes[:, row] for name, row in OUTLINE.items()]
    for x, y in lines:
        axis.plot(x, y, "k", x, -y, "k", lw=1.0)
    ends = np.concatenate(lines, axis=1)[0]
    middle = 0.5 * (ends.min() + ends.max())
    axis.set(xlim=(middle - 48.0, middle + 48.0), ylim=(-44.5, 44.5))
