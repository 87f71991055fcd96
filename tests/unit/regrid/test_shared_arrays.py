"""Regrids of a thread share their memory: whatever lay in it, a block has the same bits."""

import numpy as np

from regrid.barrier.regridder import BarrierRegridder
from regrid.domains.plane import make_domain
from regrid.work_arrays import NUMBERS, Carver, count_numbers, share_memory

DOMAINS = (("three_fingers", 20, 26, 1), ("slender_finger", 50, 40, 12), ("chicane", 30, 6, 1))


def march(domains, between):
    """Grids and reports of four steps of each, block after block as a flow does it."""
    regridders = [BarrierRegridder(coarse_from=0.0) for _ in domains]
    grids, found = [domain.start for domain, _ in domains], []
    for step in range(1, 5):
        for n, (domain, cells) in enumerate(domains):
            between()
            boundary = domain.boundary(step * cells / domain.suggested_steps)
            result = regridders[n].regrid(grids[n], boundary)
            grids[n] = result.nodes
            found.append(result)
    return found


def test_blocks_side_by_side_have_the_bits_of_blocks_alone():
    """Solves, corrections on coarse nodes, halved motions and rescues; rubbish in between."""

    def spoil():
        share_memory(1)[:] = np.nan

    domains = [(make_domain(name, ni, nj), cells) for name, ni, nj, cells in DOMAINS]
    together = march(domains, spoil)
    for n, one in enumerate(domains):
        alone = march([one], lambda: None)
        for result, expected in zip(together[n :: len(domains)], alone, strict=True):
            assert np.array_equal(result.nodes, expected.nodes)
            assert result.report == expected.report
    assert sum(result.report.iterations for result in together) > 0
    assert any(result.report.rescues + result.report.sub_moves for result in together)


def test_arrays_are_cut_one_after_another_and_aligned():
    shapes, whole = ((2, 3, 8), (5,), (4, 16)), np.zeros(500)
    carver = Carver(whole)
    arrays = [carver.cut(*shape, column=k) for k, shape in enumerate(shapes)]
    for k, array in enumerate(arrays):
        assert (array.ctypes.data // 8 + k) % NUMBERS == 0
        array[:] = k + 1.0
    assert all((array == k + 1.0).all() for k, array in enumerate(arrays))
    assert carver.at - carver.first <= sum(count_numbers(*shape) for shape in shapes)
