"""Quality of hexahedra against cells that can be worked out by hand."""

import numpy as np

from builders import tensor
from regrid.measure.hexahedra import (
    compute_hexahedron_aspects,
    compute_hexahedron_sines,
    compute_least_corner_volumes,
    compute_volumes,
)


def boxes(*steps):
    lines = [np.concatenate([[0.0], np.cumsum(step)]) for step in steps]
    return tensor(*lines)


def test_boxes():
    nodes = boxes([1.0, 2.0], [0.5, 1.0, 4.0], [3.0])
    assert np.allclose(compute_hexahedron_sines(nodes), 1.0)
    volumes = compute_volumes(nodes)
    assert np.allclose(volumes[:, :, 0], 3.0 * np.outer([1.0, 2.0], [0.5, 1.0, 4.0]))
    assert np.allclose(compute_hexahedron_aspects(nodes)[0, :, 0], [6.0, 3.0, 4.0])


def test_sheared_cell_and_turned_one():
    nodes = boxes([1.0], [1.0], [1.0])
    nodes[0] += 3.0 * nodes[2]  # the third edge is (3, 0, 1)
    assert np.allclose(compute_hexahedron_sines(nodes), 1.0 / np.sqrt(10.0))
    assert np.allclose(compute_volumes(nodes), 1.0)
    assert np.allclose(compute_hexahedron_sines(nodes[::-1]), -1.0 / np.sqrt(10.0))


def test_least_sine_has_the_sign_of_the_least_corner_volume():
    nodes = boxes(np.ones(4), np.ones(3), np.ones(5))
    nodes += 0.35 * np.random.default_rng(3).normal(size=nodes.shape)
    least = compute_least_corner_volumes(nodes)
    assert 0 < (least < 0.0).sum() < least.size
    assert np.array_equal(np.sign(compute_hexahedron_sines(nodes)), np.sign(least))
