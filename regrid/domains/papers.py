"""The papers' domains: tongues, a shifted rectangle, a 100:1 strip; and bent walls and jets.

Every domain is a rectangle whose side i_min (the lower one, where not said otherwise) bends as s
goes from 0 to 1; lines j = const start there, as the straight-line family must.  i runs upwards
and j to the left, so that corner areas are positive.

The shapes follow the figures of [CharakhchyanND]: 1 and 3 (tongues), 2 (shift), 4 (strip).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regrid.domains.moving import MovingDomain, make_box, make_unit_box, march_line

FINE = 2400  # points on the curve from which the nodes are taken
TONGUES = [
    {"centre": 0.22, "width": 0.12, "length": 0.75},
    {"centre": 0.5, "width": 0.10, "length": 1.0},
    {"centre": 0.78, "width": 0.15, "length": 0.5},
]
FIVE_TONGUES = [
    {"centre": 0.1, "width": 0.08, "length": 0.5},
    {"centre": 0.3, "width": 0.07, "length": 0.9},
    {"centre": 0.5, "width": 0.09, "length": 0.6},
    {"centre": 0.7, "width": 0.07, "length": 1.0},
    {"centre": 0.9, "width": 0.08, "length": 0.7},
]


def _fingers(name: str, ni: int, nj: int, fingers: list[dict]) -> MovingDomain:
    """Unit box whose lower side grows tongues: centre, width at half length, length, curl.

    A tongue is the graph of exp(-ln 2 (2 (x - centre)/width)^4), bent along its own axis into an
    arc that turns by `curl` radians over the full length.
    """
    start = make_unit_box(ni, nj)
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

    return march_line(name, start, _on_walls(curve_at))


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


def five_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Five straight tongues, lengths .5 to 1 of the height, widths .07 to .09."""
    return _fingers("five_fingers", ni, nj, FIVE_TONGUES)


def curled_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The three tongues, bending by .4 to .8 radians: as far as they stay between the walls."""
    return _bent_fingers("curled_fingers", ni, nj, (-0.4, 0.8, 0.5))


def overhung_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The three tongues, bending by .8 to 1.2 radians, the outer ones beyond the walls' feet.

    Straight lines from there to the opposite side would leave the domain: the first line gap cannot
    be 1.
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
    return march_line(name, start, lambda amplitude: np.array([x, amplitude * shape(x)]))


def dome(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side rises to a dome of half the height."""
    return _graph("dome", ni, nj, make_unit_box(ni, nj), lambda x: 0.5 * np.sin(np.pi * x) ** 2)


def valley(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side sinks to a valley as deep as the height."""
    return _graph("valley", ni, nj, make_unit_box(ni, nj), lambda x: -(np.sin(np.pi * x) ** 2))


def chevron(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side becomes a zigzag with corners, amplitude .3, two periods."""
    return _graph(
        "chevron",
        ni,
        nj,
        make_unit_box(ni, nj),
        lambda x: 0.3 * (2.0 * np.abs(2.0 * ((2.0 * x) % 1.0) - 1.0) - 1.0),
    )


def strip(ni: int = 120, nj: int = 40) -> MovingDomain:
    """100:1 rectangle clustered to a growing interface, square cells there ([CharakhchyanND] Fig 4)

    The interface is a cosine of one wavelength across the width 1, amplitude up to .5.
    """
    heights = np.concatenate([[0.0], np.cumsum(_stretched(100.0, ni, 1.0 / nj))])
    heights[-1] = 100.0
    start = make_box(1.0, heights, np.linspace(0.0, 1.0, nj + 1))
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
    start = make_box(width, np.linspace(0.0, 1.0, ni + 1), np.linspace(0.0, 1.0, nj + 1))
    wave = 2.0 * np.pi * 2.0 / width
    return _graph("jet", ni, nj, start, lambda x: 0.425 * (1.0 - np.cos(wave * x)))


def rectangle_shift(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle of square cells that moves by .9 cell along i ([CharakhchyanND] Fig 2)."""
    start = make_box(1.0, np.linspace(0.0, ni / nj, ni + 1), np.linspace(0.0, 1.0, nj + 1))

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
