"""Nodes of PENNANT, a Lagrangian code of others, smoothed with the boundary kept.

PENNANT [Ferenbaugh2015] marches its nodes with the material and never moves them otherwise.
`hot_layer.pnt` is a thin hot layer at the foot of a cold box: it drives a shock outwards and rolls
up at its end, and soon after 0.75 the code stops with "1 negative side volumes".  `hot_layer.npz`
has its nodes at four times, made with the code as it is (commit d7b770e, g++, serial): one run a
time with `tstop` set to it, and the .geo files read by `read_nodes`.  The licence of PENNANT is
beside this file.

    python -m examples.hosts.pennant_nodes [--plot FILE]
    python -m examples.hosts.pennant_nodes --collect a.geo b.geo -o nodes.npz

Note: the regridder knows geometry alone.  The whole way to its grid gives up the cells that the
material had gathered in the shock; a Lagrangian code goes a part of the way, as often as it has to.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.result_tables import Tables
from shockgrid import regrid

NODES = Path(__file__).with_name("hot_layer.npz")
PASSES = 5  # of the regridder on one boundary: more change nothing
PART = 0.3  # of the way to the smooth grid, for a code that wants to stay near its material


def read_nodes(path: Path) -> tuple[float, np.ndarray]:
    """Time and nodes (2, ni+1, nj+1) of a square `rect` mesh in an EnSight file of PENNANT."""
    lines = path.read_text(encoding="ascii").splitlines()
    time = float(next(line for line in lines if line.startswith("t =")).partition("=")[2])
    begin = lines.index("coordinates") + 2
    count = int(lines[begin - 1])
    side = round(count**0.5)
    if side * side != count:
        raise regrid.BadInput(f"{path}: {count} nodes; they must be those of n x n cells")
    x_and_y = np.array(lines[begin : begin + 2 * count], dtype=np.float64)
    return time, np.ascontiguousarray(x_and_y.reshape(2, side, side).transpose(0, 2, 1))


def load_nodes() -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and nodes (n, 2, ni+1, nj+1) that are kept beside this file."""
    with np.load(NODES) as kept:
        return kept["times"], kept["nodes"]


def smooth(nodes: np.ndarray) -> regrid.March:
    """The barrier's grid on the sides of `nodes`, begun from them."""
    return regrid.march(regrid.BarrierRegridder(), nodes, lambda t: nodes, range(1, PASSES + 1))


def draw(grids: dict[str, np.ndarray], path: str) -> None:
    """The grids side by side, their worst corner marked."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(grids), 4.6), layout="constrained")
    panels = figure.subplots(1, len(grids), sharey=True)
    for axes, (label, nodes) in zip(panels, grids.items(), strict=True):
        axes.plot(*nodes, color="0.25", linewidth=0.5)
        axes.plot(*nodes.transpose(0, 2, 1), color="0.25", linewidth=0.5)
        quality = regrid.measure_quality(nodes)
        i, j = quality.least_scaled_jacobian_at
        x, y = nodes[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
        axes.plot(x, y, "o", color="red", markersize=12, fillstyle="none")
        axes.set_title(f"{label}\nminimum scaled Jacobian {quality.least_scaled_jacobian:.3f}")
        axes.set(xlabel="x", aspect="equal")
    panels[0].set_ylabel("y")
    figure.savefig(path, dpi=80, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plot", metavar="FILE")
    parser.add_argument("--collect", nargs="+", type=Path, metavar="GEO")
    parser.add_argument("-o", "--output", type=Path, default=Path("nodes.npz"))
    tables = Tables(parser)
    options = tables.options
    if options.collect:
        times, nodes = zip(*map(read_nodes, options.collect), strict=True)
        np.savez_compressed(options.output, times=np.array(times), nodes=np.array(nodes))
        return
    for time, nodes in list(zip(*load_nodes(), strict=True))[1:]:  # the first is the even grid
        smoothed = smooth(nodes).nodes
        near = nodes + PART * (smoothed - nodes)
        for words, grid in (
            ("PENNANT's", nodes),
            (f"{PART:g} of the way", near),
            ("the barrier's", smoothed),
        ):
            quality = regrid.measure_quality(grid)
            tables.add(
                "host-pennant",
                time=f"{time:g}",
                nodes=words,
                **{
                    "bad cells": quality.bad_cells,
                    "minimum scaled Jacobian": quality.least_scaled_jacobian,
                    "worst aspect": quality.worst_aspect_ratio,
                    "worst skew": quality.worst_skew,
                },
            )
    tables.write()
    if options.plot:
        grids = {
            f"PENNANT, t = {time:g}": nodes,
            f"{PART:g} of the way": near,
            "smoothed": smoothed,
        }
        draw(grids, options.plot)


if __name__ == "__main__":
    main()
