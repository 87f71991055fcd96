"""Marching any regridder along a march, by the same rules for all.

A regridder is a callable `regrid(previous, boundary) -> nodes`: `previous` is the last grid,
`boundary` has the sides wanted and NaN inside; both (dim, ni+1, nj+1[, nk+1]).  It may raise
`Refused` or RegridFailure.  One whose attribute `sees_cost` is true is called with the cells' sound
speeds as a third argument where the march has them; one that cuts motions within a call counts the
parts in `sub_moves`.

The rules: a grid counts when its sides are those asked for, to the bit, and its cells are valid.
Where one does not, the step is tried again in 2, 4, 8 and 16 equal parts of the sides' motion.
Where that fails the march ends at that step.  Tries of a step that was done are paid for.
Note: the clock is that of the process; peers have to run on one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field

import numpy as np

from regrid_suite import measures
from regrid_suite.marches import March, get_side, name_sides
from shockgrid.regrid.errors import RegridFailure

Regrid = Callable[..., np.ndarray]
MOST_PARTS = 16
LAG_CALLS = 40  # further calls that stand for the converged grid
SETTLED = 1e-4  # mean edges: a call that moves no node further is the last


class Refused(Exception):
    """A regridder has no grid for a boundary; `grid`, where there is one, is what it came to."""

    def __init__(self, what: str, grid: np.ndarray | None = None):
        super().__init__(what)
        self.grid = grid


@dataclass
class Outcome:
    """What came of a march; measures as in `measures`, the worst of all steps that were done.

    `cost` is in microseconds of processor time an inner node and step; `failure` is one sentence;
    `ended_by` the grid that ended the march, where there is one.
    """

    march: str
    steps: int
    done: int = 0
    sub_moves: int = 0
    cost: float = 0.0
    gap: float | None = None
    aspect: float = 1.0
    sine: float = 1.0
    sine_1: float = 1.0
    smoothness: float = 1.0
    node_speed: float = 0.0
    rate: float = 0.0
    mean_rate: float = 0.0
    lag: float | None = None
    overlap: float | None = None
    failure: str | None = None
    nodes: np.ndarray | None = field(default=None, repr=False)
    ended_by: np.ndarray | None = field(default=None, repr=False)

    @property
    def whole(self) -> bool:
        """Did it come to the end?"""
        return self.done == self.steps

    def describe(self) -> dict:
        """All numbers and words, without the grids."""
        return {
            name: value for name, value in asdict(self).items() if name not in ("nodes", "ended_by")
        }


def run_march(march: March, regrid: Regrid, lag: bool = False) -> Outcome:
    """March a regridder and measure every grid; `lag`: how far the last one is from converged.

    A regridder that compiles at its first calls has to be warmed up by another march.
    """
    found = Outcome(march.name, march.steps, nodes=march.start.copy())
    seconds = 0.0
    rates = []
    for step in range(1, march.steps + 1):
        before = found.nodes
        old_sides = march.boundary(step - 1)
        parts = 1
        begun = time.process_time()
        while True:
            nodes, failure = march_parts(march, regrid, before, old_sides, step, parts)
            if failure is None or parts == MOST_PARTS:
                break
            parts *= 2
        if failure is not None:
            found.failure = f"step {step}: {failure}"
            found.ended_by = nodes
            if nodes is not None and np.isfinite(nodes).all():
                found.overlap = measures.measure_overlap(nodes)
            break
        seconds += time.process_time() - begun
        found.nodes = nodes
        found.done = step
        found.sub_moves += parts - 1
        rates.append(measure_step(found, march, before, step))
    if rates:
        found.rate = max(rates)
        found.mean_rate = float(np.mean(rates))
    found.sub_moves += getattr(regrid, "sub_moves", 0)
    found.cost = 1e6 * seconds / (march.inner_nodes * max(found.done, 1))
    if lag and found.whole and found.nodes is not None:
        found.lag = measure_lag(march, regrid, found.nodes)
    return found


def march_parts(
    march: March, regrid: Regrid, nodes: np.ndarray, old_sides: np.ndarray, step: int, parts: int
) -> tuple[np.ndarray | None, str | None]:
    """A step in equal parts: the last grid that was made, and why it is none, or None."""
    new_sides = march.boundary(step)
    for part in range(1, parts + 1):
        way = part / parts
        sides = new_sides if part == parts else (1.0 - way) * old_sides + way * new_sides
        nodes, failure = try_step(march, regrid, nodes, sides, step, parts)
        if failure is not None:
            return nodes, failure
    return nodes, None


def try_step(
    march: March, regrid: Regrid, previous: np.ndarray, sides: np.ndarray, step: int, parts: int
) -> tuple[np.ndarray | None, str | None]:
    """One call: the grid, and why it does not count, or None."""
    boundary = sides.copy()
    boundary[(slice(None), *(slice(1, -1),) * march.dim)] = np.nan
    more = ()
    if march.sound is not None and getattr(regrid, "sees_cost", False):
        more = (march.sound[step],)
    try:
        nodes = regrid(previous.copy(), boundary, *more)
    except (Refused, RegridFailure) as refusal:
        words = refusal.what if isinstance(refusal, RegridFailure) else str(refusal)
        return refusal.grid, words
    for side in name_sides(march.dim):
        if not np.array_equal(get_side(nodes, side), get_side(boundary, side)):
            return nodes, f"side {side} is not the one asked for"
    bad = measures.count_bad_cells(nodes)
    return nodes, f"{bad} cells are folded" if bad else None


def measure_step(found: Outcome, march: March, before: np.ndarray, step: int) -> float:
    """Keep the worst of all measures of the grid `found.nodes`; its largest rate."""
    nodes = found.nodes
    sines = measures.compute_sines(nodes)
    found.sine = min(found.sine, float(np.nanmin(sines)))
    found.sine_1 = min(found.sine_1, float(np.nanquantile(sines, 0.01)))
    if march.dim == 2:
        found.gap = max(found.gap or 0.0, measures.measure_gap(nodes, march.deforming))
    found.aspect = max(found.aspect, measures.measure_aspect(nodes))
    found.smoothness = max(found.smoothness, measures.measure_smoothness(nodes))
    found.node_speed = max(found.node_speed, measures.measure_node_speed(before, nodes))
    sound = 1.0 if march.sound is None else march.sound[step]
    return float(measures.compute_rates(nodes, sound).max())


def measure_lag(march: March, regrid: Regrid, last: np.ndarray) -> float | None:
    """Largest distance of `last` from where further calls lead, in mean edges.

    None where one fails.  At most `LAG_CALLS` calls on the last sides, fewer where none is needed.
    """
    edge = measures.measure_mean_edge(last)
    nodes = last
    sides = march.boundary(march.steps)
    for _ in range(LAG_CALLS):
        following, failure = try_step(march, regrid, nodes, sides, march.steps, 1)
        if failure is not None or following is None:
            return None
        moved = np.sqrt(((following - nodes) ** 2).sum(axis=0)).max()
        nodes = following
        if moved <= SETTLED * edge:
            break
    return float(np.sqrt(((nodes - last) ** 2).sum(axis=0)).max() / edge)
