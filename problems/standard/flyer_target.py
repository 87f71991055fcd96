"""A flyer crosses a gap and hits a target: impact, release, separation and surface speed.

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

from typing import ClassVar

import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from problems.deck import MOST_CELLS, Deck, DeckTable, Regrid, RunControl, VoidFill, key
from problems.initial_states import put_walls
from problems.pictures import draw_columns
from problems.problem import BlockPlan, Problem, Report, Row, find_time, reduce_between
from problems.references.exact_flows import compute_plate_impact


class PlateTable(DeckTable, kw_only=True):
    material: key(str, "name of a material, or FILE.toml:NAME") = "Cu"
    thickness: key(float, "[m]", ge=1e-9, le=1e3) = 2e-3
    cells: key(int, "cells across it", ge=2, le=MOST_CELLS) = 160
    gap: key(float, "to the plate before it [m]; of the first: 0", ge=0, le=1e3) = 0.0


PLATES = PlateTable(material="Al1100", thickness=1e-3, cells=100), PlateTable(gap=1e-4)


class FlyerTargetDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=1.6e-6, cfl=0.8)
    regrid: Regrid = Regrid()
    speed: key(float, "of the first plate [m/s]", ge=1e-12, le=1e5) = 1000.0
    plates: key(tuple[PlateTable, ...], "from left to right", min_length=2, max_length=12) = PLATES
    rows: key(int, "cells along the plates", ge=2, le=MOST_CELLS) = 2
    void_fill: VoidFill = VoidFill()
    bond: key(float, "tension that contacts hold [Pa]", ge=0, le=1e20) = 0.0


class FlyerTarget(Problem):
    Deck = FlyerTargetDeck
    units: ClassVar = {"free_surface_speed": "m/s", "contact_pressure": "Pa"}

    def __init__(self, deck: FlyerTargetDeck):
        super().__init__(deck)
        first, second, *more = deck.plates
        first.refuse(first.gap, "gap", "nothing is before the first plate, whose gap must be 0")
        self.materials = [find_material(plate.material) for plate in deck.plates]
        impact = deck.speed, second.gap, first.thickness, second.thickness
        self.theory = compute_plate_impact(*self.materials[:2], *impact)
        self.is_pair = not more
        self.names = [f"plate-{number}" for number in range(1, len(deck.plates) + 1)]

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
        blocks = []
        for (name, nodes), material in zip(self.make_grids().items(), self.materials, strict=True):
            state = material.rho0, 0.0 if blocks else self.deck.speed, 0.0, 0.0
            blocks.append(Block(name, material.eos, nodes, *state, material=name))
            for side in ("i_min", "i_max"):
                put(blocks[-1], side, "free-surface", bond=self.deck.bond)
            put_walls(blocks[-1])
        return self.simulate(blocks)

    def measure(self, evolution) -> dict[str, float]:
        row = {}
        states = [block.state[:, 1:-1, 1:-1] for block in evolution.blocks]
        for block, (rho, u, *_) in zip(evolution.blocks, states, strict=True):
            row[f"speed_{block.name}"] = float(np.average(u, weights=rho * block.volume))
        meeting = 0.5 * (states[0][3, -1].mean() + states[1][3, 0].mean())  # of the first two
        surface = float(states[-1][1, -1].mean())
        return {**row, "free_surface_speed": surface, "contact_pressure": float(meeting)}

    def report(self, history, final=None) -> Report:
        deck = self.deck
        theory = self.theory
        trace = history["free_surface_speed"]
        t = history["t"]
        p = history["contact_pressure"]
        parted = history["contacts_opened"] > 0
        # a contact that a step has made was there at its start
        impact = find_time(history, np.append(history["contacts_made"][1:] > 0, False))
        pressure = reduce_between(np.median, t, p, impact, impact + 0.7 * theory.back, 4)
        out, free, end = theory.read_trace(t, trace)
        rows = [
            Row("impact", impact, theory.impact, "time of impact [s]", digits=5),
            Row("pressure", pressure, theory.pressure, "pressure [GPa]", 1e9, 5),
            Row("out", out, theory.out, "arrival of the shock at the free surface [s]", digits=5),
            Row("free", free, theory.free, "speed of the free surface [m/s]", digits=5),
            Row("end", end, theory.end, "arrival of the release [s]", digits=5),
        ]
        rows = [row for row in rows[: 5 if self.is_pair else 2] if not np.isnan(row.theory)]
        first = deck.plates[0]
        notes = []
        plate = f"{first.material} of {1e3 * first.thickness:g} mm at {deck.speed:g} m/s"
        if self.is_pair:
            notes.append(f"behind the impact both plates move at {theory.u:.5g} m/s")
        for name in self.names if history else ():
            notes.append(f"{name} moves at {history[f'speed_{name}'][-1]:.5g} m/s at the end")
        if parted.any():
            notes.append(f"plates first separated at t = {find_time(history, parted):.4g} s")
        return Report(f"flyer-target: {plate}, {len(deck.plates)} plates", rows, notes)

    def draw_flyer_target(self, figure, run_data) -> None:
        """The free surface's speed beside theory."""
        axis = figure.subplots()
        theory = self.theory
        labels = {"free_surface_speed": "computed"}
        words = "free surface of the last plate [m/s]"
        draw_columns(axis, run_data.history, labels, words, "µs")
        if self.is_pair:
            axis.plot(*theory.make_trace(1e6), "k--", lw=0.8, label="theory, until the release")
