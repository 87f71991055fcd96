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

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from problems.deck import MOST_CELLS, Deck, Regrid, RunControl, VoidFill, key
from problems.pictures import draw_columns, draw_field, find_dump
from problems.problem import BlockPlan, Problem, Report, Row, find_time
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
    picture = "cavity"
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

    @property
    def t_end(self) -> float:
        """The deck's, or time enough for the void to close and the jet's shock to run on."""
        closing = 2.0 / self.near_speed + 1.5 / self.shock.shock_speed
        return self.deck.run.t_end or self.arrival + closing * self.deck.radius

    def make_grid(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (2, ni + 1, nj + 1): i along the void from its near to its far side, j outwards;
        and the numbers of the nodes at the channel's corners."""
        deck, radius = self.deck, self.deck.radius
        before, behind, width = (radius * part for part in (deck.before, deck.behind, deck.width))
        corners = np.array([[-before, 0.0], [-before, width], [behind, width], [behind, 0.0]]).T
        # as many cells on each of the channel's walls as its part of the half turn asks for
        turn = np.unwrap(np.arctan2(corners[1], corners[0]))
        counts = np.maximum(3, np.rint(deck.cells * -np.diff(turn) / math.pi).astype(int))
        at = np.concatenate([[0], np.cumsum(counts)])
        outer = np.array([np.interp(np.arange(at[-1] + 1), at, row) for row in corners])
        angle = np.pi * (1.0 - np.linspace(0.0, 1.0, at[-1] + 1))
        inner = radius * np.array([np.cos(angle), np.sin(angle)])
        inner[1, [0, -1]] = 0.0
        rows = max(6, round(deck.cells / math.pi * 0.5 * (deck.before + deck.width - 2.0)))
        part = np.linspace(0.0, 1.0, rows + 1)
        part = FINEST * part + (1.0 - FINEST) * part**2
        return inner[:, :, None] * (1.0 - part) + outer[:, :, None] * part, at

    def estimate_cells(self) -> int:
        deck = self.deck
        return round(deck.cells**2 / math.pi * 0.5 * (deck.before + deck.width)) + 6 * deck.cells

    def plan(self):
        return self.t_end, [BlockPlan.of_nodes("metal", self.make_grid()[0])]

    def build(self):
        deck, (nodes, corners) = self.deck, self.make_grid()
        state, material = (self.material.rho0, 0.0, 0.0, 0.0), deck.material.rpartition(":")[2]
        block = Block("metal", self.material.eos, nodes, *state, material=material)
        for side in ("i_min", "i_max"):
            put(block, side, "axis" if self.curved else "wall")
        put(block, "j_min", "free-surface")
        first, second, third, last = (int(k) for k in corners)
        put(block, "j_max", "piston", first, second, velocity=(deck.speed, 0.0))
        put(block, "j_max", "wall", second, third)
        put(block, "j_max", "free-surface", third, last)
        least = deck.closed * measure_void(nodes, self.curved)

        def find_end(simulation):
            if measure_void(simulation.blocks[0].nodes, self.curved) >= least:
                return None
            return f"the void is closed but for {100.0 * deck.closed:g} % of its size"

        return self.simulate([block], geometry=deck.geometry, find_end=find_end)

    def measure(self, evolution) -> dict[str, float]:
        """Size and width of the void, speeds of the cells at its ends, greatest pressure."""
        (block,) = evolution.blocks
        x, (_, u, _, p) = block.nodes[0, :, 0], block.state[:, 1:-1, 1:-1]
        return {
            "void_size": measure_void(block.nodes, self.curved),
            "void_width": float(x[-1] - x[0]),
            "jet_speed": float(u[0, 0]),
            "far_speed": float(u[-1, 0]),
            "most_pressure": float(p.max()),
        }

    def find_closing(self, history) -> float:
        """When the jet has come to the far side [s], NaN where it has not."""
        return find_time(history, history["void_width"] <= 1e-6 * self.deck.radius)

    def report(self, history, final=None) -> Report:
        deck, near, t, notes = self.deck, self.near_speed, math.nan, []
        if history:
            jet, size = history["jet_speed"], history["void_size"]
            t = find_time(history, jet > 0.5 * near)
            notes = [
                f"jet: up to {float(np.nanmax(jet)):.5g} m/s; behind this shock a plane free "
                f"surface goes at {near:.5g} m/s"
            ]
            if math.isfinite(closing := self.find_closing(history)):
                most = float(np.nanmax(history["most_pressure"]))
                notes.append(
                    f"it hits the far side at t = {closing:.4g} s; greatest pressure then "
                    f"{1e-9 * most:.4g} GPa, behind the shock {1e-9 * self.shock.p:.4g} GPa"
                )
            left = 100.0 * max(float(size[-1]), 0.0) / float(size[0])
            notes.append(f"the void has {left:.2g} % of its size in the end")
        rows = [
            Row("shock_pressure", theory=self.shock.p),
            Row("arrival", t, self.arrival, "shock at the void [s]", digits=5),
            Row("near_speed", theory=near),
        ]
        head = (
            f"cavity: void of {1e3 * deck.radius:g} mm radius in {deck.material}, piston at "
            f"{deck.speed:g} m/s, {deck.cells} cells along the void"
        )
        return Report(head, rows, notes)

    def draw(self, figure, run_data) -> None:
        """Pressure and grid at four times, size of the void and speed of the jet over time."""
        figure.set_size_inches(12.0, 5.6)
        history, deck, last = run_data.history, self.deck, run_data.history["t"][-1]
        closing = self.find_closing(history)
        end = closing if math.isfinite(closing) else last
        times = (self.arrival, 0.5 * (self.arrival + end), end, last)
        dumps, axes = [find_dump(run_data, t) for t in times], figure.subplots(2, 3)
        high = max(float(np.quantile(d.blocks[0].cell_fields["p"], 0.995)) for d in dumps)
        for axis, dump in zip((*axes[0, :2], *axes[1, :2]), dumps, strict=True):
            pressure = lambda block: 1e-9 * block.cell_fields["p"]  # noqa: E731
            picture = draw_field(axis, dump, pressure, low=0.0, high=1e-9 * high, every=1)
            axis.set(xlim=(-1.6 * deck.radius, 2.4 * deck.radius), ylim=(0.0, 2.0 * deck.radius))
            axis.set_title(f"t = {1e6 * dump.t:.3f} µs", fontsize="medium")
        figure.colorbar(picture, ax=axes[:, :2], shrink=0.7, label="pressure [GPa]")
        part = {**history, "part": history["void_size"] / history["void_size"][0]}
        draw_columns(axes[0, 2], part, {"part": ""}, "size of the void, of its first one", "µs")
        speeds = {"jet_speed": "near side, jet", "far_speed": "far side"}
        draw_columns(axes[1, 2], history, speeds, "speed [m/s]", "µs")
        axes[1, 2].axhline(self.near_speed, color="k", lw=0.8, ls="--", label="plane free surface")
        axes[1, 2].legend()


def measure_void(nodes: np.ndarray, curved: bool) -> float:
    """Area of the half void [m2], or its volume per radian."""
    x, y = nodes[:, :, 0]
    if curved:
        return float((np.diff(x) * (y[1:] ** 2 + y[1:] * y[:-1] + y[:-1] ** 2)).sum()) / 6.0
    return float((np.diff(x) * (y[1:] + y[:-1])).sum()) / 2.0
