"""Shock states, isentropes and free-surface speeds against closed forms and computed tables."""

import numpy as np
import pytest

from hydro.eos import MieGruneisen, StiffenedGas
from problems.references.hugoniot import (
    shock_to_pressure,
    shock_with_mach,
    shock_with_particle_speed,
    shock_with_speed,
)
from problems.references.isentrope import (
    GeneralIsentrope,
    compute_free_surface_speed,
    make_isentrope,
)

METALS = {
    "Al1100": (2.707, 5.386, 1.339, 1.97),
    "SS304": (7.896, 4.569, 1.490, 2.17),
    "Pb": (11.350, 2.051, 1.46, 2.77),
}


def make_metal(name):
    return MieGruneisen(*METALS[name])


@pytest.mark.parametrize("name", METALS)
@pytest.mark.parametrize("particle_speed", [1e-3, 0.5, 2.0])
def test_metal_shock_lies_on_its_linear_hugoniot(name, particle_speed):
    rho0, c0, s, _ = METALS[name]
    shock = shock_with_particle_speed(make_metal(name), rho0, 0.0, particle_speed)
    assert shock.shock_speed == pytest.approx(c0 + s * particle_speed, rel=1e-11)
    assert shock.p == pytest.approx(rho0 * shock.shock_speed * particle_speed, rel=1e-11)
    assert shock.e == pytest.approx(0.5 * particle_speed**2, rel=1e-9)


@pytest.mark.parametrize(
    "eos, rho, p", [(make_metal("Al1100"), 2.8, 1.0), (StiffenedGas(4.4, 0.6), 1.0, 1e-4)]
)
def test_every_way_of_asking_gives_the_same_shock(eos, rho, p):
    shock = shock_to_pressure(eos, rho, p, 20.0)
    by_speed = shock_with_speed(eos, rho, p, shock.shock_speed)
    by_particle = shock_with_particle_speed(eos, rho, p, shock.particle_speed)
    by_mach = shock_with_mach(eos, rho, p, shock.shock_speed / eos.sound_speed(rho, p))
    for other in (by_speed, by_particle, by_mach):
        assert other.p == pytest.approx(20.0, rel=1e-10)


@pytest.mark.parametrize(
    "name, particle_speed, ratio",
    [
        ("Al1100", 1.0, 1.00291),
        ("Al1100", 2.0, 1.01109),
        ("SS304", 1.0, 1.00490),
        ("Pb", 0.5, 1.00831),
        ("Pb", 1.0, 1.02602),
    ],
)
def test_free_surface_speed_of_metals(name, particle_speed, ratio):
    eos = make_metal(name)
    shock = shock_with_particle_speed(eos, METALS[name][0], 0.0, particle_speed)
    speed = compute_free_surface_speed(eos, shock.rho, shock.p, particle_speed)
    assert speed / (2.0 * particle_speed) == pytest.approx(ratio, abs=6e-6)


def test_integrated_isentrope_is_the_closed_form():
    eos = StiffenedGas(4.4, 0.6)
    closed, general = make_isentrope(eos, 1.4, 5.0), GeneralIsentrope(eos, 1.4, 5.0)
    p = np.array([8.0, 5.0, 2.0, 0.0, -0.5])
    np.testing.assert_allclose(general.density(p), closed.density(p), rtol=1e-10)
    np.testing.assert_allclose(general.velocity_gain(p), closed.velocity_gain(p), atol=1e-10)
    fan = closed.sound_speed(p[2:]) - closed.velocity_gain(p[2:])
    np.testing.assert_allclose(closed.pressure_in_fan(fan), p[2:], atol=1e-12)
    np.testing.assert_allclose(general.pressure_in_fan(fan, -0.55), p[2:], atol=1e-9)
