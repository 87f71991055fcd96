"""Waves in plates that meet, by characteristics: pressures, when they part, with which speeds.

Written for these tests alone, in Lagrangian mass coordinates, from each material's own Hugoniot
and isentropes; nothing of the scheme is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from shockgrid.problems.references.hugoniot import make_isentrope, shock_to_pressure


def find_impact(flyer, target, speed, p=0.0):
    """Shocks in both (equations of state with densities) after an impact at a relative speed."""

    def excess(pressure):
        return sum(shock_to_pressure(*one, p, pressure).particle_speed for one in (flyer, target))

    eos, rho = flyer
    scale = (eos.sound_speed(rho, p) + 2.0 * speed) * rho * speed
    found = brentq(lambda q: excess(q) - speed, p + 1e-3 * scale, p + 10.0 * scale)
    return tuple(shock_to_pressure(*one, p, found) for one in (flyer, target))


class Release:
    """The isentrope through a shocked state down to p = 0: impedances, integrals of dp / rho c."""

    def __init__(self, eos, shock, points=2001):
        curve = make_isentrope(eos, shock.rho, shock.p)
        self.p = np.linspace(0.0, shock.p, points)
        gains = np.array([float(curve.velocity_gain(p)) for p in self.p])
        self.integral = gains[0] - gains  # from p = 0 up
        rho = np.array([float(curve.density(p)) for p in self.p])
        self.z = rho * np.array(
            [float(eos.sound_speed(r, p)) for r, p in zip(rho, self.p, strict=True)]
        )

    def find_integral(self, p):
        return np.interp(p, self.p, self.integral)

    def find_state(self, integral):
        """Pressure and impedance where the integral has a value (below 0: tension)."""
        p = np.interp(integral, self.integral, self.p)
        if integral < 0.0:
            p = integral * self.z[0]
        return p, np.interp(p, self.p, self.z)


@dataclass
class Parting:
    """When a flyer and what it has met part, and the mean speed with which the flyer goes on."""

    time: float
    flyer_speed: float
    p: float
    u: float


def find_parting(flyer, target, speed, thickness, lines=400):
    """A flyer (eos, rho) of a thickness on a target that is so thick that nothing comes back.

    With target = None it meets its mirror image.
    """
    eos, rho = flyer
    mirror = target is None
    one, other = find_impact(flyer, flyer if mirror else target, speed)
    u = speed - one.particle_speed
    mass = rho * thickness
    release = Release(eos, one)
    beyond = None if mirror else Release(target[0], other)
    t_back = thickness / one.shock_speed
    whole = float(release.integral[-1])
    minus = u - whole  # u - F of the shocked flyer
    contact_u = u
    contact_f = 0.0 if mirror else float(beyond.integral[-1])

    def meet(plus):
        """Pressure and speed at the contact for an arriving invariant u + F."""
        if mirror:
            return release.find_state(plus - contact_u)[0], contact_u

        def excess(p):
            own = p / release.z[0] if p < 0.0 else release.find_integral(p)
            there = p / beyond.z[0] if p < 0.0 else beyond.find_integral(p)
            return contact_u - contact_f + there + own - plus

        p = brentq(excess, -0.5 * one.p, 1.0 * one.p)
        return p, contact_u - contact_f + (p / beyond.z[0] if p < 0.0 else beyond.find_integral(p))

    column = []  # nodes of the line before on the lines that come back: (m, t, J-)
    plus_before = u + whole
    impulse = 0.0
    before = (0.0, one.p)
    for k in range(lines + 1):
        own = whole * (1.0 - k / lines)  # F of this line of the fan
        plus = minus + 2.0 * own
        m = 0.0
        t = t_back
        z = release.find_state(own)[1]
        nodes = []
        for m_right, t_right, back in column:
            _, z_right = release.find_state(0.5 * (plus_before - back))
            _, z_new = release.find_state(0.5 * (plus - back))
            up = 0.5 * (z + z_new)
            down = 0.5 * (z_right + z_new)
            t_new = (m_right - m + up * t + down * t_right) / (up + down)
            m = m + up * (t_new - t)
            t = t_new
            z = z_new
            nodes.append((m, t, back))
        p, u_contact = meet(plus)
        z_new = release.find_state(release.find_integral(p) if p > 0.0 else p / release.z[0])[1]
        t += (mass - m) / (0.5 * (z + z_new))
        if p <= 0.0:
            part = before[1] / (before[1] - p)
            time = before[0] + part * (t - before[0])
            impulse += 0.5 * before[1] * (time - before[0])
            return Parting(time, speed - impulse / mass, one.p, u)
        impulse += 0.5 * (p + before[1]) * (t - before[0])
        before = t, p
        own_there = 0.5 * (plus - (u_contact - (plus - u_contact)))
        nodes.append((mass, t, u_contact - own_there))
        column = nodes
        plus_before = plus
    raise AssertionError("the plates do not part")
