"""Assembly of a block's column chunks on threads.

Every chunk writes columns of its own, so that the bits are those of the same chunks one after the
other.  The trap: the test of corner areas is too short to gain from threads, and stays without.
"""

from __future__ import annotations

from numba import prange

from regrid.barrier.assembly import assemble_barrier
from regrid.jit import kernel


@kernel(parallel=True)
def assemble_on_threads(
    nodes, along_i, along_j, blend_i, blend_j, ki, kj, sigma, c, epsilon, lam, most, columns, H,
    gradient, scratch,
):  # fmt: skip
    """`assemble_barrier` for all chunks; `columns` (chunks + 1) are their first node columns."""
    for k in prange(columns.shape[0] - 1):
        assemble_barrier(
            nodes, along_i, along_j, blend_i, blend_j, ki, kj, sigma, c, epsilon, lam, most, 0.0,
            columns[k], columns[k + 1], H[k], gradient, scratch[k],
        )  # fmt: skip
