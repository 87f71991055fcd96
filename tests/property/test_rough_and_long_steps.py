"""Boundaries with fresh noise and steps of five cells: few parts, and the marched grid stays good.

Counts are bounds with a margin; every cell is convex in every step, or `march_domain` would not
get on.
"""

import pytest
from test_barrier_motions import march_domain


@pytest.mark.parametrize(
    ("name", "most", "gap"),
    [
        ("three_fingers", 0, 1.3),
        ("curled_fingers", 4, 1.3),
        ("single_finger", 14, 1.3),
        ("slender_finger", 26, 1.3),
        ("chicane", 7, None),  # strips that turn as a whole: their ends have other first lines
        ("z_shape", 0, None),
    ],
)
def test_five_cells_a_step(name, most, gap):
    worst, _ = march_domain(name, 60, 40, cells=5.0)
    assert worst["bad"] == 0 and worst["sub_moves"] <= most
    assert worst["sine"] > 0.015 and (gap is None or worst["gap"] < gap)


@pytest.mark.parametrize(("noise", "most"), [(0.05, 25), (0.1, 80)])
def test_noise_of_twentieths_of_a_cell_on_the_thin_finger(noise, most):
    worst, _ = march_domain("single_finger", 60, 40, noise=noise)
    assert worst["bad"] == 0 and worst["sub_moves"] <= most
    assert worst["gap"] < 1.7
