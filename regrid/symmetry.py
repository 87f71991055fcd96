"""Blocks that agree with their mirror image, or with themselves turned by half a circle.

Such a block must stay so, but some operations magnify rounding:

    solves       conjugate gradients reduce what their residual shows, and multiply what it does
                 not show by 2 to 10; in a symmetric block that is all that is not symmetric
    speed limit  nodes move by fractions of the heights of their old cells, which differ by
                 rounding, step by step where cells are thin

Where the rest exceeds rounding, the motion of the nodes is therefore replaced by its symmetric part
(`Symmetry`).  Theory R5.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from shockgrid.regrid.jit import inlined, kernel

SYMMETRIC_LENGTH = 1e-9  # of the mean length: up to which a block counts as symmetric
ROUNDING_OF_MOTION = 1e-13  # of the mean length: up to which it differs from its image by rounding


class Turn(NamedTuple):
    """Whether the indices i and j run backwards."""

    i: bool
    j: bool

    @property
    def mirrors(self) -> bool:
        """Whether it turns a block that goes anticlockwise into one that goes clockwise."""
        return self.i != self.j

    def transpose(self) -> Turn:
        """The same turn where i and j are exchanged."""
        return Turn(self.j, self.i)

    def apply(self, values: np.ndarray) -> np.ndarray:
        """A view of `values` (..., n, m), their last two axes turned."""
        return values[..., :: -1 if self.i else 1, :: -1 if self.j else 1]


TURNS = (Turn(False, False), Turn(True, False), Turn(False, True), Turn(True, True))


def turn_departure(turn: Turn, spacing_departure: np.ndarray) -> np.ndarray:
    """Departures (ni+1, nj+1) of the lines' spacing, counted from the turned ends.

    They are those of `regrid.barrier.workspace.find_spacing_departure`.
    """
    turned = turn.apply(spacing_departure)
    return np.ascontiguousarray(-turned if turn.i else turned)


class Symmetry(NamedTuple):
    """The `turns` after which a grid agrees with itself, and the `rotations` (complex numbers of
    modulus 1) that bring its image back; `rounding` [m] of places."""

    turns: tuple[Turn, ...]
    rotations: tuple[complex, ...]
    rounding: float

    def even_out(self, change: np.ndarray) -> bool:
        """Leave the symmetric part of displacements (2, ni+1, nj+1), in place.

        False, and bitwise the same displacements, where all else is rounding.
        """
        before = change[0] + 1j * change[1]
        mean = before.copy()
        for turn, rotation in zip(self.turns, self.rotations, strict=True):
            image = turn.apply(before)
            mean += rotation * (np.conj(image) if turn.mirrors else image)
        mean /= 1 + len(self.turns)
        if not np.abs(mean - before).max() > self.rounding:
            return False
        change[0] = mean.real
        change[1] = mean.imag
        return True


@inlined
def compute_edge_length(nodes, i, j, next_i, next_j):
    """Length [m] of the edge between two nodes of a grid (2, ni+1, nj+1)."""
    x, y = nodes
    edge_x = x[next_i, next_j] - x[i, j]
    edge_y = y[next_i, next_j] - y[i, j]
    return np.sqrt(edge_x * edge_x + edge_y * edge_y)


@inlined
def compute_mean_side_edge(nodes):
    """Mean of the mean lengths [m] of the edges along the sides j = const and i = const."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    total_i = 0.0
    for i in range(ni):
        total_i += compute_edge_length(nodes, i, 0, i + 1, 0)
        total_i += compute_edge_length(nodes, i, nj, i + 1, nj)
    total_j = 0.0
    for j in range(nj):
        total_j += compute_edge_length(nodes, 0, j, 0, j + 1)
        total_j += compute_edge_length(nodes, ni, j, ni, j + 1)
    return 0.25 * (total_i / ni + total_j / nj)


@inlined
def are_sides_symmetric(nodes, turns_i, turns_j, most):
    """Whether the edges along the sides of a grid (2, ni+1, nj+1) are as long as their images.

    turns_i, turns_j: whether the indices of the image run backwards; most: difference [m].
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for j in (0, nj):
        image_j = nj - j if turns_j else j
        for i in range(ni):
            image_i = ni - 1 - i if turns_i else i
            image = compute_edge_length(nodes, image_i, image_j, image_i + 1, image_j)
            if not abs(compute_edge_length(nodes, i, j, i + 1, j) - image) <= most:
                return False
    for i in (0, ni):
        image_i = ni - i if turns_i else i
        for j in range(nj):
            image_j = nj - 1 - j if turns_j else j
            image = compute_edge_length(nodes, image_i, image_j, image_i, image_j + 1)
            if not abs(compute_edge_length(nodes, i, j, i, j + 1) - image) <= most:
                return False
    return True


@kernel(allocates=False)
def find_turns_of_sides(nodes):
    """For each turn but the first of TURNS: whether it leaves the lengths along the sides alike.

    nodes: (2, ni+1, nj+1).
    """
    most = SYMMETRIC_LENGTH * compute_mean_side_edge(nodes)
    return (
        are_sides_symmetric(nodes, True, False, most),
        are_sides_symmetric(nodes, False, True, most),
        are_sides_symmetric(nodes, True, True, most),
    )


def find_symmetry(
    previous: np.ndarray,
    displaced: np.ndarray,
    cell_values: Sequence[np.ndarray] = (),
    spacing_departure: np.ndarray | None = None,
) -> Symmetry | None:
    """How a block agrees with itself up to rounding, before and after its motion.

    `previous`, `displaced`: (2, ni+1, nj+1); `cell_values`: values (ni, nj) of its cells;
    `spacing_departure` (ni+1, nj+1): that of its lines, if they have their own spacing.  The
    lengths along the sides are compared first: most blocks end there.
    """
    found_before = find_turns_of_sides(previous)
    if not any(found_before):
        return None
    found_after = find_turns_of_sides(displaced)
    departure = spacing_departure
    turns = []
    for turn, before, after in zip(TURNS[1:], found_before, found_after, strict=True):
        if not (before and after):
            continue
        if not all(_agree(turn, values, np.abs(values).max()) for values in cell_values):
            continue
        if departure is not None:
            change = turn_departure(turn, departure) - departure
            if np.abs(change).max() > SYMMETRIC_LENGTH:
                continue
        if all(is_even(grid, (turn,), SYMMETRIC_LENGTH) for grid in (previous, displaced)):
            turns.append(turn)
    if not turns:
        return None
    place = displaced[0] + 1j * displaced[1]
    place -= place.mean()
    rotations = tuple(_find_rotation(turn, place) for turn in turns)
    return Symmetry(tuple(turns), rotations, ROUNDING_OF_MOTION * find_mean_length(displaced))


def even_out_grid(nodes: np.ndarray, axes: np.ndarray, turns: Sequence[Turn]) -> np.ndarray:
    """The mean of a grid and those that `turns` make of it, about the axes of another.

    `nodes`, `axes`: (2, ni+1, nj+1); `axes` itself comes out exactly symmetric.
    """
    place = axes[0] + 1j * axes[1]
    centre = place.mean()
    place -= centre
    moved = nodes[0] + 1j * nodes[1] - centre
    total = moved.copy()
    for turn in turns:
        image = turn.apply(moved)
        total += _find_rotation(turn, place) * (np.conj(image) if turn.mirrors else image)
    mean = total / (1 + len(turns)) + centre
    return np.array((mean.real, mean.imag))


def is_even(nodes: np.ndarray, turns: Sequence[Turn], most: float) -> bool:
    """Whether a grid (2, ni+1, nj+1) agrees with those that `turns` make of it, up to `most` of the
    mean length."""
    difference = np.abs(even_out_grid(nodes, nodes, turns) - nodes).max()
    return bool(difference <= most * find_mean_length(nodes))


def find_mean_length(nodes: np.ndarray) -> float:
    """Mean length [m] of the edges of a grid (2, ni+1, nj+1)."""
    steps = np.diff(nodes, axis=1), np.diff(nodes, axis=2)
    return float(np.concatenate([np.hypot(*step).ravel() for step in steps]).mean())


def _agree(turn: Turn, values: np.ndarray, scale: float) -> bool:
    """Whether values (n, m) agree with their turned ones."""
    return bool(np.abs(turn.apply(values) - values).max() <= SYMMETRIC_LENGTH * scale)


def _find_rotation(turn: Turn, place: np.ndarray) -> complex:
    """The rotation that brings the turned places (ni+1, nj+1), complex, back to the places."""
    turned = turn.apply(place)
    rotation = np.vdot(np.conj(turned) if turn.mirrors else turned, place)
    return complex(rotation / abs(rotation))
