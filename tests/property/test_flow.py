"""Uniform streams and totals for drawn cases."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builders import box, march, two_blocks, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas, MieGruneisen, StiffenedGas
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation


def make_flow(seed, inner="interface", piston=None):
    """Two blocks full of random states behind a bent line, in a closed box or under a piston."""
    random = np.random.default_rng(seed)
    ni, nj = 10, 8
    waves = random.integers(1, 4)
    height = random.uniform(-1.0, 1.0)
    gases = IdealGas(1.4), IdealGas(1.4 if inner == "seam" else 1.67)
    states = []
    for _ in range(2):
        rho = random.uniform(0.8, 1.2, (ni, nj))
        u, v = random.uniform(-0.2, 0.2, (2, ni, nj))
        states.append((rho, u, v, random.uniform(0.8, 1.2, (ni, nj))))

    def front(y):
        return 0.08 * np.cos(np.pi * y * waves) * height

    blocks, links = two_blocks(front, (ni, nj), gases, states, inner)
    if piston is not None:
        put(blocks[0], "i_min", "piston", velocity=piston)
    for block in blocks:
        wall_off(block)
    return Simulation(blocks, links, t_end=1.0)


@pytest.mark.kernels
@settings(max_examples=8, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), inner=st.sampled_from(["interface", "seam"]))
def test_closed_box(seed, inner):
    """Mass of each material and energy; momentum less what the walls gave."""
    simulation = make_flow(seed, inner)
    start = simulation.start_row()
    row = march(simulation, 25)[-1]
    energy = start["total_energy"]
    for name in start:
        if name.startswith("total_mass") and inner == "interface":
            assert abs(row[name] - start[name]) <= 5e-14 * start[name]
        elif name.startswith("total"):
            through = row["boundary_" + name.removeprefix("total_")]
            assert abs(row[name] - start[name] - through) <= 1e-12 * energy
    assert abs(row["total_energy"] - energy) <= 1e-12 * energy, "walls at rest do no work"
    assert abs(row["boundary_energy"]) <= 1e-15 * energy


@pytest.mark.kernels
@settings(max_examples=8, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), speed=st.floats(-0.3, 0.6))
def test_work_of_a_piston(seed, speed):
    """All energy that comes in is the piston's work, all momentum the pressure on the sides."""
    simulation = make_flow(seed, piston=lambda t: (speed * np.sin(6.0 * t), 0.0))
    start = simulation.start_row()
    row = march(simulation, 25)[-1]
    for name in ("energy", "momentum_x", "momentum_y"):
        change = row["total_" + name] - start["total_" + name]
        assert abs(change - row["boundary_" + name]) <= 1e-12 * start["total_energy"]
    for name in ("left", "right"):
        mass = start["total_mass_" + name]
        assert abs(row["total_mass_" + name] - mass) <= 5e-14 * mass
        assert row["boundary_mass_" + name] == 0.0


FLUIDS = {
    "ideal gas": (IdealGas(1.4), 1.2, 1e5),
    "stiffened gas": (StiffenedGas(4.4, 6e8), 1000.0, 1e6),
    "metal": (MieGruneisen(2707.0, 5386.0, 1.339, 1.97), 2800.0, 3e9),
}


@pytest.mark.kernels
@pytest.mark.parametrize("fluid", FLUIDS)
@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**32 - 1),
    ni=st.integers(2, 9),
    nj=st.integers(2, 9),
    mach=st.floats(0.0, 3.0),
    angle=st.floats(-3.2, 3.2),
    skew=st.floats(-0.7, 0.7),
    periodic=st.booleans(),
)
def test_any_motion_keeps_a_uniform_stream(fluid, seed, ni, nj, mach, angle, skew, periodic):
    eos, rho, p = FLUIDS[fluid]
    c = float(eos.sound_speed(rho, p))
    velocity = (mach * c * np.cos(angle), mach * c * np.sin(angle))
    x, y = box((0, 0), (1, 1), (ni, nj))
    base = np.array([x + skew * y, y + 0.3 * skew * x])
    random = np.random.default_rng(seed)
    shakes = {}

    def law(name, t):
        if t not in shakes:  # a retried step asks for another time
            shake = random.uniform(-0.15, 0.15, base.shape) / max(ni, nj)
            if periodic:
                shake[:, :, -1] = shake[:, :, 0]
            shakes[t] = base + shake
        return shakes[t]

    block = Block("block", eos, law("block", 0.0), rho, *velocity, p)
    stream = (rho, *velocity, p)
    links = []
    for side in ("i_min", "i_max") if periodic else ("i_min", "i_max", "j_min", "j_max"):
        put(block, side, "inflow", state=stream)
    if periodic:
        links.append(join("periodic", (block, "j_min"), (block, "j_max")))
    simulation = Simulation([block], links, t_end=1e9, cfl=0.5, mesh=law)
    march(simulation, 10)
    state = block.state[:, 1:-1, 1:-1]
    sizes = (rho, c, c, rho * c * c)
    for value, exact, size in zip(state, stream, sizes, strict=True):
        assert np.abs(value - exact).max() <= 1e-13 * size
