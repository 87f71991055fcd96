"""A flying plate hits a thick one, both elastic-plastic: precursors, releases, back surface.

Both plates are of one material and touch at the start; the flyer has a speed, their outer surfaces
are free [Wilkins1964].  An elastic precursor and a plastic shock run into both.  At the flyer's
back they are released: behind the shock follows first an elastic release, faster than it, then a
plastic one; both attenuate it.  The precursor arrives at the target's back, reflects, and meets the
shock.

The problem measures the profile of the velocity at the time `profile`, at given places, and the
speed of the target's back.  Exact are the places of both fronts.  For the default deck the
velocities are compared with those of an independent one-dimensional code with 8000 cells,
`shockgrid.problems.references.layers`.

Note: the kinks of the releases are rounded over some ten cells, so that errors at single places
there fall with the first power of the cells.  The material must not spall: tension behind the
target's back reaches 3 GPa.
"""

import functools
import math
from typing import ClassVar

import msgspec
import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.problems.deck import MOST_CELLS, Limiter, Output, Regrid, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.measured_traces import (
    ONE_MICROSECOND,
    MeasuredTrace,
    Source,
    compare_trace,
    draw_trace,
    interpolate,
)
from shockgrid.problems.pictures import make_panels
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.elastic_plastic import compute_piston
from shockgrid.problems.report import Report, Row
from shockgrid.problems.signals import find_crossing
from shockgrid.problems.solids import (
    SolidDeck,
    SolidMaterial,
    Strength,
    find_laws,
    find_solid_material,
    idealise,
)
from shockgrid.problems.standard.elastic_piston import make_law

ONE_MILLIMETRE = 1e-3
# of the default deck at 5 µs: places [mm], x = 0 being where the flyer's back began, speeds [m/s]
PROFILE_SPEEDS = {
    15.0: 7.01,
    23.0: 24.68,
    24.0: 112.24,
    25.0: 204.41,
    26.0: 296.39,
    28.5: 325.36,
    31.0: 367.58,
    33.0: 400.0,
    36.0: 35.178,
}
# of the default deck: times [µs] and speeds [m/s] of the target's back
BACK_SPEEDS = {
    7.2: 70.36,
    8.0: 644.3,
    8.5: 646.9,
    9.0: 615.5,
    9.4: 443.0,
    9.8: 240.0,
    10.0: 143.6,
    10.4: 65.12,
    10.6: 30.34,
    11.2: 22.62,
}
SOURCE = "1D, 8000 cells"


def make_material() -> dict:
    """Aluminium that does not spall."""
    return {
        "eos": "mie-gruneisen",
        "rho0": 2785.0,
        "c0": 5328.0,
        "s": 1.338,
        "gruneisen": 2.0,
        "strength": 1e11,
    }


class FlyingPlateDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(t_end=11.5e-6, cfl=0.8)
    output: Output = Output(times=[5e-6])
    regrid: Regrid = Regrid()
    material: SolidMaterial = msgspec.field(default_factory=make_material)
    strength: Strength = msgspec.field(default_factory=make_law)
    speed: key(float, "of the flyer [m/s]", ge=1e-6, le=1e5) = 800.0
    flyer: key(float, "thickness of the flyer [m]", ge=1e-9, le=1e3) = 5e-3
    target: key(float, "thickness of the target [m]", ge=1e-9, le=1e3) = 45e-3
    flyer_cells: key(int, "cells across the flyer", ge=4, le=MOST_CELLS) = 100
    rows: key(int, "cells along the plates", ge=2, le=MOST_CELLS) = 2
    profile: key(float, "time [s] at which the velocity is measured", ge=1e-300) = 5e-6
    places: key(
        tuple[float, ...], "where it is measured [m]; the flyer's back begins at 0", max_length=40
    ) = tuple(ONE_MILLIMETRE * x for x in PROFILE_SPEEDS)
    trace: MeasuredTrace = ()
    source: Source = "measured"
    limiter: Limiter = DEFAULT_LIMITER


# what shapes the flow, besides cells
SHAPING_KEYS = ("material", "strength", "spall", "speed", "flyer", "target", "profile")


class FlyingPlate(Problem):
    Deck = FlyingPlateDeck
    units: ClassVar = {"back_speed": "m/s", "precursor_place": "m", "plastic_place": "m"}

    def __init__(self, deck: FlyingPlateDeck):
        super().__init__(deck)
        self.material = find_solid_material("material", deck.material)
        self.laws = find_laws(deck, {"plates": self.material})["plates"]
        self.law = self.laws.strength
        self.solid = idealise(self.material, self.law)
        with deck.blame("speed", "no shock of this material is so fast"):
            self.waves = compute_piston(self.solid, 0.5 * deck.speed)
        self.units = type(self).units | {
            self.name_column(n): "m/s" for n, _ in self.number_places()
        }

    def number_places(self):
        """The places of the profile [m] with their numbers from 1."""
        return enumerate(self.deck.places, 1)

    def name_column(self, number: int) -> str:
        """The column of the velocity at a place."""
        return f"speed_at_{number}"

    @functools.cached_property
    def cells(self) -> int:
        """Cells through both plates."""
        deck = self.deck
        return deck.flyer_cells + max(4, round(deck.flyer_cells * deck.target / deck.flyer))

    def estimate_cells(self) -> int:
        return self.cells * self.deck.rows

    def list_boxes(self):
        deck = self.deck
        length = deck.flyer + deck.target
        height = deck.rows * length / self.cells
        return [BlockPlan("plates", (self.cells, deck.rows), (0.0, 0.0), (length, height))]

    def make_grids(self, t=0.0):
        deck = self.deck
        (box,) = self.list_boxes()
        flyer = np.linspace(0.0, deck.flyer, deck.flyer_cells + 1)
        rest = np.linspace(deck.flyer, box.high[0], self.cells - deck.flyer_cells + 1)
        x = np.concatenate([flyer, rest[1:]])
        y = np.linspace(0.0, box.high[1], deck.rows + 1)
        return {"plates": np.array(np.meshgrid(x, y, indexing="ij"))}

    def build(self):
        deck = self.deck
        nodes = self.make_grids()["plates"]
        u = np.zeros((self.cells, deck.rows))
        u[: deck.flyer_cells] = deck.speed
        state = self.material.rho0, u, 0.0, 0.0
        options = {"limiter": deck.limiter, **self.laws.options}
        block = Block("plates", self.material.eos, nodes, *state, **options)
        for side in ("i_min", "i_max"):
            put(block, side, "free-surface")
        put_walls(block)
        return self.simulate([block])

    def measure(self, evolution) -> dict[str, float]:
        """Velocities at the places, of the target's back, and the places of both fronts [m]."""
        (block,) = evolution.blocks
        x = block.centres[0].mean(axis=1)
        u = block.u.mean(axis=1)
        row = {"back_speed": float(u[-1])}
        levels = {"precursor_place": math.nan, "plastic_place": math.nan}
        if len(self.waves) == 2:
            first, last = self.waves
            levels = {
                "precursor_place": 0.5 * first.u,
                "plastic_place": 0.5 * (first.u + last.u),
            }
        for name, level in levels.items():
            row[name] = find_crossing(x, u, level)
        for number, place in self.number_places():
            inside = x[0] <= place <= x[-1]
            row[self.name_column(number)] = float(np.interp(place, x, u)) if inside else math.nan
        return row

    @property
    def is_reference(self) -> bool:
        """Whether the independent numbers are those of this deck."""
        defaults = FlyingPlateDeck()
        return all(getattr(self.deck, name) == getattr(defaults, name) for name in SHAPING_KEYS)

    def report(self, run) -> Report:
        history = run.history
        deck = self.deck
        t = history["t"]
        rows = []
        if len(self.waves) == 2:
            rows += self.compare_exact(history)
        size = self.waves[-1].u  # errors of velocities are relative to that behind the shock
        known = PROFILE_SPEEDS if self.is_reference else {}
        for number, place in self.number_places():
            name = self.name_column(number)
            found = interpolate(t, history[name], deck.profile)
            theory = known.get(round(place / ONE_MILLIMETRE, 6), math.nan)
            label = f"velocity at {place / ONE_MILLIMETRE:g} mm [m/s]"
            source = "" if math.isnan(theory) else SOURCE
            rows.append(Row(name, found, theory, label, size=size, source=source))
        for time, theory in (BACK_SPEEDS if self.is_reference else {}).items():
            found = interpolate(t, history["back_speed"], ONE_MICROSECOND * time)
            label = f"target's back at {time:g} µs [m/s]"
            rows.append(Row(f"back_at_{time:g}", found, theory, label, size=size, source=SOURCE))
        words = "target's back"
        rows += compare_trace(history, "back_speed", deck.trace, words, deck.speed, deck.source)
        sizes = f"{1e3 * deck.flyer:g} mm at {deck.speed:g} m/s onto {1e3 * deck.target:g} mm"
        note = f"differences of velocities are parts of {size:g} m/s, that behind the shock"
        if deck.trace:
            note += ", and beside the measured trace of the flyer's speed"
        return Report(f"flying-plate: {sizes}, {self.cells} cells", rows, [note])

    def compare_exact(self, history) -> list[Row]:
        """Places of both fronts at the time of the profile."""
        deck = self.deck
        first, last = self.waves
        t = history["t"]
        rows = []
        for name, wave, words in (
            ("precursor_place", first, "precursor"),
            ("plastic_place", last, "plastic shock"),
        ):
            found = interpolate(t, history[name], deck.profile)
            place = deck.flyer + wave.shock_speed * deck.profile
            rows.append(Row(name, found, place, f"{words}: place [mm]", ONE_MILLIMETRE))
        return rows

    def draw_flying_plate(self, figure, run_data) -> None:
        """Velocity through the plates at the time of the profile, and of the target's back."""
        left, right = make_panels(figure, 10.0, 3.6, 1, 2)
        deck = self.deck
        dump = min(run_data.dumps, key=lambda one: abs(one.t - deck.profile))
        block = dump.blocks[0]
        x = block.centres[0][:, 0] / ONE_MILLIMETRE
        left.plot(x, block.u[:, 0], lw=1.4, label="computed")
        left.set(xlabel="x [mm]", ylabel="u [m/s]", title=f"t = {dump.t / ONE_MICROSECOND:.3g} µs")
        history = run_data.history
        right.plot(history["t"] / ONE_MICROSECOND, history["back_speed"], lw=1.4, label="computed")
        right.set(xlabel="t [µs]", ylabel="target's back [m/s]")
        draw_trace(right, deck.trace, deck.source)
        if self.is_reference:
            left.plot(list(PROFILE_SPEEDS), list(PROFILE_SPEEDS.values()), "k+", ms=8, label=SOURCE)
            right.plot(list(BACK_SPEEDS), list(BACK_SPEEDS.values()), "k+", ms=8, label=SOURCE)
