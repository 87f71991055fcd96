"""A flyer across a gap onto a target: impact, release, parting, the free surface's speed.

Plates of given materials stand in a row with gaps between them; the first one comes with a speed.
Where they meet a contact closes, and opens again where it would have to pull, so plates leave each
other by themselves (theory F16).  Measured are the mean speed of every plate and the speed of the
last plate's free surface, which a velocity interferometer would see.  Beside it stand the time of
impact, and, by the Hugoniots and the isentrope of each material, pressure and speed at the impact
and the speed of the free surface behind the first shock.

The trap: a release is sharp at low speeds, and the scheme spreads it over some cells; plates then
leave each other a little early.  Take cells of an eightieth of the thinnest plate or less.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos.materials import find_material
from hydro.rows import P, U
from hydro.simulation import Simulation
from problems.deck import MOST_CELLS, Deck, DeckTable, Regrid, RunControl
from problems.initial_states.rectangular_grids import make_plane_grid
from problems.problem import BlockPlan, Problem
from problems.references.hugoniot import shock_to_pressure
from problems.references.isentrope import make_isentrope
from regrid.errors import BadInput


class PlateTable(DeckTable, kw_only=True):
    """One plate of the row."""

    material: Annotated[str, Meta(description="name of a material, or FILE.toml:NAME")] = "Cu"
    thickness: Annotated[float, Meta(gt=0, le=1e3, description="[m]")] = 2e-3
    cells: Annotated[int, Meta(ge=2, le=MOST_CELLS, description="cells across it")] = 160
    gap: Annotated[
        float, Meta(ge=0, le=1e3, description="to the plate before it [m]; of the first: 0")
    ] = 0.0


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
    speed: Annotated[float, Meta(gt=0, le=1e5, description="of the first plate [m/s]")] = 1000.0
    plates: Annotated[
        tuple[PlateTable, ...], Meta(min_length=2, max_length=12, description="from left to right")
    ] = msgspec.field(default_factory=make_default_plates)
    rows: Annotated[int, Meta(ge=2, le=MOST_CELLS, description="cells along the plates")] = 2
    bond: Annotated[float, Meta(ge=0, le=1e20, description="tension that contacts hold [Pa]")] = 0.0


class FlyerTarget(Problem):
    """Plates in a row, between two walls along it."""

    Deck = FlyerTargetDeck
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
        self.height = deck.rows * min(cells)

    def plan(self):
        """End time and the plates."""
        deck = self.deck
        return deck.run.t_end, [
            BlockPlan(name, (plate.cells, deck.rows), (first, 0.0), (last, self.height))
            for name, plate, (first, last) in zip(self.names, deck.plates, self.ends, strict=True)
        ]

    def build(self) -> Simulation:
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
            for side in ("j_min", "j_max"):
                put(block, side, "wall")
            blocks.append(block)
        return Simulation(
            blocks,
            [],
            t_end=deck.run.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            make_regridder=lambda: deck.regrid.make(threads=deck.run.threads),
        )

    def measure(self, evolution: Simulation) -> dict[str, float]:
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

    def find_impact(self) -> tuple[float, float, float]:
        """Pressure and speed at the first impact; speed of a free surface behind the shock."""
        from scipy.optimize import brentq  # slow to load

        flyer, target = ((one.eos, one.rho0) for one in self.materials[:2])
        speed = self.deck.speed

        def excess(p: float) -> float:
            one, other = (shock_to_pressure(*body, 0.0, p) for body in (flyer, target))
            return one.particle_speed + other.particle_speed - speed

        scale = flyer[1] * speed * (float(flyer[0].sound_speed(flyer[1], 0.0)) + 2.0 * speed)
        p = brentq(excess, 1e-3 * scale, 10.0 * scale)
        shock = shock_to_pressure(*target, 0.0, p)
        release = make_isentrope(target[0], shock.rho, shock.p)
        gain = float(release.velocity_gain(0.0))
        return p, shock.particle_speed, shock.particle_speed + gain

    def summary(self, history, final) -> str:
        deck = self.deck
        p, u, free = self.find_impact()
        t, made = history["t"], history["contacts_made"]
        gap = deck.plates[1].gap
        lines = [
            f"flyer-target: {deck.plates[0].material} of {1e3 * deck.plates[0].thickness:g} mm at "
            f"{deck.speed:g} m/s, {len(deck.plates)} plates",
            f"  {'':31}{'computed':>12}{'theory':>12}{'difference':>13}",
        ]

        def compare(what: str, found: float, wanted: float) -> None:
            off = f"{100.0 * (found / wanted - 1.0):+.2f} %" if wanted else ""
            lines.append(f"  {what:31}{found:12.5g}{wanted:12.5g}{off:>13}")

        met = np.flatnonzero(made > 0)
        if met.size:
            before = float(t[met[0] - 1]) if met[0] > 0 else 0.0
            compare("time of impact [s]", before, gap / deck.speed)
            inside = (t > before) & (t < before + 0.7 * self._find_pulse(p))
            if inside.sum() > 3:
                late = history["contact_pressure"][inside]
                compare("pressure [GPa]", 1e-9 * float(np.median(late)), 1e-9 * p)
        if len(deck.plates) == 2:
            compare("free surface [m/s]", float(_find_plateau(history)), free)
            lines.append(f"  behind the impact both go at {u:.5g} m/s")
        for name in self.names:
            lines.append(f"  {name} goes at {history[f'speed_{name}'][-1]:.5g} m/s in the end")
        opened = history["contacts_opened"]
        apart = np.flatnonzero(opened > 0)
        if apart.size:
            lines.append(f"  plates parted first at t = {float(t[apart[0]]):.4g} s")
        return "\n".join(lines)

    def _find_pulse(self, p: float) -> float:
        """About the time until the flyer's release is back at the contact [s]."""
        material, plate = self.materials[0], self.deck.plates[0]
        shock = shock_to_pressure(material.eos, material.rho0, 0.0, p)
        c = float(material.eos.sound_speed(shock.rho, shock.p))
        return plate.thickness * (1.0 / shock.shock_speed + shock.rho_ahead / (shock.rho * c))

    def figures(self):
        return {"flyer-target": functools.partial(draw_speeds, self)}


def _find_plateau(history) -> float:
    """The speed at which the free surface stays longest of those above half of its greatest."""
    t, speed = history["t"], history["free_surface_speed"]
    most = float(np.nanmax(speed)) if speed.size else math.nan
    high = speed > 0.5 * most
    if not most > 0.0 or high.sum() < 2:
        return most
    counts, edges = np.histogram(speed[high], bins=60, weights=np.gradient(t)[high])
    best = int(counts.argmax())
    inside = high & (speed >= edges[max(best - 1, 0)]) & (speed <= edges[min(best + 2, 60)])
    return float(np.median(speed[inside]))


def draw_speeds(problem: FlyerTarget, figure, run_data) -> None:
    """The free surface's speed beside theory, and the mean speeds of all plates."""
    left, right = figure.subplots(1, 2)
    history = run_data.history
    t = 1e6 * history["t"]
    left.plot(t, history["free_surface_speed"], label="computed")
    _, _, free = problem.find_impact()
    if len(problem.deck.plates) == 2:
        left.axhline(free, color="k", lw=0.8, ls="--", label="theory")
    left.set_ylabel("free surface of the last plate [m/s]")
    left.legend()
    for name, plate in zip(problem.names, problem.deck.plates, strict=True):
        right.plot(t, history[f"speed_{name}"], label=f"{name}, {plate.material}")
    right.set_ylabel("mean speed [m/s]")
    right.legend()
    for panel in (left, right):
        panel.set_xlabel("t [µs]")
