"""Regridders side by side on the marched domains: `python benchmarks/regrid_table.py [--large]`.

Every domain is marched from flat at half a cell a step by the Newton step, by the paper's sweeps
(epsilon 1e-2, 15 sweeps from the displacement start), by the original functional alone with these
sweeps, and by what is written down; the worst of all steps is printed.  Costs are the median step,
in microseconds of processor time an inner node.  A march that ends early shows it in the column of
steps.  `shockgrid grid compare` makes the same table for every family, in steps of one's choice.
"""

from __future__ import annotations

import argparse

from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.registry import make_regridder
from shockgrid.runs.grids.commands import HEAD, describe_march
from shockgrid.runs.grids.making import march

DOMAINS = (
    "three_fingers",
    "five_fingers",
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


def make(name: str, options: dict):
    """A regridder of the registry, or the sweeps with options that the barrier does not pass on."""
    if name == "sweeps":
        from shockgrid.regrid.barrier.sweeps import Sweeps

        return Sweeps(**options)
    return make_regridder(name, **options)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--large", action="store_true", help="also 240 x 160 cells")
    parser.add_argument("--cells-a-step", type=float, default=0.5)
    parser.add_argument("--domains", nargs="*", default=DOMAINS, choices=DOMAINS)
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=list(METHODS))
    arguments = parser.parse_args()
    sizes = [(60, 40), (120, 80)] + ([(240, 160)] if arguments.large else [])
    print(HEAD)
    for name in arguments.domains:
        for ni, nj in SIZES.get(name, sizes):
            domain = make_domain(name, ni, nj)
            steps = domain.steps_for(arguments.cells_a_step)
            for method in arguments.methods:
                found = march(domain, make(*METHODS[method]), steps)
                label = f"{name} {ni}x{nj} {method}"
                print(describe_march(label, found, f"{found.done}/{steps}"), flush=True)


if __name__ == "__main__":
    main()
