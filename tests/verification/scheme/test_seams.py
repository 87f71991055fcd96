"""The same flow cut into 1, 2 and 4 blocks by seams is the same to the last bit."""

import numpy as np
import pytest

from builders import box, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas, MieGruneisen
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.measure.corners import compute_centres

NI = 40
NJ = 36
CUTS = {
    "halves along i": ((0, 17, NI), (0, NJ)),
    "halves along j": ((0, NI), (0, 15, NJ)),
    "quarters": ((0, 17, NI), (0, 15, NJ)),
}
FLUIDS = {
    "ideal gas": (IdealGas(1.4), 1.0, 1.0, 1.0),
    "metal": (MieGruneisen(2.707, 5.386, 1.339, 1.97), 2.707, 20.0, 5.386),
}


LOWEST = {"plane": 0.0, "axisymmetric": 0.5}  # y of the box


def place_all(t, geometry="plane"):
    """A grid that bends and swings."""
    x, y = box((0, 0), (1, 1), (NI, NJ))
    swing = 0.06 + 0.04 * np.sin(9.0 * t)
    wave = np.sin(np.pi * x) * np.sin(np.pi * y)
    return np.array([x + swing * wave, y - swing * wave + LOWEST[geometry]])


def make_flow(cut_i, cut_j, fluid, geometry):
    """A blast in a box, cut at the given lines."""
    eos, rho0, p0, c = FLUIDS[fluid]
    centre = compute_centres(place_all(0.0))
    hot = np.hypot(centre[0] - 0.4, centre[1] - 0.45) < 0.15
    rho = np.where(hot, 1.2, 1.0) * rho0
    p = np.where(hot, 6.0, 0.5) * p0
    u, v = 0.1 * c * np.sin(3.0 * centre[1]), 0.05 * c * np.cos(4.0 * centre[0])
    blocks = {}
    spans = {}
    for a in range(len(cut_i) - 1):
        for b in range(len(cut_j) - 1):
            i = slice(cut_i[a], cut_i[a + 1])
            j = slice(cut_j[b], cut_j[b + 1])
            nodes = place_all(0.0, geometry)[:, i.start : i.stop + 1, j.start : j.stop + 1]
            name = f"{a}{b}"
            spans[name] = i, j
            fields = [field[i, j] for field in (rho, u, v, p)]
            blocks[a, b] = Block(name, eos, nodes, *fields, material="all")
    links = []
    for (a, b), block in blocks.items():
        for side, ahead in (("i_max", (a + 1, b)), ("j_max", (a, b + 1))):
            if ahead in blocks:
                links.append(
                    join("seam", (block, side), (blocks[ahead], side.replace("max", "min")))
                )
    for block in blocks.values():
        wall_off(block)

    def law(name, t):
        i, j = spans[name]
        return place_all(t, geometry)[:, i.start : i.stop + 1, j.start : j.stop + 1]

    flow = Simulation(list(blocks.values()), links, t_end=1.0, mesh=law, geometry=geometry)
    return flow, spans


def collect(simulation, spans):
    whole = np.empty((4, NI, NJ))
    for block in simulation.blocks:
        i, j = spans[block.name]
        whole[:, i, j] = block.state[:, 1:-1, 1:-1]
    return whole


@pytest.mark.parametrize(
    ("fluid", "geometry"),
    [("ideal gas", "plane"), ("metal", "plane"), ("ideal gas", "axisymmetric")],
)
def test_cut_flow_has_the_same_bits(fluid, geometry):
    states = {}
    for name, cuts in {"whole": ((0, NI), (0, NJ)), **CUTS}.items():
        simulation, spans = make_flow(*cuts, fluid, geometry)
        march(simulation, 30)
        states[name] = (simulation.t, collect(simulation, spans))
    t, whole = states.pop("whole")
    assert np.ptp(whole[3]) > 0.1 * whole[3].mean(), "something happens"
    for name, (time, state) in states.items():
        assert time == t, name
        assert np.array_equal(state, whole), (name, np.abs(state - whole).max())
