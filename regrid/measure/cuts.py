"""Cuts: lines that the boundary of a block runs along twice, out and back, the block on both sides.

The wake of a C grid, the seam of a ring that is closed on itself, a line from a wall to a body.  A
boundary touches itself there, but winds round nothing (theory R5.3).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import OPPOSITE_SIDES, SIDE_NAMES, get_side

CUT_ROUNDING = 1e-6  # of a mean edge: up to which nodes of a cut are one
CUT_WORDS = 'a side and two of its nodes, between which it goes out and back: ["j_min", 0, 80]'

Cut = tuple[str, int, int]  # a side and two of its nodes
Cuts = Sequence[Cut]


def find_cut_edges(nodes: np.ndarray, cuts: Cuts = ()) -> dict[str, np.ndarray]:
    """Which edges of each side (n,) lie on another edge of a cut, by the side's name; True there.

    Detected: opposite sides that are the same nodes, and a side whose ends are one line, as the
    wake of a C grid.  Besides, the `cuts` given (`take_cuts`); BadInput for one that is none.
    """
    cut_edges = {}
    for side, opposite in OPPOSITE_SIDES.items():
        line = get_side(nodes, side)
        cut_edges[side] = np.full(
            line.shape[1] - 1, np.array_equal(line, get_side(nodes, opposite))
        )
        _mark_cut(cut_edges[side], (line == line[:, ::-1]).all(axis=0))
    for cut in cuts:
        side, first, last = check_cut(cut, nodes)
        line = get_side(nodes, side)[:, first : last + 1]
        if not _mark_cut(cut_edges[side][first:last], _are_one_point(line)):
            raise BadInput(
                f"regrid: cuts has {cut!r}: nodes {first} and {last} of side {side} are not the "
                "same point, or those next to them on the way to each other are not"
            )
    return cut_edges


def _mark_cut(edges: np.ndarray, coincide: np.ndarray) -> bool:
    """Mark `edges` (n,) of a line from both ends on, as far as its nodes `coincide` (n+1,).

    True if there are any.
    """
    count = _count_leading(coincide)
    if count < 2:
        return False
    edges[: count - 1] = True
    edges[edges.size - count + 1 :] = True
    return True


def _count_leading(flags: np.ndarray) -> int:
    """How many of `flags` (n,) are True before the first that is not."""
    return flags.size if flags.all() else int(np.argmin(flags))


def _are_one_point(line: np.ndarray) -> np.ndarray:
    """Which nodes of a line (2, n) coincide with those from its other end, up to rounding."""
    apart = np.abs(line - line[:, ::-1]).max(axis=0)
    return apart <= CUT_ROUNDING * np.hypot(*np.diff(line)).mean()


def take_cuts(cuts: Cuts) -> tuple[Cut, ...]:
    """Cuts as tuples, from lists as well; BadInput for what is no list of them."""
    if isinstance(cuts, str):
        raise BadInput(f"regrid: cuts = {cuts!r}; it must be a list of cuts, {CUT_WORDS}")
    try:
        return tuple(tuple(cut) for cut in cuts)
    except TypeError:
        raise BadInput(f"regrid: cuts = {cuts!r}; it must be a list of cuts, {CUT_WORDS}") from None


def check_cut(cut: Cut, nodes: np.ndarray) -> Cut:
    """A cut as (side, first, last); BadInput for what is no such thing on `nodes`."""
    try:
        side, first, last = cut
        count = get_side(nodes, side).shape[1]
        is_valid = 0 <= first and first + 2 <= last < count and int(first) == first
    except (TypeError, ValueError, KeyError):
        is_valid = False
    if not is_valid:
        raise BadInput(f"regrid: cuts has {cut!r}; a cut is {CUT_WORDS}, at least two cells apart")
    return side, int(first), int(last)


def reverse_cuts(cuts: Cuts, nodes: np.ndarray) -> tuple[Cut, ...]:
    """The same cuts of the grid `nodes` with j reversed."""
    turned = []
    for cut in cuts:
        side, first, last = check_cut(cut, nodes)
        if side.startswith("j"):
            turned.append((OPPOSITE_SIDES[side], first, last))
        else:
            end = nodes.shape[2] - 1
            turned.append((side, end - last, end - first))
    return tuple(turned)


def join_cuts(nodes: np.ndarray, cuts: Cuts) -> np.ndarray:
    """A copy of a grid whose two lines of each cut are bitwise one where they were nearly so."""
    joined = nodes.copy()
    for cut in cuts:
        side, first, last = check_cut(cut, nodes)
        line = get_side(joined, side)[:, first : last + 1]
        count = min(_count_leading(_are_one_point(line)), (line.shape[1] + 1) // 2)
        line[:, line.shape[1] - count :] = line[:, :count][:, ::-1].copy()
    return joined


def join_wakes(nodes: np.ndarray) -> np.ndarray:
    """The grid, or a copy in which the ends of a side are bitwise one line if they nearly were."""
    cuts = []
    for side in SIDE_NAMES:
        line = get_side(nodes, side)
        if _count_leading(_are_one_point(line)) > 1:
            cuts.append((side, 0, line.shape[1] - 1))
    return join_cuts(nodes, cuts) if cuts else nodes
