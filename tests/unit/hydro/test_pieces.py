"""Pieces of two lines whose nodes do not match: owners, areas, budgets of the closing faces."""

import numpy as np
import pytest

from builders import free, march
from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas, StiffenedGas
from shockgrid.hydro.facets.lines import fill_line_slopes
from shockgrid.hydro.facets.rows import (
    AREAS,
    CLOSED,
    EXCESS_FOLLOWER,
    EXCESS_LEADER,
    FACET_P,
    FACET_SLIP,
    FOLLOWER,
    LEADER,
    STATE_C,
    make_facets,
    make_line_arrays,
)
from shockgrid.hydro.facets.states import make_add_facet_flux, solve_facets
from shockgrid.hydro.formulas.geometry import find_geometry
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.rows import HOOP, MOMENTUM_Y, PUSH, RHO, U, V
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.sliding.pieces import fill_pieces, fill_points

SEEDS = range(3)


def make_line(random, faces):
    """A wavy line of unequal faces that does not fold back."""
    x = np.cumsum(np.concatenate(([0.0], 0.2 + random.random(faces))))
    return np.array([x / x[-1], 0.1 * random.random(faces + 1) + 0.2 * np.sin(4.0 * x / x[-1])])


def make_places(random, faces, count, whole):
    """Places of follower nodes on a line of `faces` faces, some of them at its nodes."""
    places = np.sort(random.random(count) * faces)
    places[count // 2] = round(places[count // 2])
    places = np.unique(places)
    if whole:
        places[0] = 0.0
        places[-1] = faces
    return places


def cut(line, places, turn=1.0, moved=None, inverse_dt=0.0, curved=False):
    pieces = make_facets(line.shape[1] + places.size + 2, curved)
    moved = np.zeros_like(line) if moved is None else moved
    count = fill_pieces(line, moved, places, turn, inverse_dt, pieces)
    return pieces, count


@pytest.mark.parametrize("whole", [True, False], ids=["whole cover", "part"])
@pytest.mark.parametrize("seed", SEEDS)
def test_pieces_are_the_common_refinement(seed, whole):
    random = np.random.default_rng(seed)
    line = make_line(random, 13)
    places = make_places(random, 13, 29, whole)
    pieces, count = cut(line, places)
    owners = pieces.owners[:, :count]
    faces = pieces.geometry[:, :count]
    bounds = np.unique(np.concatenate((np.arange(14.0), places)))
    assert owners.shape[1] == bounds.size - 1
    middles = 0.5 * (bounds[1:] + bounds[:-1])
    follower = np.searchsorted(places, middles) - 1
    follower[(middles < places[0]) | (middles > places[-1])] = -1
    assert np.array_equal(owners[0], middles.astype(int))
    assert np.array_equal(owners[1], follower)
    # the pieces of a leader's face add up to it, those of a follower's face to its chord
    steps = np.diff(line, axis=1)
    points = np.empty((2, places.size))
    fill_points(line, places, points)
    for side, chords in ((0, steps), (1, np.diff(points, axis=1))):
        for face in range(chords.shape[1]):
            mine = owners[side] == face
            assert faces[0, mine].sum() == pytest.approx(chords[1, face], abs=1e-14)
            assert faces[1, mine].sum() == pytest.approx(-chords[0, face], abs=1e-14)
    at_middles = np.empty((2, middles.size))
    fill_points(line, middles, at_middles)
    assert np.abs(faces[3:5] - at_middles).max() < 1e-14


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_what_one_side_gives_the_other_takes(seed, geometry):
    random = np.random.default_rng(seed)
    line = make_line(random, 13)
    places = make_places(random, 13, 29, True)
    curved = geometry == "axisymmetric"
    pieces, count = cut(line, places, 1.0, 0.1 * random.random((2, 14)), 1.0, curved)
    pieces.contact_states[FACET_P] = random.random(pieces.contact_states.shape[1])
    pieces.contact_states[CLOSED] = 1.0
    pieces.areas[...] = pieces.geometry[AREAS] * (2.0 if curved else 1.0)
    add_facet_flux = make_add_facet_flux(find_geometry(geometry))
    lines = [make_line_arrays(np.ones((3, n))) for n in (13, places.size - 1)]
    for side, half in zip((LEADER, FOLLOWER), lines, strict=True):
        add_facet_flux(pieces, count, side, half)
    leader, follower = (half.flux for half in lines)
    assert np.abs(leader.sum(axis=1) + follower.sum(axis=1)).max() < 1e-15
    assert not leader[0].any() and not follower[0].any()
    for row in (MOMENTUM_Y, PUSH, HOOP):  # the pressure's part of y is in one or in the others
        assert (np.abs(leader[row]).max() > 1e-3) == (curved != (row == MOMENTUM_Y))


def test_contact_does_not_pull():
    line = np.array([[0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 0.0]])
    pieces, count = cut(line, np.array([0.0, 1.0, 2.0]), turn=-1.0)  # outwards: +y
    rho = 2.0
    c = 3.0
    law = np.reshape((1.5, 1.5, 0.0), (3, 1))
    mine = make_line_arrays(np.repeat(law, 3, axis=1))
    other = make_line_arrays(np.repeat(law, 2, axis=1))
    for half, nodes in ((mine, line), (other, line[:, :3])):
        half.states[RHO] = rho
        half.states[STATE_C] = c
        fill_line_slopes(nodes, half)
    other.states[U] = 5.0
    other.states[V] = 0.1, -0.1  # the first flies off, the second comes
    closed, pulled = solve_facets(mine, other, pieces, count, 0.0, 0.0)
    assert (count, closed, pulled) == (3, 1, 1)
    found = pieces.contact_states[:, :count]
    assert found[CLOSED].tolist() == [0.0, 1.0, 0.0]
    assert found[FACET_P, 0] == 0.0 and found[FACET_P, 2] == 0.0
    excess = found[[EXCESS_LEADER, EXCESS_FOLLOWER]]
    assert not excess[:, 0].any(), "each goes on with its own speed"
    assert excess[:, 1] == pytest.approx([-0.05, 0.05])
    assert found[FACET_P, 1] == pytest.approx(rho * 0.05 * (c + 1.5 * 0.05), rel=1e-3)
    assert found[FACET_SLIP, :2] == pytest.approx(5.0)


STREAM = 0.4, 0.3


def make_wavy_contact(ends, stream, cells=((24, 8), (17, 6))):
    """Two gases of one pressure on a wavy contact, moving with one velocity; leader below."""
    u, v = stream
    blocks = []
    for name, (ni, nj), rho, low in (("low", cells[0], 1.0, True), ("high", cells[1], 3.0, False)):
        s = np.linspace(0.0, 1.0, ni + 1)
        x = 2.0 * (s + 0.05 * np.sin(2.0 * np.pi * s))
        contact = 0.15 * np.sin(np.pi * x)
        if not low:  # on the leader's chords
            below = blocks[0].nodes[:, :, -1]
            contact = np.interp(x, *below)
        across = np.linspace(0.0, 1.0, nj + 1)
        bottom, top = (np.full_like(x, -1.0), contact) if low else (contact, np.full_like(x, 1.0))
        y = bottom[:, None] + (top - bottom)[:, None] * across
        nodes = np.array([np.repeat(x[:, None], nj + 1, 1), y])
        blocks.append(Block(name, IdealGas(1.4 if low else 1.67), nodes, rho, u, v, 1.0))
    low, high = blocks
    contact = slide((low, "j_max"), (high, "j_min"))
    links = [contact]
    put(low, "j_min", "piston", velocity=stream)
    put(high, "j_max", "piston", velocity=stream)
    for block in blocks:
        if ends == "periodic":
            links.append(join("periodic", (block, "i_min"), (block, "i_max")))
        else:
            put(block, "i_min", "piston", velocity=stream)
            put(block, "i_max", "piston", velocity=stream)
    return Simulation(blocks, links, t_end=1e9), contact


@pytest.mark.parametrize("ends", ["periodic", "walls"])
def test_free_stream_while_the_follower_slides_on_a_curve(ends):
    simulation, _ = make_wavy_contact(ends, STREAM)
    low, high = simulation.blocks
    (follower,) = simulation.motion.sides.followers
    first = follower.spacing.copy()
    moved = 0.0
    for step in range(100):
        follower.spacing = first + 0.1 * np.sin(np.pi * first) * np.sin(0.25 * step)
        simulation.advance()
        moved = max(moved, float(np.abs(follower.spacing - first).max()))
    assert moved > 2.0 / low.ni, "the nodes have passed two of the leader's"
    for block, rho in ((low, 1.0), (high, 3.0)):
        for row, value in enumerate((rho, *STREAM, 1.0)):
            assert np.abs(block.state[row, 1:-1, 1:-1] - value).max() < 1e-13, (block.name, row)


@pytest.mark.kernels
def test_free_stream_with_partial_cover():
    metal = StiffenedGas(4.4, 1.0)
    x = np.linspace(0.0, 2.0, 25)
    across = np.linspace(0.0, 1.0, 9)
    curve = 0.1 * np.sin(3.0 * x)
    x_follower = np.linspace(0.53, 1.41, 18)
    curve_follower = np.interp(x_follower, x, curve)
    below = -1.0 + (curve[:, None] + 1.0) * across
    above = curve_follower[:, None] + (0.6 - curve_follower[:, None]) * across
    grids = [
        np.array([np.repeat(a[:, None], 9, 1), b]) for a, b in ((x, below), (x_follower, above))
    ]
    low = Block("low", metal, grids[0], 1.0, *STREAM, 0.0)
    high = Block("high", metal, grids[1], 2.0, *STREAM, 0.0)
    contact = slide((low, "j_max"), (high, "j_min"))
    for block in (low, high):
        free(block)
    simulation = Simulation([low, high], [contact], t_end=1e9)
    march(simulation, 50)
    assert (contact.fixed == -1).all()
    for block, rho in ((low, 1.0), (high, 2.0)):
        for row, value in enumerate((rho, *STREAM, 0.0)):
            assert np.abs(block.state[row, 1:-1, 1:-1] - value).max() < 2e-13, (block.name, row)


@pytest.mark.parametrize("ends", ["periodic", "walls"])
def test_sums_are_kept_while_the_follower_slides_on_a_curve(ends):
    simulation, _ = make_wavy_contact(ends, (0.0, 0.0))
    low, high = simulation.blocks
    high.state[1, 1:-1, 1:-1] = 0.5  # slips over the waves of the line
    high.state[3, 1:-1, 3] = 2.0
    simulation.exchange.divide_contacts()
    for block in simulation.blocks:
        phases.update(block, 0.0)
    simulation.clock.rate = max(block.find_rate() for block in simulation.blocks)
    start = simulation.start_row()
    (follower,) = simulation.motion.sides.followers
    first = follower.spacing.copy()
    for step in range(60):
        follower.spacing = first + 0.1 * np.sin(np.pi * first) * np.sin(0.25 * step)
        row = simulation.advance()
    masses = {block.name: (block.volume * block.cell_fields["rho"]).sum() for block in (low, high)}
    for name, mass in masses.items():
        assert mass == pytest.approx(start[f"total_mass_{name}"], rel=1e-13)
    for what in ("momentum_x", "momentum_y", "energy"):
        drift = row[f"total_{what}"] - row[f"boundary_{what}"] - start[f"total_{what}"]
        assert abs(drift) < 1e-13 * start["total_energy"], what


def test_fields_may_be_functions_of_the_centres():
    x, y = np.meshgrid(np.linspace(0.0, 2.0, 4), np.linspace(0.0, 1.0, 3), indexing="ij")
    nodes = np.array([x + 0.1 * y, y])
    block = Block("air", IdealGas(1.4), nodes, lambda x, y: 1.0 + x * y, 0.0, lambda x, y: y, 1.0)
    centre_x, centre_y = block.centres
    assert block.centres.shape == (2, 3, 2)
    assert np.allclose(centre_x[0], [(2.0 / 3.0) / 2.0 + 0.025, (2.0 / 3.0) / 2.0 + 0.075])
    assert np.array_equal(block.state[RHO, 1:-1, 1:-1], 1.0 + centre_x * centre_y)
    assert np.array_equal(block.state[V, 1:-1, 1:-1], centre_y)
