"""Domains of Riemann problems, decks of grid marches, contacts of plates on wedges."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from builders import march
from oracles.random_pairs import make_random_pair
from shockgrid.problems.blocks import Blocks, BlocksDeck
from shockgrid.problems.grid_march import GridMarch, GridMarchDeck
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.plate_on_wedge.problem import PlateOnWedge, PlateOnWedgeDeck
from shockgrid.problems.riemann import (
    AHEAD_OF_WAVES_PART,
    MOST_GROWTH,
    PLATEAU_CELL_PART,
    Riemann,
    RiemannDeck,
    SideState,
    grade,
)
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.registry import REGRIDDERS
from shockgrid.regrid.spacings import REFINED_STEP_RATIO, meeting_laws


def make(left, right, **options) -> Riemann:
    return Riemann(RiemannDeck(left=left, right=right, **options))


@pytest.mark.parametrize("seed", range(12))
def test_every_plateau_has_its_cells_and_every_wave_its_place(seed):
    problem = make(*make_random_pair(seed), cells=200)
    exact = problem.exact
    domain = problem.domain
    assert sum(domain.lengths) <= 1.0 + 1e-12 and domain.lengths[0] > 0.0
    sides = zip(
        (-1, 1), (exact.left_wave, exact.right_wave), domain.lengths, domain.ends, domain.growths,
        strict=True,
    )  # fmt: skip
    for sign, wave, length, end, growth in sides:
        for part in (0.0, 0.3, 1.0):  # the end keeps ahead of the wave at all times
            t = part * domain.t_end
            assert sign * (sign * length + (end - wave.head) * t) > 0.0
        last = length + sign * (end - exact.u) * domain.t_end
        zone = sign * (wave.head - exact.u) * domain.t_end
        assert zone == pytest.approx((1.0 - AHEAD_OF_WAVES_PART) * last)
        edges = last * grade(100, growth)
        inside = np.count_nonzero(edges[1:] <= sign * (wave.tail - exact.u) * domain.t_end)
        assert inside >= 100 * PLATEAU_CELL_PART - 1 or growth == MOST_GROWTH
        if wave.kind == "shock":
            assert end == pytest.approx(exact.u) and growth == 1.0


def test_a_captured_contact_has_all_waves_on_its_grid():
    left, right = SideState(rho=1.0, u=30.0, p=1.0), SideState(rho=1.0, u=30.0, p=0.1)
    for mesh, speed in (("fixed", 0.0), ("follow", None)):
        problem = make(left, right, contact="captured", mesh=mesh)
        speed = problem.exact.u if speed is None else speed
        t = problem.t_end
        low, high = (sign * x for sign, x in zip((-1, 1), problem.domain.lengths, strict=True))
        assert low < min(0.0, (problem.exact.left_wave.head - speed) * t)
        assert high > max(0.0, (problem.exact.right_wave.head - speed) * t)
        assert high - low == pytest.approx(1.0)


def test_gases_that_part_are_refused_by_name():
    limit = 2.0 * 2.0 * np.sqrt(1.4 * 0.4) / 0.4

    def part(speed):
        return make(
            SideState(rho=1.0, u=-0.5 * speed, p=0.4), SideState(rho=1.0, u=0.5 * speed, p=0.4)
        )

    with pytest.raises(BadInput, match=rf"part and leave a vacuum .* less than {limit:.6g} m/s"):
        part(1.01 * limit)
    assert part(0.99 * limit).exact.p > 0.0


WEIGHTED = ("brackbill-saltzman", "equidistribution", "node-speed")


def make_march(**regrid):
    table = {"domain": "dome", "ni": 12, "nj": 10, "regrid": regrid}
    return GridMarch(msgspec.convert(table, GridMarchDeck))


def make_flow(**regrid):
    table = {"cells": 8, "lengths": (1.0, 1.0), "modes": [{"ka0": 0.3}], "regrid": regrid}
    table["passage_refinement"] = 1.0  # as with a weight
    return InterfaceInstability(msgspec.convert(table, InterfaceDeck))


@pytest.mark.parametrize("make", [make_march, make_flow])
@pytest.mark.parametrize("name", sorted(REGRIDDERS))
def test_each_family_runs_by_its_name(name, make):
    evolution = make(name=name).build()
    row = march(evolution, 6)[-1]
    assert row["t"] > 0.0 and row["regrid_least_corner_ratio"] > 0.0
    for block in evolution.blocks:
        assert len(find_bad_cells(block.nodes)) == 0


@pytest.mark.parametrize("boundary", ["given", "equidistributed"])
@pytest.mark.parametrize("name", WEIGHTED)
def test_weights_of_position_and_of_the_flow(name, boundary):
    options = {"boundary": boundary}
    grids = make_march(name=name, weight="1 + 5*y", options=options).build()
    flow = make_flow(
        name=name, weight="sides*(1 + 3*|grad(p)|/max + 0.2*tanh(x))", options=options
    ).build()
    for evolution in (grids, flow):
        plain = (make_march if evolution is grids else make_flow)(name=name).build()
        march(evolution, 4)
        march(plain, 4)
        moved = evolution.blocks[0].nodes - plain.blocks[0].nodes
        assert np.abs(moved[:, 1:-1, 1:-1]).max() > 1e-4, "the weight is felt"
        assert len(find_bad_cells(evolution.blocks[0].nodes)) == 0


def make_problem(**options) -> PlateOnWedge:
    return PlateOnWedge(msgspec.convert(options, PlateOnWedgeDeck))


def make_flying(speed=3000.0, **options) -> PlateOnWedge:
    return make_problem(drive={"kind": "moving", "speed": speed}, **options)


def test_a_plate_that_lies_on_the_wedge_as_a_whole_has_met_nothing_else(monkeypatch):
    run = make_flying(gap=1e-3, cells=(16, 4)).build()
    monkeypatch.setattr(run, "count_contact", lambda: run.plate.ni)
    assert run.get_free_line().shape == (2, 1)
    assert run.find_closure() is None


@pytest.mark.parametrize("counts, lengths", [((49, 33), (30.0, 20.0)), ((97, 65), (12.0, 38.0))])
@pytest.mark.parametrize("refinement", [1.2, 3.0, 8.0])
def test_refined_laws_meet_in_one_short_step(counts, lengths, refinement):
    plain, steps = (
        [length * np.diff(law) for length, law in zip(lengths, laws, strict=True)]
        for laws in (meeting_laws(counts, lengths), meeting_laws(counts, lengths, refinement))
    )
    assert steps[0][-1] == pytest.approx(min(plain[0][-1], plain[1][0]) / refinement)
    assert steps[1][0] == pytest.approx(steps[0][-1])
    for one, length in zip((steps[0][::-1], steps[1]), lengths, strict=True):
        ratio = one[1:] / one[:-1]
        assert ratio.min() > 1.0 - 1e-9 and ratio.max() < REFINED_STEP_RATIO + 1e-9
        assert one.sum() == pytest.approx(length)


def test_the_zone_of_constant_states_ends_where_the_flow_behind_is_sonic():
    zones = []
    for below in (0.1, 0.5, 1.0, 3.0):
        problem = make_flying(angle=16.057 - below)
        machs = [wave.mach_behind for wave in (problem.collision.plate, problem.collision.wedge)]
        assert (problem.zone > 0.0) == (min(machs) > 1.0)
        zones.append(problem.zone)
    assert sorted(zones) == zones


def make_falling(**options) -> Blocks:
    """A square of aluminium between free surfaces, under gravity."""
    sides = [
        {"side": side, "kind": "free-surface"} for side in ("i_min", "i_max", "j_min", "j_max")
    ]
    lines = {"i_min": ((0, 1), (0, 2)), "i_max": ((1, 1), (1, 2)), "j_min": ((0, 1), (1, 1))}
    block = {
        "name": "plate", "material": "Al1100", "p": 0.0, "cells": (4, 4), "side": sides,
        "curves": {**lines, "j_max": ((0, 2), (1, 2))},
    }  # fmt: skip
    kernels = {"limiter": "monotonised-central"}  # that other tests have compiled
    return Blocks(msgspec.convert({"block": [block], **kernels, **options}, BlocksDeck))


def test_blocks_of_a_deck_fall_under_gravity():
    problem = make_falling(gravity=(3.0, -9.81))
    flow = problem.build()
    march(flow, 5)
    row = problem.measure(flow)
    assert row["v_mean_plate"] == pytest.approx(-9.81 * flow.t, rel=1e-9)
    assert row["u_mean_plate"] == pytest.approx(3.0 * flow.t, rel=1e-9)
    with pytest.raises(BadInput, match="y is the radius"):
        make_falling(gravity=(0.0, -9.81), geometry="axisymmetric")
