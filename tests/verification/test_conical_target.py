"""The conical target: six blocks, four materials, points where three of them meet."""

import numpy as np
import pytest

from problems.conical_target import ConicalTarget, ConicalTargetDeck
from problems.deck import RunControl
from problems.references.hugoniot import shock_with_particle_speed
from regrid.errors import BadInput


def march(problem, steps=10**6):
    simulation = problem.build()
    rows = [simulation.start_row() | {"t": 0.0} | problem.measure(simulation)]
    while not simulation.finished and len(rows) <= steps:
        rows.append(simulation.advance() | problem.measure(simulation))
    names = [n for n, value in rows[-1].items() if not isinstance(value, str)]
    return simulation, {n: np.array([row.get(n, np.nan) for row in rows], float) for n in names}


def check_balance(history):
    for name in ("mass_impactor", "mass_shell", "mass_target", "mass_filling", "energy"):
        total = history[f"total_{name}"]
        came = np.nan_to_num(history[f"boundary_{name}"])
        assert np.abs(total - came - total[0]).max() <= 1e-12 * np.abs(total).max(), name
    # axial momentum: what the walls behind took is in the boundary's part
    total, came = history["total_momentum_x"], np.nan_to_num(history["boundary_momentum_x"])
    assert np.abs(total - came - total[0]).max() <= 1e-12 * np.abs(total).max()


def test_impact():
    """Al on SS304 at 2 km/s, computed independently: 26.97967 GPa, 0.621767 km/s."""
    problem = ConicalTarget(ConicalTargetDeck(run=RunControl(t_end=0.6e-6, cfl=0.8)))
    pressure, velocity, _ = problem.impact
    assert pressure == pytest.approx(26.97967e9, rel=1e-5)
    assert velocity == pytest.approx(621.767, rel=1e-5)
    steel = problem.materials["shell"]
    assert shock_with_particle_speed(steel.eos, steel.rho0, 0.0, velocity).p == pytest.approx(
        pressure, rel=1e-8
    )
    simulation, history = march(problem)
    assert problem.errors(history)["impact"] < 0.01
    face = simulation.blocks[0].nodes[0, -1, :10]
    u = simulation.blocks[0].state[1, -4, 1:10]
    assert np.abs(u / velocity - 1.0).max() < 0.02
    assert np.ptp(face) < 1e-9, "the impact is plane until waves come from the cone's edge"
    check_balance(history)


def test_five_microseconds():
    """Coarse, but the whole way: into the roll-up where graphite, steel and lead meet."""
    problem = ConicalTarget(ConicalTargetDeck(cells=32))
    simulation, history = march(problem)
    assert simulation.finished and simulation.t == 5e-6
    assert (history["least_scaled_jacobian"] > 0.0).all(), "every cell convex in every step"
    check_balance(history)
    peak = int(np.argmax(history["greatest_pressure"]))
    assert 30e9 < history["greatest_pressure"][peak] < 36e9
    assert history["greatest_x"][peak] > 15e-3 and history["greatest_y"][peak] < 0.5e-3
    gauges = [history[f"pressure_gauge_{k}"].max() for k in range(3)]
    assert gauges[2] > 1.2 * gauges[0], "the shock converges"
    assert history["transformed"].max() > 1e-3
    for block in simulation.blocks:
        if any(segment.kind == "axis" for segment in block.segments):
            assert not block.nodes[1, :, 0].any()
    text = problem.summary(history, simulation)
    assert "impact face" in text and "26.98" in text


def test_restart():
    problem = ConicalTarget(ConicalTargetDeck(cells=16))
    one = problem.build()
    for _ in range(30):
        one.advance()
    again = ConicalTarget(ConicalTargetDeck(cells=16)).build()
    again.set_state(one.get_state())
    for _ in range(10):
        one.advance()
        again.advance()
    state = again.get_state()
    for name, value in one.get_state().items():
        assert np.array_equal(value, state[name]), name


def test_bad_input():
    with pytest.raises(BadInput, match=r"tip is 0.01 and base 0.009 m; the cone narrows"):
        ConicalTarget(ConicalTargetDeck(tip=0.01))
    with pytest.raises(BadInput, match=r"base is 0.02 and radius 0.016 m; there must be lead"):
        ConicalTarget(ConicalTargetDeck(base=0.02))
    with pytest.raises(BadInput, match=r"cone is 0.03 and length 0.026 m; there must be lead"):
        ConicalTarget(ConicalTargetDeck(cone=0.03))
    with pytest.raises(BadInput, match=r"impactor is 'air', which has no sound speed at p = 0"):
        ConicalTarget(ConicalTargetDeck(impactor="air"))
    with pytest.raises(BadInput, match=r"there is no material 'granite'.*graphite"):
        ConicalTarget(ConicalTargetDeck(filling="granite"))
