"""Blocks whose Hessian is made by strips and whose arrays are lent: the bits of stored ones."""

import numpy as np
import pytest

from regrid.barrier import regridder as module
from regrid.barrier.large_workspace import LargeWorkspace
from regrid.domains.plane import make_domain


@pytest.mark.parametrize(("name", "cells_a_step"), [("three_fingers", 1), ("slender_finger", 12)])
def test_large_blocks_have_the_bits_of_small_ones(monkeypatch, name, cells_a_step):
    """Solves, halved motions and rescues, from the first step to the last report."""
    domain, found, made = make_domain(name, 50, 40), [], []

    def make(*arguments):
        made.append(arguments)
        return LargeWorkspace(*arguments)

    monkeypatch.setattr(module, "LargeWorkspace", make)
    count = domain.suggested_steps
    for large in (10**9, 0):
        monkeypatch.setattr(module, "LARGE", large)
        regridder, nodes, reports = module.BarrierRegridder(coarse_from=0.0), domain.start, []
        for step in range(1, 5):
            result = regridder.regrid(nodes, domain.boundary(step * cells_a_step / count))
            nodes = result.nodes.copy()
            reports.append(result.report)
        assert bool(made) == (large == 0)
        found.append((nodes, reports))
    (one, first), (other, second) = found
    assert np.array_equal(one, other) and first == second
    assert sum(report.iterations for report in first) > 0
