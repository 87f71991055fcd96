"""A ball hits a harder one: its rim flies off as a thin jet, in which nothing holds pressure."""

import numpy as np
import pytest
from discs import make_half_disc

from builders import check_budget, free, make_body
from shockgrid.hydro.boundary import put
from shockgrid.hydro.motion.line import move_parallel_to_neighbours
from shockgrid.hydro.rows import P
from shockgrid.hydro.simulation import Simulation

RADIUS = 1e-3
GPA = 1e9


def test_nodes_go_along_a_line_without_area():
    """Of a polygon with kinks, one node after the other, to round-off; the ends stay."""
    angles = np.linspace(0.0, 3.0, 9)
    line = np.array([np.cos(angles), np.sin(angles)]) * (1.0 + 0.3 * (np.arange(9) % 2))
    arc = np.concatenate([[0.0], np.hypot(*np.diff(line)).cumsum()])
    for node in range(1, 8):
        positions = arc.copy()
        positions[node] += 0.1 * (arc[node + 1] - arc[node])
        moved = line.copy()
        move_parallel_to_neighbours(line, arc, positions, moved)
        assert np.hypot(*(moved - line)[:, node]) > 0.0
        assert (np.delete(moved, node, axis=1) == np.delete(line, node, axis=1)).all()
        areas = [np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) for x, y in (line, moved)]
        assert areas[1] == pytest.approx(areas[0], abs=1e-14)


def make_half_ball(name, material, middle, speed, cells):
    ball = make_body(name, material, make_half_disc(cells, middle, RADIUS), speed, material="metal")
    put(ball, "j_min", "wall")
    free(ball, "i_min", "i_max", "j_max")
    return ball


def test_a_jet_holds_no_pressure():
    """In the outer part of the front, long after the waves of the impact, of 5 GPa."""
    cells = 20
    soft = make_half_ball("soft", "Al1100", -1.02 * RADIUS, 500.0, cells)
    hard = make_half_ball("hard", "Cu", 1.02 * RADIUS, -200.0, cells)
    simulation = Simulation([soft, hard], [], t_end=2e-6)
    rows = [simulation.start_row()]
    held = []
    while not simulation.finished:
        rows.append(simulation.advance())
        if simulation.t > 1.4e-6:
            held.append(soft.state[P, -4:-1, -4:-1].max() / GPA)
    assert max(held) < 0.2
    check_budget(rows)
