"""Plates of a column in plane flow, with free surfaces on both sides, walls along it."""

from __future__ import annotations

import itertools

import numpy as np

from builders import box, free, make_body, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.rows import CONSERVED


def make_plate(
    name, material, ends, cells, speed=0.0, rows=2, height=1e-3, p=0.0, low=0.0, **options
):  # fmt: skip
    """A block between two x, from y = `low` up, of a material by name or of an (eos, density)."""
    nodes = box((ends[0], low), (ends[1], low + height), (cells, rows))
    if isinstance(material, str):
        block = make_body(name, material, nodes, speed, p=p)
    else:
        block = Block(name, material[0], nodes, material[1], speed, 0.0, p)
    free(block, "i_min", "i_max", pressure=p, **options)
    wall_off(block)
    return block


def find_event(rows, column, number=1):
    """Time at the start of the step in which a count reached a number."""
    for before, row in itertools.pairwise(rows):
        if row[column] >= number:
            return before["t"]
    raise AssertionError(f"{column} has not come to {number}")


def mean_speed(block):
    mass, momentum = block.totals.sums[CONSERVED][:2]
    return momentum / mass


def middle_row(block, row):
    return block.state[row, 1:-1, 1 + block.nj // 2]


def take_plateau(values, width=5, skip=2):
    """Mean next to the first or (negative skip) the last cells."""
    return float(np.mean(values[skip : skip + width] if skip >= 0 else values[skip - width : skip]))
