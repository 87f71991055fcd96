"""Plane waves in elastic-plastic solids, shells that stop, elastic waves and growth."""

import math

import numpy as np
import pytest

from shockgrid.hydro.eos import MieGruneisen
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.references.collapsing_shells import PlasticShell
from shockgrid.problems.references.elastic_plastic import (
    Solid,
    compute_impact,
    compute_piston,
    compute_release,
    find_elastic_limit,
    make_solid_at_rest,
)
from shockgrid.problems.references.elastic_waves import (
    compute_elastic_growth,
    compute_rayleigh_speed,
    compute_wave_speeds,
)
from shockgrid.problems.references.hugoniot import release, shock_with_particle_speed
from shockgrid.regrid.errors import BadInput


def make_solid(rho0, c0, s, gruneisen, shear_modulus, yield_stress):
    """A solid of Mie-Grüneisen type; G and Y in GPa."""
    eos = MieGruneisen(float(rho0), float(c0), s, gruneisen, 1e9)
    return Solid(eos, float(rho0), 1e9 * shear_modulus, 1e9 * yield_stress)


COPPER = make_solid(8930, 3940, 1.49, 2.0, 45.0, 0.09)
ALUMINIUM = make_solid(2785, 5328, 1.338, 2.0, 27.6, 0.3)
SOLIDS = {
    "Cu": COPPER,
    "Al": ALUMINIUM,
    "Al6061": make_solid(2703, 5240, 1.4, 1.97, 27.6, 0.29),
    "SS304": make_solid(7896, 4569, 1.49, 2.17, 77.0, 0.34),
    "Ta": make_solid(16690, 3410, 1.2, 1.67, 69.0, 0.77),
    "W": make_solid(19300, 4030, 1.237, 1.67, 160.0, 2.2),
}


def test_piston_in_copper_as_published():
    # [Maire2013]: speeds and stresses of both waves at 20 m/s
    precursor, plastic = compute_piston(COPPER, 20.0)
    found = [precursor.rho, precursor.p, precursor.stress, precursor.u, precursor.shock_speed]
    expected = [8938.9345, 0.13903010e9, 0.19903010e9, 4.7198162, 4722.1765]
    assert found == pytest.approx(expected, rel=4e-8)
    assert precursor.e == pytest.approx(11.138333, rel=5e-8)
    found = [plastic.rho, plastic.p, plastic.stress, plastic.shock_speed, plastic.e]
    expected = [8973.4531, 0.68159097e9, 0.74159097e9, 3976.9475, 213.53036]
    assert found == pytest.approx(expected, rel=4e-8)


@pytest.mark.parametrize(
    "name, speed, expected",
    [
        ("Al", 400.0, (0.63587853, 35.178374, 6490.426, 6.6358785, 5908.5189)),
        ("Al", 200.0, (0.63587853, 35.178374, 6490.426, 3.224193, 5643.2999)),
        ("Al6061", 200.0, (0.588996, 33.7903, 6448.72, 3.08799, 5567.06)),
        ("SS304", 200.0, (0.593131, 12.8710, 5836.23, 7.80971, 4886.18)),
        ("Ta", 200.0, (1.610151, 23.1689, 4163.94, 12.45544, 3677.46)),
        ("W", 200.0, (3.659550, 36.0434, 5260.72, 17.31708, 4322.52)),
    ],
)
def test_pistons_in_metals(name, speed, expected):
    first, second = compute_piston(SOLIDS[name], speed)
    found = [1e-9 * first.stress, first.u, first.shock_speed]
    found += [1e-9 * second.stress, second.shock_speed]
    assert found == pytest.approx(expected, rel=3e-6)


@pytest.mark.parametrize("speed", [1.0, 20.0, 200.0, 800.0, 1000.0, 4000.0])
@pytest.mark.parametrize("name", ["Al", "W"])
def test_jumps_conserve_mass_momentum_and_energy(name, speed):
    solid = SOLIDS[name]
    rho, u, stress, e = solid.rho0, 0.0, 0.0, 0.0
    for state in compute_piston(solid, speed):
        mass = rho * (state.shock_speed - u)
        assert state.rho * (state.shock_speed - state.u) == pytest.approx(mass, rel=1e-9)
        assert state.stress - stress == pytest.approx(mass * (state.u - u), rel=1e-9)
        work = state.stress * state.u - stress * u
        gained = state.e - e + 0.5 * (state.u**2 - u**2)
        assert work == pytest.approx(mass * gained, rel=1e-8)
        assert solid.eos.pressure(state.rho, state.e) == pytest.approx(state.p, rel=1e-12)
        rho, u, stress, e = state.rho, state.u, state.stress, state.e
    assert u == pytest.approx(speed, rel=1e-10)


@pytest.mark.parametrize("name, least, most", [("Al6061", 0.5, 0.7), ("Ta", 1.5, 1.8)])
def test_elastic_limits_of_the_library_are_those_of_measurements(name, least, most):
    solid = make_solid_at_rest(find_material(name))
    assert least < 1e-9 * find_elastic_limit(solid).stress < most
    # Hooke's law: Y (c_l/c_s)²/2
    longitudinal, shear = compute_wave_speeds(solid.eos, solid.rho0, 0.0, solid.shear_modulus)
    hooke = 0.5 * solid.yield_stress * (longitudinal / shear) ** 2
    assert find_elastic_limit(solid).stress == pytest.approx(hooke, rel=0.02)


def test_shocks_by_strength():
    assert len(compute_piston(ALUMINIUM, 30.0)) == 1  # elastic
    assert len(compute_piston(ALUMINIUM, 700.0)) == 2
    assert len(compute_piston(ALUMINIUM, 1000.0)) == 1  # faster than the precursor
    assert compute_piston(ALUMINIUM, 1000.0)[0].deviator == pytest.approx(-0.2e9)
    weak = compute_piston(ALUMINIUM, 0.01)[0]
    fastest, _ = compute_wave_speeds(ALUMINIUM.eos, 2785.0, 0.0, 27.6e9)
    assert weak.shock_speed == pytest.approx(fastest, rel=1e-5)
    with pytest.raises(BadInput, match="must be positive"):
        compute_piston(ALUMINIUM, 0.0)
    with pytest.raises(BadInput, match="no shock reaches"):
        compute_piston(ALUMINIUM, 1e6)


@pytest.mark.parametrize("speed", [100.0, 1000.0, 3000.0])
def test_without_strength_they_are_those_of_a_fluid(speed):
    fluid = Solid(ALUMINIUM.eos, 2785.0, 0.0, 0.0)
    (state,) = compute_piston(fluid, speed)
    shock = shock_with_particle_speed(fluid.eos, 2785.0, 0.0, speed)
    assert state.p == pytest.approx(shock.p, rel=1e-9)
    assert state.shock_speed == pytest.approx(shock.shock_speed, rel=1e-9)
    found = compute_release(fluid, state)
    rho, gained = release(fluid.eos, shock.rho, shock.p)
    assert found.rho[-1] == pytest.approx(rho, rel=1e-8)
    assert found.gained[-1] == pytest.approx(gained, rel=1e-7)
    assert found.elastic_end == 0


@pytest.mark.parametrize(
    "flyer, target, speed, u, stress",
    [
        ("Al", "Cu", 500.0, 152.5856, 5.710046),
        ("Al", "Cu", 800.0, 245.5740, 9.473605),
        ("Al6061", "SS304", 1000.0, 297.7537, 11.906579),
    ],
)
def test_impacts_of_two_metals(flyer, target, speed, u, stress):
    found = compute_impact(SOLIDS[flyer], SOLIDS[target], speed)
    assert found.u == pytest.approx(u, rel=3e-7)
    assert 1e-9 * found.stress == pytest.approx(stress, rel=1e-7)
    turned = compute_impact(SOLIDS[target], SOLIDS[flyer], speed)
    assert turned.u == pytest.approx(speed - found.u, rel=1e-12)
    assert turned.stress == pytest.approx(found.stress, rel=1e-12)


def test_release_is_elastic_then_plastic():
    shocked = compute_piston(ALUMINIUM, 400.0)[-1]
    wave = compute_release(ALUMINIUM, shocked)
    k = wave.elastic_end
    # the deviator turns round, while the density falls by the factor exp(-Y/G)
    assert wave.deviator[[0, k, -1]] == pytest.approx([-0.2e9, 0.2e9, 0.2e9])
    assert math.log(wave.rho[0] / wave.rho[k]) == pytest.approx(0.3 / 27.6)
    assert wave.stress[-1] == pytest.approx(0.0, abs=1.0)
    # from a state that stiff the elastic part is more than twice the elastic limit
    drop = (wave.stress[0] - wave.stress[k]) / find_elastic_limit(ALUMINIUM).stress
    assert drop == pytest.approx(2.39, abs=0.01)
    # speeds and energies are the sums of dS/(rho c) and S/rho² drho
    middle = 0.5 * (wave.rho[1:] * wave.sound[1:] + wave.rho[:-1] * wave.sound[:-1])
    gained = -(np.diff(wave.stress) / middle)[:k].sum()
    assert wave.gained[k] == pytest.approx(gained, rel=1e-5)
    work = np.diff(1.0 / wave.rho) * 0.5 * (wave.stress[1:] + wave.stress[:-1])
    assert wave.e[0] - wave.e[-1] == pytest.approx(work.sum(), rel=1e-5)
    # heat is left, so the surface does not return to the speed of a fluid's
    assert 6.5 < 400.0 - wave.gained[-1] < 7.5


@pytest.mark.parametrize(
    "geometry, stop, speed, outer",
    [
        ("cylindrical", 0.050, 417.079, 0.078102),
        ("cylindrical", 0.045, 454.654, 0.075),
        ("cylindrical", 0.040, 490.299, 0.072111),
        ("spherical", 0.050, 545.145, 0.084948),
    ],
)
def test_shells_that_stop(geometry, stop, speed, outer):
    # beryllium; the cylinder as in [HowellBall2002]
    shell = PlasticShell(geometry, 0.08, 0.1, 1845.0, 0.33e9)
    assert shell.find_speed(stop) == pytest.approx(speed, abs=6e-4)
    assert shell.find_outer(stop) == pytest.approx(outer, abs=6e-7)
    assert shell.find_stop(shell.find_speed(stop)) == pytest.approx(stop, rel=1e-10)
    times, radii = shell.follow(speed)
    assert np.all(np.diff(times) > 0.0)
    assert radii[-1] == pytest.approx(stop, rel=1e-5)
    pace = (radii[0] - radii[1]) / (times[1] - times[0])
    assert pace == pytest.approx(speed, rel=1e-3)


def test_shells_that_do_not_stop_or_are_impossible():
    shell = PlasticShell("spherical", 0.08, 0.1, 1845.0, 0.33e9)
    assert shell.find_stop(2000.0) == 0.0
    for stop in (0.0, 0.09):
        with pytest.raises(BadInput, match="cannot stop"):
            shell.find_speed(stop)
    with pytest.raises(BadInput, match="smaller than the outer"):
        PlasticShell("spherical", 0.1, 0.08, 1845.0, 0.33e9)
    with pytest.raises(BadInput, match="cylindrical or spherical"):
        PlasticShell("plane", 0.08, 0.1, 1845.0, 0.33e9)


def test_rayleigh_waves():
    # a Poisson solid, c_l² = 3 c_s², and one that is incompressible
    assert compute_rayleigh_speed(math.sqrt(3.0), 1.0) == pytest.approx(
        math.sqrt(2.0 - 2.0 / math.sqrt(3.0)), rel=1e-12
    )
    assert compute_rayleigh_speed(1e7, 1.0) == pytest.approx(0.9553125, abs=1e-7)
    with pytest.raises(BadInput, match="faster"):
        compute_rayleigh_speed(1.0, 1.0)


def find_surface_determinant(growth, k, shear_modulus, rho, gravity):
    """Zero where a surface wave of an incompressible elastic half space y < 0 has no traction.

    Displacement: grad phi + curl psi with phi ~ exp(k y), psi ~ exp(m y), m² = k² + s² rho/G; the
    pressure is -rho s² phi, and the surface has moved away from the hydrostatic one by its height.
    """
    m = math.sqrt(k**2 + rho * growth**2 / shear_modulus)
    # u_x = (i k phi + dpsi/dy), u_y = (dphi/dy - i k psi); rows: shear stress, normal stress
    shear = [2j * k * k * shear_modulus, (m * m + k * k) * shear_modulus]
    normal = [
        rho * growth**2 + 2.0 * shear_modulus * k * k - rho * gravity * k,
        -2j * k * m * shear_modulus + rho * gravity * 1j * k,
    ]
    return (shear[0] * normal[1] - shear[1] * normal[0]) / shear_modulus**2


@pytest.mark.parametrize("driven", [2.1, 3.0, 10.0, 300.0])
def test_elastic_growth_leaves_the_surface_free(driven):
    rho, shear_modulus, k = 2700.0, 27.6e9, 500.0
    gravity = driven * shear_modulus * k / rho
    growth = compute_elastic_growth(rho, gravity, shear_modulus, k)
    scale = abs(find_surface_determinant(1.1 * growth, k, shear_modulus, rho, gravity))
    assert abs(find_surface_determinant(growth, k, shear_modulus, rho, gravity)) < 1e-9 * scale
    assert growth < math.sqrt(gravity * k)


def test_elastic_growth_has_a_threshold_and_a_fluid_limit():
    assert compute_elastic_growth(1.0, 2.0, 1.0, 1.0) == 0.0
    near = compute_elastic_growth(1.0, 2.0 + 1.5e-8, 1.0, 1.0)
    assert near == pytest.approx(1e-4, rel=1e-6)
    assert compute_elastic_growth(1.0, 1e6, 1.0, 1.0) == pytest.approx(1e3, rel=1e-4)
