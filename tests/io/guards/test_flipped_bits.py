"""A bit turned over anywhere in a run is told, or makes no difference."""

from __future__ import annotations

import flips
import pytest


@pytest.fixture
def runs(shockgrid):
    flips.make_runs(shockgrid)


def test_thirty_bits(runs, capfd):
    plain = flips.look_at_whole(capfd)
    seen = [flips.judge(seed, capfd, plain)[0] for seed in range(30)]
    assert set(seen) == {"refused", "told, went on", "went on"}  # of deck, last dump, log, ...
