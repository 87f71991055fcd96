"""Lines, area and volume of one cell, from a block's nodes."""

from __future__ import annotations

from hydro.formulas.reconstruction import compute_line_geometry
from regrid.jit import inlined


@inlined
def measure_lines(nodes, i, j):
    """Line vectors and area of a cell."""
    return compute_line_geometry(
        nodes[0, i, j], nodes[1, i, j],
        nodes[0, i + 1, j], nodes[1, i + 1, j],
        nodes[0, i + 1, j + 1], nodes[1, i + 1, j + 1],
        nodes[0, i, j + 1], nodes[1, i, j + 1],
    )  # fmt: skip


@inlined
def measure_volume(nodes, i, j, weigh):
    """Volume of a cell with straight faces; `weigh`: `Geometry.volume`."""
    xi, yi, xj, yj, area = measure_lines(nodes, i, j)
    xa, ya = nodes[0, i, j], nodes[1, i, j]
    xb, yb = nodes[0, i + 1, j], nodes[1, i + 1, j]
    xc, yc = nodes[0, i + 1, j + 1], nodes[1, i + 1, j + 1]
    xd, yd = nodes[0, i, j + 1], nodes[1, i, j + 1]
    return weigh(
        area, xi, yi, xj, yj, (xa - xb) + (xc - xd), (ya - yb) + (yc - yd),
        0.25 * ((ya + yc) + (yb + yd)),
    )  # fmt: skip
