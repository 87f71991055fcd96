"""A shocked interface goes on as a field: nothing is lost, and it goes on as the line would."""

from __future__ import annotations

import numpy as np
import pytest

from builders import check_budget, check_restarts, get_bits, march, march_measured, tensor
from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.problems.deck import RunControl
from shockgrid.problems.initial_states import Fluid
from shockgrid.problems.interface_instability.deck import InterfaceDeck, LineMotion
from shockgrid.problems.interface_instability.line import Mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.interface_instability.zone import (
    make_line_profile,
    measure_circulation,
    measure_line_width,
)
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.regrid.measure.corners import compute_centres
from thread_ranks import compare_with_ranks

STEEP = {"mach": 1.5, "modes": [Mode(ka0=0.5)]}


def make_problem(**keys):
    return InterfaceInstability(InterfaceDeck(**(STEEP | keys)))


def march_problem(problem):
    return march_measured(problem, problem.build())


def find_handover(history):
    """The first row of both materials on one grid."""
    return int(np.argmax(history["mixed_mass"] > 0.0))


@pytest.mark.parametrize("keys", [{"handover_kct": 2.0}, {"start": "captured"}])
@pytest.mark.parametrize("sides", ["wall", "periodic"])
def test_masses_momentum_and_energy_stay_over_the_handover(keys, sides):
    problem = make_problem(cells=16, kct_end=4.0, width=1.0, sides=sides, **keys)
    history = march_problem(problem)
    assert history["mixed_mass"][-1] > 0.0
    check_budget(history, limit=1e-12)
    mean = history["interface_mean"]
    assert np.isfinite(mean).all()


def test_a_line_whose_ends_move_along_periodic_sides_is_handed_over_whole():
    """What lies beyond one side of the new grid comes in through the other."""
    tilted = {"modes": [Mode(ka0=0.5, phase=0.7)], "sides": "periodic", "width": 1.0}
    history = march_problem(make_problem(cells=16, kct_end=5.0, handover_kct=3.0, **tilted))
    assert history["mixed_mass"][-1] > 0.0
    check_budget(history, limit=1e-12)
    row = find_handover(history)
    for name in ("integral_width", "circulation"):
        assert abs(history[name][row] / history[name][row - 1] - 1.0) < 0.03, name


@pytest.mark.slow
def test_width_circulation_and_rate_go_on_over_the_handover():
    """One definition measures a line and a field: what changes is what the remapping changes."""
    line = march_problem(make_problem(cells=64, kct_end=7.0, handover=True))
    field = march_problem(make_problem(cells=64, kct_end=7.0, handover_kct=6.0))
    row = find_handover(field)
    assert field["t"][row] == line["t"][row]
    for name, bar in (("amplitude", 1e-3), ("integral_width", 1e-3), ("circulation", 5e-3)):
        assert abs(field[name][row] / line[name][row] - 1.0) < bar, name
    for name in ("interface_max", "interface_min"):
        assert abs(field[name][row] - line[name][row]) < 1e-3 * line["amplitude"][row], name
    # a field goes on a little more slowly than a line
    t = np.array([line["t"][row], line["t"][-1]])
    grown = [np.diff(np.interp(t, run["t"], run["amplitude"])) for run in (line, field)]
    assert abs(grown[1] / grown[0] - 1.0) < 0.01


def test_a_line_has_the_width_of_a_field_on_ever_finer_cells():
    y = np.linspace(0.0, 0.5, 33)
    x = 0.1 * np.cos(2.0 * np.pi * y) + 0.05 * np.sin(6.0 * np.pi * y)
    x[10:14] = x[10:14][::-1]  # a fold
    exact = measure_line_width(np.array([x, y]))
    places, profile = make_line_profile(np.array([x, y]))
    fine = np.linspace(places[0], places[-1], 20001)
    values = np.interp(fine, places, profile)
    assert exact == pytest.approx(np.trapezoid(4.0 * values * (1.0 - values), fine), rel=1e-6)
    # a straight line across the domain: a profile from 1 to 0, of which the integral is 4 L / 6
    slanted = np.array([np.linspace(0.0, 3.0, 7), np.linspace(0.0, 0.5, 7)])
    assert measure_line_width(slanted) == pytest.approx(2.0, rel=1e-14)


def test_circulation_is_that_of_the_vortices_between_two_rows():
    """A shear layer whose streams differ by 2 m/s, 3 m long, on straight and bent cells."""
    nodes = tensor(np.linspace(0.0, 3.0, 13), np.linspace(0.0, 1.0, 9))
    bent = nodes.copy()
    bent[0] += 0.02 * np.sin(np.pi * nodes[1]) * np.sin(np.pi * nodes[0] / 3.0)
    for grid in (nodes, bent):
        u = np.cos(np.pi * compute_centres(grid)[1])
        block = Block("gas", IdealGas(1.4), grid, 1.0, u, 0.0, 1.0)
        assert measure_circulation([block], grid[1, 0]) == pytest.approx(6.0, rel=0.01)


@pytest.mark.slow
def test_no_step_fails_where_a_shock_comes_back_through_both_materials():
    """Round-off of a material that is not there is no lack of it."""
    gases = {"first": Fluid(gamma=1.4, rho=1.0), "second": Fluid(gamma=1.093, rho=5.1)}
    tube = {"start": "captured", "mach": 1.2, "lengths": (4.0, 1.5), "kct_end": 25.0}
    history = march_problem(make_problem(cells=24, modes=[Mode(ka0=0.2)], **tube, **gases))
    assert np.nanmax(history["retries"]) == 0
    assert np.nanmax(history["first_order_faces"]) == 0


def test_restarts_go_on_with_the_same_bits():
    problem = make_problem(cells=16, kct_end=4.0, handover_kct=1.0)

    def choose(rows, states):
        first = next(n for n, state in enumerate(states) if "both/state" in state)
        return [1, first - 1, first, first + 5]

    check_restarts(problem.build, choose)
    check_restarts(make_problem(cells=16, start="captured").build, [1, 6])


def test_a_run_goes_on_where_its_line_ends():
    problem = make_problem(cells=16, kct_end=4.0, handover=True)
    flow = problem.build()
    for _ in range(5):
        flow.advance()
    flow._check_collapse = fail_once(flow._check_collapse)
    row = flow.advance()
    assert row["handover"] == "line-torn" and flow.advance()["handover"] == ""
    assert [block.name for block in flow.blocks] == ["both"]
    assert row["t"] > 0.0 and np.isfinite(problem.measure(flow)["amplitude"])


@pytest.mark.parametrize("keys", [{"handover_kct": -0.8}, {"handover": True}])
def test_ranks_and_threads_hand_over_with_the_same_bits(keys):
    problem = make_problem(cells=16, kct_end=4.0, width=1.0, sides="periodic", **keys)

    def build():
        flow = problem.build()
        if "handover" in keys:
            flow._check_collapse = fail_once(flow._check_collapse, after=12)
        return flow

    rows = compare_with_ranks(build, 30, [2, 3])
    handed = [row["handover"] for row in rows if row["handover"]]
    assert handed == ["time" if "handover_kct" in keys else "line-torn"]
    run = RunControl(cfl=0.8, threads=2)
    parallel = make_problem(cells=16, kct_end=4.0, width=1.0, sides="periodic", run=run, **keys)
    alone = build()
    problem = parallel
    other = build()
    march(alone, 30)
    march(other, 30)
    assert get_bits(alone) == get_bits(other)


def fail_once(check, after=0):
    """A check that finds the line torn once, after so many calls that find nothing."""
    left = [None] * after + [RunFailure("lines: the line is torn", cause="line-torn")]

    def fail():
        failure = left.pop(0) if left else None
        if failure is not None:
            raise failure
        check()

    return fail


@pytest.mark.slow
def test_a_captured_contact_grows_ever_more_like_the_line():
    gentle = {"mach": 1.5, "kct_end": 6.0, "modes": [Mode(ka0=0.2)]}
    misses = []
    for cells in (32, 64):
        line = march_problem(make_problem(**gentle, cells=cells))
        field = march_problem(make_problem(**gentle, cells=cells, start="captured"))
        grown = line["amplitude_mode_1"][-1] - line["amplitude_mode_1"][0]
        miss = line["amplitude_mode_1"][-1] - field["amplitude_mode_1"][-1]
        misses.append(miss / grown)
    assert 0.0 < misses[1] < 0.08
    assert misses[1] < 0.7 * misses[0]


def test_what_needs_a_line_is_refused():
    with pytest.raises(BadInput, match="refine"):
        make_problem(handover=True, refine=True)
    with pytest.raises(BadInput, match="tension"):
        make_problem(start="captured", line=LineMotion(tension=1.0))
