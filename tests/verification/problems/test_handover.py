"""A shocked interface goes on as a field: nothing is lost, and it goes on as the line would."""

from __future__ import annotations

import numpy as np
import pytest

from builders import check_budget, check_restarts, march_measured
from shockgrid.problems.initial_states import Fluid
from shockgrid.problems.interface_instability.deck import InterfaceDeck, LineMotion
from shockgrid.problems.interface_instability.line import Mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.regrid.errors import BadInput, RunFailure

STEEP = {"mach": 1.5, "modes": [Mode(ka0=0.5)]}


def make_problem(**keys):
    return InterfaceInstability(InterfaceDeck(**(STEEP | keys)))


def march_problem(problem):
    return march_measured(problem, problem.build())


def find_handover(history):
    """The first row of both materials on one grid."""
    return int(np.argmax(history["integral_width"] > 0.0))


@pytest.mark.parametrize("keys", [{"handover_kct": 2.0}, {"start": "captured"}])
@pytest.mark.parametrize("sides", ["wall", "periodic"])
def test_masses_momentum_and_energy_stay_over_the_handover(keys, sides):
    problem = make_problem(cells=16, kct_end=4.0, width=1.0, sides=sides, **keys)
    history = march_problem(problem)
    assert history["integral_width"][-1] > 0.0
    check_budget(history, limit=1e-12)
    mean = history["interface_mean"]
    assert np.isfinite(mean).all()


@pytest.mark.slow
def test_place_width_and_modes_go_on_over_the_handover():
    history = march_problem(make_problem(cells=48, kct_end=6.5, handover_kct=6.0))
    row = find_handover(history)
    amplitude = history["amplitude"][row]
    for name in ("interface_max", "interface_min", "amplitude", "amplitude_mode_1"):
        before = history[name][row - 3 : row]
        t = history["t"][row - 3 : row + 1]
        expected = np.polyval(np.polyfit(t[:3], before, 1), t[3])
        assert abs(history[name][row] - expected) < 0.004 * amplitude, name
    profile = history["integral_width"][row]
    assert 1.2 * amplitude < profile < 2.0 * amplitude, "of a cosine 1.6 times"


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
    assert [block.name for block in flow.blocks] == ["both"]
    assert row["t"] > 0.0 and np.isfinite(problem.measure(flow)["amplitude"])


def fail_once(check):
    """A check that finds the line torn, the first time."""
    left = [RunFailure("lines: the line is torn", cause="line-torn")]

    def fail():
        if left:
            raise left.pop()
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
