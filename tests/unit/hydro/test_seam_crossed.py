"""A border between blocks of one material that is crossed is no interface that curls back."""

import numpy as np
import pytest

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.motion.grid_motion import crosses_seam


def make_block(name, first, last):
    grid = np.meshgrid(np.linspace(first, last, 5), np.linspace(0.0, 1.0, 5), indexing="ij")
    return Block(name, IdealGas(1.4), np.array(grid), 1.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("kind", ["seam", "interface"])
def test_which_line_is_crossed(kind):
    one = make_block("one", 0.0, 1.0)
    other = make_block("other", 1.0, 2.0)
    join(kind, (one, "i_max"), (other, "i_min"))
    put(one, "j_max", "wall")
    one.nodes_new[...] = one.nodes
    assert not crosses_seam(one)
    one.nodes_new[:, 2, 4] = 1.2, 0.5  # of the upper side, beyond the border
    assert crosses_seam(one) == (kind == "seam")
