"""The time left of made-up runs whose steps are known."""

from __future__ import annotations

import numpy as np
import pytest

from runs.forecast.time_left import TimeLeft, make_course


def march(step_of, t_end=1.0, seconds=lambda t: 0.01):
    """Steps, times and wall times of a run with dt = step_of(t)."""
    t, wall, rows = 0.0, 0.0, []
    while t < t_end:
        t = min(t + step_of(t), t_end)
        wall += seconds(t)
        rows.append((len(rows) + 1, t, wall))
    return rows


def foretell(rows, share, course=None, t_end=1.0):
    """The forecast at this share of the wall time, and what came true."""
    left = TimeLeft(t_end, course)
    for step, t, wall in rows:
        left.note(step, t, wall)
        if wall >= share * rows[-1][2]:
            return left.foretell(step, t, wall), rows[-1][2] - wall
    raise AssertionError


@pytest.mark.parametrize("share", [0.05, 0.25, 0.5, 0.9])
def test_a_steady_run_is_foretold_to_a_per_cent(share):
    forecast, real = foretell(march(lambda t: 1e-3), share)
    assert forecast.seconds == pytest.approx(real, rel=0.02)
    assert forecast.low <= real <= forecast.high
    assert forecast.steps == pytest.approx(real / 0.01, rel=0.02)


@pytest.mark.parametrize("fall", [3.0, 10.0, 30.0])
def test_a_falling_dt_is_followed(fall):
    rows = march(lambda t: 2e-3 * np.exp(-np.log(fall) * t))
    forecast, real = foretell(rows, 0.25)
    t = next(t for _, t, wall in rows if wall >= 0.25 * rows[-1][2])
    naive = 0.25 * rows[-1][2] * (1.0 - t) / t
    assert 0.67 < forecast.seconds / real < 1.5
    assert abs(np.log(forecast.seconds / real)) < abs(np.log(naive / real))
    assert forecast.low <= real <= forecast.high


def test_a_past_run_tells_of_a_fall_that_has_not_begun():
    past = march(lambda t: 4e-3 if t < 0.5 else 4e-5)
    rows = march(lambda t: 2e-3 if t < 0.5 else 2e-5)
    steps, times, walls = (np.array([0, *column], float) for column in zip(*past, strict=True))
    course = make_course(steps, times, np.diff(walls, prepend=0.0), 4e-3)
    left_alone, left_told = TimeLeft(1.0), TimeLeft(1.0, course)
    for step, t, wall in rows[:100]:  # of 25250
        for left in (left_alone, left_told):
            left.note(step, t, wall)
    real = rows[-1][2] - rows[99][2]
    assert left_alone.foretell(*rows[99]).high < real
    told = left_told.foretell(*rows[99])
    assert 0.6 < told.seconds / real < 1.6 and told.low <= real <= told.high


def test_nothing_is_said_before_there_is_something_to_say():
    left = TimeLeft(1.0)
    assert left.foretell(0, 0.0, 0.0) is None
    left.note(1, 0.001, 0.01)
    assert left.foretell(1, 0.001, 0.01) is None
    assert TimeLeft(float("inf")).foretell(100, 0.5, 1.0) is None
    rows = march(lambda t: 1e-2)
    end = TimeLeft(1.0)
    for row in rows:
        end.note(*row)
    assert end.foretell(*rows[-1]).seconds == 0.0
