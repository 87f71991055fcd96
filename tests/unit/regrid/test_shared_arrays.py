"""Regrids of a thread share their memory: whatever lay in it, a block has the same bits."""

import numpy as np

from regrid.barrier.regridder import BarrierRegridder
from regrid.domains import make_domain
from regrid.work_arrays import share_memory

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
