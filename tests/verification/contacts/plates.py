"""Plates of a column in plane flow, with free surfaces on both sides, walls along it."""

from __future__ import annotations

import itertools

import numpy as np

from builders import box
from hydro.block import Block
from hydro.boundary import put
from hydro.eos.materials import find_material
from hydro.rows import CONSERVED
from hydro.simulation import Simulation


def make_plate(
    name, material, ends, cells, speed=0.0, rows=2, height=1e-3, p=0.0, low=0.0, **options
):  # fmt: skip
    """A block between two x, from y = `low` up, of a material by name or of an (eos, density)."""
    found = find_material(material) if isinstance(material, str) else None
    eos, rho = (found.eos, found.rho0) if found else material
    nodes = box((ends[0], low), (ends[1], low + height), (cells, rows))
    block = Block(name, eos, nodes, rho, speed, 0.0, p)
    for side in ("i_min", "i_max"):
        put(block, side, "free-surface", pressure=p, **options)
    for side in ("j_min", "j_max"):
        put(block, side, "wall")
    return block


def make_stack(blocks, t_end, **options):
    return Simulation(blocks, options.pop("links", []), t_end=t_end, **options)


def advance(simulation, until=None):
    """March until something is so, or to the end; the rows."""
    rows = [simulation.start_row() | {"t": simulation.t}]
    while not simulation.finished and not (until and until(rows)):
        rows.append(simulation.advance())
    return rows


def find_event(rows, column, number=1):
    """Time at the start of the step in which a count reached a number."""
    for before, row in itertools.pairwise(rows):
        if row[column] >= number:
            return before["t"]
    raise AssertionError(f"{column} has not come to {number}")


def mean_speed(block):
    mass, momentum = block.sums[CONSERVED][:2]
    return momentum / mass


def middle_row(block, row):
    return block.state[row, 1:-1, 1 + block.nj // 2]


def take_plateau(values, width=5, skip=2):
    """Mean next to the first or (negative skip) the last cells."""
    return float(np.mean(values[skip : skip + width] if skip >= 0 else values[skip - width : skip]))
