"""What a cell that sets the step means, told from made-up grids."""

from __future__ import annotations

import numpy as np
import pytest

from runs.forecast.meaning import Stretch, classify

N = 40


def fill(line: np.ndarray, low: float = -1.0, count: int = 10) -> np.ndarray:
    """A grid (2, count + 1, n) between x = low and a line (2, n), which is its i_max."""
    start = np.array(
        [np.full(line.shape[1], low), np.linspace(line[1, 0], line[1, -1], line.shape[1])]
    )
    share = np.linspace(0.0, 1.0, count + 1)[:, None]
    return start[:, None, :] * (1.0 - share) + line[:, None, :] * share


def sides(nodes: np.ndarray, **kinds: str) -> list[Stretch]:
    """One stretch a side; interfaces, surfaces and sliding contacts move."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    found = []
    for side, count in (("i_min", nj), ("i_max", nj), ("j_min", ni), ("j_max", ni)):
        kind = kinds.get(side, "wall")
        moves = kind in ("interface", "sliding", "free-surface")
        found.append(Stretch(side, 0, count, kind, moves))
    return found


def make_straight() -> np.ndarray:
    y = np.linspace(0.0, 1.0, N + 1)
    return fill(np.array([0.0 * y, y]))


def test_a_straight_line_is_a_line_and_its_ends_are_corners():
    nodes = make_straight()
    stretches = sides(nodes, i_max="interface")
    assert classify(nodes, 9, 20, stretches) == "line"
    assert classify(nodes, 8, 20, stretches) == "line"
    assert classify(nodes, 5, 20, stretches) == "inside"
    assert classify(nodes, 9, 0, stretches) == "corner"
    assert classify(nodes, 9, N - 1, stretches) == "corner"
    assert classify(nodes, 5, 0, stretches) == "wall"


def test_a_spiral_is_a_roll_for_either_turn():
    s = np.linspace(0.0, 1.0, 121)
    angle = 3.0 * np.pi * s
    radius = 1.0 - 0.8 * s
    for sign in (1.0, -1.0):
        line = np.array([radius * np.cos(angle), sign * radius * np.sin(angle)])
        line = np.concatenate(
            [np.array([np.full(30, 1.0), sign * np.linspace(-2, -0.05, 30)]), line], 1
        )
        nodes = fill(line, low=4.0)
        assert classify(nodes, 9, 90, sides(nodes, i_max="interface")) == "roll"


@pytest.mark.parametrize("kind", ["wall", "axis"])
def test_a_line_that_closes_on_a_side_is_a_film(kind):
    along = np.linspace(0.0, 2.0, 30)
    low = np.array([along, np.full(30, 0.02)])
    rise = np.array([np.full(20, 2.0), np.linspace(0.02, 1.0, 21)[1:]])
    start = np.array([[0.0, 0.0], [0.0, 0.01]])
    line = np.concatenate([start, low[:, 1:], rise], axis=1)
    ni = 10
    share = np.linspace(0.0, 1.0, ni + 1)[:, None]
    # the block lies below the line: its j_min goes along y = 0 from x = 3 to the line's foot
    far = np.array([np.full(line.shape[1], 3.0), np.linspace(0.0, 1.0, line.shape[1])])
    nodes = far[:, None, :] * (1.0 - share) + line[:, None, :] * share
    stretches = sides(nodes, i_max="interface", j_min=kind)
    assert classify(nodes, 9, 20, stretches) == ("film-axis" if kind == "axis" else "film-wall")
    assert classify(nodes, 9, 45, stretches) == "line"
