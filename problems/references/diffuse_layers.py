"""Growth of a shocked interface that is a layer of graded density instead of a jump.

The layer's density follows an error function of the place x across it,

    rho = rho1 + (rho2 - rho1) (1 + erf(sqrt(pi) x / d))/2,

with the diffusion thickness d, the jump of density over its steepest gradient.  On it a wave of
number k grows psi times more slowly than on a jump.  Incompressible linear theory has two factors,
both from the operator L w = -(rho w')' + k² rho w for the velocity w across the layer:

- A shock that sets the layer into motion leaves L w = k² a rho' v, with the amplitude a and the
  speed v that the shock gives.  psi is the rate of a jump, k A a v, over w at the mean density,
  where the line between both halves of the layer is followed.
- The factor of experiments [BrouilletteSturtevant1994] is the smallest eigenvalue psi of
  L w = (k psi/A) rho' w.  It belongs to layers under a steady acceleration, whose wave has had the
  time to take the shape of the eigenfunction, and is greater.
"""

from __future__ import annotations

import math

import numpy as np

SIDE_WIDTH = 12.0  # of each side of the layer in 1/k: the velocity falls there to exp(-12)
LINE_POINTS = 6001  # of the solution: psi is then right to 1e-4 for k d >= 0.05
LEAST_SLOPE = 0.02  # k d of a layer that has at least 5 points; psi - 1 is linear in k d below it
INVERSE_ITERATIONS = 60


def mix_densities(place: np.ndarray, thickness: float, rho: tuple[float, float]) -> np.ndarray:
    """Density [kg/m3] at places x (any shape) [m] in a layer of this diffusion thickness [m].

    rho: far before and far beyond the layer [kg/m3].
    """
    from scipy.special import erf  # slow to load

    part = 0.5 * (1.0 + erf(math.sqrt(math.pi) * place / thickness))
    return rho[0] + (rho[1] - rho[0]) * part


def compute_growth_reduction(atwood: float, slope: float) -> float:
    """psi of a layer that a shock sets into motion; `slope`: k d, A: `atwood`.  A jump has 1."""
    if slope < LEAST_SLOPE:
        return _extrapolate(compute_growth_reduction, atwood, slope)
    bands, gradient = _discretise(abs(atwood), slope)
    speed = _solve(bands, gradient)
    return float(abs(atwood) / speed[LINE_POINTS // 2])


def compute_steady_reduction(atwood: float, slope: float) -> float:
    """psi of a layer under a steady acceleration, the smallest eigenvalue."""
    if slope < LEAST_SLOPE:
        return _extrapolate(compute_steady_reduction, atwood, slope)
    bands, gradient = _discretise(abs(atwood), slope)
    speed = np.ones(LINE_POINTS)
    largest = 1.0
    # inverse iteration for the largest A/psi
    for _ in range(INVERSE_ITERATIONS):
        speed = _solve(bands, gradient * speed) / largest
        scale = np.abs(speed).max()
        largest *= scale
        speed /= scale
    return float(abs(atwood) / largest)


def _extrapolate(compute, atwood: float, slope: float) -> float:
    """psi of a layer too thin for the points."""
    excess = compute(atwood, LEAST_SLOPE) - 1.0
    return 1.0 + excess * slope / LEAST_SLOPE


def _discretise(atwood: float, slope: float) -> tuple[np.ndarray, np.ndarray]:
    """L above the diagonal and on it (2, LINE_POINTS), and rho' (LINE_POINTS,), for k = 1."""
    x, dx = np.linspace(-SIDE_WIDTH, SIDE_WIDTH, LINE_POINTS, retstep=True)
    rho = mix_densities(x, slope, (1.0 - atwood, 1.0 + atwood))
    face = 0.5 * (rho[1:] + rho[:-1]) / dx**2
    bands = np.zeros((2, LINE_POINTS))
    bands[0, 1:] = -face
    bands[1] = rho
    bands[1, 1:] += face
    bands[1, :-1] += face
    return bands, np.gradient(rho, dx)


def _solve(bands: np.ndarray, right: np.ndarray) -> np.ndarray:
    from scipy.linalg import solveh_banded  # slow to load

    return solveh_banded(bands, right)
