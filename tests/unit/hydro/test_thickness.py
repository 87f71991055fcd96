"""A contact's cut-off by itself: decay rate, area, straight lines, mirror images, periodic ends."""

import numpy as np
import pytest

from hydro.motion.thickness import fill_thickness_way

WALL, FREE = (0.0, 1.0), (0.0, 0.0)


def smooth(line, closed, wall, strength, steps=1):
    line = np.ascontiguousarray(line)
    for _ in range(steps):
        way = np.empty_like(line)
        fill_thickness_way(line, closed, wall, wall, strength, way)
        line = line + way
    return line


def compute_area(line):
    return 0.5 * float((line[0, :-1] * line[1, 1:] - line[0, 1:] * line[1, :-1]).sum())


def make_ellipse(a, b, count, uneven=0.3):
    turn = np.linspace(0.0, 2.0 * np.pi, count + 1)
    turn = turn + uneven * np.sin(turn)
    line = np.array([a * np.cos(turn), b * np.sin(turn)])
    line[:, -1] = line[:, 0]
    return line


def make_wave(count, uneven=0.0, closed=False, height=1e-4):
    """A cosine's half length between walls, or the whole, periodic; y runs from 0 to .5 or 1."""
    y = np.linspace(0.0, 1.0 if closed else 0.5, count + 1)
    y = y + uneven * np.sin(4.0 * np.pi * y) / (4.0 * np.pi)
    return np.array([height * np.cos(2.0 * np.pi * y), y])


def measure_decay(line, closed, strength, steps):
    """Decay of mode 1 in strengths times k^4."""
    after = smooth(line, closed, WALL, strength, steps)
    k = 2.0 * np.pi

    def amplitude(x, y):
        wave = x * np.cos(k * y)
        return float((0.5 * (wave[1:] + wave[:-1]) * np.diff(y)).sum())

    return np.log(amplitude(*line) / amplitude(*after)) / (steps * strength * k**4)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("uneven", [0.0, 0.5])
def test_a_wave_decays_as_k_to_the_fourth_of_second_order_in_the_spacing(closed, uneven):
    strength, steps = 1e-5 / (2.0 * np.pi) ** 4, 10
    errors = []
    for count in (8, 16, 32, 64):
        cells = 2 * count if closed else count
        line = make_wave(cells, uneven, closed)
        errors.append(abs(measure_decay(line, closed, strength, steps) - 1.0))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 2e-3
    assert orders.min() > 1.8, (errors, orders)


@pytest.mark.parametrize("ratio", [1.0, 2.0, 4.0])
def test_an_ellipse_becomes_a_circle_of_its_area(ratio):
    line = make_ellipse(ratio, 1.0, 64)
    after = smooth(line, True, FREE, 1e-3, steps=400)
    assert compute_area(after) == pytest.approx(compute_area(line), rel=1e-13)
    before, reached = np.hypot(*line), np.hypot(*after)
    assert np.ptp(reached) <= max(0.9 * np.ptp(before), 1e-12)


def test_a_line_between_walls_and_a_periodic_one_keep_the_area_beside_them():
    rng = np.random.default_rng(3)
    for closed in (False, True):
        line = make_wave(40, 0.4, closed, height=0.1)
        noise = 0.004 * rng.normal(size=41)
        noise[-1] = noise[0] if closed else noise[-1]
        line[0] += noise
        after = smooth(line, closed, WALL, 1e-6, steps=20)
        beside = [float((0.5 * (x[1:] + x[:-1]) * np.diff(y)).sum()) for x, y in (line, after)]
        assert np.abs(after - line).max() > 1e-3
        assert beside[1] == pytest.approx(beside[0], abs=1e-14)
