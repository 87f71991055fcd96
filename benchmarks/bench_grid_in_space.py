"""Grids of hexahedra on moving blocks and on curved ones: validity, quality, cost of a step.

Moving blocks are marched by the barrier in equal steps from a box; every step is judged.  Costs are
process time of a step on one thread over the inner nodes, the median and the mean of all steps.
The curved blocks begin from the boolean sum of their faces, and the same faces are regridded until
no node moves by more than 1e-3 of a cell.

    python benchmarks/bench_grid_in_space.py [--sizes 20,40] [--steps 80]
"""

from __future__ import annotations

import argparse

import numpy as np
from result_tables import Tables

from shockgrid.regrid.domains_in_space import SHAPES, find_block, make_moving_block
from shockgrid.regrid.equidistribution.volumes import interpolate_faces
from shockgrid.regrid.hexahedra.regridder import BarrierRegridder3D
from shockgrid.regrid.measure.hexahedra import (
    compute_hexahedron_sines,
    compute_least_jacobian,
    compute_volumes,
    find_bad_hexahedra,
)
from shockgrid.runs.grids.making import march_in_space

BLOCKS = ("ks_block_1", "ks_block_2")
SETTLED = 1e-3
PASSES = 40


def march_blocks(tables: Tables, sizes: list[int], steps: int) -> None:
    """One row a moving block and size."""
    for name in SHAPES:
        for size in sizes:
            found = march_in_space(
                make_moving_block(name, (size,) * 3), BarrierRegridder3D(), steps
            )
            creased = int((~(compute_least_jacobian(found.nodes) > 0.0)).sum())
            bad = len(find_bad_hexahedra(found.nodes))
            tables.add(
                "moving in space",
                block=name,
                cells=f"{size}³",
                steps=found.done,
                **{
                    "cells with a corner not positive, all steps": bad,
                    "with a Jacobian not positive at 5³ places, at the end": creased,
                    "minimum scaled Jacobian": found.sine,
                    "sub-moves": found.sub_moves,
                    "untangling events": found.rescues,
                    "solver iterations": found.iterations,
                    "us per node and step": found.cost,
                    "mean": found.cost * np.mean(found.seconds) / np.median(found.seconds),
                },
            )


def settle_blocks(tables: Tables, sizes: list[int]) -> None:
    """One row a curved block and size."""
    for name in BLOCKS:
        for size in sizes:
            p = np.array(np.meshgrid(*[np.linspace(0.0, 1.0, size + 1)] * 3, indexing="ij"))
            boundary = find_block(name)(p)
            nodes = first = interpolate_faces(boundary)
            cell = np.cbrt(abs(compute_volumes(first)).mean())
            passes = 0
            moved = np.inf
            while moved > SETTLED * cell and passes < PASSES:
                found = BarrierRegridder3D().regrid(nodes, boundary).nodes
                moved = float(np.abs(found - nodes).max())
                nodes = found
                passes = passes + 1
            tables.add(
                "settled in space",
                block=name,
                cells=f"{size}³",
                passes=passes,
                **{
                    "bad cells": len(find_bad_hexahedra(nodes)),
                    "minimum scaled Jacobian of the boolean sum": float(
                        compute_hexahedron_sines(first).min()
                    ),
                    "of the barrier": float(compute_hexahedron_sines(nodes).min()),
                },
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="20,40")
    parser.add_argument("--steps", type=int, default=80)
    tables = Tables(parser)
    sizes = [int(word) for word in tables.options.sizes.split(",")]
    march_blocks(tables, sizes, tables.options.steps)
    settle_blocks(tables, sizes)
    tables.write()


if __name__ == "__main__":
    main()
