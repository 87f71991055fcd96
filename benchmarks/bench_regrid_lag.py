"""How far marched grids lag behind the converged ones, with and without the coarse correction.

Domains are marched at half a cell a step, both ways in turn, step by step.  Half way and at the end
each grid is compared with the converged one: many Newton steps on the same sides, solved down to
round-off, the later ones halved, since weights of sharp cells may swing.  A node's lag is its
distance from its converged place over the shortest edge there.

    python benchmarks/bench_regrid_lag.py [--sizes 60x40,240x160] [--domains three_fingers,strip]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from result_tables import Tables

from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.tuning import DEFAULT
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.protocol import RegridReport

DOMAINS = ("three_fingers", "curled_fingers", "single_finger", "strip", "chicane")
SIZES = "60x40,120x80,240x160"
WAYS = {"with": DEFAULT.coarse_from, "without": np.inf}
# Newton steps of the converged grid; its last step, in cells
MOST_STEPS = 40
SETTLED = 2e-3


def measure_lag(nodes: np.ndarray, converged: np.ndarray) -> np.ndarray:
    """Distance of the nodes (2, ni+1, nj+1) from those of `converged`, over its shortest edges."""
    shortest = np.full(nodes.shape[1:], np.inf)
    for axis in (0, 1):
        edges = np.hypot(*np.diff(converged, axis=axis + 1))
        near = [slice(None)] * 2
        far = [slice(None)] * 2
        near[axis] = slice(None, -1)
        far[axis] = slice(1, None)
        for side in (tuple(near), tuple(far)):
            shortest[side] = np.minimum(shortest[side], edges)
    return np.hypot(*(nodes - converged)) / shortest


def converge(nodes: np.ndarray) -> tuple[np.ndarray, float]:
    """The grid that Newton steps on the sides of `nodes` come to, and the last step in cells."""
    regridder = BarrierRegridder(tolerance=1e-3, floor=1e-10, max_iterations=40, coarse_from=0)
    moved = np.inf
    for step in range(MOST_STEPS):
        new = regridder.regrid(nodes, nodes).nodes
        moved = float(measure_lag(new, nodes).max())
        nodes = new if step < 2 else 0.5 * (nodes + new)
        if moved < SETTLED:
            break
    return nodes, moved


class Way:
    """One march of a domain, and what it took."""

    def __init__(self, moving, coarse_from: float):
        self.regridder = BarrierRegridder(coarse_from=coarse_from)
        self.nodes = moving.start
        self.seconds = 0.0
        self.reports = list[RegridReport]()
        self.lag: list[np.ndarray] = []

    def go(self, boundary: np.ndarray) -> None:
        begun = time.process_time()
        result = self.regridder.regrid(self.nodes, boundary)
        self.seconds += time.process_time() - begun
        self.nodes = result.nodes
        self.reports.append(result.report)


def march(tables: Tables, name: str, ni: int, nj: int) -> None:
    """Both marches of a domain at once, and their lags half way and at the end."""
    moving = make_domain(name, ni, nj)
    count = moving.suggested_steps
    ways = {word: Way(moving, least) for word, least in WAYS.items()}
    for step in range(1, count + 1):
        boundary = moving.boundary(step / count)
        for way in ways.values():
            way.go(boundary)
        if step in (count // 2, count):
            converged, moved = converge(ways["with"].nodes)
            for way in ways.values():
                way.lag.append(measure_lag(way.nodes, converged))
    for word, way in ways.items():
        cost = 1e6 * way.seconds / (count * (ni - 1) * (nj - 1))
        tables.add(
            "regrid-lag",
            domain=name,
            cells=f"{ni} × {nj}",
            correction=word,
            steps=count,
            **{
                "lag half way, cells": float(way.lag[0].max()),
                "lag at the end, cells": float(way.lag[1].max()),
                "mean square, cells": float(np.sqrt(np.mean(way.lag[1] ** 2))),
                "last step of the converged grid": moved,
                "us per node and step": cost,
                "iterations per step": sum(r.iterations for r in way.reports) / count,
                "sub-moves": sum(r.sub_moves for r in way.reports),
                "untangling events": sum(r.rescues for r in way.reports),
            },
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default=SIZES)
    parser.add_argument("--domains", default=",".join(DOMAINS))
    tables = Tables(parser)
    warm_up()
    for size in tables.options.sizes.split(","):
        ni, nj = (int(count) for count in size.split("x"))
        for name in tables.options.domains.split(","):
            march(tables, name, ni, nj)
    tables.write()


def warm_up() -> None:
    """Both solves once, outside the clock."""
    moving = make_domain("three_fingers", 60, 40)
    for least in (0, np.inf):
        BarrierRegridder(floor=0.0, coarse_from=least).regrid(moving.start, moving.boundary(0.01))


if __name__ == "__main__":
    main()
