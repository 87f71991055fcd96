"""Growth of rolls in a fluid layer heated from below: linear theory, by Chebyshev collocation.

A disturbance w(y), theta(y) times exp(i k x + sigma t) of the fluid at rest between isothermal
walls at y = 0 and 1, in the scales height, kappa/height, dT ([Chandrasekhar1961] II):

    sigma (D² - k²) w = Pr (D² - k²)² w - Ra Pr k² theta,       D = d/dy
    sigma theta = (D² - k²) theta + w

with w = 0, theta = 0 and w' = 0 (no-slip) or w'' = 0 (free) on both walls.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eig

POINTS = 40  # of collocation; 32 give the same ten digits


def differentiate(n: int) -> tuple[np.ndarray, np.ndarray]:
    """(points of [0, 1], matrix of the derivative) on n + 1 Chebyshev points [Trefethen2000]."""
    x = np.cos(np.pi * np.arange(n + 1) / n)
    weight = np.where((np.arange(n + 1) % n) == 0, 2.0, 1.0) * (-1.0) ** np.arange(n + 1)
    distance = x[:, None] - x[None, :] + np.eye(n + 1)
    matrix = np.outer(weight, 1.0 / weight) / distance
    matrix -= np.diag(matrix.sum(axis=1))
    return 0.5 * (x + 1.0), 2.0 * matrix


def compute_layer_growth(
    rayleigh: float, prandtl: float, wavenumber: float, free: bool = False
) -> float:
    """Largest growth rate sigma [kappa/height²] of rolls of `wavenumber` [1/height]."""
    n = POINTS
    _, d = differentiate(n)
    unit, k2 = np.eye(n + 1), wavenumber**2
    laplacian = d @ d - k2 * unit
    none = np.zeros_like(unit)
    left = np.block(
        [[prandtl * laplacian @ laplacian, -rayleigh * prandtl * k2 * unit], [unit, laplacian]]
    )
    right = np.block([[laplacian, none], [none, unit]])
    slope = d @ d if free else d
    conditions = {0: unit[0], n: unit[n], 1: slope[0], n - 1: slope[n]}
    for row, condition in conditions.items():
        left[row], right[row] = np.concatenate([condition, np.zeros(n + 1)]), 0.0
    for row in (n + 1, 2 * n + 1):
        left[row], right[row] = np.zeros(2 * n + 2), 0.0
        left[row, row] = 1.0
    values = eig(left, right, right=False)
    values = values[np.isfinite(values) & (np.abs(values) < 1e8)]
    return float(values.real.max())
