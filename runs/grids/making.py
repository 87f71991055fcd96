"""Making a grid: on a named domain by marching, on given sides by passes, in a block of space.

Every family moves a valid grid to new sides, so sides given all at once need a first grid:
transfinite interpolation, repaired where it is folded.
Then the family is called again and again until its grid stays where it is.

Where no grid is found the one that it came to is handed back with `failure`, to be looked at.

Note: far from its own grid a family may leave corners much sharper for a while, on the way to
better ones or for good.  So passes are shortened where they spoil the grid; how far the last one
moved a node is told.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.barrier.given_spacing import agrees_with_sides, find_given_spacing
from shockgrid.regrid.barrier.orientation import is_convex
from shockgrid.regrid.barrier.repair import repair_grid
from shockgrid.regrid.domains import DOMAINS, MovingDomain, make_domain
from shockgrid.regrid.domains_in_space import (
    BLOCKS,
    SHAPES,
    MovingBlock,
    find_block,
    make_moving_block,
)
from shockgrid.regrid.equidistribution import volumes
from shockgrid.regrid.equidistribution.weights import Weight, make_position_weight
from shockgrid.regrid.errors import BadInput, RegridFailure, suggest
from shockgrid.regrid.given import (
    check_nodes,
    describe_repair,
    find_start,
    is_file_name,
    read_grid,
    read_sides,
)
from shockgrid.regrid.hexahedra.regridder import BarrierRegridder3D
from shockgrid.regrid.marching import March, march_domain
from shockgrid.regrid.measure import hexahedra
from shockgrid.regrid.measure.corners import compute_hexahedron_centres
from shockgrid.regrid.measure.cuts import Cuts, reverse_cuts
from shockgrid.regrid.measure.faults import name_cells
from shockgrid.regrid.measure.quality import compute_scaled_jacobians, measure_quality
from shockgrid.regrid.protocol import Regridder, call_regridder
from shockgrid.regrid.registry import call_with_options, make_regridder
from shockgrid.regrid.sides import compute_area
from shockgrid.runs.deck.reading import parse_value
from shockgrid.runs.grids.quality import Judgement, judge, plan_outputs, write_grid

Cells = tuple[int, ...]
Family = str | Regridder
NONE: Mapping[str, Any] = MappingProxyType({})
MOST_PASSES = 40
MOTION_STEPS = 40
CELLS_IN_SPACE = (20, 20, 20)
SPACING_OPTIONS = {"spacing", "first_grid", "method", "edge_lengths"}
SPATIAL_OPTIONS = ("iterations", "sides", "threads")
FAMILIES_IN_SPACE = {
    "barrier": BarrierRegridder3D,
    "equidistribution": volumes.EquidistributionRegridder3D,
}
MOST_LOSS = 0.5  # a pass may leave the minimum scaled Jacobian no smaller than this part of it
LEAST_PART = 0.02  # of a pass
SETTLED_PASS_MOVE = 1e-3  # cells: a pass that moves no node further is the last


@dataclass(eq=False)
class Grid:
    """A grid that was made: `nodes` (2 or 3, ...) [m], how in `notes`, and its `quality`.

    `failure` says why it is not what was asked for; `sides` (2, ni+1, nj+1) then are those for
    which there is no grid, where they are not the grid's own.  `march` counts passes; `spreads` is
    that of weight times volume after each iteration in space.
    """

    nodes: np.ndarray
    notes: list[str] = field(default_factory=list)
    failure: str | None = None
    sides: np.ndarray | None = None
    march: March | None = None
    weight: np.ndarray | None = None  # of the cells
    spreads: np.ndarray | None = None
    made_by: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def quality(self) -> Judgement:
        """`valid`, `bad_cells`, `least_sine`, `worst_aspect`, `fields` of the cells."""
        return judge(self.nodes, self.weight)

    def write(self, *paths: str | Path, force: bool = False) -> list[Path]:
        """Write files of the kinds their names end in (.h5, .npz, .vts); what was written.

        Raises BadInput for another ending, and for a file that exists unless `force`.
        """
        parts = self.nodes, self.quality, self.made_by
        planned = plan_outputs([str(path) for path in paths], force)
        return [written for path in planned for written in write_grid(path, *parts)]


def parse_options(words: tuple[str, ...]) -> dict[str, Any]:
    """`--option key=value` as a dictionary; numbers and true/false are taken as such."""
    options: dict[str, Any] = {}
    for word in words:
        key, sign, text = word.partition("=")
        if not sign or not key.strip():
            raise BadInput(f"--option {word}: write key=value, such as --option epsilon=1e-3")
        options[key.strip().replace("-", "_")] = parse_value(text)
    return options


def choose_family(
    family: Family, options: Mapping[str, Any] = NONE, weight: str | None = None
) -> Regridder:
    """A regridder of the registry, with a weight if one is given, or one of a user's own.

    BadInput as `make_regridder`, and for what is no regridder.
    """
    given = dict(options) if weight is None else {"weight": weight, **(options or {})}
    if isinstance(family, str):
        return make_regridder(family, **given)
    if not hasattr(family, "regrid") or isinstance(family, type):
        raise BadInput(
            f"family = {family!r}: the name of one is wanted, or a regridder that has been made, "
            "with a method regrid(previous, boundary)"
        )
    if given:
        raise BadInput(f"{', '.join(given)}: your own regridder has its options already")
    return family


def name_family(family: Family | None, source: object, spatial: bool) -> str:
    """The name of a family, left out the default one; `spatial`: the source has no other."""
    if spatial and family is not None:
        raise BadInput(f"--family {family}: {source} is in space, where cells are equidistributed")
    if family is None:
        return "ed3" if spatial else "barrier"
    return family if isinstance(family, str) else type(family).__name__


def march(domain: MovingDomain, regridder: Regridder, steps: int, end: float = 1.0) -> March:
    """March `domain` from s = 0 to `end` in equal steps; stops at the first step without a grid.

    A grid handed back with a cell that is not convex ends the march as well.  Compiling is not in
    its times.
    """
    warm_up(domain, regridder)
    return march_domain(regridder, domain, steps, end=end)


def warm_up(domain: MovingDomain, regridder: Regridder) -> None:
    """One call outside the clock: compiling is not regridding."""
    try:
        regridder.regrid(domain.start, domain.boundary(1e-6))
    except RegridFailure:
        pass


def default_cells(name: str) -> tuple[int, int]:
    """Default cells of a named domain."""
    parameters = inspect.signature(DOMAINS[name.replace("-", "_")]).parameters
    return parameters["ni"].default, parameters["nj"].default


class NoGrid(RegridFailure):
    """No valid grid was found; `made` is what it came to."""

    def __init__(self, made: Grid):
        super().__init__(str(made.failure), grid=made.nodes)
        self.made = made


def make(
    source: str | Path | np.ndarray,
    family: Family | None = None,
    *,
    cells: Cells | None = None,
    steps: int = MOTION_STEPS,
    at: float = 1.0,
    weight: str | None = None,
    block: str | None = None,
    **options: Any,
) -> Grid:
    """A grid of a named domain or block, on the curves or sides in a file, on those of an array.

    source: a name of `shockgrid grid list`, a file, or nodes (2, ni+1, nj+1) of which the sides
    count.  family: a name with `options` ["barrier"], or your own regridder.  cells: along i and
    j, where the source leaves it open.  steps, at: of a domain's motion and the part of it that is
    made.  weight: a formula, as `--weight`.  Raises
    BadInput for what there is not, RegridFailure where no valid grid was found.
    """
    if not 0.0 <= at <= 1.0:
        raise BadInput(f"at = {at}: a number from 0 to 1 is wanted")
    source_name = "an array" if isinstance(source, np.ndarray) else str(source)
    name = source_name.replace("-", "_")
    used = name_family(family, source_name, name in BLOCKS)
    if name in BLOCKS:
        law = make_spatial_law(options, weight)
        size = cells or CELLS_IN_SPACE
        found = volumes.equidistribute_block(find_block(name), size, law, **options)
        made = _describe_ed3(found, law)
    elif name in SHAPES:
        if weight is not None:
            raise BadInput(f"--weight: {source_name} moves; its families take none")
        made = make_moving(name, used, options, cells or CELLS_IN_SPACE, steps, at)
    else:
        regridder = choose_family(family or used, options, weight)
        if isinstance(source, np.ndarray):
            nodes = check_nodes(source, "the array")
            made = make_on_curves(nodes, regridder, MOST_PASSES, "the array")
        elif name in DOMAINS:
            made = make_on_domain(name, used, regridder, cells or default_cells(name), steps, at)
        elif is_file_name(source_name):
            made = make_on_curves(
                read_sides(source_name, block, cells), regridder, MOST_PASSES, source_name
            )
        else:
            known = [name.replace("_", "-") for name in (*DOMAINS, *BLOCKS, *SHAPES)]
            raise BadInput(
                f"no domain and no file is called {source_name!r}{suggest(source_name, known)}"
            )
    made.made_by = {"source": source_name, "family": used, "at": at, "steps": steps}
    return _finish(made, options, weight)


def regrid(
    grid: Grid | np.ndarray | str | Path,
    family: Family | None = None,
    *,
    weight: str | None = None,
    **options: Any,
) -> Grid:
    """A grid regenerated on its own sides; one that is not valid is untangled first.

    The barrier keeps the spacing of a plane grid that its sides do not tell, unless `spacing` says
    "sides".

    grid: nodes (2 or 3, ...), a `Grid`, or a file.  Other arguments and what is raised: `make`.
    """
    nodes = find_nodes(grid)
    source = grid.made_by.get("source", "a grid") if isinstance(grid, Grid) else "a grid"
    used = name_family(family, source, nodes.shape[0] == 3)
    if used == "barrier" and not SPACING_OPTIONS & options.keys() and is_graded_inside(nodes):
        options = {"spacing": "given", **options}
    if nodes.shape[0] == 3:
        made = regrid_space(nodes, make_spatial_law(options, weight), options)
    else:
        made = regrid_plane(nodes, choose_family(family or used, options, weight), MOST_PASSES)
    made.made_by = {"source": source, "family": used}
    return _finish(made, options, weight)


def is_graded_inside(nodes: np.ndarray) -> bool:
    """Has a valid plane grid a spacing that its sides do not tell?"""
    if nodes.shape[0] == 3 or not is_convex(nodes):
        return False
    return not agrees_with_sides(find_given_spacing(nodes))


def find_nodes(grid: Grid | np.ndarray | str | Path) -> np.ndarray:
    """The nodes (2 or 3, ...) [m] of a grid, an array or a file."""
    if isinstance(grid, Grid):
        return grid.nodes
    if isinstance(grid, np.ndarray):
        return check_nodes(grid, "the array")
    return read_grid(str(grid))


def _finish(made: Grid, options: Mapping[str, Any], weight: str | None) -> Grid:
    """The grid with what it was made by and, in the plane, the weight at its cells."""
    made.made_by |= {
        "options": " ".join(f"{key}={value}" for key, value in options.items()),
        "weight": weight or "",
    }
    if made.failure:
        raise NoGrid(made)
    if weight is not None and made.nodes.shape[0] == 2:
        made.weight = Weight(weight).on(made.nodes, made.nodes)(made.nodes)
    return made


def make_on_domain(name: str, family: str, regridder, cells: Cells, steps: int, at: float) -> Grid:
    """Grid of a named domain at part `at` of its motion; a failure says the step."""
    domain = make_domain(name, *cells)
    if steps == 0:
        return make_on_curves(domain.boundary(at), regridder, MOST_PASSES, name)
    found = march(domain, regridder, steps, at)
    if found.failure:
        s = at * (found.done + 1) / steps
        failure = (
            f"{domain.name}, family {family}: no grid at step {found.done + 1} of {steps} "
            f"(s = {s:.3g}); {found.failure}"
        )
        if found.folded is not None:
            return Grid(found.folded, [], failure)
        return Grid(found.nodes, [], failure, domain.boundary(s))
    note = f"marched in {steps} steps, {found.cost:.2f} µs per node and step"
    if found.sub_moves or found.rescues:
        note += f", {found.sub_moves} sub-moves, {found.rescues} untangling events"
    return Grid(found.nodes, [note])


def make_on_curves(boundary: np.ndarray, regridder, passes: int, where: str) -> Grid:
    """Grid on the sides of `boundary` (2, ni+1, nj+1), by a first grid and passes of the family.

    A failure begins with `where`.
    """
    turned, regridder = _turn(boundary, regridder)
    try:
        nodes, start = find_start(turned, _find_cuts(regridder))
    except RegridFailure as failure:
        made = Grid(transfinite_grid(turned), [], str(failure))
    else:
        made = settle(nodes, turned, regridder, passes, start)
    if made.failure:
        made.failure = f"{where}: {made.failure}"
    if turned is not boundary:
        made.nodes = np.ascontiguousarray(made.nodes[:, :, ::-1])
    return made


def regrid_plane(nodes: np.ndarray, regridder: Regridder, passes: int) -> Grid:
    """A user's plane grid regenerated on its sides; one that is not valid is untangled first."""
    turned, regridder = _turn(nodes, regridder)
    try:
        repaired = repair_grid(turned, cuts=_find_cuts(regridder))
    except RegridFailure as failure:
        return Grid(nodes, [], str(failure))
    start = repaired.nodes
    origin = f"the given grid{describe_repair(repaired.report)}"
    if getattr(regridder, "spacing", "sides") == "given":
        origin += ", whose spacing is kept"
    made = settle(start, turned, regridder, passes, origin)
    if turned is not nodes:
        made.nodes = np.ascontiguousarray(made.nodes[:, :, ::-1])
    return made


def _turn(nodes: np.ndarray, regridder) -> tuple[np.ndarray, Any]:
    """Grid and regridder, or with j reversed where the grid's sides turn clockwise."""
    if compute_area(nodes) > 0.0:
        return nodes, regridder
    cuts = _find_cuts(regridder)
    if cuts:
        regridder = copy(regridder)
        regridder.cuts = reverse_cuts(cuts, nodes)
    return np.ascontiguousarray(nodes[:, :, ::-1]), regridder


def _find_cuts(regridder) -> Cuts:
    """The cuts that a family was told of; none where it knows of no such thing."""
    return getattr(regridder, "cuts", ())


def settle(nodes, boundary, regridder, passes: int, words: str) -> Grid:
    """Call the family on the same sides until its grid stays, or it fails.

    A pass that would more than halve the minimum scaled Jacobian is gone only part of the way.
    """
    cell = np.sqrt(abs(compute_area(nodes)) / ((nodes.shape[1] - 1) * (nodes.shape[2] - 1)))
    shortened = 0
    moved = np.inf
    sine = _least_sine(nodes)
    count = March(nodes, passes)
    while count.done < passes and moved >= SETTLED_PASS_MOVE:
        begun = time.process_time()
        try:
            result = call_regridder(regridder, nodes, boundary)
        except RegridFailure as failure:
            count.failure = str(failure)
            count.folded = failure.grid
            break
        count.seconds.append(time.process_time() - begun)
        count.sub_moves += result.report.sub_moves
        count.rescues += result.report.rescues
        taken = result.nodes
        part = 1.0
        while _least_sine(taken) < MOST_LOSS * sine and part > LEAST_PART:
            part *= 0.5
            taken = nodes + part * (result.nodes - nodes)
        shortened += part < 1.0
        moved = float(np.hypot(*(taken - nodes)).max() / cell)
        nodes = taken
        sine = _least_sine(taken)
        count.done += 1
    quality = measure_quality(nodes)
    count.nodes = nodes
    count.sine = quality.least_scaled_jacobian
    count.aspect = quality.worst_aspect_ratio
    note = f"started from {words}; {count.done} pass{'es' * (count.done > 1)}"
    note += f", {shortened} of them shortened" * (shortened > 0)
    note += f", the last one moved a node by {moved:.2g} cells"
    shown = nodes if count.folded is None else count.folded
    return Grid(shown, [note], count.failure, march=count)


def _least_sine(nodes: np.ndarray) -> float:
    return float(compute_scaled_jacobians(nodes).min())


def regrid_space(nodes: np.ndarray, law, options: Mapping[str, Any]) -> Grid:
    """A user's grid in space equidistributed inside its own faces; untangled first if it has to."""
    if options.get("sides"):
        raise BadInput("--option sides: the faces of a grid from a file stay as they are")
    bad = len(_find_bad_in_space(nodes))
    try:
        start = BarrierRegridder3D().regrid(nodes, nodes).nodes if bad else nodes
        found = volumes.solve_ed3(start, law, **{k: v for k, v in options.items() if k != "sides"})
    except RegridFailure as failure:
        return Grid(nodes, [], str(failure))
    made = _describe_ed3(found, law)
    if bad:
        made.notes.insert(0, f"started from the given grid with {bad} bad cells, untangled")
    return made


def _find_bad_in_space(nodes: np.ndarray) -> np.ndarray:
    """Cells (n, 3) with a corner that is not positive, whichever way round the grid goes."""
    bad = hexahedra.find_bad_hexahedra(nodes)
    other = hexahedra.find_bad_hexahedra(nodes[::-1]) if len(bad) else bad
    return min(bad, other, key=len)


def make_spatial_law(options: Mapping[str, Any], weight: str | None) -> Any:
    """The weight as a function of x, y, z, or 1; BadInput for options that ED3 has not."""
    for key, value in options.items():
        if key not in SPATIAL_OPTIONS:
            known = ", ".join(SPATIAL_OPTIONS)
            raise BadInput(f"--option {key}: a grid in space has the options {known}")
        if not isinstance(value, int):
            raise BadInput(f"--option {key}={value}: a whole number or true/false is wanted")
    return 1.0 if weight is None else make_position_weight(weight, ("x", "y", "z"))


def _describe_ed3(found: volumes.Equidistributed, law) -> Grid:
    bad = _find_bad_in_space(found.nodes)
    failure = None
    if len(bad):
        failure = f"cells {name_cells(bad, 8)} have corners that are not positive"
    first = found.spreads[0]
    last = found.spreads[found.best]
    note = (
        f"{found.residuals.size - 1} iterations ({found.stop}): spread of weight times volume "
        f"{first:.4f} to {last:.4f}, residual {found.residuals[0]:.2e} to "
        f"{found.residuals[found.best]:.2e}"
    )
    values = np.asarray(law(*compute_hexahedron_centres(found.nodes))) if callable(law) else None
    return Grid(found.nodes, [note], failure, weight=values, spreads=found.spreads)


def march_in_space(block: MovingBlock, regridder, steps: int, end: float = 1.0) -> March:
    """March from s = 0 to `end` in equal steps; stops at the first step without a grid, or with one
    of which a cell has a corner volume that is not positive."""
    found = March(block.start.copy(), steps)
    regridder.regrid(block.start, block.boundary(0.0))  # compiling is not regridding
    for step in range(1, steps + 1):
        boundary = block.boundary(end * step / steps)
        begun = time.process_time()
        try:
            result = regridder.regrid(found.nodes, boundary)
        except RegridFailure as failure:
            found.failure = str(failure)
            break
        found.seconds.append(time.process_time() - begun)
        if (bad := ~(hexahedra.compute_least_corner_volumes(result.nodes) > 0.0)).any():
            named = name_cells(np.argwhere(bad), 8)
            found.failure = f"cells {named} have corners that are not positive"
            break
        found.nodes = result.nodes
        found.done = step
        found.reports.append(result.report)
        found.sub_moves += result.report.sub_moves
        found.rescues += result.report.rescues
        found.sine = min(found.sine, float(hexahedra.compute_hexahedron_sines(found.nodes).min()))
    return found


def make_moving(
    name: str, family: str, options: Mapping[str, Any], cells: Cells, steps: int, at: float
) -> Grid:
    """Grid of a named moving block at part `at` of its motion; a failure says the step."""
    if steps < 1:
        raise BadInput(f"--steps {steps}: a moving block of space needs at least 1")
    if family not in FAMILIES_IN_SPACE:
        raise BadInput(f"--family {family}: not one of space{suggest(family, FAMILIES_IN_SPACE)}")
    regridder = call_with_options(FAMILIES_IN_SPACE[family], family, dict(options))
    block = make_moving_block(name, cells)
    found = march_in_space(block, regridder, steps, at)
    if found.failure:
        return Grid(
            found.nodes,
            [],
            f"{block.name}, family {family}: no grid at step {found.done + 1} of {steps}"
            f"; {found.failure}",
        )
    note = (
        f"marched in {steps} steps, {found.cost:.2f} µs per node and step, {found.iterations} "
        f"iterations, {found.sub_moves} sub-moves, {found.rescues} untangling events"
    )
    creased = int((~(hexahedra.compute_least_jacobian(found.nodes) > 0.0)).sum())
    worst = (
        f"minimum scaled Jacobian of all steps {found.sine:.4f}; at the end, cells with a Jacobian "
        f"not positive at 5x5x5 places: {creased}"
    )
    return Grid(found.nodes, [note, worst])
