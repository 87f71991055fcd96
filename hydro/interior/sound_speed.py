"""Sound speeds of all cells of a block, for regridders that ask what a cell costs."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from hydro.rows import RHO, P
from regrid.jit import kernel


@functools.cache
def make_fill_sound_speed(eos_class) -> Callable[..., Any]:
    """Kernel that fills the sound speeds of a material of an `EquationOfState` class."""
    sound_speed_squared_part = eos_class.sound_speed_squared_part

    @kernel
    def fill_sound_speed(state, parameters, first, last, out):
        """Sound speeds [m/s] of rows first..last - 1 of a state (4, ni + 2, nj + 2).

        Into `out` (ni, nj); NaN for none.
        """
        for i in range(first, last):
            rho, p, row = state[RHO, i + 1], state[P, i + 1], out[i]
            for j in range(row.shape[0]):
                row[j] = sound_speed_squared_part(rho[j + 1], p[j + 1], parameters) ** 0.5

    return fill_sound_speed
