"""Waves of small amplitude in elastic solids: speeds, surface waves, Rayleigh–Taylor with shear.

A free surface of a half space carries waves of speed c with [Rayleigh1885]

    (2 - x)² = 4 sqrt(1 - x c_s²/c_l²) sqrt(1 - x),   x = (c/c_s)².

The same speed has a wave along a frictionless contact of two equal half spaces, in which the
surfaces slide [AchenbachEpstein1967].

Under an acceleration g towards the empty side the surface of an incompressible half space with
waves exp(i k x + s t) has normal and shear stress zero for

    ((2 + q²)² - 4 sqrt(1 + q²)) / q² = rho g/(G k),   q = s/(c_s k).

For q = 0 the left side is 2: a solid with rho g < 2 G k does not grow.  For large q it is q², the
growth of a fluid, s² = g k.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.roots import find_root

# below it the series of the left side is used, above it its formula; the bound of the root's search
SMALL_GROWTH = 1e-3
ROOT_MARGIN = 1e-15


def compute_wave_speeds(eos: Any, rho, p, shear_modulus) -> tuple[Any, Any]:
    """Speeds [m/s] of longitudinal and shear waves: c_l² = c² + 4 G/(3 rho), c_s² = G/rho."""
    shear = np.sqrt(np.asarray(shear_modulus, float) / rho)
    return np.sqrt(eos.sound_speed(rho, p) ** 2 + 4.0 / 3.0 * shear**2), shear


def compute_rayleigh_speed(longitudinal: float, shear: float) -> float:
    """Speed [m/s] of waves along a free surface, from those inside the solid.

    Raises BadInput where c_l² is not above 4/3 c_s², which no solid has.
    """
    ratio = (shear / longitudinal) ** 2
    if not 0.0 < ratio < 0.75:
        raise BadInput(
            f"waves of {longitudinal:g} and {shear:g} m/s: the longitudinal ones must be faster "
            "than the shear waves by more than a factor of 1.155"
        )

    def excess(x: float) -> float:
        return (2.0 - x) ** 2 - 4.0 * math.sqrt((1.0 - x * ratio) * (1.0 - x))

    # x = 0 is a root, too; the one sought is the next
    x = find_root(excess, 1e-3, 1.0, xtol=ROOT_MARGIN)
    return shear * math.sqrt(x)


def compute_elastic_growth(rho: float, gravity: float, shear_modulus: float, k: float) -> float:
    """Growth rate [1/s] of waves of wave number k [1/m] at the surface of an incompressible elastic
    half space that `gravity` [m/s²] draws towards the empty side; 0 where it is stable."""
    driven = rho * gravity / (shear_modulus * k)
    if driven <= 2.0:
        return 0.0

    def excess(q: float) -> float:
        if q < SMALL_GROWTH:
            return 2.0 + 1.5 * q * q - driven
        return ((2.0 + q * q) ** 2 - 4.0 * math.sqrt(1.0 + q * q)) / (q * q) - driven

    # the left side is between q² and q² + 4
    q = find_root(excess, 0.0, math.sqrt(driven) + 1.0, xtol=ROOT_MARGIN)
    return q * k * math.sqrt(shear_modulus / rho)
