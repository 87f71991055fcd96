"""Smooth errors of a block of hexahedra on its coarse nodes (theory R14.11)."""

import numpy as np

from builders import tensor
from regrid.hexahedra.faces import compute_face_laws
from regrid.hexahedra.functional import MATRIX, fill_product
from regrid.hexahedra.regridder import BarrierRegridder3D, HexahedraMove

CELLS = (12, 10, 11)


def bent(cells=CELLS):
    """A box and the same bent, each cut evenly."""
    start = tensor(*(np.linspace(0.0, 1.0, n + 1) for n in cells))
    x, y, z = start
    return start, np.array([x + 0.2 * np.sin(2.0 * y + z), y + 0.15 * x**2, z + 0.1 * x * y])


def throw_smoothly(nodes, start, size):
    """The inner nodes moved by the lowest mode of the box."""
    x, y, z = start
    mode = np.sin(np.pi * x) * np.sin(np.pi * y) * np.sin(np.pi * z)
    return nodes + size * mode * np.array([1.0, -0.7, 0.4])[:, None, None, None]


def test_a_smooth_error_is_mostly_taken_away_at_once():
    start, end = bent((24, 20, 22))
    settled = start
    for _ in range(6):
        settled = BarrierRegridder3D(floor=1e-8, family=(1, 1, 1)).regrid(settled, end).nodes
    thrown = throw_smoothly(settled, start, 0.02)
    move = HexahedraMove(BarrierRegridder3D().options, thrown, end, np.full(3, 1.0 / 3.0))
    move.laws = compute_face_laws(end, move.weights, True)
    move.strengthen(thrown)
    move.assemble_at(thrown, MATRIX)
    inner = np.s_[:, 1:-1, 1:-1, 1:-1]
    residual, change = -move.gradient, np.zeros_like(thrown)
    gain = move.coarse.find(thrown, move.functional(0.0), residual, move.scratch)
    move.coarse.add(change)
    product = np.zeros_like(thrown)
    fill_product(thrown, change, move.functional(0.0), product, move.scratch)
    # J falls by gain less half of this; a step that is too long by two would not lower it
    assert 0.5 * gain < (change * product).sum() < 1.2 * gain
    error = settled - thrown
    lines = move.precondition(residual)
    left, left_by_lines = (((way - error)[inner] ** 2).sum() for way in (change, lines))
    assert left < 0.36 * (error**2).sum() < 0.5 * left_by_lines
