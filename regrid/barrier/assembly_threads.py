"""Assembly of a block's column chunks on threads.

Every chunk writes columns of its own, so that the bits are those of the same chunks one after the
other.  The trap: the test of corner areas is too short to gain from threads, and stays without.
"""

from __future__ import annotations

from numba import prange

from regrid.barrier.assembly import (
    assemble_barrier,
)
from regrid.jit import kernel


@kernel(parallel=True)
def assemble_on_threads(nodes, law, columns, H, gradient, scratch):
    """`assemble_barrier` for all chunks; `columns` (chunks + 1) are their first node columns."""
    for k in prange(columns.shape[0] - 1):
        first, last = columns[k], columns[k + 1]
        assemble_barrier(nodes, law, 0.0, first, last, H[k], gradient, scratch[k])
