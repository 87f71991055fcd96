"""How much memory a deck's cells take, said before anything of their size is made.

Cells are counted by arithmetic (`Problem.estimate_cells`).  The bound of a deck's key (MOST_CELLS)
keeps arrays along one side small; that of all cells is the memory of the machine.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from regrid.errors import BadInput

if TYPE_CHECKING:
    from problems.problem import Problem

LARGE = 100_000  # cells
PROGRAM = 190e6  # bytes of the program with its libraries and kernels, measured
RUN_BYTES = 640  # a cell at the peak of a run, measured,
LARGE_BYTES = 350  # of blocks of LARGE cells and more, two even ones, with solves; without 200


def estimate_memory(cells: int, blocks: Sequence[int] = ()) -> float:
    """Bytes that a run of so many cells takes at its peak; `blocks`: the cells of each, if known.

    Without them it is taken for a run of large blocks from LARGE cells on.
    """
    blocks = blocks or [cells]
    return PROGRAM + sum(n * (LARGE_BYTES if n >= LARGE else RUN_BYTES) for n in blocks)


def find_memory() -> float | None:
    """Bytes of memory of this machine; None where it does not say (Windows)."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return None


def check_cells(cells: int) -> None:
    """Raise BadInput for more cells than the machine's memory holds."""
    memory = find_memory()
    if memory is None or (wanted := estimate_memory(cells)) <= memory:
        return
    fit = max(0, int((memory - PROGRAM) / LARGE_BYTES))
    if fit < LARGE:
        fit = max(0, int((memory - PROGRAM) / RUN_BYTES))
    raise BadInput(
        f"deck: {cells:.4g} cells need about {wanted / 1e9:.3g} GB of memory, this machine has "
        f"{memory / 1e9:.3g} GB; take fewer cells, at most about {fit:.2g} fit"
    )


def check_memory(problem: Problem) -> None:
    """Raise BadInput for a problem whose cells the machine's memory does not hold."""
    check_cells(problem.estimate_cells())
