"""Blocks that stay sharp settle when their sides rest, and the matrix that sees to it."""

import numpy as np
import pytest

from regrid.barrier.regridder import BarrierRegridder
from regrid.barrier.side_laws import compute_stiffness
from regrid.barrier.tuning import DEFAULT
from regrid.barrier.workspace import Workspace
from regrid.domains.plane import make_domain
from regrid.measure.quality import measure_quality

CELLS, STIFFEST = (60, 40), DEFAULT.stiffness


def marched(name):
    domain, regridder = make_domain(name, *CELLS), BarrierRegridder()
    nodes, steps = domain.start, domain.suggested_steps
    for step in range(1, steps + 1):
        nodes = regridder.regrid(nodes, domain.boundary(step / steps)).nodes
    return nodes, np.ascontiguousarray(domain.boundary(1.0))


@pytest.mark.parametrize("name", ["single_finger", "slender_finger", "hooked_fingers", "jet"])
def test_a_sharp_block_settles(name):
    """50 calls with the same sides: at the end nothing moves, and no floor has to say so."""
    nodes, sides = marched(name)
    cell = np.ptp(nodes[0]) / 40.0
    settled, strict = BarrierRegridder(), BarrierRegridder(floor=1e-7)
    for _ in range(50):
        last, nodes = nodes, settled.regrid(nodes, sides).nodes
    assert np.abs(nodes - last).max() < 1e-6 * cell
    motions = []
    for _ in range(50):
        last, nodes = nodes, strict.regrid(nodes, sides).nodes
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


def test_it_is_in_the_matrix_of_sharp_cells_alone():
    """Same gradient; a stiffer matrix where corners are sharp, elsewhere the same to the bit."""
    sharp = np.array(np.mgrid[0:9, 0:7], dtype=float)
    sharp[0] += 5.0 * sharp[1] * (sharp[1] < 3.5) * (sharp[0] > 0.5)
    for nodes, differs in ((np.array(np.mgrid[0:9, 0:7], dtype=float), False), (sharp, True)):
        work = Workspace(8, 6, 1)
        work.sides[:] = work.old[:] = nodes
        work.begin(True, 1.0, 0.0)
        found, law = [], work.law
        for stiffness in (1.0, 2.0):
            work.law = type(law)(*(stiffness if v is law.stiffness else v for v in law))
            work.assemble(nodes)
            found.append((work.gradient.copy(), work.H.copy()))
        assert np.array_equal(found[0][0], found[1][0])
        assert np.array_equal(found[0][1], found[1][1]) is not differs
