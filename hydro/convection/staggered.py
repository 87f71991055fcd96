"""Sparse matrices of the marker-and-cell arrangement [HarlowWelch1965] on a tensor grid.

Cells carry the temperature, faces the volume flux through them, nodes the stream function.  All
faces are numbered in one array: first those across x, shape (nodes in x, cells in y), then those
across y, shape (cells in x, nodes in y).  A velocity's own control volume reaches from one cell
centre to the next in its own direction and over one cell in the other; its faces lie in the
cells' centres and on the grid's nodes.

The trap: the stream function of a periodic layer is zero on one wall only.  Its value on the other
is an unknown of its own, the volume that flows through the layer; the equation for it says that
no mean pressure gradient drives it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from hydro.convection.axis import Axis

Matrix = sparse.csr_matrix
Ends = tuple[float, float]  # of an axis: 1 where a wall's own value counts, 0 where slope vanishes


def kron(component: int, own, cross) -> Matrix:
    """Product of a matrix along the direction `component` (0: x) and one across it."""
    return sparse.kron(own, cross, "csr") if component == 0 else sparse.kron(cross, own, "csr")


def free_nodes(axes: tuple[Axis, Axis]) -> tuple[Matrix, int | None]:
    """Matrix from the unknowns of the stream function to all nodes, and the place of the unknown
    that is the volume flux through a periodic layer (None in a box)."""
    shape = tuple(axis.node_count for axis in axes)
    number = np.full(shape, -1)
    inner = tuple(slice(None) if axis.periodic else slice(1, -1) for axis in axes)
    number[inner] = np.arange(number[inner].size).reshape(number[inner].shape)
    count, through = number[inner].size, None
    for axis, far_wall in zip(axes, (number[:, -1], number[-1]), strict=True):
        if axis.periodic:
            far_wall[:] = through = count
            count += 1
    free = np.flatnonzero(number.ravel() >= 0)
    entries = (np.ones(free.size), (free, number.ravel()[free]))
    return sparse.csr_matrix(entries, shape=(number.size, count)), through


@dataclass(frozen=True)
class Component:
    """One velocity component: matrices on its faces, or on the faces of its control volumes."""

    curl: Matrix  # stream function (nodes) -> volume flux
    lengths: np.ndarray  # of its faces [m]
    reaches: np.ndarray  # of its control volumes in its own direction, centre to centre [m]
    averages: Matrix  # values -> cells
    halves: Matrix  # volume fluxes of the *other* component -> nodes
    values: Matrix  # values -> nodes, linear in the distance, 0 on walls
    balances: tuple[Matrix, Matrix]  # out of its control volumes: of what cells, nodes carry
    friction: Matrix  # values -> sum of the slopes times lengths around its control volumes
    buoyancy: Matrix  # temperature -> its mean times the reach


def make_component(k: int, axes: tuple[Axis, Axis], ends: Ends) -> Component:
    """Matrices of the velocity in direction `k`; `ends`: 1 where a wall across holds the fluid,
    0 where the fluid slips along it."""
    own, cross = axes[k], axes[1 - k]
    nodes, cells = sparse.identity(own.node_count), sparse.identity(cross.cells)
    out_of_cells = kron(k, own.difference_to_nodes(), cells)
    out_of_nodes = kron(k, nodes, cross.difference_to_cells())
    along = sparse.diags(1.0 / own.widths) @ own.difference_to_cells()
    across = sparse.diags(1.0 / cross.distances) @ cross.difference_to_nodes(*ends)
    friction = out_of_cells @ kron(k, along, sparse.diags(cross.widths))
    friction += out_of_nodes @ kron(k, sparse.diags(own.distances), across)
    spread = np.ones(cross.cells), np.ones(own.node_count)
    lengths, reaches = np.outer(spread[1], cross.widths), np.outer(own.distances, spread[0])
    return Component(
        curl=(1.0 - 2.0 * k) * kron(k, nodes, cross.difference_to_cells()),
        lengths=(lengths if k == 0 else lengths.T).ravel(),
        reaches=(reaches if k == 0 else reaches.T).ravel(),
        averages=kron(k, own.average_to_cells(), cells),
        halves=kron(k, own.halves_to_nodes(), sparse.identity(cross.node_count)),
        values=kron(k, nodes, cross.interpolate_to_nodes()),
        balances=(out_of_cells, out_of_nodes),
        friction=friction,
        buoyancy=kron(k, sparse.diags(own.distances) @ own.interpolate_to_nodes(), cells),
    )


@dataclass(frozen=True)
class Momentum:
    """Both components stacked; "around" is the sum around each free node that has no pressure."""

    curl: Matrix  # free nodes -> volume flux of all faces
    lengths: np.ndarray
    reaches: np.ndarray
    spread: Matrix  # volume fluxes of faces -> through the faces of control volumes
    carry: Matrix  # velocities of faces -> on the faces of control volumes
    around: Matrix  # momentum of control volumes -> sums around free nodes, free of the pressure
    balance: Matrix  # what faces of control volumes carry -> the same sums
    friction: Matrix  # free nodes -> the same sums of the friction over the viscosity
    mass: Matrix  # free nodes -> the same sums of the momentum
    buoyancy: tuple[Matrix, Matrix]  # temperature -> the same sums of a unit pull in x, in y


def make_momentum(axes: tuple[Axis, Axis], ends: tuple[Ends, Ends], free: Matrix) -> Momentum:
    """Stack both components; `ends[k]` are those of the component k, see `make_component`."""
    first, second = (make_component(k, axes, ends[k]) for k in (0, 1))
    curl = (sparse.vstack([first.curl, second.curl]) @ free).tocsr()
    lengths = np.concatenate([first.lengths, second.lengths])
    reaches = np.concatenate([first.reaches, second.reaches])
    spread = [
        [first.averages, None],
        [None, first.halves],
        [None, second.averages],
        [second.halves, None],
    ]
    carry = [
        [first.averages, None],
        [first.values, None],
        [None, second.averages],
        [None, second.values],
    ]
    over = sparse.diags(1.0 / lengths)
    around = (curl.T @ over).tocsr()
    balances = [sparse.hstack(component.balances) for component in (first, second)]
    stress = sparse.block_diag([first.friction, second.friction])
    pulls = sparse.block_diag([first.buoyancy, second.buoyancy], "csc")
    pulls = [curl.T @ part for part in (pulls[:, : axes[0].cells * axes[1].cells],
                                        pulls[:, axes[0].cells * axes[1].cells :])]  # fmt: skip
    return Momentum(
        curl=curl,
        lengths=lengths,
        reaches=reaches,
        spread=sparse.bmat(spread, "csr"),
        carry=sparse.bmat(carry, "csr"),
        around=around,
        balance=(around @ sparse.block_diag(balances)).tocsr(),
        friction=(around @ stress @ over @ curl).tocsr(),
        mass=(around @ sparse.diags(reaches) @ curl).tocsr(),
        buoyancy=tuple(pull.tocsr() for pull in pulls),
    )


@dataclass(frozen=True)
class Heat:
    """Matrices of the temperature."""

    values: Matrix  # temperature -> faces, linear in the distance, 0 on walls
    gradient: Matrix  # temperature -> slope times length on the faces
    balance: Matrix  # what faces carry -> out of the cells
    conduction: Matrix  # temperature -> balance of the gradient


def make_heat(axes: tuple[Axis, Axis], ends: tuple[Ends, Ends]) -> Heat:
    """`ends[k]`: 1 where the wall across direction k is isothermal, 0 where it is not."""
    values, gradient, balance = [], [], []
    for k in (0, 1):
        own, cross = axes[k], axes[1 - k]
        cells, widths = sparse.identity(cross.cells), sparse.diags(cross.widths)
        slope = sparse.diags(1.0 / own.distances) @ own.difference_to_nodes(*ends[k])
        values.append(kron(k, own.interpolate_to_nodes(), cells))
        gradient.append(kron(k, slope, widths))
        balance.append(kron(k, own.difference_to_cells(), cells))
    whole = sparse.hstack(balance, "csr"), sparse.vstack(gradient, "csr")
    return Heat(sparse.vstack(values, "csr"), whole[1], whole[0], (whole[0] @ whole[1]).tocsr())
