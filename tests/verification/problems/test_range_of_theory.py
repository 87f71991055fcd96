"""A run that goes on beyond the range of its theory is compared with it inside that range only."""

import math

import msgspec
import pytest

from builders import march_measured
from shockgrid.problems.deck import RunControl
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.line import Mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.interface_instability.theories import get_kct
from shockgrid.problems.riemann import Riemann, RiemannDeck, SideState
from shockgrid.problems.standard.detonation import Detonation, DetonationDeck
from shockgrid.problems.standard.flyer_target import FlyerTarget, FlyerTargetDeck, PlateTable
from shockgrid.problems.standard.oblique_shock import ObliqueShock, ObliqueShockDeck
from shockgrid.problems.standard.rayleigh_taylor import RayleighTaylor, RayleighTaylorDeck


def run(problem, **options):
    """The history of a problem with a deck of these options, and its report."""
    evolution = problem.build()
    history = march_measured(problem, evolution)
    return history, problem.report_on(history)


def find_errors(report):
    """Relative differences of the report's rows that are shown as such, by name."""
    shown = {row.name: abs(row.difference) for row in report.rows if row.label and not row.off}
    return {name: value for name, value in shown.items() if not math.isnan(value)}


@pytest.mark.parametrize("lengths", [(2.0, 2.5), (3.0, 1.5)], ids=["piston", "far wall"])
@pytest.mark.parametrize("ka0", [0.02, 0.6])
def test_growth_until_waves_return(lengths, ka0):
    """The first is of waves from the piston, the second of waves from the far wall."""
    deck = {"cells": 32, "start": "incident", "lengths": lengths, "kct_end": 25.0}
    problem = InterfaceInstability(InterfaceDeck(modes=[Mode(ka0=ka0)], **deck))
    echo = float(get_kct(problem, min(t for t, _ in problem.find_echoes().values())))
    assert 8.0 < echo < 20.0
    problem = InterfaceInstability(
        InterfaceDeck(modes=[Mode(ka0=ka0)], **{**deck, "kct_end": echo + 4.0})
    )
    errors = find_errors(run(problem)[1])
    assert errors["interface_speed"] < 0.005
    assert errors.get("growth_rate", 0.0) < 0.02
    assert errors.get("model_amplitude", 0.0) < 0.2
    assert len(errors) == 2


@pytest.mark.parametrize("contact", ["on-line", "captured"])
@pytest.mark.parametrize("t_end", [0.6, 2.0])
def test_star_states_until_waves_leave(contact, t_end):
    deck = RiemannDeck(case="sod", contact=contact, rows=2, run=RunControl(t_end=t_end))
    history, report = run(Riemann(deck))
    errors = find_errors(report)
    assert history["t"][-1] == t_end
    assert len(errors) == 6
    assert max(errors.values()) < 0.003


@pytest.mark.parametrize("behind", ["piston", "wall"])
def test_detonation_until_the_wall(behind):
    deck = DetonationDeck(cells=60, behind=behind, run=RunControl(t_end=3e-5))
    errors = find_errors(run(Detonation(deck))[1])
    assert errors["speed"] < 0.01
    assert errors["pressure"] < 0.2


def test_rayleigh_taylor_while_the_wave_is_gentle():
    rates = {}
    for t_end in (3.0, 6.0):
        deck = RayleighTaylorDeck(cells=16, run=RunControl(t_end=t_end))
        (row, *_) = run(RayleighTaylor(deck))[1].rows
        rates[t_end] = row.computed
    assert rates[6.0] == pytest.approx(rates[3.0], rel=0.01)
    steep = RayleighTaylorDeck(cells=16, amplitude=0.15, run=RunControl(t_end=0.3))
    assert "rate" not in find_errors(run(RayleighTaylor(steep))[1])


def test_oblique_shock_once_it_is_steady():
    early = ObliqueShockDeck(cells=24, run=RunControl(t_end=0.2))
    assert not find_errors(run(ObliqueShock(early))[1])
    late = ObliqueShockDeck(cells=24, run=RunControl(t_end=2.0))
    errors = find_errors(run(ObliqueShock(late))[1])
    assert len(errors) == 2
    assert max(errors.values()) < 0.02


def make_parting(speed, gamma=1.4, p=(0.4, 0.4), **options):
    """Two gases that part at `speed` each."""
    sides = [
        SideState(gamma=gamma, rho=1.0, u=sign * speed, p=one)
        for sign, one in zip((-1.0, 1.0), p, strict=True)
    ]
    return Riemann(RiemannDeck(left=sides[0], right=sides[1], rows=2, **options))


@pytest.mark.parametrize("contact", ["on-line", "captured"])
@pytest.mark.parametrize("cells", [16, 50, 100, 200])
@pytest.mark.parametrize(
    "gases",
    [{"speed": 2.4}, {"speed": 2.8}, {"speed": 3.5}, {"speed": 2.4, "p": (0.4, 0.2)},
     {"speed": 1.6, "gamma": 5 / 3}, {"speed": 3.9, "gamma": 1.25}],
    ids=str,
)  # fmt: skip
def test_gases_that_part_near_vacuum_speed(gases, cells, contact):
    """Within 5 %, or the problem says what is off by how much."""
    problem = make_parting(cells=cells, contact=contact, **gases)
    history, report = run(problem)
    errors = find_errors(report)
    trusted = errors and max(errors.values()) < 0.05
    assert trusted != bool(problem.cautions_on(history))


COPPER = PlateTable(material="Cu", thickness=1e-3, cells=60)
ALUMINIUM = PlateTable(material="Al6061", thickness=1e-3, cells=60, gap=1e-4)


def run_plates(*plates, t_end=8e-7):
    deck = FlyerTargetDeck(plates=plates, speed=500.0, run=RunControl(t_end=t_end))
    return run(FlyerTarget(deck))


@pytest.mark.parametrize("window", ["PMMA", "Pb"])
@pytest.mark.parametrize("gap", [0.0, 1e-4])
def test_plates_that_touch_from_the_start_are_no_impact(window, gap):
    """A window behind the target, softer and stiffer than it."""
    target = msgspec.structs.replace(ALUMINIUM, gap=gap)
    _, report = run_plates(COPPER, target, PlateTable(material=window, thickness=1e-3, cells=60))
    times = {row.name: (row.computed, row.theory) for row in report.rows}
    assert times["impact"] == pytest.approx((gap / 500.0,) * 2, rel=1e-3)
    errors = find_errors(report)
    assert {"pressure", "window_speed", "window_pressure"} <= set(errors)
    assert max(errors.values()) < 2e-3


def test_a_plate_is_bonded_to_the_one_before_it():
    """The stack stays one body with a bond and comes apart at its window without."""
    window = PlateTable(material="PMMA", thickness=1e-3, cells=60)
    opened = {}
    for bond in (None, 1e12):
        tied = msgspec.structs.replace(window, bond=bond)
        history, _ = run_plates(COPPER, ALUMINIUM, tied)
        last = {name: history[f"speed_plate-{name}"][-1] for name in (1, 2, 3)}
        opened[bond] = history["contacts_opened"][-1]
        assert last[3] > last[2] > last[1]
    assert opened[1e12] < opened[None]


def test_waves_that_ring_in_a_thin_target():
    thin = msgspec.structs.replace(ALUMINIUM, thickness=0.4e-3, cells=40)
    _, report = run_plates(COPPER, thin)
    errors = find_errors(report)
    assert errors["free"] < 2e-3
    assert errors["pressure"] < 2e-3
    assert "end" not in errors


def test_gases_at_one_speed_do_not_part():
    """A pressure that falls in one of two gases at rest, or moving together, is no vacuum."""
    for speed in (0.0, -3.0):
        side = {"gamma": 1.4, "rho": 1.0, "u": speed}
        deck = RiemannDeck(left=SideState(p=1.0, **side), right=SideState(p=0.1, **side))
        problem = Riemann(deck)
        assert math.isinf(problem.measure_heat_left())
        assert problem.cautions_on() == []
