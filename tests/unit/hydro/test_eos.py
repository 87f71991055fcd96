"""Equations of state: inverses, sound speed, Hugoniot, detonation, phase transition, refusals."""

import numpy as np
import pytest

from shockgrid.hydro.eos import JWL, IdealGas, MieGruneisen, PhaseTransition, StiffenedGas
from shockgrid.hydro.eos.base import make_least_pressure
from shockgrid.hydro.eos.materials import LIBRARY, find_material, read_materials
from shockgrid.hydro.eos.phase_transition import hugoniot
from shockgrid.hydro.formulas.reconstruction import GENTLE_STEEPNESS, LIMITERS, choose_limit
from shockgrid.problems.references.hugoniot import shock_to_pressure
from shockgrid.regrid.errors import BadInput
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
    """At the tension at which it tears, however little of it there is; continuous on the way."""
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


@pytest.mark.parametrize(
    "name, speed, pressure", [("TNT", 6929.0, 21.00e9), ("Comp-B", 7980.0, 29.50e9)]
)
def test_detonation_states(name, speed, pressure):
    eos = find_material(name).eos
    found_speed, found_pressure, rho = eos.find_detonation()
    assert found_speed == pytest.approx(speed, rel=1e-4)
    assert found_pressure == pytest.approx(pressure, rel=1e-4)
    velocity = found_speed * (1.0 - eos.rho0 / rho)
    assert found_pressure == pytest.approx(eos.rho0 * found_speed * velocity, rel=1e-9)
    sound = eos.sound_speed(rho, found_pressure)
    assert velocity + sound == pytest.approx(found_speed, rel=1e-6), "sonic behind the front"
    energy = 0.5 * found_pressure * (1.0 / eos.rho0 - 1.0 / rho) + eos.energy0 / eos.rho0
    assert float(eos.energy(rho, found_pressure)) == pytest.approx(energy, rel=1e-8)


def test_the_heat_turns_the_explosive_at_rest_into_the_products_of_its_volume():
    eos = find_material("TNT").eos
    assert eos.pressure(eos.rho0, eos.energy(eos.rho0, 0.0)) == pytest.approx(0.0, abs=1e-3)
    burnt = float(eos.energy(eos.rho0, 0.0)) + eos.heat
    assert burnt * eos.rho0 == pytest.approx(7.0e9, rel=1e-12)
    assert 2000.0 < eos.sound_speed(eos.rho0, 0.0) < 4000.0, "solid explosive carries sound"


@pytest.fixture
def graphite():
    return find_material("graphite-diamond").eos


def test_the_hugoniot_goes_through_onset_and_completion(graphite):
    start, end = graphite.mixed_region
    values = [float(hugoniot(eta, graphite.parameters)[0]) for eta in (start, end)]
    assert values == pytest.approx([2.5e10, 4e10], rel=1e-12)
    eta = np.linspace(-0.2, 0.55, 400)
    assert (np.diff(hugoniot(eta, graphite.parameters)[0]) > 0.0).all()
    assert graphite.compute_second_part(2200.0) == 0.0
    middle = graphite.rho0 / (1.0 - 0.5 * (start + end))
    assert graphite.compute_second_part(middle) == pytest.approx(0.5)


def test_states_above_completion_are_shocked_diamond(graphite):
    diamond = find_material("diamond").eos
    for rho in (3700.0, 4200.0, 4600.0):
        p = float(hugoniot(1.0 - 2200.0 / rho, graphite.parameters)[0])
        energy = 0.5 * p * (1.0 / 2200.0 - 1.0 / rho)
        assert float(diamond.pressure(rho, energy)) == pytest.approx(p, rel=1e-12)
        assert float(graphite.pressure(rho, energy)) == pytest.approx(p, rel=1e-12)


def test_the_sound_speed_is_real_wherever_shocks_and_isentropes_lead(graphite):
    mixed = 0.5 * sum(graphite.mixed_region)
    for first in (0.15, graphite.mixed_region[0], mixed, 0.47):
        p = float(hugoniot(first, graphite.parameters)[0])
        for target in np.linspace(0.02, 0.48, 24):
            rho = 2200.0 / (1.0 - first)
            e = 0.5 * p * first / 2200.0
            for part in np.diff(np.linspace(rho, 2200.0 / (1.0 - target), 201)):
                # e = e + p/rho² drho by the midpoint: an isentrope, up and down
                start = float(graphite.pressure(rho, e))
                half = e + start / rho**2 * 0.5 * part
                middle = float(graphite.pressure(rho + 0.5 * part, half))
                e += middle / (rho + 0.5 * part) ** 2 * part
                rho += part
            assert graphite.sound_speed(rho, graphite.pressure(rho, e)) > 0.2 * graphite.c0
            if target > first:  # the second shock: from (first, p) to the density `target`
                rho0 = 2200.0 / (1.0 - first)
                rho = 2200.0 / (1.0 - target)
                p2 = p
                for _ in range(200):
                    e = 0.5 * p * first / 2200.0 + 0.5 * (p + p2) * (1.0 / rho0 - 1.0 / rho)
                    p2 = float(graphite.pressure(rho, e))
                assert graphite.sound_speed(rho, p2) > 0.2 * graphite.c0


PRESSURES = np.linspace(0.02, 1.6, 80)  # over rho0 c0 squared


def find_steepness(limiter: str, has_kinks: bool) -> float:
    """Largest limited variation over the smaller of two differences of one sign."""
    limit = choose_limit(limiter, has_kinks)
    return max(limit(sign, sign * more) / sign for sign in (1.0, -1.0) for more in (1.0, 2.0, 50.0))


@pytest.mark.parametrize("limiter", LIMITERS)
def test_a_material_with_kinks_has_no_steep_limiter(limiter):
    assert find_steepness(limiter, True) <= GENTLE_STEEPNESS
    assert find_steepness(limiter, True) <= find_steepness(limiter, False)


@pytest.mark.parametrize("name", read_materials(LIBRARY))
def test_a_material_says_whether_a_shock_may_split_in_it(name):
    """One may where the material gets softer under compression, as at a phase transition."""
    material = find_material(name)
    eos = material.eos
    if not eos.opens_voids:
        assert not eos.has_kinks
        return
    scale = material.rho0 * eos.sound_speed(material.rho0, 0.0) ** 2
    shocks = [shock_to_pressure(eos, material.rho0, 0.0, part * scale) for part in PRESSURES]
    speed = np.array([float(eos.sound_speed(shock.rho, shock.p)) for shock in shocks])
    assert eos.has_kinks == bool((np.diff(speed) < -0.05 * speed[:-1]).any())
