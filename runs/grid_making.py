"""Making a grid: on a named domain by marching, on given sides by passes, in a block of space.

Every family carries a valid grid to new sides, so sides given all at once need a first grid:
transfinite interpolation or straight lines where that is valid, else interpolation untangled.
Then the family is called again and again until its grid stays where it is.

The trap: a family that stops at its first pass may still have moved its grid only part of the
way; the last motion is told, in cells.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from regrid.boundary_check import explain_failure, find_crossing
from regrid.domains import make_domain, transpose_nodes
from regrid.domains_blocks import find_block
from regrid.equidistribution3d import (
    Equidistributed,
    compute_centres,
    equidistribute_block,
    solve_ed3,
)
from regrid.errors import BadInput, RegridFailure
from regrid.families import fill_family_weights
from regrid.hexahedra import find_bad_hexahedra
from regrid.quality import find_bad_cells
from regrid.quasi1d import quasi_1d_grid
from regrid.transfinite import transfinite_grid
from regrid.untangle import untangle
from regrid.weight_expressions import make_position_weight
from regrid.weights import Weight
from regrid.workspace import Workspace
from runs.grid_marching import make_family, march
from runs.grid_quality import name_cells

PASSES = 20
EPSILON, AREA_WEIGHT = 1e-3, 2.0  # of the barrier, for untangling
SPATIAL_OPTIONS = ("iterations", "sides", "threads")
SETTLED = 1e-3  # cells: a pass that moves no node further is the last


@dataclass
class Made:
    """A grid, the weight of its cells if there is one, and how it was made, in sentences."""

    nodes: np.ndarray
    story: list[str]
    weight: np.ndarray | None = None
    equidistributed: Equidistributed | None = None
    made_by: dict[str, Any] = field(default_factory=dict)


def make_on_domain(
    name: str,
    family: str,
    options: dict[str, Any],
    weight: str | None,
    cells: tuple[int, int],
    steps: int,
    at: float,
) -> Made:
    """Grid of a named domain at part `at` of its motion; RegridFailure says the step."""
    domain = make_domain(name, *cells)
    regridder = make_family(family, options, weight)
    if steps == 0:
        made = make_on_curves(domain.boundary(at), regridder, PASSES)
    else:
        found = march(domain, regridder, steps, at)
        if found.failure:
            s = at * (found.done + 1) / steps
            raise RegridFailure(
                f"{domain.name}, family {family}: no grid at step {found.done + 1} of {steps} "
                f"(s = {s:.3g}); {found.failure.removeprefix('regrid: ')}"
            )
        story = f"marched in {steps} steps, {found.cost:.2f} us a node and step"
        if found.sub_moves or found.rescues:
            story += f", {found.sub_moves} sub-moves, {found.rescues} rescues"
        made = Made(found.nodes, [story])
    made.weight = weigh_cells(weight, made.nodes)
    return made


def make_on_curves(boundary: np.ndarray, regridder, passes: int) -> Made:
    """Grid on the sides of `boundary` (2, ni+1, nj+1), by a first grid and passes of the family."""
    nodes, words = find_start(boundary)
    return settle(nodes, boundary, regridder, passes, words)


def regrid_plane(nodes: np.ndarray, regridder, passes: int) -> Made:
    """A user's plane grid made anew on its own sides; one that is not valid is untangled first."""
    turned = _positive(nodes)
    if len(find_bad_cells(turned)):
        start, words = untangle_grid(turned), "the given grid, untangled"
        if start is None:
            start, words = find_start(turned)
    else:
        start, words = turned, "the given grid"
    made = settle(start, turned, regridder, passes, words)
    if turned is not nodes:
        made.nodes = np.ascontiguousarray(made.nodes[:, :, ::-1])
    return made


def _positive(nodes: np.ndarray) -> np.ndarray:
    """The grid itself, or with j reversed where its areas are negative on the whole."""
    x, y = nodes
    twice = (x[1:, 1:] - x[:-1, :-1]) * (y[:-1, 1:] - y[1:, :-1])
    twice = twice - (y[1:, 1:] - y[:-1, :-1]) * (x[:-1, 1:] - x[1:, :-1])
    return nodes if twice.sum() > 0.0 else np.ascontiguousarray(nodes[:, :, ::-1])


def settle(nodes, boundary, regridder, passes: int, words: str) -> Made:
    """Call the family on the same sides until its grid stays; RegridFailure passes through."""
    cell = np.sqrt(abs(_area(nodes)) / ((nodes.shape[1] - 1) * (nodes.shape[2] - 1)))
    done, moved = 0, np.inf
    while done < passes and moved >= SETTLED:
        found = regridder.regrid(nodes, boundary).nodes
        moved = float(np.hypot(*(found - nodes)).max() / cell)
        nodes, done = found, done + 1
    return Made(
        nodes,
        [f"begun from {words}; {done} passes, the last one moved a node by {moved:.2g} cells"],
    )


def _area(nodes: np.ndarray) -> float:
    up, down = nodes[:, 1:, 1:] - nodes[:, :-1, :-1], nodes[:, :-1, 1:] - nodes[:, 1:, :-1]
    return float(0.5 * (up[0] * down[1] - up[1] * down[0]).sum())


def find_start(boundary: np.ndarray) -> tuple[np.ndarray, str]:
    """A valid grid on the sides of `boundary` and words for it; RegridFailure where none is found.

    Tried in this order: transfinite interpolation, straight lines of either family, the
    interpolation untangled.
    """
    first = transfinite_grid(boundary)
    if len(find_bad_cells(first)) == 0:
        return first, "transfinite interpolation"
    for straight in (quasi_1d_grid(boundary, "i"), quasi_1d_grid(boundary, "j")):
        if len(find_bad_cells(straight)) == 0:
            return straight, "straight lines"
    number = len(find_bad_cells(first))
    untangled = None if find_crossing(boundary) else untangle_grid(first)
    if untangled is None:
        raise RegridFailure(explain_failure(boundary, first))
    return untangled, f"transfinite interpolation with {number} bad cells, untangled"


def untangle_grid(nodes: np.ndarray) -> np.ndarray | None:
    """A valid grid on the sides of a folded one (positive area), None where none was found."""
    weights = np.empty(2)
    fill_family_weights(nodes, weights)
    along_j = bool(weights[1] > weights[0])
    turned = transpose_nodes(nodes) if along_j else nodes
    ki, kj = sorted(weights, reverse=True)
    work = Workspace(turned.shape[1] - 1, turned.shape[2] - 1, 1)
    work.old[:] = work.sides[:] = work.base[:] = turned
    work.begin(True, float(ki), float(kj), EPSILON, AREA_WEIGHT)
    if not untangle(work, work.base):
        return None
    found = transpose_nodes(work.base) if along_j else work.base.copy()
    return None if len(find_bad_cells(found)) else found


def weigh_cells(weight: str | None, nodes: np.ndarray) -> np.ndarray | None:
    """The weight's values at the cells of the finished plane grid."""
    return None if weight is None else Weight(weight).on(nodes, nodes)(nodes)


def make_in_block(
    name: str, weight: str | None, cells: tuple[int, int, int], options: dict[str, Any]
) -> Made:
    """Grid of a named block of space by edges, faces, volume; the options are those of ED3."""
    mapping, given, law = find_block(name), *_spatial_options(options, weight)
    found = equidistribute_block(mapping, cells, law, **given)
    return _tell_ed3(found, weight, law)


def regrid_space(nodes: np.ndarray, weight: str | None, options: dict[str, Any]) -> Made:
    """A user's grid in space equidistributed inside its own faces; untangled grids only."""
    given, law = _spatial_options(options, weight)
    if given.pop("sides", False):
        raise BadInput("--option sides: the faces of a grid from a file stay as they are")
    return _tell_ed3(solve_ed3(nodes, law, **given), weight, law)


def _spatial_options(options: dict[str, Any], weight: str | None):
    for key in options:
        if key not in SPATIAL_OPTIONS:
            known = ", ".join(SPATIAL_OPTIONS)
            raise BadInput(f"--option {key}: a grid in space has the options {known}")
        if not isinstance(options[key], int):
            raise BadInput(f"--option {key}={options[key]}: a whole number or true/false is wanted")
    law = 1.0 if weight is None else make_position_weight(weight, ("x", "y", "z"))
    return dict(options), law


def _tell_ed3(found: Equidistributed, weight: str | None, law) -> Made:
    bad = find_bad_hexahedra(found.nodes)
    if len(bad) and len(find_bad_hexahedra(found.nodes[::-1])):
        raise RegridFailure(f"regrid: cells {name_cells(bad)} have corners that are not positive")
    first, last = found.spreads[0], found.spreads[found.best]
    story = (
        f"{found.residuals.size - 1} iterations ({found.stop}): spread of weight times volume "
        f"{first:.4f} to {last:.4f}, residual {found.residuals[0]:.2e} to "
        f"{found.residuals[found.best]:.2e}"
    )
    values = None if weight is None else np.asarray(law(*compute_centres(found.nodes)))
    return Made(found.nodes, [story], values, found)
