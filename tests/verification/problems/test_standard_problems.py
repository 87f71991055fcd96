"""Standard problems against theory, and every problem of the registry: five steps, and a restart.

The longer figures are `shockgrid verify`'s; here each statement is made at a small size.
"""

import math

import numpy as np
import pytest

from shockgrid.problems.registry import PROBLEMS
from shockgrid.problems.standard.oblique_shock import ObliqueShock, ObliqueShockDeck
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.reading import read_deck
from shockgrid.runs.verify import march

SMALL = {
    "interface-instability": ("cells=8", "lengths=[2,2]"),
    "plate-on-wedge": ("cells=[16,6]",),
    "heated-cavity": ("cells=8",),
    "rayleigh-benard": ("cells=8", "cells_up=8"),
    "convection-1d": ("cells=8",),
    "moving-grid-1d": ("cells=32",),
    "riemann": ("cells=20",),
    "free-stream": ("cells=8",),
    "vortex": ("cells=8",),
    "noh": ("cells=16",),
    "sedov": ("cells=16",),
    "saltzmann": ("cells=20", "rows=4"),
    "flyer-target": ("plates.0.cells=6", "plates.1.cells=8"),
    "elastic-piston": ("cells=20",),
    "flying-plate": ("flyer_cells=6",),
    "taylor-bar": ("cells=3",),
    "shell": ("cells=6", "rays=6"),
    "rippled-surface": ("cells=6",),
    "cavity": ("cells=16",),
    "kidder": ("cells=8", "rays=12"),
    "gresho": ("cells=12",),
    "taylor-green": ("cells=12",),
    "rayleigh-taylor": ("cells=12",),
    "oblique-shock": ("cells=24",),
    "triple-point": ("cells=6",),
    "shock-bubble": ("cells=5",),
    "detonation": ("cells=40",),
}
LEAST_STEPS = 5


def assert_same(one, other, where):
    one = np.asarray(one)
    other = np.asarray(other)
    assert np.array_equal(one, other, equal_nan=one.dtype.kind == "f"), where


@pytest.mark.parametrize("name", PROBLEMS)
def test_five_steps_and_a_restart_in_the_middle_are_the_same_bits(name):
    """Every problem of the registry; those with many cells by default get few in SMALL."""
    deck = read_deck(name, SMALL.get(name, ()))
    problem = deck.make_problem()
    problem_again = deck.make_problem()
    whole = problem.build()
    half = deck.make_problem().build()
    again = problem_again.build()
    start = whole.start_row() if hasattr(whole, "start_row") else {}
    rows = []
    while len(rows) < LEAST_STEPS and whole.finished is None:
        rows.append(whole.advance())
    assert rows
    for _ in range(len(rows) // 2):
        half.advance()
    again.set_state(half.get_state())
    for row in rows[len(rows) // 2 :]:
        same = again.advance()
        for key in row:
            if not key.startswith("seconds_"):
                assert_same(row[key], same[key], key)
    one = whole.get_state()
    other = again.get_state()
    assert one.keys() == other.keys()
    for key in one:
        assert_same(one[key], other[key], key)
    for key, value in problem.measure(whole).items():
        assert_same(value, problem_again.measure(again)[key], key)
    for key, value in start.items():
        if key.startswith(("total_mass", "total_energy")):
            came = rows[-1].get("boundary_" + key.removeprefix("total_"), 0.0)
            size = max(abs(value), abs(came))
            assert abs(rows[-1][key] - came - value) <= 1e-12 * size, key


@pytest.mark.parametrize(
    "deck, settings, words",
    [
        ("saltzmann", ("run.t_end=1.5",), "third shock meets the wall"),
        ("saltzmann", ("skew=0.3",), "skew"),
        ("saltzmann", ("flux=roe",), "flux"),
        ("kidder", ("run.t_end=0.01",), "collapsed to the centre"),
        ("oblique-shock", ("angle=40",), "stays attached up to 29.8 degrees only"),
        ("oblique-shock", ("mach=1.2", "angle=2"), "leaves through the top"),
        ("triple-point", ("cells=7",), "must be even"),
        ("detonation", ("explosive=Al1100",), "must be a JWL material"),
    ],
)
def test_bad_input_is_one_sentence(deck, settings, words):
    with pytest.raises(BadInput, match=words) as caught:
        read_deck(deck, settings).make_problem()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "deck, settings, name, most",
    [
        ("oblique-shock", ("cells=40",), "angle", 0.005),
        pytest.param("rayleigh-taylor", ("cells=64",), "rate", 0.005, marks=pytest.mark.slow),
        pytest.param(
            "rayleigh-taylor", ("cells=32", "above=nothing"), "rate", 0.01, marks=pytest.mark.slow
        ),
        pytest.param(
            "triple-point", ("cells=40", "run.t_end=0.26"), "star", 0.02, marks=pytest.mark.slow
        ),
    ],
)
def test_small_runs_against_theory(deck, settings, name, most):
    history, errors, _ = march((deck, settings))
    values = history[name] if name in history else [errors[name]]
    known = [value for value in values if math.isfinite(value)]
    assert known[-1] < most


@pytest.mark.parametrize(
    ("deck", "column", "coarse", "fine", "least"),
    [
        ("kidder", "error_rho", ("cells=10", "rays=30"), ("cells=20", "rays=60"), 1.85),
        ("taylor-green", "error_velocity", *(
            (f"cells={n}", "mesh=follow") for n in (16, 32)), 1.8),
        ("taylor-green", "error_velocity", *(
            (f"cells={n}", "mesh=swing") for n in (16, 32)), 1.8),
    ],
)  # fmt: skip
def test_orders_on_moving_grids(deck, column, coarse, fine, least):
    found = [march((deck, settings))[0] for settings in (coarse, fine)]
    assert math.log2(found[0][column][-1] / found[1][column][-1]) > least
    if deck == "kidder":
        assert found[1]["outer_error"][-1] < 2.6e-4
        assert found[1]["inner_error"][-1] < 7.3e-4


def test_kidders_slab_shrinks_as_theory_says():
    coarse, fine = (march(("kidder", ("n=1", f"cells={cells}", "rays=4")))[0] for cells in (20, 40))
    for column in ("inner_worst", "outer_worst", "error_rho"):
        assert math.log2(coarse[column][-1] / fine[column][-1]) > 1.6, column
    assert fine["outer_worst"][-1] < 1e-4


def test_the_weak_oblique_shock():
    """Mach 2.5 on 15 degrees, NACA 1135's charts: 36.9 degrees."""
    assert math.degrees(ObliqueShock(ObliqueShockDeck()).beta) == pytest.approx(36.945, abs=0.001)
