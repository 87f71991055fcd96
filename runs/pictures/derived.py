"""Fields that are not in a dump but follow from it: one table, a name a line.

To add one: a function of a block of a dump that returns (ni, nj), and a line of `DERIVED`.  Every
picture then knows the name.  A field that the dump itself has goes before a derived one.

Gradients are those of the flow (theory F3): the vector whose products with the ways between
neighbouring cell centres are the differences of the field, central inside a block and one-sided
along its sides.  Fields that are linear in x and y have exact ones on any grid.  The trap: a block
ends where its material ends, so a jump across an interface is no gradient.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from regrid.measure.corners import compute_centres
from runs.store.reader import Dump, DumpBlock


@dataclass(frozen=True)
class Derived:
    """How a field is made, its unit and words, what it needs, and how it is drawn."""

    compute: Callable[[DumpBlock], np.ndarray]
    unit: str
    words: str
    needs: tuple[str, ...]  # fields of the dump; "state/NAME": an array of the restart state
    colours: str = ""  # a colour map of its own, from 0
    power: float = 1.0  # of the value that the colour follows
    marked: bool = False  # is the cell of the largest value marked?


def compute_gradient(block: DumpBlock, name: str) -> np.ndarray:
    """Gradient (2, ni, nj) of a field of cells, in its unit per metre."""
    from hydro.formulas.reconstruction import compute_gradient as solve  # numba: loaded if wanted

    x, y = compute_centres(block.nodes)
    values = block.cell_fields[name]
    (x_i, x_j), (y_i, y_j), (along_i, along_j) = (np.gradient(a) for a in (x, y, values))
    inverse = 1.0 / (x_i * y_j - x_j * y_i)
    return np.array(solve(along_i, along_j, x_i, y_i, x_j, y_j, inverse))


def measure_gradient(block: DumpBlock, name: str) -> np.ndarray:
    """Size (ni, nj) of the gradient of a field, in its unit per metre."""
    return np.hypot(*compute_gradient(block, name))


def compute_vorticity(block: DumpBlock) -> np.ndarray:
    """Vorticity dv/dx - du/dy (ni, nj) [1/s], 2 omega in solid rotation; about the axis normal to
    the plane, also where y is a radius."""
    return compute_gradient(block, "v")[0] - compute_gradient(block, "u")[1]


DERIVED = {
    "schlieren": Derived(
        lambda block: measure_gradient(block, "rho"),
        "kg/m4", "density gradient, its size", ("rho",), "Greys", 0.4,
    ),
    "pressure_gradient": Derived(
        lambda block: measure_gradient(block, "p"),
        "Pa/m", "pressure gradient, its size", ("p",), "magma_r", 0.4,
    ),
    "vorticity": Derived(compute_vorticity, "1/s", "vorticity", ("u", "v")),
    "rate": Derived(
        lambda block: block.state_fields["rates"],
        "1/s", "rate of the cells; the largest (marked) limits dt", ("state/rates",), marked=True,
    ),
}  # fmt: skip


def has_field(block: DumpBlock, name: str) -> bool:
    """Is the field there, or can it be derived from what is?"""
    if name in block.cell_fields:
        return True
    derived = DERIVED.get(name)
    if derived is None or min(block.nodes.shape[1:]) < 3:
        return False
    return all(
        need.removeprefix("state/") in block.state_fields
        if need.startswith("state/")
        else need in block.cell_fields
        for need in derived.needs
    )


def get_field(block: DumpBlock, name: str) -> np.ndarray:
    """A field of cells (ni, nj) in its SI unit, from the dump or derived; KeyError if neither."""
    if name in block.cell_fields:
        return block.cell_fields[name]
    return DERIVED[name].compute(block)


def get_words(block: DumpBlock, name: str) -> tuple[str, str]:
    """Unit and long name of a field that `has_field`."""
    if name in block.cell_fields:
        return block.units[name], block.long_names[name]
    return DERIVED[name].unit, DERIVED[name].words


def get_style(dump: Dump, name: str) -> Derived | None:
    """The line of the table for a field that is derived in this dump."""
    stored = any(name in block.cell_fields for block in dump.blocks)
    return None if stored else DERIVED.get(name)


def list_fields(dump: Dump) -> list[str]:
    """Names of all fields of the dump, then of those that can be derived."""
    derived = [n for n in DERIVED if any(has_field(block, n) for block in dump.blocks)]
    return list(dict.fromkeys([*dump.field_names(), *derived]))
