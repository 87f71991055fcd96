"""Whole marches: a regridder follows a boundary that is a function of time.

`march` calls the regridder once per step and records the last grid, intermediate grids, the report
of every step and the worst cell of all.  Note: `boundary_at` is called once per step, in order, so
it may contain a random generator.  If `cells` determines the times of the steps (`choose_times`),
it is also called in advance and must be a function of time only.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from shockgrid.regrid.domains import MovingDomain, find_shortest_edge
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.measure.faults import name_cells
from shockgrid.regrid.measure.quality import (
    find_bad_cells,
    measure_first_line_gap,
    measure_quality,
    say_not_convex,
)
from shockgrid.regrid.protocol import Regridder, RegridReport, call_regridder
from shockgrid.regrid.sides import SIDE_NAMES, compute_area, get_sides

BOUNDARY_PATH_SAMPLES = 513  # times at which the way of the boundary is measured


@dataclass
class March:
    """A march: the last valid grid, how far it came, and the worst of all its steps.

    `nodes` (2, ni+1, nj+1) [m] is the last valid grid, `steps` how many were asked for, `done` how
    many were made.  `failure` says in a sentence why it ended early, None where it came through;
    `error` is what the regridder raised then, `folded` the grid with bad cells that ended it, as
    far as there is one.  `sine`, `aspect`, `gap`: least corner sine, worst aspect ratio and largest
    first line gap (theory R1.6) of all steps; `gap` is 0 where no side was named for it.
    `sub_moves`, `rescues` are sums over the steps.  One entry a step have `times`, `reports` and
    `seconds` (of a processor); `kept` has the grids that were to be kept, `kept_times` their times.
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
    times: list[float] = field(default_factory=list)
    reports: list[RegridReport] = field(default_factory=list)
    kept: list[np.ndarray] = field(default_factory=list)
    kept_times: list[float] = field(default_factory=list)
    error: RegridFailure | None = None

    @property
    def cost(self) -> float:
        """Median step in microseconds of a processor an inner node; nan where there is none."""
        inner = np.prod([n - 2 for n in self.nodes.shape[1:]])
        return 1e6 * float(np.median(self.seconds)) / inner if self.seconds and inner else np.nan

    @property
    def iterations(self) -> int:
        """Linear iterations, or sweeps, of all steps together."""
        return sum(report.iterations for report in self.reports)


def march(
    regridder: Regridder,
    start: np.ndarray,
    boundary_at: Callable[[float], np.ndarray],
    times: Iterable[float] | None = None,
    *,
    cells: float = 0.5,
    gap_sides: Sequence[str] = (),
    keep_every: int = 0,
    sound_speed: np.ndarray | None = None,
) -> March:
    """March `start` (2, ni+1, nj+1) [m] along the sides of `boundary_at(time)`, of the same shape.

    One step a time of `times`; without them, steps from 0 to 1 in each of which no boundary node
    moves further than `cells` of the shortest edge at the sides of `start`, as `choose_times` gives
    them; it gives them for other spans, too. The march ends at the first step without a grid, or
    with a non-convex cell; either is reported in what is returned, and nothing is raised for it.
    `start` may be of either orientation (i, j turning clockwise too). `gap_sides`: names of the
    sides whose first line is measured. Every `keep_every`-th grid is kept, with `start` as the
    first; 0 keeps none. `sound_speed` (ni, nj) [m/s] is passed on to a regridder that knows the
    cost of a step.

    Raises BadInput for arrays, names or numbers that do not fit.
    """
    start = np.ascontiguousarray(start, dtype=np.float64)
    _check(start, gap_sides, keep_every)
    if times is None:
        times = choose_times(start, boundary_at, cells)
    # steps in time
    times = [float(t) for t in times]
    if not np.isfinite(times).all():
        raise BadInput("march: times must be finite numbers")
    arguments = () if sound_speed is None else (sound_speed,)
    turned = compute_area(start) < 0.0
    progress = March(start.copy(), len(times))
    if keep_every:
        progress.kept.append(progress.nodes)
        progress.kept_times.append(0.0)
    # each is regridded from the last good grid
    for step, t in enumerate(times, start=1):
        boundary = boundary_at(t)
        begun = time.process_time()
        try:
            result = call_regridder(regridder, progress.nodes, boundary, *arguments)
        except RegridFailure as failure:
            progress.failure = str(failure)
            progress.folded = failure.grid
            progress.error = failure
            break
        seconds = time.process_time() - begun
        # convex, whichever way round it is
        upright = result.nodes[::-1] if turned else result.nodes
        quality = measure_quality(upright)
        if quality.bad_cells:
            named = name_cells(find_bad_cells(upright), 8)
            progress.failure = f"{say_not_convex(quality.bad_cells)}: {named}"
            progress.folded = result.nodes
            break
        # what is known of the march so far
        progress.nodes = result.nodes
        progress.done = step
        progress.times.append(t)
        progress.seconds.append(seconds)
        progress.reports.append(result.report)
        progress.sub_moves += result.report.sub_moves
        progress.rescues += result.report.rescues
        if gap_sides:
            progress.gap = max(
                progress.gap, *(measure_first_line_gap(progress.nodes, s) for s in gap_sides)
            )
        progress.sine = min(progress.sine, quality.least_scaled_jacobian)
        progress.aspect = max(progress.aspect, quality.worst_aspect_ratio)
        if keep_every and step % keep_every == 0:
            progress.kept.append(progress.nodes)
            progress.kept_times.append(t)
    return progress


def march_domain(
    regridder: Regridder,
    domain: MovingDomain,
    steps: int | None = None,
    *,
    cells: float = 0.5,
    end: float = 1.0,
    keep_every: int = 0,
) -> March:
    """March a domain from s = 0 to `end` in equal steps of s, at most `cells` of a cell each.

    `steps` is taken instead where it is given.  The first line is measured at the deforming sides.
    Raises BadInput for numbers that do not fit.
    """
    if steps is None:
        _check_cells(cells)
        steps = max(1, int(np.ceil(end * domain.steps_for(cells) - 1e-9)))
    return march(
        regridder,
        domain.start,
        domain.boundary,
        [end * step / steps for step in range(1, steps + 1)],
        gap_sides=domain.deforming_sides,
        keep_every=keep_every,
    )


def choose_times(
    start: np.ndarray,
    boundary_at: Callable[[float], np.ndarray],
    cells: float = 0.5,
    span: tuple[float, float] = (0.0, 1.0),
) -> np.ndarray:
    """Times (n,) after `span[0]`, the last `span[1]`, at which the fastest boundary node has gone
    equal ways of at most `cells` of the shortest edge along or away from the sides of `start`.

    Ways are measured at 513 times of `span` and taken as even between them.  Raises BadInput where
    `cells` is not positive, `span` empty, or a boundary is not finite.
    """
    _check_cells(cells)
    begin, end = (float(t) for t in span)
    if not begin < end:
        raise BadInput(f"march: span {span} must begin before it ends")
    # way of the fastest boundary node so far, at many times
    fine = np.linspace(begin, end, BOUNDARY_PATH_SAMPLES)
    last = None
    travel = np.zeros(BOUNDARY_PATH_SAMPLES)
    for k, t in enumerate(fine):
        boundary = np.asarray(boundary_at(float(t)), dtype=np.float64)
        if boundary.shape != start.shape:
            raise BadInput(
                f"march: the boundary at t = {t:g} has shape {boundary.shape}, start {start.shape}"
            )
        sides = np.concatenate(get_sides(boundary), axis=1)
        if not np.isfinite(sides).all():
            raise BadInput(f"march: the boundary at t = {t:g} has nodes that are not finite")
        if last is not None:
            travel[k] = travel[k - 1] + np.hypot(*(sides - last)).max()
        last = sides
    # equal parts of it
    longest = cells * min(find_shortest_edge(start, side) for side in SIDE_NAMES)
    count = max(1, int(np.ceil(travel[-1] / longest - 1e-9)))
    if travel[-1] == 0.0:
        return np.array([end])
    times = np.interp(np.linspace(0.0, travel[-1], count + 1)[1:], travel, fine)
    times[-1] = end
    return times


def _check(start: np.ndarray, gap_sides: Sequence[str], keep_every: int) -> None:
    if start.ndim != 3 or start.shape[0] != 2 or min(start.shape[1:]) < 2:
        raise BadInput(f"march: start has shape {start.shape}; it must be (2, ni+1, nj+1)")
    if not np.isfinite(start).all():
        raise BadInput("march: start has nodes that are not finite numbers")
    for side in gap_sides:
        if side not in SIDE_NAMES:
            raise BadInput(f"march: no side is called {side!r}; sides are {', '.join(SIDE_NAMES)}")
    if keep_every < 0:
        raise BadInput(f"march: keep_every = {keep_every}; it must be 0 or more")


def _check_cells(cells: float) -> None:
    if not 0.0 < cells < np.inf:
        raise BadInput(f"march: cells = {cells}; it must be positive")
