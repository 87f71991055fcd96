"""Domains of the literature: swan, horseshoe, annulus, airfoil; and a Z-shaped chicane.

Swan and horseshoe have the boundary curves of [KnuppSteinberg1993]'s gallery, nodes at equal steps
of the curves' parameters.  Annulus, airfoil and chicane are our own definitions; each says its
shape.  Dome, valley and chevron, our own too, lie beside the papers' domains.

Sides deform all at once here, and the amplitude is that of a straight way for every node (swan,
horseshoe), of a bend (annulus, airfoil) or of a turn (chicane).

Source: [KnuppSteinberg1993].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regrid.domains.moving import MovingDomain, distribute_by_arc_length, march_sides

ALL_SIDES = ("i_min", "i_max", "j_min", "j_max")
ANNULUS_ANGLE = 1.5 * np.pi
FINE = 2400  # points on a profile
TAIL = 0.00126  # half thickness of the profile's cut trailing edge, chords
AIRFOIL_RADIUS = 1.5  # of the outer side, chords
CHICANE_TURN = np.radians(135.0)
CHICANE_WIDTH = 0.3  # over the length of a leg


def _between(first: np.ndarray, last: np.ndarray) -> Callable[[float], np.ndarray]:
    """Every node on a straight line from its first to its last place."""
    return lambda amplitude: (1.0 - amplitude) * first + amplitude * last


def _parameters(ni: int, nj: int) -> tuple[np.ndarray, np.ndarray]:
    return np.linspace(0.0, 1.0, ni + 1), np.linspace(0.0, 1.0, nj + 1)


def swan(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Unit square whose right side becomes x = 1 + 2y - 2y² and whose top y = 1 - 3x + 3x².

    i to the right, j up.  The corner at (0, 1) closes to 18.4 degrees: no grid can have a corner
    sine above .316 there.
    """
    r, t = _parameters(ni, nj)
    square = np.array(np.meshgrid(r, t, indexing="ij"))
    shape = square.copy()
    shape[1, :, -1] = 1.0 - 3.0 * r + 3.0 * r * r
    shape[0, -1] = 1.0 + 2.0 * t - 2.0 * t * t
    return march_sides("swan", _between(square, shape), ("i_max", "j_max"))


def horseshoe(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle 1 x 2 that becomes the half ring from a unit circle to an ellipse 4 x 2.

    j along the ring from (0, -1) to (0, 1), i outwards: cells are three times as long at the tip.
    """
    r, t = _parameters(ni, nj)
    rectangle = np.array(np.meshgrid(r, 2.0 * t - 1.0, indexing="ij"))
    shape = rectangle.copy()
    angle = 0.5 * np.pi * (2.0 * t - 1.0)
    for line, (a, b) in ((0, (1.0, 1.0)), (-1, (4.0, 2.0))):
        shape[:, line] = a * np.cos(angle), b * np.sin(angle)
    for line, end in ((0, -1.0), (-1, 1.0)):
        shape[:, :, line] = np.zeros_like(r), end * (1.0 + r)
    return march_sides("horseshoe", _between(rectangle, shape), ALL_SIDES)


def annulus(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle bent to three quarters of a ring between the radii 1 and 2.

    Its mean length, 7.07, is kept; j along the ring, i outwards.
    """
    r, t = _parameters(ni, nj)
    length = 1.5 * ANNULUS_ANGLE

    def sides_at(amplitude: float) -> np.ndarray:
        along = length * (t - 0.5)
        if amplitude == 0.0:
            return np.array(np.meshgrid(r - 0.5, along, indexing="ij"))
        curvature = amplitude * ANNULUS_ANGLE / length
        radius = 1.0 / curvature + (r - 0.5)[:, None]
        angle = curvature * along
        return np.array([radius * np.cos(angle) - 1.0 / curvature, radius * np.sin(angle)])

    return march_sides("annulus", sides_at, ALL_SIDES)


def airfoil(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A strip that closes round a NACA 0012 profile: a grid of C type without a wake.

    j runs along the profile, equidistant, from the upper to the lower end of its cut trailing edge;
    i outwards, to a half circle of radius 1.5 round the middle of the chord with straight ends.
    The sides j_min and j_max stand upright on the trailing edge.  On the way both the profile's
    thickness of log r and the bend grow: `z = (1 - exp(a (u + i theta)))/a`, u from its mean
    at a = 0 to log r at a = 1; the middle of the chord comes to lie at (1, 0).
    """
    r, t = _parameters(ni, nj)
    profile = distribute_by_arc_length(_naca_0012(), nj + 1)
    tail = profile[0, 0]
    upper = np.array([np.full_like(r, tail), profile[1, 0] + (AIRFOIL_RADIUS - profile[1, 0]) * r])
    outer = distribute_by_arc_length(_c_shape(tail), nj + 1)
    sides = np.zeros((2, ni + 1, nj + 1))
    sides[:, 0], sides[:, -1] = profile, outer
    sides[:, :, 0], sides[:, :, -1] = upper, upper * np.array([[1.0], [-1.0]])
    radius = np.hypot(*sides)
    turn = np.arctan2(sides[1], sides[0]) % (2.0 * np.pi) - np.pi
    # Strip: as wide and as long as the closed shape is on average, in log r and angle.
    level = np.log(np.maximum(radius, 1e-300))
    low, high = level[0].mean(), level[-1].mean()
    flat = np.array(np.meshgrid(low + (high - low) * r, np.pi * (2.0 * t - 1.0), indexing="ij"))

    def sides_at(amplitude: float) -> np.ndarray:
        u = (1.0 - amplitude) * flat[0] + amplitude * level
        angle = (1.0 - amplitude) * flat[1] + amplitude * turn
        if amplitude == 0.0:
            return np.array([-u, -angle])
        stretched = np.exp(amplitude * u)
        x, y = stretched * np.cos(amplitude * angle), stretched * np.sin(amplitude * angle)
        return np.array([1.0 - x, -y]) / amplitude

    return march_sides("airfoil", sides_at, ALL_SIDES)


def _naca_0012() -> np.ndarray:
    """The profile (2, n) round its mid-chord, from the upper trailing edge to the lower one."""
    part = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, FINE // 2)))  # 0 at the nose
    root = np.sqrt(part)
    half = 0.6 * (
        0.2969 * root - 0.126 * part - 0.3516 * part**2 + 0.2843 * part**3 - 0.1015 * part**4
    )
    half[-1] = TAIL
    x = np.concatenate([part[::-1], part[1:]]) - 0.5
    return np.array([x, np.concatenate([half[::-1], -half[1:]])])


def _c_shape(tail: float) -> np.ndarray:
    """Half circle to the left of the middle, straight lines to x = tail above and below."""
    angle = np.linspace(0.5 * np.pi, 1.5 * np.pi, FINE)
    arc = AIRFOIL_RADIUS * np.array([np.cos(angle), np.sin(angle)])
    first = np.array([[tail], [AIRFOIL_RADIUS]])
    return np.concatenate([first, arc, first * np.array([[1.0], [-1.0]])], axis=1)


def chicane(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A straight strip of three legs, .3 wide and 3 long, folded to a Z, nodes equidistant.

    i along it, j across.  Both turns grow to 135 degrees with mitred corners, 45 degrees between
    the legs.  The sides' nodes stay equidistant, so that an inner corner comes to lie opposite to
    the middle of a leg: straight lines across the strip leave it.
    """
    t = np.linspace(0.0, 1.0, nj + 1)

    def sides_at(amplitude: float) -> np.ndarray:
        turn = amplitude * CHICANE_TURN
        centre = np.zeros((2, 4))
        for k, heading in enumerate((0.0, -turn, 0.0)):
            centre[:, k + 1] = centre[:, k] + (np.cos(heading), np.sin(heading))
        mitre = np.array([np.tan(0.5 * turn), 1.0])
        normals = np.array([[0.0, 1.0], mitre, mitre, [0.0, 1.0]]).T
        low, high = (
            distribute_by_arc_length(centre + 0.5 * CHICANE_WIDTH * side * normals, ni + 1)
            for side in (-1.0, 1.0)
        )
        return low[:, :, None] + (high - low)[:, :, None] * t

    return march_sides("chicane", sides_at, ALL_SIDES)
