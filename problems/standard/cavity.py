"""A shock collapses a round void in a metal: a jet runs through it and hits the far side.

A piston drives a shock along a channel of metal with a cylindrical void (plane flow) or a spherical
one (axisymmetric); half of it is computed, beside the plane of symmetry or the axis.  The shock is
released at the void's near side, which accelerates into the void and becomes a jet on the line of
symmetry.  It hits the far side; from then on the void's surface meets itself in a contact that
closes by itself (theory F16).  The run continues until a hundredth of the void is left.  The
problem measures the void's size, its width along the channel and the speeds of both its ends.
Theory gives the time of the shock's arrival, the pressure behind it, and the speed of a plane free
surface behind it, which is the initial speed of the near side.

Note: the jet's speed and the pressure of its impact increase with finer cells; the time at which
the void is closed does not change.
"""

import functools
import math
from typing import ClassVar, Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material, find_name
from shockgrid.problems.deck import MOST_CELLS, Regrid, RunControl, VoidFill, key
from shockgrid.problems.initial_states import lay_rays, put_walls
from shockgrid.problems.pictures import Colours, draw_field, find_dump, make_panels
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.hugoniot import caution_fit, release, shock_with_particle_speed
from shockgrid.problems.report import Report, Row
from shockgrid.problems.signals import find_time, measure_below
from shockgrid.problems.solids import SolidDeck, find_laws


class CavityDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(cfl=0.8)
    regrid: Regrid = Regrid(epsilon=3e-2)
    material: key(str, "of the body, name or FILE.toml:NAME") = "Al1100"
    speed: key(float, "of the piston [m/s]", ge=1e-12, le=1e5) = 1000.0
    radius: key(float, "of the void [m]", ge=1e-9, le=1e3) = 1e-3
    before: key(float, "piston from the void's centre, in radii", gt=1, le=100) = 2.5
    behind: key(float, "free surface behind the void, in radii", gt=1, le=100) = 5.0
    width: key(float, "half of the channel's width, in radii", gt=1, le=100) = 3.0
    geometry: key(Literal["plane", "axisymmetric"], "the void: a cylinder, a sphere") = "plane"
    void_fill: VoidFill = VoidFill()
    cells: key(int, "along half of the void's line", ge=16, le=MOST_CELLS) = 64


class Cavity(Problem):
    Deck = CavityDeck
    counted = ("cells", "rows")
    units: ClassVar = {"void_size": "m2", "void_width": "m", "most_pressure": "Pa"} | (
        dict.fromkeys(("jet_speed", "far_speed"), "m/s")
    )

    def __init__(self, deck: CavityDeck):
        super().__init__(deck)
        self.material = find_material(deck.material)
        self.laws = find_laws(deck, {"metal": self.material})["metal"]
        self.curved = deck.geometry == "axisymmetric"
        eos = self.material.eos
        rho = self.material.rho0
        with deck.blame("speed", f"{deck.material} has no such shock"):
            self.shock = shock = shock_with_particle_speed(eos, rho, 0.0, deck.speed)
            self.near_speed = deck.speed + release(eos, shock.rho, shock.p)[1]
        self.arrival = (deck.before - 1.0) * deck.radius / shock.shock_speed
        closing = 2.0 / self.near_speed + 1.5 / shock.shock_speed  # and the jet's shock runs on
        self.t_end = deck.run.t_end or self.arrival + closing * deck.radius
        self.rows = max(6, round(deck.cells / math.pi * 0.5 * (deck.before + deck.width - 2.0)))
        box = -deck.before, deck.behind, deck.width
        self.lay = functools.partial(lay_rays, deck.radius, box, deck.cells, self.rows)

    def make_grids(self, t=0.0):
        return {"metal": self.lay()[0]}

    def build(self):
        deck = self.deck
        (nodes, (_, first, second, last)) = self.lay()
        state = (self.material.rho0, 0.0, 0.0, 0.0)
        material = find_name(deck.material)
        options = {"material": material, **self.laws.options}
        block = Block("metal", self.material.eos, nodes, *state, **options)
        put(block, "j_min", "free-surface")
        put(block, "j_max", "piston", 0, first, velocity=(deck.speed, 0.0))
        put(block, "j_max", "free-surface", second, last)
        put_walls(block, curved=self.curved)
        least = 0.01 * measure_below(nodes[:, :, 0], self.curved)
        condition = "the void is closed but for 1 % of its size"
        find_end = lambda flow: condition if self.measure(flow)["void_size"] < least else None  # noqa: E731
        return self.simulate([block], geometry=deck.geometry, find_end=find_end)

    def measure(self, evolution) -> dict[str, float]:
        (block,) = evolution.blocks
        x = block.nodes[0, :, 0]
        u = block.u
        p = block.p
        size = measure_below(block.nodes[:, :, 0], self.curved)
        width = float(x[-1] - x[0])
        row = {"void_size": size, "void_width": width, "jet_speed": float(u[0, 0])}
        return {**row, "far_speed": float(u[-1, 0]), "most_pressure": float(p.max())}

    def cautions(self, run) -> list[str]:
        """A piston beyond the Hugoniot."""
        return caution_fit(self.deck.material, self.material.eos, self.shock.p)

    def report(self, run) -> Report:
        history = run.history
        deck = self.deck
        near = self.near_speed
        p = self.shock.p
        size = history["void_size"]
        arrival = run.find_time(history["jet_speed"] > 0.5 * near)
        closing = run.find_time(history["void_width"] <= 1e-6 * deck.radius)
        left = max(float(size[-1] / size[0]), 0.0)
        most = run.most("most_pressure") if math.isfinite(closing) else math.nan
        rows = [
            Row("arrival", arrival, self.arrival, "arrival of the shock at the void [s]", digits=5),
            Row(
                "near_speed",
                run.most("jet_speed"),
                near,
                "greatest speed of the jet (theory: plane surface) [m/s]",
                digits=5,
                off=" ",
            ),
            Row("closing", closing, label="impact of the jet on the far side [s]", digits=4),
            Row("shock_pressure", most, p, "pressure of the impact [GPa]", 1e9, 4, off=" "),
            Row("left", left, label="void left at the end [%]", unit=0.01, digits=3),
        ]
        head = f"cavity: void of {1e3 * deck.radius:g} mm radius in {deck.material}, piston at"
        return Report(f"{head} {deck.speed:g} m/s, {deck.cells} cells along the void", rows)

    def draw_cavity(self, figure, run_data) -> None:
        """Pressure and grid at four times, until the jet hits the far side and at the end."""
        history = run_data.history
        radius = self.deck.radius
        axes = make_panels(figure, 9.5, 5.8, 2, 2)
        start = self.arrival
        last = history["t"][-1]
        end = np.nanmin((find_time(history["t"], history["void_width"] <= 1e-6 * radius), last))
        dumps = [find_dump(run_data, t) for t in (start, 0.5 * (start + end), end, last)]
        high = max(1e-9 * float(np.quantile(dump.blocks[0].p, 0.995)) for dump in dumps)
        for axis, dump in zip(axes.flat, dumps, strict=True):
            colours = Colours(unit=1e9, low=0.0, high=high)
            title = f"t = {1e6 * dump.t:.3f} µs"
            picture = draw_field(axis, dump, "p", colours, every=1, title=title)
            axis.set(xlim=(-1.6 * radius, 2.4 * radius), ylim=(0.0, 2.0 * radius))
        figure.colorbar(picture, ax=axes, shrink=0.7, label="pressure [GPa]")
