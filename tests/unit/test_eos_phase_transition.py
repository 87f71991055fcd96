"""Graphite and diamond: the three pieces of the Hugoniot, shocks that split, what is refused."""

import numpy as np
import pytest

from hydro.eos import MieGruneisen, PhaseTransition
from hydro.eos.phase_transition import hugoniot
from hydro.materials import find_material
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
        ({"onset": 2e11, "complete": 1e10}, "higher `complete`"),
    ],
)
def test_bad_parameters_are_named(change, words):
    with pytest.raises(BadInput, match=words):
        PhaseTransition(**change)
