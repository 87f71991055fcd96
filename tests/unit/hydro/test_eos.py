"""Equations of state: round trips, sound speed along the isentrope, refused parameters."""

import numpy as np
import pytest

from hydro.eos import JWL, IdealGas, MieGruneisen, PhaseTransition, StiffenedGas
from hydro.eos.base import make_least_pressure
from regrid.errors import BadInput
from shockgrid.testing import check_inverse, check_numbers, check_sound_speed

# equation of state, densities and pressures that it is asked for
STATES = {
    "ideal gas": (IdealGas(1.4), np.array([0.1, 1.0, 30.0]), np.array([1e3, 1e5, 1e8])),
    "stiffened gas": (
        StiffenedGas(4.4, 6e8),
        np.array([800.0, 1000.0, 1300.0]),
        np.array([-1e8, 1e5, 5e9]),
    ),
    "compressed metal": (
        MieGruneisen(2707.0, 5386.0, 1.339, 1.97),
        np.array([2710.0, 3200.0, 3700.0]),
        np.array([1e8, 3e10, 9e10]),
    ),
    "released metal": (
        MieGruneisen(2707.0, 5386.0, 1.339, 1.97),
        np.array([2400.0, 2600.0, 2700.0]),
        np.array([-4.4e8, 0.0, 1e9]),  # half the tension that it bears at 2400 kg/m³ is 4.43e8
    ),
    "explosive and products": (
        JWL(),
        np.array([10.0, 300.0, 1600.0, 1700.0, 2200.0]),
        np.array([1e9, 1e10, 3e10]),
    ),
    "graphite": (PhaseTransition(), np.array([2100.0, 2300.0, 2800.0]), np.array([1e8, 2e10])),
    "graphite and diamond": (
        PhaseTransition(),
        np.array([2950.0, 3300.0, 3700.0]),
        np.array([3e10, 6e10]),
    ),
    "diamond": (PhaseTransition(), np.array([3800.0, 4200.0]), np.array([6e10, 2e11])),
    "hot mixture": (
        PhaseTransition(),
        np.array([3000.0, 3300.0, 3600.0]),
        np.array([8e10, 1.5e11]),
    ),
}


@pytest.fixture(params=STATES)
def case(request):
    eos, rho, p = STATES[request.param]
    return eos, *(a.ravel() for a in np.meshgrid(rho, p))


def test_pressure_of_energy_of_pressure(case):
    check_inverse(*case)


def test_sound_speed_is_the_slope_of_the_isentrope(case):
    check_sound_speed(*case)


def test_numbers_and_signs(case):
    check_numbers(*case)


@pytest.mark.parametrize(
    "eos",
    [
        MieGruneisen(2707.0, 5386.0, 1.339, 1.97, strength=1e9),
        PhaseTransition(strength=2e7),
        JWL(strength=1e7),
    ],
    ids=lambda eos: eos.kind,
)
def test_torn_material_has_the_sound_of_its_pieces(eos):
    rho = eos.rho0 * np.array([0.001, 0.1, 0.98])
    least = make_least_pressure(type(eos))(rho, eos.parameters)
    assert least == pytest.approx(-eos.strength * rho / eos.rho0)  # of the part that pieces fill
    torn = eos.sound_speed(rho, least)
    whole = eos.sound_speed(eos.rho0, 0.0)
    assert torn == pytest.approx(whole, rel=0.02)
    p = 0.55 * np.linspace(-eos.strength, 0.0, 2001)
    c = eos.sound_speed(0.55 * eos.rho0, p[p < -0.55 * 0.5 * eos.strength])
    assert np.isfinite(c).all() and np.abs(np.diff(c)).max() < 0.01 * whole


def test_metal_is_at_rest_at_its_reference():
    eos = MieGruneisen(2707.0, 5386.0, 1.339, 1.97)
    assert eos.pressure(2707.0, 0.0) == 0.0
    assert eos.sound_speed(2707.0, 0.0) == pytest.approx(5386.0, rel=1e-14)


@pytest.mark.parametrize("particle_speed", [100.0, 1000.0, 2500.0])
def test_metal_hugoniot(particle_speed):
    eos = MieGruneisen(2707.0, 5386.0, 1.339, 1.97)
    speed = 5386.0 + 1.339 * particle_speed
    rho = 2707.0 * speed / (speed - particle_speed)
    p = 2707.0 * speed * particle_speed
    assert eos.pressure(rho, 0.5 * particle_speed**2) == pytest.approx(p, rel=1e-12)


@pytest.mark.parametrize(
    "make, word",
    [
        (lambda: IdealGas(1.0), "gamma"),
        (lambda: StiffenedGas(0.9, 1.0), "gamma"),
        (lambda: StiffenedGas(4.4, -1.0), "p_inf"),
        (lambda: MieGruneisen(-1.0, 1.0, 1.0, 1.0), "rho0"),
        (lambda: MieGruneisen(1.0, 1.0, float("nan"), 1.0), "s is"),
    ],
)
def test_bad_parameters_are_named(make, word):
    with pytest.raises(BadInput, match=word):
        make()
