"""A driven plate is thrown onto a wedge: a contact point runs along its face, a jet follows.

The plate lies on the flat edge of the wedge body; beside it the wedge's face slopes away at
`angle`.  A shock from the drive reaches the plate's free lower side, which flies into the gap
with about twice the particle speed and closes it from the edge outwards: the contact point A
runs along the face.  With a `gap` the plate starts above the edge: two bodies, whose contact closes
and opens by itself.  Below a critical angle the oblique shocks stay attached to A and there is no
jet; above it a jet runs ahead of A.  When A reaches the end B of the face the shocks detach and a
thin jet leaves over B and bends round the end face.  Plate and wedge slide on each other; both
grids follow the contact line, with non-matching nodes.

The history has the phases and their times.  The run ends when the jet meets something (the end
face, the base on which the wedge stands, the symmetry plane) or when the free surface meets itself.
References: shock polars of both materials, the critical angle, Birkhoff's jet.
"""

from __future__ import annotations

import functools

import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from hydro.links import join, slide
from problems.plate_on_wedge.run import PlateRun
from problems.plate_on_wedge.set_up import PlateSetUp
from problems.problem import Report

# Less than elsewhere: cells of the wedge's tongue behind B are as thin as its sides make them.
COST_WEIGHT = 0.3


class PlateOnWedge(PlateSetUp):
    """Plate, wedge, drive: how they are built, run and measured."""

    measures_sides = True  # jet and shocks are found by who has the block

    def build(self) -> PlateRun:
        deck, drive = self.deck, self.deck.drive
        plate_nodes, wedge_nodes, on_edge = self.make_grids()
        speed = -drive.speed if drive.kind == "moving" else 0.0
        plate = self.make_block("plate", plate_nodes, (0.0, speed))
        wedge = self.make_block("wedge", wedge_nodes)
        blocks = [plate, wedge]
        edge, face = (
            self.turn_faces(wedge, "j_max", 0, on_edge),
            self.turn_faces(wedge, "j_max", on_edge),
        )
        links = []
        if deck.gap:
            for body, side, start, stop in (edge, face):
                put(body, side, "free-surface", start, stop)
            self.put("free-surface", plate, "j_min")
        else:
            master = [face, edge] if deck.mirror else [edge, face]
            links = [slide(master, self.turn_faces(plate, "j_min", 0, self.contact))]
            self.put("free-surface", plate, "j_min", self.contact)
        links += self._drive(plate, blocks)
        for block in blocks:
            self.put("wall", block, "i_min")
            if block.name != "wedge":
                end = "wall" if deck.right == "symmetry" else "free-surface"
                self.put(end, block, "i_max")
        self.put("free-surface", wedge, "i_max")
        self.put("wall", wedge, "j_min")
        weights = {"cost_weight": COST_WEIGHT} if deck.regrid.name.startswith("barrier") else {}
        return self.simulate(
            blocks,
            links,
            kind=functools.partial(PlateRun, self),
            make_regridder=lambda: deck.regrid.make(threads=deck.run.threads, **weights),
        )

    def _drive(self, plate: Block, blocks: list[Block]) -> list:
        """Put the drive on the plate's back; returns links, adds a flyer to the blocks."""
        drive = self.deck.drive
        strength = _interpolate(drive.history)
        if drive.kind == "piston":
            velocity = self.frame @ (0.0, -drive.speed)
            self.put("piston", plate, "j_max", velocity=lambda t: tuple(strength(t) * velocity))
        elif drive.kind == "pressure":
            self.put(
                "free-surface", plate, "j_max", pressure=lambda t: strength(t) * drive.pressure
            )
        elif drive.kind == "moving":
            self.put("free-surface", plate, "j_max")
        else:
            x, _, _ = self.make_lines()
            rows = max(4, round(drive.thickness / self.deck.thickness * self.deck.cells[1]))
            y = self.deck.gap + self.deck.thickness + np.linspace(0.0, drive.thickness, rows + 1)
            nodes = np.array(np.meshgrid(x, y, indexing="ij"))
            flyer = self.make_block(
                "flyer", nodes, (0.0, -drive.speed), find_material(drive.material)
            )
            blocks.append(flyer)
            self.put("free-surface", flyer, "j_max")
            return [
                join("interface", self.turn_faces(plate, "j_max"), self.turn_faces(flyer, "j_min"))
            ]
        return []

    def measure(self, evolution: PlateRun) -> dict[str, float]:
        return evolution.measure()

    def cautions(self, history=None) -> list[str]:
        from problems.plate_on_wedge.report import find_cautions

        return find_cautions(self)

    def report(self, history, final=None) -> Report:
        from problems.plate_on_wedge.report import make_summary

        return Report((lambda: make_summary(self, history, final)) if history else "")

    def figures(self):
        from problems.plate_on_wedge.pictures import FIGURES

        return {name: functools.partial(draw, self) for name, draw in FIGURES.items()}


def _interpolate(history):
    """Part of the full drive at a time: straight lines between the pairs, 1 without any."""
    if not history:
        return lambda t: 1.0
    times, parts = (np.array(column) for column in zip(*history, strict=True))
    return lambda t: float(np.interp(t, times, parts))
