"""Shocks that cross a line between two materials, and the ripple they leave to grow."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydro.eos.materials import find_material
from problems.references.refracted_shock import cross_line
from problems.references.shock_polars import Body

GRAPHITE, LEAD = (find_material(name) for name in ("graphite", "Pb"))
FIRST, SECOND = Body(GRAPHITE.eos, GRAPHITE.rho0), Body(LEAD.eos, LEAD.rho0)
SPEED = 6600.0


@pytest.fixture(scope="module")
def crossed():
    return cross_line(FIRST, SECOND, SPEED)


def test_both_materials_move_along_the_turned_line(crossed):
    assert crossed.first.p == pytest.approx(crossed.second.p, rel=1e-12)
    along = np.array([math.cos(crossed.deflection), -math.sin(crossed.deflection)])
    across = np.array([-along[1], along[0]])
    speeds = []
    for wave, material, side in ((crossed.first, GRAPHITE, -1.0), (crossed.second, LEAD, 1.0)):
        front = SPEED * math.sin(wave.wave_angle)
        push = wave.p / (material.rho0 * front)  # momentum
        assert wave.rho == pytest.approx(material.rho0 * front / (front - push), rel=1e-10)
        # the second's front trails behind the point, the first's leads below it: both push up
        angle = wave.wave_angle
        normal = np.array([math.sin(angle), math.cos(angle)])
        velocity = push * normal
        seen = velocity - np.array([SPEED, 0.0])  # from the point, which goes to larger x
        assert abs(seen @ across) < 1e-7 * SPEED, side
        assert math.hypot(*seen) == pytest.approx(wave.speed_behind, rel=1e-9)
        speeds.append(-seen @ along)
    assert crossed.slip == pytest.approx(speeds[1] - speeds[0], rel=1e-6)
    assert crossed.normal_speed == pytest.approx(SPEED * math.sin(crossed.deflection))
    assert crossed.first.mach_behind < 1.0, "or a reflected wave would stand at the point"


def test_growth_solves_the_equation_of_the_vortex_sheet(crossed):
    k = 2.0 * math.pi / 4e-3
    one, two = crossed.first, crossed.second
    u = np.array([SPEED - one.speed_behind, SPEED - two.speed_behind])
    rho = np.array([one.rho, two.rho])
    mean, square = rho @ u / rho.sum(), rho @ u**2 / rho.sum()

    def slope(_, state):
        return [state[1], -2j * k * mean * state[1] + k**2 * square * state[0]]

    rate = k * crossed.atwood * crossed.normal_speed - 1j * k * mean
    times = np.linspace(0.0, 3e-6, 7)
    found = solve_ivp(slope, (0.0, 3e-6), [1.0 + 0j, rate], t_eval=times, rtol=1e-9, atol=1e-12)
    grown = crossed.compute_growth(k, times) / crossed.compression
    assert np.abs(found.y[0]) == pytest.approx(grown, rel=1e-6)
    assert grown[-1] > 3.0
    assert crossed.compute_growth(k, -1e-6) == 1.0


def test_a_ripple_is_flattened_as_the_shock_runs_over_it(crossed):
    angle, height = crossed.first.wave_angle, 1e-6
    normal = np.array([math.sin(angle), math.cos(angle)])
    front = SPEED * math.sin(angle)
    late = [normal @ (0.0, y) / front for y in (height, -height)]
    moved = [y - crossed.normal_speed * t for y, t in zip((height, -height), late, strict=True)]
    assert (moved[0] - moved[1]) / (2.0 * height) == pytest.approx(crossed.compression, rel=1e-12)
