"""A simulation that a script made of its own blocks: `shockgrid.run(simulation, "out/mine")`.

The deck of such a run says what can be said without the script: how long it marches and what it
leaves behind.  Blocks, materials and links are in the script alone, so that a restart is given them
anew.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from problems.deck import Deck
from problems.evolution import Evolution
from problems.problem import Problem
from regrid.errors import BadInput

Measure = Callable[[Any], dict[str, float]]


class OwnSimulationDeck(Deck, kw_only=True):
    script: Annotated[str, Meta(description="file of the script that made the blocks")] = ""
    materials: Annotated[
        dict[str, str], Meta(description="block and its material, to know the run by")
    ] = msgspec.field(default_factory=dict)


class OwnSimulation(Problem):
    """Blocks of a script; `evolution` and `measure` are given to it before it is built."""

    Deck = OwnSimulationDeck
    deck: OwnSimulationDeck

    def __init__(
        self,
        deck: OwnSimulationDeck,
        evolution: Evolution | None = None,
        measure: Measure | None = None,
    ):
        super().__init__(deck)
        self.evolution, self.own_measure = evolution, measure

    def build(self) -> Evolution:
        """The simulation that was given; BadInput where none was."""
        if self.evolution is None:
            script = f" ({self.deck.script})" if self.deck.script else ""
            raise BadInput(
                f"the blocks of this run were made in Python{script}, and only there can they be "
                "made again: shockgrid.restart(directory, simulation=...) goes on with it"
            )
        return self.evolution

    def measure(self, evolution: Evolution) -> dict[str, float]:
        """The columns of the function that was given; none without."""
        return self.own_measure(evolution) if self.own_measure else {}

    def say_restart(self, directory: str) -> str:
        """The call by which it goes on."""
        return f"in Python: shockgrid.restart({directory!r}, simulation=...)"
