"""Plane marches of the suite as formulas: where a point of the unit square's edge is at a time.

Each is a function `place(xi, eta, a) -> (x, y)` of arrays xi, eta in 0..1 and of the march's
parameter a, 0 at the start and 1 at the end.  Node (i, j) of a side has xi = i/ni, eta = j/nj.  The
docstring's first line says what moves, `formula` (the next lines) the formula itself; both are
written into the march's file (`regrid_suite.files`).

Note: a formula is read on the edge of the unit square alone; inside it may fold.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Place = Callable[[np.ndarray, np.ndarray, float], tuple[np.ndarray, np.ndarray]]
PATH = 801  # points at which the heading of a bent strip is integrated


def hump(x, width):
    """exp(-ln 2 (2 x/width)^4): flat at 0, one half at x = width/2."""
    return np.exp(-np.log(2.0) * (2.0 * x / width) ** 4)


def between(low, high, part):
    """The point at `part` of the way from `low` to `high`."""
    return low + part * (high - low)


def comb(xi, eta, a):
    """Two tongues from below and one from above pass one another.

    x = xi; low = .65 a (h(xi - .2) + h(xi - .8)), high = 1 - .65 a h(xi - .5), h(x) = exp(-ln 2
    (2x/.14)^4); y = low + eta (high - low).
    """
    low = 0.65 * a * (hump(xi - 0.2, 0.14) + hump(xi - 0.8, 0.14))
    return xi, between(low, 1.0 - 0.65 * a * hump(xi - 0.5, 0.14), eta)


def opposed_tongues(xi, eta, a):
    """Two tongues grow towards each other until a gap of a tenth is left.

    x = xi; low = .45 a h(xi - .5), high = 1 - low, h(x) = exp(-ln 2 (2x/.2)^4); y = low + eta
    (high - low).
    """
    low = 0.45 * a * hump(xi - 0.5, 0.2)
    return xi, between(low, 1.0 - low, eta)


def wedge(xi, eta, a):
    """A wall folds up to a wedge of 45 degrees with a sharp edge.

    x = 1.5 xi; low = .9 a max(0, x - .6); y = low + eta (1.2 - low).
    """
    x = 1.5 * xi
    low = 0.9 * a * np.maximum(0.0, x - 0.6)
    return x, between(low, 1.2, eta)


def plate_on_wedge(xi, eta, a):
    """A flat plate is laid over a wedge: both of its faces bend at once.

    x = 2 xi - 1; y = .3 eta - .9 a ((x^2 + .0025)^(1/2) - .05).
    """
    x = 2.0 * xi - 1.0
    return x, 0.3 * eta - 0.9 * a * (np.sqrt(x * x + 0.0025) - 0.05)


def bubble(xi, eta, a):
    """Around a bubble: a half ring whose inner circle is dented to a kidney.

    angle = pi (1 - xi), r = .3 (1 - .7 a exp(-((angle - 1.2)/.45)^2)); radius = r + eta (1 - r);
    x, y = radius (cos, sin) angle.
    """
    angle = np.pi * (1.0 - xi)
    inner = 0.3 * (1.0 - 0.7 * a * np.exp(-(((angle - 1.2) / 0.45) ** 2)))
    radius = between(inner, 1.0, eta)
    return radius * np.cos(angle), radius * np.sin(angle)


def flattened_bubble(xi, eta, a):
    """Around a bubble that is pressed flat along x to a fifth of its width.

    angle = pi (1 - xi), radius = .4 + .6 eta; x = radius cos(angle) (1 - .8 a (1 - eta)), y =
    radius sin(angle).
    """
    angle = np.pi * (1.0 - xi)
    radius = between(0.4, 1.0, eta)
    return radius * np.cos(angle) * (1.0 - 0.8 * a * (1.0 - eta)), radius * np.sin(angle)


def pillow(xi, eta, a):
    """A square whose four sides bulge: three quarters of the way to a circle.

    X = 2 xi - 1, Y = 2 eta - 1; (x, y) = (X, Y) (1 - .75 a + .75 a 2^(1/2) max(|X|, |Y|)
    /(X^2 + Y^2)^(1/2)).
    """
    x, y = 2.0 * xi - 1.0, 2.0 * eta - 1.0
    far = np.maximum(np.hypot(x, y), 1e-12)
    factor = 1.0 - 0.75 * a + 0.75 * a * np.sqrt(2.0) * np.maximum(np.abs(x), np.abs(y)) / far
    return x * factor, y * factor


def nozzle_throat(xi, eta, a):
    """A channel is pinched from both sides to a fifth of its width.

    x = 3 xi; y = (eta - 1/2) (1 - .8 a exp(-((x - 1.5)/.4)^2)).
    """
    x = 3.0 * xi
    return x, (eta - 0.5) * (1.0 - 0.8 * a * np.exp(-(((x - 1.5) / 0.4) ** 2)))


def piston(xi, eta, a):
    """A flat piston presses the block to a tenth of its length.

    x = 1 - (1 - xi) (1 - .9 a); y = eta.
    """
    return 1.0 - (1.0 - xi) * (1.0 - 0.9 * a), eta


def bumpy_piston(xi, eta, a):
    """A piston with a bump: it goes half the way, the bump three quarters.

    front = a (.5 + .25 cos(2 pi (eta - 1/2))); x = front + xi (1 - front); y = eta.
    """
    front = a * (0.5 + 0.25 * np.cos(2.0 * np.pi * (eta - 0.5)))
    return between(front, 1.0, xi), eta


def four_waves(xi, eta, a):
    """Waves grow on all four sides at once; the corners stay.

    w(s) = .12 a sin(4 pi s) sin(pi s); x = xi + w(eta) (1 - 2 xi), y = eta + w(xi) (1 - 2 eta).
    """

    def wave(s):
        return 0.12 * a * np.sin(4.0 * np.pi * s) * np.sin(np.pi * s)

    return xi + wave(eta) * (1.0 - 2.0 * xi), eta + wave(xi) * (1.0 - 2.0 * eta)


def swinging_waves(xi, eta, a):
    """Parallel waves on all four sides swing there and back twice, and end where they began.

    w(s) = .14 sin(4 pi a) sin(3 pi s) sin(pi s); x = xi + w(eta), y = eta + w(xi).
    """

    def wave(s):
        return 0.14 * np.sin(4.0 * np.pi * a) * np.sin(3.0 * np.pi * s) * np.sin(np.pi * s)

    return xi + wave(eta), eta + wave(xi)


def pulse(xi, eta, a):
    """The lower side sinks to a valley, rises to a hill and goes back: the start comes again.

    x = xi; low = -.6 sin(2 pi a) sin(pi xi)^2; y = low + eta (1 - low).
    """
    low = -0.6 * np.sin(2.0 * np.pi * a) * np.sin(np.pi * xi) ** 2
    return xi, between(low, 1.0, eta)


def rough_tongue(xi, eta, a):
    """A tongue whose boundary nodes tremble by up to a tenth of their spacing all the way.

    x = xi + e(k, a) sin(pi xi); low = .6 a h(xi - .5) + e(k + 100, a) sin(pi xi), h(x) =
    exp(-ln 2 (2x/.16)^4), k = 32 xi; y = low + eta (1 - low); e(k, a) = .1/32 sin(2 pi (.618 k +
    (9 + 7 (.4142 k mod 1)) a)) on the lower side, 0 on the others.
    """

    def tremble(k):
        periods = 9.0 + 7.0 * ((0.4142 * k) % 1.0)
        return 0.1 / 32.0 * np.sin(2.0 * np.pi * (0.618 * k + periods * a)) * np.sin(np.pi * xi)

    k = 32.0 * xi
    low = 0.6 * a * hump(xi - 0.5, 0.16) + tremble(k + 100.0)
    return xi + np.where(eta == 0.0, tremble(k), 0.0), between(low, 1.0, eta)


def shear(xi, eta, a):
    """A square is sheared to a slanted parallelogram: a straight line family fits to the end.

    x = xi + 1.5 a eta, y = eta.
    """
    return xi + 1.5 * a * eta, eta


def turn(xi, eta, a):
    """A rectangle turns about its corner by 180 degrees and keeps its shape.

    angle = pi a; (x, y) = the point (1.5 xi, eta) turned by angle.
    """
    x = 1.5 * xi
    y = eta
    angle = np.pi * a
    return x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)


def step(xi, eta, a):
    """The lower side becomes a steep step, six tenths high and a tenth wide.

    x = xi; low = .3 a (1 + tanh((xi - .5)/.03)); y = low + eta (1 - low).
    """
    low = 0.3 * a * (1.0 + np.tanh((xi - 0.5) / 0.03))
    return xi, between(low, 1.0, eta)


def cusps(xi, eta, a):
    """The lower side becomes a trochoid with two sharp crests.

    b = .9 a; x = xi - b sin(4 pi xi) (1 - eta)/(4 pi); low = -b (1 - cos(4 pi xi))/(2 pi);
    y = low + eta (1 - low).
    """
    b = 0.9 * a
    low = -b * (1.0 - np.cos(4.0 * np.pi * xi)) / (2.0 * np.pi)
    return xi - b * np.sin(4.0 * np.pi * xi) * (1.0 - eta) / (4.0 * np.pi), between(low, 1.0, eta)


def squeezed_film(xi, eta, a):
    """The upper side comes down to a wavy film, three to eleven hundredths thick.

    x = xi; y = eta (1 - a (.93 + .04 cos(4 pi xi))).
    """
    return xi, eta * (1.0 - a * (0.93 + 0.04 * np.cos(4.0 * np.pi * xi)))


def omega(xi, eta, a):
    """A tongue with a cap wider than its neck: the lower side overhangs.

    h = exp(-ln 2 (2 (xi - .5)/.26)^4), d = xi - .5; x = .5 + d (1 + a (.9 h^3 - 2 h (1 - h))
    (1 - eta)); low = .55 a h; y = low + eta (1 - low).
    """
    h = hump(xi - 0.5, 0.26)
    d = xi - 0.5
    x = 0.5 + d * (1.0 + a * (0.9 * h**3 - 2.0 * h * (1.0 - h)) * (1.0 - eta))
    return x, between(0.55 * a * h, 1.0, eta)


def vortex_roll(xi, eta, a):
    """The upper side is rolled up by a vortex at its middle.

    d = xi - .5, angle = 3.4 a exp(-(d/.22)^2); x = xi + eta (.5 + d cos(angle) - xi), y = eta (1 +
    d sin(angle)).
    """
    d = xi - 0.5
    angle = 3.4 * a * np.exp(-((d / 0.22) ** 2))
    return between(xi, 0.5 + d * np.cos(angle), eta), between(0.0, 1.0 + d * np.sin(angle), eta)


def bent_strip(xi, eta, heading, length, width):
    """A strip along the path whose heading at xi is `heading(s)`, in radians."""
    s = np.linspace(0.0, 1.0, PATH)
    middle = heading(0.5 * (s[1:] + s[:-1]))
    path = [np.append(0.0, np.cumsum(f(middle))) * length / (PATH - 1) for f in (np.cos, np.sin)]
    x, y = (np.interp(xi, s, line) for line in path)
    away = width * (eta - 0.5)
    return x - away * np.sin(heading(xi)), y + away * np.cos(heading(xi))


def spiral_duct(xi, eta, a):
    """A straight duct coils up to a spiral of one turn.

    heading(s) = 2 pi a s^2; the middle line is the integral of 5 (cos, sin) heading over s = 0..xi;
    the point lies .4 (eta - 1/2) to its left.
    """
    return bent_strip(xi, eta, lambda s: 2.0 * np.pi * a * s * s, 5.0, 0.4)


def z_duct(xi, eta, a):
    """A straight duct folds to a Z with rounded turns of 120 degrees.

    heading(s) = -(pi/3) a (tanh((s - 1/3)/.04) - tanh((s - 2/3)/.04)); the middle line is the
    integral of 3 (cos, sin) heading over s = 0..xi; the point lies .2 (eta - 1/2) to its left.
    """

    def heading(s):
        rise = np.tanh((s - 1.0 / 3.0) / 0.04) - np.tanh((s - 2.0 / 3.0) / 0.04)
        return -np.pi / 3.0 * a * rise

    return bent_strip(xi, eta, heading, 3.0, 0.2)


def snake(xi, eta, a):
    """A duct bends to one and a half waves while it swings: its sides move along themselves.

    heading(s) = 1.6 a sin(3 pi s + 2 a); the middle line is the integral of 4 (cos, sin) heading
    over s = 0..xi; the point lies .4 (eta - 1/2) to its left.
    """
    return bent_strip(xi, eta, lambda s: 1.6 * a * np.sin(3.0 * np.pi * s + 2.0 * a), 4.0, 0.4)
