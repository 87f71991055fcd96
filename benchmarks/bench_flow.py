"""Speed of the flow step: million cell updates a CPU second, with and without regridding.

A shock crosses a plane interface between two blocks (ideal gas) or two halves of one metal
(Mie–Grüneisen).  Rows: the bare kernel of one block, whole steps on a fixed mesh, whole steps with
the grid rebuilt every step; then two threads against one.  Each figure is the best and the median
of several timings in one process, after the kernels are compiled.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numba
import numpy as np
from result_tables import Tables

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas, MieGruneisen
from hydro.links.join import join
from hydro.simulation import Simulation
from regrid.registry import make_regridder

EQUATIONS = {
    "ideal gas": (IdealGas(1.4), 1.0, 1.0, 0.3),
    "Mie-Gruneisen": (MieGruneisen(), 2707.0, 1.0e9, 100.0),
}


def make_simulation(eos, rho, p, speed, cells: int, mesh: str, threads: int) -> Simulation:
    """Two blocks side by side, cells × cells together, a smooth flow and a moving interface."""
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


def time_calls(call, repeats: int, rounds: int, clock=time.process_time) -> list[float]:
    """Seconds a call by `clock` (CPU, unless several threads are timed), one figure a round."""
    call()
    found = []
    for _ in range(rounds):
        start = clock()
        for _ in range(repeats):
            call()
        found.append((clock() - start) / repeats)
    return found


def count_updates(cells: int, seconds: list[float]) -> dict[str, float]:
    """Best and median million cell updates a second."""
    best, middle = min(seconds), statistics.median(seconds)
    return {"best, million/s": cells / best / 1e6, "median, million/s": cells / middle / 1e6}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sizes", type=int, nargs="*", default=[200, 400])
    parser.add_argument("--rounds", type=int, default=5)
    tables = Tables(parser)
    options = tables.options
    for name, setup in EQUATIONS.items():
        for size in options.sizes:
            cells, repeats = size * size, max(3, 2_000_000 // (size * size))
            case = f"{name}, {size}²"
            simulation = make_simulation(*setup, size, "fixed", 1)
            simulation.advance()
            block = simulation.blocks[0]
            dt = 1e-3 * simulation.dt

            def add(what: str, count: int, seconds: list[float], case=case) -> None:
                tables.add("flow", case=case, what=what, **count_updates(count, seconds))

            kernel = time_calls(lambda b=block, d=dt: b.update(d), repeats, options.rounds)
            add("flow kernel of one block", cells // 2, kernel)
            fixed = time_calls(simulation.advance, repeats, options.rounds)
            add("whole step, fixed mesh", cells, fixed)
            moving = make_simulation(*setup, size, "regrid", 1)
            rebuilt = time_calls(moving.advance, repeats // 2 + 1, options.rounds)
            add("whole step, grid rebuilt", cells, rebuilt)
            row = moving.advance()
            parts = {key[8:]: row[key] for key in row if key.startswith("seconds_")}
            total = sum(parts.values())
            shares = {f"{part}, %": 100.0 * value / total for part, value in parts.items()}
            arrays = [v for b in simulation.blocks for v in vars(b).values()]
            held = sum(a.nbytes for a in arrays if isinstance(a, np.ndarray))
            tables.add("flow-parts", case=case, **shares, **{"bytes a cell": round(held / cells)})
            if numba.config.NUMBA_NUM_THREADS < 2:
                continue
            pair = make_simulation(*setup, size, "regrid", 2)
            wall = time.perf_counter
            one = time_calls(moving.advance, repeats // 2 + 1, options.rounds, wall)
            two = time_calls(pair.advance, repeats // 2 + 1, options.rounds, wall)
            gain = min(one) / min(two)
            tables.add("flow-threads", case=case, **{"two threads over one, wall time": gain})
    tables.write()


if __name__ == "__main__":
    main()
