"""Speed of the flow step: cell updates a CPU second, with and without the grid rebuilt.

A shock crosses a plane interface between two blocks of an ideal gas or two halves of one metal
(Mie–Grüneisen), in a square of cells.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numba
import numpy as np

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import EquationOfState, IdealGas, MieGruneisen
from hydro.history import PHASES
from hydro.links.join import join
from hydro.simulation import Simulation
from regrid.registry import make_regridder
from runs.bench.peer import Peer
from runs.bench.rounds import time_rounds
from runs.bench.tables import Tables

# equation of state, density, pressure and speed of the flow
MATERIALS: dict[str, tuple[EquationOfState, float, float, float]] = {
    "ideal gas": (IdealGas(1.4), 1.0, 1.0, 0.3),
    "Mie-Gruneisen": (MieGruneisen(), 2707.0, 1.0e9, 100.0),
}
UPDATES = 2_000_000  # cell updates of a timing, or three steps
LONGEST = 4  # steps of all timings over the cells of a side: later the piston comes too close


def make_simulation(material: str, cells: int, mesh: str, threads: int) -> Simulation:
    """Two blocks side by side, cells × cells together, a smooth flow and a moving interface."""
    eos, rho, p, speed = MATERIALS[material]
    blocks = []
    for name, start in (("left", 0.0), ("right", 0.5)):
        x = np.linspace(start, start + 0.5, cells // 2 + 1)
        y = np.linspace(0.0, 1.0, cells + 1)
        nodes = np.array(np.meshgrid(x, y, indexing="ij"))
        centre = 0.5 * (x[1:] + x[:-1])[:, None]
        u = np.where(centre < 0.4, speed, 0.0) * np.ones(cells)
        blocks.append(Block(name, eos, nodes, rho, u, 0.0, p))
    left, right = blocks
    kind = "seam" if mesh == "fixed" else "interface"
    links = [join(kind, (left, "i_max"), (right, "i_min"))]
    if mesh == "fixed":
        put(left, "i_min", "wall")
    else:
        put(left, "i_min", "piston", velocity=(0.5 * speed, 0.0))
    put(right, "i_max", "wall")
    for block in blocks:
        put(block, "j_min", "wall")
        put(block, "j_max", "wall")
    return Simulation(
        blocks,
        links,
        t_end=1e9,
        mesh=mesh,
        threads=threads,
        make_regridder=lambda: make_regridder("barrier", threads=threads),
    )


def count_steps(cells: int, rounds: int) -> int:
    """Steps of one timing at cells × cells."""
    return max(1, min(max(3, UPDATES // (cells * cells)), LONGEST * cells // rounds))


def measure_flow(tables: Tables, cells: int, rounds: int, peer: Peer | None) -> None:
    """Tables `flow`, `flow-parts` and `flow-threads` at cells × cells."""
    repeats = count_steps(cells, rounds)
    for name in MATERIALS:
        fixed = make_simulation(name, cells, "fixed", 1)
        fixed.advance()
        block, dt = fixed.blocks[0], 1e-3 * fixed.dt
        block.predict(dt)  # the new state's ghosts: cells of zeros would all ask for HLL
        moving = make_simulation(name, cells, "regrid", 1)
        cases: dict[str, tuple[Callable[[], object], int, int]] = {
            "flow kernel of one block": (
                lambda b=block, d=dt: b.update(d),
                block.ni * block.nj,
                repeats,
            ),
            "whole step, fixed mesh": (fixed.advance, cells * cells, repeats),
            "whole step, grid rebuilt": (moving.advance, cells * cells, (repeats + 1) // 2),
        }
        for what, (call, count, times) in cases.items():
            call()
            found = time_rounds(call, count, times, rounds, peer)
            tables.add("flow", case=f"{name}, {cells}²", what=what, **found)
        row = moving.advance()
        parts = {part: row[f"seconds_{part}"] for part in PHASES}
        shares = {f"{part}, %": 100.0 * v / sum(parts.values()) for part, v in parts.items()}
        arrays = [v for b in fixed.blocks for v in vars(b).values() if isinstance(v, np.ndarray)]
        held = round(sum(a.nbytes for a in arrays) / cells**2)
        tables.add("flow-parts", case=f"{name}, {cells}²", **shares, **{"bytes a cell": held})


def measure_threads(tables: Tables, sizes: tuple[int, ...], rounds: int) -> None:
    """Table `flow-threads`: two threads over one, by the clock on the wall."""
    if numba.config.NUMBA_NUM_THREADS < 2:
        return
    for cells in sizes:
        best = []
        simulations = [make_simulation("ideal gas", cells, "regrid", n) for n in (1, 2)]
        for simulation in simulations:
            simulation.advance()
        repeats = count_steps(cells, rounds)
        for simulation in simulations * rounds:
            start = time.perf_counter()
            for _ in range(repeats):
                simulation.advance()
            best.append(time.perf_counter() - start)
        gain = min(best[0::2]) / min(best[1::2])
        tables.add(
            "flow-threads", case=f"ideal gas, {cells}²", **{"two threads over one, wall time": gain}
        )
