"""The steady state of a convecting box in one call."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hydro.convection.box import Fluid, Wall
from hydro.convection.equations import Equations
from hydro.convection.steady import GridControl, SteadySolver


def solve_steady(
    x: np.ndarray,
    y: np.ndarray,
    walls: Mapping[str, Wall],
    fluid: Fluid,
    grid: GridControl | None = None,
    **options,
) -> SteadySolver:
    """The steady state on nodes x, y [m], or on those that `grid` makes of them."""
    solver = SteadySolver(Equations(x, y, walls), fluid, grid, **options)
    solver.solve()
    return solver
