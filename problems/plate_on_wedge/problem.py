"""A driven plate strikes a wedge; a collision point runs along the face and may emit a jet.

The plate lies on the flat top of the wedge body; beyond it the wedge's face slopes away at
`angle`.  A shock from the drive reaches the plate's free lower side, which flies into the gap
with about twice the particle speed and closes it progressively: the collision point A runs along
the face.  With a `gap` the plate starts above the wedge, and the contact of the two bodies closes
and opens by itself.  Below a critical angle the oblique shocks stay attached to A and
there is no jet; above it a jet runs ahead of A.  When A reaches the end B of the face the shocks
detach and a thin jet leaves past B and curls round the end face.  Plate and wedge slide on each
other; both grids follow the contact line, with non-matching nodes.

The history has the phases and their times.  The run ends when the jet meets something (the end
face, the base on which the wedge stands, the symmetry plane) or when the free surface meets itself.
References: shock polars of both materials, the critical angle, Birkhoff's jet.
"""

import functools
import itertools
import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec import Meta

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join, slide
from shockgrid.problems.deck import (
    MOST_CELLS,
    DeckTable,
    Regrid,
    RunControl,
    check_solid,
    key,
)
from shockgrid.problems.initial_states import make_plane_grid, put_walls
from shockgrid.problems.plate_on_wedge.report import COLUMNS, WIDE_ZONE, Results
from shockgrid.problems.plate_on_wedge.run import PlateRun
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.hugoniot import (
    Shock,
    shock_to_pressure,
    shock_with_particle_speed,
)
from shockgrid.problems.references.riemann import solve_riemann
from shockgrid.problems.references.shock_polars import (
    Body,
    find_critical_angle,
    release_driven_plate,
    solve_collision,
)
from shockgrid.problems.solids import SolidDeck, find_laws
from shockgrid.regrid.spacings import arc_spacing, clustered_spacing, meeting_laws

Cells = Annotated[int, Meta(ge=1, le=MOST_CELLS)]


class Drive(DeckTable, kw_only=True):
    """What sets the plate in motion."""

    kind: key(
        Literal["piston", "pressure", "flyer", "moving"],
        "on the plate's back: a piston at `speed`, `pressure`, a flyer at `speed`; moving: the "
        "whole plate comes in at `speed`, the test of shock polars",
    ) = "piston"
    speed: key(float, "speed of piston, flyer or plate [m/s]", ge=1e-12, le=1e9) = 2500.0
    pressure: key(float, "driving pressure [Pa]", ge=1e-12, le=1e20) = 50e9
    history: key(
        tuple[tuple[float, Annotated[float, Meta(ge=0)]], ...],
        "pairs of time [s] and part (0..1) of speed or pressure; straight between",
    ) = ()
    material: key(str, "of the flyer") = "SS304"
    thickness: key(float, "of the flyer [m]", ge=1e-9, le=1e3) = 5e-3


class PlateOnWedgeDeck(SolidDeck, kw_only=True):
    """Deck of `plate-on-wedge`; the default is the paper's scenario, its sizes are ours."""

    run: RunControl = RunControl(cfl=0.8)
    # a stronger barrier than elsewhere: the plate's grid bends by 300 degrees around B
    regrid: Regrid = Regrid(epsilon=3e-2)
    plate: key(str, "material of the plate") = "Al1100"
    thickness: key(float, "of the plate [m]", ge=1e-9, le=1e3) = 10e-3
    wedge: key(str, "material of the wedge body") = "SS304"
    angle: key(float, "between plate and wedge face [degrees]", ge=0.5, le=75) = 20.0
    gap: key(float, "over the wedge's edge at first [m]; above 0: apart", ge=0, le=1e3) = 0.0
    face: key(float, "length of the wedge's face [m]", ge=1e-9, le=1e3) = 30e-3
    edge: key(float, "length of the flat edge on which the plate lies [m]", ge=1e-9, le=1e3) = 10e-3
    overhang: key(float, "of the plate beyond the end of the face [m]", ge=1e-9, le=1e3) = 10e-3
    depth: key(float, "height of the face's end over the base [m]", ge=1e-9, le=1e3) = 12e-3
    right: key(Literal["symmetry", "free"], "the plate's far end") = "symmetry"
    drive: Drive = Drive()
    cells: key(tuple[Cells, Cells], "cells of the plate along and across it") = (80, 24)
    refinement: key(
        float | None, "how much finer cells at A are. If left out: at most 3", ge=1, le=8
    ) = None
    until: key(
        Literal["auto", "arrival", "end"], "A at the face's end B, or later; auto: B if refined"
    ) = "auto"


OVER_EDGE = 0.6  # of the plate's cells: those that lie on the wedge at first
MOST_REFINED = 3.0  # times finer cells at A where the zone of constant states behind A is short
FINER_ROWS = 0.75  # power of the refinement by which rows are finer: torn cells get too thin at 1


class PlateOnWedge(Results, Problem):
    Deck = PlateOnWedgeDeck
    units: ClassVar = {
        **dict.fromkeys(("contact_x", "contact_y", "contact_path", "lead"), "m"),
        **dict.fromkeys(("contact_pressure", *COLUMNS), "Pa"),
        **dict.fromkeys(("interface_angle", "shock_angle_plate", "shock_angle_wedge"), "degrees"),
        **dict.fromkeys(("surface_speed", "jet_speed"), "m/s"),
        "jet_mass": "kg/m",
    }

    def __init__(self, deck: PlateOnWedgeDeck):
        super().__init__(deck)
        solid = find_material(deck.plate)
        wedge = find_material(deck.wedge)
        self.materials = {"plate": solid, "wedge": wedge}
        for name, material in self.materials.items():
            check_solid(name, getattr(deck, name), material)
        self.solids = dict(self.materials)
        if deck.drive.kind == "flyer":
            self.solids["flyer"] = find_material(deck.drive.material)
        self.laws = find_laws(deck, self.solids)
        ni, nj = deck.cells
        self.contact = round(OVER_EDGE * ni)
        parts = self.contact, ni - self.contact, nj  # on the wedge, beyond it, across
        if min(parts) < 4:
            raise deck.error(
                "cells", f"the plate needs 4 on the wedge, beyond it and across; these are {parts}"
            )
        self.angle = math.radians(deck.angle)
        along = deck.face * math.cos(self.angle)
        down = deck.face * math.sin(self.angle)
        self.end = np.array([deck.edge + along, -down])
        self.length = float(self.end[0]) + deck.overhang
        self.base = float(self.end[1]) - deck.depth
        if deck.gap and deck.refinement:
            raise deck.error(
                "refinement",
                "cells are finer at A only where the plate lies on the wedge from the start",
            )
        times = [time for time, _ in deck.drive.history]
        falls = any(b <= a for a, b in itertools.pairwise(times))
        if falls:
            raise deck.error("drive.history", "its times must increase")
        # the plate as it flies, its speed V [m/s], and when the drive's shock is at its lower side
        self.flying = Body(solid.eos, solid.rho0)
        self.plate_speed = deck.drive.speed
        arrival = 0.0
        if deck.drive.kind != "moving":
            shock = self.find_drive_shock()
            arrival = deck.thickness / shock.shock_speed
            driven = self.flying, shock.particle_speed
            self.flying, self.plate_speed = release_driven_plate(*driven)
        # time enough for a jet to reach the base
        path = deck.face * math.sin(self.angle) / self.plate_speed
        fall = deck.gap + deck.depth / 1.2
        self.t_end = deck.run.t_end or arrival + 2.5 * path + fall / self.plate_speed
        self.target = Body(wedge.eos, wedge.rho0)
        self.collision = solve_collision(self.flying, self.target, self.plate_speed, self.angle)
        self.refinement = deck.refinement or self.find_refinement()
        until_arrival = deck.until == "auto" and self.refinement > 1.0
        self.ends_at_arrival = deck.until == "arrival" or until_arrival
        self.coarse_spacing = self.length / ni
        self.wedge_spacing = self.coarse_spacing / math.sqrt(self.refinement)
        parts = deck.edge / self.wedge_spacing, deck.face / self.wedge_spacing
        self.on_edge, self.on_face = (max(3, round(part)) for part in parts)  # faces of the wedge
        drive = deck.drive
        self.flyer_rows = 0
        if drive.kind == "flyer":
            self.flyer_rows = max(4, round(drive.thickness / deck.thickness * nj))

    def find_drive_shock(self) -> Shock:
        """The drive's first shock in the plate; BadInput without one."""
        drive = self.deck.drive
        solid = self.materials["plate"]
        at_rest = (solid.rho0, 0.0)
        speed = drive.speed
        key = "drive.pressure" if drive.kind == "pressure" else "drive.speed"
        with self.deck.blame(key, f"{self.deck.plate} has no such shock; take a weaker drive"):
            if drive.kind == "pressure":
                return shock_to_pressure(solid.eos, *at_rest, drive.pressure)
            if drive.kind == "flyer":
                flyer = find_material(drive.material)
                hit = (flyer.rho0, speed, 0.0), solid.eos, (solid.rho0, 0.0, 0.0)
                speed = solve_riemann(flyer.eos, *hit).u
            return shock_with_particle_speed(solid.eos, *at_rest, speed)

    @functools.cached_property
    def critical(self) -> float:
        """The critical angle at the plate's speed [rad]."""
        return find_critical_angle(self.flying, self.target, self.plate_speed)

    @functools.cached_property
    def zone(self) -> float:
        """Length of the zone of constant states behind A over A's path; NaN where a jet forms.

        Nothing but A sets a length in the flow around it, so all grows with A's path s.  Sound from
        the edge of the wedge follows A at the sound speed c relative to the material, which leaves
        A at q: the zone that it has not reached is (q - c) s / (V / sin beta) long, in each body.
        Below 0, where a flow behind A is subsonic, there is none: states change from A on.
        """
        theory = self.collision
        if theory.plate is None or theory.wedge is None:
            return math.nan
        waves = (theory.plate, theory.wedge)
        return min(
            wave.speed_behind * (1.0 - 1.0 / wave.mach_behind) / theory.contact_speed
            for wave in waves
        )

    def find_refinement(self) -> float:
        """How many times finer the cells at A are, by the length of the zone behind A.

        1 for a driven plate: its run goes on behind B, where material tears in thin cells.
        """
        if self.deck.gap or self.deck.drive.kind != "moving" or not self.collision.attached:
            return 1.0
        zone = max(self.zone, 1e-3 * WIDE_ZONE)
        return min(max((WIDE_ZONE / zone) ** 1.5, 1.0), MOST_REFINED)

    def make_grids(self, t=0.0):
        """Those of plate and wedge, and of a flyer."""
        deck = self.deck
        ni, nj = self.deck.cells
        drive = self.deck.drive
        lengths = (deck.edge, self.length - deck.edge)
        counts = (self.contact + 1, ni - self.contact + 1)
        law, free_law = meeting_laws(counts, lengths, self.refinement)
        x = np.concatenate((lengths[0] * law, deck.edge + lengths[1] * free_law[1:]))
        if deck.gap:  # nodes stay with the plate
            x = np.linspace(0.0, self.length, ni + 1)
        grids = {"plate": make_plane_grid(x, deck.gap + self.lay_rows(nj, deck.thickness))}
        edge, face = (np.linspace(0.0, 1.0, n + 1) for n in (self.on_edge, self.on_face))
        along = np.concatenate((edge, 1.0 + face[1:]))
        ends = (0.0, deck.edge, self.end[0]), (0.0, 0.0, self.end[1])
        top = np.array([np.interp(along, (0.0, 1.0, 2.0), places) for places in ends])
        bottom = np.array([arc_spacing(top) * self.end[0], np.full(top.shape[1], self.base)])
        part = self.lay_rows(max(6, round(deck.depth / self.coarse_spacing)), 1.0, from_end=True)
        grids["wedge"] = bottom[:, :, None] * (1.0 - part) + top[:, :, None] * part
        if self.flyer_rows:
            across = np.linspace(0.0, drive.thickness, self.flyer_rows + 1)
            y = deck.gap + deck.thickness + across
            grids["flyer"] = make_plane_grid(x, y)
        return grids

    def lay_rows(self, rows: int, length: float, from_end: bool = False) -> np.ndarray:
        """Places (rows + 1,) of grid lines across a body from 0 to `length`, finer at one end."""
        if self.refinement <= 1.0:
            return np.linspace(0.0, length, rows + 1)
        least = 1.0 / (rows * self.refinement**FINER_ROWS)
        return length * clustered_spacing(rows + 1, least, from_end)

    def estimate_cells(self) -> int:
        """Cells of all blocks, counted from the sizes that the deck asks for."""
        ni, nj = self.deck.cells
        deck = self.deck
        along = 6.0 + (deck.edge + deck.face) / self.wedge_spacing
        return ni * (nj + self.flyer_rows) + math.ceil(
            along * max(6.0, 1.0 + deck.depth / self.coarse_spacing)
        )

    def build(self) -> PlateRun:
        deck = self.deck
        drive = self.deck.drive
        grids = self.make_grids()
        blocks = []
        strength = lambda t: 1.0  # noqa: E731
        if drive.history:
            times, parts = (np.array(column) for column in zip(*drive.history, strict=True))
            strength = lambda t: float(np.interp(t, times, parts))  # noqa: E731
        speeds = {"plate": -drive.speed if drive.kind == "moving" else 0.0, "flyer": -drive.speed}
        for name, nodes in grids.items():
            solid = self.solids[name]
            state = solid.rho0, 0.0, speeds.get(name, 0.0), 0.0
            blocks.append(Block(name, solid.eos, nodes, *state, **self.laws[name].options))
        plate, wedge, *flyer = blocks
        edge = (wedge, "j_max", 0, self.on_edge)
        face = (wedge, "j_max", self.on_edge, None)
        links = []
        if deck.gap:
            for side in (edge, face):
                put(side[0], side[1], "free-surface", *side[2:])
            put(plate, "j_min", "free-surface")
        else:
            links.append(slide([edge, face], (plate, "j_min", 0, self.contact)))
            put(plate, "j_min", "free-surface", self.contact)
        if drive.kind == "piston":
            put(plate, "j_max", "piston", velocity=lambda t: (0.0, -strength(t) * drive.speed))
        elif drive.kind == "pressure":
            pressure = lambda t: strength(t) * drive.pressure  # noqa: E731
            put(plate, "j_max", "free-surface", pressure=pressure)
        elif flyer:
            links.append(join("interface", (plate, "j_max"), (flyer[0], "j_min")))
        if drive.kind in ("moving", "flyer"):
            put(*flyer or [plate], "j_max", "free-surface")
        for block in blocks if deck.right == "free" else [wedge]:
            put(block, "i_max", "free-surface")
        put_walls(*blocks)
        return self.simulate(blocks, links, kind=functools.partial(PlateRun, self))

    def measure(self, evolution: PlateRun) -> dict[str, float]:
        return evolution.measure()
