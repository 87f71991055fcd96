"""Speed of the barrier regridder: nanoseconds a node for its parts and for whole regrids.

The three-finger domain is marched half way at half a cell a step; from there the boundary moves by
a part of a cell.  Each figure is the least of several timings (others may share the machine).

    python benchmarks/bench_regrid.py [--sizes 60x40,120x80,240x160] [--threads 1,2]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from result_tables import Tables

from shockgrid.regrid.barrier import newton_move
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.sweeps import Sweeps
from shockgrid.regrid.barrier.workspace import Workspace
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.marching import march_domain
from shockgrid.regrid.measure.quality import find_bad_cells

MARCHES = (
    "three_fingers",
    "curled_fingers",
    "overhung_fingers",
    "single_finger",
    "slender_finger",
    "strip",
    "jet",
    "dome",
)
MARCH_SIZES = {"jet": ((40, 120),), "strip": ((120, 40), (240, 80))}
MOVES = (0.02, 0.1, 0.5)  # boundary motion in cells


def least_seconds(call, rounds: int = 15, budget: float = 0.02) -> float:
    call()
    begin = time.perf_counter()
    call()
    repeats = max(1, int(budget / (time.perf_counter() - begin)))
    best = np.inf
    for _ in range(rounds):
        begin = time.perf_counter()
        for _ in range(repeats):
            call()
        best = min(best, (time.perf_counter() - begin) / repeats)
    return best


def time_parts(tables: Tables, ni: int, nj: int) -> None:
    """Nanoseconds an inner node of the regrid's parts, one thread."""
    inner = (ni - 1) * (nj - 1)
    nodes = np.array(np.mgrid[0 : ni + 1, 0 : nj + 1], dtype=float)
    nodes += np.random.default_rng(0).uniform(-0.1, 0.1, nodes.shape)
    work = Workspace(ni, nj, 1)
    work.old[:] = work.sides[:] = nodes
    work.begin(True, 0.9, 0.1)
    parts = {
        "move and look": work.check_displaced_grid,
        "corner test": lambda: work.compare_corners(nodes, work.old),
        "assembly": lambda: work.assemble(nodes),
        "start of the solve": lambda: work.solve(0.0, 0.0, 0),
    }
    cost = {name: least_seconds(call) / inner for name, call in parts.items()}
    ten = least_seconds(lambda: work.solve(0.0, 0.0, 10)) / inner
    cost["one CG iteration"] = (ten - cost["start of the solve"]) / 10.0
    parts = {f"{name}, ns per node": 1e9 * seconds for name, seconds in cost.items()}
    tables.add("regrid-parts", cells=f"{ni} × {nj}", **parts)


def time_moves(tables: Tables, ni: int, nj: int, threads: int) -> None:
    """Microseconds an inner node of whole regrids."""
    moving = make_domain("three_fingers", ni, nj)
    regridder = BarrierRegridder(threads=threads)
    nodes = moving.start
    count = moving.suggested_steps
    for step in range(count // 2):
        nodes = regridder.regrid(nodes, moving.boundary(step / count)).nodes
    here = (count // 2 - 1) / count
    for move in MOVES:
        boundary = moving.boundary(here + 2.0 * move / count)
        report = regridder.regrid(nodes, boundary).report
        cost = least_seconds(lambda b=boundary: regridder.regrid(nodes, b))
        cost *= 1e6 / ((ni - 1) * (nj - 1))
        tables.add(
            "regrid-moves",
            cells=f"{ni} × {nj}",
            threads=threads,
            **{"boundary moves by": f"{move:g} cell", "us per node": cost},
            iterations=report.iterations,
        )


def time_left_behind(tables: Tables, ni: int, nj: int) -> None:
    """Rectangle moved by .9 cell, inside left behind: error of Newton steps and of 40 sweeps.

    The Newton steps begin on the old inside; by itself the regridder would begin on straight
    lines and be done.  A cell squeezed to .1 of its width doubles in a step at most, by the
    barrier's curvature, so that four steps pass before the error falls fast.
    """
    moving = make_domain("rectangle_shift", ni, nj)
    exact = moving.start.copy()
    exact[1] += 0.9 * moving.cell
    behind = moving.boundary(1.0)
    behind[:, 1:-1, 1:-1] = moving.start[:, 1:-1, 1:-1]
    regridders = {
        f"{steps} Newton steps": BarrierRegridder(
            epsilon=1e-2,
            family="i",
            tolerance=0.04,
            max_iterations=40,
            floor=1e-9,
            newton_steps=steps,
        )
        for steps in (2, 4, 7)
    }
    regridders["40 sweeps"] = Sweeps(1e-2, family="i", sweeps=40)
    kept = newton_move.LOST
    newton_move.LOST = np.inf
    for name, regridder in regridders.items():
        result = regridder.regrid(behind, behind)
        error = np.abs(result.nodes - exact).max() / moving.cell
        cost = least_seconds(lambda r=regridder: r.regrid(behind, behind))
        cost *= 1e6 / ((ni - 1) * (nj - 1))
        tables.add(
            "regrid-left-behind",
            cells=f"{ni} × {nj}",
            method=name,
            **{"error, cells": float(error), "us per node": cost},
            iterations=result.report.iterations,
        )
    newton_move.LOST = kept


def time_march(tables: Tables, name: str, ni: int, nj: int) -> None:
    """A whole march at half a cell a step: CPU time and the worst grid on the way."""
    moving = make_domain(name, ni, nj)
    regridder = BarrierRegridder()
    regridder.regrid(moving.start, moving.start)
    found = march_domain(regridder, moving)
    if found.error:
        raise SystemExit(f"{name} {ni} x {nj}, step {found.done + 1}: {found.failure}")
    cost = 1e6 * sum(found.seconds) / (found.done * (ni - 1) * (nj - 1))
    tables.add(
        "regrid-marches",
        domain=name,
        cells=f"{ni} × {nj}",
        steps=found.done,
        **{
            "us per node and step": cost,
            "iterations per step": found.iterations / found.done,
            "bad cells": 0 if found.folded is None else len(find_bad_cells(found.folded)),
            "sub-moves": found.sub_moves,
            "untangling events": found.rescues,
            "minimum scaled Jacobian": found.sine,
            "worst aspect": found.aspect,
            "first line gap": found.gap,
        },
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="60x40,120x80,240x160")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--marches", default=",".join(MARCHES))
    tables = Tables(parser)
    options = tables.options
    sizes = [tuple(int(n) for n in size.split("x")) for size in options.sizes.split(",")]
    for size in sizes:
        time_parts(tables, *size)
    for size in sizes:
        time_left_behind(tables, *size)
    for size in sizes:
        for threads in options.threads.split(","):
            time_moves(tables, *size, int(threads))
    for name in options.marches.split(","):
        for size in MARCH_SIZES.get(name, sizes):
            time_march(tables, name, *size)
    tables.write()


if __name__ == "__main__":
    main()
