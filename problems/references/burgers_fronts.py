"""Fronts of Burgers' equation that run and merge, exactly: sums of exponentials by Cole and Hopf.

    phi = Σ exp(-(u_m x - b_m)/(2 nu) + u_m² t/(4 nu)),      u = -2 nu (ln phi)_x

Between falling levels u_m there are fronts of the speed (u_m + u_(m+1))/2 and a thickness of about
8 nu/(u_m - u_(m+1)); a faster one behind overtakes a slower one, and the two become one.  The b_m
put the fronts where they are wanted at t = 0.  Means over cells are differences of ln phi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class BurgersFronts:
    """levels: falling values of u [m/s]; places: of the fronts between them at t = 0 [m]."""

    viscosity: float
    levels: tuple[float, ...] = (1.0, 0.0)
    positions: tuple[float, ...] = (0.2,)

    def _exponents(self, x: np.ndarray, t: float) -> np.ndarray:
        """Exponents of the terms of phi, (levels, points)."""
        levels = np.array(self.levels)
        shifts = np.append(0.0, np.cumsum(np.diff(levels) * np.array(self.positions)))
        scale = 2.0 * self.viscosity
        return (-np.outer(levels, x) + shifts[:, None] + 0.5 * t * (levels**2)[:, None]) / scale

    def compute_values(self, x: np.ndarray, t: float) -> np.ndarray:
        """u at the points x (n,)."""
        exponents = self._exponents(x, t)
        parts = np.exp(exponents - exponents.max(axis=0))
        return (np.array(self.levels)[:, None] * parts).sum(axis=0) / parts.sum(axis=0)

    def compute_cell_averages(self, nodes: np.ndarray, t: float) -> np.ndarray:
        """Means (n,) of u over the cells between `nodes` (n + 1,)."""
        exponents = self._exponents(nodes, t)
        largest = exponents.max(axis=0)
        logarithm = largest + np.log(np.exp(exponents - largest).sum(axis=0))
        return -2.0 * self.viscosity * np.diff(logarithm) / np.diff(nodes)
