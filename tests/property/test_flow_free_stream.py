"""Geometric conservation: no random motion of a random grid disturbs a uniform stream."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builders import box, march
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas, MieGruneisen, StiffenedGas
from hydro.links.join import join
from hydro.simulation import Simulation

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
