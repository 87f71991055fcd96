"""Marches: what they keep, how steps are chosen, how they end, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from regrid.barrier.regridder import BarrierRegridder
from regrid.domains import make_domain
from regrid.errors import BadInput
from regrid.marching import march, march_domain
from regrid.measure.quality import measure_first_line_gap, measure_quality


@pytest.fixture(scope="module")
def valley():
    return make_domain("valley", 16, 12)


def test_a_march_is_the_loop_that_one_would_write(valley):
    nodes, regridder, gap, sine = valley.start, BarrierRegridder(), 0.0, 1.0
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


@pytest.mark.parametrize("turn", ["i reversed", "exchanged"])
def test_clockwise_grids_march_as_well(valley, turn):
    def carry(nodes):
        return np.ascontiguousarray(
            nodes[:, ::-1] if turn == "i reversed" else nodes.transpose(0, 2, 1)
        )

    upright = march_domain(BarrierRegridder(), valley, 8)
    times = [step / 8 for step in range(1, 9)]
    turned = march(
        BarrierRegridder(), carry(valley.start), lambda t: carry(valley.boundary(t)), times
    )
    assert turned.failure is None
    assert np.abs(turned.nodes - carry(upright.nodes)).max() < 1e-9
    assert turned.sine == pytest.approx(upright.sine, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"cells": 0.0}, "cells = 0.0; it must be positive"),
        ({"span": (1.0, 0.0)}, "must begin before it ends"),
        ({"gap_sides": ["bottom"]}, "no side is called 'bottom'; sides are i_min"),
        ({"keep_every": -1}, "keep_every = -1"),
        ({"times": [0.1, np.nan]}, "times must be finite"),
        ({"start": np.zeros((3, 4, 4))}, r"start has shape \(3, 4, 4\)"),
        ({"start": np.full((2, 4, 4), np.nan)}, "start has nodes that are not finite"),
        ({"boundary_at": lambda t: np.zeros((2, 3, 3))}, r"has shape \(2, 3, 3\), start"),
        ({"boundary_at": lambda t: np.full((2, 17, 13), np.inf)}, "that are not finite"),
    ],
)
def test_what_does_not_fit_is_refused(valley, options, words):
    usual = {"start": valley.start, "boundary_at": valley.boundary}
    with pytest.raises(BadInput, match=words):
        march(BarrierRegridder(), **(usual | options))
