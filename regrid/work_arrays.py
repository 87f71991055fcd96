"""Work arrays that all regrids of a thread share: its blocks are regridded one after another.

Their contents are undefined at the start of a call, and nothing in them survives a call.
"""

from __future__ import annotations

import math
import threading

import numpy as np

CACHE_LINE_BYTES = 64  # bytes of a line of the cache: vectors that lie across two cost a tenth
NUMBERS_PER_CACHE_LINE = CACHE_LINE_BYTES // 8

_kept = threading.local()


def share_memory(size: int) -> np.ndarray:
    """The flat array (`size` or more,) of this thread; pages that nobody writes take no memory."""
    whole: np.ndarray | None = getattr(_kept, "whole", None)
    if whole is None or whole.size < size:
        _kept.whole = whole = np.zeros(size)
    return whole


class Carver:
    """Arrays cut one after another from `whole` (n,), each beginning at a line of the cache."""

    def __init__(self, whole: np.ndarray):
        self.whole = whole
        self.at = (-whole.ctypes.data // 8) % NUMBERS_PER_CACHE_LINE
        self.first = self.at

    def cut(self, *shape: int, column: int = 0) -> np.ndarray:
        """An array of `shape`; a line of the cache begins at `column` of its first row."""
        begin = self.at + -column % NUMBERS_PER_CACHE_LINE
        end = begin + math.prod(shape)
        self.at = end + (self.first - end) % NUMBERS_PER_CACHE_LINE
        return self.whole[begin:end].reshape(shape)


def count_numbers(*shape: int) -> int:
    """How much of the memory `Carver.cut` takes at most for an array of `shape`."""
    return math.prod(shape) + 2 * NUMBERS_PER_CACHE_LINE
