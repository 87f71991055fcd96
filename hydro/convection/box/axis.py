"""One direction of a tensor grid: widths, distances and the sparse matrices that act along it.

An axis has n cells between `nodes` x[0..n].  Values stand either in the cells (n of them, at the
midpoints) or on the nodes (n + 1; in a periodic axis n, the last being the first again).

The trap: on an uneven grid the midpoint of a node's two neighbouring cell centres is not the node.
Interpolation to a node is therefore linear in distance, while a node's control volume reaches from
one cell centre to the next.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from regrid.errors import BadInput

FEWEST_CELLS = 3


class Axis:
    """Nodes (n + 1,) [m] of one direction, rising; `periodic` joins its ends."""

    def __init__(self, nodes: np.ndarray, periodic: bool = False, name: str = "x"):
        """Raises BadInput for fewer than three cells, nodes that do not rise or are not finite."""
        nodes = np.ascontiguousarray(nodes, dtype=np.float64)
        cells = nodes.size - 1
        if cells < FEWEST_CELLS:
            raise BadInput(
                f"a convection grid has {cells} cells in {name}; it needs at least {FEWEST_CELLS}"
            )
        if not np.isfinite(nodes).all() or not (np.diff(nodes) > 0.0).all():
            raise BadInput(f"the nodes of a convection grid do not rise in {name}")
        self.nodes, self.periodic, self.name = nodes, periodic, name
        self.cells = cells
        self.node_count = cells if periodic else cells + 1
        self.widths = np.diff(nodes)
        self.centres = 0.5 * (nodes[1:] + nodes[:-1])
        self.length = float(nodes[-1] - nodes[0])
        # of the node's control volume: centre to centre, half a cell at a wall
        half = 0.5 * self.widths
        if periodic:
            self.distances = half + np.roll(half, 1)
        else:
            self.distances = np.concatenate([half[:1], half[1:] + half[:-1], half[-1:]])

    def difference_to_cells(self) -> sparse.csr_matrix:
        """f[i+1] - f[i] of nodal values, in the cells."""
        return self._to_cells(-1.0, 1.0)

    def average_to_cells(self) -> sparse.csr_matrix:
        """(f[i] + f[i+1])/2 of nodal values, in the cells."""
        return self._to_cells(0.5, 0.5)

    def _to_cells(self, left: float, right: float) -> sparse.csr_matrix:
        here = np.arange(self.cells)
        columns = np.concatenate([here, (here + 1) % self.node_count])
        values = np.repeat([left, right], self.cells)
        shape = (self.cells, self.node_count)
        return sparse.csr_matrix((values, (np.tile(here, 2), columns)), shape=shape)

    def difference_to_nodes(self, low: float = 1.0, high: float = 1.0) -> sparse.csr_matrix:
        """f[i] - f[i-1] of cell values, on the nodes.

        At a wall the value beyond is 0, times `low` or `high`: 1 where the wall's own value is
        subtracted (the caller adds what it is), 0 where the difference is to vanish.
        """
        ones = np.ones(self.cells)
        return self._to_nodes(-ones, ones, low, -high)

    def halves_to_nodes(self) -> sparse.csr_matrix:
        """(f[i-1] + f[i])/2 of cell values on the nodes; f/2 at a wall."""
        half = np.full(self.cells, 0.5)
        return self._to_nodes(half, half, 0.5, 0.5)

    def interpolate_to_nodes(self) -> sparse.csr_matrix:
        """Cell values on the nodes, linear in the distance; 0 at a wall."""
        # the weight of a cell is the half width of the other one
        before = 0.5 * np.roll(self.widths, -1) / np.roll(self._inner_distances(), -1)
        after = 0.5 * np.roll(self.widths, 1) / self._inner_distances()
        return self._to_nodes(before, after, 0.0, 0.0)

    def _inner_distances(self) -> np.ndarray:
        """Distance (n,) from the centre of the cell before to this cell's, the ends joined."""
        return 0.5 * (self.widths + np.roll(self.widths, 1))

    def _to_nodes(self, before, after, low: float, high: float) -> sparse.csr_matrix:
        """Weights of each cell for the node behind it (`before`) and ahead of it (`after`)."""
        here = np.arange(self.cells)
        behind = (here + 1) % self.node_count
        before, after = before.copy(), after.copy()
        if not self.periodic:
            before[-1], after[0] = high, low
        rows, columns = np.concatenate([behind, here]), np.tile(here, 2)
        values = np.concatenate([before, after])
        return sparse.csr_matrix((values, (rows, columns)), shape=(self.node_count, self.cells))
