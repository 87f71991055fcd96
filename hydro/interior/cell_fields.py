"""Fields of a block's cells by name, of which the energy is computed when it is asked for.

Who wants to know the names, or a density, at every step pays for no equation of state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

ENERGY = "e"
Compute = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]


class Energies:
    """Specific internal energies (ni, nj) [J/kg], of which rows are computed that are read.

    fill: fills an array of them for density, pressure and voids' energy, which are those given
    here: arrays (ni, nj) that hold as long as the energies are read.
    """

    def __init__(self, rho: np.ndarray, p: np.ndarray, voids: np.ndarray, fill: Compute):
        self._arrays, self._fill = (rho, p, voids), fill
        self.shape, self.dtype, self.nbytes = voids.shape, voids.dtype, voids.nbytes

    def compute_rows(self, first: int, last: int) -> np.ndarray:
        """Of the rows first..last - 1 of cells: (last - first, nj)."""
        taken = [array[first:last] for array in self._arrays]
        e = np.empty(taken[0].shape)
        self._fill(*taken, e)
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
