"""The gauges of a run: their table gauges.csv, and points that go with the material.

A point of the material is carried by Heun's method, of second order in dt: a step with the velocity
at its start, then the mean of that and of the velocity in the new flow where the step ended.  It
stays with its material: beside a block's side, by less than half a cell, it has what is
extrapolated there.  Where it has left the flow (through an outflow), it is nan from then on.

`outside` counts the gauges that lie in no block.  The state of the gauges is part of a restart
point: a run that goes on writes the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from problems.deck import GaugePoint, place_gauges
from problems.evolution import Evolution
from regrid.errors import BadInput
from runs.gauges.sampling import NOWHERE, place_points
from runs.store.history import HistoryWriter, truncate_history

PREFIX = "gauges/"  # of the names in a restart point
NO_BLOCK = "-"  # in the table, for the block of a gauge outside of all


class Gauges:
    """The gauges of one evolution, where they are now."""

    def __init__(self, points: Sequence[GaugePoint], evolution: Evolution):
        self.points = list(points)
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
        blocks, places, moving = self.evolution.blocks, self.places, self.moving
        dt = self.evolution.t - self.t
        if moving.size:
            start, velocity = places.position[:, moving].copy(), self.velocity[:, moving]
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
        row["outside"] = int((self.places.block == NOWHERE).sum())
        for k, point in enumerate(self.points):
            if point.moves:
                row[f"{point.name}_x"], row[f"{point.name}_y"] = self.places.position[:, k].tolist()
            number = int(self.places.block[k])
            row[f"{point.name}_block"] = NO_BLOCK if number == NOWHERE else names[number]
            for name in point.fields:
                row[f"{point.name}_{name}"] = float(self.values[name][k])
        return row

    def get_state(self) -> dict[str, np.ndarray]:
        """What a restart needs of the gauges, under names of their own."""
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


class GaugeTable:
    """Gauges and the file they are written to; does nothing where a deck has no gauges."""

    def __init__(self, path: Path, gauges: Gauges | None):
        self.path, self.gauges = path, gauges
        self._columns: list[str] | None = None
        self._writer: HistoryWriter | None = None

    def resume(self, state: Mapping[str, Any], step: int) -> None:
        """Go on from a restart point: rows after its step are dropped.  Raises BadInput."""
        if self.gauges is not None:
            self.gauges.set_state(state)
            self._columns = truncate_history(self.path, step)

    def open(self) -> None:
        """Open the file; a new one gets the row of the present state."""
        if self.gauges is not None:
            self._writer = HistoryWriter(self.path, self._columns)
            if self._columns is None:
                self._writer.append(self.gauges.make_row())

    def record(self) -> None:
        """Write a row of the state after a step."""
        if self.gauges is not None and self._writer is not None:
            self.gauges.follow()
            self._writer.append(self.gauges.make_row())

    def sync(self) -> None:
        """Force the rows to the disk, before a dump."""
        if self._writer is not None:
            self._writer.sync()

    def get_state(self) -> dict[str, np.ndarray]:
        """The gauges' part of a restart point; {} without gauges."""
        return {} if self.gauges is None else self.gauges.get_state()

    def close(self) -> None:
        """Close the file."""
        if self._writer is not None:
            self._writer.close()


def make_gauges(deck: Any, evolution: Evolution) -> Gauges | None:
    """The gauges of a deck, found in a fresh evolution; None without any.

    Raises BadInput for fields that the flow does not have and for points of the material outside.
    """
    points = place_gauges(deck.gauge)
    return Gauges(points, evolution) if points else None
