"""Node speeds against the boundary's, and the limit on them."""

from pathlib import Path

import numpy as np
import pytest

from builders import unit_steps
from regrid.algebraic import fill_displacement
from regrid.measure.quality import compute_corner_areas, find_bad_cells
from regrid.node_speeds import (
    KEPT,
    LOOSE,
    MotionLimiter,
    fill_limited,
    find_fast_rows,
    limit_node_speeds,
    measure_node_speeds,
)


def thrown(old):
    """The block moves by (.1, 0), but one inner node by (.4, 0)."""
    new = old.copy()
    new[0] += 0.1
    new[0, 3, 4] = old[0, 3, 4] + 0.4
    return new


def test_limit_holds_back_only_the_node_that_is_too_fast():
    old = unit_steps(8, 8)
    new = thrown(old)
    limited = limit_node_speeds(old, new, factor=2.0)
    assert np.isclose(measure_node_speeds(old, limited).ratio, 2.0)
    same = np.ones((9, 9), dtype=bool)
    same[3, 4] = False
    assert np.array_equal(limited[:, same], new[:, same])
    assert limit_node_speeds(old, new, factor=5.0) is new


def test_convexity_goes_before_the_limit():
    old = unit_steps(8, 8)
    new = old.copy()
    # All of column 4 jumps by 1.6 cells inside; held back at its own speed it would be passed.
    new[0, 1:-1, 1:-1] += 0.9
    new[0, 0] += 0.3
    limited = limit_node_speeds(old, new, factor=1.0)
    assert len(find_bad_cells(limited)) == 0


def fan(angle):
    """Cells between two arcs; those inside turn by `angle` against them, the ends with them."""
    r = np.linspace(0.3, 1.0, 9)[:, None]
    turn = np.linspace(0.2, 3.0, 25) + angle * np.sin(np.pi * (r - 0.3) / 0.7)
    return np.array([r * np.cos(turn), r * np.sin(turn)])


def interpolate(old, new):
    """The sides' displacement carried inside."""
    out = np.empty_like(old)
    fill_displacement(old, new, out)
    return out


def fill_everywhere(old, new, interpolated, most, out):
    """`fill_limited` without knowing where to look."""
    first, last = np.full(old.shape[1], 1), np.full(old.shape[1], old.shape[2] - 2)
    return fill_limited(old, new, interpolated, most, first, last, out)


@pytest.mark.parametrize("angle", [0.02, 0.05, 0.1])
def test_rows_looked_at_hold_all_limited_nodes(angle):
    old, new = fan(0.0), fan(angle)
    new[:, :, :12] = old[:, :, :12]
    limit = MotionLimiter(old.shape)
    _, count = limit.limit(old, new, 0.3)
    first, last = np.empty(9, dtype=np.int64), np.empty(9, dtype=np.int64)
    raw = np.empty_like(old)
    rows = find_fast_rows(old, new, interpolate(old, new), 0.3, first, last)
    looked_at = first <= last
    assert count == fill_everywhere(old, new, interpolate(old, new), 0.3, raw)
    held = (raw != new).any(axis=0).any(axis=1)
    assert rows == looked_at.sum() == held.sum() and (looked_at == held).all()


def test_cells_that_holding_sharpens_are_held_less():
    old, new = fan(0.0), fan(0.1)
    least = np.minimum(compute_corner_areas(old), compute_corner_areas(new))
    limit = MotionLimiter(old.shape)
    held, count = limit.limit(old, new, 0.3)
    raw, far = np.empty_like(old), np.empty_like(old)
    assert count == fill_everywhere(old, new, interpolate(old, new), 0.3, raw) > 0
    fill_everywhere(old, new, interpolate(old, new), LOOSE * 0.3, far)
    sharpened = (compute_corner_areas(raw) < KEPT * least).any(axis=0)
    assert 0 < sharpened.sum() < 0.9 * sharpened.size
    closer = (compute_corner_areas(held) / least).min() - (compute_corner_areas(raw) / least).min()
    assert closer > 0.02
    between = np.abs(held - raw) + np.abs(far - held)
    np.testing.assert_allclose(between, np.abs(far - raw), atol=1e-14)


@pytest.mark.parametrize("most", [0.3, 0.1])
def test_folds_without_end_do_not_let_a_block_jump(most):
    found = np.load(Path(__file__).with_name("folds_without_end.npz"))
    old, new = found["old"], found["new"]
    held, count = MotionLimiter(old.shape).limit(old, new, most)
    assert count > 0 and len(find_bad_cells(held)) == 0
    assert np.abs(held - old).max() < 0.1 * np.abs(new - old).max()
