"""ED3 on the curved blocks: how far it gets, and nanoseconds a node and iteration.

For each block, weight and size: the spread (standard deviation over the mean) of weight times
volume at the start and after 100 iterations, whether it fell in every one of them, and the least
corner sine; once with the faces' nodes at equal steps of the parameters, once with edges and faces
equidistributed too.  Costs are process time of the volume's iterations on one thread, the least of
several: with the weight as an array of the cells, and evaluated anew in every iteration.

    python benchmarks/bench_grid_blocks.py [--sizes 20,40] [--rounds 3]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from result_tables import Tables

from shockgrid.regrid.domains_in_space import find_block
from shockgrid.regrid.equidistribution.volumes import equidistribute_block, solve_ed3
from shockgrid.regrid.equidistribution.weights import make_position_weight, weigh_points
from shockgrid.regrid.measure.corners import compute_hexahedron_centres
from shockgrid.regrid.measure.hexahedra import compute_hexahedron_sines, find_bad_hexahedra

BLOCKS = ("ks_block_1", "ks_block_2")
WEIGHTS = ("1", "1+10*(z+1)")
ITERATIONS = 100


def time_iterations(nodes, weight, rounds: int) -> float:
    """Nanoseconds a node and iteration of `solve_ed3`, its own tests of the corners included."""
    least = np.inf
    for _ in range(rounds + 1):  # the first may compile
        begun = time.process_time()
        done = solve_ed3(nodes, weight, ITERATIONS, 0.0).residuals.size - 1
        least = min(least, (time.process_time() - begun) / done)
    return 1e9 * least / nodes[0].size


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="20,40")
    parser.add_argument("--rounds", type=int, default=3)
    tables = Tables(parser)
    arguments = tables.options
    for name in BLOCKS:
        for text in WEIGHTS:
            weight = 1.0 if text == "1" else make_position_weight(text, ("x", "y", "z"))
            for size in (int(word) for word in arguments.sizes.split(",")):
                for sides in (False, True):
                    shape = (size, size, size)
                    found = equidistribute_block(
                        find_block(name), shape, weight, ITERATIONS, sides=sides
                    )
                    falls = bool((np.diff(found.spreads) < 0.0).all())
                    values = weigh_points(weight, compute_hexahedron_centres(found.nodes))
                    costs = [
                        time_iterations(found.nodes, w, arguments.rounds) for w in (values, weight)
                    ]
                    sine = compute_hexahedron_sines(found.nodes).min()
                    tables.add(
                        "blocks",
                        block=name,
                        weight=text,
                        cells=f"{size}³",
                        **{
                            "edges and faces": "equidistributed" if sides else "equal steps",
                            "spread at the start": float(found.spreads[0]),
                            "after": float(found.spreads[found.best]),
                            "fell in every iteration": "yes" if falls else "no",
                            "bad cells": len(find_bad_hexahedra(found.nodes)),
                            "minimum scaled Jacobian": float(sine),
                            "ns per node, weight as an array": costs[0],
                            "weight as a formula": costs[1],
                        },
                    )
    tables.write()


if __name__ == "__main__":
    main()
