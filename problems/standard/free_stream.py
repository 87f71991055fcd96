"""Uniform flow on grids whose nodes are shaken at random every step: it has to stay uniform.

Two blocks lie side by side with a curved line between them, an interface of two materials or a
seam; left and right the stream flows through, below and above the domain is periodic or open too.
The grid drifts with the stream and every node but those of the interface is thrown about by a
fraction of a cell at every step.  The problem measures the largest deviation from the stream: of
density and pressure relative to their values, of velocity relative to the sound speed.

Note: the given motion of an interface must be that of the material, or the test itself would
push material through a line that lets none pass.
"""

import math
import struct
from typing import Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join
from shockgrid.problems.deck import MOST_CELLS, Deck, RunControl, key
from shockgrid.problems.initial_states import make_plane_grid
from shockgrid.problems.problem import Problem
from shockgrid.problems.report import Report, Row

# of the line between the blocks and of its neighbours, over the height of the domain
LINE_BEND_PART = 0.1
FREE_STREAM_PRESSURE = 1e5


class FreeStreamDeck(Deck, kw_only=True):
    run: RunControl = RunControl(max_steps=100, t_end=1e9)
    materials: key(tuple[str, str], '"gas" or a name of the material library') = ("gas", "gas")
    contact: key(Literal["interface", "seam"], "what joins the two blocks") = "interface"
    sides: key(Literal["periodic", "inflow"], "the sides below and above") = "periodic"
    mach: key(float, "speed of the stream over the sound speed", ge=0, le=1000) = 0.6
    angle: key(float, "direction of the stream against x [degrees]", ge=-360, le=360) = 30.0
    shake: key(float, "largest displacement of a node, in cells", ge=0, lt=0.3) = 0.2
    cells: key(int, "cells of a block along x and along y", ge=2, le=MOST_CELLS) = 24
    seed: key(int, "seed of the displacements", ge=0, le=2**63 - 1) = 1


class FreeStream(Problem):
    Deck = FreeStreamDeck

    def __init__(self, deck: FreeStreamDeck):
        super().__init__(deck)
        self.fluids = {}  # equation of state and density by block
        for block, name in zip(("left", "right"), deck.materials, strict=True):
            found = None if name == "gas" else find_material(name)
            self.fluids[block] = (found.eos, found.rho0) if found else (IdealGas(1.4), 1.0)
        two = deck.contact == "seam" and self.fluids["left"] != self.fluids["right"]
        if two:
            raise deck.error("materials", "a seam joins blocks of one")
        eos, rho = self.fluids["left"]
        turn = math.radians(deck.angle)
        speed = deck.mach * float(eos.sound_speed(rho, FREE_STREAM_PRESSURE))
        self.velocity = speed * math.cos(turn), speed * math.sin(turn)

    def make_grids(self, t=0.0):
        """Cut from the nodes of both; a function of t, deck and seed."""
        deck = self.deck
        n = self.deck.cells
        x, y = make_plane_grid(np.linspace(-1.0, 1.0, 2 * n + 1), np.linspace(0.0, 1.0, n + 1))
        nodes = np.array([x + LINE_BEND_PART * (1.0 - x * x) * np.sin(2.0 * math.pi * y), y])
        (bits,) = struct.unpack("<Q", struct.pack("<d", t))
        random = np.random.default_rng([deck.seed, bits])
        shift = random.uniform(-deck.shake / n, deck.shake / n, nodes.shape)
        if deck.contact == "interface":
            shift[:, n] = 0.0
        if deck.sides == "periodic":
            shift[:, :, -1] = shift[:, :, 0]
        nodes += shift + t * np.reshape(self.velocity, (2, 1, 1))
        return {"left": nodes[:, : n + 1], "right": nodes[:, n:]}

    def estimate_cells(self) -> int:
        return 2 * self.deck.cells**2

    def build(self):
        deck = self.deck
        grids = self.make_grids()
        blocks = []
        links = []
        for name, (eos, rho) in self.fluids.items():
            stream = rho, *self.velocity, FREE_STREAM_PRESSURE
            material = "all" if deck.contact == "seam" else name
            block = Block(name, eos, grids[name], *stream, material=material)
            if deck.sides == "periodic":
                links.append(join("periodic", (block, "j_min"), (block, "j_max")))
            across = ("j_min", "j_max") if deck.sides == "inflow" else ()
            for side in ("i_min" if name == "left" else "i_max", *across):
                put(block, side, "inflow", state=stream)
            blocks.append(block)
        links.insert(0, join(deck.contact, (blocks[0], "i_max"), (blocks[1], "i_min")))
        return self.simulate(blocks, links, mesh="given")

    def measure(self, evolution) -> dict[str, float]:
        """Largest deviation from the stream, over sizes of density, sound speed and pressure."""
        return {"deviation": max(map(self.measure_deviation, evolution.blocks))}

    def measure_deviation(self, block: Block) -> float:
        """Largest deviation of a block from the stream."""
        eos, density = self.fluids[block.name]
        c = float(eos.sound_speed(density, FREE_STREAM_PRESSURE))
        stiffness = FREE_STREAM_PRESSURE if eos.kind == "ideal-gas" else density * c * c
        exact = np.reshape((density, *self.velocity, FREE_STREAM_PRESSURE), (4, 1, 1))
        off = np.abs(block.state[:, 1:-1, 1:-1] - exact).max(axis=(1, 2))
        return float((off / (density, c, c, stiffness)).max())

    def report(self, run) -> Report:
        deck = self.deck
        label = f"largest deviation, {run.history['deviation'].size - 1} steps"
        most = run.most("deviation")
        row = Row("largest_deviation", most, label=label, digits=3)
        head = (
            f"uniform stream, Mach {deck.mach:g}, {' | '.join(deck.materials)}, {deck.contact}, "
            f"{deck.sides} sides, nodes shaken by {deck.shake:g} cells at every step:"
        )
        return Report(head, [row], ["round-off makes 1e-13 in 100 steps"])
