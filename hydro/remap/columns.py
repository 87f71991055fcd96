"""Columns of a block's cells split in two by new grid lines, or merged where a line goes.

A new line j = const runs half way between its neighbours.  Each cell of the column is cut from
middle to middle of two of its edges, so the two halves fill it to the last bit of its outline: they
are convex where it is, no side of the block moves, and nothing is exchanged with another cell or
another block.  Mass, momentum and energy of a half come from the limited linear fields of the
whole (theory F12.3), whose sum over both halves is what the cell held.

A line that goes leaves cells that are not the sums of those it divided: their edges are straight
where the line had a turn.  States are laid on those by `remap_state`.
"""

from __future__ import annotations

import numpy as np

from hydro.eos import EquationOfState
from hydro.remap.conserved import (
    check_convex,
    compute_conserved,
    find_state,
    is_state,
    lessen_slopes,
    remap_state,
)
from hydro.remap.polygons import compute_cell_moments
from hydro.remap.slopes import MEAN, SLOPE_X, SLOPE_Y, make_linear_fields


def split_lines(nodes: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Nodes (2, ni+1, nj+1+n) with a line half way through each of the columns (n,) of cells."""
    columns = np.asarray(columns, dtype=int)
    middles = 0.5 * (nodes[:, :, columns] + nodes[:, :, columns + 1])
    return np.insert(nodes, columns + 1, middles, axis=2)


def split_state(
    name: str,
    eos: EquationOfState,
    curved: bool,
    nodes: np.ndarray,
    state: np.ndarray,
    void_energy: np.ndarray,
    columns: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """New nodes, states (4, ni, nj+n) and void energies after the columns (n,) were split.

    state (4, ni, nj), void_energy (ni, nj) on `nodes` (2, ni+1, nj+1); curved: y is the distance
    from an axis.  Cells of other columns keep their bits.  Raises BadInput, with the block's name,
    where a cell is not convex.
    """
    check_convex(name, nodes)
    columns = np.asarray(columns, dtype=int)
    new_nodes = split_lines(nodes, columns)
    _, centres = compute_cell_moments(nodes, curved)
    fields = make_linear_fields(compute_conserved(eos, state, void_energy), nodes, centres)
    lessen_slopes(eos, fields, nodes, centres)
    new_state = np.insert(state, columns, state[:, :, columns], axis=2)
    new_void = np.insert(void_energy, columns, void_energy[:, columns], axis=1)
    _, new_centres = compute_cell_moments(new_nodes, curved)
    shifts = np.arange(columns.size)
    first = columns + shifts  # the first half of each column in the new order
    whole = fields[:, columns]
    for half in (first, first + 1):
        way = new_centres[:, :, half] - centres[:, :, columns]
        slopes = whole[..., SLOPE_X] * way[0, ..., None] + whole[..., SLOPE_Y] * way[1, ..., None]
        new_state[:, :, half], new_void[:, half] = find_state(
            eos, np.moveaxis(whole[..., MEAN] + slopes, -1, 0)
        )
    # halves that are no states are like the whole: both, or what the cell held would be lost
    bad = ~(is_state(eos, new_state[:, :, first]) & is_state(eos, new_state[:, :, first + 1]))
    for half in (first, first + 1):
        new_state[:, :, half] = np.where(bad, state[:, :, columns], new_state[:, :, half])
        new_void[:, half] = np.where(bad, void_energy[:, columns], new_void[:, half])
    return new_nodes, new_state, new_void


def merge_state(
    name: str,
    eos: EquationOfState,
    curved: bool,
    nodes: np.ndarray,
    state: np.ndarray,
    void_energy: np.ndarray,
    lines: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """New nodes, states (4, ni, nj-n) and void energies without the inner lines j (n,).

    Arguments else, and what is raised: `split_state`; also RunFailure where an average is no state.
    """
    new_nodes = np.ascontiguousarray(np.delete(nodes, lines, axis=2))
    new_state, new_void, _ = remap_state(name, eos, curved, nodes, state, void_energy, new_nodes)
    return new_nodes, new_state, new_void
