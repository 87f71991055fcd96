"""A piston into an elastic-plastic solid: precursor and plastic shock, beside exact waves.

A piston moves into a solid at rest.  Above the elastic limit two shocks run ahead of it: the
elastic precursor, whose strength is that of the material alone, and a slower plastic shock.  Below
it the one shock is elastic, and a piston so fast that the plastic shock would overtake the
precursor drives one shock, too.

The problem measures speed and stress on both plateaus and the places of both fronts, where the
speed is half way between the plateaus.  Exact are the jumps of an elastic, perfectly plastic solid
(`law = "perfect"`) and of a fluid.

Note: the precursor is a small step ahead of a large one, on a Hugoniot with a kink: steep limiters
lose it at any resolution, so solids have none.  A captured plastic shock has a foot of some cells,
out of which the precursor comes at first: its front stays two cells ahead, at the right speed.
"""

import functools
import math
from typing import ClassVar

import msgspec
import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.problems.deck import MOST_CELLS, Limiter, Regrid, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.pictures import choose_even_dumps
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.elastic_plastic import compute_piston
from shockgrid.problems.report import Report, Row, RunSoFar
from shockgrid.problems.signals import find_crossing, fit_slope, reduce_between
from shockgrid.problems.solids import (
    SolidDeck,
    SolidMaterial,
    Strength,
    find_laws,
    find_solid_material,
    find_stress,
    idealise,
)

PRECURSOR_WAY_PART = 0.9  # of the length that the first front has passed at the end
LATE_PART = 0.4  # of the run, in which speeds of fronts are measured


def find_plateau(x: np.ndarray, values: np.ndarray, ends: tuple[float, float]) -> float:
    """Median of `values` (n,) at places `x` in the middle half between two ends; NaN if none is."""
    quarter = 0.25 * (ends[1] - ends[0])
    return reduce_between(np.median, x, values, ends[0] + quarter, ends[1] - quarter)


def make_law() -> dict:
    return {"law": "perfect", "shear_modulus": 27.6e9, "yield_strength": 0.3e9}


class ElasticPistonDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(cfl=0.8)
    regrid: Regrid = Regrid()
    material: SolidMaterial = "Al2024"
    strength: Strength = msgspec.field(default_factory=make_law)
    speed: key(float, "of the piston [m/s]", ge=1e-6, le=1e5) = 400.0
    length: key(float, "of the solid [m]", ge=1e-9, le=1e3) = 0.05
    cells: key(int, "along it", ge=8, le=MOST_CELLS) = 200
    rows: key(int, "cells across", ge=2, le=MOST_CELLS) = 2
    limiter: Limiter = DEFAULT_LIMITER


class ElasticPiston(Problem):
    Deck = ElasticPistonDeck
    counted = ("cells", "rows")
    units: ClassVar = {
        "precursor_speed": "m/s",
        "precursor_stress": "Pa",
        "precursor_place": "m",
        "speed": "m/s",
        "stress": "Pa",
        "density": "kg/m3",
        "deviator": "Pa",
        "place": "m",
    }

    def __init__(self, deck: ElasticPistonDeck):
        super().__init__(deck)
        self.material = find_solid_material("material", deck.material)
        self.laws = find_laws(deck, {"solid": self.material})["solid"]
        self.law = self.laws.strength
        self.solid = idealise(self.material, self.law)
        with deck.blame("speed", "no shock of this material is so fast"):
            self.waves = compute_piston(self.solid, deck.speed)
        fastest = self.waves[0].shock_speed
        self.check_end(deck.length / fastest, "the first front meets the end of the solid")

    @functools.cached_property
    def t_end(self) -> float:
        """End time [s]: the deck's, or when the first front has come nine tenths of its way."""
        given = self.deck.run.t_end
        if given is not None:
            return given
        return PRECURSOR_WAY_PART * self.deck.length / self.waves[0].shock_speed

    def list_boxes(self):
        deck = self.deck
        height = deck.rows * deck.length / deck.cells
        return [BlockPlan("solid", (deck.cells, deck.rows), (0.0, 0.0), (deck.length, height))]

    def build(self):
        deck = self.deck
        block = Block(
            "solid",
            self.material.eos,
            self.make_grids()["solid"],
            self.material.rho0,
            0.0,
            0.0,
            0.0,
            limiter=deck.limiter,
            **self.laws.options,
        )
        put(block, "i_min", "piston", velocity=(deck.speed, 0.0))
        put_walls(block)
        return self.simulate([block])

    def measure(self, evolution) -> dict[str, float]:
        """Medians over the middle half of both plateaus, and the places of both fronts."""
        (block,) = evolution.blocks
        t = evolution.t
        fields = block.cell_fields
        x = block.centres[0][:, 0]
        profiles = {"speed": fields["u"], "density": fields["rho"], "stress": find_stress(block)}
        profiles["deviator"] = fields.get("s_xx", np.zeros(fields["p"].shape))
        profiles = {name: values.mean(axis=1) for name, values in profiles.items()}
        row = dict.fromkeys(self.units, math.nan)
        first = self.waves[0]
        last = self.waves[-1]
        # behind the last front
        for name, values in profiles.items():
            row[name] = find_plateau(x, values, (self.deck.speed * t, last.shock_speed * t))
        ahead = first.u if len(self.waves) == 2 else 0.0
        row["place"] = find_crossing(x, profiles["speed"], 0.5 * (ahead + last.u))
        # between both fronts
        if len(self.waves) == 2:
            ends = last.shock_speed * t, first.shock_speed * t
            row["precursor_speed"] = find_plateau(x, profiles["speed"], ends)
            row["precursor_stress"] = find_plateau(x, profiles["stress"], ends)
            row["precursor_place"] = find_crossing(x, profiles["speed"], 0.5 * first.u)
        return row

    @property
    def is_exact(self) -> bool:
        """Whether the jumps of a perfectly plastic solid are those of this one's law."""
        return self.law is None or self.law.kind == "perfect"

    def report(self, run) -> Report:
        rows = []
        if len(self.waves) == 2:
            first = self.waves[0]
            rows = [
                self.compare(run, "precursor_speed", first.u, "precursor: speed [m/s]"),
                self.compare(run, "precursor_stress", first.stress, "precursor: stress [GPa]", 1e9),
                *self.compare_front(run, "precursor_place", first.shock_speed, "precursor"),
            ]
        last = self.waves[-1]
        rows += [
            self.compare(run, "stress", last.stress, "behind: stress [GPa]", 1e9),
            self.compare(run, "deviator", last.deviator, "behind: deviator [GPa]", 1e9),
            self.compare(run, "density", last.rho, "behind: density [kg/m3]"),
            *self.compare_front(run, "place", last.shock_speed, "last front"),
        ]
        return Report(self.describe(), rows)

    def compare(
        self, run: RunSoFar, name: str, theory: float, label: str, unit: float = 1.0
    ) -> Row:
        """A column at the end beside the exact value, where there is one."""
        known = theory if self.is_exact else math.nan
        return run.compare(name, known, label, unit=unit)

    def compare_front(self, run: RunSoFar, name: str, speed: float, words: str) -> list[Row]:
        """Place of a front at the end, and its speed in the last part of the run."""
        history = run.history
        t = run.t
        late = history["t"] > (1.0 - LATE_PART) * t
        found = fit_slope(history["t"], history[name], late & np.isfinite(history[name]))
        known = speed if self.is_exact else math.nan
        return [
            self.compare(run, name, speed * t, f"{words}: place [mm]", 1e-3),
            Row(f"{name}_speed", found, known, f"{words}: speed of the front [m/s]"),
        ]

    def describe(self) -> str:
        """The head of the summary."""
        deck = self.deck
        name = deck.material if isinstance(deck.material, str) else "a solid"
        kind = "without strength" if self.law is None else f"with the law {self.law.kind}"
        return f"elastic-piston: {name} {kind}, piston of {deck.speed:g} m/s, {deck.cells} cells"

    def draw_elastic_piston(self, figure, run_data) -> None:
        """Profiles of speed and stress at some times, in black the exact waves."""
        above, below = figure.subplots(2, 1, sharex=True)
        figure.set_size_inches(7.0, 5.0)
        for dump in choose_even_dumps(run_data, 4):
            block = dump.blocks[0]
            x = 1e3 * block.centres[0][:, 0]
            above.plot(x, block.u[:, 0], lw=1.4, label=f"{1e6 * dump.t:.3g} µs")
            below.plot(x, 1e-9 * find_stress(block)[:, 0], lw=1.4)
            if dump.t > 0.0:
                places, speeds, stresses = self.make_profile(dump.t)
                above.plot(1e3 * places, speeds, "k", lw=0.7)
                below.plot(1e3 * places, 1e-9 * stresses, "k", lw=0.7)
        above.set_ylabel("u [m/s]")
        below.set(xlabel="x [mm]", ylabel="stress [GPa]")

    def make_profile(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places [m], speeds [m/s] and stresses [Pa] of the exact waves, from the piston on."""
        places = [self.deck.speed * t]
        speeds = []
        stresses = []
        for wave in reversed(self.waves):
            places += [wave.shock_speed * t] * 2
            speeds += [wave.u] * 2
            stresses += [wave.stress] * 2
        places.append(self.deck.length)
        return np.array(places), np.array([*speeds, 0.0, 0.0]), np.array([*stresses, 0.0, 0.0])
