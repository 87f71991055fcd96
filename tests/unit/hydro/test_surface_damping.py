"""Waves of two faces on surfaces of bodies that have met others: what decays, and what stays."""

import numpy as np
import pytest

from builders import box, check_budget, free, make_body
from shockgrid.hydro import rim as on
from shockgrid.hydro.motion.smoothing import SURFACE_DAMPING, fill_surface_damping
from shockgrid.hydro.simulation import Simulation

NODES = 17
BEND = 0.35
MOST_RATE = 1e3
SIDES = "i_min", "i_max", "j_min", "j_max"
CELL = 1e-4


def damp(line, strain, held=()):
    """Damping (2, n) of a line (2, n) that is stretched along x at a rate `strain` [1/s]."""
    away = line[:, 2:0:-1], line[:, -2:-4:-1]
    images = 2.0 * line[:, :1] - away[0], 2.0 * line[:, -1:] - away[1]
    extended = np.concatenate([images[0], line, images[1]], axis=1)
    rim = np.zeros((on.ROWS, line.shape[1] - 1))
    rim[on.U_STAR] = strain * 0.5 * (line[0, 1:] + line[0, :-1])
    held_nodes = np.zeros(line.shape[1], dtype=bool)
    held_nodes[list(held)] = True
    out = np.empty_like(line)
    fill_surface_damping(extended, rim, 0, held_nodes, SURFACE_DAMPING, BEND, MOST_RATE, out)
    return out


def make_wave(height):
    x = np.linspace(0.0, 1.0, NODES)
    return np.array([x, height * (-1.0) ** np.arange(NODES)])


def test_waves_of_two_faces_decay():
    """Where the surface is deformed: at every node with two more on either side."""
    line = make_wave(1e-3)
    velocity = damp(line, 1.0)
    assert (velocity[1, 2:-2] * line[1, 2:-2] < 0.0).all()
    assert (velocity[:, [0, 1, -2, -1]] == 0.0).all()
    assert (damp(line, 0.0) == 0.0).all()


@pytest.mark.parametrize("held", [(0, 1, 2), (7, 8, 9)])
def test_nodes_on_another_surface_stay(held):
    """And those beside them: the surface may have a kink where it comes to lie on the other."""
    velocity = damp(make_wave(1e-3), 1.0, held)
    beside = [node for node in (held[0] - 1, *held, held[-1] + 1) if node >= 0]
    assert (velocity[:, beside] == 0.0).all()
    others = [node for node in range(2, NODES - 2) if node not in beside]
    assert (velocity[1, others] != 0.0).all()


def test_straight_lines_and_arcs_stay():
    part = np.linspace(0.0, 1.0, NODES)
    assert np.abs(damp(np.array([part, 0.3 * part]), 1.0)).max() < 1e-14
    arc = np.array([np.sin(part), np.cos(part)])
    wave = np.abs(damp(make_wave(0.1 / NODES), 1.0)).max()
    assert np.abs(damp(arc, 1.0)).max() < 1e-3 * wave


@pytest.mark.parametrize("gap", [0.0, 5.0 * CELL])
def test_a_front_that_has_met_nothing_keeps_its_waves(gap):
    """A plate that is drawn out, its upper side a zigzag, on another plate or away from it."""
    strain = 2e5
    nodes = box((-1e-3, 0.0), (1e-3, 8.0 * CELL), (20, 8))
    nodes[1] += 0.05 * CELL * (-1.0) ** np.arange(21)[:, None] * np.linspace(0.0, 1.0, 9)
    x = 0.5 * (nodes[0, 1:, 1:] + nodes[0, :-1, 1:])
    y = 0.5 * (nodes[1, 1:, 1:] + nodes[1, 1:, :-1])
    upper = make_body("upper", "Al1100", nodes, strain * x, -strain * y, material="metal")
    lower_nodes = box((-5e-4, -4.0 * CELL - gap), (5e-4, -gap), (10, 4))
    lower = make_body("lower", "Al1100", lower_nodes, material="metal")
    free(upper, *SIDES)
    free(lower, *SIDES)
    simulation = Simulation([upper, lower], [], t_end=0.4e-6)
    rows = [simulation.start_row()]
    while not simulation.finished:
        rows.append(simulation.advance())
    front = upper.nodes[1, 4:-4, -1]
    waves = np.abs(np.diff(front, 4)) / 16.0 / (0.05 * CELL)
    assert waves.max() < 0.5 if gap == 0.0 else waves.min() > 0.6
    check_budget(rows, names=("momentum_y", "energy"))
