"""Taylor's bar: a cylinder hits a rigid wall, spreads into a mushroom and comes to rest.

A round bar with a speed along its axis meets a rigid wall without friction [Taylor1948].  A plastic
wave runs from the foot; behind it the bar shortens and thickens, and the elastic waves that return
from the tail brake the rest.  The final length measures the flow stress at strain rates that no
press reaches.  The run is axisymmetric, of half a meridional plane.

The problem measures length and diameter of the foot, the bar's kinetic energy, and the greatest
plastic strain.  A deck may bring what was measured or computed elsewhere, as `known`; the estimate

    L/L0 = 0.12 + 0.88 exp(-rho U²/(2 Y))

fits measured bars of aluminium, copper and steel within some hundredths; Y is the flow stress of
the law at a strain of a tenth and a rate of 1e4 1/s.

Note: the foot stays on the wall.  Real bars rebound, and the rim of the foot lifts a little.  The
run of a bar far too soft for its speed ends when the foot is a sheet, four times as wide as the
bar.
"""

import math
from typing import ClassVar

import msgspec
import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.temperature import REST_TEMPERATURE
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.problems.deck import MOST_CELLS, DeckTable, Limiter, Regrid, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.pictures import Colours, draw_field, find_dump, make_panels
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.report import Report, Row
from shockgrid.problems.solids import (
    SolidDeck,
    SolidMaterial,
    Strength,
    find_laws,
    find_solid_material,
)
from shockgrid.regrid.errors import BadInput

USUAL_STRAIN = 0.1
USUAL_RATE = 1e4  # [1/s]
SPLASH_WIDTH = 4.0  # of the foot over the bar; bars that come to rest have up to 3
LENGTH_LEFT_PART = 0.12  # of the estimate
ONE_MILLIMETRE = 1e-3
DRAWN_PARTS = (0.125, 0.375, 1.0)  # of the run
LEAST_DRAWN_STRAIN = 1e-6


class KnownBar(DeckTable, kw_only=True):
    """What is known of a bar after its impact, and by whom."""

    length: key(float | None, "length [m]", ge=0) = None
    diameter: key(float | None, "of the foot [m]", ge=0) = None
    plastic_strain: key(float | None, "the greatest", ge=0) = None
    source: key(str, "who measured or computed it") = ""


def make_material() -> dict:
    return {
        "eos": "mie-gruneisen",
        "rho0": 8930.0,
        "c0": 3815.0,
        "s": 1.489,
        "gruneisen": 2.0,
        "strength": 1e11,
    }


def make_law() -> dict:
    return {
        "law": "linear-hardening",
        "shear_modulus": 43.33e9,
        "yield_strength": 0.4e9,
        "hardening": 0.1e9,
    }


class TaylorBarDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(t_end=80e-6, cfl=0.8)
    regrid: Regrid = Regrid()
    material: SolidMaterial = msgspec.field(default_factory=make_material)
    strength: Strength = msgspec.field(default_factory=make_law)
    speed: key(float, "towards the wall [m/s]", ge=1e-6, le=1e5) = 227.0
    length: key(float, "of the bar [m]", ge=1e-9, le=1e3) = 32.4e-3
    diameter: key(float, "of the bar [m]", ge=1e-9, le=1e3) = 6.4e-3
    cells: key(int, "across the radius", ge=3, le=MOST_CELLS) = 10
    known: KnownBar = KnownBar()
    limiter: Limiter = DEFAULT_LIMITER


class TaylorBar(Problem):
    Deck = TaylorBarDeck
    counted = ("cells", "columns")
    units: ClassVar = {"length": "m", "foot_diameter": "m", "kinetic_energy": "J"}

    def __init__(self, deck: TaylorBarDeck):
        super().__init__(deck)
        self.material = find_solid_material("material", deck.material)
        self.laws = find_laws(deck, {"bar": self.material})["bar"]
        law = self.laws.strength
        if law is None:
            raise BadInput("deck: strength is false; a bar without strength never comes to rest")
        self.law = law
        self.columns = max(4, round(2.0 * deck.cells * deck.length / deck.diameter))

    def list_boxes(self):
        deck = self.deck
        corner = deck.length, 0.5 * deck.diameter
        return [BlockPlan("bar", (self.columns, deck.cells), (0.0, 0.0), corner)]

    def build(self):
        deck = self.deck
        state = self.material.rho0, -deck.speed, 0.0, 0.0
        options = {"limiter": deck.limiter, **self.laws.options}
        block = Block("bar", self.material.eos, self.make_grids()["bar"], *state, **options)
        for side in ("i_max", "j_max"):
            put(block, side, "free-surface")
        put_walls(block, curved=True)
        return self.simulate([block], geometry="axisymmetric", find_end=self.find_splash)

    def find_splash(self, flow) -> str | None:
        """A sentence once the foot is a sheet, which no strength stops; else None."""
        width = 2.0 * float(flow.blocks[0].nodes[1, 0].max()) / self.deck.diameter
        if width < SPLASH_WIDTH:
            return None
        return f"the foot is {width:.3g} times as wide as the bar, a sheet that runs along the wall"

    def measure(self, evolution) -> dict[str, float]:
        """Length and foot [m], kinetic energy of the whole bar [J], greatest plastic strain."""
        (block,) = evolution.blocks
        fields = block.cell_fields
        mass = fields["rho"] * block.volume
        energy = 0.5 * mass * (fields["u"] ** 2 + fields["v"] ** 2)
        return {
            "length": float(np.ptp(block.nodes[0])),
            "foot_diameter": 2.0 * float(block.nodes[1, 0].max()),
            "kinetic_energy": 2.0 * math.pi * float(energy.sum()),
            "most_plastic_strain": float(fields["plastic_strain"].max()),
        }

    def estimate_length(self) -> float:
        """The final length [m] by the exponential estimate."""
        deck = self.deck
        rho = np.array([self.material.rho0])
        rest = rho, np.zeros(1), np.full(1, REST_TEMPERATURE)
        strain = np.full(1, USUAL_STRAIN)
        flow_stress = float(self.law.flow_stress(strain, np.full(1, USUAL_RATE), *rest)[0])
        load = self.material.rho0 * deck.speed**2 / (2.0 * flow_stress)
        return deck.length * (LENGTH_LEFT_PART + (1.0 - LENGTH_LEFT_PART) * math.exp(-load))

    def report(self, run) -> Report:
        deck = self.deck
        known = deck.known
        length = run.last("length")
        rows = [
            Row(
                "length",
                length,
                use(known.length),
                "length [mm]",
                ONE_MILLIMETRE,
                5,
                source=known.source,
            ),
            Row(
                "foot_diameter",
                run.last("foot_diameter"),
                use(known.diameter),
                "diameter of the foot [mm]",
                ONE_MILLIMETRE,
                5,
                source=known.source,
            ),
            Row(
                "most_plastic_strain",
                run.most("most_plastic_strain"),
                use(known.plastic_strain),
                "greatest plastic strain",
                digits=4,
                source=known.source,
            ),
            Row(
                "estimate",
                length / deck.length,
                self.estimate_length() / deck.length,
                "length over that at the start",
                digits=4,
                source="exponential estimate",
            ),
        ]
        energy = run.history["kinetic_energy"]
        left = float(energy[-1] / energy[0])
        notes = [f"kinetic energy left at the end: {100.0 * left:.3g} %"]
        size = f"{1e3 * deck.length:g} mm x {1e3 * deck.diameter:g} mm"
        head = f"taylor-bar: {size}, {self.law.kind}, {deck.speed:g} m/s"
        return Report(f"{head}, {self.columns} x {deck.cells} cells", rows, notes)

    def draw_taylor_bar(self, figure, run_data) -> None:
        """Plastic strain and grid of the whole section at three times."""
        last = run_data.dumps[-1]
        block = last.blocks[0]
        most = max(float(block.cell_fields["plastic_strain"].max()), LEAST_DRAWN_STRAIN)
        colours = Colours(low=0.0, high=most)
        axes = make_panels(figure, 9.0, 6.4, 3, 1)
        for axis, part in zip(axes, DRAWN_PARTS, strict=True):
            dump = find_dump(run_data, part * last.t)
            draw_field(
                axis,
                dump,
                "plastic_strain",
                colours,
                every=1,
                bar="plastic strain",
                title="t",
                mm=True,
            )
            axis.set_xlim(0.0, self.deck.length / ONE_MILLIMETRE)
            axis.set_ylim(0.0, 1.05 * float(block.nodes[1].max()) / ONE_MILLIMETRE)


def use(number: float | None) -> float:
    """A known number, NaN for None."""
    return math.nan if number is None else number
