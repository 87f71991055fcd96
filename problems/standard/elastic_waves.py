"""Waves and growth of small amplitude in an elastic solid, beside exact speeds and rates.

Half a wavelength of the solid stands between planes of symmetry and begins with the velocity of one
mode, without stress or displacement.  `mode`:

    longitudinal  a standing wave across the solid, speed c_l
    shear         a standing shear wave, speed c_s
    surface       a standing wave of Rayleigh along a free surface
    slip          the wave along a frictionless contact of two equal halves, on which the surfaces
                  slide; its speed is that of the surface wave [AchenbachEpstein1967]
    growth        a free surface that gravity draws towards the empty side: Rayleigh–Taylor growth
                  against elasticity, stable for rho g < 2 G k; `drive` is rho g/(G k)

The problem measures the part of the mode in the velocity, which goes as cos(omega t), or as
cosh(rate t) while the surface grows as sinh(rate t).  Speeds are omega/k of its zero crossings.
Exact are `shockgrid.problems.references.elastic_waves`.

Note: theory of the growth is without compression: take a solid whose longitudinal waves are thirty
times as fast as its shear waves, as the deck `elastic-waves-growth` has it.
"""

import functools
import math
from typing import ClassVar, Literal, NamedTuple

import msgspec
import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.hydro.links import join
from shockgrid.hydro.sources import make_gravity
from shockgrid.problems.deck import MOST_CELLS, Limiter, Regrid, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.pictures import Colours, draw_field, find_dump, make_panels
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.elastic_waves import (
    compute_elastic_growth,
    compute_rayleigh_speed,
    compute_wave_speeds,
)
from shockgrid.problems.report import Report, Row
from shockgrid.problems.signals import find_frequency
from shockgrid.problems.solids import (
    SolidDeck,
    SolidMaterial,
    Strength,
    find_laws,
    find_solid_material,
    idealise,
)
from shockgrid.regrid.measure.corners import compute_centres

PERIODS_UNTIL_END = 1.5  # of a wave that a run lasts
GROWTH_TIMES_UNTIL_END = 2.0  # that a run of growth lasts
BODY_ROWS = 4  # cells across a wave that is the same along y
# of the run: where the stress of a wave is greatest, and while a surface grows
DRAWN_PARTS = (1.0 / 6.0, 0.5, 5.0 / 6.0)
DRAWN_GROWTH_PARTS = (1.0 / 3.0, 2.0 / 3.0, 1.0)

Mode = Literal["longitudinal", "shear", "surface", "slip", "growth"]


def make_elastic() -> dict:
    """Aluminium that neither yields nor opens."""
    return {
        "eos": "mie-gruneisen",
        "rho0": 2785.0,
        "c0": 5328.0,
        "s": 1.338,
        "gruneisen": 2.0,
        "strength": 1e12,
    }


def make_law() -> dict:
    return {"law": "perfect", "shear_modulus": 27.6e9, "yield_strength": 1e13}


class ElasticWavesDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(cfl=0.8)
    regrid: Regrid = Regrid()
    mode: key(Mode, "which wave") = "surface"
    material: SolidMaterial = msgspec.field(default_factory=make_elastic)
    strength: Strength = msgspec.field(default_factory=make_law)
    speed: key(float, "greatest velocity of the mode [m/s]", ge=1e-12, le=1e5) = 1.0
    drive: key(float, "mode growth: rho g/(G k)", gt=2, le=1e4) = 4.0
    wavelength: key(float, "[m]", ge=1e-9, le=1e3) = 1e-2
    depth: key(float, "of surface, slip and growth, in wavelengths", ge=0.5, le=100) = 2.0
    cells: key(int, "in a wavelength", ge=8, le=MOST_CELLS) = 32
    limiter: Limiter = DEFAULT_LIMITER


class SurfaceMode(NamedTuple):
    """A wave at y = 0 that decays below it as a sum of exp(alpha y) and exp(beta y).

    Its velocity is that of the potential exp(alpha y) cos(k x) and the stream function
    b exp(beta y) sin(k x), without shear stress at y = 0 [Rayleigh1885].
    """

    k: float
    alpha: float
    beta: float

    def compute_velocity(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Velocities (2, ...) at places, of height 1 at a crest of the surface."""
        k, alpha, beta = self
        b = 2.0 * k * alpha / (beta**2 + k**2)
        body = np.exp(alpha * y)
        shear = b * np.exp(beta * y)
        along = (beta * shear - k * body) * np.sin(k * x)
        across = (alpha * body - k * shear) * np.cos(k * x)
        return np.array([along, across]) / (alpha - k * b)


class ElasticWaves(Problem):
    Deck = ElasticWavesDeck
    counted = ("columns", "rows", "halves")
    units: ClassVar = {"velocity": "m/s", "displacement": "m"}

    def __init__(self, deck: ElasticWavesDeck):
        super().__init__(deck)
        self.material = find_solid_material("material", deck.material)
        self.laws = find_laws(deck, {"solid": self.material})["solid"]
        if self.laws.strength is None:
            raise deck.error("strength", "a fluid has no elastic waves")
        self.solid = idealise(self.material, self.laws.strength)
        self.k = 2.0 * math.pi / deck.wavelength
        self.columns = max(4, deck.cells // 2)
        self.is_body_wave = deck.mode in ("longitudinal", "shear")
        self.rows = BODY_ROWS if self.is_body_wave else max(8, round(deck.cells * deck.depth))
        self.halves = 2 if deck.mode == "slip" else 1
        given = deck.run.t_end
        lasts = 2.0 * math.pi * PERIODS_UNTIL_END
        if deck.mode == "growth":
            lasts = GROWTH_TIMES_UNTIL_END
        self.t_end = lasts / self.rate if given is None else given

    @functools.cached_property
    def speeds(self) -> tuple[float, float]:
        """Speeds [m/s] of longitudinal and of shear waves at rest."""
        solid = self.solid
        found = compute_wave_speeds(solid.eos, solid.rho0, 0.0, solid.shear_modulus)
        return float(found[0]), float(found[1])

    @functools.cached_property
    def speed(self) -> float:
        """Exact speed [m/s] of the wave."""
        if self.is_body_wave:
            return self.speeds[self.deck.mode == "shear"]
        return compute_rayleigh_speed(*self.speeds)

    @functools.cached_property
    def gravity(self) -> float:
        """Acceleration [m/s²] towards the empty side."""
        if self.deck.mode != "growth":
            return 0.0
        return self.deck.drive * self.solid.shear_modulus * self.k / self.solid.rho0

    @functools.cached_property
    def rate(self) -> float:
        """Angular frequency or growth rate [1/s] of theory."""
        if self.deck.mode != "growth":
            return self.k * self.speed
        solid = self.solid
        return compute_elastic_growth(solid.rho0, self.gravity, solid.shear_modulus, self.k)

    @functools.cached_property
    def surface_mode(self) -> SurfaceMode:
        """The mode below a surface; that of growth without compression."""
        if self.deck.mode == "growth":
            return SurfaceMode(self.k, self.k, math.hypot(self.k, self.rate / self.speeds[1]))
        decays = [self.k * math.sqrt(1.0 - (self.speed / c) ** 2) for c in self.speeds]
        return SurfaceMode(self.k, *decays)

    def compute_velocity(self, name: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Velocities (2, ...) of the mode in a block at places, of greatest height 1."""
        if self.deck.mode == "longitudinal":
            return np.array([np.sin(self.k * x), np.zeros(np.shape(x))])
        if self.deck.mode == "shear":
            return np.array([np.zeros(np.shape(x)), np.cos(self.k * x)])
        if name == "above":  # the mirror image, whose surface moves the same way
            along, across = self.surface_mode.compute_velocity(x, -y)
            return np.array([-along, across])
        return self.surface_mode.compute_velocity(x, y)

    def list_boxes(self):
        deck = self.deck
        width = 0.5 * deck.wavelength
        depth = deck.depth * deck.wavelength
        if self.is_body_wave:
            depth = self.rows * width / self.columns
        boxes = [BlockPlan("solid", (self.columns, self.rows), (0.0, -depth), (width, 0.0))]
        if deck.mode == "slip":
            boxes.append(BlockPlan("above", (self.columns, self.rows), (0.0, 0.0), (width, depth)))
        return boxes

    def build(self):
        deck = self.deck
        blocks = []
        for name, nodes in self.make_grids().items():
            x, y = compute_centres(nodes)
            velocity = deck.speed * self.compute_velocity(name, x, y)
            state = *self._balance(y), *velocity
            rho, p, u, v = state
            options = {"limiter": deck.limiter, **self.laws.options}
            blocks.append(Block(name, self.material.eos, nodes, rho, u, v, p, **options))
        solid = blocks[0]
        links = []
        if self.is_body_wave:
            links.append(join("periodic", (solid, "j_min"), (solid, "j_max")))
        elif deck.mode == "slip":
            links.append(join("interface", (solid, "j_max"), (blocks[1], "j_min")))
        else:
            put(solid, "j_max", "free-surface")
        put_walls(*blocks)
        source = make_gravity(0.0, self.gravity) if self.gravity else None
        return self.simulate(blocks, links, source=source)

    def _balance(self, y: np.ndarray) -> tuple:
        """Density and pressure at heights (ni, nj) of the solid that hangs from its bottom."""
        rho0 = self.solid.rho0
        if not self.gravity:
            return rho0, 0.0
        stiffness = rho0 * float(self.solid.eos.sound_speed(rho0, 0.0)) ** 2
        p = stiffness * np.expm1(rho0 * self.gravity / stiffness * y)
        return rho0 * (1.0 + p / stiffness), p

    def measure(self, evolution) -> dict[str, float]:
        """The part of the mode in the velocity [m/s], by mass, and the crest of the surface [m]."""
        overlap = 0.0
        size = 0.0
        for block in evolution.blocks:
            mode = self.compute_velocity(block.name, *block.centres)
            rho, u, v, _ = block.state[:, 1:-1, 1:-1]
            mass = rho * block.volume
            overlap += float((mass * (u * mode[0] + v * mode[1])).sum())
            size += float((mass * (mode**2).sum(axis=0)).sum())
        surface = evolution.blocks[0].nodes[1, :, -1]
        height = 0.5 * float(surface[0] - surface[-1])
        return {"velocity": overlap / size, "displacement": height}

    def report(self, run) -> Report:
        deck = self.deck
        history = run.history
        t = history["t"]
        if deck.mode == "growth":
            found = find_sinh_rate(t, history["displacement"])
            rows = [
                Row("rate", found, self.rate, "growth rate [1/s]", digits=6, error="rate"),
                Row("drive", math.nan, deck.drive, "rho g/(G k); it grows from 2 on"),
            ]
        else:
            found = find_frequency(t, history["velocity"]) / self.k
            left = run.last("velocity") / deck.speed
            exact = math.cos(self.rate * run.t)
            rows = [
                Row("speed", found, self.speed, "speed of the wave [m/s]", digits=6, error="speed"),
                Row("velocity", left, exact, "velocity at the end over the first", size=1.0),
            ]
        longitudinal, shear = self.speeds
        notes = [f"longitudinal waves {longitudinal:.6g} m/s, shear waves {shear:.6g} m/s"]
        return Report(f"elastic-waves, {deck.mode}, {deck.cells} cells a wave", rows, notes)

    def draw_elastic_waves(self, figure, run_data) -> None:
        """Shear stress at three times; what grows or swings, beside theory."""
        *maps, curve = make_panels(figure, 12.0, 4.2, 1, 4, width_ratios=(1, 1, 1, 1.8))
        parts = DRAWN_GROWTH_PARTS if self.deck.mode == "growth" else DRAWN_PARTS
        dumps = [find_dump(run_data, part * run_data.dumps[-1].t) for part in parts]
        most = max(float(np.abs(b.cell_fields["s_xy"]).max()) for d in dumps for b in d.blocks)
        colours = Colours(low=-most, high=most, map="RdBu_r")
        for axis, dump in zip(maps, dumps, strict=True):
            bar = "s_xy [Pa]" if dump is dumps[-1] else ""
            draw_field(axis, dump, "s_xy", colours, bar=bar, title="t", mm=True)
        history = run_data.history
        t = history["t"]
        if self.deck.mode == "growth":
            curve.semilogy(t, np.abs(history["displacement"]), label="computed")
            exact = self.deck.speed / self.rate * np.sinh(self.rate * t)
            curve.semilogy(t, exact, "k--", lw=0.8, label="sinh(rate t)")
            curve.set(xlabel="t [s]", ylabel="crest [m]")
        else:
            curve.plot(1e6 * t, history["velocity"] / self.deck.speed, label="computed")
            curve.plot(1e6 * t, np.cos(self.rate * t), "k--", lw=0.8, label="cos(k c t)")
            curve.set(xlabel="t [µs]", ylabel="velocity of the mode")


def find_sinh_rate(t: np.ndarray, values: np.ndarray) -> float:
    """Rate [1/s] of a growth as sinh(rate t) from values (n,) at the end and half way there;
    NaN if there is none."""
    middle, last = np.interp([0.5 * t[-1], t[-1]], t, values)
    ratio = last / (2.0 * middle) if middle else math.nan
    return math.acosh(ratio) / (0.5 * t[-1]) if ratio > 1.0 else math.nan
