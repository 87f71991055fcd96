"""What a sliding contact costs: time a cell and step against blocks joined node to node.

Two gases on a plane contact, one of which slips and is squeezed by a piston, so that every line
moves and every grid is rebuilt.  The blocks are n × n/2 cells each; sliding is timed with equal
nodes and with the follower's a sixth fewer.  Each figure is the best and the median of several
timings in one process, after the kernels are compiled, the three cases taking turns.

Then the part of a step that the logic of the running contact point takes in `plate-on-wedge`:
finding the point, and the spacing laws around it.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np
from result_tables import Tables

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.plate_on_wedge.problem import PlateOnWedge, PlateOnWedgeDeck

CASES = ("interface", "sliding, equal nodes", "sliding")


def make_simulation(case: str, cells: int) -> Simulation:
    """Lower block under a piston, upper one slipping on it; periodic along the contact."""
    blocks = []
    counts = cells, cells - cells // 6 if case == "sliding" else cells
    for name, n, low, speed in zip(("low", "high"), counts, (-0.5, 0.0), (0.0, 0.3), strict=True):
        spans = np.linspace(0.0, 1.0, n + 1), np.linspace(low, low + 0.5, cells // 2 + 1)
        nodes = np.array(np.meshgrid(*spans, indexing="ij"))
        blocks.append(Block(name, IdealGas(1.4), nodes, 1.0, speed, 0.0, 1.0))
    low, high = blocks
    sides = (low, "j_max"), (high, "j_min")
    links = [join("interface", *sides) if case == "interface" else slide(*sides)]
    links += [join("periodic", (block, "i_min"), (block, "i_max")) for block in blocks]
    put(low, "j_min", "piston", velocity=(0.0, 0.2))
    put(high, "j_max", "wall")
    return Simulation(blocks, links, t_end=1e9)


def time_cases(cells: int, steps: int, rounds: int) -> dict[str, list[float]]:
    """CPU nanoseconds a cell and step of every case, one figure a round."""
    found = {}
    runs = {case: make_simulation(case, cells) for case in CASES}
    for simulation in runs.values():
        for _ in range(6):
            simulation.advance()
    for _ in range(rounds):
        for case, simulation in runs.items():
            start = time.process_time()
            for _ in range(steps):
                simulation.advance()
            passed = (time.process_time() - start) / steps
            count = sum(block.ni * block.nj for block in simulation.blocks)
            found.setdefault(case, []).append(1e9 * passed / count)
    return found


def measure_contact_point(cells: tuple[int, int]) -> float:
    """Part of the CPU time of steps with a running contact point that its own logic takes."""
    run = PlateOnWedge(PlateOnWedgeDeck(cells=cells)).build()
    while not run.times["attached"] < run.t - 1e-7:
        run.advance()
    spent = 0.0

    def clock(call):
        def clocked(*arguments):
            nonlocal spent
            start = time.process_time()
            found = call(*arguments)
            spent += time.process_time() - start
            return found

        return clocked

    follower = run.motion.sides.followers[0]
    for name in ("share_nodes", "_find_contact_point"):
        setattr(follower, name, clock(getattr(follower, name)))
    start = time.process_time()
    for _ in range(200):
        run.advance()
    return spent / (time.process_time() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sizes", type=int, nargs="*", default=[60, 120, 240])
    parser.add_argument("--rounds", type=int, default=7)
    tables = Tables(parser)
    options = tables.options
    for size in options.sizes:
        found = time_cases(size, max(4, 400_000 // (size * size)), options.rounds)
        base = min(found["interface"])
        for case, seconds in found.items():
            best = min(seconds)
            tables.add(
                "sliding",
                cells=f"{size}²",
                contact=case,
                **{
                    "best, ns per cell and step": best,
                    "median": statistics.median(seconds),
                    "more than node to node, %": 100.0 * (best / base - 1.0),
                },
            )
    for cells in ((80, 24), (160, 48)):
        part = 100.0 * min(measure_contact_point(cells) for _ in range(3))
        tables.add(
            "contact-point",
            **{"plate-on-wedge": f"{cells[0]} × {cells[1]}", "contact point, % of a step": part},
        )
    tables.write()


if __name__ == "__main__":
    main()
