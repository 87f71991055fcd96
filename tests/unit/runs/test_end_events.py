"""What happened where a run ended: how small the cell is, beside which sides."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from shockgrid.regrid.errors import Place
from shockgrid.runs.early_end.place import describe_event


@pytest.mark.parametrize(
    ("place", "cell", "beside"),
    [
        (None, "i=3, j=7", ", beside j_max"),  # the smallest
        (Place("gas"), "i=3, j=7", ", beside j_max"),
        (Place("gas", (4, 4)), "i=4, j=4", ""),
        (Place("gas", side="i_max", nodes=(5, 2)), "i=9, j=5", ", beside i_max"),
        (Place("gas", side="j_min", nodes=(99,)), "i=9, j=0", ", beside i_max and j_min"),
    ],
)
def test_a_cell_is_told_by_its_area_and_the_sides_beside_it(place, cell, beside):
    nodes = np.array(np.meshgrid(np.arange(11.0), np.arange(9.0), indexing="ij"))
    nodes[1, 3:5, -1] -= 0.75
    told = describe_event([SimpleNamespace(name="gas", nodes=nodes)], place)
    assert told.startswith(f"cell {cell} of block 'gas' at (") and f"){beside} has " in told
    share = "0.25" if cell == "i=3, j=7" else "1"
    assert told.endswith(f"has {share} of the usual area of the block's cells")
