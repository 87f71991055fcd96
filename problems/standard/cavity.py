"""A shock collapses a round void in a metal: a jet runs through it and hits the far side.

A piston drives a shock along a channel of metal with a cylindrical void (plane flow) or a spherical
one (axisymmetric); half of it is computed, beside the plane of symmetry or the axis.  The shock
is released at the void's near side, which accelerates into the void and becomes a jet
on the line of symmetry.  It hits the far side; from then on the void's surface meets itself in a
contact that closes by itself (theory F16).  The run continues until less than the fraction `closed`
of the void is left.  The problem measures the void's size, its width along the channel and the
speeds of both its ends.  Theory gives the time of the shock's arrival, the pressure behind it, and
the speed of a plane free surface behind it, which is the initial speed of the near side.

Note: the jet's speed and the pressure of its impact increase with finer cells; the time at which
the void is closed does not change.
"""

import math
from typing import ClassVar, Literal

import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from problems.deck import MOST_CELLS, Deck, Regrid, RunControl, VoidFill, key
from problems.initial_states import put_walls
from problems.pictures import draw_field, find_dump, make_panels
from problems.problem import Problem, Report, Row, find_most, find_time
from problems.references.hugoniot import release, shock_with_particle_speed
from regrid.errors import BadInput

FINEST = 0.5  # of the rows' mean height: the height of those at the void


class CavityDeck(Deck, kw_only=True):
    run: RunControl = RunControl(cfl=0.8)
    regrid: Regrid = Regrid(epsilon=3e-2)
    material: key(str, "of the body, name or FILE.toml:NAME") = "Al1100"
    speed: key(float, "of the piston [m/s]", gt=0, le=1e5) = 1000.0
    radius: key(float, "of the void [m]", gt=0, le=1e3) = 1e-3
    before: key(float, "piston from the void's centre, in radii", gt=1, le=100) = 2.5
    behind: key(float, "free surface behind the void, in radii", gt=1, le=100) = 5.0
    width: key(float, "half of the channel's width, in radii", gt=1, le=100) = 3.0
    closed: key(float, "part of the void's size with which the run ends", gt=0, lt=1) = 0.01
    geometry: key(
        Literal["plane", "axisymmetric"], "plane: a cylindrical void; axisymmetric: a spherical one"
    ) = "plane"
    void_fill: VoidFill = VoidFill()
    cells: key(int, "along half of the void's line", ge=16, le=MOST_CELLS) = 64


class Cavity(Problem):
    """One block around the void: rays from the void to the channel's walls."""

    Deck = CavityDeck
    units: ClassVar = {
        "void_size": "m2", "void_width": "m", "jet_speed": "m/s", "far_speed": "m/s",
        "most_pressure": "Pa",
    }  # fmt: skip

    def __init__(self, deck: CavityDeck):
        super().__init__(deck)
        self.material, self.curved = find_material(deck.material), deck.geometry == "axisymmetric"
        eos, rho = self.material.eos, self.material.rho0
        try:
            self.shock = shock = shock_with_particle_speed(eos, rho, 0.0, deck.speed)
            self.near_speed = deck.speed + release(eos, shock.rho, shock.p)[1]
        except (BadInput, ValueError) as error:
            raise BadInput(
                f"deck: speed is {deck.speed:g} m/s: {deck.material} has no such shock ({error})"
            ) from None
        self.arrival = (deck.before - 1.0) * deck.radius / shock.shock_speed
        closing = 2.0 / self.near_speed + 1.5 / shock.shock_speed  # and the jet's shock runs on
        self.t_end = deck.run.t_end or self.arrival + closing * deck.radius
        # corners of the channel, and as many cells on each wall as its part of the half turn has
        before, behind, width = deck.before, deck.behind, deck.width
        corners = [[-before, 0.0], [-before, width], [behind, width], [behind, 0.0]]
        self.corners = deck.radius * np.array(corners).T
        turn = -np.diff(np.unwrap(np.arctan2(*self.corners[::-1])))
        counts = np.maximum(3, np.rint(deck.cells * turn / math.pi).astype(int))
        self.corner_nodes = [0, *(int(number) for number in np.cumsum(counts))]
        self.rows = max(6, round(deck.cells / math.pi * 0.5 * (before + width - 2.0)))

    def make_grids(self, t=0.0):
        """i runs along the void from its near to its far side, j outwards."""
        along = np.arange(self.corner_nodes[-1] + 1)
        outer = np.array([np.interp(along, self.corner_nodes, row) for row in self.corners])
        angle = np.pi * (1.0 - np.linspace(0.0, 1.0, along.size))
        inner = self.deck.radius * np.array([np.cos(angle), np.sin(angle)])
        inner[1, [0, -1]] = 0.0
        part = np.linspace(0.0, 1.0, self.rows + 1)
        part = FINEST * part + (1.0 - FINEST) * part**2
        return {"metal": inner[:, :, None] * (1.0 - part) + outer[:, :, None] * part}

    def estimate_cells(self) -> int:
        deck = self.deck
        return round(deck.cells**2 / math.pi * 0.5 * (deck.before + deck.width)) + 6 * deck.cells

    def build(self):
        deck, nodes = self.deck, self.make_grids()["metal"]
        state, material = (self.material.rho0, 0.0, 0.0, 0.0), deck.material.rpartition(":")[2]
        block = Block("metal", self.material.eos, nodes, *state, material=material)
        for side in ("i_min", "i_max") if self.curved else ():
            put(block, side, "axis")
        put(block, "j_min", "free-surface")
        _, first, second, last = self.corner_nodes
        put(block, "j_max", "piston", 0, first, velocity=(deck.speed, 0.0))
        put(block, "j_max", "free-surface", second, last)
        put_walls(block)
        least = deck.closed * measure_void(nodes, self.curved)
        words = f"the void is closed but for {100.0 * deck.closed:g} % of its size"

        def find_end(simulation):
            left = measure_void(simulation.blocks[0].nodes, self.curved)
            return words if left < least else None

        return self.simulate([block], geometry=deck.geometry, find_end=find_end)

    def measure(self, evolution) -> dict[str, float]:
        """Size and width of the void, speeds of the cells at its ends, greatest pressure."""
        (block,) = evolution.blocks
        x, (_, u, _, p) = block.nodes[0, :, 0], block.state[:, 1:-1, 1:-1]
        size, width = measure_void(block.nodes, self.curved), float(x[-1] - x[0])
        row = {"void_size": size, "void_width": width, "jet_speed": float(u[0, 0])}
        return {**row, "far_speed": float(u[-1, 0]), "most_pressure": float(p.max())}

    def find_closing(self, history) -> float:
        """When the jet has come to the far side [s], NaN where it has not."""
        return find_time(history, history["void_width"] <= 1e-6 * self.deck.radius)

    def report(self, history, final=None) -> Report:
        deck, near, p, size = self.deck, self.near_speed, self.shock.p, history["void_size"]
        arrival = find_time(history, history["jet_speed"] > 0.5 * near)
        closing, left = self.find_closing(history), max(float(size[-1] / size[0]), 0.0)
        most = find_most(history, "most_pressure") if math.isfinite(closing) else math.nan
        words = "greatest speed of the jet; plane free surface [m/s]"
        rows = [
            Row("arrival", arrival, self.arrival, "shock at the void [s]", digits=5),
            Row("near_speed", find_most(history, "jet_speed"), near, words, digits=5, off=" "),
            Row("closing", closing, label="it hits the far side [s]", digits=4),
            Row("shock_pressure", most, p, "greatest pressure then [GPa]", 1e9, 4, off=" "),
            Row("left", left, label="void left at the end [%]", unit=0.01, digits=3),
        ]
        head = (
            f"cavity: void of {1e3 * deck.radius:g} mm radius in {deck.material}, piston at "
            f"{deck.speed:g} m/s, {deck.cells} cells along the void"
        )
        return Report(head, rows)

    def draw_cavity(self, figure, run_data) -> None:
        """Pressure and grid at four times, until the jet hits the far side and at the end."""
        history, radius = run_data.history, self.deck.radius
        axes = make_panels(figure, 9.5, 5.8, 2, 2)
        closing, last = self.find_closing(history), history["t"][-1]
        end = closing if math.isfinite(closing) else last
        times = (self.arrival, 0.5 * (self.arrival + end), end, last)
        dumps = [find_dump(run_data, t) for t in times]
        high = max(1e-9 * float(np.quantile(dump.blocks[0].p, 0.995)) for dump in dumps)
        for axis, dump in zip(axes.flat, dumps, strict=True):
            words = {"title": f"t = {1e6 * dump.t:.3f} µs", "unit": 1e9}
            picture = draw_field(axis, dump, "p", low=0.0, high=high, every=1, **words)
            axis.set(xlim=(-1.6 * radius, 2.4 * radius), ylim=(0.0, 2.0 * radius))
        figure.colorbar(picture, ax=axes, shrink=0.7, label="pressure [GPa]")


def measure_void(nodes: np.ndarray, curved: bool) -> float:
    """Area of the half void [m2], or its volume per radian."""
    x, y = nodes[:, :, 0]
    near, far = y[:-1], y[1:]
    height = far * far + far * near + near * near if curved else far + near
    return float((np.diff(x) * height).sum()) / (6.0 if curved else 2.0)
