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
