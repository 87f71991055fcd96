"""Named moving domains: valid at the start, steps of the promised length, sides that fit."""

import numpy as np
import pytest

from regrid.domains import DOMAINS, make_domain, transpose_nodes
from regrid.measure.crossings import find_self_crossing
from regrid.measure.quality import find_bad_cells

NAMES = tuple(DOMAINS)


def closed_outline(sides):
    """The four sides as one line round the block, first node repeated only once."""
    return np.concatenate(
        [sides[:, :, 0], sides[:, -1, 1:], sides[:, -2::-1, -1], sides[:, 0, -2:0:-1]], axis=1
    )


@pytest.mark.parametrize("name", NAMES)
def test_start_is_valid_and_is_the_boundary_at_zero(name):
    domain = make_domain(name, 12, 10)
    assert len(find_bad_cells(domain.start)) == 0
    sides = domain.boundary(0.0)
    known = np.isfinite(sides)
    assert np.array_equal(sides[known], domain.start[known])
    assert known.sum() == 2 * 2 * (12 + 10)


@pytest.mark.parametrize("name", NAMES)
def test_no_boundary_node_moves_further_than_half_a_cell_a_step(name):
    domain = make_domain(name, 24, 20)
    steps = domain.suggested_steps
    sides = np.array([domain.boundary(k / steps) for k in range(steps + 1)])
    lengths = np.hypot(*np.diff(sides, axis=0).transpose(1, 0, 2, 3))
    assert np.nanmax(lengths) < 0.51 * domain.cell
    assert domain.steps_for(20.0) <= max(1, steps // 20)


@pytest.mark.parametrize("name", NAMES)
def test_outline_never_crosses_itself(name):
    domain = make_domain(name, 60, 40)
    for s in np.linspace(0.0, 1.0, 9):
        assert find_self_crossing(closed_outline(domain.boundary(s))) is None


def test_transposed_domain_is_mirrored_and_stays_positive():
    domain = make_domain("three_fingers", 12, 10)
    turned = domain.transposed()
    assert turned.start.shape == (2, 11, 13)
    assert turned.deforming_sides == ("j_min",)
    assert len(find_bad_cells(turned.start)) == 0
    assert np.array_equal(transpose_nodes(turned.boundary(0.3))[:, 0], domain.boundary(0.3)[:, 0])
