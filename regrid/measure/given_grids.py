"""What a regridder is given, as arrays that its kernels can work on, or a sentence why not.

Lists, whole numbers, single precision, any order in memory, views and read-only arrays: all become
C-contiguous float64.  A block far smaller or larger than any body, or so far from the origin that
its coordinates no longer tell its nodes apart, is refused.

The trap: this runs in front of every regrid; arrays that need nothing cost two microseconds.
"""

from __future__ import annotations

import math

import numpy as np

from regrid.errors import BadInput
from regrid.jit import kernel
from regrid.sides import get_sides

FLOAT64 = np.dtype(np.float64)
LEAST_SIZE, MOST_SIZE = 1e-150, 1e150  # of a block, in m: squares of its areas are still numbers
NEAR = 1e9  # sizes of the block from the origin up to which nothing has to be looked at
COARSE = 0.01  # of a mean cell: the most that coordinates may be rounded to
EVERYDAY = 1e-40, 1e40  # sizes whose tenth powers need no unit of their own


def take_grids(previous, boundary) -> tuple[np.ndarray, np.ndarray]:
    """Both as C-contiguous float64 of shape (2, ni+1, nj+1), in m; themselves where they are.

    Raises BadInput for what is no array of real numbers, for shapes that do not fit, for blocks
    outside LEAST_SIZE to MOST_SIZE, and for those too far from the origin.
    """
    previous = take_nodes(previous, "previous")
    boundary = take_nodes(boundary, "boundary")
    if previous.shape != boundary.shape:
        raise BadInput(
            f"regrid: previous has shape {previous.shape}, boundary {boundary.shape}; "
            "they must agree"
        )
    if not are_ordinary(previous, boundary):
        _check_size(previous, "previous")
        _check_size(boundary, "boundary")
    return previous, boundary


def take_nodes(nodes, name: str) -> np.ndarray:
    """A grid as C-contiguous float64; BadInput, with its `name`, for what is no (2, ni+1, nj+1)."""
    nodes = take_numbers(nodes, name)
    shape = nodes.shape
    if len(shape) != 3 or shape[0] != 2 or shape[1] < 2 or shape[2] < 2:
        raise BadInput(f"regrid: {name} has shape {shape}; it must be (2, ni+1, nj+1), ni, nj >= 1")
    return nodes


def take_numbers(values, name: str) -> np.ndarray:
    """`values` as C-contiguous float64 of any shape; BadInput for what is no real numbers."""
    if type(values) is np.ndarray and values.dtype == FLOAT64 and values.flags.carray:
        return values
    if np.ma.is_masked(values):
        raise BadInput(f"regrid: {name} has masked values; give a number for every node")
    try:
        found = np.asarray(values)
    except ValueError:
        found = np.empty(0, dtype=object)
    if found.dtype.kind not in "iuf":
        kind = type(values).__name__ if found.dtype.kind == "O" else found.dtype.name
        raise BadInput(f"regrid: {name} must be an array of real numbers, not {kind}")
    return np.array(found, dtype=FLOAT64, order="C")


def find_unit(nodes: np.ndarray) -> float:
    """The power of two to divide `nodes` (2, ni+1, nj+1) by before tenth powers of lengths.

    1 for everyday sizes; in other units a block has the same bits, but for the exponent.
    """
    size = measure_corners_span(nodes)
    if EVERYDAY[0] < size < EVERYDAY[1] or not 0.0 < size < math.inf:
        return 1.0
    return 2.0 ** math.frexp(size)[1]


@kernel
def measure_corners_span(nodes):
    """The longest way, along x or y, from the first corner of `nodes` to its three others, in m."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    size = 0.0
    for k in range(2):
        for i, j in ((ni, 0), (0, nj), (ni, nj)):
            size = max(size, abs(nodes[k, i, j] - nodes[k, 0, 0]))
    return size


@kernel
def are_ordinary(previous, boundary):
    """Have both grids (2, ni+1, nj+1), by their corners, a usual size and place?  False for NaN."""
    for nodes in (previous, boundary):
        size = measure_corners_span(nodes)
        away = abs(nodes[0, 0, 0]) + abs(nodes[1, 0, 0])
        if not (LEAST_SIZE < size and size < MOST_SIZE and away < NEAR * size):
            return False
    return True


def _check_size(nodes: np.ndarray, name: str) -> None:
    """Refuse what is no block's size or place; the corners alone could not tell."""
    sides = np.concatenate(get_sides(nodes), axis=1)
    if not np.isfinite(sides).all():
        return  # named by whoever explains failures
    with np.errstate(over="ignore"):
        size = float(np.ptp(sides, axis=1).max())
    if size > 0.0 and not LEAST_SIZE < size < MOST_SIZE:
        raise BadInput(
            f"regrid: the block of {name} is {size:.3g} m across; sizes between {LEAST_SIZE:g} and "
            f"{MOST_SIZE:g} m can be regridded: choose another unit of length"
        )
    cell = size / max(nodes.shape[1:])
    if size > 0.0 and np.spacing(np.abs(sides).max()) > COARSE * cell:
        raise BadInput(
            f"regrid: the block of {name} lies {np.abs(sides).max() / cell:.1g} of its cells away "
            "from the origin, and its coordinates have no digits left for its cells: give them "
            "relative to one of its nodes"
        )
