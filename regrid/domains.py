"""Named domains with a moving boundary, for marching a regridder without flow.

Every domain is a rectangle whose side i_min (the lower one, where not said otherwise) bends as s
goes from 0 to 1; lines j = const start there, as the straight-line family must.  i runs upwards
and j to the left, so that corner areas are positive.  The trap: s is not the amplitude.  It is
scaled so that equal steps of s move the fastest boundary node by equal distances, and "cells a
step" counts the shortest edge of the starting grid's first row at the deforming side.

The shapes follow the figures of [Ch]: 1 and 3 (tongues), 2 (shift), 4 (strip).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from regrid.errors import BadInput

FINE = 2400  # points on the curve from which the nodes are taken
SAMPLES = 129  # amplitudes at which the boundary's travel is measured
TONGUES = [
    {"centre": 0.22, "width": 0.12, "length": 0.75},
    {"centre": 0.5, "width": 0.10, "length": 1.0},
    {"centre": 0.78, "width": 0.15, "length": 0.5},
]


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


def place_by_arc_length(curve: np.ndarray, count: int, law: np.ndarray | None = None) -> np.ndarray:
    """`count` nodes on the fine polyline `curve` (2, n), equidistant or by `law`, ends included."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=1)))])
    law = np.linspace(0.0, 1.0, count) if law is None else law
    line = np.array([np.interp(law * arc[-1], arc, curve[k]) for k in range(2)])
    line[:, 0], line[:, -1] = curve[:, 0], curve[:, -1]
    return line


def _box(width: float, heights: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Rectangle with rows at `heights` and columns at the laws `across`, j from right to left."""
    nodes = np.empty((2, heights.size, across.size))
    nodes[0] = width * (1.0 - across)
    nodes[1] = heights[:, None]
    return nodes


def _marched(name: str, start: np.ndarray, curve_at: Callable[[float], np.ndarray]) -> MovingDomain:
    """Domain whose side i_min follows the fine curve `curve_at(amplitude)` from j = 0 to j = nj.

    The side's ends may slide along the straight sides j_min and j_max, whose laws are kept.
    """
    count = start.shape[2]
    law_low, law_high = (_law_of(start[:, :, j]) for j in (0, -1))

    def sides(amplitude: float) -> np.ndarray:
        nodes = np.full_like(start, np.nan)
        nodes[:, -1] = start[:, -1]
        nodes[:, 0] = place_by_arc_length(curve_at(amplitude), count)
        for j, law in ((0, law_low), (-1, law_high)):
            foot, top = nodes[:, 0, j], nodes[:, -1, j]
            nodes[:, :, j] = foot[:, None] + law * (top - foot)[:, None]
            nodes[:, 0, j], nodes[:, -1, j] = foot, top
        return nodes

    amplitudes = np.linspace(0.0, 1.0, SAMPLES)
    lines = np.array([place_by_arc_length(curve_at(a), count) for a in amplitudes])
    steps = np.hypot(*np.diff(lines, axis=0).transpose(1, 0, 2)).max(axis=1)
    travel = np.concatenate([[0.0], np.cumsum(steps)])
    amplitude_at = PchipInterpolator(travel / travel[-1], amplitudes)
    cell = min(
        np.hypot(*np.diff(start[:, 0], axis=1)).min(),
        np.hypot(*(start[:, 1] - start[:, 0])).min(),
    )
    return MovingDomain(
        name=name,
        start=sides_to_grid(start, sides(0.0)),
        deforming_sides=("i_min",),
        cell=float(cell),
        travel=float(travel[-1]),
        move=lambda s: sides(float(amplitude_at(s))),
    )


def sides_to_grid(start: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """The starting grid with the moved curve's own nodes at amplitude 0 on its sides."""
    grid = start.copy()
    for side in np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1]:
        grid[side] = sides[side]
    return grid


def _law_of(line: np.ndarray) -> np.ndarray:
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=1)))])
    return arc / arc[-1]


def _unit_box(ni: int, nj: int, width: float = 1.0) -> np.ndarray:
    return _box(width, np.linspace(0.0, 1.0, ni + 1), np.linspace(0.0, 1.0, nj + 1))


def _fingers(name: str, ni: int, nj: int, fingers: list[dict]) -> MovingDomain:
    """Unit box whose lower side grows tongues: centre, width at half length, length, curl.

    A tongue is the graph of exp(-ln 2 (2 (x - centre)/width)^4), bent along its own axis into an
    arc that turns by `curl` radians over the full length.
    """
    start = _unit_box(ni, nj)
    x = np.linspace(1.0, 0.0, FINE)

    def curve_at(amplitude: float) -> np.ndarray:
        shape_x, shape_y = x.copy(), np.zeros_like(x)
        for finger in fingers:
            across = x - finger["centre"]
            profile = np.exp(-np.log(2.0) * (2.0 * across / finger["width"]) ** 4)
            depth = amplitude * finger["length"] * profile
            bend = finger.get("curl", 0.0) / finger["length"]
            if bend == 0.0:
                shape_y -= depth
            else:
                angle = bend * depth
                shape_x += (1.0 - np.cos(angle)) / bend + across * (np.cos(angle) - 1.0)
                shape_y += -np.sin(angle) / bend + across * np.sin(angle)
        return np.array([shape_x, shape_y])

    return _marched(name, start, _on_walls(curve_at))


def _on_walls(curve_at: Callable[[float], np.ndarray]) -> Callable[[float], np.ndarray]:
    """Pin the curve's ends, which the smooth profiles just miss, to the walls' feet."""

    def pinned(amplitude: float) -> np.ndarray:
        curve = curve_at(amplitude)
        curve[:, 0], curve[:, -1] = (1.0, 0.0), (0.0, 0.0)
        return curve

    return pinned


def three_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Three straight tongues, lengths .75, 1 and .5 of the height, widths .12, .10 and .15."""
    return _fingers("three_fingers", ni, nj, TONGUES)


def curled_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The three tongues, bending by .4 to .8 radians: as far as they stay between the walls."""
    return _bent_fingers("curled_fingers", ni, nj, (-0.4, 0.8, 0.5))


def overhung_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The three tongues, bending by .8 to 1.2 radians, the outer ones beyond the walls' feet.

    Straight lines from there to the opposite side would leave the domain: gap0 cannot be 1.
    """
    return _bent_fingers("overhung_fingers", ni, nj, (-1.2, 0.8, 1.2))


def hooked_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The three tongues, bending by up to 2 radians: beyond what straight lines can start from."""
    return _bent_fingers("hooked_fingers", ni, nj, (-2.0, 1.0, 2.0))


def _bent_fingers(name: str, ni: int, nj: int, curls: tuple[float, float, float]) -> MovingDomain:
    fingers = [finger | {"curl": curl} for finger, curl in zip(TONGUES, curls, strict=True)]
    return _fingers(name, ni, nj, fingers)


def single_finger(ni: int = 60, nj: int = 40) -> MovingDomain:
    """One tongue of width .05 and length .5: ten times as long as wide, as the longest of three."""
    return _fingers("single_finger", ni, nj, [{"centre": 0.5, "width": 0.05, "length": 0.5}])


def slender_finger(ni: int = 60, nj: int = 40) -> MovingDomain:
    """One tongue of width .05 and length 1, as long as the block is high: the harshest case.

    The straight lines out of a tongue meet its flanks at angles of half its width over its depth:
    .025 at the tip, whatever the grid.
    """
    return _fingers("slender_finger", ni, nj, [{"centre": 0.5, "width": 0.05, "length": 1.0}])


def _graph(name: str, ni: int, nj: int, start: np.ndarray, shape: Callable) -> MovingDomain:
    """Domain whose lower side is the graph y = amplitude * shape(x), ends free on the walls."""
    width = start[0].max()
    x = np.linspace(width, 0.0, FINE)
    return _marched(name, start, lambda amplitude: np.array([x, amplitude * shape(x)]))


def dome(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side rises to a dome of half the height."""
    return _graph("dome", ni, nj, _unit_box(ni, nj), lambda x: 0.5 * np.sin(np.pi * x) ** 2)


def valley(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side sinks to a valley as deep as the height."""
    return _graph("valley", ni, nj, _unit_box(ni, nj), lambda x: -(np.sin(np.pi * x) ** 2))


def chevron(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side becomes a zigzag with corners, amplitude .3, two periods."""
    return _graph(
        "chevron",
        ni,
        nj,
        _unit_box(ni, nj),
        lambda x: 0.3 * (2.0 * np.abs(2.0 * ((2.0 * x) % 1.0) - 1.0) - 1.0),
    )


def strip(ni: int = 120, nj: int = 40) -> MovingDomain:
    """100:1 rectangle clustered to a growing interface, where cells are square ([Ch] Fig 4).

    The interface is a cosine of one wavelength across the width 1, amplitude up to .5.
    """
    heights = np.concatenate([[0.0], np.cumsum(_stretched(100.0, ni, 1.0 / nj))])
    heights[-1] = 100.0
    start = _box(1.0, heights, np.linspace(0.0, 1.0, nj + 1))
    return _graph("strip", ni, nj, start, lambda x: 0.5 * np.cos(2.0 * np.pi * x))


def _stretched(length: float, count: int, first: float) -> np.ndarray:
    """Cell sizes in geometric progression that begin with `first` and sum up to `length`."""
    low, high = 1.0, 10.0
    for _ in range(200):
        ratio = 0.5 * (low + high)
        total = first * np.sum(ratio ** np.arange(count))
        low, high = (ratio, high) if total < length else (low, ratio)
    return first * ratio ** np.arange(count)


def jet(ni: int = 40, nj: int = 120) -> MovingDomain:
    """A jet of radius 1 pinched to .15 at two necks; the surface is i_min, the axis i_max."""
    width = 6.0
    start = _box(width, np.linspace(0.0, 1.0, ni + 1), np.linspace(0.0, 1.0, nj + 1))
    wave = 2.0 * np.pi * 2.0 / width
    return _graph("jet", ni, nj, start, lambda x: 0.425 * (1.0 - np.cos(wave * x)))


def rectangle_shift(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle of square cells that moves by .9 cell along i as a whole ([Ch] Fig 2)."""
    start = _box(1.0, np.linspace(0.0, ni / nj, ni + 1), np.linspace(0.0, 1.0, nj + 1))

    def move(s: float) -> np.ndarray:
        nodes = start.copy()
        nodes[1] += 0.9 * s / nj
        nodes[:, 1:-1, 1:-1] = np.nan
        return nodes

    return MovingDomain(
        name="rectangle_shift",
        start=start,
        deforming_sides=("i_min", "i_max"),
        cell=1.0 / nj,
        travel=0.9 / nj,
        move=move,
    )


DOMAINS: dict[str, Callable[..., MovingDomain]] = {
    "three_fingers": three_fingers,
    "curled_fingers": curled_fingers,
    "overhung_fingers": overhung_fingers,
    "hooked_fingers": hooked_fingers,
    "single_finger": single_finger,
    "slender_finger": slender_finger,
    "strip": strip,
    "jet": jet,
    "dome": dome,
    "valley": valley,
    "chevron": chevron,
    "rectangle_shift": rectangle_shift,
}


def make_domain(name: str, ni: int, nj: int) -> MovingDomain:
    """The named domain at ni × nj cells; raises BadInput for an unknown name."""
    key = name.replace("-", "_")
    if key not in DOMAINS:
        raise BadInput(f"domain: no domain is called '{name}'; known are {', '.join(DOMAINS)}")
    if ni < 2 or nj < 2:
        raise BadInput(f"domain: '{name}' needs at least 2 x 2 cells, got {ni} x {nj}")
    return DOMAINS[key](ni, nj)
