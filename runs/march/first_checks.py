"""What a deck asks for beyond its problem: the regridder, times and fields of dumps, gauges.

`check` and `run --dry-run` make these checks, which a run makes before its first step.  Fields,
gauges and columns can be looked for in built blocks alone; those are built where a deck asks for
such things, up to so many cells that it takes no longer than a start of the program.
"""

from __future__ import annotations

from hydro.history import compute_chosen_columns, find_columns
from problems.deck import Output, Regrid
from problems.evolution import Evolution
from problems.problem import Problem
from regrid.errors import BadInput
from regrid.interpreting import interpreted
from runs.deck.reading import ReadDeck
from runs.gauges.recorder import make_gauges
from runs.march.progress import patience
from runs.march.schedule import check_output, check_times
from runs.ranks.sharing import check_cut

MOST_CELLS = 1_000_000  # that are built to look


def check_deck_fully(read: ReadDeck, problem: Problem) -> None:
    """Raise BadInput for what a run of this deck would be refused for before its first step.

    Kernels are compiled for a deck with gauges, fields or columns alone: these need blocks that can
    march.  Not checked is whether this machine has the memory.  A deck of more than MOST_CELLS
    cells is not built: its gauges, fields and columns are left to the run.
    """
    output = read.deck.output
    with read.numbers_in_reach(), patience(quiet=False):
        check_regridder(problem)
        find_columns(output.columns)
        with interpreted():
            plan = problem.plan()
        if plan is not None:
            check_times(output, plan[0])
            check_cut(read.deck.run.cut, [block.name for block in plan[1]])
        if not (read.deck.gauge or output.fields or output.columns or (output.times and not plan)):
            return
        if problem.estimate_cells() > MOST_CELLS:
            return
        check_requests(read, problem.build())


def check_regridder(problem: Problem) -> None:
    """Make the deck's regridder once; BadInput for a name, an option or a weight that is none."""
    regrid = getattr(problem.deck, "regrid", None)
    if isinstance(regrid, Regrid):
        try:
            regrid.make(threads=problem.deck.run.threads)
        except BadInput as error:
            raise BadInput(f"deck: {error}") from error


def check_requests(read: ReadDeck, evolution: Evolution) -> None:
    """Raise BadInput for dumps, gauges and columns that a freshly built evolution cannot give."""
    output: Output = read.deck.output
    make_gauges(read.deck, evolution)
    check_cut(read.deck.run.cut, [block.name for block in evolution.blocks])
    check_output(output, evolution)
    compute_chosen_columns(evolution, find_columns(output.columns))
