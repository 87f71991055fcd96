"""The barrier regridder: one Newton step per time step, on a functional with a barrier.

`regrid(previous, boundary)` moves a valid grid to new boundary nodes (theory R4):

    1 spacings, lengths, family weights from the sides       4 if needed, Hessian and solve
    2 boundary displacement interpolated to the interior     5 corner areas against the old ones
    3 residual check: corner areas, gradient, residual       6 shorten, untangle, or halve the move

Every grid that it returns is convex; otherwise RegridFailure names side and nodes.  Note: the
result must depend only on `previous`, `boundary` and a first grid, never on earlier calls.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from shockgrid.regrid.barrier.newton_move import Folded, NewtonMove
from shockgrid.regrid.barrier.orientation import Orientation, choose_orientation, is_convex
from shockgrid.regrid.barrier.points import (
    FRACTIONS_OF_TWO_POINTS,
    OPENED_FRACTIONS,
    close_points,
    find_points,
    open_points,
)
from shockgrid.regrid.barrier.side_inputs import fill_family_weights
from shockgrid.regrid.barrier.tuning import DEFAULT, OPTIONS, Tuning
from shockgrid.regrid.barrier.workspace import Workspace, find_spacing_departure, has_departures
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.measure.crossings import find_crossing
from shockgrid.regrid.measure.cuts import Cuts, take_cuts
from shockgrid.regrid.measure.faults import (
    convert_grids,
    convert_nodes,
    convert_numbers,
    explain_failure,
    find_unit,
)
from shockgrid.regrid.protocol import RegridResult
from shockgrid.regrid.sides import compute_area, copy_sides, get_sides
from shockgrid.regrid.symmetry import turn_departure

# families whose weights differ by less are ranked by the block's shape
EVEN_WEIGHT_DIFFERENCE = 1e-6
SERIAL_NODES = 6400  # smaller blocks stay on one thread


class _NoGrid(Exception):
    """No grid was found; `trial` came closest, in a workspace's frame; or it is `too_sharp`."""

    def __init__(self, trial: np.ndarray, transposed: bool, too_sharp: bool):
        super().__init__()
        self.trial = trial
        self.transposed = transposed
        self.too_sharp = too_sharp

    def turn_back(self, orientation: Orientation) -> tuple[np.ndarray, bool, bool]:
        """The same of the block as it was before it was turned."""
        turn = orientation.turn.transpose() if self.transposed else orientation.turn
        trial = turn.apply(self.trial)
        return (trial[::-1] if turn.mirrors else trial), self.transposed, self.too_sharp


class RegridRequest(NamedTuple):
    """What a regrid is asked for.

    The grid before and the new sides (2, ni+1, nj+1) in m, the cells' speeds of sound (ni, nj) in
    m/s or None, the least limiting rate in 1/s, and the grid whose spacing is kept or None.
    """

    previous: np.ndarray
    boundary: np.ndarray
    sound_speed: np.ndarray | None
    least_limiting_rate: float
    first_grid: np.ndarray | None


class BarrierRegridder:
    """Straight lines where they fit, a barrier against folding everywhere.

    `epsilon` weighs the barrier (1e-3; 1e-2 for sweeps); `method` is "newton" or "sweeps" (the
    paper's own iteration); `edge_lengths` "conditional" or "unit"; `family` "auto" (by the sides;
    if all four bend, lines of their shapes unless `curves` is false), "i" (lines j = const
    straight), "j", or the two weights; `area_weight` is lam of theory R4.1; `strengthening` is the
    largest factor of epsilon in sharp cells (30); `corner_weight` (1 or more) is how much sharp
    corners count against the place of the first line (theory R4.3); `cost_weight` is mu of theory
    R4.10, the weight of cells that limit the time step (0: none); it acts only if sound speeds are
    given; `tolerance`, `floor` (in cells) and `max_iterations` end the linear solve; `newton_steps`
    is the minimum number of Newton steps per call; in blocks of `coarse_from` cells and more (9000;
    inf: none) smooth errors are removed on coarse nodes (theory R4.13); these and all other fields
    of `Tuning` have their defaults there. `spacing` "sides" gives every edge a length between those
    of two opposite sides (theory R2.3); "given" keeps the spacing of `first_grid` (2, ni+1, nj+1)
    in both families (R4.19), without one that of the first valid grid that this regridder is given.
    The latter is the default with a first grid, except that with family "i" lines j = const keep
    its spacing along themselves alone (R4.9). `cuts` are lines that the boundary runs along twice,
    out and back, the block on both sides: a side and two of its nodes each, such as ("j_min", 0,
    80). The wake of a C grid, whose nodes are the same from both ends of a side, and a ring that is
    closed on itself are detected.
    """

    # the options that are fields of `Tuning`, and their types
    numbers: ClassVar[dict[str, str]] = {
        field.name: str(field.type) for field in fields(Tuning) if field.name in OPTIONS
    }

    def __init__(
        self,
        *,
        method: str = "newton",
        edge_lengths: str = "conditional",
        family="auto",
        spacing: str | None = None,
        first_grid: np.ndarray | None = None,
        curves: bool = True,
        cuts: Cuts = (),
        threads: int = 1,
        **numbers: Any,
    ):
        if method not in ("newton", "sweeps"):
            raise BadInput(f"barrier regridder: method '{method}' is neither 'newton' nor 'sweeps'")
        if edge_lengths not in ("conditional", "unit"):
            raise BadInput(
                f"barrier regridder: edge_lengths '{edge_lengths}' is neither 'conditional' "
                "nor 'unit'"
            )
        set_numbers = {name: value for name, value in numbers.items() if value is not None}
        self.tuning = replace(DEFAULT, **set_numbers)
        _check_tuning(self.tuning)
        self.conditional = edge_lengths == "conditional"
        if not isinstance(curves, bool):
            raise BadInput(f"barrier regridder: curves = {curves!r}; it must be true or false")
        self.family = _take_family(family)
        self.curved = curves and self.family is None
        self.spacing = _choose_spacing(spacing, first_grid is not None, self.family)
        if self.spacing != "sides" and not (method == "newton" and self.conditional):
            raise BadInput(
                'barrier regridder: a spacing that is given needs method = "newton" and '
                'edge_lengths = "conditional"'
            )
        if self.spacing == "given":
            self.tuning = replace(
                self.tuning, floor=min(self.tuning.floor, self.tuning.given_floor)
            )
        self.first_grid: np.ndarray | None = None
        self.spacing_departure: np.ndarray | None = None
        if first_grid is not None:
            self.first_grid = convert_nodes(first_grid, "first_grid").copy()
            if self.spacing == "lines":
                departure = find_spacing_departure(self.first_grid)
                if has_departures(departure):  # evenly spaced lines need no stored spacing
                    self.spacing_departure = departure
            elif not is_convex(self.first_grid):
                raise BadInput(
                    "barrier regridder: first_grid has folded cells, whose spacing cannot be kept"
                )
        self.threads = int(threads)
        self.cuts = take_cuts(cuts)
        self.meets_itself = False  # set by flows whose bodies touch themselves: nothing is checked
        self._workspaces: dict[tuple[int, int], Workspace] = {}
        self._sweeps = None
        if method == "sweeps":
            from shockgrid.regrid.barrier.sweeps import Sweeps

            self._sweeps = Sweeps(
                set_numbers.get("epsilon", 1e-2), edge_lengths=edge_lengths, family=family
            )

    works_in_place = True  # into `boundary`, whose sides are preserved bitwise

    @property
    def sees_cost(self) -> bool:
        """Whether it uses the sound speeds; the sweeps do not."""
        return self._sweeps is None and self.tuning.cost_weight > 0.0

    def regrid(
        self,
        previous: np.ndarray,
        boundary: np.ndarray,
        sound_speed: np.ndarray | None = None,
        least_limiting_rate: float = 0.0,
        in_place: bool = False,
    ) -> RegridResult:
        """The grid inside `boundary` (2, ni+1, nj+1; only its sides are read), near `previous`.

        With `sound_speed` (ni, nj) [m/s], cells that would limit the time step are widened (R4.10):
        those crossed in less than 1/R, with R the larger of this block's (`compute_limiting_rate`)
        and `least_limiting_rate` [1/s], the largest of the blocks that share the step.  `in_place`
        writes the grid into `boundary` if its layout allows, overwriting its interior anyway.
        One side, or two opposite ones, may be a point: the cells there are triangles.
        Raises RegridFailure, naming side and nodes, if there is no valid grid or none is found.
        """
        if self._sweeps is not None:
            return self._sweeps.regrid(previous, boundary)
        target = boundary
        previous, boundary = convert_grids(previous, boundary)
        into = boundary if in_place and boundary is target else None
        if sound_speed is not None:
            sound_speed = _take_sound(sound_speed, previous)
        unit = find_unit(previous)
        if unit != 1.0:  # eighth powers of lengths would not be numbers
            return self._regrid_in(unit, previous, boundary, sound_speed, least_limiting_rate, into)
        request = RegridRequest(previous, boundary, sound_speed, float(least_limiting_rate), None)
        try:
            return self._regrid_checked(request, into)
        except RegridFailure:
            points = find_points(previous), find_points(boundary)
            if points == ((), ()):
                raise
        return self._regrid_opened(request, into, *points)

    def _regrid_checked(self, request: RegridRequest, into) -> RegridResult:
        """`regrid` of checked arrays."""
        if self.spacing == "given":
            request = request._replace(first_grid=self._find_first_grid(request.previous))
        try:
            return self._move(request, into, untangles=False)
        except Folded:
            return self._untangle(request, into)
        except _NoGrid as end:
            raise explain_failure(
                request.boundary, end.trial, end.transposed, end.too_sharp, cuts=self.cuts
            ) from None

    def _regrid_opened(
        self,
        request: RegridRequest,
        into,
        points_before: tuple[str, ...],
        points_after: tuple[str, ...],
    ) -> RegridResult:
        """`regrid` of a block in which these sides are points before and after the motion."""
        boundary = request.boundary
        side = (points_after or points_before)[0]
        failure = RegridFailure("cells at this point fold", side=side)
        for fraction in OPENED_FRACTIONS if len(points_after) < 2 else FRACTIONS_OF_TWO_POINTS:
            opened = request._replace(
                previous=open_points(request.previous, points_before, fraction),
                boundary=open_points(boundary, points_after, fraction),
            )
            try:
                result = self._regrid_checked(opened, None)
            except RegridFailure as raised:
                failure = raised
                continue
            nodes = result.nodes
            exempt = close_points(nodes, boundary, points_after)
            if exempt is None:
                continue
            if into is not None:
                into[:] = nodes
                nodes = into
            report = replace(result.report, exempt_corners=exempt, quality=None)
            return RegridResult(nodes, report)
        raise failure

    def _regrid_in(
        self, unit: float, previous, boundary, sound_speed, least_limiting_rate, into
    ) -> RegridResult:
        """`regrid` with lengths measured in `unit` [m], a power of two."""
        if sound_speed is not None:
            sound_speed = sound_speed / unit
        result = self.regrid(previous / unit, boundary / unit, sound_speed, least_limiting_rate)
        nodes = result.nodes * unit
        copy_sides(boundary, nodes)  # the smallest numbers lose digits
        if into is not None:
            into[:] = nodes
            nodes = into
        return replace(result, nodes=nodes)

    def take_first_grid(self, nodes: np.ndarray) -> None:
        """Let `nodes` (2, ni+1, nj+1) be the first grid, whose spacing is kept.

        Does nothing where there is a first grid already, where no spacing is to be kept, or where
        the grid is folded.
        """
        if self.spacing == "given" and self.first_grid is None and is_convex(nodes):
            self.first_grid = nodes.copy()

    def _find_first_grid(self, previous: np.ndarray) -> np.ndarray | None:
        """The grid whose spacing is kept."""
        self.take_first_grid(previous)
        self._check_shape(previous.shape)
        return self.first_grid

    def _move(
        self, request: RegridRequest, into, untangles: bool, repairs: bool = False
    ) -> RegridResult:
        """`regrid` of checked arrays; raises `_NoGrid`, and `Folded` unless it `untangles`.

        `repairs`: the previous grid is folded.
        """
        previous, boundary, sound_speed, least_limiting_rate, first_grid = request
        # the frame of the workspace
        weights, transposed = self._weigh(boundary)
        ki, kj = (weights[1], weights[0]) if transposed else (weights[0], weights[1])
        mirrored = (compute_area(previous) < 0.0) != transposed
        work = self._workspace(previous.shape, transposed)
        work.take(previous, boundary, transposed, mirrored, sound_speed, into, first_grid)
        work.least_limiting_rate = least_limiting_rate
        move = NewtonMove(
            self.tuning, work, untangles, repairs, conditional=self.conditional, ki=float(ki),
            kj=float(kj), cost=sound_speed is not None, curved=self.curved,
        )  # fmt: skip
        # the sides neither cross nor touch, but for cuts; a block is untangled after a first try
        is_checked = self.meets_itself or untangles
        if self.cuts and not is_checked:
            is_checked = find_crossing(boundary, self.cuts) is None
        is_simple = work.side_numbers.area > 0.0 and (
            is_checked or (not self.cuts and work.is_simple)
        )
        if not (is_simple and move.try_displaced_grid()):
            if not move.estimate < np.inf:  # otherwise all nodes are finite
                if not all(np.isfinite(side).all() for side in get_sides(work.sides)):
                    raise explain_failure(boundary)
                if not np.isfinite(previous).all():
                    raise BadInput(
                        "regrid: the previous grid has nodes that are not finite numbers"
                    )
            if not is_simple:
                raise explain_failure(boundary, previous=previous, cuts=self.cuts)
            if not move.run():
                raise _NoGrid(work.trial, transposed, move.solve_failed)
        report = move.report()
        if report.quality and mirrored != transposed:  # of a clockwise grid
            report = replace(report, quality=None)
        return RegridResult(work.give(), report)

    def _weigh(self, boundary) -> tuple[Any, bool]:
        """The weights of the two families, and whether the lines i = const are the heavier one."""
        weights: Any = self.family
        if weights is None:
            weights = np.empty(2)
            fill_family_weights(boundary, weights)
        return weights, _runs_along_j(weights, boundary)

    def _untangle(self, request: RegridRequest, into) -> RegridResult:
        """`_move` as its mirror image is moved; a symmetric block stays symmetric."""
        boundary = request.boundary
        # the same orientation as the mirror image
        cell_values = [] if request.sound_speed is None else [request.sound_speed]
        transposed = self._weigh(boundary)[1]
        departure = self.spacing_departure
        orientation = choose_orientation(
            request.previous, boundary, cell_values, transposed, departure
        )
        turned = self._turn_request(request, orientation)
        if turned.first_grid is not None:
            orientation = orientation._replace(symmetries=())
        repairs = not is_convex(turned.previous)
        if repairs and turned.first_grid is not None:
            # it has the spacing that is to be kept, and no folds
            turned = turned._replace(previous=turned.first_grid)
            repairs = False
        # moved, with the departure of its lines turned as long as that takes
        work = self._workspace(turned.previous.shape, False)
        if departure is not None:
            work.keep_departure(turn_departure(orientation.turn, departure))
        try:
            result = None
            if orientation.symmetries:
                result = self._move_evenly(orientation, turned, repairs)
            result = result or self._move(turned, None, untangles=True, repairs=repairs)
        except _NoGrid as end:
            raise explain_failure(boundary, *end.turn_back(orientation), cuts=self.cuts) from None
        finally:
            if departure is not None:
                work.keep_departure(departure)
        nodes = orientation.turn_grid(result.nodes)
        copy_sides(boundary, nodes)  # zeros may have changed their sign
        if into is not None:
            into[:] = nodes
            nodes = into
        return replace(result, nodes=nodes)

    @staticmethod
    def _turn_request(request: RegridRequest, orientation: Orientation) -> RegridRequest:
        """The same request of the block as it is in an orientation."""
        previous = orientation.turn_grid(request.previous)
        boundary = previous.copy()
        copy_sides(orientation.turn_grid(request.boundary), boundary)
        sound, first_grid = request.sound_speed, request.first_grid
        return request._replace(
            previous=previous,
            boundary=boundary,
            sound_speed=None if sound is None else orientation.turn_cells(sound),
            first_grid=None if first_grid is None else orientation.turn_grid(first_grid),
        )

    def _move_evenly(
        self, orientation: Orientation, request: RegridRequest, repairs: bool
    ) -> RegridResult | None:
        """`_move` of a turned block that is symmetric up to rounding, as if it were exactly so."""
        boundary = request.boundary
        sound = request.sound_speed
        even = request._replace(
            previous=orientation.even_out(request.previous, request.previous),
            boundary=orientation.even_out(boundary, boundary),
            sound_speed=None if sound is None else orientation.even_out_cells(sound),
        )
        try:
            result = self._move(even, None, untangles=True, repairs=repairs)
        except (_NoGrid, RegridFailure):
            return None
        for nodes in (orientation.even_out(result.nodes, boundary), result.nodes):
            copy_sides(boundary, nodes)
            if is_convex(nodes):
                return replace(result, nodes=nodes)
        return None

    def compute_limiting_rate(self, boundary: np.ndarray, sound_speed: np.ndarray) -> float:
        """R [1/s] of theory R4.11: the rate implied by these sides for any interior.

        `boundary` (2, ni+1, nj+1; only its sides are read), `sound_speed` (ni, nj) [m/s].
        """
        boundary = convert_nodes(boundary, "boundary")
        sound_speed = _take_sound(sound_speed, boundary)
        work = self._workspace(boundary.shape, False)
        first_grid = self.first_grid if self.spacing == "given" else None
        mirrored = compute_area(boundary) < 0.0
        work.take(None, boundary, False, mirrored, sound_speed, first_grid=first_grid)
        work.least_limiting_rate = 0.0
        work.begin(self.conditional, 1.0, 0.0, replace(self.tuning, cost_weight=1.0), cost=True)
        return float(np.sqrt(2.0 / work.inputs.cost_scale))

    def _check_shape(self, shape: tuple[int, ...]) -> None:
        """BadInput where the first grid has another shape."""
        if self.first_grid is not None and self.first_grid.shape != shape:
            shapes = self.first_grid.shape, shape
            first_cells, block_cells = (f"{ni_1 - 1} x {nj_1 - 1}" for _, ni_1, nj_1 in shapes)
            raise BadInput(
                f"barrier regridder: the first grid has {first_cells} cells, the block "
                f"{block_cells}; both must be the same"
            )

    def _workspace(self, shape, transposed) -> Workspace:
        ni, nj = shape[1] - 1, shape[2] - 1
        key = (nj, ni) if transposed else (ni, nj)
        if key not in self._workspaces:
            threads = self.threads if ni * nj >= SERIAL_NODES else 1
            if self.spacing == "lines":
                self._check_shape(shape)
            self._workspaces[key] = Workspace(*key, threads, self.tuning, shared=True)
            if self.spacing_departure is not None:
                self._workspaces[key].keep_departure(self.spacing_departure)
        return self._workspaces[key]


def _take_sound(sound_speed, nodes: np.ndarray) -> np.ndarray:
    """The sound speeds of a grid's cells as C-contiguous float64; BadInput for another shape."""
    sound_speed = convert_numbers(sound_speed, "sound_speed")
    cells = nodes.shape[1] - 1, nodes.shape[2] - 1
    if sound_speed.shape != cells:
        raise BadInput(
            f"regrid: sound_speed has shape {sound_speed.shape}; it must be (ni, nj), here {cells}"
        )
    return sound_speed


def _check_tuning(tuning: Tuning) -> None:
    """Raise BadInput for invalid parameters of the functional."""
    for name, condition, holds in (
        ("epsilon", "positive", tuning.epsilon > 0.0),
        ("strengthening", "1 or more", tuning.strengthening >= 1.0),
        ("corner_weight", "finite and 1 or more", 1.0 <= tuning.corner_weight < np.inf),
        ("cost_weight", "finite and not negative", 0.0 <= tuning.cost_weight < np.inf),
        ("coarse_from", "a count of cells, 0 or more", tuning.coarse_from >= 0.0),
    ):
        if not holds:
            raise BadInput(f"barrier regridder: {name} {getattr(tuning, name)} must be {condition}")


def _choose_spacing(spacing: str | None, has_first_grid: bool, family) -> str:
    """`spacing`, by default "lines" with a first grid and family "i", "given" with other families,
    "sides" without a first grid; BadInput for other words."""
    if spacing is None:
        if not has_first_grid:
            return "sides"
        return "lines" if family == (1.0, 0.0) else "given"
    if spacing not in ("sides", "given"):
        raise BadInput(f"barrier regridder: spacing {spacing!r} is neither 'sides' nor 'given'")
    if spacing == "sides" and has_first_grid:
        raise BadInput(
            "barrier regridder: spacing = 'sides' keeps nothing of a first grid; leave one of them "
            "out"
        )
    return spacing


def _take_family(family) -> tuple[float, float] | None:
    """The weights of the two families, None for those that the sides imply; else BadInput."""
    if family == "auto":
        return None
    if family == "i":
        return (1.0, 0.0)
    if family == "j":
        return (0.0, 1.0)
    try:
        ki, kj = (float(k) for k in family)
    except (TypeError, ValueError):
        ki = kj = -1.0
    if ki < 0.0 or kj < 0.0 or not ki + kj > 0.0:
        raise BadInput(
            f"barrier regridder: family {family!r} must be 'auto', 'i', 'j' or two weights >= 0"
        )
    return (ki / (ki + kj), kj / (ki + kj))


def _runs_along_j(weights, boundary) -> bool:
    """Whether the lines i = const are the heavier family; at a tie, whether they are longer.

    A tie must not depend on round-off or on the naming of indices: more cells, then more length.
    """
    if abs(weights[1] - weights[0]) > EVEN_WEIGHT_DIFFERENCE:
        return bool(weights[1] > weights[0])
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    if ni != nj:
        return nj > ni
    lengths = [np.hypot(*np.diff(side, axis=1)).sum() for side in get_sides(boundary)]
    return bool(
        lengths[0] + lengths[1] > (1.0 + EVEN_WEIGHT_DIFFERENCE) * (lengths[2] + lengths[3])
    )


class _FixedFamily(BarrierRegridder):
    """Base: `BarrierRegridder` with a given `family` (theory R4), not chosen from the sides.

    A family that does not start on the deforming side leaves the first grid line far from it, as
    does an equal mixture of both.
    """

    fixed: str | tuple[float, float] = "auto"

    def __init__(
        self,
        epsilon: float | None = None,
        method: str = "newton",
        edge_lengths: str = "conditional",
        area_weight: float | None = None,
        cost_weight: float | None = None,
        threads: int = 1,
    ):
        super().__init__(
            method=method,
            edge_lengths=edge_lengths,
            family=self.fixed,
            threads=threads,
            epsilon=epsilon,
            area_weight=area_weight,
            cost_weight=cost_weight,
        )


class StraightAlongI(_FixedFamily):
    """The barrier with lines j = const straight.

    The family of the paper, kappa = 0 of theory R4.
    """

    fixed = "i"


class StraightAlongJ(_FixedFamily):
    """The barrier with lines i = const straight."""

    fixed = "j"


class StraightBothWays(_FixedFamily):
    """The barrier with both straight families at equal weights."""

    fixed = (0.5, 0.5)
