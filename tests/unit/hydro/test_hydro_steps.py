"""A step can be rejected, a state restored, and the kernels are compiled once, in packed form."""

import platform
import re

import numba
import numpy as np
import pytest

from builders import SIDES, march, two_blocks, wall_off
from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas, MieGruneisen
from hydro.formulas.geometry import GEOMETRIES, PLANE
from hydro.formulas.reconstruction import DEFAULT_LIMITER, LIMITERS
from hydro.formulas.riemann import FLUXES
from hydro.interior import axisymmetric, fluxes, reconstruction, slopes, traces, update
from hydro.interior import scratch as at
from hydro.interior.advance import make_flow_kernels
from hydro.motion import line, thickness
from hydro.perimeter import contacts
from hydro.perimeter.strips import make_side_kernels
from hydro.simulation import Simulation
from regrid.errors import RegridFailure, RunFailure


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
