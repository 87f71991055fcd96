"""The fast step against the plain one of `tests/reference_step.py`: random blocks, random motion.

Every kind of side, plane and (all but sliding contacts) axisymmetric; rough and smooth states of
gases and of materials that tear; every limiter and both fluxes; a few steps on from each other.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from builders import box
from reference_carried import carry
from reference_sliding import find_points, find_positions
from reference_solid import take_solid_step
from reference_step import take_step
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import OWN_SEGMENTS, put
from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.eos import IdealGas, MieGruneisen, PhaseTransition, StiffenedGas
from shockgrid.hydro.eos.base import REMAINING_DENSITY_PART, make_least_pressure
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER, LIMITERS
from shockgrid.hydro.formulas.riemann import DEFAULT_FLUX
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.strength.laws import JohnsonCook, Perfect
from shockgrid.regrid.measure.corners import compute_centres

GAS = (IdealGas(1.4), 1.2, 1e5)
WATER = (StiffenedGas(4.4, 6e8), 1000.0, 3e8)
METAL = (MieGruneisen(2707.0, 5386.0, 1.339, 1.97), 2800.0, 6e9)
GRAPHITE = (PhaseTransition(), 2500.0, 1e10)
MATERIALS = {"gas": (GAS, GAS), "metal": (METAL, WATER)}
YIELD_STRENGTH = 3e9  # [Pa]: far beyond metals', as the noise is
SOLID_LAWS = (
    Perfect(2.7e10, YIELD_STRENGTH),
    JohnsonCook(2.7e10, YIELD_STRENGTH, 4e9, 0.4, 0.01, 1.0, 2000.0),
)
# of nodes [m]: a tenth of a cell, anew in every step
STEPS = 6
SHAKE = 0.017
OTHERS = "upper", "follower"  # blocks of the second material
EXACT = 1e-12  # of the largest density, sound speed, rho c squared


class Shaken:
    """A mesh law: nodes that shake about where they were, those of linked sides alike."""

    def __init__(self, grids, alike, on_axis, random):
        self.grids = grids
        self.alike = alike
        self.on_axis = on_axis
        self.random = random
        self.shaken = {}

    def __call__(self, name, t):
        if t not in self.shaken:  # a step may be tried again with another dt
            found = {
                key: grid + self.random.uniform(-SHAKE, SHAKE, grid.shape)
                for key, grid in self.grids.items()
            }
            for (one, here), (two, there), shift in self.alike:
                found[two][there] = found[one][here] + np.reshape(shift, (2, 1))
            for key in self.on_axis:
                found[key][1, :, 0] = 0.0
            if "follower" in found:  # its nodes lie on the leader's line
                line = found["leader"][:, :, -1]
                points = found["follower"][:, :, 0]
                for end in (0, -1):
                    if self.grids["follower"][0, end, 0] == self.grids["leader"][0, end, 0]:
                        points[:, end] = line[:, end]
                points[...] = find_points(line, find_positions(line, points))
            self.shaken[t] = found
        return self.shaken[t][name]


def make_state(nodes, material, rough, random):
    """Density, velocities and pressure: noise, or waves a few cells long."""
    eos, rho, p = material
    c = float(eos.sound_speed(rho, p))
    x, y = nodes[:, :-1, :-1]
    numbers = random.uniform(-2.0, 2.0, (4, 3))
    waves = [np.sin(a * x + b * y + phase) for a, b, phase in numbers]
    if rough:
        waves = random.uniform(-1.0, 1.0, (4, *x.shape))
    size = 0.3 if rough else 0.1
    dp = min(0.4 * size * rho * c * c, 0.6 * p)
    return (
        rho * (1.0 + size * waves[0]),
        size * c * waves[1],
        size * c * waves[2],
        p + dp * waves[3],
    )


def make_block(name, materials, nodes, rough, random, **options):
    eos, eos_rho, _ = material = materials[name in OTHERS]
    state = make_state(nodes(name, 0.0), material, rough, random)
    words = f"of {name in OTHERS}"
    first = random.uniform(size=state[0].shape) if rough else 0.5 + 0.4 * np.sin(state[0] / eos_rho)
    fields = [CarriedField("mark", first=first), CarriedField("one", first=0.7)]
    return Block(name, eos, nodes(name, 0.0), *state, material=words, carried=fields, **options)


def make_flow(materials, geometry, rough, limiter=DEFAULT_LIMITER, flux=DEFAULT_FLUX, seed=1):
    """A block below and one above an interface, one beside the lower one, and one alone."""
    random = np.random.default_rng(seed)
    curved = geometry == "axisymmetric"
    low = 0.0 if curved else 0.5
    grids = {
        "lower": box((0.0, low), (1.0, low + 0.8), (6, 5)),
        "upper": box((0.0, low + 0.8), (1.0, low + 1.8), (6, 7)),
        "beside": box((1.0, low), (1.6, low + 0.8), (4, 5)),
        "alone": box((3.0, 1.0), (3.8, 1.9), (5, 6)),
    }
    first_row = np.s_[:, :, 0]
    last_row = np.s_[:, :, -1]
    alike = [
        (("lower", last_row), ("upper", first_row), (0.0, 0.0)),
        (("lower", np.s_[:, -1, :]), ("beside", np.s_[:, 0, :]), (0.0, 0.0)),
        (("lower", last_row), ("upper", first_row), (0.0, 0.0)),
    ]
    if not curved:
        alike += [(("alone", first_row), ("alone", last_row), (0.0, 0.9))]
    nodes = Shaken(grids, alike, ("lower", "beside") if curved else (), random)
    options = {"limiter": limiter, "flux": flux}
    blocks = [make_block(name, materials, nodes, rough, random, **options) for name in grids]
    lower, upper, beside, alone = blocks
    (eos, rho, p), (other, other_rho, other_p) = materials
    c = float(eos.sound_speed(rho, p))
    other_c = float(other.sound_speed(other_rho, other_p))
    links = [
        join("interface", (lower, "j_max"), (upper, "j_min")),
        join("seam", (lower, "i_max"), (beside, "i_min")),
    ]
    stream = rho * np.linspace(0.9, 1.1, 5), 0.2 * c, 0.1 * c, p
    put(lower, "i_min", "inflow", state=stream, carried={"mark": 0.2, "one": 0.7})
    put(lower, "j_min", "axis" if curved else "wall")
    put(beside, "j_min", "axis" if curved else "wall")
    put(beside, "i_max", "outflow")
    put(beside, "j_max", "piston", velocity=lambda t: (0.0, -0.2 * c))
    put(upper, "i_min", "wall", 0, 3)
    put(upper, "i_min", "free-surface", 3, pressure=1.1 * other_p)
    put(upper, "i_max", "piston", velocity=(-0.1 * other_c, 0.0))
    put(upper, "j_max", "free-surface", pressure=lambda t: 0.9 * other_p)
    put(alone, "i_min", "outflow")
    put(alone, "i_max", "wall")
    if curved:
        put(alone, "j_min", "wall")
        put(alone, "j_max", "outflow")
    else:
        links.append(join("periodic", (alone, "j_min"), (alone, "j_max")))
    return Simulation(blocks, links, t_end=1e9, mesh=nodes, geometry=geometry, cfl=0.4)


def make_sliding_flow(materials, rough):
    """Two blocks that slide on each other.

    The follower covers all of a gas; a condensed leader goes on, as a free surface, at one end.
    """
    random = np.random.default_rng(1)
    gas = materials is MATERIALS["gas"]
    grids = {
        "leader": box((0.0, 0.0), (1.0, 0.8), (6, 5)),
        "follower": box((0.0, 0.8), (1.0 if gas else 0.87, 1.8), (8, 6)),
    }
    nodes = Shaken(grids, [], (), random)
    blocks = [make_block(name, materials, nodes, rough, random) for name in grids]
    contact = slide((blocks[0], "j_max"), (blocks[1], "j_min"))
    for block, side in zip(blocks, ("j_min", "j_max"), strict=True):
        put(block, "i_min", "wall")
        put(block, "i_max", "outflow")
        put(block, side, "outflow")
    return Simulation(blocks, [contact], t_end=1e9, mesh=nodes, cfl=0.4)


def hold(block):
    """What the reference needs of a block before a step."""
    names = "nodes", "state", "void_energy", "carried"
    kept = {name: getattr(block, name).copy() for name in names}
    others = "eos", "limiter", "flux_name", "segments", "strength", "wave_law"
    return SimpleNamespace(**kept, **{name: getattr(block, name) for name in others})


def check_cells(block, state, void, by_mass=False):
    """A block has the state (4, ni, nj) and the void energies of the reference, to round-off."""
    rho = state[0].max()
    c2 = block.eos.sound_speed(state[0], state[3]).max() ** 2
    got = *block.state[:, 1:-1, 1:-1], block.void_energy
    sizes = rho, c2**0.5, c2**0.5, rho * c2, c2
    weight = state[0] / rho if by_mass else 1.0
    weights = 1.0, weight, weight, 1.0, weight
    for fast, plain, size, weight in zip(got, (*state, void), sizes, weights, strict=True):
        if by_mass:  # emptied cells are thrown about faster than sound
            size = max(size, np.abs(weight * plain).max())
        assert (weight * np.abs(fast - plain)).max() <= EXACT * size, block.name


def make_solid_flow(law, rough, seed=1):
    """Two blocks of metal with a seam, one that is bonded to them, one that slips; one alone."""
    random = np.random.default_rng(seed)
    grids = {
        "lower": box((0.0, 0.5), (1.0, 1.3), (6, 5)),
        "beside": box((1.0, 0.5), (1.6, 1.3), (4, 5)),
        "upper": box((0.0, 1.3), (1.0, 2.3), (6, 7)),
        "top": box((0.0, 2.3), (1.0, 3.1), (6, 5)),
        "alone": box((3.0, 1.0), (3.8, 1.9), (5, 6)),
    }
    first_row = np.s_[:, :, 0]
    last_row = np.s_[:, :, -1]
    seam = (("lower", np.s_[:, -1, :]), ("beside", np.s_[:, 0, :]), (0.0, 0.0))
    alike = [
        (("lower", last_row), ("upper", first_row), (0.0, 0.0)),
        (("upper", last_row), ("top", first_row), (0.0, 0.0)),
        seam,
        (("lower", last_row), ("upper", first_row), (0.0, 0.0)),
        (("alone", first_row), ("alone", last_row), (0.0, 0.9)),
    ]
    nodes = Shaken(grids, alike, (), random)
    eos, rho, p = METAL
    eos = eos.with_heat_capacity(900.0)
    c = float(eos.sound_speed(rho, p))
    blocks = []
    for name in grids:
        state = make_state(nodes(name, 0.0), (eos, rho, 0.5 * p), rough, random)
        x, y = compute_centres(nodes(name, 0.0))
        waves = [np.sin(a * x - b * y) for a, b in random.uniform(-4.0, 4.0, (3, 2))]
        fields = [
            CarriedField(field, "Pa", first=0.4 * YIELD_STRENGTH * wave)
            for field, wave in zip(("s_xx", "s_yy", "s_xy"), waves, strict=True)
        ]
        options = {"strength": law, "carried": fields, "material": name}
        blocks.append(Block(name, eos, nodes(name, 0.0), *state, **options))
    lower, beside, upper, top, alone = blocks
    links = [
        join("seam", (lower, "i_max"), (beside, "i_min")),
        join("interface", (lower, "j_max"), (upper, "j_min"), bonded=True),
        join("interface", (upper, "j_max"), (top, "j_min")),
        join("periodic", (alone, "j_min"), (alone, "j_max")),
    ]
    put(lower, "i_min", "wall", clamped=True)
    put(lower, "j_min", "wall")
    put(beside, "j_min", "piston", velocity=(0.1 * c, 0.05 * c), clamped=True)
    put(beside, "i_max", "outflow")
    put(beside, "j_max", "piston", velocity=lambda t: (0.0, -0.1 * c))
    put(upper, "i_min", "wall", 0, 3)
    put(upper, "i_min", "free-surface", 3, pressure=0.2 * p)
    put(upper, "i_max", "free-surface")
    put(top, "i_min", "wall")
    put(top, "i_max", "outflow")
    put(top, "j_max", "free-surface", pressure=lambda t: 0.3 * p)
    put(alone, "i_min", "free-surface")
    put(alone, "i_max", "wall")
    return Simulation(blocks, links, t_end=1e9, mesh=nodes, cfl=0.4)


@pytest.mark.parametrize("rough", [False, True], ids=["smooth", "rough"])
@pytest.mark.parametrize("law", SOLID_LAWS, ids=lambda law: law.kind)
def test_fast_step_of_solids_is_the_plain_one(law, rough):
    simulation = make_solid_flow(law, rough)
    plastic = torn = 0
    for _ in range(STEPS):
        start = simulation.t
        given = [hold(block) for block in simulation.blocks]
        row = simulation.advance()
        for block, now in zip(given, simulation.blocks, strict=True):
            block.nodes_new = now.nodes
            block.is_first_order = now.kernels.is_first_order
        found = take_solid_step(given, simulation.exchange.links, start, row["dt"])
        for block, (state, void, carried) in zip(simulation.blocks, found, strict=True):
            fields = block.get_inside("carried")
            assert np.abs(fields[:3] - carried[:3]).max() <= EXACT * law.modulus, block.name
            assert np.abs(fields[3] - carried[3]).max() <= EXACT, block.name
            check_cells(block, state, void)
            plastic += np.count_nonzero(carried[3])
            torn += np.count_nonzero(void)
    assert plastic > 0
    assert torn > 0


def follow(simulation, by_mass=False):
    """March with the reference beside each step; kinds of sides, retries and torn cells seen.

    by_mass: velocities and void energies count by the density, as momenta and energies do.
    """
    torn = retries = 0
    for _ in range(STEPS):
        start = simulation.t
        given = [hold(block) for block in simulation.blocks]
        row = simulation.advance()
        retries += row["retries"]
        for block, now in zip(given, simulation.blocks, strict=True):
            block.nodes_new = now.nodes
            block.is_first_order = now.kernels.is_first_order
        exchange = simulation.exchange
        curved = simulation.geometry.curved
        contacts = exchange.contacts
        found = take_step(given, exchange.links, start, row["dt"], curved, contacts, carry)
        for block, (state, void, carried) in zip(simulation.blocks, found, strict=True):
            if not contacts:
                assert np.abs(block.carried[:, 1:-1, 1:-1] - carried).max(initial=0.0) <= EXACT
            check_cells(block, state, void, by_mass)
            torn += np.count_nonzero(void)
    return torn, retries


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("geometry", "flux"),
    [("plane", "hllc"), ("axisymmetric", "hll"),
     pytest.param("plane", "hll", marks=pytest.mark.slow),
     pytest.param("axisymmetric", "hllc", marks=pytest.mark.slow)],
)  # fmt: skip
def test_emptied_cells_keep_what_they_have_in_both(geometry, flux):
    """Cells of fragments at one to three times the least density, also at a seam and an outflow."""
    simulation = make_flow(MATERIALS["metal"], geometry, rough=False, flux=flux)
    random = np.random.default_rng(3)
    simulation.advance()
    eos = METAL[0]
    for block in simulation.blocks:
        if block.name in OTHERS:
            continue
        rho, u, v, p = block.state[:, 1:-1, 1:-1]
        shape = rho[:, 1:4].shape
        rho[:, 1:4] = REMAINING_DENSITY_PART * eos.rho0 * random.uniform(1.0, 3.0, shape)
        u[:, 1:4] = 100.0 * random.uniform(-1.0, 1.0, shape)
        v[:, 1:4] = 100.0 * random.uniform(-1.0, 1.0, shape)
        p[:, 1:4] = make_least_pressure(type(eos))(rho[:, 1:4], eos.parameters)
        block.void_energy[:, 1:4] = -eos.energy(rho[:, 1:4], p[:, 1:4])
    torn, _ = follow(simulation, by_mass=True)
    assert torn > 0


@pytest.mark.kernels
@pytest.mark.parametrize("rough", [False, True], ids=["smooth", "rough"])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize("materials", MATERIALS)
def test_fast_step_is_the_plain_one(materials, geometry, rough):
    torn, _ = follow(make_flow(MATERIALS[materials], geometry, rough))
    assert (torn > 0) == (materials == "metal")  # the solid was torn in the shaking


@pytest.mark.kernels
@pytest.mark.parametrize("rough", [False, True], ids=["smooth", "rough"])
@pytest.mark.parametrize("materials", MATERIALS)
def test_fast_step_is_the_plain_one_where_blocks_slide(materials, rough):
    follow(make_sliding_flow(MATERIALS[materials], rough))


@pytest.mark.kernels
@pytest.mark.parametrize("limiter", [name for name in LIMITERS if name != DEFAULT_LIMITER])
def test_fast_step_is_the_plain_one_with_every_limiter(limiter):
    follow(make_flow(MATERIALS["gas"], "plane", False, limiter))


@pytest.mark.kernels
def test_fast_step_is_the_plain_one_in_a_material_with_kinks():
    """Neither has the slopes of the default limiter there."""
    follow(make_flow((GRAPHITE, GAS), "plane", False))


@pytest.mark.kernels
def test_fast_step_is_the_plain_one_with_hll_alone():
    follow(make_flow(MATERIALS["gas"], "plane", True, flux="hll"))


def test_every_kind_of_side_is_there():
    flows = [make_flow(MATERIALS["gas"], geometry, False) for geometry in ("plane", "axisymmetric")]
    flows += [make_sliding_flow(MATERIALS["gas"], False)]
    kinds = {s.kind for flow in flows for block in flow.blocks for s in block.segments}
    assert kinds == set(OWN_SEGMENTS)
