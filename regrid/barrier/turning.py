"""How a block is looked at while it is untangled: the same way as its mirror image.

Untangling magnifies rounding: its first matrices have a condition of 1e10 and more, so a sum taken
from the other end of a line moves nodes by 1e-8 of a cell, in long untanglings by whole cells.
Two things therefore happen before it.

    orientation   of the four ways in which i and j may run, the one is chosen that a rule of
                  lengths prefers; a mirrored block is thus the same block, bit by bit
    symmetry      a block that agrees with its mirror image, or with itself turned by half a
                  circle, up to rounding is made to agree with it before and after

Lengths of edges and diagonals determine a grid up to its place, so the rule needs no other axis
than the grid itself.  Nodes of the sides do not move: only what is inside follows the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from shockgrid.regrid.measure.corners import find_folded_cells
from shockgrid.regrid.sides import compute_area, copy_sides
from shockgrid.regrid.symmetry import (
    TURNS,
    Turn,
    even_out_grid,
    find_mean_length,
    is_even,
    turn_bend,
)

SAME_LENGTH = 1e-5  # of the mean length: up to which grids differ by magnified rounding only
GOLDEN_FRACTION = 0.6180339887498949  # its multiples weigh lengths; no two weights agree


class Look(NamedTuple):
    """The `turn` to look at a block with, and those that show the same block again.

    Then x is `negated` if the block would go clockwise.
    """

    turn: Turn
    negated: bool
    same: tuple[Turn, ...]

    def turn_grid(self, nodes: np.ndarray) -> np.ndarray:
        """A grid (2, ni+1, nj+1) as it is looked at, or back from there."""
        turned = np.array(self.turn.apply(nodes))
        if self.negated:
            np.negative(turned[0], out=turned[0])
        return turned

    def turn_cells(self, values: np.ndarray) -> np.ndarray:
        """Values (ni, nj) of its cells."""
        return np.ascontiguousarray(self.turn.apply(values))

    def even_out(self, nodes: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """The mean of a turned grid and those that `same` makes of it, about the axes of another.

        `nodes`, `axes`: (2, ni+1, nj+1); `axes` itself comes out exactly symmetric.
        """
        return even_out_grid(nodes, axes, self.same)

    def even_out_cells(self, values: np.ndarray) -> np.ndarray:
        """The mean of turned values (ni, nj) and those that `same` makes of them."""
        total = values.copy()
        for turn in self.same:
            total += turn.apply(values)
        return total / (1 + len(self.same))


def choose_look(
    previous: np.ndarray,
    boundary: np.ndarray,
    cells: Sequence[np.ndarray] = (),
    transposed: bool = False,
    bend: np.ndarray | None = None,
) -> Look:
    """How to look at a block: its grid before, its new sides, and values (ni, nj) of its cells.

    `previous`, `boundary`: (2, ni+1, nj+1), of the second the sides alone; `transposed` blocks are
    looked at as those that have i for j; `bend` (ni+1, nj+1) of `find_bend`, if lines have a
    spacing of their own.
    """
    if transposed:
        exchanged = [grid[::-1].transpose(0, 2, 1) for grid in (previous, boundary)]
        look = choose_look(*exchanged, [part.T for part in cells])
        same = tuple(turn.exchange() for turn in look.same)
        return Look(look.turn.exchange(), look.negated, same)
    wanted = previous.copy()
    copy_sides(boundary, wanted)
    measures = [_measure(turn, (previous, wanted), cells) for turn in TURNS]
    weights = np.arange(1, measures[0].size + 1) * GOLDEN_FRACTION % 1.0 - 0.5
    scores = [float(measure @ weights) for measure in measures]
    best = int(np.argmax(scores))
    turn = TURNS[best]
    same = []
    for other, measure in zip(TURNS, measures, strict=True):
        change = Turn(other.i != turn.i, other.j != turn.j)
        if change != TURNS[0] and np.abs(measure - measures[best]).max() <= SAME_LENGTH:
            same.append(change)
    if bend is not None:
        own = turn_bend(turn, bend)
        same = [other for other in same if np.abs(turn_bend(other, own) - own).max() <= SAME_LENGTH]
    negated = turn.mirrors != (compute_area(previous) < 0.0)
    look = Look(turn, negated, tuple(same))
    grids = [look.turn_grid(grid) for grid in (previous, wanted)]
    if all(is_even(grid, look.same, SAME_LENGTH) for grid in grids):
        return look
    return Look(turn, negated, ())


def is_convex(nodes: np.ndarray) -> bool:
    """Are all cells of a grid (2, ni+1, nj+1) convex, whichever way round they go?  Exact."""
    upright = nodes if compute_area(nodes) > 0.0 else nodes[::-1]
    return not find_folded_cells(upright).size


def _measure(turn: Turn, grids, cells) -> np.ndarray:
    """All lengths of turned grids over their mean, and their cells' values over theirs."""
    parts = []
    for grid in grids:
        x, y = turn.apply(grid)
        lengths = []
        for first, second in (
            (np.s_[1:, :], np.s_[:-1, :]),
            (np.s_[:, 1:], np.s_[:, :-1]),
            (np.s_[1:, 1:], np.s_[:-1, :-1]),
            (np.s_[1:, :-1], np.s_[:-1, 1:]),
        ):
            lengths.append(np.hypot(x[first] - x[second], y[first] - y[second]).ravel())
        parts.append(np.concatenate(lengths) / find_mean_length(grid))
    for values in cells:
        parts.append(turn.apply(values).ravel() / np.abs(values).max())
    return np.concatenate(parts)
