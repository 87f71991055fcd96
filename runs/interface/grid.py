"""Grids without flow from Python: made, read, judged, compared, written.

`shockgrid.grid` is this module: `sg.grid.make("dome", family="winslow")`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from regrid.domains import DOMAINS, make_domain
from regrid.errors import RegridFailure
from regrid.given import check_nodes, read_grid
from runs.grids import making
from runs.grids.making import PASSES, STEPS, Family, Grid, March
from runs.grids.quality import Judgement, judge


def make(
    source: str | Path | np.ndarray,
    family: Family | None = None,
    *,
    cells: tuple[int, ...] | None = None,
    steps: int = STEPS,
    at: float = 1.0,
    passes: int = PASSES,
    weight: str | None = None,
    block: str | None = None,
    **options: Any,
) -> Grid:
    """A grid of a named domain or block, on the curves or sides in a file, on those of an array.

    source: a name of `shockgrid grid list`, a file, or nodes (2, ni+1, nj+1) of which the sides
    count.  family: a name with `options` ["barrier"], or your own regridder.  cells: along i and
    j, where the source leaves it open.  steps, at: of a domain's motion and the part of it that is
    made; passes: at most, on sides given at once.  weight: a formula, as `--weight`.  Raises
    BadInput for what there is not, RegridFailure where no valid grid was found.
    """
    told = source if isinstance(source, np.ndarray) else str(source)
    words = {"cells": cells, "steps": steps, "at": at, "passes": passes, "block": block}
    return _check(making.make(told, family, options, weight=weight, **words))


def regrid(
    grid: Grid | np.ndarray | str | Path,
    family: Family | None = None,
    *,
    passes: int = PASSES,
    weight: str | None = None,
    **options: Any,
) -> Grid:
    """A grid regenerated on its own sides; a plane one that is not valid is untangled first.

    grid: nodes (2 or 3, ...), a `Grid`, or a file.  Other arguments and what is raised: `make`.
    """
    nodes = _find_nodes(grid)
    return _check(making.regrid(nodes, family, options, passes=passes, weight=weight))


def read(path: str | Path, block: str | None = None) -> np.ndarray:
    """The nodes (2 or 3, ...) [m] in a file (.npz, .h5, .vts, .vtk).

    block: which one, where it has several.  Raises BadInput for a file that holds no grid.
    """
    return read_grid(str(path), block)


def quality(grid: Grid | np.ndarray | str | Path) -> Judgement:
    """What `shockgrid grid check` measures: `valid`, `bad_cells`, `least_sine`, `worst_aspect`, ...

    `fields` of the cells, (ni, nj) each: the smallest sine of a corner, aspect ratio, skew, size.
    """
    return judge(_find_nodes(grid))


def compare(
    domain: str,
    families: Sequence[Family] | Mapping[str, Family],
    *,
    cells: tuple[int, int] | None = None,
    steps: int = STEPS,
) -> dict[str, March]:
    """Named domain marched in `steps` steps by each family; what came of it, by its label.

    families: names or regridders of one's own, with labels where it is a mapping.  Of a march:
    `done` steps of `steps`, `failure`, the last `nodes`, and the worst of all steps: `sine` of a
    corner, `aspect` ratio, first-line `gap`; `cost` in µs a node and step.  Raises BadInput for a
    domain or family that there is not.
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
    """Write a grid to files of the kinds their names end in; see `Grid.write`."""
    grid = grid if isinstance(grid, Grid) else Grid(_find_nodes(grid))
    return grid.write(*paths, force=force)


def _find_nodes(grid: Grid | np.ndarray | str | Path) -> np.ndarray:
    if isinstance(grid, Grid):
        return grid.nodes
    return check_nodes(grid, "the array") if isinstance(grid, np.ndarray) else read(grid)


def _check(made: Grid) -> Grid:
    if made.failure:
        raise RegridFailure(made.failure, grid=made.nodes)
    return made
