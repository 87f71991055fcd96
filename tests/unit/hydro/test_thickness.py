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


def test_the_decay_does_not_depend_on_how_a_short_wave_is_cut_into_nodes():
    """Waves beyond the cut-off go in a step, however long it is; none overshoots."""
    for count in (8, 16, 64):
        line = make_wave(count, height=1e-4)
        after = smooth(line, False, WALL, 1e3)
        assert np.abs(after[0]).max() < 1e-5 * 1e-4


@pytest.mark.parametrize("ratio", [1.0, 2.0, 4.0])
def test_an_ellipse_becomes_a_circle_of_its_area(ratio):
    line = make_ellipse(ratio, 1.0, 64)
    after = smooth(line, True, FREE, 1e-3, steps=400)
    assert compute_area(after) == pytest.approx(compute_area(line), rel=1e-13)
    before, reached = np.hypot(*line), np.hypot(*after)
    assert np.ptp(reached) <= max(0.9 * np.ptp(before), 1e-12)


def test_a_circle_and_a_straight_line_stay():
    circle = make_ellipse(1.0, 1.0, 48)
    assert np.abs(smooth(circle, True, FREE, 1.0, steps=10) - circle).max() < 1e-14
    place = np.linspace(0.0, 1.0, 33) ** 1.3
    line = np.array([3.0 * place, 4.0 * place])
    for closed in (False, True):
        assert np.abs(smooth(line, closed, FREE, 1.0, steps=10) - line).max() < 1e-14


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


@pytest.mark.parametrize("closed", [False, True])
def test_the_mirror_image_has_the_same_bits(closed):
    y = np.linspace(-1.0, 1.0, 42)
    y = 0.5 * (y - y[::-1])
    noise = np.random.default_rng(1).normal(size=42)
    x = 0.3 * np.cos(4.0 * y) + 0.02 * (noise + noise[::-1])
    line = np.array([x, y])
    after = smooth(line, closed, WALL, 1e-4, steps=3)
    assert np.abs(after - line).max() > 1e-3
    assert np.array_equal(after[0], after[0, ::-1])
    assert np.array_equal(after[1], -after[1, ::-1])


def test_half_a_wave_between_walls_is_half_of_the_whole_one():
    y = np.linspace(0.0, 0.5, 33) ** 1.1
    half = np.array([0.2 * np.cos(np.pi * y / y[-1]), y])
    whole = np.concatenate([half[:, :0:-1] * [[1.0], [-1.0]], half], axis=1)
    after, all_of_it = smooth(half, False, WALL, 1e-5), smooth(whole, True, FREE, 1e-5)
    assert np.abs(after - half).max() > 1e-3
    assert np.abs(all_of_it[:, 32:] - after).max() < 1e-15
