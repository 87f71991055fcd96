"""Named moving domains: valid at the start, steps of the promised length, sides that fit."""

import numpy as np
import pytest

from builders import box, unit_steps
from regrid.domains.in_space import BLOCKS, find_block
from regrid.domains.moving import transpose_nodes
from regrid.domains.plane import DOMAINS, make_domain
from regrid.errors import BadInput
from regrid.measure.crossings import find_self_crossing
from regrid.measure.hexahedra import compute_least_corner_volumes
from regrid.measure.quality import compute_best_sines, find_bad_cells, find_best_sine

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


def test_strip_is_square_at_the_interface_and_hundred_to_one():
    start = make_domain("strip", 60, 20).start
    assert np.isclose(start[1, 1, 0] - start[1, 0, 0], 1.0 / 20)
    assert np.isclose(start[1].max() / start[0].max(), 100.0)


def test_unknown_domain_names_the_known_ones():
    with pytest.raises(BadInput, match="did you mean 'curled_fingers'"):
        make_domain("four-fingers", 8, 8)
    with pytest.raises(BadInput, match=r"known are: .*chicane"):
        make_domain("xyz", 8, 8)


def test_best_sines_are_those_of_the_boundary_angles():
    square = unit_steps(5, 2)
    sines, places = compute_best_sines(square)
    assert np.allclose(sines, 1.0)
    assert places[0] == ("i_min", 0)
    notched = square.copy()
    notched[1, 2, 0] = 0.5  # a node of j_min pushed in: its angle is 360 degrees less 2 atan 2
    assert find_best_sine(notched[:, ::-1]) == (pytest.approx(np.sin(np.arctan(2.0))), "j_min", 3)
    folded = square.copy()
    folded[:, 0, 0] = 1.5, 0.8  # the block's corner turned over
    assert find_best_sine(folded)[0] < 0.0


def test_named_blocks_fill_their_shape():
    p = box((0.0,) * 3, (1.0,) * 3, (8,) * 3)
    for name in BLOCKS:
        assert (compute_least_corner_volumes(find_block(name)(p)) > 0.0).all()
    assert np.ptp(find_block("ks-block-1")(p)[2]) == 1.0
    with pytest.raises(BadInput, match="did you mean 'ks_block_1'"):
        find_block("ks_blok_1")
