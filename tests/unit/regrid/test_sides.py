"""Sides of a grid: their nodes by index, as a kernel finds them, are those of the views."""

from __future__ import annotations

import numpy as np
import pytest

from shockgrid.regrid.jit import kernel
from shockgrid.regrid.sides import SIDE_NAMES, find_node, get_side


@kernel
def read_line(field, side, deep, line):
    """Values of a field (ni+1, nj+1) along a side, or `deep` nodes inwards."""
    ni = field.shape[0] - 1
    nj = field.shape[1] - 1
    for k in range(line.size):
        i, j = find_node(side, k, deep, ni, nj)
        line[k] = field[i, j]


@pytest.mark.parametrize("name", SIDE_NAMES)
@pytest.mark.parametrize("deep", [0, 1, 2])
def test_nodes_of_a_side_are_those_of_its_view(name, deep):
    rng = np.random.default_rng(3)
    nodes = rng.random((2, 5, 7))
    inwards = nodes[:, deep : 5 - deep] if name[0] == "i" else nodes[:, :, deep : 7 - deep]
    expected = get_side(inwards, name)
    for field, values in zip(nodes, expected, strict=True):
        line = np.empty(values.size)
        read_line(field, SIDE_NAMES.index(name), deep, line)
        assert np.array_equal(line, values)
