"""Every step of a small `interface-instability` against a stored baseline.

A steep interface (k a0 = 0.5, 16 cells per wavelength) from before the shock to well behind it: per
step the regridder's work, the worst corner, the grid and the time step.  `pytest tests/regression
--update-baselines` writes the file anew; review the difference before committing it.
"""

from pathlib import Path

import numpy as np

from shockgrid.problems.deck import Regrid, RunControl
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.line import Mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability

PATH = Path(__file__).parent / "baselines" / "interface_instability.txt"
STEPS = 100
COUNTS = ("regrid_iterations", "regrid_node_iterations", "regrid_sub_moves")
SIZES = ("least_scaled_jacobian", "grid_norm", "dt")
COLUMNS = COUNTS + SIZES
TOLERANCE = 1e-9  # of sums that processors may order differently; counts are exact


def measure_steps() -> np.ndarray:
    deck = InterfaceDeck(
        run=RunControl(t_end=10.0, cfl=0.8),
        mach=2.0,
        cells=16,
        modes=[Mode(ka0=0.5)],
        lengths=(3.0, 3.0),
        regrid=Regrid(options={"family": "auto"}),  # more work for the regridder than "i"
    )
    evolution = InterfaceInstability(deck).build()
    rows = []
    for _ in range(STEPS):
        row = evolution.advance()
        nodes = np.concatenate([block.nodes.ravel() for block in evolution.blocks])
        row["grid_norm"] = np.sqrt(np.mean(nodes**2))
        rows.append([row[name] for name in COLUMNS])
    return np.array(rows, dtype=float)


def test_every_step_follows_the_baseline(check_steps):
    check_steps(measure_steps(), PATH, COLUMNS, TOLERANCE, counts=len(COUNTS))
