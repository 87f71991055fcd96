"""A convecting box: its fluid, its walls, and one axis of its tensor grid.

    du/dt + div(u u) = -grad p + nu lap u + b T,      div u = 0
    dT/dt + div(u T) = kappa lap T

with b = -expansion · gravity [m/s2/K], a vector.  Scaled with L, kappa/L and dT, nu = Pr, kappa = 1
and |b| = Ra Pr.

A side is either a wall (no-slip or free) that is isothermal, adiabatic or has a given flux, or
periodic together with the opposite side.  Temperatures and fluxes may be functions of the
coordinate along the wall (conducting walls, a heated strip).

An axis has n cells between `nodes` x[0..n].  Values are located either in the cells (n, at the
midpoints) or on the nodes (n + 1; n on a periodic axis, whose last node is the first).  Note: on an
uneven grid the midpoint of a node's two neighbouring cell centres is not the node.  Interpolation
to a node is therefore linear in distance, while a node's control volume reaches from one cell
centre to the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import SIDE_NAMES

PAIRS = (("i_min", "i_max"), ("j_min", "j_max"))
FEWEST_CELLS = 3


@dataclass(frozen=True)
class Fluid:
    """viscosity nu [m2/s], diffusivity kappa [m2/s], buoyancy (x, y) [m/s2/K]."""

    viscosity: float
    diffusivity: float
    buoyancy: tuple[float, float]

    def __post_init__(self):
        """Raises BadInput for nu or kappa that is not positive, or numbers that are not finite."""
        for name in ("viscosity", "diffusivity"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise BadInput(f"the fluid's {name} is {value:g}; it must be positive")
        if not all(math.isfinite(value) for value in self.buoyancy):
            raise BadInput(f"the fluid's buoyancy is {self.buoyancy}; it must be finite")

    @property
    def prandtl(self) -> float:
        """nu/kappa."""
        return self.viscosity / self.diffusivity

    def compute_rayleigh(self, length: float = 1.0, difference: float = 1.0) -> float:
        """|b| dT L³/(nu kappa)."""
        return (
            math.hypot(*self.buoyancy)
            * difference
            * length**3
            / (self.viscosity * self.diffusivity)
        )

    def at_rayleigh(self, rayleigh: float) -> Fluid:
        """The same fluid with the buoyancy for Ra = `rayleigh` in the scales L = dT = 1."""
        size = math.hypot(*self.buoyancy)
        if size == 0.0:
            raise BadInput(
                "this fluid has no buoyancy, so that its Rayleigh number cannot be changed"
            )
        factor = rayleigh * self.viscosity * self.diffusivity / size
        return Fluid(
            self.viscosity, self.diffusivity, tuple(factor * value for value in self.buoyancy)
        )


def turn_gravity(tilt: float) -> tuple[float, float]:
    """Unit vector of gravity, turned by `tilt` degrees anticlockwise from straight down."""
    quarter, remainder = divmod(tilt, 90.0)
    angle = math.radians(remainder)
    x, y = math.sin(angle), -math.cos(angle)
    for _ in range(int(quarter) % 4):  # quarter turns are exact
        x, y = -y, x
    return x + 0.0, y + 0.0


def make_fluid(rayleigh: float, prandtl: float, tilt: float = 0.0) -> Fluid:
    """The fluid with the given Ra and Pr in the scales L, kappa/L, dT.

    Gravity points down, turned by `tilt` degrees anticlockwise.  Raises BadInput for Ra < 0 and
    Pr <= 0.
    """
    if not (math.isfinite(rayleigh) and rayleigh >= 0.0):
        raise BadInput(
            f"Ra = {rayleigh:g} is negative; heat the other wall or turn gravity instead"
            if math.isfinite(rayleigh)
            else f"Ra = {rayleigh} is not a number"
        )
    if not (math.isfinite(prandtl) and prandtl > 0.0):
        raise BadInput(f"Pr = {prandtl:g} must be positive")
    if not math.isfinite(tilt):
        raise BadInput(f"tilt = {tilt} is not an angle in degrees")
    x, y = turn_gravity(tilt)
    strength = rayleigh * prandtl
    return Fluid(prandtl, 1.0, (-strength * x, -strength * y))


Along = float | Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Wall:
    """One side.

    `flow`: "no-slip", "free" (no shear stress) or "periodic".  `temperature` [K] makes it
    isothermal; `flux` [K m/s] is the heat flux into the fluid over rho cp; without either it is
    adiabatic.  Both are numbers or functions of the coordinate along the wall.
    """

    flow: str = "no-slip"
    temperature: Along | None = None
    flux: Along | None = None

    def sample(self, along: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
        """(temperature or None, flux) at the coordinates `along` (n,)."""

        def values(wall_values: Along) -> np.ndarray:
            values_along = wall_values(along) if callable(wall_values) else wall_values
            return np.broadcast_to(np.asarray(values_along, dtype=np.float64), along.shape)

        if self.temperature is not None:
            return values(self.temperature), np.zeros_like(along)
        return None, values(0.0 if self.flux is None else self.flux)


def isothermal(temperature: Along, flow: str = "no-slip") -> Wall:
    """A wall of given temperature."""
    return Wall(flow, temperature=temperature)


def adiabatic(flow: str = "no-slip") -> Wall:
    """A wall without heat flux."""
    return Wall(flow)


def heated(flux: Along, flow: str = "no-slip") -> Wall:
    """A wall with a given heat flux into the fluid."""
    return Wall(flow, flux=flux)


PERIODIC = Wall("periodic")


def check_walls(walls: Mapping[str, Wall]) -> None:
    """Raise BadInput for walls that are missing, unknown, or contradict each other."""
    if set(walls) != set(SIDE_NAMES):
        wrong = sorted(set(walls) ^ set(SIDE_NAMES))
        raise BadInput(
            f"a convection cell has the sides {', '.join(SIDE_NAMES)}; check {wrong[0]!r}"
        )
    # each side by itself
    for side in SIDE_NAMES:
        wall = walls[side]
        if wall.flow not in ("no-slip", "free", "periodic"):
            raise BadInput(
                f"side {side}: flow {wall.flow!r} is not known; no-slip, free, periodic are"
            )
        if wall.temperature is not None and wall.flux is not None:
            raise BadInput(
                f"side {side} has both a temperature and a flux, which contradict; give one"
            )
        if wall.flow == "periodic" and (wall.temperature is not None or wall.flux is not None):
            raise BadInput(f"side {side} is periodic and so has no temperature or flux of its own")
    # both of a pair
    for low, high in PAIRS:
        if (walls[low].flow == "periodic") != (walls[high].flow == "periodic"):
            lonely = low if walls[low].flow == "periodic" else high
            opposite = high if lonely == low else low
            raise BadInput(
                f"side {lonely} is periodic but {opposite} is a wall; they must both be periodic"
            )
    if all(wall.flow == "periodic" for wall in walls.values()):
        raise BadInput("a convection cell cannot be periodic both ways; give it two walls")


def fixes_temperature(walls: Mapping[str, Wall]) -> bool:
    """Whether any side is isothermal."""
    return any(wall.temperature is not None for wall in walls.values())


class Axis:
    """Increasing nodes (n + 1,) [m] of one direction; `periodic` joins its ends."""

    def __init__(self, nodes: np.ndarray, periodic: bool = False, name: str = "x"):
        """Raises BadInput for fewer than three cells, or nodes not increasing or not finite."""
        nodes = np.ascontiguousarray(nodes, dtype=np.float64)
        cells = nodes.size - 1
        if cells < FEWEST_CELLS:
            raise BadInput(
                f"a convection grid has {cells} cells in {name}; it needs at least {FEWEST_CELLS}"
            )
        if not np.isfinite(nodes).all() or not (np.diff(nodes) > 0.0).all():
            raise BadInput(f"the nodes of a convection grid do not rise in {name}")
        self.nodes = nodes
        self.periodic = periodic
        self.name = name
        self.cells = cells
        self.node_count = cells if periodic else cells + 1
        self.widths = np.diff(nodes)
        self.centres = 0.5 * (nodes[1:] + nodes[:-1])
        self.length = float(nodes[-1] - nodes[0])
        # of a node's control volume: centre to centre, half a cell at a wall
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

        At a wall the value beyond is 0, scaled by `low` or `high`: 1 if the wall's own value is
        subtracted (the caller adds it), 0 if the difference vanishes.
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
        """Distance (n,) from the previous cell's centre to this one's, across the periodic ends."""
        return 0.5 * (self.widths + np.roll(self.widths, 1))

    def _to_nodes(self, before, after, low: float, high: float) -> sparse.csr_matrix:
        """Weights of each cell at the node before it (`before`) and after it (`after`)."""
        here = np.arange(self.cells)
        behind = (here + 1) % self.node_count
        before = before.copy()
        after = after.copy()
        if not self.periodic:
            before[-1] = high
            after[0] = low
        rows = np.concatenate([behind, here])
        columns = np.tile(here, 2)
        values = np.concatenate([before, after])
        return sparse.csr_matrix((values, (rows, columns)), shape=(self.node_count, self.cells))
