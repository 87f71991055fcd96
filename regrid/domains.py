"""Domains with a moving boundary: their definition, construction from curves, and named examples.

The papers' domains follow the figures of [CharakhchyanND]: 1 and 3 (tongues), 2 (shift), 4
(strip).  Each is a rectangle whose side i_min (the lower one unless stated otherwise) deforms as s
goes from 0 to 1; lines j = const start there, as the straight-line family must.  i points up and j
to the left, so that corner areas are positive.

Note: s is not the amplitude.  It is scaled so that equal steps of s move the fastest boundary node
by equal distances; "cells per step" refers to the shortest edge of the initial grid at the
deforming sides.

Swan and horseshoe have the boundary curves of [KnuppSteinberg1993]'s gallery, with nodes at equal
steps of the curves' parameters; in these and in annulus, airfoil and chicane all sides deform at
once, and the amplitude is that of a straight path of every node (swan, horseshoe), of a bend
(annulus, airfoil) or of a turn (chicane).  In nozzle, waves, cushion, pinched, crescent and bulged
chevron all four sides bend, and neither family of straight lines starts on all sides that deform
(theory R4.5, R4.16).  All start as a rectangle and bend as the amplitude grows; nodes are
equidistant on every side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.sides import SIDE_NAMES, copy_sides
from shockgrid.regrid.spacings import arc_spacing, clustered_spacing

MOTION_SAMPLES = 129  # amplitudes at which the motion of a side is measured,
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
        """Number of equal steps of s in which no boundary node exceeds `cells_a_step`."""
        return max(1, int(np.ceil(self.travel / (cells_a_step * self.cell) - 1e-9)))

    @property
    def travel_in_cells(self) -> float:
        """Path length of the fastest boundary node over the whole motion, in cells."""
        return self.travel / self.cell

    @property
    def suggested_steps(self) -> int:
        """Number of steps at half a cell each."""
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
    curve: np.ndarray, count: int, spacing: np.ndarray | None = None
) -> np.ndarray:
    """`count` nodes on the fine polyline `curve` (2, n) with its ends, even or by `spacing`."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=1)))])
    spacing = np.linspace(0.0, 1.0, count) if spacing is None else spacing
    line = np.array([np.interp(spacing * arc[-1], arc, coordinate) for coordinate in curve])
    line[:, 0] = curve[:, 0]
    line[:, -1] = curve[:, -1]
    return line


def make_box(width: float, heights: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Rectangle with rows at `heights` and columns at fractions `across`, j from right to left."""
    nodes = np.empty((2, heights.size, across.size))
    nodes[0] = width * (1.0 - across)
    nodes[1] = heights[:, None]
    return nodes


def march_line(
    name: str, start: np.ndarray, curve_at: Callable[[float], np.ndarray]
) -> MovingDomain:
    """Domain whose side i_min follows the fine curve `curve_at(amplitude)` from j = 0 to j = nj.

    The side's ends may slide along the straight sides j_min and j_max, whose spacing is kept.
    """
    count = start.shape[2]
    spacing_low, spacing_high = (arc_spacing(start[:, :, j]) for j in (0, -1))

    def sides(amplitude: float) -> np.ndarray:
        nodes = np.full_like(start, np.nan)
        nodes[:, -1] = start[:, -1]
        nodes[:, 0] = distribute_by_arc_length(curve_at(amplitude), count)
        for j, spacing in ((0, spacing_low), (-1, spacing_high)):
            foot = nodes[:, 0, j]
            top = nodes[:, -1, j]
            nodes[:, :, j] = foot[:, None] + spacing * (top - foot)[:, None]
            nodes[:, 0, j] = foot
            nodes[:, -1, j] = top
        return nodes

    amplitudes = np.linspace(0.0, 1.0, MOTION_SAMPLES)
    lines = np.array([distribute_by_arc_length(curve_at(a), count) for a in amplitudes])
    steps = np.hypot(*np.diff(lines, axis=0).transpose(1, 0, 2)).max(axis=1)
    grid = start.copy()
    copy_sides(sides(0.0), grid)  # the curve's own nodes
    cell = find_shortest_edge(start, "i_min")
    return _make_domain(name, grid, ("i_min",), cell, (amplitudes, steps, sides))


def _make_domain(name, start, deforming_sides, cell: float, motion) -> MovingDomain:
    """The domain of a motion: amplitudes (n,), the largest displacements (n - 1,) of a side's node
    between them, and the sides as a function of the amplitude."""
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
    """Nodes (2, ni+1, nj+1) of a uniform grid on a box of `width` by 1."""
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
    along = np.diff(turned[:, 0], axis=1)
    away = turned[:, 1] - turned[:, 0]
    return float(min(np.hypot(*along).min(), np.hypot(*away).min()))


FINE_CURVE_POINTS = 2400  # points on the curve from which nodes are interpolated
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
    x = np.linspace(1.0, 0.0, FINE_CURVE_POINTS)

    def curve_at(amplitude: float) -> np.ndarray:
        shape_x, shape_y = x.copy(), np.zeros_like(x)
        for finger in fingers:
            across = x - finger["centre"]
            profile = np.exp(-np.log(2.0) * (2.0 * across / finger["width"]) ** 4)
            depth = amplitude * finger["length"] * profile
            curvature = finger.get("curl", 0.0) / finger["length"]
            if curvature == 0.0:
                shape_y -= depth
            else:
                angle = curvature * depth
                shape_x += (1.0 - np.cos(angle)) / curvature + across * (np.cos(angle) - 1.0)
                shape_y += -np.sin(angle) / curvature + across * np.sin(angle)
        return np.array([shape_x, shape_y])

    return march_line(name, start, _on_walls(curve_at))


def _on_walls(curve_at: Callable[[float], np.ndarray]) -> Callable[[float], np.ndarray]:
    """Pin the curve's ends, which the smooth profiles slightly miss, to the feet of the walls."""

    def pinned(amplitude: float) -> np.ndarray:
        curve = curve_at(amplitude)
        curve[:, 0] = (1.0, 0.0)
        curve[:, -1] = (0.0, 0.0)
        return curve

    return pinned


def three_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Three straight tongues, lengths 0.75, 1 and 0.5 of the height, widths 0.12, 0.10 and 0.15."""
    return _fingers("three_fingers", ni, nj, TONGUES)


def five_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Five straight tongues, lengths 0.5 to 1 of the height, widths 0.07 to 0.09."""
    return _fingers("five_fingers", ni, nj, FIVE_TONGUES)


def curled_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The three tongues bent by 0.4 to 0.8 radians: as far as they stay between the walls."""
    return _bent_fingers("curled_fingers", ni, nj, (-0.4, 0.8, 0.5))


def overhung_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The three tongues bent by 0.8 to 1.2 radians, the outer ones beyond the feet of the walls.

    Straight lines from there to the opposite side would leave the domain: the first line gap cannot
    be 1.
    """
    return _bent_fingers("overhung_fingers", ni, nj, (-1.2, 0.8, 1.2))


def hooked_fingers(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The three tongues bent by up to 2 radians: too far for straight lines to start from them."""
    return _bent_fingers("hooked_fingers", ni, nj, (-2.0, 1.0, 2.0))


def _bent_fingers(name: str, ni: int, nj: int, curls: tuple[float, float, float]) -> MovingDomain:
    fingers = [finger | {"curl": curl} for finger, curl in zip(TONGUES, curls, strict=True)]
    return _fingers(name, ni, nj, fingers)


def single_finger(ni: int = 60, nj: int = 40) -> MovingDomain:
    """One tongue of width 0.05, length 0.5: ten times as long as wide, as the longest of three."""
    return _fingers("single_finger", ni, nj, [{"centre": 0.5, "width": 0.05, "length": 0.5}])


def slender_finger(ni: int = 60, nj: int = 40) -> MovingDomain:
    """One tongue of width 0.05 and length 1, as long as the block is high: the hardest case.

    The straight lines out of a tongue meet its flanks at angles of half its width over its depth:
    0.025 at the tip on any grid.
    """
    return _fingers("slender_finger", ni, nj, [{"centre": 0.5, "width": 0.05, "length": 1.0}])


def _graph(name: str, ni: int, nj: int, start: np.ndarray, shape: Callable) -> MovingDomain:
    """Domain whose lower side is the graph y = amplitude * shape(x), ends free on the walls."""
    width = start[0].max()
    x = np.linspace(width, 0.0, FINE_CURVE_POINTS)
    return march_line(name, start, lambda amplitude: np.array([x, amplitude * shape(x)]))


def dome(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side rises to a dome of half the height."""
    return _graph("dome", ni, nj, make_unit_box(ni, nj), lambda x: 0.5 * np.sin(np.pi * x) ** 2)


def valley(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side sinks to a valley as deep as the height."""
    return _graph("valley", ni, nj, make_unit_box(ni, nj), lambda x: -(np.sin(np.pi * x) ** 2))


def chevron(ni: int = 60, nj: int = 40) -> MovingDomain:
    """The lower side becomes a zigzag with corners, amplitude 0.3, two periods."""
    return _graph(
        "chevron",
        ni,
        nj,
        make_unit_box(ni, nj),
        lambda x: 0.3 * (2.0 * np.abs(2.0 * ((2.0 * x) % 1.0) - 1.0) - 1.0),
    )


def strip(ni: int = 120, nj: int = 40) -> MovingDomain:
    """100:1 rectangle clustered to a growing interface, square cells there ([CharakhchyanND] Fig 4)

    The interface is a cosine of one wavelength across the width 1, amplitude up to 0.5.
    """
    heights = 100.0 * clustered_spacing(ni + 1, 0.01 / nj)
    start = make_box(1.0, heights, np.linspace(0.0, 1.0, nj + 1))
    return _graph("strip", ni, nj, start, lambda x: 0.5 * np.cos(2.0 * np.pi * x))


def jet(ni: int = 40, nj: int = 120) -> MovingDomain:
    """A jet of radius 1 pinched to 0.15 at two necks; the surface is i_min, the axis i_max."""
    width = 6.0
    start = make_box(width, np.linspace(0.0, 1.0, ni + 1), np.linspace(0.0, 1.0, nj + 1))
    wave = 2.0 * np.pi * 2.0 / width
    return _graph("jet", ni, nj, start, lambda x: 0.425 * (1.0 - np.cos(wave * x)))


def rectangle_shift(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle of square cells that moves by 0.9 cell along i ([CharakhchyanND] Fig 2)."""
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


ANNULUS_ANGLE = 1.5 * np.pi
TAIL_HALF_THICKNESS = 0.00126  # half thickness of the profile's cut trailing edge, chords
AIRFOIL_RADIUS = 1.5  # of the outer side, chords
CHICANE_TURN = np.radians(135.0)
CHICANE_WIDTH = 0.3  # over the length of a leg


def _between(first_nodes: np.ndarray, last_nodes: np.ndarray) -> Callable[[float], np.ndarray]:
    """Every node moves on a straight line from its first to its last position."""
    return lambda amplitude: (1.0 - amplitude) * first_nodes + amplitude * last_nodes


def _parameters(ni: int, nj: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the lines across i and across j, from 0 to 1."""
    return np.linspace(0.0, 1.0, ni + 1), np.linspace(0.0, 1.0, nj + 1)


def swan(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Unit square whose right side becomes x = 1 + 2y - 2y² and whose top y = 1 - 3x + 3x².

    i to the right, j up.  The corner at (0, 1) closes to 18.4 degrees: no grid can have a corner
    sine above 0.316 there.
    """
    r, t = _parameters(ni, nj)
    square = np.array(np.meshgrid(r, t, indexing="ij"))
    shape = square.copy()
    shape[1, :, -1] = 1.0 - 3.0 * r + 3.0 * r * r
    shape[0, -1] = 1.0 + 2.0 * t - 2.0 * t * t
    return march_sides("swan", _between(square, shape), ("i_max", "j_max"))


def horseshoe(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle 1 x 2 that becomes the half ring from a unit circle to an ellipse 4 x 2.

    j along the ring from (0, -1) to (0, 1), i outwards: cells are three times as long at the tip.
    """
    r, t = _parameters(ni, nj)
    rectangle = np.array(np.meshgrid(r, 2.0 * t - 1.0, indexing="ij"))
    shape = rectangle.copy()
    angle = 0.5 * np.pi * (2.0 * t - 1.0)
    for line, (a, b) in ((0, (1.0, 1.0)), (-1, (4.0, 2.0))):
        shape[:, line] = a * np.cos(angle), b * np.sin(angle)
    for line, end in ((0, -1.0), (-1, 1.0)):
        shape[:, :, line] = np.zeros_like(r), end * (1.0 + r)
    return march_sides("horseshoe", _between(rectangle, shape), SIDE_NAMES)


def annulus(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle bent to three quarters of a ring between the radii 1 and 2.

    Its mean length, 7.07, is kept; j along the ring, i outwards.
    """
    r, t = _parameters(ni, nj)
    length = 1.5 * ANNULUS_ANGLE

    def sides_at(amplitude: float) -> np.ndarray:
        along = length * (t - 0.5)
        if amplitude == 0.0:
            return np.array(np.meshgrid(r - 0.5, along, indexing="ij"))
        curvature = amplitude * ANNULUS_ANGLE / length
        radius = 1.0 / curvature + (r - 0.5)[:, None]
        angle = curvature * along
        return np.array([radius * np.cos(angle) - 1.0 / curvature, radius * np.sin(angle)])

    return march_sides("annulus", sides_at, SIDE_NAMES)


def airfoil(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A strip that closes round a NACA 0012 profile: a grid of C type without a wake.

    j runs along the profile, equidistant, from the upper to the lower end of its cut trailing edge;
    i outwards, to a half circle of radius 1.5 round the middle of the chord with straight ends.
    The sides j_min and j_max are normal to the trailing edge.  During the motion both the profile's
    thickness in log r and the bend grow: `z = (1 - exp(a (u + i theta)))/a`, u from its mean at
    a = 0 to log r at a = 1; the middle of the chord ends at (1, 0).
    """
    r, t = _parameters(ni, nj)
    profile = distribute_by_arc_length(_naca_0012(), nj + 1)
    tail = profile[0, 0]
    upper = np.array([np.full_like(r, tail), profile[1, 0] + (AIRFOIL_RADIUS - profile[1, 0]) * r])
    outer = distribute_by_arc_length(_c_shape(tail), nj + 1)
    sides = np.zeros((2, ni + 1, nj + 1))
    sides[:, 0] = profile
    sides[:, -1] = outer
    sides[:, :, 0] = upper
    sides[:, :, -1] = upper * np.array([[1.0], [-1.0]])
    radius = np.hypot(*sides)
    turn = np.arctan2(sides[1], sides[0]) % (2.0 * np.pi) - np.pi
    # Strip: as wide and as long as the closed shape on average, in log r and angle.
    level = np.log(np.maximum(radius, 1e-300))
    low, high = level[0].mean(), level[-1].mean()
    flat = np.array(np.meshgrid(low + (high - low) * r, np.pi * (2.0 * t - 1.0), indexing="ij"))

    def sides_at(amplitude: float) -> np.ndarray:
        u = (1.0 - amplitude) * flat[0] + amplitude * level
        angle = (1.0 - amplitude) * flat[1] + amplitude * turn
        if amplitude == 0.0:
            return np.array([-u, -angle])
        stretched = np.exp(amplitude * u)
        x, y = stretched * np.cos(amplitude * angle), stretched * np.sin(amplitude * angle)
        return np.array([1.0 - x, -y]) / amplitude

    return march_sides("airfoil", sides_at, SIDE_NAMES)


def _naca_0012() -> np.ndarray:
    """The profile (2, n) round its mid-chord, from the upper trailing edge to the lower one."""
    place = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, FINE_CURVE_POINTS // 2)))  # 0 at the nose
    root = np.sqrt(place)
    half_thickness = 0.6 * (
        0.2969 * root - 0.126 * place - 0.3516 * place**2 + 0.2843 * place**3 - 0.1015 * place**4
    )
    half_thickness[-1] = TAIL_HALF_THICKNESS
    x = np.concatenate([place[::-1], place[1:]]) - 0.5
    return np.array([x, np.concatenate([half_thickness[::-1], -half_thickness[1:]])])


def _c_shape(tail: float) -> np.ndarray:
    """Half circle to the left of the middle, straight lines to x = tail above and below."""
    angle = np.linspace(0.5 * np.pi, 1.5 * np.pi, FINE_CURVE_POINTS)
    arc = AIRFOIL_RADIUS * np.array([np.cos(angle), np.sin(angle)])
    line_start = np.array([[tail], [AIRFOIL_RADIUS]])
    return np.concatenate([line_start, arc, line_start * np.array([[1.0], [-1.0]])], axis=1)


def chicane(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A straight strip of three legs, 0.3 wide and 3 long, folded to a Z, nodes equidistant.

    i along it, j across.  Both turns grow to 135 degrees with mitred corners, 45 degrees between
    the legs.  The sides' nodes stay equidistant, so an inner corner ends up opposite the middle of
    a leg: straight lines across the strip leave it.
    """
    t = np.linspace(0.0, 1.0, nj + 1)

    def sides_at(amplitude: float) -> np.ndarray:
        turn = amplitude * CHICANE_TURN
        centre = np.zeros((2, 4))
        for k, heading in enumerate((0.0, -turn, 0.0)):
            centre[:, k + 1] = centre[:, k] + (np.cos(heading), np.sin(heading))
        mitre = np.array([np.tan(0.5 * turn), 1.0])
        normals = np.array([[0.0, 1.0], mitre, mitre, [0.0, 1.0]]).T
        low, high = (
            distribute_by_arc_length(centre + 0.5 * CHICANE_WIDTH * side * normals, ni + 1)
            for side in (-1.0, 1.0)
        )
        return low[:, :, None] + (high - low)[:, :, None] * t

    return march_sides("chicane", sides_at, SIDE_NAMES)


FINE_SIDE = 1200  # points on a side from which its nodes are interpolated

# x and y of a side's points: functions of the parameter p along it, from 0 to 1, and of the
# amplitude a of the motion, from 0 to 1
Curve = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]


def _make_curved(name: str, ni: int, nj: int, low: Curve, high: Curve, near: Curve, far: Curve):
    """Domain between the curves j_min (`low`), j_max (`high`), i_min (`near`), i_max (`far`)."""
    p = np.linspace(0.0, 1.0, FINE_SIDE)

    def sides_at(amplitude: float) -> np.ndarray:
        nodes = np.full((2, ni + 1, nj + 1), np.nan)
        for curve, j in ((low, 0), (high, -1)):
            nodes[:, :, j] = distribute_by_arc_length(np.array(curve(p, amplitude)), ni + 1)
        for curve, i in ((near, 0), (far, -1)):
            line = distribute_by_arc_length(np.array(curve(p, amplitude)), nj + 1)
            nodes[:, i, 1:-1] = line[:, 1:-1]
        return nodes

    return march_sides(name, sides_at, SIDE_NAMES)


def _shift_rectangle(name: str, ni: int, nj: int, low, high, near, far) -> MovingDomain:
    """Rectangle 1.5 x 1 whose sides j_min, j_max (up) and i_min, i_max (right) shift.

    By functions of the parameter p along the side and of the amplitude a.
    """
    return _make_curved(
        name, ni, nj,
        lambda p, a: (1.5 * p, low(p, a)), lambda p, a: (1.5 * p, 1.0 + high(p, a)),
        lambda p, a: (near(p, a), p), lambda p, a: (1.5 + far(p, a), p),
    )  # fmt: skip


def nozzle(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A duct 2 long and 2 high: its throat closes to 0.6, both ends bulge downstream by 0.3.

    i along the duct, j across.  Half its height is `1 - .7 a sin²(pi x/2)`.
    """

    def wall(sign: float) -> Curve:
        return lambda p, a: (2.0 * p, sign * (1.0 - 0.7 * a * np.sin(np.pi * p) ** 2))

    def end(x: float) -> Curve:
        return lambda p, a: (x + 1.2 * a * p * (1.0 - p), 2.0 * p - 1.0)

    return _make_curved("nozzle", ni, nj, wall(-1.0), wall(1.0), end(0.0), end(2.0))


def waves(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle 1.5 x 1 with a wave on each side: two and a half, one and a half, one, two of them.

    Their amplitudes grow to 0.1 (j_min, j_max) and 0.08 (i_min, i_max).
    """

    def wave(p: np.ndarray, a: float, high: float, count: float) -> np.ndarray:
        return a * high * np.sin(2.0 * np.pi * count * p)

    return _shift_rectangle(
        "waves", ni, nj,
        lambda p, a: wave(p, a, 0.1, 2.5), lambda p, a: wave(p, a, 0.1, 1.5),
        lambda p, a: wave(p, a, 0.08, 1.0), lambda p, a: wave(p, a, 0.08, 2.0),
    )  # fmt: skip


def _bulged(name: str, ni: int, nj: int, height: float) -> MovingDomain:
    """Rectangle 1.5 x 1 whose sides all become parabolas of the given `height`."""

    def bulge(p: np.ndarray, a: float) -> np.ndarray:
        return 4.0 * height * a * p * (1.0 - p)

    def inward(p: np.ndarray, a: float) -> np.ndarray:
        return -bulge(p, a)

    return _shift_rectangle(name, ni, nj, inward, bulge, inward, bulge)


def cushion(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle 1.5 x 1 whose sides all bulge outwards by 0.2: its corners open to 150 degrees."""
    return _bulged("cushion", ni, nj, 0.2)


def pinched(ni: int = 60, nj: int = 40) -> MovingDomain:
    """Rectangle 1.5 x 1 whose sides all bulge inwards by 0.2: its corners close to 34 degrees."""
    return _bulged("pinched", ni, nj, -0.2)


def crescent(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A rectangle bent to half a ring between the radii 1 and 2, with both ends bulged by 0.3.

    i outwards, j round; the inner side has three waves of amplitude 0.1 along the ring.
    """
    length = 1.5 * np.pi

    def ring(across: float, high: float) -> Curve:
        def curve(p: np.ndarray, a: float) -> tuple[np.ndarray, np.ndarray]:
            return around(across + a * high * np.sin(6.0 * np.pi * p), length * (p - 0.5), a)

        return curve

    def end(sign: float) -> Curve:
        def curve(p: np.ndarray, a: float) -> tuple[np.ndarray, np.ndarray]:
            return around(p - 0.5, sign * (0.5 * length + 1.2 * a * p * (1.0 - p)), a)

        return curve

    def around(across, along, a: float) -> tuple[np.ndarray, np.ndarray]:
        across, along = np.broadcast_arrays(across, along)
        if a == 0.0:
            return across, along
        radius = length / (np.pi * a)
        angle = along / radius
        return (radius + across) * np.cos(angle) - radius, (radius + across) * np.sin(angle)

    return _make_curved("crescent", ni, nj, end(-1.0), end(1.0), ring(-0.5, 0.1), ring(0.5, 0.0))


def bulged_chevron(ni: int = 60, nj: int = 40) -> MovingDomain:
    """A chevron 1.5 x 1 with a kink 0.3 deep on j_min and j_max and ends that bulge by 0.15."""

    def kink(p: np.ndarray, a: float) -> np.ndarray:
        return a * 0.3 * (1.0 - np.abs(2.0 * p - 1.0))

    def bulge(p: np.ndarray, a: float) -> np.ndarray:
        return a * 0.6 * p * (1.0 - p)

    return _shift_rectangle("bulged_chevron", ni, nj, kink, kink, lambda p, a: -bulge(p, a), bulge)


DOMAINS: dict[str, Callable[..., MovingDomain]] = {shape.__name__: shape for shape in (
    three_fingers, five_fingers, curled_fingers, overhung_fingers, hooked_fingers,
    single_finger, slender_finger, strip, jet, dome, valley, chevron, rectangle_shift, swan,
    horseshoe, annulus, airfoil, chicane, nozzle, waves, cushion, pinched, crescent,
    bulged_chevron,
)}  # fmt: skip


def make_domain(name: str, ni: int, nj: int) -> MovingDomain:
    """The named domain at ni × nj cells; raises BadInput for an unknown name."""
    key = name.replace("-", "_")
    if key not in DOMAINS:
        raise BadInput(f"domain: no domain is called '{name}'{suggest(name, DOMAINS)}")
    if ni < 2 or nj < 2:
        raise BadInput(f"domain: '{name}' needs at least 2 x 2 cells, got {ni} x {nj}")
    return DOMAINS[key](ni, nj)
