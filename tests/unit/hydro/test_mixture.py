"""Two materials at one pressure: inverse formulas, sound speed, and the limits of one of them."""

import numpy as np
import pytest

from shockgrid.hydro.eos import JWL, IdealGas, MieGruneisen, PhaseTransition, StiffenedGas
from shockgrid.hydro.eos.base import measure_inverse
from shockgrid.hydro.eos.mixture import mix
from shockgrid.regrid.errors import BadInput

AIR = IdealGas(1.4)
PAIRS = {
    "gases": (IdealGas(1.4), IdealGas(1.093), (1.2, 5.1), 1e5),
    "water and air": (StiffenedGas(4.4, 6e8), AIR, (1000.0, 1.2), 1e5),
    "metals": (MieGruneisen(), MieGruneisen(11340.0, 2051.0, 1.46, 2.77), (2707.0, 11340.0), 1e10),
    "products and metal": (JWL(), MieGruneisen(), (1630.0, 2707.0), 5e9),
}


def mix_cells(one, two, densities, parts):
    """A mixture at volume fractions `parts` of the first, with the density of each cell."""
    rho = parts * densities[0] + (1.0 - parts) * densities[1]
    fields = np.array([parts * densities[0] / rho, parts])
    return mix(one, two, densities).with_fields(fields), rho


@pytest.mark.parametrize("name", PAIRS)
def test_energy_and_pressure_are_inverse(name):
    one, two, densities, p = PAIRS[name]
    eos, rho = mix_cells(one, two, densities, np.linspace(0.0, 1.0, 11))
    stiffness = rho * eos.sound_speed(rho, p) ** 2
    pressures = np.full(rho.shape, p)
    assert np.abs(measure_inverse(eos, rho, pressures) / stiffness).max() < 1e-14


@pytest.mark.parametrize("name", PAIRS)
def test_a_cell_of_one_material_is_that_material(name):
    one, two, densities, p = PAIRS[name]
    eos, rho = mix_cells(one, two, densities, np.array([1.0, 0.0]))
    pressures = np.full(2, p)
    speeds = [float(one.sound_speed(densities[0], p)), float(two.sound_speed(densities[1], p))]
    energies = [float(one.energy(densities[0], p)), float(two.energy(densities[1], p))]
    assert eos.sound_speed(rho, pressures) == pytest.approx(speeds, rel=1e-9)
    assert eos.energy(rho, pressures) == pytest.approx(energies, rel=1e-9)


@pytest.mark.parametrize("name", PAIRS)
def test_energy_is_linear_in_the_volume_fraction(name):
    """So that a contact keeps its pressure whatever part of each material a cell has."""
    one, two, densities, p = PAIRS[name]
    parts = np.linspace(0.0, 1.0, 11)
    eos, rho = mix_cells(one, two, densities, parts)
    held = rho * eos.energy(rho, np.full(rho.shape, p))
    ends = densities[0] * one.energy(densities[0], p), densities[1] * two.energy(densities[1], p)
    line = parts * ends[0] + (1.0 - parts) * ends[1]
    assert np.abs(held - line).max() < 1e-11 * np.abs(line).max()


def test_the_sound_speed_of_two_gases_lies_between_theirs_by_stiffness():
    """Equal pressures and constant volume fractions: rho c² is a mean of both."""
    one, two, densities, p = PAIRS["gases"]
    eos, rho = mix_cells(one, two, densities, np.array([0.3]))
    soft = np.array([0.3 / 0.4, 0.7 / 0.093])
    stiff = (soft * np.array([1.4, 1.093])).sum() / soft.sum() * p
    assert rho * eos.sound_speed(rho, np.array([p])) ** 2 == pytest.approx(stiff, rel=1e-12)


def test_round_off_of_a_material_has_no_density_of_its_own():
    eos = mix(AIR, IdealGas(1.093), (1.2, 5.1)).with_fields(np.array([[-1e-17], [1e-17]]))
    assert np.isfinite(eos.sound_speed(np.array([5.1]), np.array([1e5]))).all()


def test_materials_that_cannot_share_cells_are_refused():
    with pytest.raises(BadInput, match="phase-transition"):
        mix(PhaseTransition(), AIR, (2000.0, 1.2))
