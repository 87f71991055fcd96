"""Graphite in a conical target: an impact drives a shock into a cone, where it converges.

An aluminium impactor hits a steel disc inside a ring of lead, which close a steel shell filled with
lead.  Behind the disc, embedded in the lead, stands a cone of graphite, its base on the disc, its
blunt tip downstream; the target is axisymmetric.  Shocks run faster in graphite than in lead and
enter the cone from its side, so pressures rise towards the tip.  Steel slides on lead and graphite.
Where graphite, steel and lead meet the lines roll up; the graphite-lead interface is unstable.

The shape follows Charakhch'yan's third application.  His dimensions, speed and pressures are not
available: those here are ours.  A rigid wall holds the outside of the shell, because the rim of a
free one throws a jet that these blocks cannot follow.

The problem measures the pressure at the impact face and at gauges in the graphite on the axis, the
greatest pressure and its place in every material, the fraction of graphite that has changed phase,
position and pressure of the shock in the cone on its axis and along its side, how far the
graphite-lead interface is from straight, and the growth of a ripple put on it.

Note: failed aluminium that slides on the impact face is compressed without bound where it closes up
again; there, and on the cone's side, materials share the nodes of their line.
"""

import dataclasses
import math
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.materials import Material, find_material, make_material
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.conical_target import report as seen
from shockgrid.problems.conical_target.layout import MATERIALS, Layout, Ripple
from shockgrid.problems.deck import (
    MOST_CELLS,
    NONE,
    DeckTable,
    Regrid,
    RunControl,
    check_solid,
    key,
)
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.riemann import solve_riemann
from shockgrid.problems.signals import find_crossing
from shockgrid.problems.solids import SolidDeck, find_laws

Touch = Literal["joined", "sliding"]


class EosNumbers(DeckTable, kw_only=True):
    """Numbers of the equations of state in place of the library's, such as `onset = 3e10`."""

    merges = True

    impactor: key(dict[str, float], "of the impactor's material") = NONE
    shell: key(dict[str, float], "of the shell's material") = NONE
    target: key(dict[str, float], "of the material around the cone") = NONE
    filling: key(dict[str, float], "of the cone's material") = NONE


class Contact(DeckTable, kw_only=True):
    """How materials touch: "joined" share the nodes of their line, "sliding" slip along it."""

    impactor: key(Touch, "the impactor and what it hits") = "joined"
    front: key(Touch, "the shell's front and what it covers") = "sliding"
    side: key(Touch, "the shell's side and what it surrounds") = "sliding"
    cone: key(Touch, "the cone's side and what is around it") = "joined"


class ConicalTargetDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(t_end=5e-6, cfl=0.8)
    regrid: Regrid = Regrid()
    cells: key(int, "cells from the axis to the shell", ge=16, le=MOST_CELLS) = 48
    speed: key(float, "of the impactor [m/s]", ge=1e-12, le=1e9) = 2000.0
    impactor: key(str, "material of the impactor") = "Al1100"
    shell: key(str, "material of the shell") = "SS304"
    target: key(str, "material around the cone") = "Pb"
    filling: key(str, "material of the cone") = "graphite-diamond"
    thickness: key(float, "of the impactor [m]", ge=1e-9, le=1e3) = 8e-3
    front: key(float, "thickness of the shell's front [m]", ge=1e-9, le=1e3) = 3e-3
    side: key(float, "thickness of the shell's side [m]", ge=1e-9, le=1e3) = 4e-3
    radius: key(float, "inside the shell [m]", ge=1e-9, le=1e3) = 16e-3
    cover: key(float, "of the front [m]; `radius`: the shell is closed", ge=1e-9, le=1e3) = 12.5e-3
    length: key(float, "inside the shell [m]", ge=1e-9, le=1e3) = 26e-3
    base: key(float, "radius of the cone's base [m]", ge=1e-9, le=1e3) = 9e-3
    tip: key(float, "radius of the cone's blunt tip [m]", ge=1e-9, le=1e3) = 2e-3
    cone: key(float, "length of the cone [m]", ge=1e-9, le=1e3) = 14e-3
    ripple_amplitude: key(float, "of a ripple on the cone's side [m]; 0: none", ge=0, le=1e3) = 0.0
    ripple_wavelength: key(float, "along the cone's side [m]", ge=1e-9, le=1e3) = 4e-3
    ripple_phase: key(float, "of its sine at the cone's base [rad]", ge=-1e6, le=1e6) = 0.0
    contact: Contact = Contact()
    eos: EosNumbers = EosNumbers()


SHOCK_PRESSURE_PART = 0.2  # of the impact's pressure: where a shock in the cone is
AT_REST = 0.01  # of the impactor's speed
# greatest pressure of a material, and the centre of that cell
PEAK = {"pressure": "Pa", "x": "m", "y": "m"}
CELLS_BEHIND_FRONT = 5  # cells behind the front: a shock is three or four wide


class ConicalTarget(seen.Results, Problem):
    Deck = ConicalTargetDeck
    units: ClassVar[dict[str, str]] = {
        **dict.fromkeys(("greatest_x", "greatest_y", "shock_x_axis", "shock_x_side"), "m"),
        **dict.fromkeys(("line_bend", "line_amplitude", "line_length"), "m"),
        **dict.fromkeys(("pressure_impact", "greatest_pressure"), "Pa"),
        **dict.fromkeys(("shock_pressure_axis", "shock_pressure_side"), "Pa"),
        **{f"pressure_gauge_{number}": "Pa" for number in range(len(seen.GAUGES))},
        **{f"peak_{n}_{part}": unit for part in seen.PARTS for n, unit in PEAK.items()},
    }

    def __init__(self, deck: ConicalTargetDeck):
        super().__init__(deck)
        self.materials = {
            name: _find_material(deck, name) for name in ("impactor", "shell", "target", "filling")
        }
        for name, material in self.materials.items():
            check_solid(name, getattr(deck, name), material)
        self.laws = find_laws(deck, self.materials)
        for low, high, what in (
            ("tip", "base", "the cone narrows from its base to its tip"),
            ("base", "radius", "there must be lead between the cone and the shell"),
            ("cone", "length", "there must be lead behind the cone's tip"),
            ("base", "cover", "the shell's front must cover the cone's base and more"),
        ):
            most = getattr(deck, high)
            if getattr(deck, low) > 0.97 * most:
                raise deck.error(low, f"{high} is {most:g} m: {what}")
        if 0.97 * deck.radius < deck.cover < deck.radius:
            raise deck.error(
                "cover",
                "the lead beside it is too thin; "
                f"give {deck.radius:g} m to close the shell, or less",
            )
        self.impact = self._match_impact()
        self.ripple = Ripple(deck, self.materials, self.impact)
        self.layout = Layout(deck, self.ripple)
        if self.ripple:
            self.check_memory()  # grids are made here
            self.ripple.check(self.layout.along, self.make_grids())

    def _match_impact(self) -> tuple[float, float, float]:
        """Pressure and velocity of the impact face until waves come back, and for how long.

        Raises BadInput past the speeds at which the materials' Hugoniots were measured.
        """
        deck = self.deck
        one, two = (self.materials[name] for name in ("impactor", "shell"))
        with deck.blame("speed", "take a slower impactor"):
            hit = solve_riemann(one.eos, (one.rho0, deck.speed, 0.0), two.eos, (two.rho0, 0.0, 0.0))
        limits = [float(solid.eos.sound_speed(solid.rho0, 0.0)) for solid in (one, two)]
        if deck.speed - hit.u > limits[0] or hit.u > limits[1]:
            raise deck.error(
                "speed",
                "take a slower impactor: equations of state are not made for material behind a "
                "shock that is faster than sound at rest "
                f"({limits[0]:.0f} and {limits[1]:.0f} m/s)",
            )
        return hit.p, hit.u, deck.front / hit.right_wave.head

    def estimate_cells(self) -> int:
        return self.layout.estimate_cells()

    def make_grids(self, t=0.0):
        return self.layout.make_grids()

    def build(self) -> Simulation:
        deck = self.deck
        blocks = {}
        for name, nodes in self.make_grids().items():
            body = MATERIALS[name]
            material = self.materials[body]
            speed = deck.speed if name == "impactor" else 0.0
            state = material.rho0, speed, 0.0, 0.0
            options = {"material": body, **self.laws[body].options}
            blocks[name] = Block(name, material.eos, nodes, *state, **options)
        return self.simulate(
            blocks.values(),
            self.layout.connect(blocks),
            geometry="axisymmetric",
        )

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Pressures, the part of the cone's mass in its second phase, the bend of its side."""
        blocks = {block.name: block for block in evolution.blocks}
        front = blocks["front"]
        cone = blocks["cone"]
        measured = {name: seen.measure_peak(block) for name, block in blocks.items()}
        greatest, x, y, transformed = measured["cone"]
        row = {"pressure_impact": float(front.p[1, 0]), "greatest_pressure": greatest}
        row |= {"greatest_x": x, "greatest_y": y}
        p = cone.p
        axis = cone.centres[0, :, 0]
        ends = cone.nodes[0, [0, -1], 0]
        for number, part in enumerate(seen.GAUGES):
            position = ends[0] + part * (ends[1] - ends[0])
            row[f"pressure_gauge_{number}"] = float(np.interp(position, axis, p[:, 0]))
        row["transformed"] = transformed
        line = cone.nodes[:, :, -1]
        chord = line[:, -1] - line[:, 0]
        away = chord[0] * (line[1] - line[1, 0]) - chord[1] * (line[0] - line[0, 0])
        row["line_bend"] = float(np.abs(away).max() / math.hypot(*chord))
        departure, part = seen.measure_departure(line)
        middle = departure[(part >= seen.MIDDLE[0]) & (part <= seen.MIDDLE[1])]
        row["line_amplitude"] = 0.5 * float(np.ptp(middle))
        row["line_length"] = float(np.hypot(*np.diff(line, axis=1)).sum())
        threshold = SHOCK_PRESSURE_PART * self.impact[0]
        speed = AT_REST * self.deck.speed
        for name, number in (("axis", 0), ("side", -1)):
            front = measure_front(cone, number, threshold, speed)
            row[f"shock_x_{name}"], row[f"shock_pressure_{name}"] = front
        for part in seen.PARTS:
            own = [found[:3] for name, found in measured.items() if MATERIALS[name] == part]
            peak = max(own, key=lambda found: found[0])
            row |= {f"peak_{n}_{part}": value for n, value in zip(PEAK, peak, strict=True)}
        return row | (self.ripple.measure(line, evolution.t) if self.ripple else {})


def _find_material(deck: ConicalTargetDeck, name: str) -> Material:
    """The material of a part, with the deck's own numbers; raises BadInput."""
    found = find_material(getattr(deck, name))
    own = getattr(deck.eos, name)
    if own:
        table = dataclasses.asdict(found.eos) | {"eos": found.eos.kind, "source": found.source}
        found = make_material(f"deck: eos.{name}", table | own, Path())
    return found


def measure_front(block: Block, row: int, threshold: float, speed: float) -> tuple[float, float]:
    """Place x of the shock that runs along a row of cells towards i_max, and pressure behind it.

    The foremost crossing of `threshold` [Pa], between cell centres, and the greatest pressure in
    the BEHIND cells behind; NaN before the shock is in the row, and as soon as the row's last cell
    moves faster than `speed` [m/s].
    """
    p = block.p[:, row]
    u, v = block.state[1:3, -2, 1:-1][:, row]
    x = find_crossing(block.centres[0, :, row], p, threshold)
    if math.isnan(x) or math.hypot(u, v) > speed:
        return math.nan, math.nan
    last = int(np.flatnonzero(p > threshold)[-1])
    return x, float(p[max(0, last - CELLS_BEHIND_FRONT) : last + 1].max())
