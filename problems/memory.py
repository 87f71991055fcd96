"""The memory that a run needs, and whether it is there."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence

from shockgrid.regrid.errors import BadInput

LARGE_GRID_CELLS = 100_000  # cells
PROGRAM_BYTES = 190e6  # bytes of the program with its libraries and kernels, measured
RUN_BYTES = 640  # per cell at the peak of a run, measured,
# for blocks of LARGE_GRID_CELLS cells and more, two equal ones, with solves; without: 200
LARGE_BYTES = 350


def estimate_memory(cells: int, blocks: Sequence[int] = ()) -> float:
    """Peak memory [bytes] of a run with `cells` cells; `blocks`: the cells of each, if known.

    Without `blocks`, LARGE_GRID_CELLS cells and more are assumed to be in large blocks.
    """
    blocks = blocks or [cells]
    return PROGRAM_BYTES + sum(
        n * (LARGE_BYTES if n >= LARGE_GRID_CELLS else RUN_BYTES) for n in blocks
    )


def find_memory() -> float | None:
    """Memory [bytes] available to this process; None if the system does not tell (Windows)."""
    try:
        import resource

        memory = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    except (ImportError, AttributeError, OSError, ValueError):
        return None
    return memory if limit == resource.RLIM_INFINITY else min(memory, float(limit))


def check_memory(cells: float, estimate_solver_memory: Callable[[int], float]) -> None:
    """Raise BadInput where a run of so many cells, with its solver's bytes, does not fit."""

    def need(count: float) -> float:
        return estimate_memory(int(count)) + estimate_solver_memory(int(count))

    memory = find_memory()
    if memory is None or (wanted := need(cells)) <= memory:
        return
    fit = float(cells)
    while fit > 1.0 and need(fit) > memory:
        fit *= 0.98
    raise BadInput(
        f"deck: {cells:.4g} cells need about {wanted / 1e9:.3g} GB of memory, where "
        f"{memory / 1e9:.3g} GB are there; take fewer cells, at most about {fit:.2g} fit"
    )
