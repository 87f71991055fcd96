"""Sliding contacts: slip under a shock, chains of blocks, cuts that are none, a turning annulus."""

import itertools
import math

import numpy as np
import pytest

from builders import box, check_restarts, find_unexplained, get_bits, march
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.corners import compute_centres

GAS = IdealGas(1.4)
MACH = 2.0
SLIP = 0.7
P_SHOCKED = 1.0 + 2.8 / 2.4 * (MACH**2 - 1.0)
U_PISTON = math.sqrt(1.4) * 2.0 / 2.4 * (MACH - 1.0 / MACH)
ANGLES = (0.0, math.radians(33.0))


def turn_back(pair, angle):
    """Parts of vectors along and across the contact."""
    cosine = math.cos(angle)
    sine = math.sin(angle)
    return cosine * pair[0] + sine * pair[1], cosine * pair[1] - sine * pair[0]


def make_planar(
    angle=0.0,
    ends="periodic",
    speeds=(0.0, SLIP),
    cuts=((), ()),
    swapped=False,
    cells=(40, 57),
    kind="sliding",
):
    """A shock runs upwards through a plane contact on which the two gases slip.

    `speeds` along the contact: a leader's grid goes with it.  `cuts`: where the lower and the
    upper row are cut into blocks joined by seams; a follower's seams should be at rest.
    """
    cosine = math.cos(angle)
    sine = math.sin(angle)

    def turned(along, across):
        return cosine * along - sine * across, sine * along + cosine * across

    links = []
    rows = []
    blocks = []
    for name, n, low, parts, speed in zip(
        ("low", "high"), cells, (-1.0, 0.0), cuts, speeds, strict=True
    ):
        row = []
        for a, b in itertools.pairwise([0, *parts, n]):
            nodes = box((a / n, low), (b / n, low + 1.0), (b - a, 40), angle)
            state = 1.0, *turned(speed, 0.0), 1.0
            row.append(Block(f"{name}{len(row)}", GAS, nodes, *state, material=name))
        links += [
            join("seam", (one, "i_max"), (two, "i_min")) for one, two in itertools.pairwise(row)
        ]
        if ends == "periodic":
            links.append(join("periodic", (row[0], "i_min"), (row[-1], "i_max")))
        else:
            put(row[0], "i_min", "wall")
            put(row[-1], "i_max", "wall")
        rows.append(row)
        blocks += row
    low, high = rows
    for block in low:
        along = 0.0 if swapped else speeds[0]
        put(block, "j_min", "piston", velocity=turned(along, U_PISTON))
    for block in high:
        along = speeds[1] if swapped else 0.0
        put(block, "j_max", "piston", velocity=turned(along, 0.0))
    sides = [(block, "j_max") for block in low], [(block, "j_min") for block in high]
    if kind == "interface":
        links.append(join(kind, sides[0][0], sides[1][0]))
    else:
        links.append(slide(*(sides[::-1] if swapped else sides)))
    return Simulation(blocks, links, t_end=0.5), rows


def check_planar(simulation, rows, angle, speeds):
    ends = [simulation.start_row(), march(simulation)[-1]]
    names = [name.removeprefix("total_") for name in ends[0] if name.startswith("total_")]
    drifts = {name: find_unexplained(ends, name) for name in names}
    assert max(drifts.values()) < 1e-13, drifts
    heights = []
    for row, side, speed in zip(rows, ("j_max", "j_min"), speeds, strict=True):
        for block in row:
            heights.append(turn_back(block.side_line(side, block.nodes), angle)[1])
            along, _ = turn_back(block.state[1:3, 1:-1, 1:-1], angle)
            assert np.abs(along - speed).max() < 1e-12, block.name
    heights = np.concatenate(heights)
    assert np.ptp(heights) < 1e-12
    assert heights.mean() == pytest.approx(0.1152, abs=0.005), "the contact rides on the shock"
    pressure = rows[0][0].state[3, 1:-1, 20].mean()
    assert pressure == pytest.approx(P_SHOCKED, rel=0.01)


@pytest.mark.parametrize("angle", ANGLES, ids=["plane", "inclined"])
@pytest.mark.parametrize("ends, speeds", [("periodic", (0.0, SLIP)), ("walls", (0.0, 0.0))])
def test_planar_sliding(ends, speeds, angle):
    """40 cells against 57: sums kept, contact flat and jump of the tangential speed unchanged."""
    check_planar(*make_planar(angle, ends, speeds), angle, speeds)


def test_matching_nodes_without_slip_are_an_interface():
    states = []
    for kind in ("interface", "sliding"):
        simulation, rows = make_planar(speeds=(0.0, 0.0), cells=(24, 24), kind=kind)
        check_planar(simulation, rows, 0.0, (0.0, 0.0))
        states.append([row[0].state[:, 1:-1, 1:-1].copy() for row in rows])
    for one, two in zip(*states, strict=True):
        assert np.abs(one - two).max() < 1e-10


RADII = (1.0, 2.0, 3.0)
SPEED = 1.0
PRESSURE = 2.0
RATE = SPEED / RADII[1]
HEAVY = 1000.0  # density of the ring: of equal densities the slipping layer would roll up


def make_ring(low, high, cells, around):
    angle = 2.0 * np.pi * np.arange(around + 1) / around
    angle[-1] = 0.0
    radius = np.linspace(low, high, cells + 1)[:, None]
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def compute_annulus_pressure(centres):
    return PRESSURE + 0.5 * RATE**2 * ((centres**2).sum(axis=0) - RADII[1] ** 2)


def make_annulus(cells, turns):
    """`cells` across and 4 `cells` around each; the ring at rest has a quarter fewer around."""
    around = 4 * cells
    around_ring = 3 * cells
    outside = make_ring(RADII[1], RADII[2], cells, around_ring)
    inside = make_ring(RADII[0], RADII[1], cells, around)
    places = np.linspace(0.0, around_ring, around + 1)
    for row, line in zip(inside, outside[:, 0], strict=True):
        row[-1] = np.interp(places, np.arange(around_ring + 1), line)
    centres = compute_centres(inside)
    velocity = RATE * np.array([-centres[1], centres[0]])
    annulus = Block("annulus", GAS, inside, 1.0, *velocity, compute_annulus_pressure(centres))
    ring = Block("ring", GAS, outside, HEAVY, 0.0, 0.0, PRESSURE)
    put(annulus, "i_min", "wall")
    put(ring, "i_max", "wall")
    links = [slide((ring, "i_min"), (annulus, "i_max"))]
    links += [join("seam", (block, "j_min"), (block, "j_max")) for block in (annulus, ring)]
    return Simulation([annulus, ring], links, t_end=turns * 2.0 * np.pi / RATE)


def measure_annulus(cells, turns):
    """Mean errors, relative: pressure in both rings and radius of the contact."""
    simulation = make_annulus(cells, turns)
    march(simulation)
    annulus, ring = simulation.blocks
    exact = compute_annulus_pressure(compute_centres(annulus.nodes))
    found = {}
    for block, pressure in ((annulus, exact), (ring, PRESSURE)):
        miss = np.abs(block.cell_fields["p"] / pressure - 1.0)
        found[block.name] = float((block.volume * miss).sum() / block.volume.sum())
        found[block.name + ", largest"] = float(miss.max())
    radii = np.hypot(*ring.nodes[:, 0])
    found["radius"] = float(np.abs(radii / RADII[1] - 1.0).mean())
    found["radius, largest"] = float(np.abs(radii / RADII[1] - 1.0).max())
    return found


def check_annulus(cells, turns, bar, converging=("annulus", "ring", "radius")):
    coarse = measure_annulus(cells, turns)
    fine = measure_annulus(2 * cells, turns)
    for name in ("annulus", "ring", "radius"):
        assert fine[name] < bar, name
    for name in converging:
        assert math.log2(coarse[name] / fine[name]) >= 1.5, name
    assert fine["radius, largest"] < bar
    assert fine["ring, largest"] < 0.02 and fine["annulus, largest"] < 0.02


def test_annulus_turns_by_a_quarter():
    check_annulus(8, 0.25, 0.01)


@pytest.mark.slow
def test_annulus_turns_once():
    check_annulus(16, 1.0, 0.01, converging=("annulus", "radius"))


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True,
    reason="the mean error of the pressure in the ring at rest falls with order 1.35, not 1.5, as "
    "its worst cell does not fall with finer grids (docs/limits.md)",
)
def test_the_ring_at_rest_converges_while_the_annulus_turns_once():
    check_annulus(16, 1.0, 0.01, converging=("ring",))


def test_restart_goes_on_with_the_same_bits():
    check_restarts(lambda: make_annulus(6, 1.0), [15], steps=15)


def test_threads_give_the_same_bits():
    states = []
    for threads in (1, 2):
        low = Block("low", GAS, box((0.0, -1.0), (1.0, 0.0), (90, 80)), 1.0, 0.0, 0.0, 1.0)
        high = Block("high", GAS, box((0.0, 0.0), (1.0, 1.0), (101, 80)), 1.0, SLIP, 0.1, 1.0)
        high.state[3, 20:40, 1:20] = 3.0
        links = [slide((low, "j_max"), (high, "j_min"))]
        for block, side in ((low, "j_min"), (high, "j_max")):
            links.append(join("periodic", (block, "i_min"), (block, "i_max")))
            put(block, side, "wall")
        simulation = Simulation([low, high], links, t_end=1.0, threads=threads)
        march(simulation, 12)
        states.append(get_bits(simulation))
    assert states[0] == states[1]


def make_pair(shift=(0.0, 0.0)):
    low = Block("low", GAS, box((0.0, -1.0), (1.0, 0.0), (8, 3)), 1.0, 0.0, 0.0, 1.0)
    nodes = box((shift[0], shift[1]), (1.0 + shift[0], 1.0), (5, 3))
    return low, Block("high", GAS, nodes, 1.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("shift", [(0.0, 0.1), (0.3, 0.0)], ids=["above", "beyond the end"])
def test_follower_off_the_leader(shift):
    low, high = make_pair(shift)
    with pytest.raises(BadInput, match=r"nodes of block 'high'.* off the line of block 'low'"):
        slide((low, "j_max"), (high, "j_min"))
