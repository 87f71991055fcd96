"""A U whose arms close: one block that meets itself, two linked ones, and its upper half."""

from __future__ import annotations

import numpy as np

from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from hydro.links import join
from hydro.simulation import Simulation

ARM, HALF_GAP, THICK = 4e-3, 2e-4, 1e-3


def make_line(cells, bend):
    """Points (2, n) of the inner line of the upper half, from the arm's tip, and normals."""
    x = np.linspace(0.0, ARM, cells + 1)[:-1]
    angle = np.linspace(0.5 * np.pi, 0.0, bend + 1)
    line = np.concatenate([
        [x, np.full(x.size, HALF_GAP)],
        [ARM + HALF_GAP * np.cos(angle), HALF_GAP * np.sin(angle)],
    ], axis=1)  # fmt: skip
    normal = np.concatenate([[0.0 * x, 0.0 * x + 1.0], [np.cos(angle), np.sin(angle)]], axis=1)
    normal[:, -1] = 1.0, 0.0
    line[1, -1] = 0.0
    return line, normal


def make_half(cells, bend, layers, sign=1.0):
    line, normal = make_line(cells, bend)
    depth = np.linspace(0.0, THICK, layers + 1)
    nodes = line[:, :, None] + normal[:, :, None] * depth
    nodes[1] *= sign
    return nodes


def give_speed(block, speed):
    """Arms turn towards each other about the bend."""
    x, y = block.nodes
    x, y = (0.25 * (q[1:, 1:] + q[:-1, 1:] + q[1:, :-1] + q[:-1, :-1]) for q in (x, y))
    block.state[2, 1:-1, 1:-1] = -speed * np.sign(y) * np.clip(1.0 - x / ARM, 0.0, 1.0)


def make_u(kind="whole", speed=400.0, cells=40, bend=6, layers=8, t_end=1.5e-6, material="Al1100"):
    """`kind`: "whole", one block; "linked", two with a seam; "half", the upper one on a wall."""
    found = find_material(material)
    upper, lower = make_half(cells, bend, layers), make_half(cells, bend, layers, -1.0)
    if kind == "whole":
        grids = {"u": np.concatenate([upper, lower[:, -2::-1]], axis=1)}
    elif kind == "linked":
        grids = {"upper": upper, "lower": lower[:, ::-1]}
    else:
        grids = {"upper": upper}
    blocks, links = [], []
    for name, nodes in grids.items():
        block = Block(name, found.eos, nodes, found.rho0, 0.0, 0.0, 0.0, material="metal")
        give_speed(block, speed)
        put(block, "j_min", "free-surface")
        put(block, "j_max", "free-surface")
        blocks.append(block)
    put(blocks[0], "i_min", "wall")
    if kind == "linked":
        links.append(join("seam", (blocks[0], "i_max"), (blocks[1], "i_min")))
    put(blocks[-1], "i_max", "wall")
    return blocks, Simulation(blocks, links, t_end=t_end)
