"""Grids without flow from Python: made, read, judged, compared, written.

`shockgrid.grid` is this module: `sg.grid.make("dome", family="winslow")`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from regrid.domains import DOMAINS, make_domain
from regrid.domains_in_space import BLOCKS
from regrid.errors import BadInput, RegridFailure, suggest
from regrid.given import check_nodes, is_file_name, read_grid, read_sides
from regrid.protocol import Regridder
from runs.grids.compare import default_cells
from runs.grids.making import (
    PASSES,
    Made,
    March,
    make_family,
    make_on_curves,
    make_on_domain,
    march,
    regrid_plane,
    weigh_cells,
)
from runs.grids.quality import Judgement, check_free, judge, plan_outputs, write_grid

STEPS = 40
Family = str | Regridder


@dataclass(frozen=True)
class Grid:
    """A grid that was made: `nodes` (2, ni+1, nj+1) [m], how in `notes`, and its `quality`.

    `quality.valid`, `quality.least_sine`, `quality.worst_aspect`, `quality.fields` of the cells.
    """

    nodes: np.ndarray
    notes: list[str]
    quality: Judgement
    made_by: dict[str, Any] = field(default_factory=dict)

    def write(self, *paths: str | Path, force: bool = False) -> list[Path]:
        """Write files of the kinds their names end in (.h5, .npz, .vts); what was written.

        Raises BadInput for another ending, and for a file that exists unless `force`.
        """
        return write(self, *paths, force=force)


def make(
    source: str | Path | np.ndarray,
    family: Family = "barrier",
    *,
    cells: tuple[int, int] | None = None,
    steps: int = STEPS,
    at: float = 1.0,
    passes: int = PASSES,
    weight: str | None = None,
    block: str | None = None,
    **options: Any,
) -> Grid:
    """A plane grid of a named domain, on the curves or sides in a file, or on those of an array.

    source: a domain of `shockgrid grid list`, a file, or nodes (2, ni+1, nj+1) of which the sides
    count.  family: a name with `options`, or a regridder of one's own.  cells: along i and j, where
    the source leaves it open.  steps, at: of a domain's motion and the part of it that is made;
    passes: at most, on sides given at once.  weight: a formula, as `--weight`.  Raises BadInput for
    what there is not, RegridFailure where no valid grid was found.
    """
    regridder = _find_family(family, options, weight)
    if isinstance(source, np.ndarray):
        made = make_on_curves(check_nodes(source, "the array"), regridder, passes, "the array")
    elif (name := str(source)).replace("-", "_") in DOMAINS:
        size = cells or default_cells(name)
        if not 0.0 <= at <= 1.0:
            raise BadInput(f"at = {at}: a number from 0 to 1 is wanted")
        made = make_on_domain(name, _name(family), regridder, size, steps, at)
    elif name.replace("-", "_") in BLOCKS:
        raise BadInput(f"{name} is a block in space; `shockgrid grid make {name}` makes its grid")
    elif is_file_name(name):
        made = make_on_curves(read_sides(name, block, cells), regridder, passes, name)
    else:
        known = [domain.replace("_", "-") for domain in DOMAINS]
        raise BadInput(f"no domain and no file is called {name!r}{suggest(name, known)}")
    told = "an array" if isinstance(source, np.ndarray) else str(source)
    return _finish(made, weight, {"source": told, "family": _name(family)})


def regrid(
    grid: Grid | np.ndarray | str | Path,
    family: Family = "barrier",
    *,
    passes: int = PASSES,
    weight: str | None = None,
    **options: Any,
) -> Grid:
    """A plane grid made anew on its own sides; one that is not valid is untangled first.

    grid: nodes (2, ni+1, nj+1), a `Grid`, or a file.  Other arguments and what is raised: `make`.
    """
    nodes = _find_nodes(grid)
    if nodes.shape[0] != 2:
        raise BadInput("a grid in space is made anew by `shockgrid grid regrid FILE`")
    made = regrid_plane(nodes, _find_family(family, options, weight), passes)
    return _finish(made, weight, {"source": "a grid", "family": _name(family)})


def read(path: str | Path, block: str | None = None) -> np.ndarray:
    """The nodes (2 or 3, ...) [m] in a file (.npz, .h5, .vts, .vtk).

    block: which one, where it has several.  Raises BadInput for a file that holds no grid.
    """
    return read_grid(str(path), block)


def quality(grid: Grid | np.ndarray | str | Path) -> Judgement:
    """What `shockgrid grid check` measures: `valid`, `bad_cells`, `least_sine`, `worst_aspect`, ...

    `fields` of the cells, (ni, nj) each: the least sine of a corner, aspect ratio, skew, size.
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
        families = {_name(family): family for family in families}
    size = cells or (default_cells(domain) if domain.replace("-", "_") in DOMAINS else (4, 4))
    moving = make_domain(domain, *size)
    return {
        label: march(moving, _find_family(family, {}, None), steps)
        for label, family in families.items()
    }


def write(grid: Grid | np.ndarray, *paths: str | Path, force: bool = False) -> list[Path]:
    """Write a grid to files of the kinds their names end in; see `Grid.write`."""
    wanted = plan_outputs([str(path) for path in paths], force)
    for path in wanted:
        check_free(path, force)
    made_by = grid.made_by if isinstance(grid, Grid) else {}
    nodes = _find_nodes(grid)
    judgement = grid.quality if isinstance(grid, Grid) else judge(nodes)
    return [written for path in wanted for written in write_grid(path, nodes, judgement, made_by)]


def _find_family(family: Family, options: dict[str, Any], weight: str | None) -> Any:
    if isinstance(family, str):
        return make_family(family, options, weight)
    if not hasattr(family, "regrid") or isinstance(family, type):
        raise BadInput(
            f"family = {family!r}: the name of one is wanted, or a regridder that has been made, "
            "with a method regrid(previous, boundary)"
        )
    if options or weight is not None:
        words = ", ".join([*options, *(["weight"] if weight is not None else [])])
        raise BadInput(f"{words}: a regridder of one's own has its options already")
    return family


def _name(family: Family) -> str:
    return family if isinstance(family, str) else type(family).__name__


def _find_nodes(grid: Grid | np.ndarray | str | Path) -> np.ndarray:
    if isinstance(grid, Grid):
        return grid.nodes
    return check_nodes(grid, "the array") if isinstance(grid, np.ndarray) else read(grid)


def _finish(made: Made, weight: str | None, made_by: dict[str, Any]) -> Grid:
    if made.failure:
        raise RegridFailure(made.failure, grid=made.nodes)
    weights = weigh_cells(weight, made.nodes) if weight is not None else None
    return Grid(made.nodes, made.notes, judge(made.nodes, weights), made_by)
