"""Axes that follow a fluid: known digits, equal products, stagnant fluid, bounds, averages."""

import numpy as np
import pytest

from hydro.convection import tensor_grids
from hydro.convection.tensor_grids import correct_axis, make_axis


def sine(x):
    return np.sin(np.pi * x)


def settle(kind, x, profile, corrections=400, **options):
    """Corrections by a profile that is known everywhere, until nothing moves."""
    for _ in range(corrections):
        old = x
        x = correct_axis(kind, x, profile(x), **options)
        if np.abs(x - old).max() < 1e-14 * (x[-1] - x[0]):
            break
    return x


def spread(products):
    return np.ptp(products) / products.mean()


@pytest.mark.parametrize(("n", "first"), [(10, 0.207546), (20, 0.144625), (40, 0.101477)])
def test_polevikov_digits(n, first):
    solved = make_axis("polevikov", n, profile=sine)
    corrected = settle("polevikov", make_axis("polevikov", n), sine)
    for x in (solved, corrected):
        assert x[1] == pytest.approx(first, abs=5.1e-7)
        assert spread(tensor_grids.compute_grid_reynolds(x, sine(x))) < 1e-12
        assert np.allclose(x, 1.0 - x[::-1], atol=1e-12)


@pytest.mark.parametrize("relaxation", [1.0, 0.7, 0.4])
def test_linear_speed_is_exact(relaxation):
    exact = (np.sqrt(1.0 + 120.0 * np.linspace(0.0, 1.0, 21)) - 1.0) / 10.0
    x = settle("polevikov", make_axis("uniform", 20), lambda x: 1 + 10 * x, relaxation=relaxation)
    assert np.abs(x - exact).max() < 1e-12
    weights = make_axis("monitor", 20, profile=lambda x: 1 + 10 * x)
    assert np.abs(weights - exact).max() < 1e-12


@pytest.mark.parametrize("ratio", [1.05, 1.2])
@pytest.mark.parametrize("kind", ["polevikov", "monitor", "combined"])
def test_bound_on_neighbours_is_kept(kind, ratio):
    def layer(x):
        return np.tanh(30.0 * (x - 0.3)) * np.sin(np.pi * x)

    x = make_axis(kind, 40)
    for _ in range(25):
        profile = (layer(x), layer(x)) if kind == "combined" else layer(x)
        x = correct_axis(kind, x, profile, ratio=ratio, strength=4.0, relaxation=0.7)
        assert tensor_grids.compute_neighbour_ratio(x) <= ratio * (1.0 + 1e-9)
        assert x[0] == 0.0 and x[-1] == 1.0
    free = settle(
        kind,
        x,
        lambda x: (layer(x), layer(x)) if kind == "combined" else layer(x),
        corrections=25,
        ratio=np.inf,
        strength=4.0,
    )
    assert tensor_grids.compute_neighbour_ratio(free) > ratio, "the bound had nothing to do"
