"""Domains whose four sides all bend: nozzle, waves, cushion, pinched, crescent and bulged chevron.

On these neither family of straight lines starts on all sides that deform (theory R4.5, R4.16).  All
begin as a rectangle and bend as the amplitude grows; nodes are equidistant on every side.  The
shapes are our own definitions.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regrid.domains.moving import MovingDomain, distribute_by_arc_length, march_sides

ALL_SIDES = ("i_min", "i_max", "j_min", "j_max")
FINE = 1200  # points on a side from which its nodes are taken

Curve = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]


def _bend(name: str, ni: int, nj: int, low: Curve, high: Curve, near: Curve, far: Curve):
    """Domain between the curves j_min, j_max, i_min, i_max: points at p from 0 to 1, amplitude."""
    p = np.linspace(0.0, 1.0, FINE)

    def sides_at(amplitude: float) -> np.ndarray:
        nodes = np.full((2, ni + 1, nj + 1), np.nan)
        for curve, j in ((low, 0), (high, -1)):
            nodes[:, :, j] = distribute_by_arc_length(np.array(curve(p, amplitude)), ni + 1)
        for curve, i in ((near, 0), (far, -1)):
            line = distribute_by_arc_length(np.array(curve(p, amplitude)), nj + 1)
            nodes[:, i, 1:-1] = line[:, 1:-1]
        return nodes

    return march_sides(name, sides_at, ALL_SIDES)


def nozzle(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A duct 2 long and 2 high whose throat closes to .6, both of its ends bulged downstream by .3.

    i along the duct, j across.  Half its height is `1 - .7 a sin²(pi x/2)`.
    """

    def wall(sign: float) -> Curve:
        return lambda p, a: (2.0 * p, sign * (1.0 - 0.7 * a * np.sin(np.pi * p) ** 2))

    def end(at: float) -> Curve:
        return lambda p, a: (at + 1.2 * a * p * (1.0 - p), 2.0 * p - 1.0)

    return _bend("nozzle", ni, nj, wall(-1.0), wall(1.0), end(0.0), end(2.0))


def waves(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle 1.5 x 1 with a wave on each side: two and a half, one and a half, one, two of them.

    Their amplitudes grow to .1 (j_min, j_max) and .08 (i_min, i_max).
    """

    def wave(p: np.ndarray, a: float, high: float, count: float) -> np.ndarray:
        return a * high * np.sin(2.0 * np.pi * count * p)

    return _bend(
        "waves", ni, nj,
        lambda p, a: (1.5 * p, wave(p, a, 0.1, 2.5)),
        lambda p, a: (1.5 * p, 1.0 + wave(p, a, 0.1, 1.5)),
        lambda p, a: (wave(p, a, 0.08, 1.0), p),
        lambda p, a: (1.5 + wave(p, a, 0.08, 2.0), p),
    )  # fmt: skip


def _bulged(name: str, ni: int, nj: int, height: float) -> MovingDomain:
    """Rectangle 1.5 x 1 whose sides all become parabolas that stand out by `height`."""

    def bulge(p: np.ndarray, a: float) -> np.ndarray:
        return 4.0 * height * a * p * (1.0 - p)

    return _bend(
        name, ni, nj,
        lambda p, a: (1.5 * p, -bulge(p, a)),
        lambda p, a: (1.5 * p, 1.0 + bulge(p, a)),
        lambda p, a: (-bulge(p, a), p),
        lambda p, a: (1.5 + bulge(p, a), p),
    )  # fmt: skip


def cushion(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle 1.5 x 1 whose sides all bulge outwards by .2: its corners open to 150 degrees."""
    return _bulged("cushion", ni, nj, 0.2)


def pinched(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle 1.5 x 1 whose sides all bulge inwards by .2: its corners close to 34 degrees."""
    return _bulged("pinched", ni, nj, -0.2)


def crescent(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A rectangle bent to half a ring between the radii 1 and 2, both of its ends bulged by .3.

    i outwards, j round; the inner side has a wave of amplitude .1, three of them along the ring.
    """
    length = 1.5 * np.pi

    def ring(across: float, high: float) -> Curve:
        def curve(p: np.ndarray, a: float) -> tuple[np.ndarray, np.ndarray]:
            return around(across + a * high * np.sin(6.0 * np.pi * p), length * (p - 0.5), a)

        return curve

    def end(sign: float) -> Curve:
        def curve(p: np.ndarray, a: float) -> tuple[np.ndarray, np.ndarray]:
            return around(p - 0.5, sign * (0.5 * length + 1.2 * a * p * (1.0 - p)), a)

        return curve

    def around(across, along, a: float) -> tuple[np.ndarray, np.ndarray]:
        across, along = np.broadcast_arrays(across, along)
        if a == 0.0:
            return across, along
        radius = length / (np.pi * a)
        angle = along / radius
        return (radius + across) * np.cos(angle) - radius, (radius + across) * np.sin(angle)

    return _bend("crescent", ni, nj, end(-1.0), end(1.0), ring(-0.5, 0.1), ring(0.5, 0.0))


def bulged_chevron(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A chevron 1.5 x 1, its kink .3 deep on j_min and j_max, between ends that bulge by .15."""

    def kink(p: np.ndarray, a: float) -> np.ndarray:
        return a * 0.3 * (1.0 - np.abs(2.0 * p - 1.0))

    def bulge(p: np.ndarray, a: float) -> np.ndarray:
        return a * 0.6 * p * (1.0 - p)

    return _bend(
        "bulged_chevron", ni, nj,
        lambda p, a: (1.5 * p, kink(p, a)),
        lambda p, a: (1.5 * p, 1.0 + kink(p, a)),
        lambda p, a: (-bulge(p, a), p),
        lambda p, a: (1.5 + bulge(p, a), p),
    )  # fmt: skip
