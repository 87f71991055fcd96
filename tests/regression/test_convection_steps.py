"""Every step of small convection runs against stored baselines.

A cavity from rest to its steady state on Polevikov's grid, and a layer whose grid moves in every
step: per step what was measured, and norms of state and grid.  `pytest tests/regression
--update-baselines` writes the files anew; review the difference before committing it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shockgrid.problems.convection.heated_cavity import AxisGrid, HeatedCavity, HeatedCavityDeck
from shockgrid.problems.convection.rayleigh_benard import RayleighBenard, RayleighBenardDeck
from shockgrid.problems.deck import RunControl

FOLDER = Path(__file__).parent / "baselines"
TOLERANCE = 1e-7  # of converged states and of sums that processors may order differently
COLUMNS = ("nusselt", "u_max", "norm_psi", "norm_temperature", "norm_grid")
STEPS = 40


def make_cavity() -> HeatedCavity:
    grid = AxisGrid(kind="polevikov", every=2)
    return HeatedCavity(HeatedCavityDeck(cells=12, rayleigh=1e5, grid=grid))


def make_layer() -> RayleighBenard:
    deck = RayleighBenardDeck(
        shape="layer",
        cells=10,
        cells_up=10,
        rayleigh=1e4,
        amplitude=0.2,
        grid=AxisGrid(kind="combined"),
        run=RunControl(t_end=0.2),
        longest_step=2e-3,
    )
    return RayleighBenard(deck)


PROBLEMS = {"heated_cavity": make_cavity, "rayleigh_benard": make_layer}


def measure_steps(name: str) -> np.ndarray:
    problem = PROBLEMS[name]()
    evolution = problem.build()
    rows = []
    while len(rows) < STEPS and evolution.finished is None:
        evolution.advance()
        row = problem.measure(evolution)
        axes = np.concatenate([axis.nodes for axis in evolution.equations.axes])
        arrays = {"psi": evolution.psi, "temperature": evolution.temperature, "grid": axes}
        row |= {f"norm_{key}": float(np.sqrt(np.mean(v**2))) for key, v in arrays.items()}
        rows.append([row[column] for column in COLUMNS])
    return np.array(rows)


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_step_follows_the_baseline(name, check_steps):
    check_steps(measure_steps(name), FOLDER / f"{name}.txt", COLUMNS, TOLERANCE)
