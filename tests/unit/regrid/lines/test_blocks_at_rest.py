"""Blocks that stay sharp settle when their sides rest, and the matrix that sees to it."""

import numpy as np
import pytest

from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.side_inputs import compute_stiffness
from shockgrid.regrid.barrier.tuning import DEFAULT
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.measure.quality import measure_quality

CELLS = (60, 40)
STIFFEST = DEFAULT.stiffness


def marched(name):
    domain = make_domain(name, *CELLS)
    regridder = BarrierRegridder()
    nodes = domain.start
    steps = domain.suggested_steps
    for step in range(1, steps + 1):
        nodes = regridder.regrid(nodes, domain.boundary(step / steps)).nodes
    return nodes, np.ascontiguousarray(domain.boundary(1.0))


@pytest.mark.parametrize("name", ["single_finger", "slender_finger", "hooked_fingers", "jet"])
def test_a_sharp_block_settles(name):
    nodes, sides = marched(name)
    cell = np.ptp(nodes[0]) / 40.0
    settled = BarrierRegridder()
    strict = BarrierRegridder(floor=1e-7)
    for _ in range(50):
        last = nodes
        nodes = settled.regrid(nodes, sides).nodes
    assert np.abs(nodes - last).max() < 1e-6 * cell
    motions = []
    for _ in range(50):
        last = nodes
        nodes = strict.regrid(nodes, sides).nodes
        motions.append(np.abs(nodes - last).max() / cell)
    assert motions[-1] < 1e-4 and motions[-1] <= 0.01 * max(motions)
    assert name == "jet" or measure_quality(nodes).least_scaled_jacobian < 0.06


def test_stiffness_of_motions():
    nodes = np.array(np.mgrid[0:9, 0:7], dtype=float)

    def stiffness(change):
        return compute_stiffness(
            nodes, nodes + change, STIFFEST, 0.3 * DEFAULT.fast_sides, DEFAULT.fast_sides
        )

    bulge = np.zeros_like(nodes)
    bulge[0, 0, 3] = 1.0
    assert stiffness(0.0) == STIFFEST
    assert stiffness(7.3) == STIFFEST  # carried along bodily
    assert stiffness(0.002 * bulge) == STIFFEST
    assert stiffness(0.02 * bulge) == 1.0
    assert 1.0 < stiffness(0.005 * bulge) < STIFFEST
