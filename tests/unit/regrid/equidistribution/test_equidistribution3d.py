"""ED3: the discrete operator, exact grids, orders, threads, and the order of work of a block."""

import numpy as np

from builders import box
from shockgrid.regrid.equidistribution.volumes import solve_ed3


def cube(*shape):
    return box((0.0,) * 3, (1.0,) * 3, shape)


def horn(p):
    """A square duct whose width falls along z from 1.5 to 1, with curved sides."""
    a, b, c = p
    width = 1.5 - c * c * (1.5 - c)
    return np.array([(a - 0.5) * width, (b - 0.5) * width, c - 1.0])


def shell(q):
    """Part of a spherical shell with equal volumes: r = (1 + 7 q1)^(1/3), cosine linear in q2."""
    r = np.cbrt(1.0 + 7.0 * q[0])
    cosine = q[1] - 0.5
    longitude = 1.2 * q[2]
    sine = np.sqrt(1.0 - cosine * cosine)
    return r * np.array([sine * np.cos(longitude), sine * np.sin(longitude), -cosine])


def weight_in_z(x, y, z):
    return 1.0 + 10.0 * (z + 1.0)


def tensor_weight(x, y, z):
    return (1.0 + 10.0 * x) * (1.0 + 5.0 * y) * (1.0 + 3.0 * z)


def tensor_mapping(q):
    return np.array([(np.sqrt(1.0 + c * (c + 2.0) * v) - 1.0) / c for c, v in zip((10, 5, 3), q)])  # noqa: B905


def test_tensor_grid_is_exact():
    nodes = tensor_mapping(cube(10, 8, 9))
    found = solve_ed3(nodes, tensor_weight)
    assert found.stop == "converged" and found.best == 0
    assert found.residuals[0] < 1e-13 and found.spreads[0] < 1e-13
    assert np.array_equal(found.nodes, nodes)


def test_spherical_shell_is_second_order():
    errors = []
    spreads = []
    for steps in (6, 12):
        exact = shell(cube(steps, steps, steps))
        found = solve_ed3(exact, 1.0, 400, 1e-9)
        errors.append(np.abs(found.nodes - exact).max())
        spreads.append(found.spreads[found.best])
    assert errors[0] / errors[1] > 3.3 and errors[1] < 1e-3
    assert spreads[0] / spreads[1] > 3.0 and spreads[1] < 1e-3


def test_turned_moved_and_scaled_blocks_have_the_same_grid():
    start = horn(cube(8, 7, 6))
    expected = solve_ed3(start, weight_in_z, 20).nodes
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = np.array([2.0, -1.0, 0.5]).reshape(3, 1, 1, 1)
    for scale in (1.0, 1e-10):

        def back(x, y, z, scale=scale):
            return weight_in_z(*np.tensordot(turn.T, np.array([x, y, z]) / scale - shift, 1))

        carried = scale * (np.tensordot(turn, start, 1) + shift)
        found = np.tensordot(turn.T, solve_ed3(carried, back, 20).nodes / scale - shift, 1)
        assert np.abs(found - expected).max() < 1e-10
