"""The isentropic vortex: an exact solution, its period, and averages that converge."""

import numpy as np
import pytest

from problems.references.vortex import Vortex


def make_grid(cells, wave=0.0):
    line = np.linspace(0.0, 10.0, cells + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    bump = wave * np.sin(0.2 * np.pi * x) * np.sin(0.2 * np.pi * y)
    return np.array([x + bump, y + bump])


def test_it_is_steady_in_its_own_frame_and_isentropic():
    vortex, h = Vortex(stream=(0.0, 0.0)), 1e-4
    rng = np.random.default_rng(7)
    x, y = rng.uniform(3.0, 7.0, (2, 40))
    rho, u, v, p = vortex.sample(x, y)
    np.testing.assert_allclose(p / rho**1.4, 1.0, rtol=1e-13)

    def slopes(k):
        east, west = vortex.sample(x + h, y)[k], vortex.sample(x - h, y)[k]
        north, south = vortex.sample(x, y + h)[k], vortex.sample(x, y - h)[k]
        return (east - west) / (2 * h), (north - south) / (2 * h)

    (u_x, u_y), (v_x, v_y), (p_x, p_y), (rho_x, rho_y) = (slopes(k) for k in (1, 2, 3, 0))
    np.testing.assert_allclose(rho * (u * u_x + v * u_y) + p_x, 0.0, atol=1e-7)
    np.testing.assert_allclose(rho * (u * v_x + v * v_y) + p_y, 0.0, atol=1e-7)
    np.testing.assert_allclose(u * rho_x + v * rho_y + rho * (u_x + v_y), 0.0, atol=1e-7)


def test_averages_add_up_on_any_grid():
    vortex = Vortex()
    straight = vortex.compute_cell_averages(make_grid(32))
    wavy_nodes = make_grid(32, 0.2)
    wavy = vortex.compute_cell_averages(wavy_nodes)
    dx, dy = wavy_nodes[:, 1:, 1:] - wavy_nodes[:, :-1, :-1]
    ex, ey = wavy_nodes[:, :-1, 1:] - wavy_nodes[:, 1:, :-1]
    d, e = np.array([dx, dy]), np.array([ex, ey])
    areas = 0.5 * (d[0] * e[1] - d[1] * e[0])
    mass = np.sum(straight[0]) * (10 / 32) ** 2
    assert np.sum(wavy[0] * areas) == pytest.approx(mass, rel=1e-8)
    momentum = np.sum(straight[0] * straight[1]) * (10 / 32) ** 2
    assert np.sum((wavy[0] * wavy[1]) * areas) == pytest.approx(momentum, rel=1e-8)
