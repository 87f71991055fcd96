"""A block's state on another grid: mass, momentum and total energy conserved, and a state again.

Density, both momenta and total energy per volume are linear in each old cell.  Total energy holds
the internal, the void and the kinetic energy, so that what velocity loses by averaging becomes
heat.  Where the linear fields of a cell give a corner that is no state of the material, or one of
next to no sound speed, or a pressure beyond those around, all its slopes are lessened together:
what lies between corners is then a state too, and so is any average of it.

Slivers: along a curved side the polygons through other nodes differ by slivers between chords.
What lies in old cells outside the new grid is given away, what new cells need beyond the old grid
is filled with their own covered mean; each row of cells that begins at the nearest face of the new
side takes the balance, by mass.  The cell at the side alone would take a relative change of density
of an eighth of a face's angle of turn, in a metal many gigapascals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial import cKDTree

from shockgrid.hydro.eos import EquationOfState
from shockgrid.hydro.eos.conversion import compute_conserved, find_held, make_conversion
from shockgrid.hydro.remap.overlay import (
    MEAN,
    SLOPE_X,
    SLOPE_Y,
    Overlay,
    compute_cell_moments,
    make_linear_fields,
    overlay_grids,
)
from shockgrid.hydro.rows import HELD_ARRAYS, RHO, P, U, V
from shockgrid.regrid.errors import BadInput, Place, RunFailure
from shockgrid.regrid.measure.quality import find_bad_cells, say_not_convex
from shockgrid.regrid.sides import J_MIN, SIDE_NAMES, get_sides

LEAST_SLIVER = 1e-13  # part of a cell from which on a gap is no round-off
FLOW_QUANTITIES = 4  # mass, momentum x, y and energy, before what is carried
LEAST_LEFT = 0.05  # of a cell's density and c² that its linear fields must leave at its corners
FILTERS = (minimum_filter, maximum_filter)
BEYOND_SIDES = 0.05  # of density and rho c²: how far beyond those around corners at a side may be
LOCATED_CELLS_CHUNK = 2048  # cells whose corners are looked at together, as they fit into the cache
SLOPE_FRACTIONS = (1.0, 0.75, 0.5, 0.25, 0.0)  # of the slopes, tried in this order
MOST_SLIVERS = 0.05  # part of a block's volume by which outlines may differ


@dataclass(frozen=True)
class Slivers:
    """How much did not fit: cells with a sliver, volumes removed and filled [m² or m³/rad]."""

    count: int
    given: float
    borrowed: float


def find_side_faces(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles (2, n) of the faces of all four sides, and the number (n,) of each one's side.

    nodes (2, ni+1, nj+1) [m].
    """
    lines = get_sides(nodes)
    middles = [0.5 * (line[:, 1:] + line[:, :-1]) for line in lines]
    owners = np.repeat(np.arange(len(lines)), [line.shape[1] - 1 for line in lines])
    return np.concatenate(middles, axis=1), owners


def fill_in(overlay: Overlay, fields: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Means (n, mi, mj) in the new cells, each of what covers it; where nothing does, the nearest.

    fields (ni, nj, n, 3), centres (2, ni, nj): of the old cells.  Nothing is conserved here where
    the outlines differ.
    """
    covered_volume = overlay.covered[..., 0]
    is_bare = covered_volume <= 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        means = overlay.taken / covered_volume[..., None]
    if is_bare.any():
        nearest = cKDTree(centres.reshape(2, -1).T).query(overlay.centres[:, is_bare].T)[1]
        means[is_bare] = fields.reshape(-1, *fields.shape[2:])[nearest, :, MEAN]
    return np.moveaxis(means, -1, 0)


def balance_slivers(
    overlay: Overlay,
    fields: np.ndarray,
    volumes: np.ndarray,
    centres: np.ndarray,
    new_nodes: np.ndarray,
) -> tuple[np.ndarray, Slivers]:
    """Integrals (mi, mj, n) over the new cells, whose sums are those over the old ones.

    fields (ni, nj, n, 3), the first quantity being the density; volumes (ni, nj) and centres (2,
    ni, nj) of the old cells; new_nodes (2, mi+1, mj+1).  Theory F12.4.
    """
    # what of old cells lies outside the new grid, and what new cells need beyond the old one
    left_over = volumes - overlay.used[..., 0]
    gives = left_over > LEAST_SLIVER * volumes
    lacking = overlay.volumes - overlay.covered[..., 0]
    borrows = lacking > LEAST_SLIVER * overlay.volumes
    content = overlay.taken.copy()
    slivers = Slivers(
        int(gives.sum() + borrows.sum()),
        float(left_over[gives].sum()),
        float(lacking[borrows].sum()),
    )
    if slivers.count == 0:
        return content, slivers
    # new cells are filled with their own mean; old ones give their linear fields away
    means = np.moveaxis(fill_in(overlay, fields, centres), 0, -1)
    loans = means[borrows] * lacking[borrows][:, None]
    content[borrows] += loans
    missing = -overlay.covered[borrows][:, 1:]
    left_moments = -overlay.used[gives][
        :, 1:
    ]  # first moments of what is left, as those of a cell are 0
    gifts = (
        fields[gives][..., MEAN] * left_over[gives][:, None]
        + fields[gives][..., SLOPE_X] * left_moments[:, :1]
        + fields[gives][..., SLOPE_Y] * left_moments[:, 1:]
    )
    # both go to the nearest face of a side
    positions = np.concatenate([
        centres[:, gives].T + left_moments / left_over[gives][:, None],
        overlay.centres[:, borrows].T + missing / lacking[borrows][:, None],
    ])  # fmt: skip
    middles, owners = find_side_faces(new_nodes)
    balance = np.zeros((len(owners), content.shape[-1]))
    np.add.at(balance, cKDTree(middles.T).query(positions)[1], np.concatenate([gifts, -loans]))
    # and from there, by mass, to the cells of the line that starts at it
    for side in range(len(SIDE_NAMES)):
        axis = 0 if side < J_MIN else 1
        mass = content[..., 0] / content[..., 0].sum(axis=axis, keepdims=True)
        content = content + mass[..., None] * np.expand_dims(balance[owners == side], axis)
    return content, slivers


class CellLimits(NamedTuple):
    """Linear fields of n cells and what they must keep to at the cells' corners.

    means, slope_x, slope_y (4, n): of mass, both momenta and energy per volume; least, greatest (2,
    n): density and pressure; floors (2, n): density and c² that are to be left; offsets (4, 2, n):
    of the corners from the centres [m].
    """

    means: np.ndarray
    slope_x: np.ndarray
    slope_y: np.ndarray
    least: np.ndarray
    greatest: np.ndarray
    floors: np.ndarray
    offsets: np.ndarray

    def choose(self, which: slice | np.ndarray) -> CellLimits:
        """The same of some cells."""
        return CellLimits(*(array[..., which] for array in self))


def is_state(eos: EquationOfState, state: np.ndarray) -> np.ndarray:
    """Whether rho, u, v, p (4, ...) are finite, with a density and a c² above 0."""
    with np.errstate(all="ignore"):
        c2 = eos.sound_speed_squared_part(state[RHO], state[P], eos.parameters)
        return np.isfinite(state).all(axis=0) & (state[RHO] > 0.0) & (c2 > 0.0)


def find_bounds(eos: EquationOfState, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest density and pressure (2, ni, nj) at the corners of cells.

    Those of rho, u, v, p (4, ni, nj) in the cells around, and beyond them what is of second order
    where density and velocity vary (theory F12.5); at a side also a small part, as smooth fields
    go on there and shocks do not.
    """
    rho, _, _, p = state
    low, high = (find_extreme(state, size=(1, 3, 3), mode="nearest") for find_extreme in FILTERS)
    half_range = 0.5 * (high - low)
    stiffness = rho * eos.sound_speed(rho, p) ** 2
    margin = np.full(p.shape, BEYOND_SIDES)
    margin[1:-1, 1:-1] = 0.0
    slack = np.array([
        margin * rho,
        stiffness * (margin + (half_range[RHO] / rho) ** 2)
        + 0.5 * rho * (half_range[U] ** 2 + half_range[V] ** 2),
    ])  # fmt: skip
    return low[[RHO, P]] - slack, high[[RHO, P]] + slack


def limit_slopes_to_states(
    eos: EquationOfState, fields: np.ndarray, nodes: np.ndarray, centres
) -> int:
    """Lessen slopes of `fields` (ni, nj, n, 3) in place where corners are no states.

    Returns in how many cells.  The first four are those of `compute_conserved`.
    nodes (2, ni+1, nj+1), centres (2, ni, nj) [m].
    """
    flow = fields[..., :FLOW_QUANTITIES, :]
    means = np.ascontiguousarray(np.moveaxis(flow[..., MEAN], -1, 0))
    slopes = np.ascontiguousarray(np.moveaxis(flow[..., SLOPE_X:], (-1, -2), (0, 1)))
    state = find_held(eos, means)["state"]
    least, greatest = find_bounds(eos, state)
    stiffness = eos.sound_speed_squared_part(state[RHO], state[P], eos.parameters)
    corners = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
    cells = CellLimits(
        means=means.reshape(FLOW_QUANTITIES, -1),
        slope_x=slopes[0].reshape(FLOW_QUANTITIES, -1),
        slope_y=slopes[1].reshape(FLOW_QUANTITIES, -1),
        least=least.reshape(2, -1),
        greatest=greatest.reshape(2, -1),
        floors=LEAST_LEFT * np.array([state[RHO], stiffness]).reshape(2, -1),
        offsets=np.array([corner - centres for corner in corners]).reshape(4, 2, -1),
    )
    factor = np.empty(cells.means.shape[1])
    for start in range(0, factor.size, LOCATED_CELLS_CHUNK):
        chunk = slice(start, start + LOCATED_CELLS_CHUNK)
        factor[chunk] = _find_slope_fractions(eos, cells.choose(chunk))
    fields[..., SLOPE_X:] *= factor.reshape(fields.shape[:2])[..., None, None]
    return int((factor < 1.0).sum())


def _find_slope_fractions(eos: EquationOfState, cells: CellLimits) -> np.ndarray:
    """The largest of SLOPE_FRACTIONS (n,) with which all corners of cells are states."""
    to_pressure = make_conversion(type(eos)).to_pressure
    factor = np.zeros(cells.means.shape[1])
    waiting = np.arange(factor.size)
    for fraction in SLOPE_FRACTIONS:
        is_good = np.ones(waiting.size, dtype=bool)
        with np.errstate(all="ignore"):
            for offset_x, offset_y in cells.offsets:
                change = cells.slope_x * offset_x + cells.slope_y * offset_y
                rho, momentum_x, momentum_y, total = cells.means + fraction * change
                kinetic = 0.5 * (momentum_x * momentum_x + momentum_y * momentum_y) / rho
                p, _, _, c2 = to_pressure(rho, (total - kinetic) / rho, eos.parameters)
                least_rho, least_p = cells.least
                greatest_rho, greatest_p = cells.greatest
                floor_rho, floor_c2 = cells.floors
                is_good &= (rho > floor_rho) & (c2 > floor_c2)
                is_good &= (rho >= least_rho) & (rho <= greatest_rho)
                is_good &= (p >= least_p) & (p <= greatest_p)
        factor[waiting[is_good]] = fraction
        waiting = waiting[~is_good]
        cells = cells.choose(~is_good)
        if waiting.size == 0:
            break
    return factor


def check_convex(name: str, nodes: np.ndarray) -> None:
    """Raise BadInput for a grid (2, ni+1, nj+1) with a cell that cannot be cut: not convex."""
    bad_cells = find_bad_cells(nodes)
    if len(bad_cells):
        i, j = (int(index) for index in bad_cells[0])
        raise BadInput(
            f"block {name!r}: {say_not_convex(len(bad_cells))} (the first is i={i}, j={j}), and "
            "what they hold cannot be laid on another grid; take an earlier restart point or dump"
        )


def remap_means(
    means: np.ndarray, nodes: np.ndarray, new_nodes: np.ndarray, curved: bool
) -> np.ndarray:
    """Means (n, mi, mj) of any fields on another grid, each of what covers the cell.

    means (n, ni, nj) of cells of `nodes` (2, ni+1, nj+1); new_nodes (2, mi+1, mj+1) [m]; curved: y
    is the distance from an axis.  All grids convex.  Conservative where the outlines agree.
    """
    _, centres = compute_cell_moments(nodes, curved)
    fields = make_linear_fields(means, nodes, centres)
    return fill_in(overlay_grids(nodes, centres, fields, new_nodes, curved), fields, centres)


def remap_state(
    name: str,
    eos: EquationOfState,
    curved: bool,
    nodes: np.ndarray,
    held: Mapping[str, np.ndarray],
    new_nodes: np.ndarray,
) -> tuple[dict[str, np.ndarray], Slivers]:
    """What the cells of a block hold on a new grid, and the slivers; theory F12.

    held: the arrays of `Block.held_arrays` by name, without ghosts, (..., ni, nj) each, on `nodes`
    (2, ni+1, nj+1); new_nodes (2, mi+1, mj+1).  Returns such arrays.
    Raises BadInput, with the block's name, for cells that are not convex and for outlines that
    differ by more than slivers; RunFailure where an average is no state of the material.
    """
    check_convex(name, nodes)
    check_convex(name, new_nodes)
    # linear fields of conserved quantities, and of carried fields by mass
    volumes, centres = compute_cell_moments(nodes, curved)
    conserved = compute_conserved(eos, *(held[array] for array in HELD_ARRAYS))
    carried = held.get("carried")
    if carried is not None:
        conserved = np.concatenate((conserved, conserved[RHO] * carried))
    fields = make_linear_fields(conserved, nodes, centres)
    limit_slopes_to_states(eos, fields, nodes, centres)
    # cut by the new grid; a second time with constant fields if a result is no state
    for _ in range(2):
        overlay = overlay_grids(nodes, centres, fields, new_nodes, curved)
        content, slivers = balance_slivers(overlay, fields, volumes, centres, new_nodes)
        if max(slivers.given, slivers.borrowed) > MOST_SLIVERS * volumes.sum():
            raise BadInput(
                f"block {name!r}: the outlines of its two grids differ by "
                f"{max(slivers.given, slivers.borrowed) / volumes.sum():.2g} of its volume; only "
                "grids of one outline can take over each other's state"
            )
        new_means = np.moveaxis(content / overlay.volumes[..., None], -1, 0)
        new_held = find_held(eos, new_means[:FLOW_QUANTITIES])
        is_bad = ~is_state(eos, new_held["state"])
        if not is_bad.any():
            if carried is not None:
                new_held["carried"] = new_means[FLOW_QUANTITIES:] / new_means[RHO]
            return new_held, slivers
        fields[..., SLOPE_X:] = 0.0  # averages of states, where those of linear fields fail
    i, j = (int(index) for index in np.argwhere(is_bad)[0])
    raise RunFailure(
        f"remap: block {name!r}, cell i={i}, j={j} of the new grid: {eos.failure}; its density "
        f"is {new_means[RHO, i, j]:.6g} kg/m3",
        cause="remap",
        place=Place(name, (i, j)),
    )
