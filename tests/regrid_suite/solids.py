"""Marches in space as formulas: `place(xi, eta, zeta, a) -> (x, y, z)` on the unit cube's faces.

As in `shapes`: a is 0 at the start and 1 at the end, a node (i, j, k) of a face has xi = i/ni,
eta = j/nj, zeta = k/nk.
"""

from __future__ import annotations

import numpy as np


def bumpy_piston_3d(xi, eta, zeta, a):
    """A piston with a bump in its middle presses a cube to less than half.

    front = a (.3 + .35 sin(pi eta)^2 sin(pi zeta)^2); x = front + xi (1 - front), y = eta, z =
    zeta.
    """
    front = a * (0.3 + 0.35 * np.sin(np.pi * eta) ** 2 * np.sin(np.pi * zeta) ** 2)
    return front + xi * (1.0 - front), eta, zeta


def twisted_duct_3d(xi, eta, zeta, a):
    """A straight square duct is twisted about its axis by 120 degrees.

    angle = (2 pi/3) a xi; x = 2 xi; (y, z) = (eta - 1/2, zeta - 1/2) turned by angle.
    """
    y = eta - 0.5
    z = zeta - 0.5
    angle = 2.0 * np.pi / 3.0 * a * xi
    return (
        2.0 * xi,
        y * np.cos(angle) - z * np.sin(angle),
        y * np.sin(angle) + z * np.cos(angle),
    )


def bent_duct_3d(xi, eta, zeta, a):
    """A straight square duct bends by 135 degrees and flattens at its end.

    angle = (3 pi/4) a, curvature = angle/2; radius = 1/curvature - (eta - 1/2) .6 w, w = 1 - .5
    a xi; x = radius sin(angle xi), y = 1/curvature - radius cos(angle xi), z = .6 (zeta - 1/2).
    For a = 0 the limit x = 2 xi, y = .6 (eta - 1/2).
    """
    across = 0.6 * (eta - 0.5) * (1.0 - 0.5 * a * xi)
    if a == 0.0:
        return 2.0 * xi, across, 0.6 * (zeta - 0.5)
    angle = 0.75 * np.pi * a
    far = 2.0 / angle
    radius = far - across
    x, y = radius * np.sin(angle * xi), far - radius * np.cos(angle * xi)
    return x, y, 0.6 * (zeta - 0.5)


def tongue_3d(xi, eta, zeta, a):
    """The lower face of a cube grows a round tongue, six tenths high.

    r^2 = (xi - .5)^2 + (eta - .5)^2; low = .6 a exp(-(r/.17)^4) ; x = xi, y = eta, z = low + zeta
    (1 - low).
    """
    square = (xi - 0.5) ** 2 + (eta - 0.5) ** 2
    low = 0.6 * a * np.exp(-((square / 0.17**2) ** 2))
    return xi, eta, low + zeta * (1.0 - low)


def wavy_block_3d(xi, eta, zeta, a):
    """Waves grow on all six faces of a cube; the edges move along.

    w = .1 a; x = xi + w sin(2 pi eta) sin(2 pi zeta), y = eta + w sin(2 pi zeta) sin(2 pi xi),
    z = zeta + w sin(2 pi xi) sin(2 pi eta), with the sines of (coordinate + .15).
    """
    p, q, r = (np.sin(2.0 * np.pi * (c + 0.15)) for c in (xi, eta, zeta))
    w = 0.1 * a
    return xi + w * q * r, eta + w * r * p, zeta + w * p * q
