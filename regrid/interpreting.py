"""Looking at a set-up without compiling: kernels run as the Python functions that they are.

A deck is checked by a few calls on small arrays, which do not repay a minute of compiling.  The
formulas are the same, some hundred times slower.  Nothing here imports numba, which takes a while.

Note: `hydro.simulation.Simulation` leaves out what only a march needs here, and cannot march.
"""

from __future__ import annotations

import contextlib
import contextvars
from collections.abc import Iterator

import numpy as np

MOST_NUMBERS = 300_000  # in the arrays of a call: beyond, compiling takes no longer than Python

_interpreting = contextvars.ContextVar("interpreting", default=False)
is_interpreting = _interpreting.get  # is this inside a block of `interpreted`?


@contextlib.contextmanager
def interpreted() -> Iterator[None]:
    """In this block kernels that this process has not used run as Python, on small arrays.

    Those on arrays of more than MOST_NUMBERS numbers are compiled, and so are those of threads
    that are started in the block.
    """
    before = _interpreting.set(True)
    try:
        with np.errstate(all="ignore"):  # kernels do not warn
            yield
    finally:
        _interpreting.reset(before)


def suits_python(arguments: tuple) -> bool:
    """Is a call of a kernel with these arguments one for Python, here and now?"""
    numbers = sum(one.size for one in arguments if isinstance(one, np.ndarray))
    return is_interpreting() and numbers <= MOST_NUMBERS
