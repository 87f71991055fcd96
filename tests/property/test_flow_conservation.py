"""What is conserved: mass of each material always, all totals where no work is done outside."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas, StiffenedGas
from hydro.links.join import join
from hydro.simulation import Simulation


def make_flow(seed, inner="interface", piston=None):
    """Two blocks full of random states behind a bent line, in a closed box or under a piston."""
    random = np.random.default_rng(seed)
    ni, nj = 10, 8
    y = np.linspace(0.0, 1.0, nj + 1)
    front = 0.08 * np.cos(np.pi * y * random.integers(1, 4)) * random.uniform(-1.0, 1.0)
    part = np.linspace(0.0, 1.0, ni + 1)[:, None]
    rows = np.broadcast_to(y, (ni + 1, nj + 1))
    grids = [
        np.array([-1.0 + (front + 1.0) * part, rows]),
        np.array([front + (1.0 - front) * part, rows]),
    ]
    blocks = []
    materials = ("gas", "gas") if inner == "seam" else ("gas", "liquid")
    gases = IdealGas(1.4), IdealGas(1.4) if inner == "seam" else StiffenedGas(4.4, 10.0)
    for name, eos, grid, material in zip(("left", "right"), gases, grids, materials, strict=True):
        rho = random.uniform(0.8, 1.2, (ni, nj))
        u, v = random.uniform(-0.2, 0.2, (2, ni, nj))
        p = random.uniform(0.8, 1.2, (ni, nj))
        blocks.append(Block(name, eos, grid, rho, u, v, p, material=material))
    left, right = blocks
    if piston is None:
        put(left, "i_min", "wall")
    else:
        put(left, "i_min", "piston", velocity=piston)
    put(right, "i_max", "wall")
    for block in blocks:
        put(block, "j_min", "wall")
        put(block, "j_max", "wall")
    links = [join(inner, (left, "i_max"), (right, "i_min"))]
    return Simulation(blocks, links, t_end=1.0)


def march(simulation, steps):
    start = simulation.start_row()
    for _ in range(steps):
        row = simulation.advance()
    return start, row


@settings(max_examples=8, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), inner=st.sampled_from(["interface", "seam"]))
def test_closed_box(seed, inner):
    """Mass of each material and energy; momentum less what the walls gave."""
    start, row = march(make_flow(seed, inner), 25)
    energy = start["total_energy"]
    for name in start:
        if name.startswith("total_mass") and inner == "interface":
            assert abs(row[name] - start[name]) <= 5e-14 * start[name]
        elif name.startswith("total"):
            through = row["boundary_" + name.removeprefix("total_")]
            assert abs(row[name] - start[name] - through) <= 1e-12 * energy
    assert abs(row["total_energy"] - energy) <= 1e-12 * energy, "walls at rest do no work"
    assert abs(row["boundary_energy"]) <= 1e-15 * energy


@settings(max_examples=8, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), speed=st.floats(-0.3, 0.6))
def test_work_of_a_piston(seed, speed):
    """All energy that comes in is the piston's work, all momentum the pressure on the sides."""
    simulation = make_flow(seed, piston=lambda t: (speed * np.sin(6.0 * t), 0.0))
    start, row = march(simulation, 25)
    for name in ("energy", "momentum_x", "momentum_y"):
        change = row["total_" + name] - start["total_" + name]
        assert abs(change - row["boundary_" + name]) <= 1e-12 * start["total_energy"]
    for name in ("gas", "liquid"):
        mass = start["total_mass_" + name]
        assert abs(row["total_mass_" + name] - mass) <= 5e-14 * mass
        assert row["boundary_mass_" + name] == 0.0
