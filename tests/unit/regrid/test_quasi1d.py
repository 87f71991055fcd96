"""The quasi-1D grid is where the gradient (3) of Q vanishes."""

import numpy as np

from regrid.algebraic import quasi_1d_grid
from regrid.curves import arc_law
from regrid.domains import make_domain


def test_gradient_of_q_vanishes_to_round_off():
    boundary = make_domain("valley", 14, 11).boundary(0.7)
    boundary[1, :, 0] = boundary[1, -1, 0] * np.linspace(0.0, 1.0, 15) ** 1.4
    x = quasi_1d_grid(boundary)
    low, high = arc_law(x[:, :, 0]), arc_law(x[:, :, -1])
    law = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, 12)
    q = 1.0 / (14 * np.diff(law, axis=0))
    pull = q * np.diff(x, axis=1)
    assert np.abs(np.diff(pull, axis=1)[:, :, 1:-1]).max() < 1e-14
    uniform = quasi_1d_grid(make_domain("valley", 14, 11).boundary(0.7))
    assert np.abs(np.diff(uniform, 2, axis=1)[:, :, 1:-1]).max() < 1e-14


def test_other_family_is_the_transposed():
    boundary = make_domain("dome", 9, 7).boundary(0.8)
    turned = quasi_1d_grid(boundary.transpose(0, 2, 1), "j").transpose(0, 2, 1)
    assert np.array_equal(turned, quasi_1d_grid(boundary, "i"))
