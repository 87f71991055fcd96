"""Growth of interfaces in closed form: impulsive and non-linear models, gravity modes in layers.

Everything in the caller's units.  The trap: the impulsive rate is 2-40 % off the compressible one
(`linear_growth`), and the non-linear models are models, not solutions.
"""

from __future__ import annotations

import math

import numpy as np


def compute_atwood_number(rho_first: float, rho_second: float) -> float:
    """`A = (rho2 - rho1)/(rho2 + rho1)`, positive when the second material is denser."""
    return (rho_second - rho_first) / (rho_second + rho_first)


def compute_impulsive_rate(
    wavenumber: float, amplitude: float, velocity: float, atwood: float
) -> float:
    """da/dt = k a u A+ after an impulsive acceleration [Richtmyer1960].

    `atwood` A+ is that just after the shock and `velocity` that of the contact.  The `amplitude` a
    is a+, just after the shock, where a shock is reflected, and the mean of a+ and that before the
    shock where a rarefaction is [MeyerBlewett1972].
    """
    return wavenumber * amplitude * velocity * atwood


def compute_pade_rate(wavenumber: float, amplitude: float, rate: float, atwood: float, t):
    """da/dt at the times `t` (any shape) in the non-linear stage [ZhangSohn1997].

    `v = v0/(1 + v0 a0 k² t + max(0, a0² k² - A² + 1/2) v0² k² t²)` for the half height of bubble
    and spike; `amplitude` a0 and the linear `rate` v0 > 0 just after the shock.  Quoted from memory
    of the literature.  Its range: `find_pade_range`.
    """
    reduced = rate * np.asarray(t, dtype=float)
    square = max(0.0, (amplitude * wavenumber) ** 2 - atwood**2 + 0.5)
    denominator = 1.0 + reduced * amplitude * wavenumber**2 + square * (wavenumber * reduced) ** 2
    return rate / denominator


def find_pade_range(wavenumber: float, amplitude: float, rate: float, atwood: float) -> float:
    """Time after the shock up to which `compute_pade_rate` can be right; inf without such an end.

    The growth of one mode slows down like 1/t and no faster [Sadot1998].  The model's goes over to
    1/t² where c (k v0 t)² = 1, c = a0² k² - A² + 1/2: from there on it is no approximation.
    """
    square = (amplitude * wavenumber) ** 2 - atwood**2 + 0.5
    return math.inf if square <= 0.0 else 1.0 / (math.sqrt(square) * wavenumber * rate)


def compute_pade_amplitude(wavenumber: float, amplitude: float, rate: float, atwood: float, t):
    """Amplitude at the ascending times `t` (n,) from t = 0 by the rate of `compute_pade_rate`.

    Integrated by Simpson's rule between the times, 16 pieces each.
    """
    t = np.asarray(t, dtype=float)
    start = np.concatenate([[0.0], t[:-1]])
    position = np.linspace(0.0, 1.0, 33)
    weight = np.full(33, 2.0)
    weight[1::2] = 4.0
    weight[[0, -1]] = 1.0
    times = start[:, None] + (t - start)[:, None] * position
    speed = compute_pade_rate(wavenumber, amplitude, rate, atwood, times)
    return amplitude + np.cumsum((speed @ weight) / 96.0 * (t - start))


def compute_gravity_mode(
    wavenumber: float,
    gravity: float,
    rho_lower: float,
    rho_upper: float,
    depth_lower: float = math.inf,
    depth_upper: float = math.inf,
) -> float:
    """omega² of the mode k between two inviscid incompressible layers ([Lamb1932] art. 231).

    `omega² = g k (rho_lower - rho_upper)/(rho_lower coth k h_lower + rho_upper coth k h_upper)`
    with rigid walls at the depths h.  Positive: a standing wave with that omega; negative:
    Rayleigh-Taylor growth at the rate `sqrt(-omega²)`.  `rho_upper = 0` is a free surface.
    """
    lower = rho_lower / math.tanh(wavenumber * depth_lower)
    upper = rho_upper / math.tanh(wavenumber * depth_upper)
    return gravity * wavenumber * (rho_lower - rho_upper) / (lower + upper)
