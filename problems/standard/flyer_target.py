"""A flyer crosses a gap and hits a target: impact, release, separation and surface speed.

Plates of given materials stand in a row with gaps between them; the first one has a speed.  Where
plates meet a contact closes; it opens again where it would go into tension, so plates separate by
themselves (theory F16).  The first plates, as many as `flyers` says, move together.  A plate
without a gap touches the one before it from the start, as a window does behind a target: that is no
impact.  `bond` is the tension that contacts hold; that of a
plate is of its contact with the plate before it.

The problem measures the mean speed of every plate and the speed of the last plate's free surface,
as a velocity interferometer sees it.  Theory gives the time of impact and, by the Hugoniots and the
isentrope of each material, pressure and speed at the impact; for two plates also when the shock
reaches the free surface, the speed of the surface then, and how long it lasts, because the release
from the flyer's back follows the shock.  For a third plate without a gap, a window, theory gives
the speed and the pressure of its face behind the target.  With `trace` the speed of the surface
that is observed, the window's face or else the free surface, is compared with a measured one.  For
solids of the law `perfect` theory is the exact stress behind the impact.

Note: a release is sharp at low speeds, and the scheme spreads it over some cells; plates then
separate a little early.  Use cells of an eightieth of the thinnest plate or less.
"""

import functools
import math
from typing import ClassVar, Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.deck import MOST_CELLS, Regrid, RunControl, VoidFill, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.measured_traces import (
    MeasuredTrace,
    Source,
    compare_trace,
    draw_trace,
    say_spread,
)
from shockgrid.problems.pictures import draw_columns
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.elastic_plastic import compute_impact
from shockgrid.problems.references.exact_flows import compute_plate_impact, compute_window_impact
from shockgrid.problems.references.hugoniot import caution_fit
from shockgrid.problems.report import Report, Row
from shockgrid.problems.signals import reduce_between
from shockgrid.problems.solids import (
    BodyTable,
    SolidDeck,
    find_laws,
    find_stress,
    idealise,
    list_fluids,
)


class PlateTable(BodyTable, kw_only=True):
    material: key(str, "name of a material, or FILE.toml:NAME") = "Cu"
    thickness: key(float, "[m]", ge=1e-9, le=1e3) = 2e-3
    cells: key(int, "cells across it", ge=2, le=MOST_CELLS) = 160
    gap: key(float, "to the plate before it [m]; of the first: 0", ge=0, le=1e3) = 0.0
    bond: key(
        float | None,
        "of its contact with the plate before it [Pa]. If left out: bond",
        ge=0,
        le=1e20,
    ) = None


LARGE_LENGTH = 0.2  # of a plate or a gap [m]: more may be meant in mm
PLATES = PlateTable(material="Al1100", thickness=1e-3, cells=100), PlateTable(gap=1e-4)


class FlyerTargetDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(t_end=1.6e-6, cfl=0.8)
    regrid: Regrid = Regrid()
    speed: key(float, "of the first plate [m/s]", ge=1e-12, le=1e5) = 1000.0
    plates: key(tuple[PlateTable, ...], "from left to right", min_length=2, max_length=12) = PLATES
    flyers: key(int, "how many of the first plates move with the speed", ge=1, le=11) = 1
    rows: key(int, "cells along the plates", ge=2, le=MOST_CELLS) = 2
    backing: key(Literal["free", "rigid"], "what is behind the last plate") = "free"
    trace: MeasuredTrace = ()
    source: Source = "measured"
    void_fill: VoidFill = VoidFill()
    bond: key(float, "tension that contacts hold [Pa]", ge=0, le=1e20) = 0.0


class FlyerTarget(Problem):
    Deck = FlyerTargetDeck
    units: ClassVar[dict[str, str]] = {
        **dict.fromkeys(("free_surface_speed", "window_speed"), "m/s"),
        **dict.fromkeys(("contact_pressure", "window_pressure"), "Pa"),
    }

    def __init__(self, deck: FlyerTargetDeck):
        super().__init__(deck)
        self.units = type(self).units | {
            f"speed_plate-{number}": "m/s" for number in range(1, len(deck.plates) + 1)
        }
        first = deck.plates[0]
        if first.gap:
            raise first.error("gap", "nothing is before the first plate, whose gap must be 0")
        if first.bond is not None:
            raise first.error("bond", "nothing is before the first plate; give it to the next one")
        if deck.flyers >= len(deck.plates):
            raise deck.error("flyers", "the last plate is what they hit, at rest")
        self.materials = [find_material(plate.material) for plate in deck.plates]
        # the impact is between the last of the flyers and the target
        flyer = deck.plates[deck.flyers - 1]
        target = deck.plates[deck.flyers]
        impact = deck.speed, target.gap, flyer.thickness, target.thickness
        hit = self.materials[deck.flyers - 1 : deck.flyers + 1]
        self.waves_of_impact = compute_plate_impact(*hit, *impact)
        self.is_pair = len(deck.plates) == 2
        # contacts from the start on, besides that of the impact
        others = [plate for plate in deck.plates[1:] if plate is not target]
        self.touching = sum(plate.gap == 0.0 for plate in others)
        self.names = [f"plate-{number}" for number in range(1, len(deck.plates) + 1)]
        behind = deck.plates[deck.flyers + 1 :]
        self.has_window = bool(behind) and behind[0].gap == 0.0
        bodies = dict(zip(self.names, self.materials, strict=True))
        self.laws = find_laws(deck, bodies, dict(zip(self.names, deck.plates, strict=True)))
        self.are_fluids = all(body.strength is None for body in self.laws.values())
        self.window = None
        if self.has_window and deck.flyers == 1 and self.are_fluids:
            sizes = deck.speed, target.thickness, behind[0].thickness
            self.window = compute_window_impact(self.waves_of_impact, *self.materials[:3], *sizes)

    @functools.cached_property
    def impact_stress(self) -> float:
        """Stress [Pa] behind the impact: of fluids the pressure; NaN for laws without an exact
        one."""
        if self.are_fluids:
            return self.waves_of_impact.pressure
        sides = range(self.deck.flyers - 1, self.deck.flyers + 1)
        laws = [self.laws[self.names[side]].strength for side in sides]
        if any(law is not None and law.kind != "perfect" for law in laws):
            return math.nan
        solids = [
            idealise(self.materials[side], law) for side, law in zip(sides, laws, strict=True)
        ]
        return compute_impact(*solids, self.deck.speed).stress

    def list_boxes(self):  # cells 8 times as high as the thinnest: square ones halve the time step
        rows = self.deck.rows
        boxes = []
        x = 0.0
        height = 8.0 * rows * min(one.thickness / one.cells for one in self.deck.plates)
        for name, plate in zip(self.names, self.deck.plates, strict=True):
            low = x + plate.gap
            x = x + plate.gap + plate.thickness
            boxes.append(BlockPlan(name, (plate.cells, rows), (low, 0.0), (x, height)))
        return boxes

    def build(self):
        deck = self.deck
        blocks = []
        # of both surfaces of each plate; a contact holds the smaller one of its two
        own = [deck.bond if plate.bond is None else plate.bond for plate in deck.plates]
        bonds = zip(own, [*own[1:], deck.bond], strict=True)
        bodies = zip(self.make_grids().items(), self.materials, bonds, strict=True)
        for (name, nodes), material, pair in bodies:
            speed = deck.speed if len(blocks) < deck.flyers else 0.0
            state = material.rho0, speed, 0.0, 0.0
            options = {"material": name, **self.laws[name].options}
            blocks.append(Block(name, material.eos, nodes, *state, **options))
            is_backed = deck.backing == "rigid" and name == self.names[-1]
            free_sides = ("i_min",) if is_backed else ("i_min", "i_max")
            for side, bond in zip(free_sides, pair, strict=False):
                put(blocks[-1], side, "free-surface", bond=bond)
            put_walls(blocks[-1])
        return self.simulate(blocks)

    def cautions(self, run) -> list[str]:
        """Lengths that may be meant in mm, an end before the impact, speeds beyond a Hugoniot."""
        deck = self.deck
        cautions = [
            f"plates.{number}.{name} is {getattr(plate, name):g} m; lengths are in metres: 1 mm is "
            "1e-3"
            for number, plate in enumerate(deck.plates)
            for name in ("thickness", "gap")
            if getattr(plate, name) >= LARGE_LENGTH
        ]
        if self.t_end <= self.waves_of_impact.impact:
            cautions.append(
                f"the run ends at t = {self.t_end:.4g} s, before the impact at "
                f"{self.waves_of_impact.impact:.4g} s; take a later run.t_end, or a smaller gap"
            )
        hit = dict(zip((plate.material for plate in deck.plates), self.materials, strict=True))
        impact = deck.plates[deck.flyers - 1 : deck.flyers + 1]
        for name in dict.fromkeys(plate.material for plate in impact):
            cautions += caution_fit(name, hit[name].eos, self.waves_of_impact.pressure)
        return cautions + list_fluids(self.laws)

    def measure(self, evolution) -> dict[str, float]:
        row = {}
        states = [block.state[:, 1:-1, 1:-1] for block in evolution.blocks]
        for block, (rho, u, *_) in zip(evolution.blocks, states, strict=True):
            row[f"speed_{block.name}"] = float(np.average(u, weights=rho * block.volume))
        # of flyer and target, and of target and window
        target = self.deck.flyers
        sides = evolution.blocks[target - 1], evolution.blocks[target]
        before, behind = (find_stress(block) for block in sides)
        meeting = 0.5 * (before[-1].mean() + behind[0].mean())
        surface = float(states[-1][1, -1].mean())
        row |= {"free_surface_speed": surface, "contact_pressure": float(meeting)}
        if self.has_window:
            window = states[target + 1]
            face = 0.5 * (states[target][:, -1].mean(axis=1) + window[:, 0].mean(axis=1))
            row |= {"window_speed": float(face[1]), "window_pressure": float(face[3])}
        return row

    @property
    def observed(self) -> str:
        """The column of the speed that an interferometer sees."""
        return "window_speed" if self.has_window else "free_surface_speed"

    def report(self, run) -> Report:
        history = run.history
        deck = self.deck
        theory = self.waves_of_impact
        trace = history["free_surface_speed"]
        t = history["t"]
        p = history["contact_pressure"]
        parted = history["contacts_opened"] > 0
        # a contact that a step has made was there at its start
        made = history["contacts_made"][1:] > self.touching
        impact = run.find_time(np.append(made, False))
        until = impact + 0.7 * min(theory.back, theory.returned)
        pressure = reduce_between(np.median, t, p, impact, until, 4)
        out, free, end = theory.read_trace(t, trace)
        ends = theory.end if theory.end < theory.ring else math.nan
        name = "pressure" if self.are_fluids else "stress"
        rows = [
            Row("impact", impact, theory.impact, "time of impact [s]", digits=5),
            Row("pressure", pressure, self.impact_stress, f"{name} [GPa]", 1e9, 5),
            Row("out", out, theory.out, "arrival of the shock at the free surface [s]", digits=5),
            Row("free", free, theory.free, "speed of the free surface [m/s]", digits=5),
            Row("end", end, ends, "arrival of the release [s]", digits=5),
        ]
        rows = rows[: 5 if self.is_pair and self.are_fluids else 2]
        rows = [row for row in rows if not np.isnan(row.theory)]
        if self.window is not None:
            rows += self.compare_window(history)
        words = "window's face" if self.has_window else "free surface"
        measured = compare_trace(history, self.observed, deck.trace, words, deck.speed, deck.source)
        rows += measured
        notes = say_spread(measured, deck.speed)
        first = deck.plates[deck.flyers - 1]
        plate = f"{first.material} of {1e3 * first.thickness:g} mm at {deck.speed:g} m/s"
        if self.is_pair and self.are_fluids:
            notes.append(f"behind the impact both plates move at {theory.u:.5g} m/s")
        for name in self.names if run.begun else ():
            notes.append(f"{name} moves at {history[f'speed_{name}'][-1]:.5g} m/s at the end")
        if parted.any():
            notes.append(f"plates first separated at t = {run.find_time(parted):.4g} s")
        return Report(f"flyer-target: {plate}, {len(deck.plates)} plates", rows, notes)

    def compare_window(self, history) -> list[Row]:
        """Speed and pressure of the window's face, medians over the middle half of the time in
        which theory has them constant; none where a release overtakes the shock before."""
        window = self.window
        span = window.end - window.start
        if not span > 0.0:
            return []
        t = history["t"]
        middle = window.start + 0.25 * span, window.end - 0.25 * span
        speed, p = (
            reduce_between(np.median, t, history[name], *middle, 4)
            for name in ("window_speed", "window_pressure")
        )
        material = self.deck.plates[2].material
        return [
            Row("window_speed", speed, window.u, f"speed of the {material} window [m/s]", digits=5),
            Row("window_pressure", p, window.p, "pressure at the window [GPa]", 1e9, 5),
        ]

    def draw_flyer_target(self, figure, run_data) -> None:
        """The speed of the surface that is observed beside theory or what was measured."""
        axis = figure.subplots()
        theory = self.waves_of_impact
        words = "window's face" if self.has_window else "free surface of the last plate"
        labels = {self.observed: "computed"}
        draw_columns(axis, run_data.history, labels, f"{words} [m/s]", "µs")
        draw_trace(axis, self.deck.trace, self.deck.source)
        if self.is_pair and self.are_fluids:
            axis.plot(*theory.make_trace(1e6), "k--", lw=0.8, label="theory, until the release")
