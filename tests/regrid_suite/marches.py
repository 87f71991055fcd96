"""What a march is: a grid to start from, and the nodes of its sides at every step.

A march has dim = 2 or 3; grids have the shape (dim, ni+1, nj+1[, nk+1]).  Note: `boundary(k)`
has NaN inside, so that nobody can read a grid that is not given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from shockgrid.regrid.algebraic import transfinite_grid

PLANE_SIDES = ("i_min", "i_max", "j_min", "j_max")
SPACE_SIDES = (*PLANE_SIDES, "k_min", "k_max")
SAMPLES = 257  # parameters at which the travel of the boundary is measured


def name_sides(dim: int) -> tuple[str, ...]:
    """Names of the sides of a block in `dim` dimensions, in their order."""
    return PLANE_SIDES if dim == 2 else SPACE_SIDES


def get_side(nodes: np.ndarray, name: str) -> np.ndarray:
    """A view (dim, ...) of the side of `nodes` (dim, ni+1, nj+1[, nk+1]) called `name`."""
    axis = "ijk".index(name[0]) + 1
    return nodes[(slice(None),) * axis + (0 if name.endswith("min") else -1,)]


@dataclass(frozen=True)
class March:
    """A named march: `start` (dim, ni+1, nj+1[, nk+1]), and `sides[name]` (steps+1, dim, ...).

    `parameter` (steps+1,): what the formula was taken at; `deforming`: the sides at which the first
    line is looked at; `sound` (steps+1, ni, nj), where known: the cells' sound speeds [m/s].
    """

    name: str
    about: str
    formula: str
    start: np.ndarray
    sides: dict[str, np.ndarray]
    parameter: np.ndarray
    deforming: tuple[str, ...]
    sound: np.ndarray | None = field(default=None)

    @property
    def steps(self) -> int:
        """Number of steps of the march."""
        return len(self.parameter) - 1

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.start)

    @property
    def inner_nodes(self) -> int:
        """Number of nodes that a regridder has to place."""
        return int(np.prod([n - 2 for n in self.start.shape[1:]]))

    def boundary(self, step: int) -> np.ndarray:
        """The sides after `step` steps in an array like `start`, NaN inside."""
        nodes = np.full_like(self.start, np.nan)
        for name, line in self.sides.items():
            get_side(nodes, name)[...] = line[step]
        return nodes


def measure_shortest_edge(nodes: np.ndarray) -> float:
    """The shortest edge of a grid (dim, ...) [m]."""
    edges = (np.diff(nodes, axis=axis) for axis in range(1, nodes.ndim))
    return min(float(np.sqrt((edge**2).sum(axis=0)).min()) for edge in edges)


def interpolate_faces(faces: np.ndarray) -> np.ndarray:
    """Transfinite interpolation of six faces (3, n1+1, n2+1, n3+1); uniform in the indices."""
    total = np.zeros_like(faces)
    parts = []
    for axis in (1, 2, 3):
        count = faces.shape[axis]
        shape = [1, 1, 1, 1]
        shape[axis] = count
        parts.append(np.linspace(0.0, 1.0, count).reshape(shape))

    def project(nodes: np.ndarray, axis: int) -> np.ndarray:
        low, high = (np.take(nodes, [end], axis=axis) for end in (0, -1))
        return (1.0 - parts[axis - 1]) * low + parts[axis - 1] * high

    # Boolean sum P1 + P2 + P3 - P1P2 - P1P3 - P2P3 + P1P2P3, of faces, edges and corners alone.
    for axis in (1, 2, 3):
        total = total + project(faces, axis)
    for first, second in ((1, 2), (1, 3), (2, 3)):
        total = total - project(project(faces, first), second)
    total = total + project(project(project(faces, 1), 2), 3)
    inside = (slice(None), *(slice(1, -1),) * 3)
    out = faces.copy()
    out[inside] = total[inside]
    return out


def make_march(
    name: str,
    place: Callable[..., tuple],
    cells: tuple[int, ...],
    cells_a_step: float,
    deforming: tuple[str, ...],
) -> March:
    """The march of a formula of `shapes` or `solids`, in steps of equal travel.

    No boundary node goes further in a step than `cells_a_step` shortest edges of the start grid.
    """
    axes = [np.linspace(0.0, 1.0, n + 1) for n in cells]
    at = np.meshgrid(*axes, indexing="ij")
    names = name_sides(len(cells))

    def take(a: float) -> dict[str, np.ndarray]:
        square = np.array(at)
        return {
            side: np.array(np.broadcast_arrays(*place(*get_side(square, side), a)), dtype=float)
            for side in names
        }

    start = np.full((len(cells), *(n + 1 for n in cells)), np.nan)
    first = take(0.0)
    for side in names:
        get_side(start, side)[...] = first[side]
    start = transfinite_grid(start) if len(cells) == 2 else interpolate_faces(start)
    samples = np.linspace(0.0, 1.0, SAMPLES)
    travel = np.zeros(SAMPLES)
    last = first
    for k, a in enumerate(samples[1:], start=1):
        following = take(a)
        ways = (np.sqrt(((following[s] - last[s]) ** 2).sum(axis=0)).max() for s in names)
        travel[k] = travel[k - 1] + max(ways)
        last = following
    steps = max(1, int(np.ceil(travel[-1] / (cells_a_step * measure_shortest_edge(start)))))
    parameter = np.interp(np.linspace(0.0, travel[-1], steps + 1), travel, samples)
    taken = [take(a) for a in parameter]
    about, _, formula = (place.__doc__ or "").strip().partition("\n")
    return March(
        name=name,
        about=about,
        formula=" ".join(formula.split()),
        start=start,
        sides={side: np.array([sides[side] for sides in taken]) for side in names},
        parameter=parameter,
        deforming=deforming,
    )
