"""The doubled signed area of one triangle, as the barrier's kernels need it."""

from __future__ import annotations

from regrid.jit import part


@part
def doubled_area(nodes, i, j, k, l, m, n):
    """(second - first) × (third - first) of three nodes."""
    x, y = nodes[0], nodes[1]
    return (x[k, l] - x[i, j]) * (y[m, n] - y[i, j]) - (y[k, l] - y[i, j]) * (x[m, n] - x[i, j])
