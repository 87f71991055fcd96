"""Named blocks in space: two with curved sides, after a figure of a paper, and a spherical shell.

A block is a mapping of the unit cube.  The figure's shapes are not written down in the paper; what
it says of them (two curved blocks, z from -1 to 0, the weights 1 and 1 + 10 (z + 1)) is kept, the
rest is our own definition.

Source: [KhakimzyanovShokina1998], Figure 3; theory R10.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regrid.errors import BadInput, suggest

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

    p1 is the radius less 1, so that the grid of equal volumes, r³ = 1 + 7q, has to be found.
    """
    r, cosine, longitude = 1.0 + p[0], p[1] - 0.5, 1.2 * p[2]
    sine = np.sqrt(1.0 - cosine * cosine)
    return r * np.array([sine * np.cos(longitude), sine * np.sin(longitude), -cosine])


BLOCKS: dict[str, Mapping] = {
    "ks_block_1": ks_block_1,
    "ks_block_2": ks_block_2,
    "spherical_shell": spherical_shell,
}


def find_block(name: str) -> Mapping:
    """The mapping of a named block; raises BadInput for an unknown name."""
    key = name.replace("-", "_")
    if key not in BLOCKS:
        raise BadInput(f"block: none is called '{name}'{suggest(name, BLOCKS)}")
    return BLOCKS[key]
