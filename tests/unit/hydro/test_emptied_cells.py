"""Cells that empty between fragments keep a remainder; nothing of the totals is lost."""

import numpy as np
import pytest

from builders import box, check_budget, free, make_body, march_whole, wall_off
from shockgrid.hydro.eos.base import REMAINING_DENSITY_PART, make_leaving_fraction
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation

COPPER = find_material("Cu")
LEAST = REMAINING_DENSITY_PART * COPPER.rho0


def make_parting_plate(parts, speed, cells=24):
    """A plate of copper whose halves fly apart, in one block or cut at its middle by a seam.

    They start at twice `speed` and at rest, so that the plate as a whole moves too.
    """
    edges = np.linspace(-1e-3, 1e-3, parts + 1)
    blocks = []
    for number in range(parts):
        nodes = box((edges[number], 0.0), (edges[number + 1], 2e-4), (2 * cells // parts, 2))
        middle = 0.5 * (nodes[0, 1:, 1:] + nodes[0, :-1, 1:])
        blocks.append(make_body(f"part-{number}", "Cu", nodes, speed * (1.0 + np.sign(middle))))
    free(blocks[0], "i_min")
    free(blocks[-1], "i_max")
    links = [join("seam", (blocks[0], "i_max"), (blocks[1], "i_min"))] if parts == 2 else []
    wall_off(blocks[0], "j_min", "j_max")
    if parts == 2:
        wall_off(blocks[1], "j_min", "j_max")
    return blocks, Simulation(blocks, links, t_end=2e-5)


@pytest.mark.parametrize("speed", [300.0, 1500.0])
@pytest.mark.parametrize("parts", [1, 2])
def test_a_plate_torn_apart_flies_on(parts, speed):
    """Its middle empties to a remainder, in no shorter steps, and all totals are kept."""
    blocks, simulation = make_parting_plate(parts, speed)
    rows = march_whole(simulation)
    rho = np.concatenate([block.state[0, 1:-1, 1:-1].ravel() for block in blocks])
    assert 0.1 * LEAST < rho.min() < 2.0 * LEAST
    assert rows[-1]["emptied_cells"] == np.count_nonzero(rho < 2.0 * LEAST)
    assert sum(row["retries"] for row in rows[1:]) == 0
    check_budget(rows)
    halves = [np.sign(block.state[1, 1:-1, 1:-1] - speed) for block in blocks]
    assert abs(sum(half.sum() for half in halves)) <= 2.0


def test_as_much_leaves_as_the_density_says():
    part = make_leaving_fraction(type(COPPER.eos))
    rho = LEAST * np.array([0.0, 0.5, 1.0, 1.25, 2.0, 3.0, 1e9])
    found = part(rho, COPPER.eos.parameters)
    assert found == pytest.approx([0.0, 0.0, 0.0, 0.25, 1.0, 1.0, 1.0], abs=1e-12)
    assert (found[-3:] == 1.0).all()
