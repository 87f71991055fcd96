"""JWL: detonation states of tabulated explosives, the explosive at rest, what is refused."""

import pytest

from hydro.eos.materials import find_material


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
