"""Graphite and diamond: the three pieces of the Hugoniot, shocks that split, what is refused."""

import numpy as np
import pytest

from hydro.eos import MieGruneisen
from hydro.eos.materials import find_material
from hydro.eos.phase_transition import hugoniot


@pytest.fixture
def graphite():
    return find_material("graphite-diamond").eos


def test_below_the_onset_it_is_the_plain_solid(graphite):
    plain = MieGruneisen(2200.0, 3900.0, 2.0, 0.4, 2.0e7)
    rho, p = np.meshgrid([2100.0, 2200.0, 2500.0, 2800.0], [0.0, 1e9, 2.5e10])
    assert graphite.energy(rho, p) == pytest.approx(plain.energy(rho, p), rel=1e-12)
    assert graphite.sound_speed(rho, p) == pytest.approx(plain.sound_speed(rho, p), rel=1e-12)


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
            rho, e = 2200.0 / (1.0 - first), 0.5 * p * first / 2200.0
            for part in np.diff(np.linspace(rho, 2200.0 / (1.0 - target), 201)):
                # e = e + p/rho² drho by the midpoint: an isentrope, up and down
                start = float(graphite.pressure(rho, e))
                half = e + start / rho**2 * 0.5 * part
                middle = float(graphite.pressure(rho + 0.5 * part, half))
                e += middle / (rho + 0.5 * part) ** 2 * part
                rho += part
            assert graphite.sound_speed(rho, graphite.pressure(rho, e)) > 0.2 * graphite.c0
            if target > first:  # the second shock: from (first, p) to the density `target`
                rho0, rho = 2200.0 / (1.0 - first), 2200.0 / (1.0 - target)
                p2 = p
                for _ in range(200):
                    e = 0.5 * p * first / 2200.0 + 0.5 * (p + p2) * (1.0 / rho0 - 1.0 / rho)
                    p2 = float(graphite.pressure(rho, e))
                assert graphite.sound_speed(rho, p2) > 0.2 * graphite.c0


def test_a_shock_into_the_mixed_region_is_slower_than_the_one_to_the_onset(graphite):
    start, end = graphite.mixed_region
    speed = [
        np.sqrt(float(hugoniot(eta, graphite.parameters)[0]) / (2200.0 * eta))
        for eta in (start, end)
    ]
    assert speed[1] < speed[0]
