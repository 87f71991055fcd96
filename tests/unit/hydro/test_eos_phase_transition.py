"""Graphite and diamond: the three pieces of the Hugoniot, shocks that split, what is refused."""

import numpy as np
import pytest

from hydro.eos import MieGruneisen, PhaseTransition
from hydro.eos.materials import find_material
from hydro.eos.phase_transition import hugoniot
from regrid.errors import BadInput


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
    """Energy of the jump from graphite at rest and diamond's own law give the pressure."""
    diamond = find_material("diamond").eos
    for rho in (3700.0, 4200.0, 4600.0):
        p = float(hugoniot(1.0 - 2200.0 / rho, graphite.parameters)[0])
        energy = 0.5 * p * (1.0 / 2200.0 - 1.0 / rho)
        assert float(diamond.pressure(rho, energy)) == pytest.approx(p, rel=1e-12)
        assert float(graphite.pressure(rho, energy)) == pytest.approx(p, rel=1e-12)


def test_beyond_completion_the_law_is_diamond_s_own(graphite):
    """Off the Hugoniot too: released, heated, shocked again."""
    diamond = find_material("diamond").eos
    rho, e = np.meshgrid([3750.0, 4100.0, 4600.0], [2e6, 1e7, 4e7])
    p = diamond.pressure(rho, e)
    assert graphite.pressure(rho, e) == pytest.approx(p, rel=1e-12, abs=1e-2)
    assert graphite.sound_speed(rho, p)[p > 0] == pytest.approx(diamond.sound_speed(rho, p)[p > 0])


def test_the_sound_speed_is_real_wherever_shocks_and_isentropes_lead(graphite):
    """From rest: one shock or two, then released or compressed at constant entropy."""
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
    """There the wave splits in two: Us² = p / (rho0 eta) has a minimum above the onset."""
    start, end = graphite.mixed_region
    speed = [
        np.sqrt(float(hugoniot(eta, graphite.parameters)[0]) / (2200.0 * eta))
        for eta in (start, end)
    ]
    assert speed[1] < speed[0]


@pytest.mark.parametrize(
    "change, words",
    [
        ({"onset": -1.0}, "onset is -1"),
        ({"rho0_second": 2000.0}, "denser than the first"),
        ({"onset": 2e11, "complete": 1e10}, "above its onset"),
    ],
)
def test_bad_parameters_are_named(change, words):
    with pytest.raises(BadInput, match=words):
        PhaseTransition(**change)
