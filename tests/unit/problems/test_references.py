"""Exact Riemann solutions, Hugoniots, Taylor wave, vortex, mixtures."""

import math

import numpy as np
import pytest
from scipy import integrate

from shockgrid.hydro.eos import JWL, IdealGas, MieGruneisen, StiffenedGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.initial_states import mix_states
from shockgrid.problems.references.exact_flows import SedovBlast, Vortex, compute_taylor_wave
from shockgrid.problems.references.hugoniot import (
    GeneralIsentrope,
    make_isentrope,
    shock_to_pressure,
    shock_with_mach,
    shock_with_particle_speed,
    shock_with_speed,
)
from shockgrid.problems.references.riemann import compute_cell_averages, solve_riemann
from shockgrid.problems.report import Row
from shockgrid.regrid.errors import BadInput

AIR = IdealGas(1.4)
AL = MieGruneisen(2.707, 5.386, 1.339, 1.97)
SS = MieGruneisen(7.896, 4.569, 1.490, 2.17)
PB = MieGruneisen(11.350, 2.051, 1.46, 2.77)

# eos, (rho, u, p) left and right, then p*, u*, rho_left*, rho_right*
GASES = {
    "sod": (AIR, (1, 0, 1), AIR, (0.125, 0, 0.1))
    + (0.3031301781, 0.92745262, 0.4263194282, 0.2655737117),
    "123": (AIR, (1, -2, 0.4), AIR, (1, 2, 0.4))
    + (0.00189387342, 0.0, 0.02185211821, 0.02185211821),
    "toro 3": (AIR, (1, 0, 1000), AIR, (1, 0, 0.01))
    + (460.8937875, 19.59745139, 0.5750622985, 5.999240705),
    "leblanc": (IdealGas(5 / 3), (1, 0, 0.2 / 3), IdealGas(5 / 3), (1e-3, 0, 2e-10 / 3))
    + (5.155779277e-4, 0.6218386714, 0.05407933535, 0.00399999806),
    "two gammas": (AIR, (1, 0, 1e5), IdealGas(1.2), (0.125, 0, 1e4))
    + (29380.73518, 300.310494, 0.4169123462, 0.2988111005),
    "water-gas": (StiffenedGas(4.4, 6e8), (1000, 0, 1e9), AIR, (50, 0, 1e5))
    + (14190477.21, 482.6104121, 804.4446323, 288.1680626),
    "triple point, bottom": (IdealGas(1.5), (1, 0, 1), AIR, (1, 0, 0.1))
    + (0.5119685345, 0.5172439078, 0.6399737785, 2.852428921),
    "triple point, top": (IdealGas(1.5), (1, 0, 1), IdealGas(1.5), (0.125, 0, 0.1))
    + (0.2992955507, 0.8922594508, 0.4474386615, 0.2496694984),
}


@pytest.mark.parametrize("name", GASES)
def test_star_states_of_gases(name):
    eos_left, left, eos_right, right, *expected = GASES[name]
    solution = solve_riemann(eos_left, left, eos_right, right)
    found = [solution.p, solution.u, solution.rho_left, solution.rho_right]
    assert found == pytest.approx(expected, rel=6e-10, abs=1e-12)
    assert not solution.gap


@pytest.mark.parametrize(
    "eos_left, eos_right, speed, p, u",
    [
        (AL, SS, 2.0, 26.97967, 0.621767),
        (AL, SS, 4.0, 66.12667, 1.290141),
        (AL, AL, 2.0, 18.20457, 1.0),
        (AL, PB, 2.0, 24.85395, 0.709413),
        (SS, PB, 2.0, 43.80328, 1.068685),
    ],
)
def test_metal_impacts(eos_left, eos_right, speed, p, u):
    solution = solve_riemann(eos_left, (eos_left.rho0, speed, 0), eos_right, (eos_right.rho0, 0, 0))
    assert solution.p == pytest.approx(p, abs=6e-6)
    assert solution.u == pytest.approx(u, abs=6e-7)


@pytest.mark.parametrize("name", [*GASES, "tension", "vacuum"])
def test_profile_conserves_mass_and_momentum(name):
    if name == "tension":
        problem = (AL, (2.707, -2, 0), SS, (7.896, 0, 0))
    elif name == "vacuum":
        problem = (AIR, (1, -10, 0.4), AIR, (1, 10, 0.4))
    else:
        problem = GASES[name][:4]
    _, (rho_l, u_l, p_l), _, (rho_r, u_r, p_r) = problem
    solution = solve_riemann(*problem)
    assert solution.gap == (name == "vacuum")
    speeds = solution.get_speeds()
    t = 0.7
    reach = speeds[-1] - speeds[0]
    x = t * np.linspace(speeds[0] - 0.1 * reach, speeds[-1] + 0.2 * reach, 38)
    rho, momentum, _ = compute_cell_averages(solution, x, t)
    x_l = x[0]
    x_r = x[-1]
    mass = rho_r * (x_r - u_r * t) - rho_l * (x_l - u_l * t)
    push = t * (rho_r * u_r**2 + p_r - rho_l * u_l**2 - p_l)
    impulse = rho_r * u_r * x_r - rho_l * u_l * x_l - push
    scale = rho_l + rho_r
    assert np.sum(rho * np.diff(x)) == pytest.approx(mass, abs=1e-11 * scale * t * reach)
    assert np.sum(momentum * np.diff(x)) == pytest.approx(impulse, abs=1e-11 * scale * t * reach**2)


def test_vacuum_front_of_an_ideal_gas():
    solution = solve_riemann(AIR, (1, -10, 0.4), AIR, (1, 10, 0.4))
    front = 10 - 2 * math.sqrt(1.4 * 0.4) / 0.4
    assert solution.u_right == pytest.approx(front, rel=1e-14)
    rho, u, p = solution.sample(np.array([0.0, 20.0]))
    assert rho.tolist() == [0.0, 1.0] and u.tolist() == [0.0, 10.0] and p.tolist() == [0.0, 0.4]


def test_condensed_materials_part_at_a_cavitation_pressure():
    states = (AL, (2.707, -2, 1.0), SS, (7.896, 0, 0))
    assert solve_riemann(*states).p < 0.0
    parted = solve_riemann(*states, cavitation_pressure=0.0)
    assert parted.gap and parted.p == 0.0 and parted.u_left < parted.u_right == 0.0
    with pytest.raises(BadInput, match="cavitation"):
        solve_riemann(AL, (2.707, -20, 0), SS, (7.896, 20, 0))


METALS = {"Al1100": AL, "SS304": SS, "Pb": PB}


@pytest.mark.parametrize("name", METALS)
@pytest.mark.parametrize("particle_speed", [1e-3, 0.5, 2.0])
def test_metal_shock_lies_on_its_linear_hugoniot(name, particle_speed):
    eos = METALS[name]
    rho0 = eos.rho0
    c0 = eos.c0
    s = eos.s
    shock = shock_with_particle_speed(eos, rho0, 0.0, particle_speed)
    assert shock.shock_speed == pytest.approx(c0 + s * particle_speed, rel=1e-11)
    assert shock.p == pytest.approx(rho0 * shock.shock_speed * particle_speed, rel=1e-11)
    assert shock.e == pytest.approx(0.5 * particle_speed**2, rel=1e-9)


@pytest.mark.parametrize("eos, rho, p", [(AL, 2.8, 1.0), (StiffenedGas(4.4, 0.6), 1.0, 1e-4)])
def test_every_way_of_asking_gives_the_same_shock(eos, rho, p):
    shock = shock_to_pressure(eos, rho, p, 20.0)
    by_speed = shock_with_speed(eos, rho, p, shock.shock_speed)
    by_particle = shock_with_particle_speed(eos, rho, p, shock.particle_speed)
    by_mach = shock_with_mach(eos, rho, p, shock.shock_speed / eos.sound_speed(rho, p))
    for other in (by_speed, by_particle, by_mach):
        assert other.p == pytest.approx(20.0, rel=1e-10)


def test_integrated_isentrope_is_the_closed_form():
    eos = StiffenedGas(4.4, 0.6)
    closed = make_isentrope(eos, 1.4, 5.0)
    general = GeneralIsentrope(eos, 1.4, 5.0)
    p = np.array([8.0, 5.0, 2.0, 0.0, -0.5])
    np.testing.assert_allclose(general.density(p), closed.density(p), rtol=1e-10)
    np.testing.assert_allclose(general.velocity_gain(p), closed.velocity_gain(p), atol=1e-10)
    fan = closed.sound_speed(p[2:]) - closed.velocity_gain(p[2:])
    np.testing.assert_allclose(closed.pressure_in_fan(fan), p[2:], atol=1e-12)
    np.testing.assert_allclose(general.pressure_in_fan(fan, -0.55), p[2:], atol=1e-9)


@pytest.mark.parametrize("name", ["TNT", "Comp-B"])
def test_it_goes_from_the_detonation_to_rest_on_one_isentrope(name):
    eos = find_material(name).eos
    wave = compute_taylor_wave(eos)
    speed, pressure, rho = eos.find_detonation()
    assert [wave.pace[-1], wave.p[-1], wave.rho[-1]] == pytest.approx([speed, pressure, rho], 1e-6)
    assert wave.u[0] == pytest.approx(0.0, abs=1e-9)
    c = eos.sound_speed(wave.rho, wave.p)
    assert wave.pace == pytest.approx(wave.u + c, rel=1e-6), "rays are characteristics"
    e = eos.energy(wave.rho, wave.p)
    middle = 0.5 * (wave.p[1:] / wave.rho[1:] ** 2 + wave.p[:-1] / wave.rho[:-1] ** 2)
    assert np.diff(e) == pytest.approx(middle * np.diff(wave.rho), rel=1e-3, abs=5.0)
    mean = 0.5 * (c[1:] / wave.rho[1:] + c[:-1] / wave.rho[:-1])
    assert np.diff(wave.u) == pytest.approx(mean * np.diff(wave.rho), rel=1e-3)


def test_a_gas_at_the_wall_keeps_what_theory_says():
    gamma = 1.8
    eos = JWL(rho0=1000.0, a=1e-3, b=1e-3, r1=4.0, r2=1.0, omega=gamma - 1.0, energy0=5e9)
    wave = compute_taylor_wave(eos)
    assert wave.pace[0] / wave.speed == pytest.approx(0.5, rel=1e-5)
    ratio = 0.5 * (gamma + 1.0) / gamma
    assert wave.p[0] / wave.p[-1] == pytest.approx(ratio ** (2 * gamma / (gamma - 1.0)), rel=1e-4)
    state = wave.compute_state([0.0, 0.25 * wave.speed, 1.01 * wave.speed])
    assert state[0] == pytest.approx([wave.p[0], wave.p[0], 0.0])
    assert state[1][2] == 1000.0 and state[2][2] == 0.0


def test_it_is_steady_in_its_own_frame_and_isentropic():
    vortex = Vortex(stream=(0.0, 0.0))
    h = 1e-4
    rng = np.random.default_rng(7)
    x, y = rng.uniform(3.0, 7.0, (2, 40))
    rho, u, v, p = vortex.sample(x, y)
    np.testing.assert_allclose(p / rho**1.4, 1.0, rtol=1e-13)

    def slopes(k):
        east = vortex.sample(x + h, y)[k]
        west = vortex.sample(x - h, y)[k]
        north = vortex.sample(x, y + h)[k]
        south = vortex.sample(x, y - h)[k]
        return (east - west) / (2 * h), (north - south) / (2 * h)

    (u_x, u_y), (v_x, v_y), (p_x, p_y), (rho_x, rho_y) = (slopes(k) for k in (1, 2, 3, 0))
    np.testing.assert_allclose(rho * (u * u_x + v * u_y) + p_x, 0.0, atol=1e-7)
    np.testing.assert_allclose(rho * (u * v_x + v * v_y) + p_y, 0.0, atol=1e-7)
    np.testing.assert_allclose(u * rho_x + v * rho_y + rho * (u_x + v_y), 0.0, atol=1e-7)


@pytest.mark.parametrize("eos", [IdealGas(1.4), MieGruneisen(1.0, 2.0, 1.3, 1.9)])
def test_mixture_keeps_mass_momentum_and_energy(eos):
    first, second = (1.9, 0.7, -0.2, 2.3), (1.1, 0.1, 0.4, 0.9)
    fraction = np.linspace(0.0, 1.0, 12).reshape(3, 4)
    mixed = mix_states(eos, fraction, first, second)

    def conserve(rho, u, v, p):
        return np.array(
            [rho, rho * u, rho * v, rho * eos.energy(rho, p) + rho * (u * u + v * v) / 2]
        )

    parts = [conserve(*state)[:, None, None] for state in (first, second)]
    expected = fraction * parts[0] + (1.0 - fraction) * parts[1]
    np.testing.assert_allclose(conserve(*mixed), expected, rtol=1e-13)


def test_equal_velocity_and_pressure_of_an_ideal_gas_stay():
    rho, u, v, p = mix_states(IdealGas(1.4), np.array([[0.25]]), (1, 2, 3, 5), (4, 2, 3, 5))
    assert rho[0, 0] == 3.25
    assert [u[0, 0], v[0, 0], p[0, 0]] == pytest.approx([2, 3, 5], rel=1e-14)


@pytest.mark.parametrize("gamma", [1.05, 1.4, 5.0, 6.5])
def test_energy_of_a_blast_does_not_depend_on_the_points_of_its_profile(gamma):
    blast = SedovBlast("spherical", gamma)
    alpha = blast._sum_energy(2)  # a sum that is four times as wrong
    assert alpha == pytest.approx(blast.alpha, rel=1e-5)


@pytest.mark.parametrize("name", ["TNT", "Comp-B"])
@pytest.mark.parametrize("burnt", [8.38e9, 2.1e10, 1e9])
@pytest.mark.parametrize("air", [(1.2, 0.0, 1e5), (0.012, 0.0, 1e3), (12.0, -300.0, 1e6)])
def test_products_of_an_explosive_beside_air(name, burnt, air):
    """Against the JWL isentrope in closed form, its speed by quadrature over the volume."""
    material = find_material(name)
    eos = material.eos
    gamma = 1.4
    found = solve_riemann(eos, (material.rho0, 0.0, burnt), IdealGas(gamma), air)
    mirrored = (air[0], -air[1], air[2])
    other = solve_riemann(IdealGas(gamma), mirrored, eos, (material.rho0, 0.0, burnt))
    assert (other.p, other.u) == pytest.approx((found.p, -found.u), rel=1e-9)

    parts = ((eos.a, eos.r1), (eos.b, eos.r2))
    rest = burnt - sum(a * np.exp(-r) for a, r in parts)  # of the gas, at volume 1

    def pressure(volume):
        return sum(a * np.exp(-r * volume) for a, r in parts) + rest * volume ** (-1.0 - eos.omega)

    def slope(volume):
        gas = (1.0 + eos.omega) * rest * volume ** (-2.0 - eos.omega)
        return sum(r * a * np.exp(-r * volume) for a, r in parts) + gas

    volume = material.rho0 / found.rho_left
    speed, _ = integrate.quad(
        lambda x: np.sqrt(slope(np.exp(x)) / material.rho0) * np.exp(x), 0.0, np.log(volume)
    )
    volume_error = (found.p - pressure(volume)) / slope(volume)  # stiff products: dp is large
    assert abs(volume_error) < 1e-9 * volume
    assert found.u == pytest.approx(speed, rel=1e-8)
    rho, u, p = air
    jump = (gamma + 1.0) * found.p + (gamma - 1.0) * p
    assert found.u - u == pytest.approx((found.p - p) * np.sqrt(2.0 / rho / jump), rel=1e-8)
    back = (gamma - 1.0) * found.p + (gamma + 1.0) * p
    assert found.rho_right == pytest.approx(rho * jump / back, rel=1e-8)


def test_products_that_part_from_air_for_good_are_refused_in_words():
    material = find_material("TNT")
    away = (1.2, 3e4, 1e5)
    with pytest.raises(BadInput, match=r"common pressure|does not reach"):
        solve_riemann(material.eos, (material.rho0, 0.0, 8.38e9), IdealGas(1.4), away)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_difference_has_the_sign_of_the_magnitude(sign):
    """A number that is smaller than theory's is so whatever the sign of both."""
    assert Row("rate", sign * 0.97, sign).difference == pytest.approx(-0.03)
    assert Row("rate", sign * 1.03, sign).difference == pytest.approx(0.03)
    assert Row("rate", -sign * 0.5, sign).difference == pytest.approx(-1.5)
    assert Row("drift", sign * 0.1, 0.0, size=10.0).difference == pytest.approx(sign * 0.01)
