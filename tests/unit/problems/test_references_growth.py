"""Growth of interfaces: models, linear compressible theory, refracted shocks."""

import functools
import math

import numpy as np
import pytest

from hydro.eos import IdealGas, MieGruneisen
from hydro.eos.materials import find_material
from problems.references.hugoniot import shock_with_mach
from problems.references.linear_growth import PadeModel, compute_linear_growth
from problems.references.shock_polars import Body, cross_line


def test_pade_amplitude_is_the_integral():
    t = np.linspace(0.0, 3.0, 31)
    amplitude = PadeModel(2.0, 0.05, 0.3, 0.9).compute_amplitude(t)
    assert amplitude[0] == 0.05
    exact = 0.05 + math.log1p(0.3 * 0.05 * 4 * 3.0) / (0.05 * 4)
    assert amplitude[-1] == pytest.approx(exact, rel=1e-10)


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
