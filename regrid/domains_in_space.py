"""Named blocks in space: fixed ones with curved sides, and blocks whose faces move.

A block is a map of the unit cube, so its faces are exact; its interior is not used, because a
regridder computes it.  ks_block_1 and ks_block_2 follow a figure whose shapes the paper does not
define; what it states (two curved blocks, z from -1 to 0, the weights 1 and 1 + 10 (z + 1)) is
kept, the rest is our own definition, as are the moving blocks (in metres).

Source: [KhakimzyanovShokina1998], Figure 3; theory R10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shockgrid.regrid.errors import BadInput, suggest

Mapping = Callable[[np.ndarray], np.ndarray]


def ks_block_1(p: np.ndarray) -> np.ndarray:
    """A quarter of a ring from r = 1 to 2, between a bulging floor and z = 0.

    p and the points (3, ...); p1 outwards, p2 round the ring, p3 upwards.
    """
    a, b, c = p
    bulge = 1.0 - 0.05 * np.sin(np.pi * a) * np.sin(np.pi * b)
    angle = 0.5 * np.pi * b
    return np.array([(1.0 + a) * np.sin(angle), -(1.0 + a) * np.cos(angle), (c - 1.0) * bulge])


def ks_block_2(p: np.ndarray) -> np.ndarray:
    """A square horn whose width falls along z from 1.5 at z = -1 to 1 at z = 0, on curved sides."""
    a, b, c = p
    width = 1.5 - c * c * (1.5 - c)
    return np.array([(a - 0.5) * width, (b - 0.5) * width, c - 1.0])


def spherical_shell(p: np.ndarray) -> np.ndarray:
    """Part of a shell from r = 1 to 2, cosine of the polar angle within .5, longitude to 1.2.

    p1 is the radius less 1, so the grid of equal volumes, r³ = 1 + 7q, has to be computed.
    """
    r = 1.0 + p[0]
    cosine = p[1] - 0.5
    longitude = 1.2 * p[2]
    sine = np.sqrt(1.0 - cosine * cosine)
    return r * np.array([sine * np.cos(longitude), sine * np.sin(longitude), -cosine])


BLOCKS: dict[str, Mapping] = {
    block.__name__: block for block in (ks_block_1, ks_block_2, spherical_shell)
}


def find_block(name: str) -> Mapping:
    """The mapping of a named block; raises BadInput for an unknown name."""
    key = name.replace("-", "_")
    if key not in BLOCKS:
        raise BadInput(f"block: none is called '{name}'{suggest(name, BLOCKS)}")
    return BLOCKS[key]


@dataclass(frozen=True)
class MovingBlock:
    """A moving block: `start` (3, n1+1, n2+1, n3+1) at s = 0, and `boundary(s)` of that shape.

    `boundary(s)` has the six faces; inner nodes are zeros.
    """

    name: str
    start: np.ndarray
    boundary: Callable[[float], np.ndarray]


Shape = Callable[[np.ndarray, float], np.ndarray]


def piston_with_bump(p: np.ndarray, s: float) -> np.ndarray:
    """A piston that moves halfway through a box while a bump of .3 grows on it."""
    bump = 0.3 * s * (np.sin(np.pi * p[1]) * np.sin(np.pi * p[2])) ** 2
    face = 0.5 * s + bump
    return np.array([face + (1.0 - face) * p[0], p[1], p[2]])


def twisted_duct(p: np.ndarray, s: float) -> np.ndarray:
    """A square duct of length 2 whose far end turns by 120 degrees."""
    angle = 2.0 * np.pi / 3.0 * s * p[0]
    y = p[1] - 0.5
    z = p[2] - 0.5
    cosine = np.cos(angle)
    sine = np.sin(angle)
    return np.array([2.0 * p[0], cosine * y - sine * z, sine * y + cosine * z])


def finger_in_space(p: np.ndarray, s: float) -> np.ndarray:
    """A spike that grows in a column to three wavelengths, from its lower face.

    A quarter of a period: y and z cover half a wave of length 2, from the middle of the spike to
    that of the gap.  Spike and gap are 6 apart at s = 1; the other end is fixed at 7.
    """
    shape = 0.5 * (1.0 + np.cos(np.pi * p[1])) * 0.5 * (1.0 + np.cos(np.pi * p[2]))
    face = 6.0 * s * (shape - 0.25)
    return np.array([face + (7.0 - face) * p[0], p[1], p[2]])


SHAPES: dict[str, Shape] = {
    shape.__name__: shape for shape in (piston_with_bump, twisted_duct, finger_in_space)
}


def make_moving_block(name: str, cells: tuple[int, int, int]) -> MovingBlock:
    """A named block with `cells` along i, j, k; BadInput for an unknown name."""
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
