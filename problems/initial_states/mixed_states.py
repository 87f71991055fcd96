"""States of cells that an initial shock or contact cuts: conserved quantities mixed by volume.

A staircase of whole cells along a slanted or curved front is a sawtooth later; primitive values
must not be averaged instead, or mass, momentum and energy of the start are wrong.
"""

from __future__ import annotations

import numpy as np


def mix_states(eos, fraction: np.ndarray, first, second):
    """rho, u, v, p of cells with the volume `fraction` in state `first`, the rest in `second`.

    fraction: (ni, nj) in [0, 1], from `regrid.measure.cells`; the states are (rho, u, v, p) of
    numbers or arrays (ni, nj), both of the material `eos`.  Density, momentum and total energy are
    mixed; the pressure is that of the mixed energy.  Returns four arrays (ni, nj); whole cells
    (fraction 0 or 1) get their state unchanged to the last bit.
    """
    fraction = np.asarray(fraction, dtype=float)
    conserved = []
    for rho, u, v, p in (first, second):
        total = rho * eos.energy(rho, p) + 0.5 * rho * (u * u + v * v)
        conserved.append((rho, rho * u, rho * v, total))
    rho, momentum_x, momentum_y, total = (
        fraction * a + (1.0 - fraction) * b for a, b in zip(*conserved, strict=True)
    )
    u, v = momentum_x / rho, momentum_y / rho
    p = eos.pressure(rho, total / rho - 0.5 * (u * u + v * v))
    mixed = []
    for value, a, b in zip((rho, u, v, p), first, second, strict=True):
        mixed.append(np.where(fraction == 1.0, a, np.where(fraction == 0.0, b, value)))
    return tuple(mixed)
