"""Points in a flow: in which block each lies, and the fields there.

Interpolated is between the centres of four cells, where the scheme puts a cell's averages:
second order, exact for linear fields.  Within half a cell of a block's side the same map goes on
beyond the outermost centres; a density or sound speed that would not be positive there is the
cell's own.  Energy and sound speed are computed in the four cells from their density and pressure.

A point on an interface belongs to the block in which it was last, at first to the first block of
the flow that has it.  The trap: sliding contacts leave slivers between the chords of their lines;
a fixed point up to GAP cells beside a block still counts as in it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from hydro.block import Block
from problems.deck import GaugePoint
from problems.evolution import BlockView, get_material
from regrid.errors import BadInput
from regrid.measure.cells import OUTSIDE, find_places

GAP = 0.05  # cells beside a block at which a fixed point still counts as in it
LEEWAY = 0.5  # the same for a point of the material, beside the blocks of that material
NOWHERE = -1  # number of the block of a point outside of all
POSITIVE = ("rho", "c")


class Places:
    """Where points are: `position` (2, n) [m], `block` (n,) with NOWHERE for outside, and cells.

    allowed (blocks, n): in which blocks a point may be; reach (n,): cells beside them.
    """

    def __init__(self, position: np.ndarray, allowed: np.ndarray, reach: np.ndarray):
        count = position.shape[1]
        self.position = position
        self.allowed, self.reach = allowed, reach
        self.block = np.full(count, NOWHERE, dtype=np.int64)
        self.cell = np.zeros((2, count), dtype=np.int64)
        self.quad = np.zeros((2, count), dtype=np.int64)
        self.part = np.zeros((2, count))

    def locate(self, blocks: Sequence[BlockView]) -> None:
        """Find all points anew in the present grids, each first where it was last."""
        pending = np.isfinite(self.position).all(axis=0)
        last = self.block.copy()
        self.block[~pending] = NOWHERE
        for number, block in enumerate(blocks):
            pending &= ~self._search(number, block, pending & (last == number))
        reaches = [0.0] if not pending.any() else [0.0, *np.unique(self.reach[pending])]
        for reach in reaches:
            for home in (True, False) if reach else (False,):  # beside the last block first
                for number, block in enumerate(blocks):
                    tried = pending & (self.allowed[number] | (last == number))
                    if reach:
                        tried &= self.reach == reach
                    if home:
                        tried &= last == number
                    pending &= ~self._search(number, block, tried, reach)
        self.block[pending] = NOWHERE

    def _search(
        self, number: int, block: BlockView, tried: np.ndarray, reach: float = 0.0
    ) -> np.ndarray:
        """Look for the points of a mask in one block; the mask of those that are found."""
        found = np.zeros_like(tried)
        chosen = np.flatnonzero(tried)
        if not chosen.size:
            return found
        cells = np.ascontiguousarray(self.cell[:, chosen])
        strangers = self.block[chosen] != number
        sizes = np.array(block.nodes.shape[1:])[:, None]
        cells[:, strangers] = sizes // 2
        cells = np.minimum(cells, sizes - 2)  # where grid lines have gone since
        quads, parts = np.zeros_like(cells), np.zeros(cells.shape)
        where = np.zeros(chosen.size, dtype=np.int64)
        nodes = np.ascontiguousarray(block.nodes)
        points = np.ascontiguousarray(self.position[:, chosen])
        find_places(nodes, points, float(reach), cells, quads, parts, where)
        here = where != OUTSIDE
        chosen = chosen[here]
        self.cell[:, chosen], self.quad[:, chosen] = cells[:, here], quads[:, here]
        self.part[:, chosen] = parts[:, here]
        self.block[chosen] = number
        found[chosen] = True
        return found

    def sample(self, blocks: Sequence[BlockView], fields: Iterable[str]) -> dict[str, np.ndarray]:
        """Fields (n,) at all points in SI units; nan outside of all blocks."""
        fields = list(fields)
        values = {name: np.full(self.block.size, np.nan) for name in fields}
        for number, block in enumerate(blocks):
            chosen = np.flatnonzero(self.block == number)
            if not chosen.size:
                continue
            (a, b), (s, t) = self.quad[:, chosen], self.part[:, chosen]
            ni, nj = block.nodes.shape[1] - 1, block.nodes.shape[2] - 1
            i = np.array([a, np.minimum(a + 1, ni - 1)])[[0, 1, 0, 1]]
            j = np.array([b, np.minimum(b + 1, nj - 1)])[[0, 0, 1, 1]]
            weights = np.array([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t])
            own = self.cell[:, chosen]
            corners = take_cells(block, fields, i, j)
            for name in fields:
                result = (weights * corners[name]).sum(axis=0)
                if name in POSITIVE and (bad := ~(result > 0.0)).any():
                    result[bad] = take_cells(block, [name], own[0][bad], own[1][bad])[name]
                values[name][chosen] = result
        return values


def place_points(points: Sequence[GaugePoint], blocks: Sequence[BlockView]) -> Places:
    """The gauges of a flow, found in its first grids.

    One that moves may be in blocks of its own material alone.  Raises BadInput for one that moves
    and does not begin in a block, and where blocks lack a field that is asked for.
    """
    _check_fields(points, blocks)
    position = np.array([point.at for point in points], dtype=float).T.copy()
    moves = np.array([point.moves for point in points])
    everywhere = np.ones((len(blocks), len(points)), dtype=bool)
    places = Places(position, everywhere, np.where(moves, 0.0, GAP))
    places.locate(blocks)
    materials = [get_material(block) for block in blocks]
    for number in np.flatnonzero(moves):
        if places.block[number] == NOWHERE:
            x, y = position[:, number]
            raise BadInput(
                f"deck: gauge {points[number].name!r} moves with the material, but at "
                f"[{x:g}, {y:g}] there is none; {_describe_extent(blocks)}"
            )
        own = materials[places.block[number]]
        places.allowed[:, number] = [material == own for material in materials]
    places.reach[moves] = LEEWAY
    return places


def _describe_extent(blocks: Sequence[BlockView]) -> str:
    low = np.min([block.nodes.min(axis=(1, 2)) for block in blocks], axis=0)
    high = np.max([block.nodes.max(axis=(1, 2)) for block in blocks], axis=0)
    return f"the blocks lie within x = {low[0]:g} to {high[0]:g} m, y = {low[1]:g} to {high[1]:g} m"


def _check_fields(points: Sequence[GaugePoint], blocks: Sequence[BlockView]) -> None:
    """Raise BadInput where a gauge asks for what a block does not have."""
    for block in blocks:
        if isinstance(block, Block):
            continue
        if block.nodes.shape[0] != 2:
            raise BadInput("deck: gauge: gauges are for plane and axisymmetric flows")
        for point in points:
            wanted = (*point.fields, *(("u", "v") if point.moves else ()))
            for name in wanted:
                if name not in block.cell_fields:
                    there = ", ".join(block.cell_fields) or "none"
                    raise BadInput(
                        f"deck: gauge {point.name!r}: block {block.name!r} has no field {name!r} "
                        f"in its cells; there are: {there}"
                    )


def take_cells(
    block: BlockView, fields: Iterable[str], i: np.ndarray, j: np.ndarray
) -> dict[str, np.ndarray]:
    """Fields of the cells [i, j], shaped as i; of a flow's block nothing else is computed."""
    if not isinstance(block, Block):
        return {name: np.asarray(block.cell_fields[name])[i, j] for name in fields}
    rho, u, v, p = block.state[:, i + 1, j + 1]
    found = {"rho": rho, "u": u, "v": v, "p": p}
    for name in fields:
        if name == "e":
            found["e"] = block.eos.energy(rho, p) + block.void_energy[i, j]
        elif name == "c":
            found["c"] = block.eos.sound_speed(rho, p)
    return found
