"""EDC on curves and EDS on surfaces: exact laws, ED2 on a plane, and areas on a sphere."""

import numpy as np
import pytest

from builders import tensor
from equidistributing import solve_ed2
from regrid.equidistribution.volumes import (
    solve_edc,
    solve_eds,
    weigh_surface,
)


def catenary(x):
    return np.array([x, np.cosh(x)])


@pytest.mark.parametrize("end", [1.0, 2.0])
def test_catenary_has_equal_arcs_in_the_limit_and_equal_chords_always(end):
    errors = []
    for steps in (10, 20, 40):
        q = np.linspace(0.0, 1.0, steps + 1)
        x = solve_edc(catenary, 1.0, steps + 1, 0.0, end)
        chords = np.hypot(*np.diff(catenary(x), axis=1))
        assert np.ptp(chords) < 1e-12 * chords.mean()
        errors.append(np.abs(x - np.arcsinh(q * np.sinh(end))).max())
    assert errors[0] / errors[1] > 3.6 and errors[1] / errors[2] > 3.6
    assert errors[2] < 4e-4 * end


def test_helix_has_weight_times_chord_constant():
    def helix(p):
        return np.array([np.cos(5.0 * p), np.sin(5.0 * p), p * p])

    def weight(x, y, z):
        return 1.0 + 10.0 * z

    p = solve_edc(helix, weight, 31)
    points = helix(p)
    products = weight(*helix(0.5 * (p[1:] + p[:-1])))
    products *= np.sqrt((np.diff(points, axis=1) ** 2).sum(axis=0))
    assert np.ptp(products) < 1e-12 * products.mean()
    backward = solve_edc(helix, weight, 31, 1.0, 0.0)
    assert np.abs(backward[::-1] - p).max() < 1e-12


def square(steps, size=0.0):
    q = np.linspace(0.0, 1.0, steps + 1)
    p = tensor(q, q)
    bump = np.sin(np.pi * p[0]) * np.sin(np.pi * p[1])
    return p + size * np.array([bump, -bump]) * (bump > 1e-12)


def test_on_a_plane_with_cartesian_parameters_eds_is_ed2():
    tilt = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 2)))[0]

    def plane(p):
        return np.tensordot(tilt, p, axes=1) + 0.3

    def weight(x, y):
        return 1.0 + 8.0 * np.exp(-10.0 * ((x - 0.4) ** 2 + (y - 0.6) ** 2))

    def in_space(x, y, z):
        return weight(*np.tensordot(tilt.T, np.array([x, y, z]) - 0.3, axes=1))

    start = square(12, 0.1)
    W = weigh_surface(plane, in_space, start)
    centres = 0.25 * (start[:, 1:, 1:] + start[:, 1:, :-1] + start[:, :-1, 1:] + start[:, :-1, :-1])
    assert np.abs(W / weight(*centres) - 1.0).max() < 1e-13
    flat = solve_ed2(start, weight, 30)
    tilted = solve_eds(plane, start, in_space, 30)
    assert np.abs(flat.nodes - tilted.nodes).max() < 1e-12
    assert np.allclose(flat.residuals, tilted.residuals, rtol=1e-9)
