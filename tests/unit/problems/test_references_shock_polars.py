"""Shock polars, oblique collision and jets against closed forms and computed tables."""

import math

import pytest
from scipy.optimize import brentq

from hydro.eos import IdealGas, StiffenedGas
from hydro.eos.materials import find_material
from problems.references.shock_polars import (
    Body,
    ShockPolar,
    compute_birkhoff_jet,
    find_critical_angle,
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


def turn_gas(gamma, mach):
    """The Prandtl-Meyer function."""
    ratio = math.sqrt((gamma + 1.0) / (gamma - 1.0))
    root = math.sqrt(mach**2 - 1.0)
    return ratio * math.atan(root / ratio) - math.atan(root)


@pytest.mark.parametrize("gamma", [1.2, 1.4, 5 / 3])
@pytest.mark.parametrize("mach", [1.3, 2.0, 8.0])
def test_gas_polar_is_the_closed_form(gamma, mach):
    polar = ShockPolar(make_gas(gamma), mach)
    for share in (0.1, 0.5, 0.9, 1.0):
        angle = math.asin(1.0 / mach) * (1.0 - share) + 0.5 * math.pi * share
        normal = (mach * math.sin(angle)) ** 2
        p = 1.0 + 2.0 * gamma / (gamma + 1.0) * (normal - 1.0)
        shock = polar.wave_to_pressure(p) if share < 1.0 else polar.find_normal_shock()
        assert shock.p == pytest.approx(p)
        assert shock.deflection == pytest.approx(deflect_gas(gamma, mach, angle), abs=1e-7)
        if share < 1.0:
            assert polar.deflection(shock.p) == pytest.approx(shock.deflection, rel=1e-9)


def test_detachment_and_sonic_point_of_gas_at_mach_2():
    polar = ShockPolar(make_gas(), 2.0)
    top = polar.find_detachment()
    low, high = polar.body.p, polar.find_normal_shock().p
    sonic = polar.wave_to_pressure(
        brentq(lambda p: polar.wave_to_pressure(p).mach_behind - 1.0, low, high, rtol=1e-14)
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
    normal = polar.find_normal_shock()
    assert normal.deflection == pytest.approx(0.0, abs=1e-6)
    for share in (0.05, 0.4, 0.8, 0.99):
        wave = polar.wave_to_pressure(body.p + share * (normal.p - body.p))
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


@pytest.mark.parametrize("ratio", [0.99, 0.5, 0.05])
def test_fan_in_gas_is_the_prandtl_meyer_function(ratio):
    gamma, mach = 1.4, 2.0
    wave = ShockPolar(make_gas(gamma), mach).wave_to_pressure(ratio)
    stagnation = (1.0 + 0.2 * mach**2) * ratio ** (-0.4 / 1.4)
    behind = math.sqrt((stagnation - 1.0) / 0.2)
    assert wave.kind == "fan"
    assert wave.mach_behind == pytest.approx(behind, rel=1e-9)
    assert -wave.deflection == pytest.approx(turn_gas(gamma, behind) - turn_gas(gamma, mach))
    assert wave.wave_angle == pytest.approx(math.pi / 6.0)


TABLE = {
    (2, 8): (30.07481, 5.44936, 2.55064, 31.3187, 22.8705),
    (2, 10): (33.04748, 6.70250, 3.29750, 41.7369, 29.4859),
    (3, 10): (48.80798, 6.7825, 3.2175, 29.184, 20.616),
    (3, 12): (51.37507, 8.08037, 3.91963, 36.5658, 25.2116),
}
LAST_DIGITS = {
    (2, 8): (5e-6, 5e-6, 5e-6, 5e-5, 5e-5),
    (2, 10): (5e-6, 5e-6, 5e-6, 5e-5, 5e-5),
    (3, 10): (5e-6, 5e-5, 5e-5, 5e-4, 5e-4),
    (3, 12): (5e-6, 5e-6, 5e-6, 5e-5, 5e-5),
}


@pytest.mark.parametrize("speed, angle", TABLE)
def test_attached_shocks_of_aluminium_on_steel(speed, angle):
    found = solve_collision(AL, STEEL, 1000.0 * speed, math.radians(angle))
    assert found.attached and found.regime == "attached"
    angles = (
        found.plate.deflection,
        found.wedge.deflection,
        found.plate.wave_angle,
        found.wedge.wave_angle,
    )
    values = (found.p / 1e9, *(math.degrees(value) for value in angles))
    for value, wanted, digit in zip(
        values, TABLE[speed, angle], LAST_DIGITS[speed, angle], strict=True
    ):
        assert value == pytest.approx(wanted, abs=1.01 * digit)
    assert found.plate.p == found.wedge.p == found.p
    assert found.plate.deflection + found.wedge.deflection == pytest.approx(found.angle, rel=1e-12)
    assert found.contact_speed * math.sin(found.angle) == pytest.approx(found.speed)
    assert found.plate_flow_speed * math.tan(found.angle) == pytest.approx(found.speed)


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
    assert math.degrees(found.angle) == pytest.approx(CRITICAL[pair][speed - 1], abs=5e-4)
    below, above = (
        solve_collision(AL, wedge, 1000.0 * speed, factor * found.angle)
        for factor in (1.0 - 1e-7, 1.0 + 1e-7)
    )
    assert below.attached and not above.attached
    assert below.p == pytest.approx(found.p, rel=1e-3)
    assert found.plate_mach == pytest.approx(below.plate_mach, rel=1e-6)
    assert found.wedge_mach == pytest.approx(below.wedge_mach, rel=1e-6)
    assert found.contact_speed == pytest.approx(below.contact_speed, rel=1e-6)


@pytest.mark.parametrize("degrees", [5.0, 30.0, 60.0])
def test_birkhoff_jet(degrees):
    angle, speed, rho = math.radians(degrees), 2000.0, 2707.0
    jet = compute_birkhoff_jet(rho, speed, angle)
    assert jet.jet_speed == pytest.approx(speed / math.tan(0.5 * angle))
    assert jet.jet_fraction == pytest.approx(0.5 * (1.0 - math.cos(angle)))
    flow, contact = speed / math.tan(angle), speed / math.sin(angle)
    assert jet.jet_speed - contact == pytest.approx(flow)
    assert contact - jet.slug_speed == pytest.approx(flow)
    assert jet.stagnation_pressure == pytest.approx(0.5 * rho * flow**2)
    # in the frame of the wall the plate has no momentum along itself, and all of its energy stays
    along = jet.jet_fraction * jet.jet_speed + (1.0 - jet.jet_fraction) * jet.slug_speed
    assert along == pytest.approx(speed * math.sin(angle))
    energy = jet.jet_fraction * jet.jet_speed**2 + (1.0 - jet.jet_fraction) * jet.slug_speed**2
    assert energy == pytest.approx(speed**2)
