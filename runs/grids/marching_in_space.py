"""Marching a regridder in space along with a named moving block, and what came of it."""

from __future__ import annotations

import inspect
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from regrid.domains_in_space import MovingBlock, make_moving_block
from regrid.equidistribution.volumes import EquidistributionRegridder3D
from regrid.errors import BadInput, RegridFailure, suggest
from regrid.hexahedra.regridder import BarrierRegridder3D
from regrid.measure.hexahedra import (
    compute_hexahedron_sines,
    compute_least_corner_volumes,
    compute_least_jacobian,
)
from runs.grids.making import Made

FAMILIES_IN_SPACE = {
    "barrier": BarrierRegridder3D,
    "equidistribution": EquidistributionRegridder3D,
}


@dataclass
class MarchInSpace:
    """The last grid (3, ...), and sums and worst of all steps; cells counted in every step.

    `folded` are cells of which a corner volume is not positive, `creased` those of the last grid
    whose trilinear Jacobian is not at one of 5³ places.
    """

    nodes: np.ndarray
    steps: int
    done: int = 0
    failure: str | None = None
    folded: int = 0
    creased: int = 0
    sine: float = 1.0
    sub_moves: int = 0
    rescues: int = 0
    iterations: int = 0
    seconds: list[float] = field(default_factory=list)

    def get_cost(self, mean: bool = False) -> float:
        """Median, or mean, of a step in microseconds of a processor an inner node."""
        inner = np.prod([n - 2 for n in self.nodes.shape[1:]])
        middle = np.mean if mean else np.median
        return float(1e6 * middle(self.seconds) / inner) if self.seconds else np.nan


def make_family_in_space(name: str, options: dict[str, Any]):
    """A regridder for blocks of space; BadInput for a name or an option that is none."""
    if name not in FAMILIES_IN_SPACE:
        raise BadInput(f"--family {name}: not one of space{suggest(name, FAMILIES_IN_SPACE)}")
    known = list(inspect.signature(FAMILIES_IN_SPACE[name]).parameters)
    for option in options:
        if option not in known:
            raise BadInput(f"--option {option}: family '{name}' has none{suggest(option, known)}")
    return FAMILIES_IN_SPACE[name](**options)


def march_in_space(block: MovingBlock, regridder, steps: int, end: float = 1.0) -> MarchInSpace:
    """March from s = 0 to `end` in equal steps; stops at the first step without a grid."""
    found = MarchInSpace(block.start.copy(), steps)
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
        found.nodes, found.done = result.nodes, step
        found.sub_moves += result.report.sub_moves
        found.rescues += result.report.rescues
        found.iterations += result.report.iterations
        found.folded += int((~(compute_least_corner_volumes(found.nodes) > 0.0)).sum())
        found.sine = min(found.sine, float(compute_hexahedron_sines(found.nodes).min()))
    found.creased = int((~(compute_least_jacobian(found.nodes) > 0.0)).sum())
    return found


def make_moving(
    name: str,
    family: str,
    options: dict[str, Any],
    cells: tuple[int, int, int],
    steps: int,
    at: float,
) -> Made:
    """Grid of a named moving block at part `at` of its motion; a failure says the step."""
    if steps < 1:
        raise BadInput(f"--steps {steps}: a moving block of space needs at least 1")
    block = make_moving_block(name, cells)
    found = march_in_space(block, make_family_in_space(family, options), steps, at)
    if found.failure:
        words = f"{block.name}, family {family}: no grid at step {found.done + 1} of {steps}"
        return Made(found.nodes, [], f"{words}; {found.failure}")
    note = (
        f"marched in {steps} steps, {found.get_cost():.2f} us a node and step (mean "
        f"{found.get_cost(mean=True):.2f}), {found.iterations} iterations, {found.sub_moves} "
        f"sub-moves, {found.rescues} rescues"
    )
    worst = (
        f"least corner sine of all steps {found.sine:.4f}; cells with a corner not positive in any "
        f"step: {found.folded}; with a Jacobian not positive at 5x5x5 places, at the end: "
        f"{found.creased}"
    )
    return Made(found.nodes, [note, worst])
