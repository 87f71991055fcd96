"""Untangling: what it costs to mend grids that are folded, and what corners it leaves.

The last sides of named domains filled by transfinite interpolation, and a box of square cells whose
inner nodes were thrown about.  Times are process time on one thread, the least of several.

    python benchmarks/bench_grid_untangling.py [--cells 60x40] [--rounds 5]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from result_tables import Tables

from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.barrier.repair import repair_grid
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.measure.quality import compute_scaled_jacobians, find_bad_cells

DOMAINS = (
    "swan",
    "three_fingers",
    "five_fingers",
    "curled_fingers",
    "overhung_fingers",
    "hooked_fingers",
    "single_finger",
    "slender_finger",
    "chicane",
)
NOISE = (0.5, 1.0, 3.0)  # in cells


def make_folded(ni: int, nj: int):
    """Names and folded grids (2, ni+1, nj+1)."""
    for name in DOMAINS:
        yield name, transfinite_grid(make_domain(name, ni, nj).boundary(1.0))
    for noise in NOISE:
        nodes = np.array(np.meshgrid(np.arange(ni + 1.0), np.arange(nj + 1.0), indexing="ij"))
        inner = nodes[:, 1:-1, 1:-1]
        inner += noise * np.random.default_rng(3).normal(size=inner.shape)
        yield f"box, noise {noise:g}", nodes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", default="60x40")
    parser.add_argument("--rounds", type=int, default=5)
    tables = Tables(parser)
    arguments = tables.options
    ni, nj = (int(word) for word in arguments.cells.split("x"))
    for name, nodes in make_folded(ni, nj):
        least = np.inf
        for _ in range(arguments.rounds + 1):  # the first may compile
            begun = time.process_time()
            found = repair_grid(nodes)
            least = min(least, time.process_time() - begun)
        sine = compute_scaled_jacobians(found.nodes).min()
        bad = len(find_bad_cells(nodes))
        moved = found.report.projected_nodes
        tables.add(
            "untangling",
            grid=name,
            **{
                "cells not convex": bad,
                "untangled in, ms": 1e3 * least,
                "minimum scaled Jacobian then": float(sine),
                "nodes projected": moved,
            },
        )
    tables.write()


if __name__ == "__main__":
    main()
