"""The conical target: seven blocks, four materials, points where three of them meet."""

import h5py
import numpy as np
import pytest
from scipy.optimize import brentq

from builders import check_budget, march, march_measured
from hydro.eos.materials import find_material
from problems.conical_target.deck import ConicalTargetDeck, Contact, EosNumbers
from problems.conical_target.growth import make_ripple_lines
from problems.conical_target.peaks import PARTS, find_peak
from problems.conical_target.pictures import sample_hugoniot
from problems.conical_target.problem import ConicalTarget, measure_departure, measure_front
from problems.conical_target.report import STATIONS, measure_growth, measure_passage
from problems.deck import RunControl
from problems.references.hugoniot import shock_with_particle_speed
from regrid.errors import BadInput
from regrid.interpreting import interpreted


def march_target(problem, steps=None):
    simulation = problem.build()
    return simulation, march_measured(problem, simulation, steps)


@pytest.mark.slow
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
    simulation, history = march_target(problem)
    assert problem.errors(history)["impact"] < 0.01
    face = simulation.blocks[0].nodes[0, -1, :10]
    u = simulation.blocks[0].state[1, -4, 1:10]
    assert np.abs(u / velocity - 1.0).max() < 0.02
    assert np.ptp(face) < 1e-9, "the impact is plane until waves come from the cone's edge"
    check_budget(history)


def shock_with_speed(material, speed):
    """Pressure behind a single shock of that speed into a material at rest [Pa]."""

    def excess(u):
        shock = shock_with_particle_speed(material.eos, material.rho0, 0.0, u)
        return shock.shock_speed - speed

    u = brentq(excess, 10.0, 2000.0)
    return shock_with_particle_speed(material.eos, material.rho0, 0.0, u).p


@pytest.mark.slow
def test_five_microseconds():
    """Coarse, but the whole way: into the roll-up where graphite, steel and lead meet."""
    problem = ConicalTarget(ConicalTargetDeck(cells=32))
    simulation, history = march_target(problem)
    assert simulation.finished and simulation.t == 5e-6
    assert (history["least_scaled_jacobian"] > 0.0).all(), "every cell convex in every step"
    check_budget(history)
    peak = int(np.argmax(history["greatest_pressure"]))
    # the focus on the axis, one cell wide: 29.8 GPa at 32, 30.4 at 48 cells
    assert 29e9 < history["greatest_pressure"][peak] < 36e9
    assert history["greatest_x"][peak] > 15e-3 and history["greatest_y"][peak] < 0.5e-3
    gauges = [history[f"pressure_gauge_{k}"].max() for k in range(3)]
    assert gauges[2] > 1.2 * gauges[0], "the shock converges"
    assert history["transformed"].max() > 1e-3
    for block in simulation.blocks:
        if any(segment.kind == "axis" for segment in block.segments):
            assert not block.nodes[1, :, 0].any()
    # the first shock in the graphite, and what comes of it towards the tip
    axis, side = (measure_passage(problem, history, name) for name in ("axis", "side"))
    assert len(axis) == len(STATIONS) and np.isfinite(axis).all() and np.isfinite(side).all()
    graphite = problem.materials["filling"]
    first = shock_with_speed(graphite, axis[0][1])
    assert axis[0][2] == pytest.approx(first, rel=0.08), "on the Hugoniot of graphite"
    assert axis[2][1] > 1.03 * axis[0][1] and axis[2][2] > 1.3 * axis[0][2], "it converges"
    assert all(there[0] < here[0] for here, there in zip(axis, side, strict=True))
    begin, growth, _ = measure_growth(history)
    assert 0.5e-6 < begin < 1.2e-6 and growth > 0.0
    assert history["line_amplitude"][-1] > 0.1e-3 > 1e6 * history["line_amplitude"][0]
    text = problem.summary(history, simulation)
    assert "impact face" in text and "mean from 0.27 to 0.52 us" in text and "26.98" in text
    top, _, x, y = find_peak(history, "target")
    assert 40e9 < top < 60e9 and 13e-3 < x < 20e-3 and 8e-3 < y < 12e-3, "the focus in the lead"
    assert "greatest pressure of all" in text and ", in Pb" in text
    assert "shock on its axis" in text and "it bends from" in text


def test_departure_from_a_straight_line():
    """A wave on a line that is turned, carried and unevenly cut into segments."""
    x = 14.0 * np.linspace(0.0, 1.0, 401) ** 1.3
    wave = 0.05 * np.cos(2.0 * np.pi * x / 14.0)
    turn = -0.46
    line = np.array(
        [
            3.0 + x * np.cos(turn) - wave * np.sin(turn),
            9.0 + x * np.sin(turn) + wave * np.cos(turn),
        ]
    )
    departure, part = measure_departure(line)
    assert np.abs(departure - wave).max() < 2e-4 and np.allclose(part, x / 14.0, atol=1e-4)
    assert np.abs(measure_departure(line[:, ::-1])[0] - departure[::-1]).max() < 1e-12
    straight = np.array([x, 9.0 - 0.5 * x])
    assert np.abs(measure_departure(straight)[0]).max() < 1e-13


@pytest.mark.slow
def test_front_in_a_row_of_cells():
    blocks = ConicalTarget(ConicalTargetDeck(cells=16)).build().blocks
    cone = next(block for block in blocks if block.name == "cone")
    centre = 0.5 * (cone.nodes[0, 1:, 0] + cone.nodes[0, :-1, 0])
    inside = cone.state[:, 1:-1, 1:-1]
    assert np.isnan(measure_front(cone, 0, 5e9, 20.0)).all(), "nothing has come yet"
    inside[3, :, 0] = np.interp(centre, [6e-3, 8e-3], [10e9, 0.0])
    x, p = measure_front(cone, 0, 5e9, 20.0)
    assert x == pytest.approx(7e-3, abs=1e-4) and p == 10e9
    inside[1, -1, 0] = 100.0
    assert np.isnan(measure_front(cone, 0, 5e9, 20.0)).all(), "the shock has left"


SLIDING = Contact(impactor="sliding", front="sliding", side="sliding", cone="sliding")
JOINED = Contact(front="joined", side="joined")


@pytest.mark.slow
@pytest.mark.parametrize("contact", [SLIDING, JOINED])
@pytest.mark.parametrize("cover", [12e-3, 16e-3])
def test_points_where_impactor_steel_and_lead_meet(cover, contact):
    """Each part of the impact face is at the pressure of its own two materials at first."""
    deck = ConicalTargetDeck(
        cells=32, cover=cover, contact=contact, run=RunControl(t_end=0.4e-6, cfl=0.8)
    )
    problem = ConicalTarget(deck)
    simulation, history = march_target(problem)
    check_budget(history)
    assert not history["cells_not_convex"].any()
    solids = problem.materials

    def match(name):
        def excess(u):
            return (
                shock_with_particle_speed(
                    solids["impactor"].eos, solids["impactor"].rho0, 0.0, deck.speed - u
                ).p
                - shock_with_particle_speed(solids[name].eos, solids[name].rho0, 0.0, u).p
            )

        u = brentq(excess, 1.0, deck.speed - 1.0)
        return shock_with_particle_speed(solids[name].eos, solids[name].rho0, 0.0, u).p, u

    blocks = {block.name: block for block in simulation.blocks}
    assert ("ring" in blocks) == (cover < deck.radius)
    for name, part in (("front", "shell"), ("ring", "target")):
        if name in blocks:
            p, u = match(part)
            row = blocks[name].state[:, 1, 1:-1]  # the cells at the face
            middle = row[:, row.shape[1] // 2 - 1 : row.shape[1] // 2 + 1]
            assert middle[3] == pytest.approx(p, rel=0.06), name
            assert middle[1] == pytest.approx(u, rel=0.04), name
    peaks = {part: find_peak(history, part)[0] for part in PARTS}
    assert peaks["filling"] < 0.1 * peaks["shell"], "the shock is not there yet"
    assert max(peaks.values()) == pytest.approx(problem.impact[0], rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("cover", "contact"), [(16e-3, JOINED), (12.5e-3, Contact())])
def test_corners_of_a_finer_target(cover, contact):
    """They would open past 180 degrees: the graphite's at the tip, steel's at the impact face."""
    simulation, history = march_target(
        ConicalTarget(ConicalTargetDeck(cells=64, cover=cover, contact=contact))
    )
    assert simulation.finished and not history["cells_not_convex"].any()
    check_budget(history)


@pytest.mark.slow
def test_restart():
    problem = ConicalTarget(ConicalTargetDeck(cells=16))
    one = problem.build()
    march(one, 30)
    again = ConicalTarget(ConicalTargetDeck(cells=16)).build()
    again.set_state(one.get_state())
    march(one, 10)
    march(again, 10)
    state = again.get_state()
    for name, value in one.get_state().items():
        assert np.array_equal(value, state[name]), name


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tip": 0.01}, "tip is 0.01 and base 0.009 m; the cone narrows"),
        ({"base": 0.02}, "base is 0.02 and radius 0.016 m; there must be lead"),
        ({"cone": 0.03}, "cone is 0.03 and length 0.026 m; there must be lead"),
        ({"tip": 1e-9}, "tip is 1e-09 m with a radius of 0.016 m; it must be between 0.00016"),
        ({"front": 1e-9}, "front is 1e-09 m with a radius of 0.016 m; it must be between"),
        ({"side": 1e3}, "side is 1000 m with a radius of 0.016 m; it must be between"),
        ({"cone": 1e-6}, "cone is 1e-06 m with a radius"),
        ({"cover": 9.1e-3}, "base is 0.009 and cover 0.0091 m; the shell's front must cover"),
        ({"cover": 15.9e-3}, "cover is 0.0159 m, which leaves 0.0001 m of lead"),
        ({"speed": 1e5}, "speed is 100000 m/s; .* faster than sound .*5386 and 4569 m/s"),
        ({"speed": 8.1e3}, "speed is 8100 m/s; .* take a slower impactor"),
        ({"impactor": "air"}, "impactor is 'air', which has no sound speed at p = 0"),
        ({"filling": "TNT"}, "filling is 'TNT', an explosive; nothing burns .* an inert material"),
        ({"filling": "granite"}, "there is no material 'granite'.*graphite"),
        ({"shell": "nowhere.toml:steel"}, "materials: there is no file 'nowhere.toml'"),
        ({"filling": "graphite", "eos": EosNumbers(filling={"onset": 3e10})}, "no parameter 'ons"),
        (
            {"eos": EosNumbers(filling={"complete": 2e10})},
            "complete at 2e.10 Pa; that must be above its onset",
        ),
    ],
)
def test_bad_input(changes, words):
    with pytest.raises(BadInput, match=words):
        ConicalTarget(ConicalTargetDeck(**changes))


def write_table(folder, top):
    """Aluminium as a table up to the density `top` [kg/m³] and 1.5 MJ/kg; its name in a deck."""
    solid = find_material("Al1100").eos
    rho, e = np.linspace(2000.0, top, 200), np.linspace(-1e6, 1.5e6, 60)
    with h5py.File(folder / f"{top:g}.h5", "w") as file:
        file["rho"], file["e"] = rho, e
        file["p"] = solid.pressure(*np.meshgrid(rho, e, indexing="ij"))
    own = '[al]\neos = "tabular"\nsource = "a test"\nrho0 = 2707.0\npath = "%g.h5"\n'
    (folder / f"{top:g}.toml").write_text(own % top)
    return f"{folder / f'{top:g}'}.toml:al"


def test_tables_must_hold_the_shocks_of_the_impact(tmp_path):
    """Up to its pressure and no more: 3344 kg/m3 and 0.95 MJ/kg of the aluminium."""
    problem = ConicalTarget(ConicalTargetDeck(impactor=write_table(tmp_path, 3380.0)))
    assert problem.impact[0] == pytest.approx(26.98e9, rel=2e-3), "as the law it was made from"
    words = "the shocks that '.*3300.toml:al' at 2000 m/s .* outside the table .*rho 2000 to 3300"
    with pytest.raises(BadInput, match=words):
        ConicalTarget(ConicalTargetDeck(impactor=write_table(tmp_path, 3300.0)))
    rho, p = sample_hugoniot(problem.materials["impactor"], 60e9)
    assert rho[0] == 2707.0 and 27e9 < p[-1] < 35e9 and rho[-1] < 3380.0, "as far as the table goes"
    with pytest.raises(BadInput, match="table must hold p = 0 at its density, 2707 kg/m3"):
        ConicalTarget(ConicalTargetDeck(filling=write_table(tmp_path, 2600.0)))


def test_ripples_of_few_cells_are_not_compared():
    def tell(cells):
        problem = ConicalTarget(
            ConicalTargetDeck(cells=cells, ripple_amplitude=1e-4, contact=Contact())
        )
        with interpreted():  # nothing marches: no kernel is worth its compiling
            row = problem.measure(problem.build())
        history = {name: np.array([value]) for name, value in row.items()} | {"t": np.zeros(1)}
        return "\n".join(make_ripple_lines(problem, history))

    assert "7.16 cells a wave are too few to compare growth with theory" in tell(32)
    assert "cells=48 or more would do" in tell(32)
    assert "too few" in tell(47) and "too few" not in tell(48)


def test_plan_is_what_is_built():
    """Also of a size that nobody could allocate."""
    problem = ConicalTarget(ConicalTargetDeck(cells=24))
    t_end, plans = problem.plan()
    nodes = problem.make_nodes()
    assert t_end == 5e-6 and [plan.name for plan in plans] == list(nodes)
    for plan, grid in zip(plans, nodes.values(), strict=True):
        assert plan.cells == (grid.shape[1] - 1, grid.shape[2] - 1)
        assert plan.low == pytest.approx(tuple(grid.min(axis=(1, 2))), abs=1e-12)
        assert plan.high == pytest.approx(tuple(grid.max(axis=(1, 2))), abs=1e-12)
    assert ConicalTarget(ConicalTargetDeck(cells=10**6)).plan()[1][0].cells[1] == 1250000
