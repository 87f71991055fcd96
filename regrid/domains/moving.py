"""Domains with a moving boundary: what one is, and how it is made from curves.

Note: s is not the amplitude.  It is scaled so that equal steps of s move the fastest boundary
node by equal distances, and "cells a step" counts the shortest edge of the starting grid at the
deforming sides.  i and j are such that corner areas are positive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from regrid.algebraic import transfinite_grid
from regrid.curves import arc_law
from regrid.errors import BadInput
from regrid.sides import copy_sides

SAMPLES = 129  # amplitudes at which the travel of a side is measured,
SIDES_SAMPLES = 257  # and that of all sides, which may turn corners


@dataclass(frozen=True)
class MovingDomain:
    """A valid grid, `start` (2, ni+1, nj+1), and the motion of its sides, `boundary(s)`."""

    name: str
    start: np.ndarray
    deforming_sides: tuple[str, ...]
    cell: float
    travel: float
    move: Callable[[float], np.ndarray]

    def boundary(self, s: float) -> np.ndarray:
        """Array of the shape of `start` with the four sides at s and NaN inside."""
        return self.move(min(1.0, max(0.0, float(s))))

    def steps_for(self, cells_a_step: float) -> int:
        """Number of equal steps of s in which no boundary node moves further than that."""
        return max(1, int(np.ceil(self.travel / (cells_a_step * self.cell) - 1e-9)))

    @property
    def travel_in_cells(self) -> float:
        """Way of the fastest boundary node over the whole motion."""
        return self.travel / self.cell

    @property
    def suggested_steps(self) -> int:
        """Steps at half a cell each."""
        return self.steps_for(0.5)

    def transposed(self) -> MovingDomain:
        """The same domain with i and j exchanged, mirrored in x = y to keep areas positive."""
        turn = {"i": "j", "j": "i"}
        return replace(
            self,
            name=self.name + "-transposed",
            start=transpose_nodes(self.start),
            deforming_sides=tuple(turn[side[0]] + side[1:] for side in self.deforming_sides),
            move=lambda s: transpose_nodes(self.move(s)),
        )


def transpose_nodes(nodes: np.ndarray) -> np.ndarray:
    """Exchange i and j, and x and y with them, so that positive corner areas stay positive."""
    return np.ascontiguousarray(nodes[::-1].transpose(0, 2, 1))


def distribute_by_arc_length(
    curve: np.ndarray, count: int, law: np.ndarray | None = None
) -> np.ndarray:
    """`count` nodes on the fine polyline `curve` (2, n), equidistant or by `law`, ends included."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=1)))])
    law = np.linspace(0.0, 1.0, count) if law is None else law
    line = np.array([np.interp(law * arc[-1], arc, curve[k]) for k in range(2)])
    line[:, 0], line[:, -1] = curve[:, 0], curve[:, -1]
    return line


def make_box(width: float, heights: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Rectangle with rows at `heights` and columns at the laws `across`, j from right to left."""
    nodes = np.empty((2, heights.size, across.size))
    nodes[0] = width * (1.0 - across)
    nodes[1] = heights[:, None]
    return nodes


def march_line(
    name: str, start: np.ndarray, curve_at: Callable[[float], np.ndarray]
) -> MovingDomain:
    """Domain whose side i_min follows the fine curve `curve_at(amplitude)` from j = 0 to j = nj.

    The side's ends may slide along the straight sides j_min and j_max, whose laws are kept.
    """
    count = start.shape[2]
    law_low, law_high = (arc_law(start[:, :, j]) for j in (0, -1))

    def sides(amplitude: float) -> np.ndarray:
        nodes = np.full_like(start, np.nan)
        nodes[:, -1] = start[:, -1]
        nodes[:, 0] = distribute_by_arc_length(curve_at(amplitude), count)
        for j, law in ((0, law_low), (-1, law_high)):
            foot, top = nodes[:, 0, j], nodes[:, -1, j]
            nodes[:, :, j] = foot[:, None] + law * (top - foot)[:, None]
            nodes[:, 0, j], nodes[:, -1, j] = foot, top
        return nodes

    amplitudes = np.linspace(0.0, 1.0, SAMPLES)
    lines = np.array([distribute_by_arc_length(curve_at(a), count) for a in amplitudes])
    steps = np.hypot(*np.diff(lines, axis=0).transpose(1, 0, 2)).max(axis=1)
    grid = start.copy()
    copy_sides(sides(0.0), grid)  # the curve's own nodes
    cell = find_shortest_edge(start, "i_min")
    return _make_domain(name, grid, ("i_min",), cell, (amplitudes, steps, sides))


def _make_domain(name, start, deforming_sides, cell: float, motion) -> MovingDomain:
    """The domain of a motion: amplitudes (n,), the longest ways (n - 1,) of a side's node between
    them, and the sides as a function of the amplitude."""
    amplitudes, steps, sides = motion
    travel = np.concatenate([[0.0], np.cumsum(steps)])
    try:
        from scipy.interpolate import PchipInterpolator  # slow to load, and not everywhere
    except ImportError as error:
        raise BadInput("domain: named domains need scipy: pip install scipy") from error
    amplitude_at = PchipInterpolator(travel / travel[-1], amplitudes)
    return MovingDomain(
        name, start, deforming_sides, cell, float(travel[-1]),
        move=lambda s: sides(float(amplitude_at(s))),
    )  # fmt: skip


def make_unit_box(ni: int, nj: int, width: float = 1.0) -> np.ndarray:
    """Nodes (2, ni+1, nj+1) of an even grid on the box of `width` by 1."""
    return make_box(width, np.linspace(0.0, 1.0, ni + 1), np.linspace(0.0, 1.0, nj + 1))


def march_sides(
    name: str,
    sides_at: Callable[[float], np.ndarray],
    deforming_sides: tuple[str, ...],
) -> MovingDomain:
    """Domain whose four sides are given at every amplitude from 0 to 1.

    `sides_at(amplitude)` is (2, ni+1, nj+1); only its sides are read.  The grid at amplitude 0 is
    interpolated (transfinite).
    """

    def sides(amplitude: float) -> np.ndarray:
        nodes = np.array(sides_at(amplitude), dtype=np.float64)
        nodes[:, 1:-1, 1:-1] = np.nan
        return nodes

    amplitudes = np.linspace(0.0, 1.0, SIDES_SAMPLES)
    steps = np.empty(SIDES_SAMPLES - 1)
    last = sides(0.0)
    start = transfinite_grid(last)
    for k, amplitude in enumerate(amplitudes[1:]):
        following = sides(amplitude)
        steps[k] = np.nanmax(np.hypot(*(following - last)))
        last = following
    cell = min(find_shortest_edge(start, side) for side in deforming_sides)
    return _make_domain(name, start, deforming_sides, cell, (amplitudes, steps, sides))


def find_shortest_edge(start: np.ndarray, side: str) -> float:
    """Shortest edge along a side of a grid and from there to the first line [m]."""
    turned = start if side[0] == "i" else start.transpose(0, 2, 1)
    turned = turned[:, ::-1] if side.endswith("max") else turned
    along, away = np.diff(turned[:, 0], axis=1), turned[:, 1] - turned[:, 0]
    return float(min(np.hypot(*along).min(), np.hypot(*away).min()))
