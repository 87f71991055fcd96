"""Quality of a grid in space: corner sines, aspect ratio and volume of its hexahedra.

A corner's sine is the triple product of its three edges over the product of their lengths: 1 for a
box, positive at all eight corners of a valid cell.  Volume and aspect ratio are those of the
three mid-lines, which join the centres of opposite faces ([KS] (3.12)).
"""

from __future__ import annotations

import numpy as np


def compute_hexahedron_sines(nodes: np.ndarray) -> np.ndarray:
    """Least of the eight corner sines (n1, n2, n3) of every cell; nodes (3, n1+1, n2+1, n3+1).

    NaN at an edge of no length.
    """
    least = None
    with np.errstate(invalid="ignore", divide="ignore"):
        for corner in np.ndindex(2, 2, 2):
            edges = []
            for axis in range(3):
                edge = np.diff(nodes, axis=axis + 1)
                for other in range(3):
                    if other != axis:
                        part = slice(1, None) if corner[other] else slice(None, -1)
                        edge = edge[(slice(None),) * (other + 1) + (part,)]
                edges.append(edge)
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
                ahead = [slice(None)] * 4
                behind = [slice(None)] * 4
                ahead[other], behind[other] = slice(1, None), slice(None, -1)
                line = 0.5 * (line[tuple(ahead)] + line[tuple(behind)])
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
