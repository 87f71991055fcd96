"""Blocks of a flow in memory, as a person looks at them: cells and nodes, never ghost cells.

The trap: what these hand out are views of what the flow computes with.  The arrays of two steps
change places, so that an array kept from one step is written over by the next ones: `.copy()` what
is to stay, ask the block again for what is to be new.  Nothing can be written through them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from problems.evolution import BlockView, get_long_names, get_material, get_node_fields
from regrid.errors import BadInput, suggest
from regrid.measure.corners import compute_centres
from runs.store.reader import get_field


def lock(values: np.ndarray) -> np.ndarray:
    """A view of an array through which nothing can be written."""
    view = values.view()
    view.flags.writeable = False
    return view


class LockedFields(Mapping[str, np.ndarray]):
    """Fields by name, each a view through which nothing can be written."""

    def __init__(self, fields: Mapping[str, np.ndarray]):
        self._fields = fields

    def __getitem__(self, name: str) -> np.ndarray:
        return lock(self._fields[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)


class LiveBlock:
    """One block: `nodes` (2, ni+1, nj+1) [m], and its fields `rho`, `u`, `v`, `p`, `e`, (ni, nj).

    SI units; a field of another name is an attribute too.  An unknown name raises AttributeError
    with those that there are.
    """

    def __init__(self, block: BlockView, axes: tuple[str, str] = ("x", "y")):
        self._block = block
        self.name: str = block.name
        self.material: str = get_material(block)
        self.axes = axes
        self.units: Mapping[str, str] = block.units
        fields = {*block.cell_fields, *get_node_fields(block)}
        told = get_long_names(block)
        self.long_names: Mapping[str, str] = {name: told.get(name, name) for name in fields}

    @property
    def nodes(self) -> np.ndarray:
        """Nodes (2, ni+1, nj+1) [m], a view."""
        return lock(self._block.nodes)

    @property
    def centres(self) -> np.ndarray:
        """Middles of the cells (2, ni, nj) [m], computed now."""
        return compute_centres(self._block.nodes)

    @property
    def cells(self) -> tuple[int, int]:
        """Cells along i and along j."""
        ni, nj = (size - 1 for size in self._block.nodes.shape[1:])
        return ni, nj

    @property
    def cell_fields(self) -> Mapping[str, np.ndarray]:
        """Fields of the cells by name, (ni, nj) each: views, and what is computed from them."""
        return LockedFields(self._block.cell_fields)

    @property
    def node_fields(self) -> Mapping[str, np.ndarray]:
        """Fields at the nodes by name, (ni+1, nj+1) each; none in most flows."""
        return LockedFields(get_node_fields(self._block))

    @property
    def state_fields(self) -> Mapping[str, np.ndarray]:
        """What is kept of the cells besides: their rates [1/s], (ni, nj), in flows."""
        rates = getattr(self._block, "rates", None)
        return LockedFields({} if rates is None else {"rates": rates})

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):
            raise AttributeError(name)
        return get_field(self, name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.cell_fields, *self.node_fields})

    def __repr__(self) -> str:
        ni, nj = self.cells
        return f"<block {self.name}: {self.material}, {ni} x {nj} cells>"


class Blocks(Mapping[str, LiveBlock]):
    """The blocks of a flow by name, in their order; BadInput for a name that none has."""

    def __init__(self, blocks: Sequence[BlockView], axes: tuple[str, str]):
        self._blocks = {block.name: LiveBlock(block, axes) for block in blocks}

    def __getitem__(self, name: str) -> LiveBlock:
        try:
            return self._blocks[name]
        except KeyError:
            raise BadInput(f"there is no block {name!r}{suggest(name, self._blocks)}") from None

    def __contains__(self, name: Any) -> bool:
        return name in self._blocks

    def __iter__(self) -> Iterator[str]:
        return iter(self._blocks)

    def __len__(self) -> int:
        return len(self._blocks)

    def __repr__(self) -> str:
        return f"<blocks: {', '.join(self._blocks)}>"
