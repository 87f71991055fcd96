"""Lengths, grading and ends of `riemann` by the waves; what it refuses and what it says."""

import numpy as np
import pytest

from problems.riemann.domain import BEYOND, MOST_GROWTH, SHARE
from problems.riemann.problem import Riemann, RiemannDeck, SideState, grade
from problems.riemann.random_pairs import make_random_pair
from regrid.errors import BadInput


def make(left, right, **options) -> Riemann:
    return Riemann(RiemannDeck(left=left, right=right, **options))


@pytest.mark.parametrize("seed", range(12))
def test_every_plateau_has_its_cells_and_every_wave_its_place(seed):
    problem = make(*make_random_pair(seed), cells=200)
    exact, domain = problem.exact, problem.domain
    assert sum(domain.lengths) <= 1.0 + 1e-12 and domain.lengths[0] > 0.0
    sides = zip(
        (-1, 1), (exact.left_wave, exact.right_wave), domain.lengths, domain.ends, domain.growths,
        strict=True,
    )  # fmt: skip
    for sign, wave, length, end, growth in sides:
        for part in (0.0, 0.3, 1.0):  # the end keeps ahead of the wave at all times
            t = part * domain.t_end
            assert sign * (sign * length + (end - wave.head) * t) > 0.0
        last = length + sign * (end - exact.u) * domain.t_end
        zone = sign * (wave.head - exact.u) * domain.t_end
        assert zone == pytest.approx((1.0 - BEYOND) * last)
        edges = last * grade(100, growth)
        inside = np.count_nonzero(edges[1:] <= sign * (wave.tail - exact.u) * domain.t_end)
        assert inside >= 100 * SHARE - 1 or growth == MOST_GROWTH
        if wave.kind == "shock":
            assert end == pytest.approx(exact.u) and growth == 1.0


def test_a_captured_contact_has_all_waves_on_its_grid():
    left, right = SideState(rho=1.0, u=30.0, p=1.0), SideState(rho=1.0, u=30.0, p=0.1)
    for mesh, speed in (("fixed", 0.0), ("follow", None)):
        problem = make(left, right, contact="captured", mesh=mesh)
        speed = problem.exact.u if speed is None else speed
        t = problem.t_end
        low, high = (sign * x for sign, x in zip((-1, 1), problem.domain.lengths, strict=True))
        assert low < min(0.0, (problem.exact.left_wave.head - speed) * t)
        assert high > max(0.0, (problem.exact.right_wave.head - speed) * t)
        assert high - low == pytest.approx(1.0)


def test_gases_that_part_are_refused_by_name():
    limit = 2.0 * 2.0 * np.sqrt(1.4 * 0.4) / 0.4

    def part(speed):
        return make(
            SideState(rho=1.0, u=-0.5 * speed, p=0.4), SideState(rho=1.0, u=0.5 * speed, p=0.4)
        )

    with pytest.raises(BadInput, match=rf"part and leave a vacuum .* less than {limit:.6g} m/s"):
        part(1.01 * limit)
    assert part(0.99 * limit).exact.p > 0.0
