"""A shell of metal that collapses until plastic work has used up its energy, and stops.

A cylinder or a sphere moves inwards as an incompressible body would, u = -V (R0/r)^d with d = 1 or
2, between free surfaces.  It shrinks and thickens until the plastic work has taken the kinetic
energy it began with.  For a rigid, perfectly plastic, incompressible material that gives the radius
at which the inner surface stops [Verney1968, HowellBall2002]; the deck says that radius, and the
theory the speed V that leads to it.

The problem measures the mean radii of both surfaces, how round they are, and the energy in motion.

Note: beryllium is stiff, but not rigid: some 1 % of the energy goes into compression, and waves
run to and fro through the shell.  The stop is the least radius of the inner surface.
"""

import functools
import math
from typing import ClassVar, Literal

import msgspec
import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.formulas.geometry import find_centres_of_volume, find_geometry
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.problems.deck import MOST_CELLS, Limiter, Regrid, RunControl, key
from shockgrid.problems.initial_states import RadialProblem
from shockgrid.problems.pictures import Colours, draw_field, find_dump, make_panels
from shockgrid.problems.references.collapsing_shells import PlasticShell
from shockgrid.problems.report import Report, Row
from shockgrid.problems.solids import (
    SolidDeck,
    SolidMaterial,
    Strength,
    find_laws,
    find_solid_material,
    idealise,
)
from shockgrid.regrid.errors import BadInput

DIMENSIONS_OF_SHAPES = {"cylindrical": 2, "spherical": 3}
END_PART = 1.15  # of the time in which a rigid shell stops
DRAWN_PARTS = (0.0, 0.5, 1.0)  # of the run
ONE_MILLIMETRE = 1e-3


def make_beryllium() -> dict:
    return {
        "eos": "mie-gruneisen",
        "rho0": 1845.0,
        "c0": 7998.0,
        "s": 1.124,
        "gruneisen": 1.16,
        "strength": 1e11,
    }


def make_law() -> dict:
    return {"law": "perfect", "shear_modulus": 151.9e9, "yield_strength": 0.33e9}


class ShellDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(cfl=0.8)
    regrid: Regrid = Regrid()
    geometry: key(Literal["cylindrical", "spherical"], "shape of the shell") = "cylindrical"
    material: SolidMaterial = msgspec.field(default_factory=make_beryllium)
    strength: Strength = msgspec.field(default_factory=make_law)
    inner: key(float, "radius of the inner surface at the start [m]", ge=1e-9, le=1e3) = 80e-3
    outer: key(float, "radius of the outer surface at the start [m]", ge=1e-9, le=1e3) = 100e-3
    stop: key(float, "radius at which the inner surface is to stop [m]", ge=1e-9, le=1e3) = 50e-3
    speed: key(
        float | None,
        "of the inner surface at the start [m/s]. If left out: that of theory for `stop`",
        ge=1e-6,
        le=1e5,
    ) = None
    cells: key(int, "cells through the shell", ge=4, le=MOST_CELLS) = 40
    rays: key(int, "cells along a quarter of the shell", ge=4, le=MOST_CELLS) = 32
    limiter: Limiter = DEFAULT_LIMITER


class CollapsingShell(RadialProblem):
    Deck = ShellDeck
    counted = ("cells", "rays")
    t_unit = "s"
    units: ClassVar = {"inner_radius": "m", "outer_radius": "m", "kinetic_energy": "J"}

    def __init__(self, deck: ShellDeck):
        super().__init__(deck, DIMENSIONS_OF_SHAPES[deck.geometry])
        self.material = find_solid_material("material", deck.material)
        self.laws = find_laws(deck, {"shell": self.material})["shell"]
        law = self.laws.strength
        if law is None:
            raise BadInput("deck: strength is false; a shell without strength does not stop")
        self.law = law
        solid = idealise(self.material, law)
        sizes = deck.inner, deck.outer, solid.rho0, solid.yield_stress
        self.shell = PlasticShell(deck.geometry, *sizes)
        with deck.blame("stop", "the shell cannot stop there"):
            self.speed = deck.speed or self.shell.find_speed(deck.stop)
        self.stop = self.shell.find_stop(self.speed)
        if self.stop == 0.0:
            raise deck.error("speed", "so fast a shell reaches the centre")
        times, _ = self.motion
        self.t_end = deck.run.t_end or END_PART * float(times[-1])

    @functools.cached_property
    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Times [s] and inner radii [m] of the rigid shell."""
        return self.shell.follow(self.speed)

    def make_grids(self, t=0.0):
        deck = self.deck
        radius = np.linspace(deck.inner, deck.outer, deck.cells + 1)[:, None]
        angle = np.linspace(0.0, 0.5 * math.pi, deck.rays + 1)
        nodes = np.array([radius * np.cos(angle), radius * np.sin(angle)])
        nodes[0, :, -1] = 0.0
        nodes[1, :, 0] = 0.0
        return {"shell": nodes}

    def build(self):
        deck = self.deck
        nodes = self.make_grids()["shell"]
        # the velocity at the cells' centres of volume
        centres = find_centres_of_volume(find_geometry(self.geometry), nodes)
        radius = np.hypot(*centres)
        inwards = -self.speed * (deck.inner / radius) ** self.shell.power / radius
        u, v = inwards * centres
        options = {"limiter": deck.limiter, **self.laws.options}
        state = self.material.rho0, u, v, 0.0
        block = Block("shell", self.material.eos, nodes, *state, **options)
        put(block, "i_min", "free-surface")
        put(block, "i_max", "free-surface")
        return self.simulate([block])

    def measure(self, evolution) -> dict[str, float]:
        """Mean radii [m] of both surfaces, the parts by which they are not round, energy [J]."""
        (block,) = evolution.blocks
        row = {}
        for side, edge in (("inner", 0), ("outer", -1)):
            radii = self.compute_radii(block.nodes[:, edge, :])
            row[f"{side}_radius"] = float(radii.mean())
            row[f"{side}_roundness"] = float(np.ptp(radii) / radii.mean())
        fields = block.cell_fields
        mass = fields["rho"] * block.volume
        energy = 0.5 * mass * (fields["u"] ** 2 + fields["v"] ** 2)
        return {**row, "kinetic_energy": float(energy.sum())}

    def report(self, run) -> Report:
        deck = self.deck
        inner = run.history["inner_radius"]
        least = float(np.nanmin(inner)) if np.isfinite(inner).any() else math.nan
        passed = len(inner) > 1 and np.nanargmin(inner) < len(inner) - 1
        outer = run.history["outer_radius"]
        at_stop = float(outer[np.nanargmin(inner)]) if math.isfinite(least) else math.nan
        rows = [
            Row("stop", least, self.stop, "inner radius at the stop [mm]", ONE_MILLIMETRE, 6),
            Row(
                "outer_at_stop",
                at_stop,
                self.shell.find_outer(self.stop),
                "outer radius there [mm]",
                ONE_MILLIMETRE,
                6,
            ),
            Row(
                "inner_roundness",
                run.last("inner_roundness"),
                label="inner surface, round to",
                digits=2,
            ),
        ]
        notes = [f"the inner surface begins at {self.speed:.6g} m/s"]
        if not passed and len(inner) > 1:
            notes.append("the shell had not stopped at the end of the run")
        head = f"shell, {deck.geometry}, {deck.cells} x {deck.rays} cells"
        return Report(head, rows, notes)

    def draw_shell(self, figure, run_data) -> None:
        """Plastic strain and grid at the start, half way and at the end; both radii over time."""
        *sections, right = make_panels(figure, 15.0, 4.0, 1, 4, width_ratios=(1, 1, 1, 1.3))
        dumps = run_data.dumps
        most = float(dumps[-1].blocks[0].cell_fields["plastic_strain"].max())
        colours = Colours(low=0.0, high=most)
        outermost = 1.02 * self.deck.outer / ONE_MILLIMETRE
        for section, part in zip(sections, DRAWN_PARTS, strict=True):
            dump = find_dump(run_data, part * dumps[-1].t)
            bar = "plastic strain" if part == DRAWN_PARTS[-1] else ""
            draw_field(
                section, dump, "plastic_strain", colours, every=4, bar=bar, title="t", mm=True
            )
            section.set(xlim=(0.0, outermost), ylim=(0.0, outermost))
        history = run_data.history
        times, radii = self.motion
        for name in ("inner_radius", "outer_radius"):
            label = name.replace("_", " ")
            right.plot(1e6 * history["t"], history[name] / ONE_MILLIMETRE, lw=1.4, label=label)
        right.plot(
            1e6 * times, radii / ONE_MILLIMETRE, "k--", lw=0.8, label="rigid, incompressible"
        )
        outer = [self.shell.find_outer(one) / ONE_MILLIMETRE for one in radii]
        right.plot(1e6 * times, outer, "k--", lw=0.8)
        right.set(xlabel="t [µs]", ylabel="radius [mm]")
