"""Named blocks of space whose faces move: functions of s in [0, 1], and the grid at s = 0.

Shapes of this project, in metres; each is written down as a map of the unit cube, so that its faces
are exact.  What the map does inside is not used: a regridder finds the inside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from regrid.errors import BadInput, suggest


@dataclass(frozen=True)
class MovingBlock:
    """A block on the way: `start` (3, n1+1, n2+1, n3+1) at s = 0, `boundary(s)` of that shape.

    Of `boundary(s)` the six faces are meant; inner nodes are zeros.
    """

    name: str
    start: np.ndarray
    boundary: Callable[[float], np.ndarray]


Shape = Callable[[np.ndarray, float], np.ndarray]


def piston_with_bump(p: np.ndarray, s: float) -> np.ndarray:
    """A piston that goes half of the way through a box, while a bump of .3 grows on it."""
    bump = 0.3 * s * (np.sin(np.pi * p[1]) * np.sin(np.pi * p[2])) ** 2
    face = 0.5 * s + bump
    return np.array([face + (1.0 - face) * p[0], p[1], p[2]])


def twisted_duct(p: np.ndarray, s: float) -> np.ndarray:
    """A square duct of length 2 whose far end turns by 120 degrees."""
    angle = 2.0 * np.pi / 3.0 * s * p[0]
    y, z = p[1] - 0.5, p[2] - 0.5
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([2.0 * p[0], cosine * y - sine * z, sine * y + cosine * z])


def finger_in_space(p: np.ndarray, s: float) -> np.ndarray:
    """A spike that grows in a column to three wavelengths, from its lower face.

    A quarter of a period: y and z run over half a wave of length 2, from the middle of the spike to
    that of the gap.  Spike and gap are 6 apart at s = 1; the other end stays at 7.
    """
    shape = 0.5 * (1.0 + np.cos(np.pi * p[1])) * 0.5 * (1.0 + np.cos(np.pi * p[2]))
    face = 6.0 * s * (shape - 0.25)
    return np.array([face + (7.0 - face) * p[0], p[1], p[2]])


SHAPES: dict[str, Shape] = {
    "piston_with_bump": piston_with_bump,
    "twisted_duct": twisted_duct,
    "finger_in_space": finger_in_space,
}


def make_moving_block(name: str, cells: tuple[int, int, int]) -> MovingBlock:
    """A named block with so many cells along i, j, k; BadInput for an unknown name."""
    key = name.replace("-", "_")
    if key not in SHAPES:
        raise BadInput(f"moving block: none is called '{name}'{suggest(name, SHAPES)}")
    shape = SHAPES[key]
    p = np.array(np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in cells), indexing="ij"))

    def boundary(s: float) -> np.ndarray:
        nodes = shape(p, s)
        nodes[:, 1:-1, 1:-1, 1:-1] = 0.0
        return nodes

    return MovingBlock(key, shape(p, 0.0), boundary)
