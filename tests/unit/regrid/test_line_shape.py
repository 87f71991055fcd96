"""Turns and edge ratios of lines whose answers are known."""

import numpy as np

from regrid.measure.quality import measure_edge_ratio, measure_turns


def test_a_polygon_turns_by_its_outer_angle_and_the_way_it_is_walked():
    angle = np.linspace(0.0, 2.0 * np.pi, 13)
    circle = np.array([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(measure_turns(circle), np.pi / 6.0, rtol=1e-12)
    np.testing.assert_allclose(measure_turns(circle[:, ::-1]), -np.pi / 6.0, rtol=1e-12)


def test_a_straight_line_does_not_turn_and_its_steps_are_compared():
    line = np.array([[0.0, 1.0, 3.0, 4.0], [0.0, 2.0, 6.0, 8.0]])
    assert np.abs(measure_turns(line)).max() < 1e-15
    assert measure_edge_ratio(line) == 2.0
