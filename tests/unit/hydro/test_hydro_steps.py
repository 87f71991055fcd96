"""Steps: restarts, refusals, threads, sources, guards, both sides of a link."""

import platform
import re

import numba
import numpy as np
import pytest

from builders import SIDES, box, march, tensor, two_blocks, wall_off
from hydro import rim as on
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas, MieGruneisen
from hydro.formulas.geometry import GEOMETRIES, PLANE
from hydro.formulas.reconstruction import DEFAULT_LIMITER, LIMITERS
from hydro.formulas.riemann import FLUXES
from hydro.interior import axisymmetric, fluxes, reconstruction, slopes, traces, update
from hydro.interior import scratch as at
from hydro.interior.advance import make_flow_kernels
from hydro.links.join import join
from hydro.motion import line, thickness
from hydro.perimeter import contacts
from hydro.perimeter.strips import make_side_kernels
from hydro.simulation import Simulation
from hydro.sources import make_gravity
from regrid.errors import RegridFailure, RunFailure
from regrid.measure.quality import find_bad_cells
from regrid.registry import make_regridder


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


def get_bits(simulation):
    return {
        name: np.asarray(value).tobytes()
        for name, value in simulation.get_state().items()
        if not isinstance(value, str)
    }


def test_restart_goes_on_to_the_same_bits():
    whole, first = make_pair(), make_pair()
    march(whole, 24)
    march(first, 12)
    second = make_pair()
    second.set_state(first.get_state())
    row = march(second, 12)[-1]
    assert second.step == whole.step == 24
    assert get_bits(second) == get_bits(whole)
    assert np.isfinite(row["total_energy"])


class Stubborn:
    """Regridder that refuses `failures` times from its second call on."""

    def __init__(self, failures):
        from regrid.registry import make_regridder

        self.inner, self.failures, self.calls = make_regridder("barrier"), failures, 0

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
    with pytest.raises(RunFailure, match=r"block 'left'.*refused.*t = .*step 2.*dt was cut"):
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
        for module in (contacts, line, thickness)
        for value in vars(module).values()
        if hasattr(value, "signatures") and value.__module__ == module.__name__
    ]
    counts = {k.__name__: len(k.signatures) for k in kernels}
    assert max(counts.values()) == 1, counts


def test_threads_give_the_same_bits():
    one, two = make_pair(40, 140), make_pair(40, 140, threads=2)
    march(one, 6)
    march(two, 6)
    assert get_bits(one) == get_bits(two)


PHASES = {
    "fill_geometry": (),
    "fill_length_after": (),
    "fill_faces_i": (0.1,),
    "fill_faces_j": (0.1,),
    "fill_length_j": (),
    "fill_slopes": (0.1, (1.4,)),
    "fill_slopes_radial": (0.1, (1.4,)),
    "fill_upwind_i": (),
    "fill_upwind_j": (),
    "gather_flux": (0.1, 10.0, (1.4,)),
    "gather_flux_radial": (0.1, 10.0, (1.4,)),
    "fill_push": (),
    "fill_lines": (),
    "fill_shift_after": (),
    "fill_traces": (1.0, (1.4,)),
    "fill_traces_in": (1.0, (1.4,)),
    "fill_flux": ((1.4,),),
    "smear_flux": (16, (1.4,)),
    "fill_new_state": (0.1, 10.0, (1.4,)),
    "update_rows": (0.1, 10.0, (1.4,)),
    "fill_switch": ((1.4,),),
}
SWITCH = (IdealGas.sound_speed_squared_part, IdealGas.energy_part, FLUXES["hllc"], False)
CURVED = GEOMETRIES["axisymmetric"]
LIMIT, SOUND = LIMITERS[DEFAULT_LIMITER], IdealGas.sound_speed_squared_part
I_FACES, J_FACES = (at.RHO_OUT, at.RHO_IN, at.AREA_X_I), (at.RHO_UP - 1, at.RHO_DOWN, at.AREA_X_J)
MADE = {
    "fill_length_after": lambda: reconstruction.fill_length_after,
    "fill_geometry": lambda: reconstruction.make_geometry(PLANE.volume),
    "fill_faces_i": lambda: traces.make_faces(PLANE.face, at.X_HIGH, at.X_HIGH + 1, at.AREA_X_I),
    "fill_faces_j": lambda: traces.make_faces(PLANE.face, at.X_HIGH, at.X_LOW, at.AREA_X_J),
    "fill_length_j": lambda: reconstruction.fill_length_j,
    "fill_slopes": lambda: slopes.make_slopes(LIMIT, False, PLANE, SWITCH),
    "fill_slopes_radial": lambda: slopes.make_slopes(LIMIT, True, CURVED, SWITCH),
    "fill_upwind_i": lambda: fluxes.make_upwind(
        *I_FACES, at.TORN_BEFORE, at.ACOUSTIC_BEFORE, False, False
    ),
    "fill_upwind_j": lambda: fluxes.make_upwind(*J_FACES, at.TORN - 1, at.ACOUSTIC - 1, True, True),
    "gather_flux": lambda: update.make_update(IdealGas, PLANE, False, True),
    "fill_push": lambda: axisymmetric.make_push(
        CURVED.split, at.PRESSURE_J, at.FLUX_J_Y, at.X_HIGH, at.X_LOW, at.AREA_Y_J, at.PUSH_J
    ),
    "fill_lines": lambda: axisymmetric.fill_lines,
    "fill_shift_after": lambda: axisymmetric.fill_shift_after,
    "gather_flux_radial": lambda: update.make_update(IdealGas, CURVED, False, True),
    "fill_traces": lambda: traces.make_traces(SOUND, True)[1],
    "fill_traces_in": lambda: traces.make_traces(SOUND, True)[0],
    "fill_flux": lambda: fluxes.make_flux(
        IdealGas.energy_part, at.AREA_X_J, at.FLUX_J_MASS, 0, False
    ),
    "smear_flux": lambda: fluxes.make_hll_flux(
        IdealGas.energy_part, *J_FACES, at.HLL - 1, at.TORN - 1, at.FLUX_J_MASS, 0, True
    ),
    "fill_new_state": lambda: update.make_update(IdealGas, PLANE, True, False),
    "update_rows": lambda: update.make_update(IdealGas, PLANE, True, True),
    "fill_switch": lambda: reconstruction.make_switch(
        SOUND, IdealGas.energy_part, FLUXES["hllc"], True
    ),
}
HOISTED = {"fill_switch": 2}  # scalar instructions on numbers that are the same for all cells
PACKED_SINCE = {"fill_switch": (0, 66)}  # numba
INSTRUCTION = re.compile(r"^\s+v?(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d*)(p|s)d\s", re.M)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86-64 code")
@pytest.mark.parametrize("name", PHASES)
def test_row_phases_are_packed(name):
    if numba.version_info.short < PACKED_SINCE.get(name, (0, 0)):
        pytest.skip("the compiler of this numba leaves the loop scalar: slower, the same numbers")
    # not through the disk cache: code loaded from there has no text to read
    compiled = numba.njit(error_model="numpy")(MADE[name]())
    compiled(np.ones(at.SIZE), 1 if name == "smear_flux" else 16, *PHASES[name])
    (code,) = compiled.inspect_asm().values()
    kinds = INSTRUCTION.findall(code)
    packed, scalar = kinds.count("p"), kinds.count("s") - HOISTED.get(name, 0)
    assert packed >= 0.9 * scalar and packed > 0, (packed, scalar)


GAS = IdealGas(1.4)


def make_block(name="a", start=0.0, end=1.0, **open_sides):
    block = Block(name, GAS, box((start, 0.0), (end, 1.0), (8, 8)), 1.0, 0.0, 0.0, 1.0)
    for side in ("i_min", "i_max", "j_min", "j_max"):
        if side not in open_sides:
            put(block, side, "wall")
    return block


def test_negative_density_is_a_failure_though_the_sound_speed_is_real():
    block = make_block()
    simulation = Simulation([block], [], t_end=1.0, mesh="fixed")
    simulation.advance()
    block.state[0, 4, 4] = block.state[3, 4, 4] = -1.0  # c² = gamma p / rho > 0
    block.update(0.0)
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
    rows = on.FLUX if kind == "seam" else slice(on.W_STAR, on.W_STAR + 1)
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


def measure_worst(cells):
    """Worst error of the heat of a cell against the r-weighted average of the heating law."""
    x, r = np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, cells + 1)
    nodes = tensor(x, r)
    block = Block("gas", IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0)
    put(block, "j_min", "axis")
    wall_off(block, "i_min", "i_max", "j_max")
    simulation = Simulation(
        [block], [], t_end=1.0, mesh="fixed", geometry="axisymmetric",
        source=lambda block, x, y, t, dt: (0.0, 0.0, dt * np.cos(2.0 * x) * np.cos(3.0 * y)),
    )  # fmt: skip
    simulation.flow.source.start_step(0.0, 2e-3)
    rho, _, _, p = block.start[:, 1:-1, 1:-1]
    heat = (block.eos.energy(rho, p) - block.cell_fields["e"]) / 1e-3
    along = np.diff(np.sin(2.0 * x) / 2.0) / np.diff(x)
    moment = r * np.sin(3.0 * r) / 3.0 + np.cos(3.0 * r) / 9.0  # of r cos 3 r
    across = np.diff(moment) / (0.5 * np.diff(r * r))
    return float(np.abs(heat - along[:, None] * across).max())


@pytest.mark.kernels
def test_a_heating_law_in_axisymmetric_flow_is_of_second_order():
    errors = [measure_worst(cells) for cells in (8, 16, 32)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.1)
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("name", ["barrier", "equidistribution"])
def test_a_step_reads_the_state_it_starts_from_alone(name, monkeypatch):
    options = {"weight": "sides*(1+3*abs(p-1))"} if name == "equidistribution" else {}

    def march(spoilt):
        x = np.linspace(0.0, 1.0, 13)
        nodes = np.array(np.meshgrid(x, x[:7], indexing="ij"))
        block = Block("gas", IdealGas(1.4), nodes, 1.0, 0.0, 0.0, 1.0)
        put(block, "i_min", "piston", velocity=(0.8, 0.0))
        for side in ("i_max", "j_min", "j_max"):
            put(block, side, "wall")
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
        for _ in range(8):
            simulation.advance()
        return simulation.get_state()

    plain, spoilt = march(False), march(True)
    assert all(np.array_equal(plain[key], spoilt[key]) for key in plain)
