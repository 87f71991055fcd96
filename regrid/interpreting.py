"""Looking at a set-up without compiling: kernels run as the Python functions that they are.

A deck is checked by a few calls on small arrays, which do not repay a minute of compiling.  Note:
`hydro.simulation.Simulation` leaves out what only a march needs here, and cannot march.
"""

import contextlib
import contextvars

import numpy as np

MOST_NUMBERS = 300_000  # in the arrays of a call: beyond, compiling takes no longer than Python

_interpreting = contextvars.ContextVar("interpreting", default=False)
is_interpreting = _interpreting.get  # is this inside a block of `interpreted`?


@contextlib.contextmanager
def interpreted():
    """In this block kernels that this process has not used run as Python, on small arrays; those of
    threads that are started in the block are compiled."""
    before = _interpreting.set(True)
    try:
        with np.errstate(all="ignore"):  # kernels do not warn
            yield
    finally:
        _interpreting.reset(before)
