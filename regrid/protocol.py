"""The interface of a regridder: a protocol for all, and two for regridders that use the flow.

A regridder moves a grid from step to step.  Most use geometry only (`Regridder`).  A
`CostAwareRegridder` also takes the sound speeds of the cells, and widens cells that limit the time
step.  A `FlowAwareRegridder` follows fields of the flow or places nodes of sides itself: the flow
passes it the fields, and the sides whose nodes it may place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import SIDE_NAMES, get_sides


@dataclass(frozen=True)
class RegridReport:
    """How one regrid went; what a regridder does not do or know stays at its default.

    `iterations` counts linear iterations (newton) or sweeps, `node_iterations` the nodes they
    touched.  `sub_moves` is the number of extra parts the boundary's motion was cut into, `rescues`
    the number of times an untangling was needed.  `least_corner_ratio` is the least new corner area
    relative to the old one at the same corner.  `residual` is the size of the gradient at the
    start: with Newton's method in cells, with sweeps relative to its terms.  `start` names the
    initial guess: "previous", "displacement", "transfinite", "quasi-1d", "followed", "untangled",
    "halved".  `exempt_corners` counts corner triangles left out because the boundary's own nodes
    turn them over, `triangles` the block's corners that its sides make flat
    (`regrid.measure.corners`), `limited_nodes` the nodes whose motion was cut short because a
    corner would have folded or a speed been too high.  `strayed` is how far inner nodes are at most
    from where interpolation of the sides' motion puts them, in heights of the old cells; None where
    the regridder does not know it.  `quality` is what `regrid.measure.quality.measure_worst` says
    of the grid, where the regridder knows it.
    """

    iterations: int = 0
    node_iterations: int = 0
    sub_moves: int = 0
    rescues: int = 0
    least_corner_ratio: float = math.nan
    residual: float = 0.0
    start: str = ""
    exempt_corners: int = 0
    limited_nodes: int = 0
    triangles: int = 0
    strayed: float | None = None
    quality: tuple[float, float, int, int] | None = None


@dataclass(frozen=True)
class RegridResult:
    """A valid grid on the wanted boundary: `nodes` of shape (2, ni+1, nj+1), and its report.

    `nodes` belongs to the caller: a fresh array, or `boundary` where that was asked for.
    """

    nodes: np.ndarray
    report: RegridReport


@runtime_checkable
class Regridder(Protocol):
    """Anything that finds a grid of convex cells on given sides."""

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """A valid grid on the sides of `boundary`, near `previous`; both (2, ni+1, nj+1) in m.

        Of `boundary` only the sides are read.  Raises RegridFailure, with side and nodes, where no
        valid grid exists or is found; BadInput for arrays that do not fit.
        """
        ...


@runtime_checkable
class CostAwareRegridder(Regridder, Protocol):
    """A regridder that may know what a step costs."""

    @property
    def sees_cost(self) -> bool:
        """Whether it wants the sound speeds."""
        ...

    def regrid(
        self,
        previous: np.ndarray,
        boundary: np.ndarray,
        sound_speed: np.ndarray | None = None,
    ) -> RegridResult:
        """As any regridder; `sound_speed` (ni, nj) of the cells in m/s, without it by geometry."""
        ...


@runtime_checkable
class FlowAwareRegridder(Regridder, Protocol):
    """A regridder that may follow a flow; which of it this one does is said by its attributes."""

    free_sides: tuple[str, ...]  # names of sides whose nodes are its own to place, if it owns any

    @property
    def sees_flow(self) -> bool:
        """Whether `take_step` is to be called before every step."""
        ...

    @property
    def owns_sides(self) -> bool:
        """Whether it places the nodes of its `free_sides` itself."""
        ...

    def take_step(self, fields: Mapping[str, np.ndarray], step_fraction: float) -> None:
        """Take the cells' fields by name, (ni, nj) each in SI units, and the next step over
        the stable one, at most 1."""
        ...


def sees_cost(regridder: Regridder) -> bool:
    """Whether the regridder takes the cells' sound speeds."""
    return isinstance(regridder, CostAwareRegridder) and regridder.sees_cost


def find_flow_aware(regridder: Regridder) -> FlowAwareRegridder | None:
    """The regridder itself where it sees the flow or owns sides, else None."""
    if not isinstance(regridder, FlowAwareRegridder):
        return None
    return regridder if regridder.sees_flow or regridder.owns_sides else None


def check_regridder(regridder: object, origin: str) -> None:
    """Raise BadInput for what has no method `regrid`; `origin`: how the caller came by it."""
    if isinstance(regridder, type) or not callable(getattr(regridder, "regrid", None)):
        raise BadInput(
            f"{origin} is {regridder!r}: a regridder is wanted, an object with a method "
            "regrid(previous, boundary)"
        )


def call_regridder(
    regridder: Regridder,
    previous: np.ndarray,
    boundary: np.ndarray,
    *arguments: Any,
    where: str = "",
    in_place: bool = False,
) -> RegridResult:
    """What `regridder.regrid` returns, if it keeps its word about the shape and the sides.

    Nodes of sides that a regridder places itself (`free_sides`) are its own.  `where`: words for a
    message, "block 'gas'"; `in_place`: the grid may be written into `boundary`, whose sides who
    `works_in_place` leaves alone.  Raises BadInput for other sides or no grid at all, and what
    `regrid` raises.
    """
    # trusted: tests hold such regridders to it
    if in_place and hasattr(regridder, "works_in_place"):
        return regridder.regrid(previous, boundary, *arguments, in_place=True)  # type: ignore[call-arg]
    wanted_sides = np.concatenate(get_sides(boundary), axis=1)
    result = regridder.regrid(previous, boundary, *arguments)
    name = f"regridder {type(regridder).__name__}"
    place = f"{name}: {where}" if where else name
    # what it returned is a grid of that shape
    nodes = getattr(result, "nodes", None)
    if not isinstance(nodes, np.ndarray) or not hasattr(result, "report"):
        raise BadInput(
            f"{place}: it returned {type(result).__name__}; a RegridResult of nodes and a report "
            "is wanted"
        )
    if nodes.shape != previous.shape:
        raise BadInput(f"{place}: it returned nodes {nodes.shape}; the grid has {previous.shape}")
    if (np.concatenate(get_sides(nodes), axis=1) == wanted_sides).all():
        return result
    # with the given sides, but for those that it places itself
    free: tuple[str, ...] = ()
    if isinstance(regridder, FlowAwareRegridder) and regridder.owns_sides:
        free = regridder.free_sides
    sides = get_sides(nodes)
    ends = np.cumsum([side.shape[1] for side in sides])[:-1]
    distances = {
        side: float(np.hypot(*(line - wanted)).max())
        for side, line, wanted in zip(
            SIDE_NAMES, sides, np.split(wanted_sides, ends, 1), strict=True
        )
        if side not in free and not np.array_equal(line, wanted)
    }
    if distances:
        side = max(distances, key=distances.__getitem__)
        raise BadInput(
            f"{place}{',' if where else ':'} side {side}: it returned other nodes than it was "
            f"given, up to {distances[side]:.3g} m away; a regridder must return the nodes of the "
            "sides unchanged, bitwise"
        )
    return result
