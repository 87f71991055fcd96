"""Weights as formulas: what they mean, what they refuse, and what they are on a grid."""

import numpy as np
import pytest

from builders import box
from shockgrid.regrid.equidistribution.weights import (
    Expression,
    Weight,
    measure_gradient,
)
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.corners import compute_centres

F = np.array([1.0, 2.0, 4.0])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 10*f", 1.0 + 10.0 * F),
        ("1 + 5*|g|/max", 1.0 + 5.0 * F[::-1] / 4.0),
        ("1 + 5*|g|/f/max", 1.0 + 5.0 * (F[::-1] / F) / 4.0),
        ("5*2*f/max", 10.0 * F / 4.0),
        ("-2*f/max + 3", 3.0 - 2.0 * F / 4.0),
        ("f/max", F / 4.0),
        ("3/f/max", 3.0 / F),
        ("0*f/max", 0.0 * F),
        ("|1 - |f - 3||", np.abs(1.0 - np.abs(F - 3.0))),
        ("max(f, 2)**2 - min(f, g)", np.maximum(F, 2.0) ** 2 - np.minimum(F, F[::-1])),
        ("sqrt(f)*exp(-f)/pi", np.sqrt(F) * np.exp(-F) / np.pi),
        ("2**-f", 2.0**-F),
    ],
)
def test_formulas_mean_what_they_say(text, value):
    assert np.allclose(Expression(text).evaluate({"f": F, "g": F[::-1]}), value, rtol=1e-15)


def bent_grid(ni=16, nj=12):
    a, b = box((0, 0), (1, 1), (ni, nj))
    return np.array([a + 0.1 * np.sin(3.0 * b), b + 0.2 * a * a])


def test_position_follows_the_grid_and_fields_stay_with_the_cells():
    grid = bent_grid()
    moved = bent_grid() + 0.25
    weight = Weight("1 + x*x").on(grid, grid)
    assert np.allclose(weight(moved), 1.0 + compute_centres(moved)[0] ** 2)
    carried = Weight("1 + rho", smoothing=0)
    with pytest.raises(BadInput, match="no flow"):
        carried.on(grid, grid)
    rho = np.arange(192.0).reshape(16, 12)
    carried.take_fields({"rho": rho})
    assert np.array_equal(carried.on(grid, grid)(moved), 1.0 + rho)
    with pytest.raises(BadInput, match=r"shape \(15, 12\)"):
        carried.take_fields({"rho": rho[1:]})
        carried.on(grid, grid)


def test_gradient_of_a_linear_field_is_exact_on_any_grid_turned_or_not():
    grid = bent_grid()
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    for nodes in (grid, np.tensordot(turn, grid, 1), grid[::-1]):
        centres = compute_centres(nodes)
        slope = measure_gradient(3.0 * centres[0] - 4.0 * centres[1] + 7.0, centres)
        assert np.abs(slope - 5.0).max() < 1e-11
