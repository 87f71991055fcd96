"""What happened to the shape of the blocks where a run ended: a film, a neck, a line on itself.

Measured on the outlines of the last dump.  Two places of one outline that are near each other, but
far along it, have thin material between them, or a gap.  How near is told in distances of
neighbouring nodes there: below MET of one no grid resolves what lies between.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regrid.errors import Place
from regrid.sides import get_side

MET = 0.1  # distances of neighbouring nodes: lines as near as this have met
DETOUR = 6.0  # times their distance: two places of an outline less far apart along it are one
NEAR = 10  # distances of neighbouring nodes from the place that failed


def describe_event(blocks: Sequence, place: Place | None) -> str:
    """A sentence on the thinnest film, neck or gap at the place that failed; "" where none is thin.

    Where one of a film's sides is a seam inside one material, that is said: no material is cut.

    blocks: with `name` and `nodes` (2, ni + 1, nj + 1) [m]; without a place all are looked at.
    """
    named = [block for block in blocks if place is not None and block.name == place.block]
    found = []
    for block in named or blocks:
        centre = _find_centre(block.nodes, place) if named else None
        event = find_thinnest(block.nodes, centre)
        if event is not None:
            found.append((event, block.name))
    if not found:
        return ""
    (share, width, sides, x, y, inside), name = min(found, key=lambda one: one[0][0])
    if share > MET:
        return ""
    size = f"{width:.3g} m, {share:.2g} of the distance of its nodes, at ({x:.6g}, {y:.6g})"
    one, other = sides
    seam = _find_seam(blocks, name, sides, x, y) if inside and one != other else None
    if seam is not None:
        side, neighbour = seam
        line = other if side == one else one
        return (
            f"side {line} of block '{name}' has come to its seam with '{neighbour}', of the same "
            f"material: what is left between them is {size}"
        )
    if inside and one == other:
        return f"block '{name}' is pinched off: between two parts of its side {one} it is {size}"
    if inside:
        return f"block '{name}' is a film: between its sides {one} and {other} it is {size}"
    whose = f"side {one} of '{name}' has" if one == other else f"sides {one} and {other} have"
    return f"{whose} met {'itself' if one == other else f'outside of {name!r}'}: the gap is {size}"


def _find_seam(blocks, name: str, sides, x: float, y: float) -> tuple[str, str] | None:
    """The one of two sides whose node nearest to (x, y) lies on another block of the same material,
    and that block's name; None where none does, or where materials are not told."""
    block = next(block for block in blocks if block.name == name)
    material = getattr(block, "material", "")
    for side in sides if material else ():
        line = get_side(block.nodes, side)
        node = line[:, [int(np.argmin((line[0] - x) ** 2 + (line[1] - y) ** 2))]]
        close = 1e-9 * float(np.ptp(line, axis=1).max())
        for other in blocks:
            if other.name != name and getattr(other, "material", "") == material:
                ring, _ = trace_outline(other.nodes)
                if np.hypot(*(ring - node)).min() <= close:
                    return side, other.name
    return None


def find_thinnest(nodes: np.ndarray, centre: np.ndarray | None = None):
    """The nearest two places of a block's outline that are far apart along it, or None.

    Returns their distance over that of neighbouring nodes, their distance [m], their sides, x, y of
    the middle between them, and whether that lies inside of the block.  centre (2,): only nodes
    near it count.
    """
    ring, side = trace_outline(nodes)
    after = np.roll(ring, -1, axis=1)
    steps = np.hypot(*(after - ring))
    arc = np.concatenate(([0.0], np.cumsum(steps)))
    spacing = np.maximum(steps, np.roll(steps, 1))
    best: tuple | None = None
    for k in range(ring.shape[1]):
        here = ring[:, k : k + 1]
        if centre is not None and np.hypot(*(ring[:, k] - centre)) > NEAR * spacing[k]:
            continue
        way = after - ring
        squares = np.maximum((way**2).sum(axis=0), 1e-300)
        part = np.clip(((here - ring) * way).sum(axis=0) / squares, 0.0, 1.0)
        foot = ring + part * way
        away = np.hypot(*(foot - here))
        along = np.abs(arc[:-1] + part * steps - arc[k])
        along = np.minimum(along, arc[-1] - along)
        far = (along > DETOUR * away) & (along > spacing[k])
        if not far.any():
            continue
        m = int(np.argmin(np.where(far, away, np.inf)))
        share = float(away[m] / spacing[k])
        if best is None or share < best[0]:
            x, y = 0.5 * (foot[:, m] + ring[:, k])
            best = share, float(away[m]), (side[k], side[m]), float(x), float(y)
    if best is None:
        return None
    return (*best, is_inside(ring, *best[3:5]))


def trace_outline(nodes: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Nodes (2, n) round a block, each once, and the side of the segment that begins at each."""
    parts = (
        ("j_min", nodes[:, :-1, 0]),
        ("i_max", nodes[:, -1, :-1]),
        ("j_max", nodes[:, :0:-1, -1]),
        ("i_min", nodes[:, 0, :0:-1]),
    )
    ring = np.concatenate([line for _, line in parts], axis=1)
    return ring, [name for name, line in parts for _ in range(line.shape[1])]


def is_inside(ring: np.ndarray, x: float, y: float) -> bool:
    """Does a point lie inside of the closed polyline (2, n)?"""
    (x0, y0), (x1, y1) = ring, np.roll(ring, -1, axis=1)
    crosses = (y0 > y) != (y1 > y)
    with np.errstate(all="ignore"):
        at = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    return bool(np.count_nonzero(crosses & (x < at)) % 2)


def _find_centre(nodes: np.ndarray, place: Place | None) -> np.ndarray | None:
    """Where in the block a place is; None where it names no more than the block."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    if place is None:
        return None
    if place.cell is not None:
        i, j = (min(max(k, 0), n) for k, n in zip(place.cell, (ni, nj), strict=True))
        return nodes[:, i, j]
    if place.side and place.nodes:
        edge = -1 if place.side.endswith("max") else 0
        line = nodes[:, edge, :] if place.side.startswith("i") else nodes[:, :, edge]
        return line[:, min(place.nodes[0], line.shape[1] - 1)]
    return None
