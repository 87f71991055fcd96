"""Keys `strength` and `spall` of decks with bodies: one mechanism for all of them."""

import numpy as np
import pytest

from builders import march as march_steps
from builders import march_measured
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.strength.laws import Perfect
from shockgrid.hydro.strength.spall import CochranBanner, ConstantSpall
from shockgrid.problems.initial_states import make_plane_grid
from shockgrid.problems.references.elastic_waves import compute_wave_speeds
from shockgrid.problems.solids import idealise
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.reading import read_deck

WEAK = "{ law = 'perfect', shear_modulus = 1.0, yield_strength = 0.0 }"
FIRM = "{ law = 'perfect', shear_modulus = 30e9, yield_strength = 1e9 }"
CAVITY = "cavity", ("cells=24", "width=2", "behind=3")
FLYER = "flyer-target", ("plates.0.cells=25", "plates.1.cells=40")
PLATE = "plate-on-wedge", ("cells=[30,9]", "angle=10", "drive.kind=moving", "drive.speed=1500")
METALS = "interface-instability-al-ss304", ("cells=16", "kct_end=4", "handover=false")
TARGET = "conical-target", ("cells=16", "run.t_end=1.2e-6", "filling=Cu")
CONES = *TARGET[1], "cover=0.016"


def march(deck, *settings):
    """A problem, its history and the rows of its report by name."""
    problem = read_deck(deck, settings).make_problem()
    history = march_measured(problem, problem.build())
    return problem, history, {row.name: row.computed for row in problem.report_on(history).rows}


@pytest.mark.parametrize(
    "deck, columns",
    [
        (FLYER, {"pressure": 1e-3, "free_surface_speed": 3e-3}),
        (CAVITY, {"arrival": 2e-3, "near_speed": 0.02}),
        pytest.param(PLATE, {"contact_speed": 5e-3, "pressure": 0.02}, marks=pytest.mark.slow),
        (METALS, {"interface_speed": 1e-4}),
        pytest.param(
            (TARGET[0], CONES), {"impact": 0.03, "peak_impactor": 0.03}, marks=pytest.mark.slow
        ),
    ],
)
def test_strength_that_goes_to_nothing_leaves_the_fluid(deck, columns):
    # a fluid has steeper slopes: fronts of the null test are as far apart as limiters make them
    name, settings = deck
    found = []
    for strength in ("false", WEAK):
        _, history, rows = march(name, *settings, f"strength={strength}")
        found.append([rows.get(column, np.nanmax(history.get(column, 0.0))) for column in columns])
    for column, fluid, weak in zip(columns, *found, strict=True):
        assert weak == pytest.approx(fluid, rel=columns[column]), column


def test_a_rippled_contact_of_metals_grows_less_with_strength_and_least_where_bonded():
    growths = {}
    for contact, strength in (
        ("sliding", "false"),
        ("sliding", WEAK),
        ("sliding", FIRM),
        ("bonded", FIRM),
    ):
        settings = f"strength={strength}", f"line.contact={contact}"
        _, history, _ = march(METALS[0], *METALS[1], *settings)
        growths[contact, strength] = history["amplitude"][-1] - history["amplitude"][0]
    fluid = growths["sliding", "false"]
    assert growths["sliding", WEAK] == pytest.approx(fluid, rel=0.02)
    assert growths["bonded", FIRM] < growths["sliding", FIRM] < 0.98 * fluid


def test_bodies_of_a_deck_have_the_laws_that_it_chooses_for_them():
    laws = read_deck("conical-target", ("strength=true",)).make_problem().laws
    assert laws["shell"].strength.kind == "steinberg-cochran-guinan"
    assert laws["filling"].strength is None  # graphite, of which none is known
    assert all(body.spall is None for body in laws.values())

    chosen = "strength.plate-2=true", "spall.plate-2={law='cochran-banner',stress=1e9,width=1e-5}"
    problem = read_deck("flyer-target", chosen).make_problem()
    assert problem.laws["plate-1"].options == {"strength": None, "spall": None}
    assert isinstance(problem.laws["plate-2"].spall, CochranBanner)
    assert any("plate-1: without a law of strength" in said for said in problem.cautions_on())

    # a key of one body counts before that of all
    own = read_deck("flyer-target", ("strength=true", "plates.0.strength=false")).make_problem()
    assert own.laws["plate-1"].strength is None
    assert own.laws["plate-2"].strength is not None


def test_spall_of_the_library_is_the_tension_of_the_material():
    problem = read_deck("cavity", ("strength=true", "spall=true")).make_problem()
    assert problem.laws.spall == ConstantSpall(problem.material.eos.strength)


def test_spall_of_a_material_file_is_its_law(tmp_path):
    (tmp_path / "own.toml").write_text(
        "[soft]\neos = 'mie-gruneisen'\nsource = 'made up'\nrho0 = 2700.0\nc0 = 5300.0\ns = 1.34\n"
        "gruneisen = 2.0\nstrength = 1e10\n"
        "[soft.strength_law]\nlaw = 'perfect'\nshear_modulus = 27e9\nyield_strength = 3e8\n"
        "[soft.spall_law]\nlaw = 'cochran-banner'\nstress = 1.1e9\nwidth = 2e-5\n"
    )
    settings = f"material={tmp_path / 'own.toml'}:soft", "strength=true", "spall=true"
    assert read_deck("cavity", settings).make_problem().laws.spall == CochranBanner(1.1e9, 2e-5)


def test_a_block_of_a_deck_spalls():
    # a bar whose halves part breaks between them, where its law says so
    table = (
        "{ name = 'bar', cells = [20, 2], p = 0, material = 'Al6061', strength = true, "
        "spall = { law = 'constant', stress = 4e8 }, u = '50*tanh((x - 0.01)*1e3)', curves = "
        "{ i_min = [[0,0],[0,2e-3]], i_max = [[0.02,0],[0.02,2e-3]], "
        "j_min = [[0,0],[0.02,0]], j_max = [[0,2e-3],[0.02,2e-3]] }, "
        "side = [{ side = 'i_min', kind = 'free-surface' }, { side = 'i_max', kind = "
        "'free-surface' }, { side = 'j_min', kind = 'wall' }, { side = 'j_max', kind = 'wall' }] }"
    )
    problem = read_deck("blocks", (f"block=[{table}]", "run.t_end=1e-6")).make_problem()
    flow = problem.build()
    march_measured(problem, flow)
    damage = flow.blocks[0].cell_fields["damage"]
    assert 0 < np.count_nonzero(damage > 0.5) < damage.size
    assert flow.blocks[0].stress.broken_cells > 0


@pytest.mark.parametrize(
    "deck, settings, words",
    [
        ("cavity", ("material=air", "strength=true"), "strength is for solids"),
        ("cavity", ("strength={ law = 'perfect', shear_modulus = 1e9 }",), "needs yield_strength"),
        (
            "cavity",
            ("strength={ law = 'perfect', shear_modulus = 1e9, yield_strength = -1 }",),
            "yield_strength is -1",
        ),
        ("cavity", ("strength={ yield_strength = 1e9 }",), "there is no body 'yield_strength'"),
        ("cavity", ("spall=true",), "wants a law of strength besides"),
        ("flyer-target", ("strength.plate-3=true",), "there is no body 'plate-3'"),
        ("flyer-target", ("strength.plate-1=true", "spall.plate-2=true"), "plate-2 has none"),
        ("flyer-target", ("strength=true", "spall='soft'"), "true, false or a table is wanted"),
        ("plate-on-wedge", ("strength='glue'",), "no such law of strength, 'glue'"),
        ("conical-target", ("strength.cone=true",), "the bodies are impactor, shell"),
        ("interface-instability", ("strength=true",), "'ideal-gas' is a gas"),
        ("interface-instability", ("line.contact=bonded",), "only solids stick together"),
        (METALS[0], ("strength=true", "handover=true"), "whose cells bear no shear"),
        ("blocks", ("strength=true",), "'ideal-gas' is a gas"),
        ("blocks", ("block.0.strength=true",), "'ideal-gas' is a gas"),
    ],
)
def test_strength_that_cannot_be_is_said_in_one_sentence(deck, settings, words):
    with pytest.raises(BadInput, match=words) as caught:
        read_deck(deck, settings).make_problem()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "materials, speed",
    [
        (("Al2024", "Cu"), 500.0),
        (("Cu", "Al2024"), 800.0),
        (("Al6061", "SS304"), 1000.0),
        (("Al6061", "Cu"), 10.0),  # elastic
    ],
)
def test_an_impact_of_two_solids_has_the_exact_stress(materials, speed):
    law = "{ law = 'perfect', shear_modulus = 30e9, yield_strength = 0.25e9 }"
    plates = ", ".join(
        f"{{ material = '{one}', thickness = 2e-3, cells = 80 }}" for one in materials
    )
    settings = f"plates=[{plates}]", f"speed={speed}", f"strength={law}", "run.t_end=4e-7"
    problem, history, _ = march("flyer-target", *settings)
    rows = {row.name: row for row in problem.report_on(history).rows}
    assert rows["pressure"].find_error() < 1e-3


def test_an_elastic_wave_reverberates_in_a_layer_of_another_material():
    law = "{ law = 'perfect', shear_modulus = 30e9, yield_strength = 1e10 }"
    layers = (("Cu", 4e-3, 120), ("Al2024", 1e-3, 60), ("Cu", 4e-3, 120))
    plates = ", ".join(
        f"{{ material = '{name}', thickness = {size}, cells = {cells} }}"
        for name, size, cells in layers
    )
    settings = f"plates=[{plates}]", "speed=1.0", f"strength={law}", "run.t_end=1e-6", "bond=1e10"
    problem, history, _ = march("flyer-target", *settings)
    solids = [
        idealise(material, laws.strength)
        for material, laws in zip(problem.materials, problem.laws.values(), strict=True)
    ]
    speeds = [
        float(compute_wave_speeds(one.eos, one.rho0, 0.0, one.shear_modulus)[0]) for one in solids
    ]
    impedance = [one.rho0 * speed for one, speed in zip(solids, speeds, strict=True)]
    reflected = (impedance[0] - impedance[1]) / (impedance[0] + impedance[1])
    transit = 1e-3 / speeds[1]
    for arrivals in (1, 2, 3):
        # each time that the wave is at the window's face, less is missing of half the speed
        exact = 0.5 * (1.0 - reflected ** (2 * arrivals))
        inside = np.abs(history["t"] - 2 * arrivals * transit) < 0.4 * transit
        found = np.median(history["window_speed"][inside])
        assert found == pytest.approx(exact, rel=1e-3), arrivals


@pytest.mark.parametrize("swing", [0.0, 0.02])  # the grid stands, or moves through the solid
def test_simple_shear_turns_the_stress_as_its_law_says(swing):
    # Jaumann's rate: s_xy = G sin(gamma), s_xx = -s_yy = G (1 - cos(gamma))
    shear_modulus = 1e6  # so soft that its energy leaves the pressure alone
    height = 1e-3
    speed = 300.0
    nodes = make_plane_grid(np.linspace(0.0, height, 9), np.linspace(0.0, height, 9))

    def move(name, t):
        x, y = nodes
        wave = np.sin(2.0 * np.pi * x / height) * np.sin(np.pi * y / height)
        wave[-1] = wave[0]
        return nodes + np.array([swing * height * wave * np.sin(1e6 * t), 0.0 * wave])

    slab = Block(
        "slab",
        find_material("Al2024").eos,
        nodes,
        2785.0,
        lambda x, y: speed * y / height,
        0.0,
        0.0,
        strength=Perfect(shear_modulus, 1e12),
    )
    put(slab, "j_min", "wall", clamped=True)
    put(slab, "j_max", "piston", velocity=(speed, 0.0), clamped=True)
    links = [join("periodic", (slab, "i_min"), (slab, "i_max"))]
    end = 1.5 * height / speed
    flow = Simulation([slab], links, t_end=end, mesh=move)
    march_steps(flow)
    gamma = speed * flow.t / height
    s_xx, s_yy, s_xy = slab.carried[:3, 1:-1, 1:-1]
    assert s_xy == pytest.approx(shear_modulus * np.sin(gamma), abs=5e-3 * shear_modulus)
    assert s_xx == pytest.approx(shear_modulus * (1 - np.cos(gamma)), abs=5e-3 * shear_modulus)
    assert s_yy == pytest.approx(-s_xx, abs=5e-3 * shear_modulus)


def test_five_layers_move_the_window_as_it_was_measured():
    cells = tuple(f"plates.{k}.cells={n}" for k, n in enumerate((20, 13, 20, 67, 40)))
    problem, history, _ = march("flyer-target-five-layers", *cells)
    rows = [row for row in problem.report_on(history).rows if row.name.startswith("trace_at")]
    assert len(rows) == len(problem.deck.trace)
    differences = np.array([row.computed - row.theory for row in rows])
    # the precursor's ramp is in no law of the library
    assert np.sqrt(np.mean(differences**2)) < 0.08 * problem.deck.speed
    # what tells a wall behind the window from a free face
    assert rows[-2].computed == pytest.approx(-44.9, abs=3.0)


@pytest.mark.slow
def test_a_tube_expands_around_slugs_that_part_from_it():
    settings = "block.0.cells=[60,8]", "block.1.cells=[60,4]", "run.t_end=8e-6", "gauge=[]"
    problem = read_deck("blocks-expanding-tube", settings).make_problem()
    flow = problem.build()
    history = march_measured(problem, flow)
    _, tube = flow.blocks
    outside = tube.nodes[1, :, -1]
    middle = np.abs(tube.nodes[0, :, -1] - 0.0254) < 3e-3
    # it bulges where the slugs met, by what measured speeds add up to and half as much again
    assert 1.1e-3 < outside[middle].max() - 9.35e-3 < 2.2e-3
    assert outside[-5:] == pytest.approx(9.35e-3, abs=1e-4)
    # and has left the slug behind it
    assert history["contacts_opened"][-1] > 0
    assert np.ptp(history["total_energy"]) < 1e-12 * history["total_energy"][0]
