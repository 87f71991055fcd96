"""Uniform flow on grids whose nodes are shaken at random every step: it has to stay uniform.

Two blocks lie side by side with a curved line between them, an interface of two materials or a
seam; left and right the stream flows through, below and above the domain is periodic or open too.
The grid drifts with the stream and every node but those of the interface is thrown about by a
fraction of a cell at every step.  Measured is the largest deviation from the stream, of density
and pressure relative to their own size, of velocity to the sound speed.

The trap: a law of motion for an interface has to move with the material, or the test itself
would push material through a line that lets none pass.
"""

from __future__ import annotations

import math
import struct
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import EquationOfState, IdealGas
from hydro.eos.materials import find_material
from hydro.links.join import join
from hydro.simulation import Simulation
from problems.deck import MOST_CELLS, Deck, RunControl
from problems.problem import Problem
from regrid.errors import BadInput

BEND = 0.1  # of the line between the blocks and of its neighbours, over the height of the domain


class FreeStreamDeck(Deck, kw_only=True):
    """Deck of `free-stream`; the defaults are two gases at Mach 0.6 between open sides."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(max_steps=100, t_end=1e9))
    materials: Annotated[
        tuple[str, str],
        Meta(description='of the two blocks: "gas" or a name of the material library'),
    ] = ("gas", "gas")
    contact: Annotated[
        Literal["interface", "seam"], Meta(description="what joins the two blocks")
    ] = "interface"
    sides: Annotated[
        Literal["periodic", "inflow"], Meta(description="the sides below and above")
    ] = "periodic"
    mach: Annotated[
        float, Meta(ge=0, le=1000, description="speed of the stream over the sound speed")
    ] = 0.6
    angle: Annotated[
        float, Meta(ge=-360, le=360, description="direction of the stream against x [degrees]")
    ] = 30.0
    shake: Annotated[
        float, Meta(ge=0, lt=0.3, description="largest displacement of a node, in cells")
    ] = 0.2
    cells: Annotated[
        int, Meta(ge=2, le=MOST_CELLS, description="cells of a block along x and along y")
    ] = 24
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, description="seed of the displacements")] = 1


class FreeStream(Problem):
    """Two shaken blocks in one stream."""

    Deck = FreeStreamDeck

    def __init__(self, deck: FreeStreamDeck):
        super().__init__(deck)
        self.fluids = [_make_fluid(name) for name in deck.materials]
        if deck.contact == "seam" and deck.materials[0] != deck.materials[1]:
            raise BadInput("deck: a seam joins blocks of one material; give both the same")
        self.pressure = 1e5
        self.sound_speed = float(self.fluids[0][0].sound_speed(self.fluids[0][1], self.pressure))
        turn = math.radians(deck.angle)
        speed = deck.mach * self.sound_speed
        self.velocity = (speed * math.cos(turn), speed * math.sin(turn))

    def make_nodes(self, t: float) -> np.ndarray:
        """All nodes (2, 2 cells + 1, cells + 1) at time t; a function of t, deck and seed alone."""
        deck = self.deck
        n = deck.cells
        x, y = np.meshgrid(np.linspace(-1.0, 1.0, 2 * n + 1), np.linspace(0.0, 1.0, n + 1))
        x, y = x.T, y.T
        nodes = np.array([x + BEND * (1.0 - x * x) * np.sin(2.0 * math.pi * y), y])
        (bits,) = struct.unpack("<Q", struct.pack("<d", t))
        random = np.random.default_rng([deck.seed, bits])
        shift = random.uniform(-deck.shake / n, deck.shake / n, nodes.shape)
        if deck.contact == "interface":
            shift[:, n] = 0.0
        if deck.sides == "periodic":
            shift[:, :, -1] = shift[:, :, 0]
        nodes += shift + t * np.reshape(self.velocity, (2, 1, 1))
        return nodes

    def make_block_nodes(self, name: str, t: float) -> np.ndarray:
        """Nodes of a block at time t: the law of motion."""
        n = self.deck.cells
        nodes = self.make_nodes(t)
        return nodes[:, : n + 1] if name == "left" else nodes[:, n:]

    def estimate_cells(self) -> int:
        return 2 * self.deck.cells**2

    def build(self) -> Simulation:
        deck = self.deck
        blocks = []
        for name, (eos, rho) in zip(("left", "right"), self.fluids, strict=True):
            material = "all" if deck.contact == "seam" else name
            blocks.append(
                Block(
                    name, eos, self.make_block_nodes(name, 0.0), rho, *self.velocity, self.pressure,
                    material=material,
                )
            )  # fmt: skip
        left, right = blocks
        links = [join(deck.contact, (left, "i_max"), (right, "i_min"))]
        for block, side in ((left, "i_min"), (right, "i_max")):
            self._open(block, side)
        for block in blocks:
            if deck.sides == "periodic":
                links.append(join("periodic", (block, "j_min"), (block, "j_max")))
            else:
                self._open(block, "j_min")
                self._open(block, "j_max")
        return Simulation(
            blocks,
            links,
            t_end=deck.run.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            mesh=self.make_block_nodes,
            measure_block=self.measure_deviation,
        )

    def _open(self, block: Block, side: str) -> None:
        rho = self.fluids[0 if block.name == "left" else 1][1]
        put(block, side, "inflow", state=(rho, *self.velocity, self.pressure))

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Largest deviation from the stream, over sizes of density, sound speed and pressure."""
        return {"deviation": max(worst for (worst,) in evolution.measured)}

    def watch(self, evolution):
        """Nothing: a block's deviation is found by who has the block."""
        return {}

    def measure_deviation(self, block: Block) -> tuple[float]:
        """Largest deviation of a block from the stream."""
        eos, density = self.fluids[0 if block.name == "left" else 1]
        rho, u, v, p = block.state[:, 1:-1, 1:-1]
        c = float(eos.sound_speed(density, self.pressure))
        stiffness = self.pressure if eos.kind == "ideal-gas" else density * c * c
        worst = 0.0
        for value, exact, size in (
            (rho, density, density),
            (u, self.velocity[0], c),
            (v, self.velocity[1], c),
            (p, self.pressure, stiffness),
        ):
            worst = max(worst, float(np.abs(value - exact).max()) / size)
        return (worst,)

    def summary(self, history, final) -> str:
        deck = self.deck
        return (
            f"uniform stream, Mach {deck.mach:g}, {' | '.join(deck.materials)}, {deck.contact}, "
            f"{deck.sides} sides, nodes shaken by {deck.shake:g} cells at every step:\n"
            f"  largest deviation in any step {np.nanmax(history['deviation']):.2e} "
            f"after {len(history['t']) - 1} steps (round-off: 1e-13 in 100)"
        )


def _make_fluid(name: str) -> tuple[EquationOfState, float]:
    """Equation of state and density of a block."""
    if name == "gas":
        return IdealGas(1.4), 1.0
    found = find_material(name)
    return found.eos, found.rho0
