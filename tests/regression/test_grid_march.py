"""Regridding step by step against a stored baseline, on domains that differ in what they ask.

One text file a case: per step the iterations, node-iterations and sub-moves, the least corner sine
and the root mean square of the node coordinates.  `pytest tests/regression --update-baselines`
writes the files anew; review the difference before committing it.
"""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from shockgrid.problems.deck import Regrid
from shockgrid.problems.grid_march import GridMarch, GridMarchDeck

FOLDER = Path(__file__).parent / "baselines"
STEPS = 20
COLUMNS = ("iterations", "node_iterations", "sub_moves", "least_scaled_jacobian", "grid_norm")
SIZES = {"jet": (12, 36)}
SWEEPS = Regrid(method="sweeps", epsilon=1e-2)
# moves cut into sub-moves (chicane, slender finger), most iterations (swan), closed lines (annulus,
# airfoil), mostly idle steps (jet), and the usual; that all domains march is verified elsewhere
DOMAINS = ("airfoil", "annulus", "chicane", "jet", "slender_finger", "swan", "three_fingers")
CASES = {name: {"domain": name} for name in DOMAINS}
CASES["three_fingers_sweeps"] = {"domain": "three_fingers", "regrid": SWEEPS}
CASES["three_fingers_noise"] = {"domain": "three_fingers", "noise": 0.05, "seed": 1}


def march_domain(case: dict) -> np.ndarray:
    ni, nj = SIZES.get(case["domain"], (24, 16))
    problem = GridMarch(GridMarchDeck(ni=ni, nj=nj, **case))
    problem.deck = msgspec.structs.replace(
        problem.deck, cells_a_step=problem.make_domain().travel_in_cells / STEPS
    )
    evolution = problem.build()
    rows = []
    while evolution.finished is None:
        row = evolution.advance()
        assert row["bad_cells"] == 0
        rows.append(
            (
                row["regrid_iterations"],
                row["regrid_node_iterations"],
                row["regrid_sub_moves"],
                row["least_scaled_jacobian"],
                np.sqrt(np.mean(evolution.nodes**2)),
            )
        )
    return np.array(rows)


@pytest.mark.parametrize("name", sorted(CASES))
def test_march_follows_its_baseline(name, check_steps):
    path = FOLDER / f"grid_march_{name}.txt"
    check_steps(march_domain(CASES[name]), path, COLUMNS, 1e-7, counts=3)
