"""The loops over a row of cells are compiled into vector instructions."""

import platform
import re

import numba
import numpy as np
import pytest

from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.formulas.geometry import GEOMETRIES, PLANE
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER, LIMITERS
from shockgrid.hydro.formulas.riemann import HLL_JUMP_THRESHOLDS
from shockgrid.hydro.interior import axisymmetric, faces, reconstruction, scratch, slopes, update
from shockgrid.regrid.algebraic import RowBlend
from shockgrid.regrid.barrier import residual_estimate as check
from shockgrid.regrid.barrier.functional import CellCoefficients, CornerCoefficients
from shockgrid.regrid.compilation.first_calls import prepare_compiler

CURVED = GEOMETRIES["axisymmetric"]
LIMIT, SOUND, ENERGY = (
    LIMITERS[DEFAULT_LIMITER],
    *(getattr(IdealGas, part) for part in ("sound_speed_squared_part", "energy_part")),
)
SWITCH = SOUND, ENERGY, HLL_JUMP_THRESHOLDS["hllc"], False
I_FACES = scratch.RHO_OUT, scratch.RHO_IN, scratch.AREA_X_I
J_FACES = scratch.RHO_UP + scratch.CELL_BELOW, scratch.RHO_DOWN, scratch.AREA_X_J
UPWIND_I = *I_FACES, scratch.VOIDED_ENERGY_BEFORE, scratch.ACOUSTIC_BEFORE
UPWIND_J = *J_FACES, scratch.VOIDED_ENERGY - 1, scratch.ACOUSTIC - 1
LEFT_CELLS = scratch.HLL + scratch.CELL_BELOW, scratch.VOIDED_ENERGY + scratch.CELL_BELOW
HLL = J_FACES, LEFT_CELLS, scratch.FLUX_J_MASS, scratch.NO_ROW, True
RADIAL = (
    scratch.PRESSURE_J,
    scratch.FLUX_J_Y,
    scratch.X_HIGH,
    scratch.X_LOW,
    scratch.AREA_Y_J,
    scratch.PUSH_J,
)
OPEN = {"closes_before": False, "opens_own": True}
CLOSE = {"closes_before": True, "opens_own": False}
CLOSE_AND_OPEN = {"closes_before": True, "opens_own": True}
GAS = ((1.4,),)
STEP = 0.1, 10.0, (1.4,)  # dt, 1/dt, parameters
PHASES = {  # how a phase is made, its arguments after the scratch and the number of cells
    "lengths along i": (lambda: reconstruction.fill_length_after, ()),
    "lengths along j": (lambda: reconstruction.fill_length_j, ()),
    "geometry": (lambda: reconstruction.make_geometry(PLANE.volume), ()),
    "switch": (lambda: reconstruction.make_switch(*SWITCH[:3], True), GAS),
    "faces along i": (
        lambda: faces.make_faces(PLANE.face, scratch.X_HIGH, scratch.X_HIGH + 1, scratch.AREA_X_I),
        (0.1,),
    ),
    "faces along j": (
        lambda: faces.make_faces(PLANE.face, scratch.X_HIGH, scratch.X_LOW, scratch.AREA_X_J),
        (0.1,),
    ),
    "radial faces": (
        lambda: faces.make_faces(CURVED.face, scratch.X_HIGH, scratch.X_LOW, scratch.AREA_X_J),
        (0.1,),
    ),
    "slopes": (lambda: slopes.make_slopes(LIMIT, False, PLANE, SWITCH), (0.1, (1.4,))),
    "radial slopes": (lambda: slopes.make_slopes(LIMIT, True, CURVED, SWITCH), (0.1, (1.4,))),
    "traces": (lambda: faces.make_traces(SOUND, True)[1], (1.0, (1.4,))),
    "traces in": (lambda: faces.make_traces(SOUND, True)[0], (1.0, (1.4,))),
    "upwind along i": (lambda: faces.make_upwind(*UPWIND_I, False, False), ()),
    "upwind along j": (lambda: faces.make_upwind(*UPWIND_J, True, True), ()),
    "flux": (
        lambda: faces.make_flux(
            ENERGY, scratch.AREA_X_J, scratch.FLUX_J_MASS, scratch.NO_ROW, False
        ),
        GAS,
    ),
    "HLL flux": (lambda: faces.make_hll_flux(ENERGY, *HLL), (16, (1.4,))),
    "gathering": (lambda: update.make_update(IdealGas, PLANE, **OPEN), STEP),
    "new states": (lambda: update.make_update(IdealGas, PLANE, **CLOSE), STEP),
    "update": (lambda: update.make_update(IdealGas, PLANE, **CLOSE_AND_OPEN), STEP),
    "radial gathering": (lambda: update.make_update(IdealGas, CURVED, **OPEN), STEP),
    "radial push": (lambda: axisymmetric.make_push(CURVED.split, *RADIAL), ()),
    "radial lines": (lambda: axisymmetric.fill_lines, ()),
    "radial shifts": (lambda: axisymmetric.fill_shift_after, ()),
}
CORNER = CornerCoefficients(1.0, 1.0, 1.0, 1.0)
ROW_COEFFICIENTS = check.RowCoefficients(
    1.0, 1.0, 1.0, 1.0, CORNER, CellCoefficients(1.0, 1.0), 1.0
)
CHECKS = {  # loops over a row of cells of the regridder's check: their arguments before the scratch
    "moved row": (check.move_row, (RowBlend(0.5, 0.1, *(((0.1, 0.1),) * 4), 0.1, 0.1), 16)),
    "old measures": (check.measure_old, (16,)),
    "lengths of edges": (check.load_edge_numbers, ((1.0,) * 5, (1.0,) * 3, 16)),
    "old areas": (check.fill_old_areas, (16,)),
    "cells": (check.add_row_of_cells, (ROW_COEFFICIENTS, 16)),
    "nodes": (check.add_row, (16,)),
}
HOISTED = {
    "switch": 2,
    "cells": 6,
}  # scalar, on numbers that are the same for all cells
PACKED_SINCE = {"switch": (0, 66)}  # numba
INSTRUCTION = re.compile(r"^\s+v?(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d*)(p|s)d\s", re.M)


def count_kinds(function, *arguments):
    """Packed and scalar instructions of a compiled function's loops."""
    # not through the disk cache: code loaded from there has no text to read
    compiled = numba.njit(error_model="numpy")(function)
    prepare_compiler()
    compiled(*arguments)
    (code,) = compiled.inspect_asm().values()
    kinds = INSTRUCTION.findall(code)
    return kinds.count("p"), kinds.count("s")


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86-64 code")
@pytest.mark.parametrize("name", [*PHASES, *CHECKS])
def test_rows_of_cells_are_vectors(name):
    if numba.version_info.short < PACKED_SINCE.get(name, (0, 0)):
        pytest.skip("the compiler of this numba leaves the loop scalar: slower, the same numbers")
    if name in CHECKS:
        kernel, arguments = CHECKS[name]
        packed, scalar = count_kinds(kernel.py_func, *arguments, np.ones(check.RESIDUAL_SIZE))
    else:
        make, arguments = PHASES[name]
        count = 1 if name == "HLL flux" else 16
        packed, scalar = count_kinds(make(), np.ones(scratch.SIZE), count, *arguments)
    scalar -= HOISTED.get(name, 0)
    assert packed >= 0.9 * scalar and packed > 0, (packed, scalar)
