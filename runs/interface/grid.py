"""Grids without flow from Python: made, read, judged, compared, written.

`shockgrid.grid` is this module: `sg.grid.make("dome", family="winslow")`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from shockgrid.regrid.domains import DOMAINS, make_domain
from shockgrid.regrid.given import read_grid
from shockgrid.runs.grids import making
from shockgrid.runs.grids.making import MOTION_STEPS, Family, Grid, March, find_nodes, make, regrid
from shockgrid.runs.grids.quality import Judgement, judge

__all__ = ("Grid", "compare", "make", "quality", "read", "regrid", "write")


def read(path: str | Path, block: str | None = None) -> np.ndarray:
    """The nodes (2 or 3, ...) [m] in a file (.npz, .h5, .vts, .vtk, Plot3D).

    block: which of several.  Raises BadInput for a file without a grid.
    """
    return read_grid(str(path), block)


def quality(grid: Grid | np.ndarray | str | Path) -> Judgement:
    """What `shockgrid grid check` measures: `valid`, `bad_cells`, `least_sine`, `worst_aspect`, ...

    `fields` of the cells, (ni, nj) each: the smallest sine of a corner, aspect ratio, skew, size.
    """
    return judge(find_nodes(grid))


def compare(
    domain: str,
    families: Sequence[Family] | Mapping[str, Family],
    *,
    cells: tuple[int, int] | None = None,
    steps: int = MOTION_STEPS,
) -> dict[str, March]:
    """March a named domain in `steps` steps with each family; the results by label.

    families: names or your own regridders, as a mapping with labels.  A result has
    `done` steps of `steps`, `failure`, the last `nodes`, and the worst of all steps: `sine` of a
    corner, `aspect` ratio, first-line `gap`; `cost` in µs a node and step.  Raises BadInput for an
    unknown domain or family.
    """
    if not isinstance(families, Mapping):
        families = {making.name_family(family, domain, False): family for family in families}
    known = domain.replace("-", "_") in DOMAINS
    size = cells or (making.default_cells(domain) if known else (4, 4))
    moving = make_domain(domain, *size)
    return {
        label: making.march(moving, making.choose_family(family), steps)
        for label, family in families.items()
    }


def write(grid: Grid | np.ndarray, *paths: str | Path, force: bool = False) -> list[Path]:
    """Write a grid to files, each in the format of its suffix; see `Grid.write`."""
    grid = grid if isinstance(grid, Grid) else Grid(find_nodes(grid))
    return grid.write(*paths, force=force)
