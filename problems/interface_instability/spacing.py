"""Spacing of the cells across the interface.

Cells are even near the interface and grow beyond.  Where the shock is on its way, they are finer
at the interface until it has passed: a captured shock is a few cells thick, and what it does to a
wave of the interface is wrong by its thickness over the wavelength, to first order.  When the waves
that it leaves are beyond the finer cells, these grow to the size of the others, by a respacing of
the sides.
"""

import math
from dataclasses import dataclass

import numpy as np

from shockgrid.problems.deck import MOST_CELLS
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.regrid.errors import BadInput

# wavelengths on each side with the finest cells while the shock passes
FINE_ZONE_WAVELENGTHS = 0.05
PASSAGE_CELL_GROWTH = 1.1  # most growth of the finer cells, from one to the next beyond that
MOST_SIDE_CELLS = 10 * MOST_CELLS  # cells along a side
# most speed of nodes that are respaced, over that of sound: faster, what a strong shock has left
# beside the interface is smeared over the wider cells before it has moved the interface
NODE_SPEED = 0.1


def grow_steps(steps: list[float], stretch: float, length: float) -> list[float]:
    """The steps and further ones, each `stretch` times the one before, up to `length` or beyond.

    Raises BadInput for more than a side may have.
    """
    reach = sum(steps)
    while reach < length * (1.0 - 1e-9):
        steps.append(steps[-1] * stretch)
        reach += steps[-1]
        if len(steps) > MOST_SIDE_CELLS:
            raise BadInput(
                f"deck: a block of length {length:g} would have {MOST_SIDE_CELLS} cells and more: "
                "take fewer `cells`, shorter `lengths`, more `stretch`"
            )
    return steps


@dataclass(frozen=True)
class Spacing:
    """The deck's cells across the interface, `finer` times as fine at the interface.

    fine_zone: wavelengths on each side with the finest cells.
    """

    deck: InterfaceDeck
    finer: float = 1.0
    fine_zone: float = FINE_ZONE_WAVELENGTHS

    def make(self, length: float) -> np.ndarray:
        """Distances (n,) [m] of the nodes from the interface, from 0 to `length`."""
        deck = self.deck
        size = deck.wavelength / deck.cells
        steps = list(self._make_finer_steps(size, length))
        even = min(length, deck.uniform * deck.wavelength) - sum(steps)
        steps += [size] * max(0 if steps else 1, round(min(even / size, MOST_SIDE_CELLS)))
        steps = grow_steps(steps, deck.stretch, length)
        positions = np.concatenate([[0.0], np.cumsum(steps)])
        return positions * (length / positions[-1])

    def _make_finer_steps(self, size: float, length: float) -> np.ndarray:
        """Sizes (n,) [m] of the finer cells.

        Their growth sets in and ends gradually, as the slope 6 x (1 - x) of 3 x² - 2 x³, at most
        1.5: a captured shock sends a pulse back to the interface from where it changes at once.
        """
        if self.finer == 1.0:
            return np.empty(0)
        first = size / self.finer
        count = math.ceil(1.5 * math.log(self.finer) / math.log(PASSAGE_CELL_GROWTH))
        part = np.arange(1, count) / count
        growing = first * self.finer ** (part * part * (3.0 - 2.0 * part))
        steps = np.append(
            np.full(round(self.fine_zone * self.deck.wavelength / first), first), growing
        )
        return steps[np.cumsum(steps) <= length]

    def make_last_spacing(self, length: float) -> np.ndarray:
        """Places (n,), from 0 at the interface to 1, of the nodes when no cell is finer."""
        last = Spacing(self.deck).make(length)
        nodes = np.linspace(0.0, last.size - 1.0, self.make(length).size)
        return np.interp(nodes, np.arange(last.size), last) / length
