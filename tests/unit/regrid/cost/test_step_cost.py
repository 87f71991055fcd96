"""What cells cost: the term's slope and curvature, where it is silent, and the mushroom's roll."""

import numpy as np
import pytest

from regrid.barrier import line_cg
from regrid.barrier.tuning import Tuning
from regrid.barrier.workspace import Workspace

NI, NJ = 7, 9
FASTER = 3.5  # than R was made for: about half of all cells limit the step


def shaken_grid(amplitude=0.3, seed=3):
    nodes = np.array(np.mgrid[0 : NI + 1, 0 : NJ + 1], dtype=float)
    return 0.1 * (nodes + np.random.default_rng(seed).uniform(-amplitude, amplitude, nodes.shape))


def prepared(nodes, weight, sound):
    work = Workspace(NI, NJ, 1)
    work.sides[:] = nodes
    work.sound[:] = sound
    work.begin(True, 0.7, 0.3, Tuning(cost_weight=weight), cost=True)
    work.sound *= FASTER
    work.assemble(nodes)
    return work


def sound_speeds(seed=4):
    return np.random.default_rng(seed).uniform(1.0, 3.0, (NI, NJ))


def test_gradient_is_the_slope_of_the_cost():
    nodes, sound = shaken_grid(), sound_speeds()
    work, without = prepared(nodes, 1.0, sound), prepared(nodes, 0.0, sound)
    barrier = np.zeros((NI, NJ))  # leaves straight lines and the cost
    step, slopes = 1e-6, np.zeros_like(nodes)
    for place in np.ndindex(2, NI - 1, NJ - 1):
        place = (place[0], place[1] + 1, place[2] + 1)
        for sign in (1.0, -1.0):
            moved = nodes.copy()
            moved[place] += sign * step
            cost = work.compute_energy(moved, 0.0, barrier)[0]
            slopes[place] += sign * (cost - without.compute_energy(moved, 0.0, barrier)[0])
    inner = np.s_[:, 1:-1, 1:-1]
    expected = slopes[inner] / (2.0 * step)
    found = (work.gradient - without.gradient)[inner]
    assert np.abs(expected).max() > np.abs(without.gradient[inner]).max()
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def dense(work):
    size = 2 * (NI - 1) * (NJ - 1)
    matrix = np.zeros((size, size))
    zero, out = np.zeros((2, NI + 1, NJ + 1)), np.zeros((2, NI + 1, NJ + 1))
    for column in range(size):
        unit = np.zeros(size)
        unit[column] = 1.0
        direction = np.zeros_like(zero)
        direction[:, 1:-1, 1:-1] = unit.reshape(2, NI - 1, NJ - 1)
        line_cg.fill_product(
            (direction, zero, zero), -1.0, 1, NJ, work.H[0], out, work.totals, work.scratch[0]
        )
        matrix[:, column] = out[:, 1:-1, 1:-1].ravel()
    return matrix


@pytest.mark.parametrize("seed", [3, 8, 11])
def test_hessian_is_symmetric_and_positive_semidefinite(seed):
    nodes, sound = shaken_grid(seed=seed), sound_speeds()
    matrix = dense(prepared(nodes, 1e3, sound)) - dense(prepared(nodes, 0.0, sound))
    size = np.abs(matrix).max()
    assert np.abs(matrix - matrix.T).max() <= 1e-13 * size
    assert np.linalg.eigvalsh(matrix)[0] > -1e-12 * size
    assert np.linalg.eigvalsh(matrix)[-1] > 0.1 * size
