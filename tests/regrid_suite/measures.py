"""What is measured of a grid and of a step: in words and formulas; the page has the same list.

Nodes r (2, ni+1, nj+1), or (3, ni+1, nj+1, nk+1).  A cell has the middle lines l_i, l_j[, l_k]
between the middles of opposite faces, and the area, or volume, V = l_i x l_j[ . l_k].

    valid         every corner triangle (tetrahedron) of every cell is positive; in the plane by the
                  sign of exact rational arithmetic where rounding leaves a doubt
    simple        no two segments of the boundary touch but neighbours at their node, exactly
    overlap       Σ|A_c| / |Σ A_c| - 1 of the grid that was not valid: folded area, twice
    sine          least sine of all corners: (a x b)/(|a||b|), in space (a x b . c)/(|a||b||c|)
    sine 1 %      the quantile .01 over cells of the cell's least sine
    aspect        longest over shortest middle line of a cell
    smoothness    quantile .99 over inner faces of max(V/V', V'/V) of the two cells
    gap           distance of the first line from a side over that of straight lines (theory R1.6)
    node speed    the largest way of an inner node in a step over that of a boundary node
    rate          largest c Σ|l|/V, c = 1 where no sound speed is given: a flow's step is 1/rate
    lag           largest distance of the grid from the one that further calls on the same sides
                  lead to, over the mean edge

Note: a valid grid on a simple boundary covers each point once; on one that crosses itself cells
may be convex and overlap.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.measure.corners import compute_turns
from shockgrid.regrid.measure.faults import walk_boundary
from shockgrid.regrid.measure.hexahedra import (
    compute_hexahedron_aspects,
    compute_hexahedron_sines,
    find_bad_hexahedra,
)
from shockgrid.regrid.measure.hexahedra import compute_mid_lines as compute_space_lines
from shockgrid.regrid.measure.hexahedra import compute_volumes as compute_space_volumes
from shockgrid.regrid.measure.quality import (
    compute_aspect_ratio,
    compute_corner_areas,
    compute_mid_lines,
    compute_scaled_jacobians,
    find_bad_cells,
    measure_first_line_gap,
)


def count_bad_cells(nodes: np.ndarray) -> int:
    """Cells that are not convex, in space those with a corner volume that is not positive."""
    if not np.isfinite(nodes).all():
        return int(np.prod([n - 1 for n in nodes.shape[1:]]))
    return len(find_bad_cells(nodes) if len(nodes) == 2 else find_bad_hexahedra(nodes))


def compute_lines(nodes: np.ndarray) -> list[np.ndarray]:
    """Middle lines of all cells, (dim, ni, nj[, nk]) for each index."""
    return list(compute_mid_lines(nodes) if len(nodes) == 2 else compute_space_lines(nodes))


def compute_sizes(nodes: np.ndarray) -> np.ndarray:
    """Signed areas or volumes (ni, nj[, nk]) of all cells."""
    if len(nodes) == 3:
        return compute_space_volumes(nodes)
    (ax, ay), (bx, by) = compute_lines(nodes)
    return ax * by - ay * bx


def compute_sines(nodes: np.ndarray) -> np.ndarray:
    """Least corner sine (ni, nj[, nk]) of every cell."""
    if len(nodes) == 3:
        return compute_hexahedron_sines(nodes)
    return compute_scaled_jacobians(nodes).min(axis=0)


def measure_overlap(nodes: np.ndarray) -> float:
    """Σ|A|/|ΣA| - 1 over corner triangles (cells in space): 0 where nothing is folded."""
    areas = compute_corner_areas(nodes) if len(nodes) == 2 else compute_sizes(nodes)
    return float(np.abs(areas).sum() / max(abs(areas.sum()), 1e-300) - 1.0)


def measure_aspect(nodes: np.ndarray) -> float:
    """Longest over shortest middle line, of the worst cell."""
    compute = compute_aspect_ratio if len(nodes) == 2 else compute_hexahedron_aspects
    return float(compute(nodes).max())


def measure_smoothness(nodes: np.ndarray) -> float:
    """Quantile .99 of the larger over the smaller of two cells with a common face."""
    log = np.log(np.maximum(compute_sizes(nodes), 1e-300))
    jumps = [np.abs(np.diff(log, axis=axis)).ravel() for axis in range(log.ndim)]
    return float(np.exp(np.quantile(np.concatenate(jumps), 0.99)))


def measure_gap(nodes: np.ndarray, sides: tuple[str, ...]) -> float:
    """The largest first line gap (theory R1.6) of these sides of a plane grid."""
    return max(measure_first_line_gap(nodes, side) for side in sides)


def compute_rates(nodes: np.ndarray, sound: np.ndarray | float = 1.0) -> np.ndarray:
    """c Σ|l|/V (ni, nj[, nk]) [1/s]; `sound` (ni, nj[, nk]) [m/s]."""
    lengths = sum(np.sqrt((line**2).sum(axis=0)) for line in compute_lines(nodes))
    return sound * lengths / compute_sizes(nodes)


def measure_node_speed(old: np.ndarray, new: np.ndarray) -> float:
    """Largest way of an inner node over that of a boundary node; 0 where no boundary node moves."""
    way = np.sqrt(((new - old) ** 2).sum(axis=0))
    inside = (slice(1, -1),) * way.ndim
    inner = float(way[inside].max())
    way[inside] = 0.0
    return inner / float(way.max()) if way.max() > 0.0 else 0.0


def measure_mean_edge(nodes: np.ndarray) -> float:
    """Mean length of all edges [m]."""
    edges = (np.diff(nodes, axis=axis) for axis in range(1, nodes.ndim))
    return float(np.mean([np.sqrt((edge**2).sum(axis=0)).mean() for edge in edges]))


def find_boundary_crossing(nodes: np.ndarray) -> tuple[int, int] | None:
    """Two segments of the closed boundary of a plane grid that touch, exactly, or None.

    Segments are counted along `walk_boundary`; neighbours touch where one folds back onto the
    other.  Signs of turns are exact (`regrid.measure.corners`).
    """
    line, _ = walk_boundary(nodes)
    count = line.shape[1]
    a = line
    b = np.roll(line, -1, axis=1)
    low, high = np.minimum(a, b), np.maximum(a, b)
    apart = (low[:, :, None] > high[:, None]) | (high[:, :, None] < low[:, None])
    first, second = np.nonzero(np.triu(~apart.any(axis=0), k=1))
    beside = (second == first + 1) | ((first == 0) & (second == count - 1))
    p = first[~beside]
    q = second[~beside]
    turns = [
        compute_turns(*points)[0]
        for points in (
            (a[:, p], b[:, p], a[:, q]),
            (a[:, p], b[:, p], b[:, q]),
            (a[:, q], b[:, q], a[:, p]),
            (a[:, q], b[:, q], b[:, p]),
        )
    ]
    # The products of turns are those of signs; with overlapping boxes they settle lines in line.
    touch = (turns[0] * turns[1] <= 0) & (turns[2] * turns[3] <= 0)
    if touch.any():
        found = int(np.argmax(touch))
        return int(p[found]), int(q[found])
    last = np.roll(line, 1, axis=1)
    back = compute_turns(last, a, b)[0] == 0
    back &= ((a - last) * (b - a)).sum(axis=0) < 0.0
    if back.any():
        found = int(np.argmax(back))
        return (found - 1) % count, found
    return None
