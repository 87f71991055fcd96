"""Marching a family of grids along with a named domain, step by step, and what came of it."""

from __future__ import annotations

import inspect
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from regrid.domains.catalogue import MovingDomain
from regrid.errors import BadInput, RegridFailure
from regrid.measure.quality import find_bad_cells, measure_first_line_gap, measure_quality
from regrid.registry import find_usable, load_regridder, make_regridder
from runs.grids.quality import name_cells


@dataclass
class March:
    """The last valid grid, how far it came, and the worst of all steps.

    `folded` is the grid with bad cells that ended it, where there is one.
    """

    nodes: np.ndarray
    steps: int
    done: int = 0
    failure: str | None = None
    folded: np.ndarray | None = None
    gap: float = 0.0
    sine: float = 1.0
    aspect: float = 1.0
    sub_moves: int = 0
    rescues: int = 0
    seconds: list[float] = field(default_factory=list)

    @property
    def cost(self) -> float:
        """Median step in microseconds of a processor an inner node."""
        inner = (self.nodes.shape[1] - 2) * (self.nodes.shape[2] - 2)
        return 1e6 * float(np.median(self.seconds)) / inner if self.seconds else np.nan


def parse_options(words: tuple[str, ...]) -> dict[str, Any]:
    """`--option key=value` as a dictionary; numbers and true/false are taken as such."""
    options: dict[str, Any] = {}
    for word in words:
        key, sign, text = word.partition("=")
        if not sign or not key.strip():
            raise BadInput(f"--option {word}: write key=value, such as --option epsilon=1e-3")
        options[key.strip().replace("-", "_")] = _read_value(text.strip())
    return options


def _read_value(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return {"true": True, "false": False}.get(text.lower(), text)


def make_family(name: str, options: dict[str, Any], weight: str | None = None):
    """A regridder of the registry; BadInput for a weight given to a family that takes none."""
    if weight is None:
        return make_regridder(name, **options)
    if not takes_weight(name):
        able = ", ".join(family for family in find_usable() if takes_weight(family))
        raise BadInput(f"--weight: the family '{name}' takes none; these do: {able}")
    return make_regridder(name, **{"weight": _read_value(weight), **options})


def takes_weight(name: str) -> bool:
    """Has this family an option called weight?"""
    return "weight" in inspect.signature(load_regridder(name).__init__).parameters


def march(domain: MovingDomain, regridder, steps: int, end: float = 1.0) -> March:
    """March `domain` from s = 0 to `end` in equal steps; stops at the first step without a grid.

    A grid handed back with a cell that is not convex ends the march as well.
    """
    found = March(domain.start.copy(), steps)
    warm_up(domain, regridder)
    for step in range(1, steps + 1):
        boundary = domain.boundary(end * step / steps)
        begun = time.process_time()
        try:
            result = regridder.regrid(found.nodes, boundary)
        except RegridFailure as failure:
            found.failure, found.folded = str(failure), failure.grid
            break
        seconds = time.process_time() - begun
        quality = measure_quality(result.nodes)
        if quality.bad_cells:
            named = name_cells(find_bad_cells(result.nodes))
            found.failure = f"{quality.bad_cells} cells are not convex: {named}"
            found.folded = result.nodes
            break
        found.nodes, found.done = result.nodes, step
        found.seconds.append(seconds)
        found.sub_moves += result.report.sub_moves
        found.rescues += result.report.rescues
        found.gap = max(
            found.gap, *(measure_first_line_gap(found.nodes, s) for s in domain.deforming_sides)
        )
        found.sine = min(found.sine, quality.least_scaled_jacobian)
        found.aspect = max(found.aspect, quality.worst_aspect_ratio)
    return found


def warm_up(domain: MovingDomain, regridder) -> None:
    """One call outside the clock: compiling is not regridding."""
    try:
        regridder.regrid(domain.start, domain.boundary(1e-6))
    except RegridFailure:
        pass
