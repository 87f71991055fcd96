"""Regridders side by side on the marched domains: `python benchmarks/regrid_table.py [--large]`.

Every domain is marched from flat at half a cell a step by the Newton step and by the paper's sweeps
(epsilon 1e-2, 15 sweeps from the displacement start; also the original functional alone), and
the worst of all steps is printed.  Costs are the median step, in microseconds of one core per
inner node; on a busy machine take the least of several runs.  A march that ends early shows it
in the column of steps.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from regrid.domains import make_domain
from regrid.errors import RegridFailure
from regrid.quality import measure_gap0, measure_quality
from regrid.registry import make_regridder

DOMAINS = (
    "three_fingers",
    "curled_fingers",
    "overhung_fingers",
    "hooked_fingers",
    "single_finger",
    "slender_finger",
    "jet",
    "dome",
    "valley",
    "chevron",
    "strip",
)
SIZES = {"jet": ((40, 120),), "strip": ((120, 40), (240, 80))}
METHODS = {
    "newton": ("barrier", {"method": "newton"}),
    "sweeps": ("barrier", {"method": "sweeps", "epsilon": 1e-2}),
    "original I": ("sweeps", {"functional": "ivanenko-charakhchyan"}),
    "quasi-1d": ("quasi-1d", {"family": "i"}),
    "displacement": ("displacement", {}),
}
HEADER = (
    f"{'domain':15s} {'cells':>8s} {'method':13s} {'steps':>9s} {'bad':>4s} {'sub':>4s}"
    f" {'resc':>4s} {'its':>6s} {'us/node':>8s} {'gap0':>6s} {'aspect':>7s} {'min SJ':>7s}"
)


def make(name: str, options: dict):
    """A regridder of the registry, or the sweeps with options that the barrier does not pass on."""
    if name == "sweeps":
        from regrid.sweeps import Sweeps

        return Sweeps(**options)
    return make_regridder(name, **options)


def march(domain, regridder, cells_a_step: float) -> str:
    """March the whole motion; returns the row of the table behind the method's name."""
    steps, nodes = domain.steps_for(cells_a_step), domain.start
    inner = (nodes.shape[1] - 2) * (nodes.shape[2] - 2)
    bad = sub_moves = rescues = iterations = 0
    gap, aspect, sine, seconds = 0.0, 0.0, 1.0, []
    done = steps
    # One call outside the clock: compiling is not regridding.
    regridder.regrid(nodes, domain.boundary(1e-6))
    for step in range(1, steps + 1):
        boundary = domain.boundary(step / steps)
        begun = time.perf_counter()
        try:
            result = regridder.regrid(nodes, boundary)
        except RegridFailure:
            done = step - 1
            break
        seconds.append(time.perf_counter() - begun)
        nodes, report = result.nodes, result.report
        quality = measure_quality(nodes)
        bad += quality.bad_cells
        sub_moves, rescues = sub_moves + report.sub_moves, rescues + report.rescues
        iterations += report.iterations
        gap = max(gap, measure_gap0(nodes))
        aspect = max(aspect, quality.worst_aspect_ratio)
        sine = min(sine, quality.least_scaled_jacobian)
    cost = 1e6 * float(np.median(seconds)) / inner if seconds else np.nan
    return (
        f"{done:4d}/{steps:<4d} {bad:4d} {sub_moves:4d} {rescues:4d}"
        f" {iterations / max(1, done):6.1f} {cost:8.3f} {gap:6.2f} {aspect:7.1f} {sine:7.3f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--large", action="store_true", help="also 240 x 160 cells")
    parser.add_argument("--cells-a-step", type=float, default=0.5)
    parser.add_argument("--domains", nargs="*", default=DOMAINS, choices=DOMAINS)
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=list(METHODS))
    arguments = parser.parse_args()
    sizes = [(60, 40), (120, 80)] + ([(240, 160)] if arguments.large else [])
    print(HEADER)
    for name in arguments.domains:
        for ni, nj in SIZES.get(name, sizes):
            domain = make_domain(name, ni, nj)
            for method in arguments.methods:
                row = march(domain, make(*METHODS[method]), arguments.cells_a_step)
                print(f"{name:15s} {ni:4d}x{nj:<3d} {method:13s} {row}", flush=True)


if __name__ == "__main__":
    main()
