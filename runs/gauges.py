"""The gauges of a run: their table gauges.csv, and points that go with the material.

A point of the material moves by Heun's method, of second order in dt: a step with the velocity
at its start, then the mean of that and of the velocity in the new flow where the step ended.  It
stays with its material: beside a block's side, by less than half a cell, it has what is
extrapolated there.  Where it has left the flow (through an outflow), it is nan from then on.

`outside` counts the gauges that lie in no block.  The state of the gauges is part of a restart
point: a run that goes on writes the same bits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.problems.deck import Gauge, place_gauges
from shockgrid.problems.evolution import BlockView, Evolution, get_material
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.measure.cells import OUTSIDE_BLOCK, find_places
from shockgrid.runs.store.history import HistoryWriter

FIXED_POINT_GAP = 0.05  # cells beside a block at which a fixed point still counts as in it
# the same for a point of the material, beside the blocks of that material
MATERIAL_POINT_LEEWAY = 0.5
OUTSIDE_ALL_BLOCKS = -1  # number of the block of a point outside of all
POSITIVE = ("rho", "c")


class Places:
    """Where points are: `position` (2, n) [m], `block` (n,) with OUTSIDE_ALL_BLOCKS for outside,
    and cells.

    allowed (blocks, n): in which blocks a point may be; reach (n,): cells beside them.
    """

    def __init__(self, position: np.ndarray, allowed: np.ndarray, reach: np.ndarray):
        count = position.shape[1]
        self.position = position
        self.allowed = allowed
        self.reach = reach
        self.block = np.full(count, OUTSIDE_ALL_BLOCKS, dtype=np.int64)
        self.cell = np.zeros((2, count), dtype=np.int64)
        self.quad = np.zeros((2, count), dtype=np.int64)
        self.part = np.zeros((2, count))

    def locate(self, blocks: Sequence[BlockView]) -> None:
        """Find all points in the present grids, each first where it was last."""
        if len(self.allowed) != len(blocks):  # both materials are in one block from now on
            self.allowed = np.ones((len(blocks), self.position.shape[1]), dtype=bool)
            self.block[:] = OUTSIDE_ALL_BLOCKS
        pending = np.isfinite(self.position).all(axis=0)
        last = self.block.copy()
        self.block[~pending] = OUTSIDE_ALL_BLOCKS
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
        self.block[pending] = OUTSIDE_ALL_BLOCKS

    def _search(
        self, number: int, block: BlockView, tried: np.ndarray, reach: float = 0.0
    ) -> np.ndarray:
        """Look for the points of a mask in one block; the mask of those that are found."""
        found = np.zeros_like(tried)
        chosen = np.flatnonzero(tried)
        if not chosen.size:
            return found
        sizes = np.array(block.nodes.shape[1:])[:, None]
        here = self.block[chosen] == number
        # from the last cell, which may be gone, or else from the middle
        cells = np.minimum(np.where(here, self.cell[:, chosen], sizes // 2), sizes - 2)
        quads = np.zeros_like(cells)
        parts = np.zeros(cells.shape)
        where = np.zeros(chosen.size, dtype=np.int64)
        nodes, points = map(np.ascontiguousarray, (block.nodes, self.position[:, chosen]))
        find_places(nodes, points, float(reach), cells, quads, parts, where)
        here = where != OUTSIDE_BLOCK
        chosen = chosen[here]
        for kept, new in ((self.cell, cells), (self.quad, quads), (self.part, parts)):
            kept[:, chosen] = new[:, here]
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
            a, b = self.quad[:, chosen]
            s, t = self.part[:, chosen]
            ni, nj = block.nodes.shape[1] - 1, block.nodes.shape[2] - 1
            i = np.array([a, np.minimum(a + 1, ni - 1)])[[0, 1, 0, 1]]
            j = np.array([b, np.minimum(b + 1, nj - 1)])[[0, 0, 1, 1]]
            weights = np.array([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t])
            own = self.cell[:, chosen]
            corners = read_cells(block, fields, i, j)
            for name in fields:
                result = (weights * corners[name]).sum(axis=0)
                if name in POSITIVE and (bad := ~(result > 0.0)).any():
                    result[bad] = read_cells(block, [name], own[0][bad], own[1][bad])[name]
                values[name][chosen] = result
        return values


def place_points(points: Sequence[Gauge], blocks: Sequence[BlockView]) -> Places:
    """The gauges of a flow, found in its first grids.

    One that moves may be in blocks of its own material alone.  Raises BadInput for one that moves
    and does not begin in a block, and where blocks lack a field that is asked for.
    """
    _check_fields(points, blocks)
    position = np.array([point.at for point in points], dtype=float).reshape(-1, 2).T.copy()
    moves = np.array([point.moves for point in points], dtype=bool)
    everywhere = np.ones((len(blocks), len(points)), dtype=bool)
    places = Places(position, everywhere, np.where(moves, 0.0, FIXED_POINT_GAP))
    places.locate(blocks)
    materials = [get_material(block) for block in blocks]
    for number in np.flatnonzero(moves):
        if places.block[number] == OUTSIDE_ALL_BLOCKS:
            x, y = position[:, number]
            low = np.min([block.nodes.min(axis=(1, 2)) for block in blocks], axis=0)
            high = np.max([block.nodes.max(axis=(1, 2)) for block in blocks], axis=0)
            raise BadInput(
                f"deck: gauge {points[number].name!r} moves with the material, but at "
                f"[{x:g}, {y:g}] there is none; the blocks lie within x = {low[0]:g} to "
                f"{high[0]:g} m, y = {low[1]:g} to {high[1]:g} m"
            )
        own = materials[places.block[number]]
        places.allowed[:, number] = [material == own for material in materials]
    places.reach[moves] = MATERIAL_POINT_LEEWAY
    return places


def _check_fields(points: Sequence[Gauge], blocks: Sequence[BlockView]) -> None:
    """Raise BadInput if a gauge needs a field that a block does not have.

    Carried fields and temperatures may be missing in some blocks of a flow, not in all of them.
    """
    if not points:
        return
    flows = [block for block in blocks if isinstance(block, Block)]
    known = {"c", *(name for block in flows for name in block.cell_fields)}
    for point in points:
        for name in point.fields if flows else ():
            if name not in known:
                raise BadInput(
                    f"deck: gauge {point.name!r}: there is no field {name!r}"
                    f"{suggest(name, known)}; there are: {', '.join(sorted(known))}"
                )
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


def read_cells(
    block: BlockView, fields: Iterable[str], i: np.ndarray, j: np.ndarray
) -> dict[str, np.ndarray]:
    """Fields of the cells [i, j], shaped as i; of a flow's block nothing else is computed."""
    if not isinstance(block, Block):
        return {name: np.asarray(block.cell_fields[name])[i, j] for name in fields}
    rho, u, v, p = block.state[:, i + 1, j + 1]
    found = {"rho": rho, "u": u, "v": v, "p": p}
    for name in fields:
        if name in ("e", "T") and name in block.cell_fields:
            found[name] = block.compute_at(name, i, j)
        elif name == "c":
            found["c"] = block.eos.sound_speed(rho, p)
        elif name not in found:
            fields = block.cell_fields
            found[name] = fields[name][i, j] if name in fields else np.full(np.shape(i), np.nan)
    return found


PREFIX = "gauges/"  # of the names in a restart point
NO_BLOCK = "-"  # in the table, for the block of a gauge outside of all


class Gauges:
    """The gauges of one evolution, where they are now, and the file that they are written to.

    Of a deck without gauges it does nothing.
    """

    def __init__(self, points: Sequence[Gauge], evolution: Evolution):
        self.points = list(points)
        self.columns: list[str] | None = None  # of the file, where a run goes on
        self._writer: HistoryWriter | None = None
        self.evolution = evolution
        self.t = evolution.t
        self.places = place_points(points, evolution.blocks)
        self.moving = np.flatnonzero([point.moves for point in points])
        self.velocity = np.zeros((2, len(self.points)))
        self.fields = list(dict.fromkeys(name for point in points for name in point.fields))
        if self.moving.size:
            self.fields = list(dict.fromkeys([*self.fields, "u", "v"]))
        self._sample()

    def _sample(self) -> None:
        self.values = self.places.sample(self.evolution.blocks, self.fields)
        if self.moving.size:
            self.velocity = np.array([self.values["u"], self.values["v"]])

    def follow(self) -> None:
        """Move and sample all gauges after a step."""
        blocks = self.evolution.blocks
        places = self.places
        moving = self.moving
        dt = self.evolution.t - self.t
        if moving.size:
            start = places.position[:, moving].copy()
            velocity = self.velocity[:, moving]
            places.position[:, moving] = start + dt * velocity
            places.locate(blocks)
            there = places.sample(blocks, ("u", "v"))
            new = np.array([there["u"], there["v"]])[:, moving]
            places.position[:, moving] = start + (0.5 * dt) * (velocity + new)
        places.locate(blocks)
        self._sample()
        self.t = self.evolution.t

    def make_row(self) -> dict[str, Any]:
        """Columns of gauges.csv at this step."""
        names = [block.name for block in self.evolution.blocks]
        row: dict[str, Any] = {"step": self.evolution.step, "t": self.evolution.t}
        row["outside"] = int((self.places.block == OUTSIDE_ALL_BLOCKS).sum())
        for k, point in enumerate(self.points):
            if point.moves:
                row[f"{point.name}_x"], row[f"{point.name}_y"] = self.places.position[:, k].tolist()
            number = int(self.places.block[k])
            row[f"{point.name}_block"] = NO_BLOCK if number == OUTSIDE_ALL_BLOCKS else names[number]
            for name in point.fields:
                row[f"{point.name}_{name}"] = float(self.values[name][k])
        return row

    def get_state(self) -> dict[str, np.ndarray]:
        """What a restart needs of the gauges, under names of their own; {} without gauges."""
        if not self.points:
            return {}
        places = self.places
        arrays = {
            "position": places.position,
            "velocity": self.velocity,
            "block": places.block,
            "cell": places.cell,
            "allowed": places.allowed.astype(np.int64),
        }
        return {PREFIX + name: array.copy() for name, array in arrays.items()}

    def set_state(self, state: Mapping[str, Any], other_cells: bool = False) -> None:
        """Take up a state of `get_state`, after the evolution its own.  Raises BadInput.

        other_cells: the blocks have other cells than those of the state.
        """
        if not self.points:
            return
        for name, array in self.get_state().items():
            if np.shape(state.get(name)) != array.shape:
                raise BadInput(
                    f"the restart point of step {self.evolution.step} was written without these "
                    "gauges; run with them from the start (shockgrid run)"
                )
        places = self.places
        places.position = np.array(state[PREFIX + "position"])
        places.block = np.array(state[PREFIX + "block"])
        places.cell = np.array(state[PREFIX + "cell"]) * (not other_cells)
        places.allowed = np.array(state[PREFIX + "allowed"]).astype(bool)
        places.locate(self.evolution.blocks)
        self._sample()
        if not other_cells:
            self.velocity = np.array(state[PREFIX + "velocity"])
        self.t = self.evolution.t

    def open(self, path: Path) -> None:
        """Open the file; a new one starts with the row of the current state."""
        if self.points:
            self._writer = HistoryWriter(path, self.columns)
            if self.columns is None:
                self._writer.append(self.make_row())

    def record(self) -> None:
        """Write a row of the state after a step."""
        if self._writer is not None:
            self.follow()
            self._writer.append(self.make_row())

    def sync(self) -> None:
        """Force the rows to the disk, before a dump."""
        if self._writer is not None:
            self._writer.sync()

    def close(self) -> None:
        """Close the file."""
        if self._writer is not None:
            self._writer.close()


def make_gauges(deck: Any, evolution: Evolution) -> Gauges:
    """The gauges of a deck, found in a fresh evolution.

    Raises BadInput for fields that the flow does not have and for points of the material outside.
    """
    return Gauges(place_gauges(deck.gauge), evolution)
