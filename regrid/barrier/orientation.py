"""The orientation in which a block is untangled: the same for the block and its mirror image.

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
    turn_departure,
)

SAME_LENGTH = 1e-5  # of the mean length: up to which grids differ by magnified rounding only
GOLDEN_FRACTION = 0.6180339887498949  # its multiples weigh lengths; no two weights agree


class Orientation(NamedTuple):
    """The `turn` that a block is untangled in, and the `symmetries`: turns that give it again.

    Then x is `negated` if the block would go clockwise.
    """

    turn: Turn
    negated: bool
    symmetries: tuple[Turn, ...]

    def turn_grid(self, nodes: np.ndarray) -> np.ndarray:
        """A grid (2, ni+1, nj+1) in this orientation, or back from it."""
        turned = np.array(self.turn.apply(nodes))
        if self.negated:
            np.negative(turned[0], out=turned[0])
        return turned

    def turn_cells(self, values: np.ndarray) -> np.ndarray:
        """Values (ni, nj) of its cells."""
        return np.ascontiguousarray(self.turn.apply(values))

    def even_out(self, nodes: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """The mean of a turned grid and those that `symmetries` make of it, about `axes`.

        `nodes`, `axes`: (2, ni+1, nj+1); `axes` itself comes out exactly symmetric.
        """
        return even_out_grid(nodes, axes, self.symmetries)

    def even_out_cells(self, values: np.ndarray) -> np.ndarray:
        """The mean of turned values (ni, nj) and those that `symmetries` make of them."""
        total = values.copy()
        for turn in self.symmetries:
            total += turn.apply(values)
        return total / (1 + len(self.symmetries))


def choose_orientation(
    previous: np.ndarray,
    boundary: np.ndarray,
    cell_values: Sequence[np.ndarray] = (),
    transposed: bool = False,
    spacing_departure: np.ndarray | None = None,
) -> Orientation:
    """The orientation of a block: its grid before, its new sides, and values (ni, nj) of its cells.

    `previous`, `boundary`: (2, ni+1, nj+1), of the second the sides alone; `transposed` blocks are
    oriented as those that have i for j; `spacing_departure` (ni+1, nj+1) of
    `find_spacing_departure`, if lines have a spacing of their own.
    """
    if transposed:
        exchanged = [grid[::-1].transpose(0, 2, 1) for grid in (previous, boundary)]
        orientation = choose_orientation(*exchanged, [values.T for values in cell_values])
        symmetries = tuple(turn.transpose() for turn in orientation.symmetries)
        return Orientation(orientation.turn.transpose(), orientation.negated, symmetries)
    wanted = previous.copy()
    copy_sides(boundary, wanted)
    # the turn that the rule of lengths prefers
    measures = [_measure(turn, (previous, wanted), cell_values) for turn in TURNS]
    weights = np.arange(1, measures[0].size + 1) * GOLDEN_FRACTION % 1.0 - 0.5
    scores = [float(measure @ weights) for measure in measures]
    best = int(np.argmax(scores))
    turn = TURNS[best]
    # other turns after which the lengths are the same
    symmetries = []
    for candidate, measure in zip(TURNS, measures, strict=True):
        change = Turn(candidate.i != turn.i, candidate.j != turn.j)
        if change != TURNS[0] and np.abs(measure - measures[best]).max() <= SAME_LENGTH:
            symmetries.append(change)
    if spacing_departure is not None:
        turned = turn_departure(turn, spacing_departure)
        symmetries = [
            symmetry
            for symmetry in symmetries
            if np.abs(turn_departure(symmetry, turned) - turned).max() <= SAME_LENGTH
        ]
    # and so are the grids themselves
    negated = turn.mirrors != (compute_area(previous) < 0.0)
    orientation = Orientation(turn, negated, tuple(symmetries))
    grids = [orientation.turn_grid(grid) for grid in (previous, wanted)]
    if all(is_even(grid, orientation.symmetries, SAME_LENGTH) for grid in grids):
        return orientation
    return Orientation(turn, negated, ())


def is_convex(nodes: np.ndarray) -> bool:
    """Whether all cells of a grid (2, ni+1, nj+1) are convex, in either orientation.  Exact."""
    upright = nodes if compute_area(nodes) > 0.0 else nodes[::-1]
    return not find_folded_cells(upright).size


def _measure(turn: Turn, grids, cell_values) -> np.ndarray:
    """All lengths of turned grids over their mean, and their cells' values over theirs."""
    measures = []
    for grid in grids:
        x, y = turn.apply(grid)
        lengths = []
        # edges along i and j, and both diagonals
        for first, second in (
            (np.s_[1:, :], np.s_[:-1, :]),
            (np.s_[:, 1:], np.s_[:, :-1]),
            (np.s_[1:, 1:], np.s_[:-1, :-1]),
            (np.s_[1:, :-1], np.s_[:-1, 1:]),
        ):
            lengths.append(np.hypot(x[first] - x[second], y[first] - y[second]).ravel())
        measures.append(np.concatenate(lengths) / find_mean_length(grid))
    for values in cell_values:
        measures.append(turn.apply(values).ravel() / np.abs(values).max())
    return np.concatenate(measures)
