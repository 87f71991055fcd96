"""Contacts of bodies and the motion of lines against the plain ones of
`tests/reference_contact.py`: lines with kinks whose nodes do not match, random states."""

import numpy as np
import pytest

from builders import box, free, make_body
from reference_contact import BodyContact, move_nodes, respace_nodes
from shockgrid.hydro import phases
from shockgrid.hydro.motion.line import MOST_RESPACED_PART, move_parallel_to_neighbours
from shockgrid.hydro.rim import CONTACT, FLUX, LENGTH, RHO, TRACE, C
from shockgrid.hydro.rows import U, V
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.step import fill_states_beyond, find_contact_speeds, move_boundaries

EXACT = 1e-12
FRICTION = 0.3
DT = 1e-9
CELL = 1e-4
# of a trace's rows: rho, u, v, p, c²
STATE_ROWS = [0, 1, 2, 3, 6]


def make_bodies(random):
    """A body that lies on a longer one, whose line has kinks; their states are random."""
    nodes = box((-4.5 * CELL, -3 * CELL), (4.5 * CELL, 0.0), (9, 3))
    nodes[1, :, -1] += 0.008 * CELL * random.uniform(-1.0, 1.0, 10)
    line = nodes[:, :, -1]
    base = make_body("base", "Al1100", nodes)
    x = np.sort(random.uniform(-0.4, 0.4, 8) + np.linspace(-3.0, 3.0, 8)) * CELL
    above = box((x[0], 0.0), (x[-1], 3 * CELL), (7, 3))
    above[0] = x[:, None]
    above[1, :, 0] = np.interp(x, *line)
    top = make_body("top", "Cu", above)
    for block in (base, top):
        free(block, friction=FRICTION)
        _, u, v, p = block.state[:, 1:-1, 1:-1]
        u[...] = random.uniform(-50.0, 50.0, u.shape)
        v[...] = random.uniform(-30.0, 30.0, u.shape)
        p[...] = random.uniform(0.0, 2e9, u.shape)
    return base, top


@pytest.fixture(params=[0, 2, 3])
def contact(request):
    """The flow of two bodies before its first step, the pair of their surfaces that lie on each
    other, and the plain contact of their traces."""
    base, top = make_bodies(np.random.default_rng(request.param))
    simulation = Simulation([base, top], [], t_end=1e-6)
    simulation.meetings.find(0.0, 0)
    flow = simulation.flow
    fill_states_beyond(flow, DT)
    find_contact_speeds(flow, DT)
    (pair,) = simulation.meetings.with_facets
    return flow, pair


def make_plain(pair, lines):
    sides = pair.leader, pair.follower
    states = [side.gather(TRACE)[STATE_ROWS] for side in sides]
    laws = [side.block.eos.wave_law for side in sides]
    return BodyContact(lines, states, laws)


def check(found, wanted):
    assert np.abs(found - wanted).max() <= EXACT * np.abs(wanted).max()


def test_what_moves_the_lines(contact):
    """Pressures and normal speeds of all faces, closed, free or in part."""
    _, pair = contact
    plain = make_plain(pair, (pair.leader.line, pair.follower.line))
    assert pair.count == plain.leader.size
    assert pair.closed == plain.closed.sum()
    assert 0 < pair.closed < pair.count
    for number, side in enumerate((pair.leader, pair.follower)):
        pressure, speed = plain.cover(number)
        p_star, w_star = side.gather(CONTACT)[:2]
        check(p_star, pressure)
        check(w_star, speed)


def test_what_passes(contact):
    """Momentum, energy and friction through moved facets: lines stretched and turned."""
    flow, pair = contact
    turning = np.array([[1e-3, 2e-3], [-1e-3, -2e-3]])
    for block in flow.blocks:
        block.nodes_new[...] = block.nodes + np.tensordot(turning, block.nodes, 1)
        phases.trace(block, DT)
    for coupling in flow.couplings:
        coupling.fill_fluxes(0.5 * DT, DT)
    sides = pair.leader, pair.follower
    plain = make_plain(pair, [line + 0.5 * turning @ line for line in (s.line for s in sides)])
    cells = [side.gather_cells()[[RHO, U, V, C, LENGTH]] for side in sides]
    fluxes = plain.find_fluxes(turning @ pair.leader.line, DT, FRICTION, cells)
    for side, wanted in zip(sides, fluxes, strict=True):
        check(side.gather(FLUX)[1:4], wanted)


def test_nodes_between_their_faces(contact):
    """Inner nodes go with the speeds of the faces beside them, before they are spread or laid."""
    flow, pair = contact
    move_boundaries(flow, DT, 1.0)
    for side in (pair.leader, pair.follower):
        found = side.moving_line.moved[:, :: side.step][:, 1:-1]
        wanted = move_nodes(side.line, side.gather(CONTACT)[2:4], DT)
        inner = side.line[:, 1:-1]
        check(found - inner, wanted - inner)


def test_nodes_along_a_body():
    random = np.random.default_rng(7)
    line = np.cumsum(random.uniform(-0.3, 1.0, (2, 30)), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line)))])
    positions = np.linspace(0.0, arc[-1], 30)
    moved = line.copy()
    move_parallel_to_neighbours(line, arc, positions, moved)
    check(moved[:, 1:-1], respace_nodes(line, positions, MOST_RESPACED_PART))
