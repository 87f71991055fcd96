"""Mixing of states in cut cells."""

import numpy as np
import pytest

from hydro.eos import IdealGas, MieGruneisen
from problems.initial_states.mixed_states import mix_states


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
