"""EDC on curves and EDS on surfaces: exact laws, ED2 on a plane, and areas on a sphere."""

import numpy as np
import pytest

from builders import tensor
from equidistributing import solve_ed2
from regrid.curves import solve_ed1
from regrid.equidistribution.volumes import (
    compute_surface_areas,
    solve_edc,
    solve_eds,
    weigh_surface,
)
from regrid.errors import BadInput
from regrid.sides import SIDES


def catenary(x):
    return np.array([x, np.cosh(x)])


@pytest.mark.parametrize("end", [1.0, 2.0])
def test_catenary_has_equal_arcs_in_the_limit_and_equal_chords_always(end):
    """w = 1: x_j = asinh(q_j sinh X)."""
    errors = []
    for steps in (10, 20, 40):
        q = np.linspace(0.0, 1.0, steps + 1)
        x = solve_edc(catenary, 1.0, steps + 1, 0.0, end)
        chords = np.hypot(*np.diff(catenary(x), axis=1))
        assert np.ptp(chords) < 1e-12 * chords.mean()
        errors.append(np.abs(x - np.arcsinh(q * np.sinh(end))).max())
    assert errors[0] / errors[1] > 3.6 and errors[1] / errors[2] > 3.6
    assert errors[2] < 4e-4 * end


def test_catenary_by_its_arc_length_is_exact():
    """By arc length |f'| = 1 and (5.9) is (2.22): ED1, exact for w = 1."""
    length = np.sinh(1.5)
    x = np.arcsinh(solve_ed1(np.ones_like, 21, 0.0, length))
    exact = np.arcsinh(np.linspace(0.0, 1.0, 21) * length)
    assert np.abs(x - exact).max() < 1e-15 * 21


def test_straight_segment_in_space_is_ed1():
    direction = np.array([[2.0], [-1.0], [2.0]])
    p = solve_edc(lambda p: 0.5 + direction * p, lambda x, y, z: 1.0 + 5.0 * (x - 0.5), 16)
    assert np.abs(p - solve_ed1(lambda p: 1.0 + 10.0 * p, 16)).max() < 1e-13


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
    """(4.19) is (2.14), term by term, on every grid."""
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


def test_zone_of_a_sphere_has_equal_areas():
    """Longitude and latitude: equal areas are equal steps of the sine of latitude."""

    def sphere(p):
        longitude, latitude = 1.5 * p[0], 1.2 * p[1]
        return np.array(
            [
                np.cos(latitude) * np.cos(longitude),
                np.cos(latitude) * np.sin(longitude),
                np.sin(latitude),
            ]
        )

    errors = []
    for steps in (8, 16):
        q = np.linspace(0.0, 1.0, steps + 1)
        latitude = np.arcsin(q * np.sin(1.2)) / 1.2
        exact = tensor(q, latitude)
        found = solve_eds(sphere, exact, iterations=300, tolerance=1e-8)
        areas = compute_surface_areas(sphere(found.nodes))
        assert areas.std() < 0.02 / (steps / 8) ** 2 * areas.mean()
        errors.append(np.abs(found.nodes - exact).max())
    assert errors[0] / errors[1] > 3.2


def test_edges_then_face_spread_the_weight_better_than_the_face_alone():
    def surface(p):
        return np.array([p[0], p[1], 0.3 * np.sin(np.pi * p[0]) * p[1]])

    def weight(x, y, z):
        return 1.0 + 10.0 * x

    alone = solve_eds(surface, square(16), weight, 60)
    placed = square(16)
    for side in SIDES:  # straight lines in the plane of the parameters, by EDC
        line = placed[side]
        first, last = line[:, :1].copy(), line[:, -1:].copy()
        law = solve_edc(lambda s, a=first, b=last: surface(a + s * (b - a)), weight, line.shape[1])
        placed[side][:, 1:-1] = (first + law * (last - first))[:, 1:-1]
    both = solve_eds(surface, placed, weight, 60)
    assert both.spreads[both.best] < 0.5 * alone.spreads[alone.best]
    corners = np.ix_((0, 1), (0, -1), (0, -1))
    assert np.array_equal(placed[corners], square(16)[corners])


def test_weights_that_cannot_be_are_bad_input():
    with pytest.raises(BadInput, match="positive"):
        solve_edc(catenary, lambda x, y: x - 10.0, 5)
    with pytest.raises(BadInput, match="2 nodes"):
        solve_edc(catenary, 1.0, 1)
