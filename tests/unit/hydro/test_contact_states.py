"""The contact state between two gases against exact Riemann solutions, also where Newton's method
does not settle."""

import numpy as np
import pytest

from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.formulas.riemann import compute_contact
from shockgrid.problems.references.riemann import solve_riemann

REST = (1.0, 0.4), (1.0, 0.2)  # density and pressure on both sides


def compute_between(gammas, speeds, sides=REST):
    """(p*, w*) between gases of these gammas and velocities."""
    states = []
    for gamma, w, (rho, p) in zip(gammas, speeds, sides, strict=True):
        c = np.sqrt(gamma * p / rho)
        states.append((rho, w, p, c, ((gamma + 1.0) / 4.0, (gamma + 1.0) / 4.0, 0.0)))
    return compute_contact(*states, 0.0)


def find_escape_speed(gammas):
    """Half of the speed with which the gases of REST part when they leave a vacuum."""
    speeds = [
        2.0 * np.sqrt(gamma * p / rho) / (gamma - 1.0)
        for gamma, (rho, p) in zip(gammas, REST, strict=True)
    ]
    return 0.5 * sum(speeds)


@pytest.mark.parametrize("gammas", [(1.1, 1.1), (1.25, 1.25), (1.4, 1.1), (5 / 3, 1.4)])
@pytest.mark.parametrize("part", [0.3, 0.7, 0.9, 0.97])
def test_gases_that_part_have_the_exact_state(gammas, part):
    speed = part * find_escape_speed(gammas)
    eos = [IdealGas(gamma) for gamma in gammas]
    sides = [(rho, w, p) for w, (rho, p) in zip((-speed, speed), REST, strict=True)]
    exact = solve_riemann(eos[0], sides[0], eos[1], sides[1])
    p, w = compute_between(gammas, (-speed, speed))
    assert p == pytest.approx(exact.p, rel=1e-5, abs=0.0)
    assert w == pytest.approx(exact.u, abs=1e-6 * speed)


@pytest.mark.parametrize("excess", [1.01, 2.0, 100.0])
def test_no_pressure_across_a_vacuum(excess):
    gammas = 1.1, 1.25
    speed = excess * find_escape_speed(gammas)
    p, w = compute_between(gammas, (-speed, speed))
    assert p == 0.0
    assert abs(w) < speed


def test_the_mirror_image_has_the_mirrored_state_bitwise():
    gammas = 1.1, 1.25
    for part in (0.9, 0.99, 1.5):
        speed = part * find_escape_speed(gammas)
        p, w = compute_between(gammas, (-speed, 0.5 * speed))
        other = compute_between(gammas[::-1], (-0.5 * speed, speed), REST[::-1])
        assert other == (p, -w)


def test_a_cold_gas_takes_no_pressure_from_a_hot_one_that_leaves_it():
    """No mean of two pressures that differ."""
    sides = (1e-4, 2e-5), (1e-9, 1e-20)
    p, _ = compute_between((1.25, 1.25), (-3.0, 3.5), sides)
    assert p <= 1e-20


def test_a_gas_of_next_to_no_density_is_pushed_away():
    sides = (1e-30, 1e-30), (1e-46, 1e-48)
    p, w = compute_between((1.1, 1.1), (0.0, 0.0), sides)
    assert 1e-47 < p < 1e-30
    assert w > 0.0
