"""What the roll of the mushroom costs a flow, without a flow: both gases share the step."""

import numpy as np

from benchmarks.regrid_suite import measures
from benchmarks.regrid_suite.catalogue import ROLLS, load_march
from regrid.barrier.regridder import BarrierRegridder

COST_WEIGHT = 0.2


def march_both(cost_weight, joint):
    """Largest rate of both blocks at every step, each block's worst first line gap, sub-moves."""
    marches = [load_march(name) for name in ROLLS]
    regridders = [BarrierRegridder(family="i", cost_weight=cost_weight) for _ in marches]
    grids, gaps, top, moves = [march.start for march in marches], [0.0, 0.0], [], 0
    for step in range(1, marches[0].steps + 1):
        pairs = list(zip(regridders, marches, strict=True))
        asked = [r.compute_dear_rate(m.boundary(step), m.sound[step]) for r, m in pairs]
        rates = []
        for k, (regridder, march) in enumerate(pairs):
            sound, least = march.sound[step], max(asked) if joint else 0.0
            result = regridder.regrid(grids[k], march.boundary(step), sound, least)
            grids[k] = result.nodes
            moves += result.report.sub_moves + result.report.rescues
            rates.append(measures.compute_rates(grids[k], sound).max())
            gaps[k] = max(gaps[k], measures.measure_gap(grids[k], march.deforming))
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


def test_a_block_that_does_not_set_the_step_is_left_alone():
    """With R of the dearest block the other one has the grid of no cost at all, to the bit."""
    march = load_march("mushroom-roll-heavy")
    regridder, plain = BarrierRegridder(family="i"), BarrierRegridder(family="i", cost_weight=0.0)
    step = march.steps // 8
    boundary, sound = march.boundary(step), march.sound[step]
    nodes = march.start
    for k in range(1, step):
        nodes = plain.regrid(nodes, march.boundary(k)).nodes
    wanted = plain.regrid(nodes, boundary).nodes
    least = 10.0 * regridder.compute_dear_rate(boundary, sound)
    assert np.array_equal(regridder.regrid(nodes, boundary, sound, least).nodes, wanted)
    assert np.array_equal(
        regridder.regrid(nodes, boundary, sound).nodes,
        regridder.regrid(nodes, boundary, sound, 0.0).nodes,
    )


def test_what_the_sides_ask_for_does_not_depend_on_how_the_block_is_given():
    march = load_march("mushroom-roll")
    boundary, sound = march.boundary(30), march.sound[30]
    regridder = BarrierRegridder()
    asked = regridder.compute_dear_rate(boundary, sound)
    turned = np.ascontiguousarray(boundary[::-1].transpose(0, 2, 1))
    mirrored = np.ascontiguousarray(boundary[::-1])
    for other, cells in ((turned, sound.T), (mirrored, sound)):
        assert abs(regridder.compute_dear_rate(other, cells) / asked - 1.0) < 1e-12
    assert abs(regridder.compute_dear_rate(2.0 * boundary, sound) * 2.0 / asked - 1.0) < 1e-12
    assert abs(regridder.compute_dear_rate(boundary, 3.0 * sound) / 3.0 / asked - 1.0) < 1e-12
