"""A flyer across a gap onto a target: impact, release, separation, the free surface's speed.

Plates of given materials stand in a row with gaps between them; the first one has a speed.  Where
plates meet a contact closes; it opens again where it would go into tension, so plates separate by
themselves (theory F16).  The problem measures the mean speed of every plate and the speed of the
last plate's free surface, as a velocity interferometer sees it.  Theory gives the time of impact
and, by the Hugoniots and the isentrope of each material, pressure and speed at the impact; for two
plates also when the shock reaches the free surface, the speed of the surface then, and how long it
lasts, because the release from the flyer's back follows the shock.

Note: a release is sharp at low speeds, and the scheme spreads it over some cells; plates then
separate a little early.  Use cells of an eightieth of the thinnest plate or less.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import ClassVar

import msgspec
import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from hydro.rows import P, U
from problems.deck import MOST_CELLS, Deck, DeckTable, Regrid, RunControl, VoidFill, key
from problems.initial_states import make_plane_grid, put_walls
from problems.problem import BlockPlan, Problem, Report, Row
from problems.references.hugoniot import make_isentrope, shock_to_pressure
from regrid.errors import BadInput
from regrid.roots import find_root

TALL = 8.0  # heights of cells over their least width: square ones would halve the time step


class PlateTable(DeckTable, kw_only=True):
    """One plate of the row."""

    material: key(str, "name of a material, or FILE.toml:NAME") = "Cu"
    thickness: key(float, "[m]", gt=0, le=1e3) = 2e-3
    cells: key(int, "cells across it", ge=2, le=MOST_CELLS) = 160
    gap: key(float, "to the plate before it [m]; of the first: 0", ge=0, le=1e3) = 0.0


def make_default_plates() -> tuple[PlateTable, ...]:
    """Aluminium of 1 mm onto copper of 2 mm, a tenth of a millimetre apart."""
    return (
        PlateTable(material="Al1100", thickness=1e-3, cells=100),
        PlateTable(material="Cu", thickness=2e-3, cells=160, gap=1e-4),
    )


class FlyerTargetDeck(Deck, kw_only=True):
    """Deck of `flyer-target`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=1.6e-6, cfl=0.8))
    regrid: Regrid = msgspec.field(default_factory=Regrid)
    speed: key(float, "of the first plate [m/s]", gt=0, le=1e5) = 1000.0
    plates: key(tuple[PlateTable, ...], "from left to right", min_length=2, max_length=12) = (
        msgspec.field(default_factory=make_default_plates)
    )
    rows: key(int, "cells along the plates", ge=2, le=MOST_CELLS) = 2
    void_fill: VoidFill = msgspec.field(default_factory=VoidFill)
    bond: key(float, "tension that contacts hold [Pa]", ge=0, le=1e20) = 0.0


@dataclass(frozen=True)
class Theory:
    """Of the first impact: pressure [Pa] and speed [m/s] behind it, its time [s].

    Of a free surface behind two plates: speed [m/s] from `out` to `end` [s]; `end` is NaN where the
    release has met the shock before.
    """

    p: float
    u: float
    free: float
    impact: float
    out: float
    end: float


class FlyerTarget(Problem):
    """Plates in a row, between two walls along it."""

    Deck = FlyerTargetDeck
    picture = "flyer-target"
    units: ClassVar = {"free_surface_speed": "m/s", "contact_pressure": "Pa"}

    def __init__(self, deck: FlyerTargetDeck):
        super().__init__(deck)
        if deck.plates[0].gap:
            raise BadInput(
                f"deck: plates[0].gap is {deck.plates[0].gap:g}; nothing is before the first plate"
            )
        self.materials = [find_material(plate.material) for plate in deck.plates]
        self.names = [f"plate-{number}" for number in range(1, len(deck.plates) + 1)]
        ends, x = [], 0.0
        for plate in deck.plates:
            ends.append((x + plate.gap, x + plate.gap + plate.thickness))
            x = ends[-1][1]
        self.ends = ends
        cells = [plate.thickness / plate.cells for plate in deck.plates]
        self.height = TALL * deck.rows * min(cells)

    def plan(self):
        """End time and the plates."""
        deck = self.deck
        return deck.run.t_end, [
            BlockPlan(name, (plate.cells, deck.rows), (first, 0.0), (last, self.height))
            for name, plate, (first, last) in zip(self.names, deck.plates, self.ends, strict=True)
        ]

    def build(self):
        deck, blocks = self.deck, []
        for number, (name, plate, material) in enumerate(
            zip(self.names, deck.plates, self.materials, strict=True)
        ):
            x = np.linspace(*self.ends[number], plate.cells + 1)
            nodes = np.array(make_plane_grid(x, np.linspace(0.0, self.height, deck.rows + 1)))
            speed = deck.speed if number == 0 else 0.0
            block = Block(name, material.eos, nodes, material.rho0, speed, 0.0, 0.0, material=name)
            for side in ("i_min", "i_max"):
                put(block, side, "free-surface", bond=deck.bond)
            put_walls(block, "j_min", "j_max")
            blocks.append(block)
        return self.simulate(blocks)

    def measure(self, evolution) -> dict[str, float]:
        """Speeds of the plates and of the last free surface; pressure where the first two meet."""
        blocks = evolution.blocks
        row = {}
        for name, block in zip(self.names, blocks, strict=True):
            mass = block.state[0, 1:-1, 1:-1] * block.volume
            row[f"speed_{name}"] = float((mass * block.state[U, 1:-1, 1:-1]).sum() / mass.sum())
        row["free_surface_speed"] = float(blocks[-1].state[U, -2, 1:-1].mean())
        row["contact_pressure"] = 0.5 * float(
            blocks[0].state[P, -2, 1:-1].mean() + blocks[1].state[P, 1, 1:-1].mean()
        )
        return row

    @functools.cached_property
    def theory(self) -> Theory:
        """The first impact, and the trace of a free surface behind two plates."""
        deck = self.deck
        bodies = [(one.eos, one.rho0) for one in self.materials[:2]]
        flyer, target = bodies

        def excess(p: float) -> float:
            shocks = [shock_to_pressure(*body, 0.0, p) for body in bodies]
            return sum(shock.particle_speed for shock in shocks) - deck.speed

        scale = flyer[1] * deck.speed * (float(flyer[0].sound_speed(flyer[1], 0.0)) + deck.speed)
        p = find_root(excess, 1e-3 * scale, 10.0 * scale)
        one, other = (shock_to_pressure(*body, 0.0, p) for body in bodies)
        gain = float(make_isentrope(target[0], other.rho, other.p).velocity_gain(0.0))
        free = other.particle_speed + gain
        thickness, depth = (plate.thickness for plate in deck.plates[:2])
        impact = deck.plates[1].gap / deck.speed
        out = impact + depth / other.shock_speed
        # In mass coordinates: the head of the release crosses the flyer and follows the shock.
        # In the fan from the free surface m (t - out) stays what it is.
        z_flyer = one.rho * float(flyer[0].sound_speed(one.rho, p))
        z = other.rho * float(target[0].sound_speed(other.rho, p))
        z_free = target[1] * float(target[0].sound_speed(target[1], 0.0))
        head = impact + thickness / one.shock_speed + flyer[1] * thickness / z_flyer
        catch = (target[1] * depth + z * (head - out)) / (2.0 * z)  # after `out`, at the fan
        end = out + 2.0 * catch * math.sqrt(z / z_free) if catch > 0.0 else math.nan
        return Theory(p, other.particle_speed, free, impact, out, end)

    def report(self, history, final=None) -> Report:
        deck, theory, first = self.deck, self.theory, self.deck.plates[0]
        head = (
            f"flyer-target: {first.material} of {1e3 * first.thickness:g} mm at {deck.speed:g} "
            f"m/s, {len(deck.plates)} plates"
        )
        if not history:
            return Report(head)
        t, rows, notes = history["t"], [], []
        met = np.flatnonzero(history["contacts_made"] > 0)
        if met.size:
            before = float(t[met[0] - 1]) if met[0] > 0 else 0.0
            rows.append(Row("impact", before, theory.impact, "time of impact [s]", digits=5))
            inside = (t > before) & (t < before + 0.7 * self._find_pulse(theory.p))
            if inside.sum() > 3:
                late = float(np.median(history["contact_pressure"][inside]))
                rows.append(Row("pressure", late, theory.p, "pressure [GPa]", 1e9, digits=5))
        if len(deck.plates) == 2:
            trace = history["free_surface_speed"]
            risen = np.flatnonzero(trace > 0.5 * theory.free)
            if risen.size:
                words, found = "shock at the free surface [s]", float(t[risen[0]])
                rows.append(Row("out", found, theory.out, words, digits=5))
            late = (t > 0.5 * (theory.out + theory.end)) & (t < theory.end) & (t > theory.out)
            if late.any():
                found = float(np.median(trace[late]))
                rows.append(Row("free", found, theory.free, "free surface [m/s]", digits=5))
            fallen = np.flatnonzero(
                (t > theory.out) & (trace < 0.98 * theory.free) & _has_been(trace, theory.free)
            )
            if fallen.size and math.isfinite(theory.end):
                words, found = "until the release [s]", float(t[fallen[0]])
                rows.append(Row("end", found, theory.end, words, digits=5))
            notes.append(f"behind the impact both go at {theory.u:.5g} m/s")
        for name in self.names:
            notes.append(f"{name} goes at {history[f'speed_{name}'][-1]:.5g} m/s in the end")
        apart = np.flatnonzero(history["contacts_opened"] > 0)
        if apart.size:
            notes.append(f"plates parted first at t = {float(t[apart[0]]):.4g} s")
        return Report(head, rows, notes)

    def _find_pulse(self, p: float) -> float:
        """About the time until the flyer's release is back at the contact [s]."""
        material, plate = self.materials[0], self.deck.plates[0]
        shock = shock_to_pressure(material.eos, material.rho0, 0.0, p)
        c = float(material.eos.sound_speed(shock.rho, shock.p))
        return plate.thickness * (1.0 / shock.shock_speed + shock.rho_ahead / (shock.rho * c))

    def draw(self, figure, run_data) -> None:
        """The free surface's speed beside theory, and the mean speeds of all plates."""
        left, right = figure.subplots(1, 2)
        history = run_data.history
        t = 1e6 * history["t"]
        left.plot(t, history["free_surface_speed"], label="computed")
        theory = self.theory
        if len(self.deck.plates) == 2:
            end = theory.end if math.isfinite(theory.end) else theory.out
            line = np.array(
                [(0.0, 0.0), (theory.out, 0.0), (theory.out, theory.free), (end, theory.free)]
            )
            left.plot(
                1e6 * line[:, 0], line[:, 1], "k--", lw=0.8, label="theory, until the release"
            )
        left.set_ylabel("free surface of the last plate [m/s]")
        left.legend()
        for name, plate in zip(self.names, self.deck.plates, strict=True):
            right.plot(t, history[f"speed_{name}"], label=f"{name}, {plate.material}")
        right.set_ylabel("mean speed [m/s]")
        right.legend()
        for panel in (left, right):
            panel.set_xlabel("t [µs]")


def _has_been(trace, level: float) -> np.ndarray:
    """Of each entry of a trace: has it come to within 2 % of a level before?"""
    return np.maximum.accumulate(trace) > 0.98 * level
