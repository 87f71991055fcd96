"""The Boussinesq equations on one tensor grid: conservative staggered finite volumes.

The unknowns are the stream function psi on the free nodes and the temperature T in the cells.  The
volume flux through a face is the difference of psi along it, so the net outflow of a cell is zero
to round-off for any psi.  The transposed differences sum the momentum of the faces around each node
and so eliminate the pressure: this is the marker-and-cell scheme [HarlowWelch1965] in
divergence-free unknowns.

    M dpsi/dt + E [(S D psi) (C u)] - nu K psi - (b · B) T = 0,       u = D psi / length
    A dT/dt + W [(D psi) (I T) - kappa G(T)] = 0

D, S, C, E, K and B are `curl`, `spread`, `carry`, `balance`, `friction` and `buoyancy` of
`Momentum`; I, G (with the walls) and W are `values`, `gradient` and `balance` of `Heat`; A are the
cell areas.

The temperature is located in cells, the volume flux on faces, the stream function on nodes.  All
faces are numbered in one array: first those across x, shape (nodes in x, cells in y), then those
across y, shape (cells in x, nodes in y).  A velocity's own control volume reaches from one cell
centre to the next in its own direction and over one cell in the other; its faces lie in the cells'
centres and on the grid's nodes.

Note: the stream function of a periodic layer is zero on one wall only.  Its value on the other is
an additional unknown, the volume flux through the layer; its equation states that there is no mean
pressure gradient.

Systems are solved by sparse LU.  The matrices have symmetric patterns and large diagonals; with
diagonal pivots the elimination can use a minimum-degree ordering of the pattern, which at 160 x 160
cells is three times as fast as column ordering with row exchanges.  If the residual of the solution
shows that a pivot was too small, the matrix is factorised again with exchanges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from shockgrid.hydro.convection.box import PAIRS, Axis, Fluid, Wall, check_walls
from shockgrid.regrid.errors import RunFailure
from shockgrid.regrid.sides import SIDE_NAMES

Matrix = sparse.csr_matrix
Ends = tuple[float, float]  # of an axis: 1 if the wall's value is given, 0 if the slope vanishes
SOLUTION_TOLERANCE = 1e-6  # of the residual of a solution, relative to the right-hand side


def kron(component: int, along: Matrix | np.ndarray, cross: Matrix | np.ndarray) -> Matrix:
    """Product of a matrix along the direction `component` (0: x) and one across it.

    A one-dimensional array represents a diagonal matrix.  (scipy's `kron` is five times slower on
    such small matrices.)
    """
    first, second = (along, cross) if component == 0 else (cross, along)
    (rows, columns, values, shape), (rows2, columns2, values2, shape2) = map(
        get_entries, (first, second)
    )
    row = (rows[:, None] * shape2[0] + rows2).ravel()
    column = (columns[:, None] * shape2[1] + columns2).ravel()
    entries = ((values[:, None] * values2).ravel(), (row, column))
    return sparse.csr_matrix(entries, shape=(shape[0] * shape2[0], shape[1] * shape2[1]))


def get_entries(matrix: Matrix | np.ndarray):
    """(rows, columns, values, shape) of a matrix, or of the diagonal matrix of an array."""
    if isinstance(matrix, np.ndarray):
        place = np.arange(matrix.size)
        return place, place, matrix, (matrix.size, matrix.size)
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    return rows, matrix.indices, matrix.data, matrix.shape


def scale_rows(factors: np.ndarray, matrix: Matrix) -> Matrix:
    """Multiply every row of a matrix by its factor."""
    data = matrix.data * np.repeat(factors, np.diff(matrix.indptr))
    return sparse.csr_matrix((data, matrix.indices, matrix.indptr), shape=matrix.shape)


@dataclass(frozen=True)
class Topology:
    """The matrices that do not depend on the node positions."""

    free: Matrix  # unknowns of the stream function -> all nodes
    through: int | None  # the unknown that is the volume flux through a periodic layer
    curl: Matrix  # unknowns -> volume flux of all faces
    curl_transposed: Matrix
    spread: Matrix  # volume fluxes of faces -> through the faces of control volumes
    averages: tuple[Matrix, Matrix]  # velocities of faces -> cells
    outflows: tuple[tuple[Matrix, Matrix], tuple[Matrix, Matrix]]
    # of both components: fluxes in cells and on nodes -> out of control volumes
    outflow: Matrix  # all of these
    balance: Matrix  # fluxes through faces -> out of the cells


@lru_cache(maxsize=8)
def make_topology(cells: tuple[int, int], periodic: tuple[bool, bool]) -> Topology:
    """The topology of a grid with the given numbers of cells."""
    axes = tuple(Axis(np.arange(n + 1.0), p) for n, p in zip(cells, periodic, strict=True))
    # unknowns of the stream function
    free, through = free_nodes(axes)
    curls = []
    averages = []
    halves = []
    outflows = []
    balance = []
    # operators along each axis: products of one along it and one across
    for k in (0, 1):
        axis = axes[k]
        cross = axes[1 - k]
        nodes = np.ones(axis.node_count)
        inside = np.ones(cross.cells)
        out_of_nodes = kron(k, nodes, cross.difference_to_cells())
        curls.append((1.0 - 2.0 * k) * out_of_nodes)
        averages.append(kron(k, axis.average_to_cells(), inside))
        halves.append(kron(k, axis.halves_to_nodes(), np.ones(cross.node_count)))
        outflows.append((kron(k, axis.difference_to_nodes(), inside), out_of_nodes))
        balance.append(kron(k, axis.difference_to_cells(), inside))
    # put together over both components
    curl = (sparse.vstack(curls) @ free).tocsr()
    spread = [[averages[0], None], [None, halves[0]], [None, averages[1]], [halves[1], None]]
    return Topology(
        free=free,
        through=through,
        curl=curl,
        curl_transposed=curl.T.tocsr(),
        spread=sparse.bmat(spread, "csr"),
        averages=tuple(averages),
        outflows=tuple(outflows),
        outflow=sparse.block_diag([sparse.hstack(pair) for pair in outflows], "csr"),
        balance=sparse.hstack(balance, "csr"),
    )


def free_nodes(axes: tuple[Axis, Axis]) -> tuple[Matrix, int | None]:
    """Matrix from the unknowns of the stream function to all nodes, and the index of the unknown
    that is the volume flux through a periodic layer (None in a box)."""
    shape = tuple(axis.node_count for axis in axes)
    number = np.full(shape, -1)
    inner = tuple(slice(None) if axis.periodic else slice(1, -1) for axis in axes)
    number[inner] = np.arange(number[inner].size).reshape(number[inner].shape)
    count = number[inner].size
    through = None
    for axis, far_wall in zip(axes, (number[:, -1], number[-1]), strict=True):
        if axis.periodic:
            far_wall[:] = through = count
            count += 1
    free = np.flatnonzero(number.ravel() >= 0)
    entries = (np.ones(free.size), (free, number.ravel()[free]))
    return sparse.csr_matrix(entries, shape=(number.size, count)), through


class Momentum:
    """Matrices of both velocity components on one grid; "around" is the sum around a free node.

    `ends[k]` of component k: 1 for a no-slip wall, 0 for a free one.
    """

    def __init__(self, axes: tuple[Axis, Axis], ends: tuple[Ends, Ends], topology: Topology):
        self.axes = axes
        self.topology = topology
        lengths = []
        reaches = []
        stress = []
        values = []
        for k in (0, 1):
            axis = axes[k]
            cross = axes[1 - k]
            nodes = np.ones(axis.node_count)
            length = np.outer(nodes, cross.widths)
            reach = np.outer(axis.distances, np.ones(cross.cells))
            lengths.append((length if k == 0 else length.T).ravel())
            reaches.append((reach if k == 0 else reach.T).ravel())
            values.append(kron(k, nodes, cross.interpolate_to_nodes()))
            along = scale_rows(1.0 / axis.widths, axis.difference_to_cells())
            across = scale_rows(1.0 / cross.distances, cross.difference_to_nodes(*ends[k]))
            out_of_cells, out_of_nodes = topology.outflows[k]
            stress.append(
                out_of_cells @ kron(k, along, cross.widths)
                + out_of_nodes @ kron(k, axis.distances, across)
            )
        self.lengths = np.concatenate(lengths)
        self.reaches = np.concatenate(reaches)
        over = scale_rows(1.0 / self.lengths, topology.curl)
        first, second = topology.averages
        blocks = [[first, None], [values[0], None], [None, second], [None, values[1]]]
        self.carry: Matrix = sparse.bmat(blocks, "csr")  # velocities -> faces of control volumes
        # sums around free nodes: of friction over viscosity, and of momentum
        self.friction: Matrix = (over.T @ (sparse.block_diag(stress, "csr") @ over)).tocsr()
        weighted = scale_rows(self.reaches / self.lengths, topology.curl)
        self.mass: Matrix = topology.curl_transposed @ weighted

    @property
    def curl(self) -> Matrix:
        """Unknowns of the stream function -> volume flux of all faces."""
        return self.topology.curl

    @cached_property
    def velocity(self) -> Matrix:
        """Unknowns -> velocity on the faces of control volumes."""
        return self.carry @ scale_rows(1.0 / self.lengths, self.curl)

    @cached_property
    def volume_flux(self) -> Matrix:
        """Unknowns -> volume flux through the faces of control volumes."""
        return self.topology.spread @ self.curl

    @cached_property
    def balance(self) -> Matrix:
        """Fluxes through the faces of control volumes -> sums around free nodes."""
        return self.topology.curl_transposed @ scale_rows(1.0 / self.lengths, self.topology.outflow)

    @cached_property
    def buoyancy(self) -> tuple[Matrix, Matrix]:
        """Temperature -> sums around free nodes of a unit force in x and in y."""
        pulls = []
        cut = self.axes[0].node_count * self.axes[1].cells
        for k, columns in ((0, slice(0, cut)), (1, slice(cut, None))):
            axis = self.axes[k]
            cross = self.axes[1 - k]
            reach = scale_rows(axis.distances, axis.interpolate_to_nodes())
            pull = kron(k, reach, np.ones(cross.cells))
            pulls.append(self.topology.curl_transposed[:, columns] @ pull)
        return tuple(pulls)

    def sum_around(self, momentum: np.ndarray) -> np.ndarray:
        """Sums of the control volumes' momentum around the free nodes, free of pressure."""
        return self.topology.curl_transposed @ (momentum / self.lengths)

    def sum_carried(self, carried: np.ndarray) -> np.ndarray:
        """Sums around the free nodes of the fluxes through the faces of control volumes."""
        return self.sum_around(self.topology.outflow @ carried)


@dataclass(frozen=True)
class Heat:
    """Matrices of the temperature."""

    values: Matrix  # temperature -> faces, linear in the distance, 0 on walls
    gradient: Matrix  # temperature -> slope times length on the faces
    balance: Matrix  # fluxes through faces -> out of the cells
    conduction: Matrix  # temperature -> balance of the gradient


def make_heat(axes: tuple[Axis, Axis], ends: tuple[Ends, Ends], topology: Topology) -> Heat:
    """`ends[k]`: 1 if the wall across direction k is isothermal, else 0."""
    values = []
    gradient = []
    for k in (0, 1):
        axis = axes[k]
        cross = axes[1 - k]
        slope = scale_rows(1.0 / axis.distances, axis.difference_to_nodes(*ends[k]))
        values.append(kron(k, axis.interpolate_to_nodes(), np.ones(cross.cells)))
        gradient.append(kron(k, slope, cross.widths))
    slopes = sparse.vstack(gradient, "csr")
    balance = topology.balance
    return Heat(sparse.vstack(values, "csr"), slopes, balance, balance @ slopes)


class Equations:
    """The discrete equations of one grid; psi (free,) [m2/s], temperature (cells,) [K] are flat."""

    def __init__(self, x: np.ndarray, y: np.ndarray, walls: Mapping[str, Wall]):
        """Nodes x (nx + 1,), y (ny + 1,) [m].  Raises BadInput from the axes and the walls."""
        check_walls(walls)
        self.walls = dict(walls)
        periodic = [walls[low].flow == "periodic" for low, _ in PAIRS]
        self.axes = (Axis(x, periodic[0], "x"), Axis(y, periodic[1], "y"))
        self.shape = tuple(axis.cells for axis in self.axes)
        self.areas = np.outer(*(axis.widths for axis in self.axes)).ravel()
        self.topology = make_topology(self.shape, tuple(periodic))
        self.free = self.topology.free
        self.through = self.topology.through
        slip = [tuple(float(walls[s].flow != "free") for s in pair) for pair in PAIRS]
        self.momentum = Momentum(self.axes, (slip[1], slip[0]), self.topology)
        held = [
            tuple(float(walls[s].temperature is not None or walls[s].flow == "periodic") for s in p)
            for p in PAIRS
        ]
        self.heat = make_heat(self.axes, tuple(held), self.topology)
        self.wall_temperature, self.wall_gradient, self.wall_flux = self._wall_terms()

    @property
    def face_shapes(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of the faces across x and across y."""
        across, up = self.axes
        return (across.node_count, up.cells), (across.cells, up.node_count)

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of unknowns: stream function, temperature."""
        return self.free.shape[1], self.areas.size

    def split_faces(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Split an array over all faces into its two parts, in their shapes."""
        first, second = self.face_shapes
        cut = first[0] * first[1]
        return values[:cut].reshape(first), values[cut:].reshape(second)

    def _wall_terms(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """On all faces: temperature of isothermal walls [K]; its part of slope times length [K];
        the given heat through other walls, in +x or +y [K m2/s].  Zero elsewhere."""
        whole = [np.zeros(self.momentum.lengths.size) for _ in range(3)]
        for k, (low, high) in enumerate(PAIRS):
            axis = self.axes[k]
            cross = self.axes[1 - k]
            if axis.periodic:
                continue
            face_values = [self.split_faces(values)[k] for values in whole]
            if k == 1:
                face_values = [values_of_faces.T for values_of_faces in face_values]
            for end, sign, side in ((0, -1.0, low), (-1, 1.0, high)):
                temperature, flux = self.walls[side].sample(cross.centres)
                if temperature is not None:
                    face_values[0][end] = temperature
                    face_values[1][end] = sign * temperature / axis.distances[end] * cross.widths
                face_values[2][end] = sign * flux * cross.widths
        return tuple(whole)

    def buoyancy(self, fluid: Fluid) -> sparse.csr_matrix:
        """Temperature -> sums of the buoyancy around the free nodes."""
        across, up = self.momentum.buoyancy
        return fluid.buoyancy[0] * across + fluid.buoyancy[1] * up

    def compute_fluxes(self, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Volume fluxes [m2/s] through the faces across x and across y."""
        return self.split_faces(self.momentum.curl @ psi)

    def compute_velocities(self, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocities [m/s] on the faces across x (u) and across y (v)."""
        return self.split_faces((self.momentum.curl @ psi) / self.momentum.lengths)

    def compute_divergence(self, psi: np.ndarray) -> np.ndarray:
        """Net outflow of each cell [m2/s], shape of the cells: zero to round-off."""
        return (self.heat.balance @ (self.momentum.curl @ psi)).reshape(self.shape)

    def compute_conduction(self, fluid: Fluid, temperature: np.ndarray) -> np.ndarray:
        """kappa dT/dn times length on all faces [K m2/s], n in +x or +y."""
        slope = self.heat.gradient @ temperature + self.wall_gradient
        return fluid.diffusivity * slope + self.wall_flux

    def compute_wall_heat(self, fluid: Fluid, temperature: np.ndarray, side: str) -> np.ndarray:
        """Heat over rho cp that enters through each face of a wall [K m2/s], shape (cells,)."""
        k, high = divmod(SIDE_NAMES.index(side), 2)
        faces = self.split_faces(self.compute_conduction(fluid, temperature))[k]
        return np.take(faces, -1 if high else 0, axis=k) * (1.0 if high else -1.0)

    def compute_residual(
        self, fluid: Fluid, psi: np.ndarray, temperature: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Both equations without their time derivatives; zero in the steady state."""
        momentum = self.momentum.balance @ (
            (self.momentum.volume_flux @ psi) * (self.momentum.velocity @ psi)
        )
        momentum -= fluid.viscosity * (self.momentum.friction @ psi)
        momentum -= self.buoyancy(fluid) @ temperature
        carried = (self.momentum.curl @ psi) * (self.heat.values @ temperature)
        heat = self.heat.balance @ (carried - self.compute_conduction(fluid, temperature))
        return momentum, heat

    def compute_jacobian(
        self, fluid: Fluid, psi: np.ndarray, temperature: np.ndarray
    ) -> sparse.csc_matrix:
        """Derivative of `compute_residual` by (psi, temperature)."""
        flux = self.momentum.volume_flux @ psi
        velocity = self.momentum.velocity @ psi
        carried = scale_rows(flux, self.momentum.velocity)
        carried += scale_rows(velocity, self.momentum.volume_flux)
        momentum = self.momentum.balance @ carried - fluid.viscosity * self.momentum.friction
        curl = self.momentum.curl
        values = self.heat.values
        heat_by_psi = self.heat.balance @ (scale_rows(values @ temperature, curl))
        heat = self.heat.balance @ (scale_rows(curl @ psi, values))
        heat -= fluid.diffusivity * self.heat.conduction
        return sparse.bmat([[momentum, -self.buoyancy(fluid)], [heat_by_psi, heat]], "csc")


class Factors:
    """LU of a square sparse matrix, for any number of calls of `solve`."""

    def __init__(self, matrix: sparse.spmatrix, what: str = "matrix"):
        """Factorise; `what` names the matrix in messages.  Raises RunFailure if it is singular."""
        self.matrix = matrix.tocsc()
        self.what = what
        self.exchanged = False
        try:
            self._factors = _factorise(
                self.matrix,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:
            self._exchange_rows()

    def _exchange_rows(self) -> None:
        self.exchanged = True
        try:
            self._factors = _factorise(self.matrix)
        except RuntimeError as error:
            raise RunFailure(
                f"convection: the {self.what} is singular", cause="singular"
            ) from error

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solution (n,) for `right` (n,); raises RunFailure if no accurate one is found."""
        solution = self._factors.solve(right)
        if not self._is_good(solution, right) and not self.exchanged:
            self._exchange_rows()
            solution = self._factors.solve(right)
        if not self._is_good(solution, right):
            raise RunFailure(
                f"convection: the {self.what} is singular to working precision", cause="singular"
            )
        return solution

    def _is_good(self, solution: np.ndarray, right: np.ndarray) -> bool:
        residual = np.abs(self.matrix @ solution - right).max()
        return bool(residual <= SOLUTION_TOLERANCE * np.abs(right).max())


def _factorise(matrix: sparse.csc_matrix, **options):
    """`splu`, with MemoryError if SuperLU's factors exceed memory or its index range."""
    try:
        return splu(matrix, **options)
    except SystemError as error:  # "gstrf was called with invalid arguments"
        raise MemoryError from error
