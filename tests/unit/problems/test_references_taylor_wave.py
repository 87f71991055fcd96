"""Taylor's wave: its ends, its isentrope, the equations of motion, and a gas of constant gamma."""

import numpy as np
import pytest

from hydro.eos import JWL
from hydro.eos.materials import find_material
from problems.references.taylor_wave import compute_taylor_wave


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
