"""Marches: what they keep, how steps are chosen, how they end, what is refused."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from regrid.algebraic import TransfiniteRegridder
from regrid.barrier.regridder import BarrierRegridder
from regrid.domains.plane import make_domain
from regrid.errors import BadInput, RegridFailure
from regrid.marching import choose_times, march, march_domain
from regrid.measure.quality import find_bad_cells, measure_first_line_gap, measure_quality
from regrid.sides import get_sides


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


def test_steps_are_as_long_as_allowed_however_uneven_the_motion(valley):
    def boundary_at(t):
        return valley.boundary((t / 3.0) ** 4)

    times = choose_times(valley.start, boundary_at, 0.5, (0.0, 3.0))
    assert times[-1] == 3.0 and (np.diff(times) > 0.0).all()
    sides = [np.concatenate(get_sides(boundary_at(t)), axis=1) for t in (0.0, *times)]
    ways = np.array([np.hypot(*(b - a)).max() for a, b in itertools.pairwise(sides)])
    allowed = 0.5 * valley.cell
    assert ways.max() <= 1.01 * allowed  # ways are taken as even between samples
    assert len(times) <= 1.05 * ways.sum() / allowed + 1
    found = march(BarrierRegridder(), valley.start, boundary_at, cells=0.5, span=(0.0, 3.0))
    assert found.failure is None and found.times == list(times)


def test_a_boundary_at_rest_is_one_step(valley):
    assert list(choose_times(valley.start, lambda t: valley.start)) == [1.0]


def test_a_march_without_a_grid_says_so_and_keeps_the_last():
    domain = make_domain("three_fingers", 16, 12)
    found = march_domain(TransfiniteRegridder(), domain, 20)
    assert 0 < found.done < 20 and len(found.reports) == found.done
    assert isinstance(found.error, RegridFailure) and str(found.error) == found.failure
    assert len(find_bad_cells(found.nodes)) == 0 < len(find_bad_cells(found.folded))


def test_a_grid_with_bad_cells_ends_a_march(valley):
    class Careless:
        def regrid(self, previous, boundary):
            result = BarrierRegridder().regrid(previous, boundary)
            result.nodes[:, 3, 3] = result.nodes[:, 5, 5]
            return result

    found = march_domain(Careless(), valley, 10)
    assert found.done == 0 and found.error is None
    assert found.failure.startswith("3 cells are not convex: ")
    assert len(find_bad_cells(found.folded)) == 3
    assert np.array_equal(found.nodes, valley.start)


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


def test_noise_may_come_from_a_generator(valley):
    def make_boundary():
        random = np.random.default_rng(3)

        def boundary_at(t):
            boundary = valley.boundary(t)
            boundary[1, 0, 1:-1] += 0.01 * valley.cell * random.normal(size=boundary.shape[2] - 2)
            return boundary

        return boundary_at

    times = np.linspace(0.1, 0.5, 5)
    grids = [
        march(BarrierRegridder(), valley.start, make_boundary(), times).nodes for _ in range(2)
    ]
    assert np.array_equal(*grids)


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
