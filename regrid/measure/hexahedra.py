"""Validity of a grid of hexahedra: the eight corner volumes of every cell.

A corner volume is the triple product of the three edges that leave a node of the cell, positive
where i, j, k turn like x, y, z.  Note: eight positive corners are what is asked of a cell here;
with strongly warped faces the trilinear map may still fold between them.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.jit import kernel


@kernel
def fill_least_corner_volumes(nodes, out):
    """Least of the eight corner volumes of every cell into `out` (n1, n2, n3); NaN stays NaN."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            row = out[i, j]
            for corner in range(8):
                a = corner & 1
                b = (corner >> 1) & 1
                c = corner >> 2
                x, y, z = nodes[0, i + a, j + b], nodes[1, i + a, j + b], nodes[2, i + a, j + b]
                # Neighbours of the corner's row along i and along j.
                p = i + 1 - a
                q = j + 1 - b
                xi, yi, zi = nodes[0, p, j + b], nodes[1, p, j + b], nodes[2, p, j + b]
                xj, yj, zj = nodes[0, i + a, q], nodes[1, i + a, q], nodes[2, i + a, q]
                sign = float((1 - 2 * a) * (1 - 2 * b) * (1 - 2 * c))
                for k in range(out.shape[2]):
                    x0, y0, z0 = x[k + c], y[k + c], z[k + c]
                    ax, ay, az = xi[k + c] - x0, yi[k + c] - y0, zi[k + c] - z0
                    bx, by, bz = xj[k + c] - x0, yj[k + c] - y0, zj[k + c] - z0
                    cx, cy, cz = x[k + 1 - c] - x0, y[k + 1 - c] - y0, z[k + 1 - c] - z0
                    volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz)
                    volume = sign * (volume + az * (bx * cy - by * cx))
                    least = volume if corner == 0 else row[k]
                    row[k] = least if least < volume else volume


def compute_least_corner_volumes(nodes: np.ndarray) -> np.ndarray:
    """Least corner volume (n1, n2, n3) of every cell of nodes (3, n1+1, n2+1, n3+1)."""
    nodes = np.ascontiguousarray(nodes, dtype=np.float64)
    if nodes.ndim != 4 or nodes.shape[0] != 3 or min(nodes.shape[1:]) < 2:
        raise BadInput(f"grid: nodes must have shape (3, n1+1, n2+1, n3+1), got {nodes.shape}")
    out = np.empty(tuple(n - 1 for n in nodes.shape[1:]))
    fill_least_corner_volumes(nodes, out)
    if not np.isfinite(nodes).all():
        # A comparison may lose a NaN: such cells are never valid.
        broken = ~np.isfinite(nodes).all(axis=0)
        for corner in np.ndindex(2, 2, 2):
            cells = tuple(slice(c, c + n) for c, n in zip(corner, out.shape, strict=True))
            out[broken[cells]] = np.nan
    return out


def find_bad_hexahedra(nodes: np.ndarray) -> np.ndarray:
    """Cells (n, 3) as (i, j, k) with a corner volume that is not positive, worst first."""
    least = compute_least_corner_volumes(nodes)
    cells = np.argwhere(~(least > 0.0))
    return cells[np.argsort(least[tuple(cells.T)], kind="stable")]


def compute_corner_volumes(nodes: np.ndarray) -> np.ndarray:
    """All eight corner volumes (8, n1, n2, n3) of nodes (3, n1+1, n2+1, n3+1), in m3."""
    return np.array([_triple_product(*edges) for edges in _corner_edges(nodes)])


def compute_corner_ratio(nodes: np.ndarray, previous: np.ndarray) -> float:
    """Least ratio of a corner volume to that of the same corner in `previous`."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.min(compute_corner_volumes(nodes) / compute_corner_volumes(previous)))


def compute_least_jacobian(nodes: np.ndarray, points: int = 5) -> np.ndarray:
    """Least Jacobian (n1, n2, n3) of the trilinear map at points³ places of every cell, in m3.

    The places are even, corners included: more than the eight corners, still no proof.
    """
    ways = np.linspace(0.0, 1.0, points)
    least = np.full([n - 1 for n in nodes.shape[1:]], np.inf)
    for place in np.ndindex(points, points, points):
        edges = []
        for axis in range(3):
            edge = np.diff(nodes, axis=axis + 1)
            for other in range(3):
                if other != axis:
                    way = ways[place[other]]
                    before = (slice(None),) * (other + 1)
                    low, high = edge[(*before, slice(None, -1))], edge[(*before, slice(1, None))]
                    edge = (1.0 - way) * low + way * high
            edges.append(edge)
        least = np.minimum(least, _triple_product(*edges))
    return least


def _corner_edges(nodes: np.ndarray):
    """The three edges of each of the eight corners, of all cells, along the indices."""
    for corner in np.ndindex(2, 2, 2):
        edges = []
        for axis in range(3):
            edge = np.diff(nodes, axis=axis + 1)
            for other in range(3):
                if other != axis:
                    part = slice(1, None) if corner[other] else slice(None, -1)
                    edge = edge[(slice(None),) * (other + 1) + (part,)]
            edges.append(edge)
        yield edges


def compute_hexahedron_sines(nodes: np.ndarray) -> np.ndarray:
    """Least of the eight corner sines (n1, n2, n3) of every cell; nodes (3, n1+1, n2+1, n3+1).

    NaN at an edge of no length.
    """
    least = None
    with np.errstate(invalid="ignore", divide="ignore"):
        for edges in _corner_edges(nodes):
            triple = _triple_product(*edges)
            sizes = [np.sqrt((edge**2).sum(axis=0)) for edge in edges]
            sine = triple / (sizes[0] * sizes[1] * sizes[2])
            least = sine if least is None else np.minimum(least, sine)
    return least


def compute_mid_lines(nodes: np.ndarray) -> list[np.ndarray]:
    """Vectors (3, n1, n2, n3) between the centres of opposite faces, along the three indices."""
    lines = []
    for axis in range(3):
        line = np.diff(nodes, axis=axis + 1)
        for other in range(1, 4):
            if other != axis + 1:
                before = (slice(None),) * other
                line = 0.5 * (line[(*before, slice(1, None))] + line[(*before, slice(None, -1))])
        lines.append(line)
    return lines


def compute_volumes(nodes: np.ndarray) -> np.ndarray:
    """Signed volumes (n1, n2, n3) by mid-lines."""
    return _triple_product(*compute_mid_lines(nodes))


def compute_hexahedron_aspects(nodes: np.ndarray) -> np.ndarray:
    """Longest over shortest mid-line (n1, n2, n3)."""
    lengths = [np.sqrt((line**2).sum(axis=0)) for line in compute_mid_lines(nodes)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.maximum.reduce(lengths) / np.minimum.reduce(lengths)


def _triple_product(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
