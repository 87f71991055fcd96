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

import math
from typing import ClassVar

import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from hydro.rows import P, U
from problems.deck import MOST_CELLS, Deck, DeckTable, Regrid, RunControl, VoidFill, key
from problems.initial_states import put_walls
from problems.pictures import draw_columns
from problems.problem import BlockPlan, Problem, Report, Row, find_time
from problems.references.exact_flows import compute_plate_impact
from regrid.errors import BadInput

TALL = 8.0  # heights of cells over their least width: square ones would halve the time step


class PlateTable(DeckTable, kw_only=True):
    material: key(str, "name of a material, or FILE.toml:NAME") = "Cu"
    thickness: key(float, "[m]", gt=0, le=1e3) = 2e-3
    cells: key(int, "cells across it", ge=2, le=MOST_CELLS) = 160
    gap: key(float, "to the plate before it [m]; of the first: 0", ge=0, le=1e3) = 0.0


PLATES = PlateTable(material="Al1100", thickness=1e-3, cells=100), PlateTable(gap=1e-4)


class FlyerTargetDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=1.6e-6, cfl=0.8)
    regrid: Regrid = Regrid()
    speed: key(float, "of the first plate [m/s]", gt=0, le=1e5) = 1000.0
    plates: key(tuple[PlateTable, ...], "from left to right", min_length=2, max_length=12) = PLATES
    rows: key(int, "cells along the plates", ge=2, le=MOST_CELLS) = 2
    void_fill: VoidFill = VoidFill()
    bond: key(float, "tension that contacts hold [Pa]", ge=0, le=1e20) = 0.0


class FlyerTarget(Problem):
    """Plates in a row, between two walls along it."""

    Deck = FlyerTargetDeck
    units: ClassVar = {"free_surface_speed": "m/s", "contact_pressure": "Pa"}

    def __init__(self, deck: FlyerTargetDeck):
        super().__init__(deck)
        first, second, *more = deck.plates
        if first.gap:
            words = "nothing is before the first plate"
            raise BadInput(f"deck: plates[0].gap is {first.gap:g}; {words}")
        self.materials = [find_material(plate.material) for plate in deck.plates]
        impact = deck.speed, second.gap, first.thickness, second.thickness
        self.theory = compute_plate_impact(*self.materials[:2], *impact)
        self.is_pair = not more
        self.names = [f"plate-{number}" for number in range(1, len(deck.plates) + 1)]

    def list_boxes(self):
        rows, boxes, x = self.deck.rows, [], 0.0
        height = TALL * rows * min(one.thickness / one.cells for one in self.deck.plates)
        for name, plate in zip(self.names, self.deck.plates, strict=True):
            low, x = x + plate.gap, x + plate.gap + plate.thickness
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
        """Speeds of the plates and of the last free surface; pressure where the first two meet."""
        blocks, row = evolution.blocks, {}
        states = [block.state[:, 1:-1, 1:-1] for block in blocks]
        for block, state in zip(blocks, states, strict=True):
            mass = state[0] * block.volume
            row[f"speed_{block.name}"] = float(np.average(state[U], weights=mass))
        row["free_surface_speed"] = float(states[-1][U, -1].mean())
        meeting = 0.5 * (states[0][P, -1].mean() + states[1][P, 0].mean())
        return {**row, "contact_pressure": float(meeting)}

    def report(self, history, final=None) -> Report:
        deck, theory, trace = self.deck, self.theory, history["free_surface_speed"]
        first, t, parted = deck.plates[0], history["t"], history["contacts_opened"] > 0
        # a contact that a step has made was there at its start
        impact = find_time(history, np.append(history["contacts_made"][1:] > 0, False))
        pressure = history["contact_pressure"][(t > impact) & (t < impact + 0.7 * theory.back)]
        late = (t > max(theory.out, 0.5 * (theory.out + theory.end))) & (t < theory.end)
        risen = np.maximum.accumulate(trace) > 0.98 * theory.free
        fallen = risen & (t > theory.out) & (trace < 0.98 * theory.free)
        out, end = find_time(history, trace > 0.5 * theory.free), find_time(history, fallen)
        rows = [
            Row("impact", impact, theory.impact, "time of impact [s]", digits=5),
            Row("pressure", median(pressure), theory.pressure, "pressure [GPa]", 1e9, 5),
            Row("out", out, theory.out, "shock at the free surface [s]", digits=5),
            Row("free", median(trace[late]), theory.free, "free surface [m/s]", digits=5),
            Row("end", end, theory.end, "until the release [s]", digits=5),
        ]
        rows = [row for row in rows[: 5 if self.is_pair else 2] if not math.isnan(row.theory)]
        plate = f"{first.material} of {1e3 * first.thickness:g} mm at {deck.speed:g} m/s"
        head, notes = f"flyer-target: {plate}, {len(deck.plates)} plates", []
        if self.is_pair:
            notes.append(f"behind the impact both go at {theory.u:.5g} m/s")
        for name in self.names if history else ():
            notes.append(f"{name} goes at {history[f'speed_{name}'][-1]:.5g} m/s in the end")
        if parted.any():
            notes.append(f"plates parted first at t = {find_time(history, parted):.4g} s")
        return Report(head, rows, notes)

    def draw_flyer_target(self, figure, run_data) -> None:
        """The free surface's speed beside theory."""
        axis, theory = figure.subplots(), self.theory
        words = {"free_surface_speed": "computed"}
        draw_columns(axis, run_data.history, words, "free surface of the last plate [m/s]", "µs")
        if self.is_pair:
            end = theory.end if math.isfinite(theory.end) else theory.out
            t, trace = (0.0, theory.out, theory.out, end), (0.0, 0.0, theory.free, theory.free)
            words = "theory, until the release"
            axis.plot(1e6 * np.array(t), trace, "k--", lw=0.8, label=words)


def median(values: np.ndarray) -> float:
    """The median of a few numbers at least, else NaN."""
    return float(np.median(values)) if values.size > 3 else math.nan
