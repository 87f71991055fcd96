"""A simulation that a script made of its own blocks: `shockgrid.run(simulation, "out/mine")`.

The deck of such a run contains what does not need the script: how long it runs and what it writes.
Blocks, materials and links are only in the script, so a restart needs them again.
"""

import shlex
from collections.abc import Callable, Mapping
from typing import Any

from shockgrid.problems.deck import NONE, Deck, key
from shockgrid.problems.evolution import Evolution
from shockgrid.problems.problem import Problem
from shockgrid.regrid.errors import BadInput

Measure = Callable[[Any], dict[str, float]]
NOT_IN_NAMES = ',"'  # what history.csv parts columns by
TAKEN = ("step", "t", "dt", "dt_limit")


class OwnSimulationDeck(Deck, kw_only=True):
    script: key(str, "file of the script that made the blocks") = ""
    materials: key(dict[str, str], "block and its material, to know the run by") = NONE


class OwnSimulation(Problem):
    """Blocks of a script; `evolution` and `measure` are given to it before it is built."""

    Deck = OwnSimulationDeck
    deck: OwnSimulationDeck

    def __init__(self, deck: OwnSimulationDeck, evolution=None, measure: Measure | None = None):
        super().__init__(deck)
        if measure is not None and not callable(measure):
            raise BadInput(f"measure = {measure!r}: a function of the simulation is wanted")
        self.evolution = evolution
        self.own_measure = measure

    def build(self) -> Evolution:
        """The simulation that was given; BadInput where none was."""
        self.plan()
        return self.evolution

    def plan(self) -> None:
        """Nothing is known without the blocks; BadInput where none were given."""
        if self.evolution is None:
            script = f" ({self.deck.script})" if self.deck.script else ""
            raise BadInput(
                f"the blocks of this run were made in Python{script}: "
                "continue it there with shockgrid.restart(directory, simulation=...)"
            )

    def say_repeat(self) -> str:
        """The script makes the blocks, and its deck alone no run."""
        script = self.deck.script
        where = f"by the script {script}" if script else "in Python, in a notebook or by hand"
        call = f"python {shlex.quote(script)}" if script else "shockgrid.run(simulation, directory)"
        return f"Its blocks were made {where}: run that again, {call}. The deck alone makes no run."

    def measure(self, evolution: Evolution) -> dict[str, float]:
        """The columns of the function that was given; none without.

        Raises BadInput for what is no number by name.
        """
        if self.own_measure is None:
            return {}
        row = self.own_measure(evolution)
        if not isinstance(row, Mapping):
            raise BadInput(f"measure returned {row!r}: it returns numbers by name, as a dict")
        for name, value in row.items():
            if not isinstance(name, str) or not name.isprintable() or set(name) & set(NOT_IN_NAMES):
                wanted = "a column's name is text without , or \""
                raise BadInput(f"measure returned {name!r}: {wanted}")
            if name in TAKEN:
                raise BadInput(f"measure returned {name!r}, which every history has; rename it")
            try:
                float(value)
            except (TypeError, ValueError):
                raise BadInput(
                    f"measure returned {value!r} for {name!r}: a number is wanted"
                ) from None
        return dict(row)

    def say_restart(self, directory: str) -> str:
        """The call that continues it."""
        more = ", measure=..." if self.own_measure else ""
        return f"in Python: shockgrid.restart({directory!r}, simulation=...{more})"
