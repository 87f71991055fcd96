"""Fields of a block's cells, of which energy and sound speed are computed when they are asked for.

Who wants to know the names, or a density, at every step pays for no equation of state.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from hydro.eos.base import EquationOfState
from hydro.rows import RHO, P
from regrid.errors import BadInput
from regrid.jit import kernel

SLAB = 64  # rows for which something is computed at a time
ENERGY = "e"
Compute = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]


def check_first_state(name: str, eos: EquationOfState, state: np.ndarray) -> None:
    """Raise BadInput where a block's first `state` (4, ni, nj) is none of its material."""
    rho, _, _, p = state
    for first in range(0, len(rho), SLAB):
        rows = slice(first, first + SLAB)
        with np.errstate(all="ignore"):
            c = eos.sound_speed(rho[rows], p[rows])
        bad = ~(np.isfinite(state[:, rows]).all(axis=0) & (rho[rows] > 0.0) & (c > 0.0))
        if not bad.any():
            continue
        i, j = (int(index) for index in np.argwhere(bad)[0])
        i += first
        raise BadInput(
            f"block {name!r}: cell i={i}, j={j} starts with density {rho[i, j]:g} and "
            f"pressure {p[i, j]:g}; both must give a positive density and sound speed"
        )


class Energies:
    """Specific internal energies (ni, nj) [J/kg], of which rows are computed that are read.

    fill: fills an array of them for density, pressure and voids' energy, which are those given
    here: arrays (ni, nj) that hold as long as the energies are read.  known: the rows, first and
    the one after the last, whose states are here; those of others are 0.
    """

    def __init__(
        self,
        rho: np.ndarray,
        p: np.ndarray,
        voids: np.ndarray,
        fill: Compute,
        known: tuple[int, int],
    ):
        self._arrays, self._fill, self._known = (rho, p, voids), fill, known
        self.shape, self.dtype, self.nbytes = voids.shape, voids.dtype, voids.nbytes

    def compute_rows(self, first: int, last: int) -> np.ndarray:
        """Of the rows first..last - 1 of cells: (last - first, nj)."""
        e = np.zeros((last - first, self.shape[1]))
        begin = max(first, self._known[0])
        rows = slice(begin, max(begin, min(last, self._known[1])))
        taken = [array[rows] for array in self._arrays]
        self._fill(*taken, e[rows.start - first : rows.stop - first])
        return e


class CellFields(Mapping[str, np.ndarray]):
    """Density, velocity, pressure, each (ni, nj), and the specific internal energy.

    stored: the first four.
    """

    def __init__(self, stored: Mapping[str, np.ndarray], energies: Energies):
        self._stored, self._energies = stored, energies

    def __getitem__(self, name: str) -> np.ndarray:
        return (
            self._stored[name]
            if name != ENERGY
            else self._energies.compute_rows(0, self._energies.shape[0])
        )

    def __iter__(self) -> Iterator[str]:
        yield from self._stored
        yield ENERGY

    def __len__(self) -> int:
        return len(self._stored) + 1

    def __contains__(self, name: object) -> bool:
        return name == ENERGY or name in self._stored


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
