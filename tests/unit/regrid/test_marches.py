"""Domains, marches in the library, repair of given grids, the roll of the mushroom."""

from __future__ import annotations

import numpy as np
import pytest

from builders import unit_steps
from regrid_suite import measures
from regrid_suite.catalogue import ROLLS, load_march
from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.repair import repair_grid
from shockgrid.regrid.domains import DOMAINS, make_domain, transpose_nodes
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.marching import march_domain
from shockgrid.regrid.measure.crossings import find_self_crossing
from shockgrid.regrid.measure.quality import find_bad_cells, measure_first_line_gap, measure_quality
from shockgrid.regrid.sides import SIDES

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


@pytest.fixture(scope="module")
def valley():
    return make_domain("valley", 16, 12)


def test_a_march_is_the_loop_that_one_would_write(valley):
    nodes = valley.start
    regridder = BarrierRegridder()
    gap = 0.0
    sine = 1.0
    for step in range(1, 11):
        nodes = regridder.regrid(nodes, valley.boundary(step / 10)).nodes
        gap = max(gap, measure_first_line_gap(nodes, "i_min"))
        sine = min(sine, measure_quality(nodes).least_scaled_jacobian)
    found = march_domain(BarrierRegridder(), valley, 10, keep_every=5)
    assert np.array_equal(found.nodes, nodes)
    assert (found.gap, found.sine, found.failure) == (gap, sine, None)
    assert found.done == found.steps == len(found.reports) == len(found.seconds) == 10
    assert found.kept_times == [0.0, 0.5, 1.0] and np.array_equal(found.kept[0], valley.start)
    assert found.kept[-1] is found.nodes and found.cost > 0.0
    assert found.iterations == sum(report.iterations for report in found.reports)


COST_WEIGHT = 0.2


def march_both(cost_weight, joint):
    """Largest rate of both blocks at every step, each block's worst first line gap, sub-moves."""
    marches = [load_march(name) for name in ROLLS]
    regridders = [BarrierRegridder(family="i", cost_weight=cost_weight) for _ in marches]
    grids = [march.start for march in marches]
    gaps = [0.0, 0.0]
    top = []
    moves = 0
    for step in range(1, marches[0].steps + 1):
        pairs = list(zip(regridders, marches, strict=True))
        asked = [r.compute_limiting_rate(m.boundary(step), m.sound[step]) for r, m in pairs]
        rates = []
        for k, (regridder, motion) in enumerate(pairs):
            sound = motion.sound[step]
            least = max(asked) if joint else 0.0
            result = regridder.regrid(grids[k], motion.boundary(step), sound, least)
            grids[k] = result.nodes
            moves += result.report.sub_moves + result.report.rescues
            rates.append(measures.compute_rates(grids[k], sound).max())
            gaps[k] = max(gaps[k], measures.measure_gap(grids[k], motion.deforming))
        top.append(max(rates))
    assert not any(measures.count_bad_cells(nodes) for nodes in grids)
    return np.array(top), gaps, moves


def test_the_largest_rate_falls_by_four_while_first_lines_stay():
    plain, _, _ = march_both(0.0, joint=False)
    aware, gaps, moves = march_both(COST_WEIGHT, joint=True)
    assert aware.max() < plain.max() / 4.0
    assert aware.mean() < plain.mean() / 2.5  # steps of a flow are in proportion to the mean
    assert max(gaps) <= 1.7
    assert moves == 0


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
