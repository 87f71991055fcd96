"""Problems of solids with strength, against exact waves and independent computations."""

import numpy as np
import pytest

from builders import box, march, march_measured, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.strength.laws import Perfect
from shockgrid.problems.references.elastic_plastic import compute_impact, make_solid_at_rest
from shockgrid.problems.references.layers import Layer, LayeredPlates
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.reading import read_deck


def run(deck, *settings):
    """The rows of a run's report by name."""
    problem = read_deck(deck, settings).make_problem()
    history = march_measured(problem, problem.build())
    return {row.name: row for row in problem.report_on(history).rows}


@pytest.mark.parametrize(
    "deck, settings",
    [
        ("elastic-piston", ("speed=200",)),
        ("elastic-piston-copper", ()),
        pytest.param("elastic-piston", (), marks=pytest.mark.slow),
    ],
)
def test_piston_has_both_plateaus_and_fronts_of_the_right_speed(deck, settings):
    rows = run(deck, *settings)
    for name in ("precursor_speed", "precursor_stress"):
        assert rows[name].find_error() < 3e-3, name
    for name in ("stress", "density", "deviator", "place_speed"):
        assert rows[name].find_error() < 1e-3, name
    assert rows["precursor_place_speed"].find_error() < 3e-3
    # out of the foot of the captured shock: some cells ahead
    assert 0.0 < rows["precursor_place"].difference < 0.02


def test_overdriven_piston_has_one_shock_and_the_right_deviator():
    rows = run("elastic-piston-overdriven", "cells=100")
    assert "precursor_speed" not in rows
    assert rows["stress"].find_error() < 1e-3
    assert rows["place"].find_error() < 2e-3
    # an overshoot would unload cells behind the shock for good
    assert rows["deviator"].find_error() < 0.01


def test_without_yield_it_is_the_fluid():
    # a null: a strength that goes to 0 gives the flow of the fluid
    weak = "strength={ law = 'perfect', shear_modulus = 1.0, yield_strength = 0.0 }"
    solid = run("elastic-piston", "cells=40", weak)
    fluid = run("elastic-piston", "cells=40", "strength=false")
    for name in ("stress", "density", "place"):
        assert solid[name].computed == pytest.approx(fluid[name].computed, rel=2e-3), name


@pytest.mark.parametrize(
    "settings, words",
    [
        (("material=air", "strength=true"), "strength is for solids"),
        (("material=diamond", "strength=true"), "it has none"),
        (("strength='glue'",), "no such law of strength, 'glue'"),
        (("strength={ law = 'perfect', shear_modulus = 1e9 }",), "needs yield_strength"),
        (("material=air",), "strength is for solids"),
        (("run.t_end=1",), "the first front meets the end of the solid"),
    ],
)
def test_what_makes_no_solid_is_said_in_one_sentence(settings, words):
    with pytest.raises(BadInput, match=words) as caught:
        read_deck("elastic-piston", settings).make_problem()
    assert "\n" not in str(caught.value)


def test_layers_of_the_reference_code_have_the_exact_waves():
    flyer = make_solid_at_rest(find_material("Al6061"))
    target = make_solid_at_rest(find_material("SS304"))
    plates = LayeredPlates([Layer(flyer, 5e-3, 150, 1000.0), Layer(target, 5e-3, 150)])
    energy = (plates.mass * plates.state.energy).sum()
    momentum = (plates.mass * plates.state.u).sum()
    state = plates.advance_to(0.6e-6)
    exact = compute_impact(flyer, target, 1000.0)
    near = np.abs(state.centres - (5e-3 + exact.u * 0.6e-6)) < 1e-3
    assert state.u[near] == pytest.approx(exact.u, rel=3e-3)
    assert state.stress[near] == pytest.approx(exact.stress, rel=3e-3)
    assert (plates.mass * state.energy).sum() == pytest.approx(energy, rel=1e-12)
    assert (plates.mass * state.u).sum() == pytest.approx(momentum, rel=1e-12)


def test_flying_plate_has_the_release_of_an_elastic_plastic_solid():
    rows = run("flying-plate", "flyer_cells=40", "places=[0.0285, 0.033, 0.036]", "run.t_end=5e-6")
    assert rows["plastic_place"].find_error() < 1e-3
    # plateau of the elastic release, behind the shock, precursor
    assert rows["speed_at_1"].computed == pytest.approx(325.35, rel=1e-3)
    assert rows["speed_at_2"].computed == pytest.approx(400.0, rel=2e-3)
    assert rows["speed_at_3"].computed == pytest.approx(35.178, rel=3e-3)


def test_shell_stops_where_its_energy_is_used_up():
    rows = run("shell-spherical", "cells=24", "rays=6")
    assert rows["stop"].find_error() < 0.01
    assert rows["outer_at_stop"].find_error() < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize("deck", ["shell", "shell-spherical"])
def test_shell_stops_within_half_a_per_cent(deck):
    rows = run(deck, "rays=12")
    assert rows["stop"].find_error() < 5e-3
    assert rows["inner_roundness"].computed < 2e-3


@pytest.mark.slow
def test_bar_of_steel_is_as_long_as_another_code_has_it():
    rows = run("taylor-bar-42crmo4")
    assert rows["length"].find_error() < 3e-3
    assert rows["foot_diameter"].find_error() < 0.015


def test_bar_comes_to_rest_and_has_a_wide_foot():
    rows = run("taylor-bar", "cells=4")
    assert 0.64 < rows["estimate"].computed < 0.72
    assert rows["foot_diameter"].computed > 1.8 * 6.4e-3


def test_a_bar_too_soft_for_its_speed_ends_as_a_sheet():
    law = "law = 'perfect', shear_modulus = 11e9, yield_strength = 5e7"
    settings = "material=Al1100", "speed=500", "cells=3", f"strength={{ {law} }}"
    problem = read_deck("taylor-bar", settings).make_problem()
    flow = problem.build()
    march_measured(problem, flow)
    assert "a sheet that runs along the wall" in flow.finished
    assert flow.t < problem.t_end


@pytest.mark.parametrize("yield_stress", [0.1e9, pytest.param(0.4e9, marks=pytest.mark.slow)])
def test_ripple_stops_at_a_height_as_the_inverse_of_the_flow_stress(yield_stress):
    law = f"law = 'perfect', shear_modulus = 47.7e9, yield_strength = {yield_stress}"
    rows = run("rippled-surface", "cells=16", f"strength={{ {law} }}")
    assert 0.22 < rows["constant"].computed < 0.30


@pytest.mark.slow
def test_heights_at_rest_are_a_straight_line_over_a_decade():
    heights = {}
    for yield_stress in (0.06e9, 0.2e9, 0.6e9):
        law = f"law = 'perfect', shear_modulus = 47.7e9, yield_strength = {yield_stress}"
        rows = run("rippled-surface", f"strength={{ {law} }}")
        load = 8930.0 * 100.0**2 / yield_stress
        heights[load] = rows["k_growth"].computed
    (soft, middle, firm) = heights
    slope = (heights[soft] - heights[firm]) / (soft - firm)
    assert slope == pytest.approx(0.262, rel=0.04)
    line = heights[firm] + slope * (middle - firm)
    assert heights[middle] == pytest.approx(line, rel=0.03)


@pytest.mark.parametrize(
    "deck, settings, words",
    [
        ("taylor-bar", ("strength=false",), "never comes to rest"),
        ("shell", ("strength=false",), "does not stop"),
        ("shell", ("stop=0.09",), "cannot stop at 0.09 m"),
        ("shell", ("outer=0.07",), "smaller than the outer one"),
        ("shell", ("speed=2000",), "reaches the centre"),
        ("rippled-surface", ("start=shock",), "a flat surface does not grow after a shock"),
    ],
)
def test_decks_of_solids_refuse_what_makes_no_sense(deck, settings, words):
    with pytest.raises(BadInput, match=words) as caught:
        read_deck(deck, settings).make_problem()
    assert "\n" not in str(caught.value)


def test_impact_of_two_metals_has_the_exact_contact():
    speed = 1000.0
    length = 6e-3
    cells = 60
    solids = [make_solid_at_rest(find_material(name)) for name in ("Al6061", "SS304")]
    blocks = []
    for name, place, u, solid in (("al", -length, speed, solids[0]), ("ss", 0.0, 0.0, solids[1])):
        nodes = box((place, 0.0), (place + length, 2.0 * length / cells), (cells, 2))
        law = Perfect(solid.shear_modulus, solid.yield_stress)
        blocks.append(Block(name, solid.eos, nodes, solid.rho0, u, 0.0, 0.0, strength=law))
    put(blocks[0], "i_min", "free-surface")
    put(blocks[1], "i_max", "free-surface")
    link = join("interface", (blocks[0], "i_max"), (blocks[1], "i_min"))
    for block in blocks:
        wall_off(block)
    march(Simulation(blocks, [link], t_end=0.7e-6, cfl=0.8))
    exact = compute_impact(*solids, speed)
    for block, near in ((blocks[0], slice(-8, -2)), (blocks[1], slice(2, 8))):
        fields = block.cell_fields
        assert np.median(fields["u"][near]) == pytest.approx(exact.u, rel=1e-3)
        stress = (fields["p"] - fields["s_xx"])[near]
        assert np.median(stress) == pytest.approx(exact.stress, rel=1e-3)


@pytest.mark.parametrize("mode", ["longitudinal", "shear", "surface", "slip"])
def test_waves_of_a_solid_have_their_speed_and_little_damping(mode):
    coarse, fine = (run("elastic-waves", f"mode={mode}", f"cells={cells}") for cells in (16, 32))
    assert fine["speed"].find_error() < 2e-3
    damping = [abs(rows["velocity"].computed - rows["velocity"].theory) for rows in (coarse, fine)]
    assert damping[1] < 0.03
    assert damping[1] < 0.25 * damping[0]  # of second order at least


def test_a_sliding_contact_carries_the_wave_of_a_free_surface():
    surface = run("elastic-waves", "mode=surface", "cells=16")
    slip = run("elastic-waves", "mode=slip", "cells=16")
    assert slip["speed"].computed == pytest.approx(surface["speed"].computed, rel=1e-5)


def test_an_elastic_surface_grows_at_the_rate_of_theory():
    assert run("elastic-waves-growth")["rate"].find_error() < 0.02


@pytest.mark.slow
def test_an_elastic_surface_far_above_the_limit_grows_at_the_rate_of_theory():
    assert run("elastic-waves-growth", "drive=10", "cells=64")["rate"].find_error() < 0.02
