"""The base of all problems: what a file in `problems/` has to say about itself.

A problem is one module.  The first line of its docstring is what `shockgrid list` prints, the
whole docstring is the head of its page in docs/problems.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from problems.deck import Deck
from problems.evolution import Evolution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# `run_data` is runs.store.reader.RunData; the import would point the wrong way, hence Any.
AnyDeck: TypeAlias = Deck  # inside Problem the name Deck is that of the problem's own
Watched: TypeAlias = Mapping[str, Sequence[tuple[int | slice, slice, slice]]]
DrawFigure = Callable[["Figure", Any], None]


@dataclass(frozen=True)
class BlockPlan:
    """Size of a block that a deck asks for: cells each way, and the corners of its extent [m]."""

    name: str
    cells: tuple[int, int]
    low: tuple[float, float]
    high: tuple[float, float]


class Problem:
    """One problem with one deck: blocks to run, measurements, references, pictures."""

    Deck: ClassVar[type[Deck]] = Deck
    units: ClassVar[Mapping[str, str]] = {}  # of the columns of `measure` that have one
    t_unit: str = "s"  # of t, in words of the screen: "iterations" where it counts those

    def __init__(self, deck: AnyDeck):
        """Keep the deck; a subclass checks here what no single field can (raises BadInput)."""
        self.deck = deck

    def build(self) -> Evolution:
        """The initial state, ready for its first step."""
        raise NotImplementedError

    def plan(self) -> tuple[float, list[BlockPlan]] | None:
        """End time and blocks of the run without allocating it, after all checks of the deck.

        None where `build` is the only way to know (right for problems that are always small).
        """
        return None

    def estimate_cells(self) -> int:
        """Cells of all blocks by arithmetic alone, or somewhat more: asked before `plan` and
        `build`, so that too many are refused before an array of them is made."""
        plan = self.plan()
        return sum(block.cells[0] * block.cells[1] for block in plan[1]) if plan else 0

    def measure(self, evolution: Evolution) -> dict[str, float]:
        """Extra history columns, evaluated before the first and after every step: cheap, same
        keys always, a function of the evolution's state alone (a restart must give the same)."""
        return {}

    def watch(self, evolution: Evolution) -> Watched | None:
        """What `measure` reads of the cells' states besides three rows along every side: by a
        block's name indices of an array (rows, ni, nj) of its states, rows as in `hydro.rows`; {}
        for nothing more; None: any cell, or nodes inside.  What `measure_block` of a
        `hydro.simulation.Simulation` finds need not be watched.

        On several ranks of MPI the first one, which measures, is told so much after every step;
        where it is None, all of all blocks.
        """
        return {} if type(self).measure is Problem.measure else None

    def summary(self, history: Mapping[str, np.ndarray], final: Evolution | None) -> str:
        """The closing screen: what was computed, beside what theory says.

        `history` maps columns to arrays; `final` is the state at the end, None when only the run
        directory is at hand.  The runner prints time, steps and drifts itself.
        """
        return ""

    def cautions(self, history: Mapping[str, np.ndarray] | None = None) -> list[str]:
        """Sentences on where this deck's results are not to be trusted; none where they are.

        Without a `history` of what the deck alone tells: said by `check`, by `--dry-run` and before
        the first step.  With that of a run also of what the run shows: said by the closing screen
        and by `info`.  A sentence names the quantity, how far it is off or why nobody knows, and
        what to change.
        """
        return []

    def count_cells_a_wave(self) -> dict[str, float]:
        """Cells in a wave of each mode that the deck begins with, by its name; {} without modes."""
        return {}

    def list_wave_cautions(self) -> list[str]:
        """Those of the `cautions` that say that `count_cells_a_wave` is too small."""
        return []

    def predict(self) -> dict[str, float]:
        """What the references say for this deck, by name: numbers in SI units, none where unknown.

        A number that belongs to a column of `measure` or of `errors` has its name.
        """
        return {}

    def say_restart(self, directory: str) -> str:
        """The command by which a stopped run in `directory`, quoted for a shell, goes on."""
        return f"shockgrid restart {directory}"

    def say_repeat(self) -> str:
        """How its runs are made again where the deck alone does not do it; "" where it does."""
        return ""

    def errors(self, history: Mapping[str, np.ndarray]) -> dict[str, float]:
        """Errors against the reference by name, for `shockgrid verify`, from a whole run's history.

        Columns of the history need not be repeated here: `verify` knows their last values.
        """
        return {}

    def results(self, history: Mapping[str, np.ndarray]) -> dict[str, tuple[float, float]]:
        """What a whole run was made to find, by name: as computed, and as theory has it.

        NaN for what a run was too short to show or theory does not know.  For studies, which draw
        the first of them over what is varied.
        """
        return {}

    def figures(self) -> dict[str, DrawFigure]:
        """Pictures of this problem by name: functions `(figure, run_data) -> None`.

        `run_data` (runs.store.reader.RunData) has `.deck`, `.history` (dict of arrays), `.dumps`.
        """
        return {}
