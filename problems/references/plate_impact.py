"""A plate hits another: impact, the shock at the free surface behind, and the release after it.

Plane waves by the Hugoniots and isentropes of both materials, which start without pressure.  In
mass coordinates the release from the flyer's back crosses the flyer and follows the shock through
the target; in the fan from the free surface m (t - out) is constant along it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hydro.eos.materials import Material
from problems.references.hugoniot import release
from problems.references.riemann import solve_riemann


class PlateImpact(NamedTuple):
    """Of the first impact: pressure [Pa] and speed [m/s] behind it, its time [s], and the time
    until the release from the flyer's back is at the contact, `back` [s].

    Of the target's free surface: speed `free` [m/s] from `out` to `end` [s]; `end` is NaN where the
    release has met the shock before.
    """

    pressure: float
    u: float
    impact: float
    back: float
    free: float
    out: float
    end: float


def compute_plate_impact(
    flyer: Material, target: Material, speed: float, gap: float, thickness: float, depth: float
) -> PlateImpact:
    """A flyer of `thickness` [m] at `speed` [m/s], first `gap` [m] before a target of `depth`."""
    bodies = (flyer.eos, (flyer.rho0, speed, 0.0)), (target.eos, (target.rho0, 0.0, 0.0))
    hit = solve_riemann(*bodies[0], *bodies[1])
    free = hit.u + release(target.eos, hit.rho_right, hit.p)[1]
    impact = gap / speed
    out = impact + depth / hit.right_wave.head
    z_flyer = hit.rho_left * float(flyer.eos.sound_speed(hit.rho_left, hit.p))
    z = hit.rho_right * float(target.eos.sound_speed(hit.rho_right, hit.p))
    z_free = target.rho0 * float(target.eos.sound_speed(target.rho0, 0.0))
    back = thickness / (speed - hit.left_wave.head) + flyer.rho0 * thickness / z_flyer
    catch = (target.rho0 * depth + z * (impact + back - out)) / (2.0 * z)  # after `out`, at the fan
    end = out + 2.0 * catch * math.sqrt(z / z_free) if catch > 0.0 else math.nan
    return PlateImpact(hit.p, hit.u, impact, back, free, out, end)
