"""Shock polars, oblique collision and jets against closed forms and computed tables."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from shockgrid.hydro.eos import IdealGas, StiffenedGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.references.shock_polars import (
    Body,
    ShockPolar,
    compute_jet_speed,
    find_critical_angle,
    search_pressure,
    solve_collision,
)


def make_body(name):
    material = find_material(name)
    return Body(material.eos, material.rho0)


AL, STEEL, LEAD = (make_body(name) for name in ("Al1100", "SS304", "Pb"))
WATER = Body(StiffenedGas(4.4, 6.0e8), 1000.0, 1.0e5)
PAIRS = {"steel": STEEL, "aluminium": AL, "rigid": None}


def make_gas(gamma=1.4, p=1.0):
    """Gas of sound speed 1 at p = 1, so that a flow speed is a Mach number."""
    return Body(IdealGas(gamma), gamma, p)


def deflect_gas(gamma, mach, angle):
    """The theta-beta-M relation of an ideal gas."""
    excess = (mach * math.sin(angle)) ** 2 - 1.0
    return math.atan(
        2.0 / math.tan(angle) * excess / (mach**2 * (gamma + math.cos(2.0 * angle)) + 2.0)
    )


@pytest.mark.parametrize("gamma", [1.2, 1.4, 5 / 3])
@pytest.mark.parametrize("mach", [1.3, 2.0, 8.0])
def test_gas_polar_is_the_closed_form(gamma, mach):
    polar = ShockPolar(make_gas(gamma), mach)
    for share in (0.1, 0.5, 0.9, 1.0):
        angle = math.asin(1.0 / mach) * (1.0 - share) + 0.5 * math.pi * share
        normal = (mach * math.sin(angle)) ** 2
        p = 1.0 + 2.0 * gamma / (gamma + 1.0) * (normal - 1.0)
        shock = polar.shock_to(p) if share < 1.0 else polar.normal_shock
        assert shock.p == pytest.approx(p)
        assert shock.deflection == pytest.approx(deflect_gas(gamma, mach, angle), abs=1e-7)
        if share < 1.0:
            assert polar.deflection(shock.p) == pytest.approx(shock.deflection, rel=1e-9)


def test_detachment_and_sonic_point_of_gas_at_mach_2():
    polar = ShockPolar(make_gas(), 2.0)
    top = polar.shock_to(search_pressure([polar], 0.7)[1])
    low, high = polar.body.p, polar.normal_shock.p
    sonic = polar.shock_to(
        brentq(lambda p: polar.shock_to(p).mach_behind - 1.0, low, high, rtol=1e-14)
    )
    assert math.degrees(top.deflection) == pytest.approx(22.97353, abs=1e-5)
    assert math.degrees(top.wave_angle) == pytest.approx(64.669, abs=1e-3)
    # gamma = 1.4 and M = 2 in the closed forms of sin²(phi) at both points
    root = math.sqrt(2.4 * (1.0 + 0.2 * 4.0 + 0.15 * 16.0))
    assert math.sin(top.wave_angle) ** 2 == pytest.approx((2.4 - 1.0 + root) / 5.6, rel=1e-6)
    root = math.sqrt(2.4 * (0.65 - 0.8 + 2.4))
    assert math.sin(sonic.wave_angle) ** 2 == pytest.approx((2.4 - 0.4 + root) / 5.6, rel=1e-12)
    assert sonic.mach_behind == pytest.approx(1.0, abs=1e-12)
    assert sonic.p < top.p
    assert math.degrees(sonic.wave_angle) == pytest.approx(61.485, abs=1e-3)


@pytest.mark.parametrize(
    "body, speed", [(AL, 9000.0), (STEEL, 6000.0), (LEAD, 2500.0), (WATER, 3000.0)]
)
def test_oblique_shocks_conserve_mass_momentum_and_energy(body, speed):
    polar = ShockPolar(body, speed)
    normal = polar.normal_shock
    assert normal.deflection == pytest.approx(0.0, abs=1e-6)
    for share in (0.05, 0.4, 0.8, 0.99):
        wave = polar.shock_to(body.p + share * (normal.p - body.p))
        across = speed * math.sin(wave.wave_angle)
        behind = wave.speed_behind * math.sin(wave.wave_angle - wave.deflection)
        flux = body.rho * across
        assert wave.rho * behind == pytest.approx(flux, rel=1e-10)
        assert wave.p + flux * behind == pytest.approx(body.p + flux * across, rel=1e-10)
        along = wave.speed_behind * math.cos(wave.wave_angle - wave.deflection)
        assert along == pytest.approx(speed * math.cos(wave.wave_angle), rel=1e-10)
        total = [
            float(body.eos.energy(rho, p)) + p / rho + 0.5 * q**2
            for rho, p, q in ((body.rho, body.p, speed), (wave.rho, wave.p, wave.speed_behind))
        ]
        assert total[1] == pytest.approx(total[0], rel=1e-10)
        assert polar.deflection(wave.p) == pytest.approx(wave.deflection, rel=1e-12)


TABLE = {
    (2, 8): (30.07481, 5.44936, 2.55064, 31.3187, 22.8705),
    (2, 10): (33.04748, 6.70250, 3.29750, 41.7369, 29.4859),
    (3, 10): (48.80798, 6.7825, 3.2175, 29.184, 20.616),
    (3, 12): (51.37507, 8.08037, 3.91963, 36.5658, 25.2116),
}
DIGITS = 5e-6, 5e-6, 5e-6, 5e-5, 5e-5  # half of the last one


@pytest.mark.parametrize("speed, angle", TABLE)
def test_attached_shocks_of_aluminium_on_steel(speed, angle):
    found = solve_collision(AL, STEEL, 1000.0 * speed, math.radians(angle))
    assert found.attached
    angles = (
        found.plate.deflection,
        found.wedge.deflection,
        found.plate.wave_angle,
        found.wedge.wave_angle,
    )
    values = (found.p / 1e9, *(math.degrees(value) for value in angles))
    digits = np.multiply(DIGITS, (1, 10, 10, 10, 10) if (speed, angle) == (3, 10) else 1)
    assert (np.abs(np.subtract(values, TABLE[speed, angle])) <= 1.01 * digits).all()
    assert found.plate.p == found.wedge.p == found.p
    assert sum(angles[:2]) == pytest.approx(math.radians(angle), rel=1e-12)
    assert found.contact_speed * math.sin(math.radians(angle)) == pytest.approx(1000.0 * speed)


# The table of reference numbers has 20.682 for the last of aluminium on aluminium; a search on a
# grid of 4 million pressures with the Hugoniot in closed form gave 20.68148, as found here.
CRITICAL = {
    "steel": (7.456, 12.364, 16.057, 18.986),
    "aluminium": (7.669, 13.035, 17.243, 20.6815),
    "rigid": (6.523, 10.395, 13.172, 15.312),
}


@pytest.mark.parametrize("speed", [1, 2, 3, 4])
@pytest.mark.parametrize("pair", PAIRS)
def test_critical_angle_of_aluminium_plate(pair, speed):
    wedge = PAIRS[pair]
    found = find_critical_angle(AL, wedge, 1000.0 * speed)
    assert math.degrees(found) == pytest.approx(CRITICAL[pair][speed - 1], abs=5e-4)
    below, above = (
        solve_collision(AL, wedge, 1000.0 * speed, factor * found)
        for factor in (1.0 - 1e-7, 1.0 + 1e-7)
    )
    assert below.attached and not above.attached


@pytest.mark.parametrize("degrees", [5.0, 30.0, 60.0])
def test_birkhoff_jet(degrees):
    """In the frame of the wall the plate has no momentum along itself, and keeps its energy."""
    angle = math.radians(degrees)
    speed = 2000.0
    # of the plate's mass
    jet = compute_jet_speed(speed, angle)
    part = math.sin(0.5 * angle) ** 2
    slug = 2.0 * speed / math.sin(angle) - jet  # as fast the other way in the frame of A
    assert part * jet + (1.0 - part) * slug == pytest.approx(speed * math.sin(angle))
    assert part * jet**2 + (1.0 - part) * slug**2 == pytest.approx(speed**2)
