"""Given grids made valid: what is found, left out, projected, untangled, or named."""

import numpy as np
import pytest

from builders import unit_steps
from regrid.algebraic import transfinite_grid
from regrid.barrier.repair import repair_grid
from regrid.domains import make_domain
from regrid.errors import BadInput, RegridFailure
from regrid.measure.quality import find_bad_cells, measure_quality
from regrid.sides import SIDES


def check(nodes, repaired):
    assert len(find_bad_cells(repaired.nodes)) == 0
    for side in SIDES:
        assert np.array_equal(repaired.nodes[side], nodes[side])


@pytest.mark.parametrize("step", [0.6, -0.55, 1.3])
def test_a_node_gone_astray_is_projected_and_the_rest_stays(step):
    nodes = unit_steps(20, 14)
    nodes[:, 7, 5] += step
    repaired = repair_grid(nodes)
    check(nodes, repaired)
    assert repaired.report.bad_cells > 0 and not repaired.report.untangled
    assert 1 <= repaired.report.projected_nodes <= 4
    moved = (repaired.nodes != nodes).any(axis=0)
    assert moved.sum() == repaired.report.projected_nodes


@pytest.mark.parametrize("noise", [0.3, 0.5, 3.0])
def test_noise_is_untangled(noise):
    nodes = unit_steps(60, 40)
    inner = nodes[:, 1:-1, 1:-1]
    inner += noise * np.random.default_rng(3).normal(size=inner.shape)
    repaired = repair_grid(nodes)
    check(nodes, repaired)
    assert repaired.report.bad_cells > 200 and repaired.report.untangled
    assert measure_quality(repaired.nodes).least_scaled_jacobian > 0.9


@pytest.mark.parametrize("name", ["swan", "five_fingers", "curled_fingers"])
@pytest.mark.parametrize("turned", [False, True])
def test_folded_transfinite_grids_are_untangled(name, turned):
    moving = make_domain(name, 60, 40)
    moving = moving.transposed() if turned else moving
    nodes = transfinite_grid(moving.boundary(1.0))
    assert len(find_bad_cells(nodes)) > 50
    repaired = repair_grid(nodes)
    check(nodes, repaired)
    assert repaired.report.untangled
    assert measure_quality(repaired.nodes).least_scaled_jacobian > 0.03


def test_what_cannot_be_repaired_names_sides_and_cells():
    nodes = transfinite_grid(make_domain("dome", 16, 12).boundary(0.0))
    nodes[1, 0, 6] = 1.5
    with pytest.raises(RegridFailure, match=r"i_min.*cells \(0, 5\), \(0, 6\)"):
        repair_grid(nodes)
    nodes[1, 0, 6] = np.nan
    with pytest.raises(BadInput, match=r"node \(0, 6\)"):
        repair_grid(nodes)
    with pytest.raises(BadInput, match="shape"):
        repair_grid(np.zeros((3, 4, 4)))
