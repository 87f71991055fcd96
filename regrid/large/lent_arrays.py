"""Arrays lent to the regrids of large blocks: one set a thread, as large as its largest block.

Blocks of a flow are regridded one after another on a thread, so that they can share what none of
them keeps.  The trap: an array comes with what the last borrower has left in it.
"""

from __future__ import annotations

import math
import threading
import weakref

import numpy as np

LARGE = 100_000  # cells from which a block's regrids share arrays and store no Hessian
WORK = "work"  # the array of what is never needed at the same time
LINE = 64  # bytes of a line of the cache: vectors that lie across two cost a tenth


def view_aligned(whole: np.ndarray, shape: tuple[int, ...], column: int = 0) -> np.ndarray:
    """The beginning of `whole` (n,) as an array of `shape`; a cache line begins at `column`.

    The last of `shape` is a multiple of 8 where that is to hold in every row; `whole` has LINE // 8
    numbers more than the array needs.
    """
    size = math.prod(shape)
    first = (-whole.ctypes.data // 8 - column) % (LINE // 8)
    return whole[first : first + size].reshape(shape)


class LentArrays:
    """Flat arrays by name, and grids that a borrower may keep and give another one back for."""

    def __init__(self) -> None:
        self._kept: dict[str, np.ndarray] = {}
        self._most = 0

    def view(self, name: str, *shape: int, column: int = 0) -> np.ndarray:
        """The array of this name in this shape, its numbers as they were left."""
        size = math.prod(shape) + LINE // 8
        if name not in self._kept or self._kept[name].size < size:
            self._kept.pop(name, None)
            self._kept[name] = np.zeros(size)
        return view_aligned(self._kept[name], shape, column)

    def take_grid(self, shape: tuple[int, ...]) -> np.ndarray:
        """A grid of this shape: the one given back last, or a new one."""
        size = math.prod(shape)
        self._most = max(self._most, size)
        whole = self._kept.pop("grid", None)
        if whole is None or whole.size < size:
            whole = np.empty(self._most)
        return whole[:size].reshape(shape)

    def give_back(self, grid: np.ndarray) -> None:
        """Take a grid of `take_grid` back; it must not be used any more."""
        whole = grid if grid.base is None else grid.base
        self._kept["grid"] = whole.reshape(-1)


_lent: weakref.WeakValueDictionary[int, LentArrays] = weakref.WeakValueDictionary()


def find_lent_arrays() -> LentArrays:
    """The arrays of this thread; they live as long as somebody holds them."""
    found = _lent.get(threading.get_ident())
    if found is None:
        found = _lent[threading.get_ident()] = LentArrays()
    return found
