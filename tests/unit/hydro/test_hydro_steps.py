"""Steps: restarts, refusals, threads, sources, guards, both sides of a link."""

import numpy as np
import pytest

from builders import SIDES, box, check_restarts, get_bits, march, two_blocks, wall_off
from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas, MieGruneisen
from shockgrid.hydro.interior.advance import make_flow_kernels
from shockgrid.hydro.links import join
from shockgrid.hydro.motion import line, smoothing
from shockgrid.hydro.perimeter import contacts
from shockgrid.hydro.perimeter.strips import make_side_kernels
from shockgrid.hydro.rim import FLUX, W_STAR
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.sources import make_gravity
from shockgrid.hydro.workers import LEAST_INSIDE
from shockgrid.regrid.errors import RegridFailure, RunFailure
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.registry import make_regridder


def make_pair(ni=12, nj=8, threads=1, make_regridder=None):
    """Two gases behind a curved interface; a piston drives a shock through it."""
    blocks, links = two_blocks(
        lambda y: 0.05 * np.cos(2.0 * np.pi * y),
        (ni, nj),
        (IdealGas(1.4), IdealGas(1.2)),
        ((1.0, 0.0, 0.0, 1.0), (3.0, 0.0, 0.0, 1.0)),
    )
    put(blocks[0], "i_min", "piston", velocity=(0.8, 0.0))
    for block in blocks:
        wall_off(block)
    return Simulation(blocks, links, t_end=0.6, threads=threads, make_regridder=make_regridder)


def test_restart_goes_on_to_the_same_bits():
    check_restarts(make_pair, [12], steps=12)


class Stubborn:
    """Regridder that refuses `failures` times from its second call on."""

    def __init__(self, failures):
        from shockgrid.regrid.registry import make_regridder

        self.inner = make_regridder("barrier")
        self.failures = failures
        self.calls = 0

    def regrid(self, previous, boundary):
        self.calls += 1
        if self.calls > 2 and self.failures > 0:
            self.failures -= 1
            raise RegridFailure("side i_max: refused")
        return self.inner.regrid(previous, boundary)


def test_refused_step_is_halved():
    simulation = make_pair(make_regridder=lambda: Stubborn(1))
    plain = make_pair()
    march(simulation, 2)
    march(plain, 2)
    assert get_bits(simulation) == get_bits(plain)
    dt = simulation.clock.choose_dt()[0]
    row = simulation.advance()
    assert row["retries"] >= 1 and row["dt_limit"] == "retry"
    assert row["dt"] < dt
    limit = plain.clock.choose_dt()[0]
    assert simulation.clock.choose_dt()[0] < limit, "the step recovers gently"


def test_step_that_always_fails_leaves_the_state_and_names_the_place():
    simulation = make_pair(make_regridder=lambda: Stubborn(10_000))
    simulation.advance()
    simulation.advance()
    before = get_bits(simulation)
    with pytest.raises(RunFailure, match=r"block 'left'.*refused.*t = .*step 2.*steps were tried"):
        simulation.advance()
    assert get_bits(simulation) == before


@pytest.mark.kernels
@pytest.mark.parametrize("eos_class", [IdealGas, MieGruneisen])
def test_one_signature_a_kernel(eos_class):
    make_pair().advance()
    left = Block("metal", MieGruneisen(), np.array(np.mgrid[0:4, 0:5], float), 2707.0, 0, 0, 1e9)
    wall_off(left, *SIDES)
    Simulation([left], [], t_end=1.0).advance()
    kernels = [make_flow_kernels(eos_class).advance, *make_side_kernels(eos_class)]
    kernels += [
        value
        for module in (contacts, line, smoothing)
        for value in vars(module).values()
        if hasattr(value, "signatures") and value.__module__ == module.__name__
    ]
    counts = {k.__name__: len(k.signatures) for k in kernels}
    assert max(counts.values()) == 1, counts


@pytest.mark.kernels
def test_threads_give_the_same_bits():
    one = make_pair(48, 140)
    two = make_pair(48, 140, threads=2)
    assert all(block.ni * block.nj >= LEAST_INSIDE for block in two.blocks), "one thread is taken"
    march(one, 6)
    march(two, 6)
    assert get_bits(one) == get_bits(two)


GAS = IdealGas(1.4)


def make_block(name="a", start=0.0, end=1.0, **open_sides):
    block = Block(name, GAS, box((start, 0.0), (end, 1.0), (8, 8)), 1.0, 0.0, 0.0, 1.0)
    wall_off(block, *(side for side in SIDES if side not in open_sides))
    return block


def test_negative_density_is_a_failure_though_the_sound_speed_is_real():
    block = make_block()
    simulation = Simulation([block], [], t_end=1.0, mesh="fixed")
    simulation.advance()
    block.state[0, 4, 4] = block.state[3, 4, 4] = -1.0  # c² = gamma p / rho > 0
    phases.update(block, 0.0)
    assert block.find_failure()


def test_a_mesh_law_that_tangles_ends_the_run():
    block = make_block()
    rest = block.nodes.copy()

    def law(name, t):
        nodes = rest.copy()
        nodes[0, 4, 4] += 4.0 * t  # passes its neighbour at t = 1/32
        return nodes

    simulation = Simulation([block], [], t_end=1.0, mesh=law)
    with pytest.raises(RunFailure):
        march(simulation)
    assert 0.0 < simulation.t <= 1.0 / 32.0
    assert len(find_bad_cells(block.nodes)) == 0


def test_two_pistons_at_one_corner_move_it_along_both():
    block = Block("a", GAS, box((0.0, 0.0), (1.0, 1.0), (8, 8)), 1.0, 0.0, 0.0, 1.0)
    put(block, "i_min", "piston", velocity=(0.5, 0.0))
    put(block, "j_min", "piston", velocity=(0.0, 0.25))
    wall_off(block, "i_max", "j_max")
    simulation = Simulation([block], [], t_end=0.1)
    march(simulation)
    np.testing.assert_allclose(block.nodes[:, 0, 0], (0.05, 0.025), atol=1e-12)


NODES = np.array(np.mgrid[0:5, 0:4], float)


@pytest.mark.parametrize("kind", ["interface", "seam"])
def test_both_sides_of_a_link_have_the_same_bits(kind):
    gases = (IdealGas(1.4), IdealGas(1.4 if kind == "seam" else 1.2))
    states = ((1.0, 0.3, 0.1, 2.0), (3.0, -0.2, 0.0, 1.0))
    blocks, links = two_blocks(
        lambda y: 0.05 * np.cos(2.0 * np.pi * y), (6, 5), gases, states, kind
    )
    if kind == "seam":
        links += [join("periodic", (block, "j_min"), (block, "j_max")) for block in blocks]
    for block in blocks:
        wall_off(block)
    march(Simulation(blocks, links, t_end=1.0, mesh="regrid"), 3)
    rows = FLUX if kind == "seam" else slice(W_STAR, W_STAR + 1)
    for link in links:
        order = -1 if link.reverse else 1
        one, other = (side.rim for side in link.segments)
        assert np.abs(one.rows[rows]).max() > 0.0
        assert np.array_equal(one.rows[rows], -other.rows[rows, ::order])
        assert kind == "seam" or np.array_equal(one.p_star, other.p_star[::order])


def test_inflow_is_as_fast_as_its_sound():
    block = Block("gas", IdealGas(1.4), NODES, 1.0, 0.2, 0.0, 1.0)
    put(block, "i_min", "inflow", state=(0.25, 0.2, 0.0, 1.0))
    wall_off(block)
    march(Simulation([block], [], t_end=1.0, mesh="fixed"), 1)
    rim = block.segments[0].rim
    assert rim.c2_beyond == pytest.approx(1.4 / 0.25) and rim.c_beyond**2 == pytest.approx(5.6)


@pytest.mark.parametrize("name", ["barrier", "equidistribution"])
def test_a_step_reads_the_state_it_starts_from_alone(name, monkeypatch):
    options = {"weight": "sides*(1+3*abs(p-1))"} if name == "equidistribution" else {}

    def run(spoilt):
        nodes = box((0.0, 0.0), (1.0, 0.5), (12, 6))
        block = Block("gas", IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0)
        put(block, "i_min", "piston", velocity=(0.8, 0.0))
        wall_off(block)
        simulation = Simulation(
            [block], [], t_end=1.0, source=make_gravity(-3.0, 0.5),
            make_regridder=lambda: make_regridder(name, **options),
        )  # fmt: skip
        start_step = simulation.flow.source.start_step

        def start_and_spoil(t, dt):
            start_step(t, dt)
            if spoilt:
                block.state[...] = np.nan

        monkeypatch.setattr(simulation.flow.source, "start_step", start_and_spoil)
        march(simulation, 8)
        return simulation

    assert get_bits(run(False)) == get_bits(run(True))
