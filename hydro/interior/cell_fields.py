"""Fields of a block's cells; energy, temperature, sound speed are computed when they are used.

Reading the names or the density at every step therefore costs no equation of state.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from shockgrid.hydro.eos.base import EquationOfState
from shockgrid.hydro.rows import RHO, P
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import Kernel, kernel

SLAB_ROWS = 64  # rows for which something is computed at a time


def check_first_state(
    name: str, eos: EquationOfState, state: np.ndarray, fields: np.ndarray | None = None
) -> None:
    """Raise BadInput where a block's first `state` (4, ni, nj) is none of its material.

    fields (n, ni, nj): those that its cells carry, where its equation of state sees them.
    """
    rho, _, _, p = state
    for first in range(0, len(rho), SLAB_ROWS):
        rows = slice(first, first + SLAB_ROWS)
        eos_of_rows = eos if fields is None else eos.with_fields(fields[:, rows])
        with np.errstate(all="ignore"):
            c = eos_of_rows.sound_speed(rho[rows], p[rows])
        is_bad = ~(np.isfinite(state[:, rows]).all(axis=0) & (rho[rows] > 0.0) & (c > 0.0))
        if not is_bad.any():
            continue
        i, j = (int(index) for index in np.argwhere(is_bad)[0])
        i += first
        raise BadInput(
            f"block {name!r}: cell i={i}, j={j} starts with density {rho[i, j]:g} and "
            f"pressure {p[i, j]:g}; both must give a positive density and sound speed"
            + (f"; {eos.limits}" if eos.limits else "")
        )


class CellFields(Mapping[str, np.ndarray]):
    """Fields of a block's cells by name, each (ni, nj): those that it has, then others.

    stored: the arrays that the block has; computed: by name, what gives the others at each access.
    """

    def __init__(
        self, stored: Mapping[str, np.ndarray], computed: Mapping[str, Callable[[], np.ndarray]]
    ):
        self._stored = stored
        self._computed = computed

    def __getitem__(self, name: str) -> np.ndarray:
        return self._computed[name]() if name in self._computed else self._stored[name]

    def __iter__(self) -> Iterator[str]:
        yield from self._stored
        yield from self._computed

    def __len__(self) -> int:
        return len(self._stored) + len(self._computed)

    def __contains__(self, name: object) -> bool:
        return name in self._computed or name in self._stored


@functools.cache
def make_fill_sound_speed(eos_class) -> Kernel:
    """Kernel that fills the sound speeds of a material of an `EquationOfState` class."""
    sound_speed_squared_part = eos_class.sound_speed_squared_part

    @kernel
    def fill_sound_speed(state, parameters, first, last, out):
        """Sound speeds [m/s] of rows first..last - 1 of a state (4, ni + 2, nj + 2).

        Into `out` (ni, nj); NaN for none.
        """
        for i in range(first, last):
            rho = state[RHO, i + 1]
            p = state[P, i + 1]
            row = out[i]
            for j in range(row.shape[0]):
                row[j] = sound_speed_squared_part(rho[j + 1], p[j + 1], parameters) ** 0.5

    return fill_sound_speed
