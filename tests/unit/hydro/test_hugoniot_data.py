"""Materials of the library against measured shocks, and against the line of a like material."""

import numpy as np
import pytest

from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems.references.hugoniot import shock_with_particle_speed

# Water at 20 C: particle and shock speed [m/s], as a public code quotes them from
# S. P. Marsh (ed.), LASL Shock Hugoniot Data, Univ. of California Press, 1980; those up to 2 km/s
WATER = np.array([
    (900, 3314), (1136, 3617), (1140, 3608), (1144, 3534), (1144, 3620), (1306, 3944),
    (1311, 3936), (1316, 3972), (1339, 4044), (1357, 4077), (1600, 4482), (1689, 4635),
    (1713, 4674), (1741, 4700), (1749, 4720), (1773, 4755), (1779, 4727), (1792, 4715),
    (1814, 4689),
], dtype=float)  # fmt: skip


def measure_errors(name: str, points: np.ndarray) -> np.ndarray:
    """Relative errors of the shock speeds of a material at the points' particle speeds."""
    material = find_material(name)
    speeds = [
        shock_with_particle_speed(material.eos, material.rho0, 1e5, u).shock_speed
        for u in points[:, 0]
    ]
    return np.array(speeds) / points[:, 1] - 1.0


def test_water_lies_on_its_measured_hugoniot():
    errors = measure_errors("water-hugoniot", WATER)
    assert np.abs(errors).max() < 0.035 and np.median(np.abs(errors)) < 0.01
    assert abs(errors.mean()) < 1e-3


@pytest.mark.parametrize("particle_speed, most", [(500.0, 0.02), (1000.0, 0.01), (2000.0, 0.04)])
def test_titanium_is_shocked_like_its_usual_alloy(particle_speed, most):
    titanium = find_material("Ti")
    shock = shock_with_particle_speed(titanium.eos, titanium.rho0, 0.0, particle_speed)
    alloy = 4419.0 * (5130.0 + 1.028 * particle_speed) * particle_speed
    assert shock.p == pytest.approx(alloy, rel=most)
