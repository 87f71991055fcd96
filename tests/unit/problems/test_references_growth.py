"""Growth of interfaces: models, linear compressible theory, refracted shocks."""

import functools
import math

import numpy as np
import pytest

from shockgrid.hydro.eos import IdealGas, MieGruneisen
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.references.diffuse_layers import (
    compute_growth_reduction,
    compute_steady_reduction,
    mix_densities,
)
from shockgrid.problems.references.hugoniot import make_isentrope, shock_with_mach
from shockgrid.problems.references.linear_growth import PadeModel, compute_linear_growth
from shockgrid.problems.references.perturbed_layers import (
    Cut,
    find_kinks,
    interpolate_zones,
    march_layers,
)
from shockgrid.problems.references.shock_polars import Body, cross_line


def test_pade_amplitude_is_the_integral():
    t = np.linspace(0.0, 3.0, 31)
    amplitude = PadeModel(2.0, 0.05, 0.3, 0.9).compute_amplitude(t)
    assert amplitude[0] == 0.05
    exact = 0.05 + math.log1p(0.3 * 0.05 * 4 * 3.0) / (0.05 * 4)
    assert amplitude[-1] == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("rate", [1.0, 1e2, 1e4])
def test_pade_amplitude_after_a_long_time(rate):
    model = PadeModel(2.0 * math.pi, 0.02, rate, 0.9)
    slowing = rate * 0.02 * (2.0 * math.pi) ** 2  # its square vanishes: the integral is a logarithm
    exact = 0.02 + rate * math.log1p(slowing * 30.0) / slowing
    assert model.compute_amplitude(np.array([30.0]))[0] == pytest.approx(exact, rel=1e-8)


def test_pade_ends_where_its_growth_falls_faster_than_one_over_t():
    model = PadeModel(2.0, 0.05, 0.3, 0.5)
    for part, sign in ((0.9, 1.0), (1.1, -1.0)):
        t = part * model.reach * np.array([1.0 - 1e-4, 1.0 + 1e-4])
        steepness = np.diff(np.log(model.compute_rate(t))) / np.diff(np.log(t))
        assert sign * (steepness[0] + 1.0) > 0.01
    assert PadeModel(2.0, 0.05, 0.3, 0.9).reach == math.inf


AL = MieGruneisen(2.707, 5.386, 1.339, 1.97)
SS = MieGruneisen(7.896, 4.569, 1.490, 2.17)


@functools.cache
def compute_gas_growth(gamma_first, gamma_second, ratio, mach, **options):
    """Growth with rho = p = 1 ahead of the shock in the first gas."""
    first = IdealGas(gamma_first)
    behind = shock_with_mach(first, 1.0, 1.0, mach).p
    return compute_linear_growth(first, 1.0, IdealGas(gamma_second), ratio, 1.0, behind, **options)


# gammas, density ratio, Mach number, then uc, a+/a0, impulsive, vinf, first peak, its k c t
TABLE = [
    ((1.4, 1.4, 3.0, 1.05), 0.0704676, 0.943280, 0.03323, 0.03419, 0.03843, 5.0),
    ((1.4, 1.4, 3.0, 1.2), 0.264952, 0.813396, 0.10759, 0.1164, 0.1300, 5.0),
    ((1.4, 1.4, 3.0, 1.5), 0.604865, 0.659197, 0.19659, 0.2217, 0.2463, 5.1),
    ((1.4, 1.4, 3.0, 2.0), 1.09910, 0.535547, 0.27826, 0.3234, 0.3579, 5.2),
    ((1.4, 1.093, 5.1, 1.2), 0.238209, 0.832230, 0.13903, 0.1425, 0.1610, 3.6),
    ((1.4, 1.093, 5.1, 1.5), 0.539348, 0.696112, 0.27491, 0.2675, 0.2908, 3.4),
]


def find_atwood(growth):
    base = growth.base
    return (base.rho_right - base.rho_left) / (base.rho_right + base.rho_left)


def find_first_peak(growth):
    """Time k c t and value of the first maximum of `rate` above the asymptotic rate."""
    settled = growth.get_asymptotic_rate()
    rate = growth.rate * math.copysign(1.0, settled)
    peak = (rate[1:-1] > rate[:-2]) & (rate[1:-1] >= rate[2:]) & (rate[1:-1] > abs(settled))
    assert peak.any()
    top = 1 + int(np.argmax(peak))
    near = slice(top - 1, top + 2)
    second, first, value = np.polyfit(growth.kt[near] - growth.kt[top], growth.rate[near], 2)
    shift = -0.5 * first / second
    kct = (growth.kt[top] + shift) * growth.sound_speed
    return float(kct), float(value + 0.5 * first * shift)


@pytest.mark.parametrize("case, contact, compression, impulsive, rate, peak, when", TABLE)
def test_gas_rows_of_the_table(case, contact, compression, impulsive, rate, peak, when):
    growth = compute_gas_growth(*case)
    assert growth.reflected == "shock"
    assert growth.base.u == pytest.approx(contact, rel=4e-6)
    assert growth.compression == pytest.approx(compression, rel=2e-6)
    assert growth.impulsive == pytest.approx(impulsive, rel=2e-4)
    assert growth.get_asymptotic_rate() == pytest.approx(rate, rel=2e-3)
    assert growth.get_mean_rate() == pytest.approx(rate, rel=6e-3)
    time, height = find_first_peak(growth)
    assert height == pytest.approx(peak, rel=3e-4)
    assert time == pytest.approx(when, abs=0.06)


@functools.cache
def compute_metal_growth():
    return compute_linear_growth(AL, 2.707, SS, 7.896, 0.0, 10.0)


def test_metal_row_of_the_table():
    growth = compute_metal_growth()
    assert growth.base.u == pytest.approx(0.362536, abs=6e-7)
    assert growth.compression == pytest.approx(0.941391, abs=6e-7)
    assert growth.impulsive == pytest.approx(0.15855, rel=1e-4)
    assert growth.get_asymptotic_rate() == pytest.approx(0.170, rel=3e-3)


@pytest.mark.parametrize("ratio", [1.5, 1 / 3])
def test_weak_shock_grows_at_the_mean_of_both_amplitudes(ratio):
    growth = compute_gas_growth(1.4, 1.4, ratio, 1.01)
    richtmyer = growth.base.u * growth.compression * find_atwood(growth)
    mean = richtmyer * 0.5 * (1.0 + 1.0 / growth.compression)
    assert growth.reflected == ("shock" if ratio > 1 else "rarefaction")
    assert growth.get_asymptotic_rate() == pytest.approx(mean, rel=2e-3)
    assert growth.impulsive == pytest.approx(richtmyer if ratio > 1 else mean, rel=1e-12)


@pytest.mark.parametrize("mach", [1.2, 1.5, 2.0])
def test_the_impulse_is_meyer_and_blewett_s_where_a_rarefaction_is_reflected(mach):
    for ratio, name in ((1 / 3, "Meyer, Blewett"), (3.0, "Richtmyer")):
        growth = compute_gas_growth(1.4, 1.4, ratio, mach)
        richtmyer = growth.base.u * growth.compression * find_atwood(growth)
        assert growth.impulse == name
        assert (growth.impulsive == pytest.approx(richtmyer, rel=1e-12)) == (ratio > 1)
    heavy = compute_gas_growth(1.4, 1.4, 1 / 3, mach)
    richtmyer = heavy.base.u * heavy.compression * find_atwood(heavy)
    rate = heavy.get_asymptotic_rate()
    assert abs(heavy.impulsive - rate) < 0.5 * abs(richtmyer - rate)


GRAPHITE, LEAD = (find_material(name) for name in ("graphite", "Pb"))
FIRST = Body(GRAPHITE.eos, GRAPHITE.rho0)
SECOND = Body(LEAD.eos, LEAD.rho0)
SPEED = 6600.0


@pytest.fixture(scope="module")
def crossed():
    return cross_line(FIRST, SECOND, SPEED)


def test_a_ripple_is_flattened_as_the_shock_runs_over_it(crossed):
    angle = crossed.first.wave_angle
    height = 1e-6
    normal = np.array([math.sin(angle), math.cos(angle)])
    front = SPEED * math.sin(angle)
    late = [normal @ (0.0, y) / front for y in (height, -height)]
    moved = [y - crossed.normal_speed * t for y, t in zip((height, -height), late, strict=True)]
    assert (moved[0] - moved[1]) / (2.0 * height) == pytest.approx(crossed.compression, rel=1e-12)


GAS = {gamma: IdealGas(gamma) for gamma in (1.02, 1.1, 1.4)}
WATER, AL1100 = (find_material(name) for name in ("water", "Al1100"))
# first and second material with their densities, pressures ahead of and behind the shock: liquid
# and gas both ways, a metal that is released to a gas, gammas near 1, a strong shock, a heavy gas
PAIRS = {
    "water-gas": (WATER.eos, WATER.rho0, GAS[1.4], 50.0, 1e5, 1e8),
    "gas-water": (GAS[1.4], 1.2, WATER.eos, WATER.rho0, 1e5, 1e6),
    "metal-gas": (AL1100.eos, AL1100.rho0, GAS[1.4], 10.0, 1e5, 5e10),
    "isothermal": (GAS[1.1], 1.0, GAS[1.1], 3.0, 1.0, 100.0),
    "rarefied": (GAS[1.02], 1.0, GAS[1.02], 0.3, 1.0, 100.0),
    "strong": (GAS[1.4], 1.0, GAS[1.4], 3.0, 1.0, 1e5),
    "heavy": (GAS[1.4], 1.0, GAS[1.4], 1000.0, 1.0, 5.0),
}


@pytest.mark.parametrize("name", PAIRS)
def test_growth_does_not_depend_on_how_the_layers_are_cut(name):
    growth = compute_linear_growth(*PAIRS[name])
    finest = march_layers(growth.layers, Cut(24, 2.0), growth.kt_end)
    grown = finest.growth
    known = growth.get_amplitude(1.0, finest.times) - growth.compression
    assert growth.error < 1.5e-3
    assert np.abs(grown - known).max() < 2e-3 * np.abs(grown).max()


def test_a_layer_of_hundreds_of_waves_thickness_needs_more_than_one_zone():
    growth = compute_linear_growth(*PAIRS["water-gas"])
    one_zone = march_layers(growth.layers, Cut(40), growth.kt_end)
    assert one_zone.growth[-1] > 0.7 * (growth.get_amplitude(1.0, growth.kt_end) - 1.0)
    assert growth.get_mean_rate() == pytest.approx(-95.3, abs=0.2)


def test_a_kink_of_the_isentrope_is_an_edge_of_the_fan_s_zones():
    growth = compute_linear_growth(*PAIRS["metal-gas"])
    isentrope = make_isentrope(AL1100.eos, growth.incident.rho, growth.incident.p)
    (kink,) = find_kinks(isentrope, growth.base.p)
    assert isentrope.density(kink) == pytest.approx(AL1100.rho0, rel=1e-6)
    assert not find_kinks(make_isentrope(GAS[1.4], 1.0, 1.0), 0.01)
    assert growth.error < 1e-4


def test_perturbed_fields_at_a_start_do_not_depend_on_the_cut():
    growth = compute_linear_growth(*PAIRS["water-gas"])
    kt = 1.0 / growth.sound_speed
    layer = growth.compute_fields(kt).first
    finest = march_layers(growth.layers, Cut(24, 2.0, 1.0), kt)
    for place, field in enumerate((layer.p, layer.u, layer.v)):
        side = finest.sides[0]
        speeds = np.concatenate([zone.speed for zone in side.zones[:-1]])
        exact = np.concatenate(finest.split_states()[0][:-1], axis=1)[place]
        inside = speeds < 0.99 * side.zones[-2].speed[-1]
        found = interpolate_zones(layer.speed, field[None], speeds)[0]
        assert np.abs(found - exact)[inside].max() < 1e-3 * np.abs(exact).max()


@pytest.mark.parametrize("slope", [0.005, 0.05])
@pytest.mark.parametrize(
    ("compute", "thin"),
    [
        (compute_growth_reduction, 1.0 / math.pi),
        (compute_steady_reduction, math.sqrt(2.0) / math.pi),
    ],
)
def test_growth_on_a_thin_layer(compute, thin, slope):
    """psi - 1 at A = 0: the mean of k |x|, and of k |x - x'|, over the gradient of the density."""
    assert compute(1e-6, slope) - 1.0 == pytest.approx(thin * slope, rel=0.05)
    assert compute(-1e-6, slope) == compute(1e-6, slope)


def test_growth_on_a_thick_layer_is_slower_and_slower():
    slopes = (0.0, 0.02, 0.3, 1.0, 3.0)
    for compute in (compute_growth_reduction, compute_steady_reduction):
        psi = [compute(0.7, slope) for slope in slopes]
        assert psi[0] == 1.0
        assert psi == sorted(psi)
    assert compute_steady_reduction(0.7, 1.0) > compute_growth_reduction(0.7, 1.0)


def test_diffuse_density_has_its_thickness():
    x = np.array([-1e-7, 0.0, 1e-7, -1.0, 1.0])
    rho = mix_densities(x, 2e-3, (1.0, 5.0))
    assert rho[1] == 3.0
    assert (rho[2] - rho[0]) / 2e-7 == pytest.approx(4.0 / 2e-3, rel=1e-6)
    assert rho[3:].tolist() == [1.0, 5.0]
