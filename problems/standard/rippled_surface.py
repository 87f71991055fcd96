"""A rippled metal surface grows, and its strength stops it: a measure of the flow stress.

A shock that leaves a metal through a rippled free surface sets the ripple into motion, as in the
Richtmyer-Meshkov instability with a vacuum beyond.  In a fluid it grows for good.  In a metal it
stops at an amplitude above that of the start of [Piriz2008, Dimonte2011]

    a_max - a0 = C rho v0²/(k Y),   C between 0.24 and 0.29,

so that the height at rest measures Y at rates of 1e5 to 1e7 1/s.  `start = "velocity"`: the surface
begins with the growth rate v0 and the flow of an incompressible fluid below it, decaying with
exp(-k depth).  `start = "shock"`: a piston drives a shock to the surface and then goes on with the
surface's speed.  The ripple then turns over: what was a crest becomes a valley.  Growth is counted
from the amplitude that the shock leaves behind, and v0 is Richtmyer's estimate, k times that of the
compressed ripple times the surface's speed.

The problem measures the amplitude, half of the height from valley to crest, and its rate, and
reports C.  Half a wavelength is computed, between planes of symmetry.

Note: with k a0 of some tenths the spike becomes a jet before it stops, and for rho v0²/Y above some
two the growth is no longer that of the estimate.
"""

import functools
import math
from typing import ClassVar, Literal

import msgspec
import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.problems.deck import MOST_CELLS, Limiter, Regrid, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.pictures import Colours, draw_field, find_dump, make_panels
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.elastic_plastic import compute_piston, compute_release
from shockgrid.problems.report import Report, Row
from shockgrid.problems.solids import (
    SolidDeck,
    SolidMaterial,
    Strength,
    find_laws,
    find_solid_material,
    idealise,
)
from shockgrid.regrid.measure.corners import compute_centres

USUAL_CONSTANT = 0.29  # C of [Piriz2008]
ARRESTS_UNTIL_END = 2.5  # the run lasts so many times the estimate of the time to the arrest
DRAWN_PARTS = (0.1, 0.25, 1.0)  # of the run
DRAWN_DEPTH = 0.6  # of a wavelength, below the crest
DRAWN_MARGIN = 0.05  # of a wavelength, beyond it
AFTER_PASSAGE_PART = 0.05  # of a wavelength that the shock would go on before growth is counted


def make_copper() -> dict:
    """Copper that does not spall."""
    return {
        "eos": "mie-gruneisen",
        "rho0": 8930.0,
        "c0": 3940.0,
        "s": 1.489,
        "gruneisen": 1.99,
        "strength": 1e11,
    }


def make_law() -> dict:
    return {"law": "perfect", "shear_modulus": 47.7e9, "yield_strength": 0.2e9}


class RippledSurfaceDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(cfl=0.8)
    regrid: Regrid = Regrid()
    material: SolidMaterial = msgspec.field(default_factory=make_copper)
    strength: Strength = msgspec.field(default_factory=make_law)
    start: key(Literal["velocity", "shock"], "how the growth begins") = "velocity"
    speed: key(
        float,
        "v0 [m/s] of the start with a velocity; that of the piston of a shock",
        ge=1e-6,
        le=1e5,
    ) = 100.0
    wavelength: key(float, "of the ripple [m]", ge=1e-9, le=1e3) = 1e-3
    ka0: key(float, "wave number times amplitude at the start", ge=0, le=1) = 0.0
    depth: key(float, "of the metal, in wavelengths", ge=0.5, le=100) = 1.5
    cells: key(int, "along half a wavelength", ge=4, le=MOST_CELLS) = 32
    limiter: Limiter = DEFAULT_LIMITER


class RippledSurface(Problem):
    Deck = RippledSurfaceDeck
    counted = ("cells", "columns")
    units: ClassVar = {"amplitude": "m", "growth_rate": "m/s"}

    def __init__(self, deck: RippledSurfaceDeck):
        super().__init__(deck)
        self.material = find_solid_material("material", deck.material)
        self.laws = find_laws(deck, {"metal": self.material})["metal"]
        self.law = self.laws.strength
        self.solid = idealise(self.material, self.law)
        self.k = 2.0 * math.pi / deck.wavelength
        self.amplitude = deck.ka0 / self.k
        self.columns = max(8, round(2.0 * deck.cells * deck.depth))
        shocked = deck.start == "shock"
        if shocked and deck.ka0 == 0.0:
            raise deck.error("ka0", "a flat surface does not grow after a shock")

    @property
    def length(self) -> float:
        """Depth of the metal [m]."""
        return self.deck.depth * self.deck.wavelength

    @functools.cached_property
    def last_shock(self):
        """The last of the shocks that the piston sends."""
        return compute_piston(self.solid, self.deck.speed)[-1]

    @functools.cached_property
    def passage(self) -> tuple[float, float, float, float]:
        """The last shock's arrival at the surface [s], the surface's speed [m/s] then, and the
        times [s] at which head and tail of its release are back at the piston."""
        last = self.last_shock
        release = compute_release(self.solid, last)
        arrival = self.length / last.shock_speed
        # mass between piston and surface, which the release crosses
        mass = self.solid.rho0 * self.length
        head = arrival + mass / float(release.mass_speed[0])
        tail = arrival + mass / float(release.mass_speed[-1])
        return arrival, self.deck.speed + float(release.gained[-1]), head, tail

    def estimate_rate(self) -> float:
        """v0 [m/s]: the deck's, or by the impulsive estimate with the amplitude after the shock."""
        deck = self.deck
        if deck.start == "velocity":
            return deck.speed
        _, surface_speed, _, _ = self.passage
        compression = 1.0 - deck.speed / self.last_shock.shock_speed
        return self.k * self.amplitude * compression * surface_speed

    def estimate_arrest(self, rate: float) -> float:
        """Growth [m] until the arrest with the usual constant."""
        if self.solid.yield_stress == 0.0:
            return math.inf
        return USUAL_CONSTANT * self.solid.rho0 * rate**2 / (self.k * self.solid.yield_stress)

    @functools.cached_property
    def t_end(self) -> float:
        """End time [s]: the deck's, or some times that of an even deceleration to the arrest."""
        given = self.deck.run.t_end
        if given is not None:
            return given
        rate = self.estimate_rate()
        arrest = min(self.estimate_arrest(rate), 1.0 / self.k)
        lasts = ARRESTS_UNTIL_END * 2.0 * arrest / rate
        return lasts + (self.passage[0] if self.deck.start == "shock" else 0.0)

    def list_boxes(self):
        deck = self.deck
        corner = self.length, 0.5 * deck.wavelength
        return [BlockPlan("metal", (self.columns, deck.cells), (0.0, 0.0), corner)]

    def make_grids(self, t=0.0):
        deck = self.deck
        y = np.linspace(0.0, 0.5 * deck.wavelength, deck.cells + 1)
        surface = self.length + self.amplitude * np.cos(self.k * y)
        part = np.linspace(0.0, 1.0, self.columns + 1)[:, None]
        return {"metal": np.array([part * surface, np.broadcast_to(y, part.shape[:1] + y.shape)])}

    def build(self):
        deck = self.deck
        nodes = self.make_grids()["metal"]
        u = 0.0
        v = 0.0
        if deck.start == "velocity":
            x, y = compute_centres(nodes)
            below = deck.speed * np.exp(self.k * (x - self.length))
            u = below * np.cos(self.k * y)
            v = -below * np.sin(self.k * y)
        options = {"limiter": deck.limiter, **self.laws.options}
        block = Block("metal", self.material.eos, nodes, self.material.rho0, u, v, 0.0, **options)
        put(block, "i_max", "free-surface")
        if deck.start == "shock":
            put(block, "i_min", "piston", velocity=self.drive)
        put_walls(block)
        return self.simulate([block])

    def drive(self, t: float) -> tuple[float, float]:
        """Velocity [m/s] of the piston: it gives way as the release of the surface asks."""
        _, surface_speed, head, tail = self.passage
        part = min(max((t - head) / (tail - head), 0.0), 1.0)
        return self.deck.speed + part * (surface_speed - self.deck.speed), 0.0

    def measure(self, evolution) -> dict[str, float]:
        """Amplitude [m] of the surface and its rate [m/s]."""
        (block,) = evolution.blocks
        surface = block.nodes[0, -1]
        u = block.u[-1]
        return {
            "amplitude": 0.5 * float(surface[0] - surface[-1]),
            "growth_rate": 0.5 * float(u[0] - u[-1]),
        }

    def find_first_row(self, history) -> int:
        """The row of the history at which growth begins: the first, or when the shock has left."""
        if self.deck.start == "velocity":
            return 0
        arrival, _, _, _ = self.passage
        speed = self.length / arrival  # of the shock
        left = arrival + (self.amplitude + AFTER_PASSAGE_PART * self.deck.wavelength) / speed
        return min(int(np.searchsorted(history["t"], left)), len(history["t"]) - 1)

    def report(self, run) -> Report:
        history = run.history
        deck = self.deck
        first = self.find_first_row(history)
        sense = -1.0 if deck.start == "shock" else 1.0
        amplitude = history["amplitude"]
        grown = sense * (amplitude[first:] - amplitude[first])
        rates = sense * history["growth_rate"][first:]
        growth = float(np.nanmax(grown)) if np.isfinite(grown).any() else math.nan
        fastest = float(np.nanmax(rates)) if np.isfinite(rates).any() else math.nan
        rate = self.estimate_rate()
        arrest = self.estimate_arrest(rate)
        constant = USUAL_CONSTANT * growth / arrest
        rows = [
            Row("rate", fastest, rate, "greatest rate (theory: v0) [m/s]", digits=5),
            Row("growth", growth, arrest, "growth until the arrest [µm]", 1e-6, 5),
            Row("constant", constant, USUAL_CONSTANT, "C = growth k Y/(rho v0²)", digits=4),
            Row("k_growth", self.k * growth, label="k times the growth", digits=4),
        ]
        notes = []
        if growth > 0.0:
            notes.append(f"growth at the end over the greatest: {float(grown[-1]) / growth:.4f}")
        name = self.law.kind if self.law is not None else "without strength"
        head = f"rippled-surface, {name}, start by {deck.start}, {deck.cells} cells"
        return Report(f"{head} along half a wavelength", rows, notes)

    def draw_rippled_surface(self, figure, run_data) -> None:
        """Plastic strain below the surface at three times, and the amplitude over time."""
        *maps, curve = make_panels(figure, 13.0, 3.4, 1, 4, width_ratios=(1, 1, 1, 1.3))
        last = run_data.dumps[-1]
        strained = "plastic_strain" in last.blocks[0].cell_fields
        name = "plastic_strain" if strained else "p"
        colours = Colours(low=0.0, high=float(last.blocks[0].cell_fields[name].max()))
        for axis, part in zip(maps, DRAWN_PARTS, strict=True):
            dump = find_dump(run_data, part * last.t)
            bar = name.replace("_", " ") if part == DRAWN_PARTS[-1] else ""
            draw_field(axis, dump, name, colours, every=1, bar=bar, title="t", mm=True)
            crest = 1e3 * float(dump.blocks[0].nodes[0, -1].max())
            wavelength = 1e3 * self.deck.wavelength
            axis.set_xlim(crest - DRAWN_DEPTH * wavelength, crest + DRAWN_MARGIN * wavelength)
        history = run_data.history
        curve.plot(1e6 * history["t"], 1e6 * history["amplitude"], lw=1.4)
        curve.set(xlabel="t [µs]", ylabel="amplitude [µm]")
