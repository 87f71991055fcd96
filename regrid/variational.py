"""Variational grids: a weighted sum of smoothness, volume and orthogonality; node speeds.

    J = sigma Σ_cells ¼ Σ_corners [ lam_s (a² + b²)/D + ŵ s (D/c)² + lam_o (a·b)²/c² ]

are the integrals of [BrackbillSaltzman1982], `∫(|∇xi|² + |∇eta|²) dV`, `∫ w J dV` and
`∫ (∇xi·∇eta)² J³ dV` (theory R12.1, R12.2), summed over the four corner triangles of every cell.
a, b are the edges at a corner over their conditional lengths, D = a × b, and c is the mean of D.
With D in the denominator no corner can be inverted.  The Hessian is that of the barrier for the
first term and the Gauss-Newton approximation for the other two; where w D is constant, the omitted
terms cancel at inner nodes.  Note: w belongs to the cell here.  If it is a function of position, it
must be recomputed in every step, and J decreases from step to step only while w is constant.

"brackbill-saltzman" minimises J by Newton's method.  "ivanenko-charakhchyan" is its first term
alone with equal lengths: the barrier without straight lines and without conditional lengths.  The
terms are those of the map from the unit square divided by the mean cell, so that the three weights
are plain numbers.  With `edge_lengths` "conditional" the map is from the rectangle implied by the
sides, and a graded rectangle does not change; "unit" is the functional of the paper.  Note: the
volume and orthogonality terms alone have no minimum that is a grid; lam_s must be positive.  No
step removes more than three quarters of the area of a corner.

Every step starts from a valid grid: the displaced old grid, or otherwise the barrier's.  With the
displaced grid the result depends on the history unless enough iterations are made.

"node-speed": nodes that follow an evolution equation, the residual of equidistribution relaxed over
`tau` steps,

    dr/dt = d/tau,   H d = -∇J                                                    theory R13.1

J is the functional with most of its weight on the volume.  Its gradient is the residual of w times
area, regularised by smoothness, and H d = -∇J is solved so that waves of all lengths decay in the
same time.  The grid first moves with its sides and then by the fraction `1 - exp(-f/tau)` of d.  In
a flow `f` is the step over the stable step, so that a run divided into short steps has the same
node motion.  The residual of ED2 itself is not suitable, because it does not contain waves along
the diagonals of the cells (see `regrid.equidistribution.areas`), which a flow excites.

Sources: [IvanenkoCharakhchyan1988]; [AndersonTannehillPletcher1984] §10.4; [HuangRenRussell1994].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shockgrid.regrid.algebraic import displaced_grid
from shockgrid.regrid.barrier import assembly as at
from shockgrid.regrid.barrier.functional import WITHOUT_AREA_TERM, corner_terms, prepare_corners
from shockgrid.regrid.barrier.regridder import SERIAL_NODES, BarrierRegridder
from shockgrid.regrid.barrier.side_inputs import LENGTH, LENGTH_CHANGE
from shockgrid.regrid.barrier.step_control import CHUNK_SPAN, NO_LIMIT, shorten_steps
from shockgrid.regrid.barrier.tuning import Tuning
from shockgrid.regrid.barrier.workspace import Workspace
from shockgrid.regrid.equidistribution.weights import WeightedRegridder, compute_side_density
from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.jit import inlined, kernel
from shockgrid.regrid.measure.corners import BLOCK_CORNERS, find_excluded_corners, is_collapsed
from shockgrid.regrid.measure.faults import check_grids, name_cells
from shockgrid.regrid.measure.quality import compute_corner_areas
from shockgrid.regrid.protocol import RegridReport, RegridResult
from shockgrid.regrid.sides import compute_area, copy_sides

# Rows of the energy's scratch: edges along i, then along j at the near and the far row of nodes.
LINE_EDGE_X, LINE_EDGE_Y, NEAR_EDGE_X, NEAR_EDGE_Y, FAR_EDGE_X = range(5)
AREA_ROWS = at.COSECANT_1  # of the assembly's scratch, which holds D here, corner by corner


@kernel(allocates=False)
def fill_variational_corner(a_rows, b_rows, area, active, volume, smoothness, orthogonality, out):
    """Terms of one corner of a row of cells from its edges a along i and b along j.

    volume: lam_v w sigma/(4 c²) of the cells; the other two weights are numbers.  A corner that is
    not `active` has none.
    """
    for col in range(volume.shape[0]):
        ax, ay, _, inverse_a = at.take_block(a_rows, 0, col)
        bx, by, _, inverse_b = at.take_block(b_rows, 0, col)
        # smoothness: as the barrier's corner (R2.2)
        kept = active[col]
        d = kept * area[col] + (1.0 - kept)
        wx, wy = ax - by, ay + bx
        v = ((wx, wy), (wy, -wx))
        g = ((by, -bx), (-ay, ax))
        scale = kept * smoothness, inverse_a, inverse_b
        size = wx * wx + wy * wy
        terms = corner_terms(size, v, g, 1.0, 1.0 / d, 1.0, scale, WITHOUT_AREA_TERM)
        # volume (D²) and orthogonality (a·b): slopes (R12.2)
        kappa = 2.0 * kept * volume[col]
        mu = 2.0 * kept * orthogonality
        dot = ax * bx + ay * by
        kappa_d = kappa * d
        mu_dot = mu * dot
        out[at.SLOPE_AX + col] = terms.slope_ax + inverse_a * (kappa_d * by + mu_dot * bx)
        out[at.SLOPE_AY + col] = terms.slope_ay + inverse_a * (mu_dot * by - kappa_d * bx)
        out[at.SLOPE_BX + col] = terms.slope_bx + inverse_b * (mu_dot * ax - kappa_d * ay)
        out[at.SLOPE_BY + col] = terms.slope_by + inverse_b * (kappa_d * ax + mu_dot * ay)
        # and second derivatives
        hessian = terms.hessian
        kappa_aa = kappa * inverse_a * inverse_a
        mu_aa = mu * inverse_a * inverse_a
        kappa_ab = kappa * inverse_a * inverse_b
        mu_ab = mu * inverse_a * inverse_b
        kappa_bb = kappa * inverse_b * inverse_b
        mu_bb = mu * inverse_b * inverse_b
        out[at.AA_XX + col] = hessian.aa_xx + (kappa_aa * by * by + mu_aa * bx * bx)
        out[at.AA_XY + col] = hessian.aa_xy + (mu_aa - kappa_aa) * bx * by
        out[at.AA_YY + col] = hessian.aa_yy + (kappa_aa * bx * bx + mu_aa * by * by)
        out[at.BB_XX + col] = hessian.bb_xx + (kappa_bb * ay * ay + mu_bb * ax * ax)
        out[at.BB_XY + col] = hessian.bb_xy + (mu_bb - kappa_bb) * ax * ay
        out[at.BB_YY + col] = hessian.bb_yy + (kappa_bb * ax * ax + mu_bb * ay * ay)
        out[at.AB_XX + col] = hessian.ab_xx + (mu_ab * bx * ax - kappa_ab * by * ay)
        out[at.AB_XY + col] = hessian.ab_xy + (mu_ab * bx * ay + kappa_ab * by * ax)
        out[at.AB_YX + col] = hessian.ab_yx + (mu_ab * by * ax + kappa_ab * bx * ay)
        out[at.AB_YY + col] = hessian.ab_yy + (mu_ab * by * ay - kappa_ab * bx * ax)


@kernel(allocates=False)
def fill_variational_corners(i, cells, low, count, Z):
    """Terms of the four corners of `count` cells from column `low` on in row i.

    cells: as in `assemble_variational`.
    """
    _, active, smoothness, orthogonality = cells
    for col in range(count):
        areas, _ = prepare_corners(*at.take_scaled_edges(col, Z))
        for corner in range(4):
            Z[AREA_ROWS + corner * CHUNK_SPAN + col] = areas[corner]
    for corner in range(4):
        # Corners 2 and 3 take the line edge one column on, 3 and 4 the far edge.
        shift = 1 if corner == 1 or corner == 2 else 0
        side = at.FAR_X if corner >= 2 else at.NEAR_X
        term = at.CORNER_1 + corner * at.CORNER_SPAN
        area = AREA_ROWS + corner * CHUNK_SPAN
        fill_variational_corner(
            Z[at.LINE_X + shift : at.LINE_X + shift + 4 * CHUNK_SPAN],
            Z[side : side + 4 * CHUNK_SPAN],
            Z[area : area + count],
            active[corner, i, low : low + count],
            Z[at.WEIGHT : at.WEIGHT + count],
            smoothness,
            orthogonality,
            Z[term : term + at.CORNER_SPAN],
        )


@kernel
def assemble_variational(nodes, sides, cells, first, last, H, gradient, Z):
    """Fill `H` (NODE_ROW_SIZE a row of nodes) and `gradient` for node columns first..last-1.

    sides: (along_i, along_j, blend_i, blend_j) of a workspace; cells: volume (ni, nj), active
    (4, ni, nj), and the numbers smoothness and orthogonality; active corners of `nodes` must be
    positive.
    """
    along_i, along_j, blend_i, blend_j = sides
    volume = cells[0]
    ni = nodes.shape[1] - 1
    low = first - 1
    count = last - first + 1
    no_departure = np.zeros((ni + 1, nodes.shape[2]))
    no_chords = np.zeros((2, nodes.shape[2]))
    lines = at.LineInputs(along_i, along_j, blend_i, no_departure, no_chords, 0.0, 0.0)
    at.begin_columns(nodes, along_j, blend_i, blend_j, 0.0, low, count, Z)
    for i in range(ni):
        here = H[i * at.NODE_ROW_SIZE : (i + 1) * at.NODE_ROW_SIZE]
        before = H[max(i - 1, 0) * at.NODE_ROW_SIZE : (max(i - 1, 0) + 1) * at.NODE_ROW_SIZE]
        # corners of this row of cells
        at.begin_row(nodes, i, lines, low, count, Z)
        for col in range(count):
            Z[at.WEIGHT + col] = volume[i, low + col]
        fill_variational_corners(i, cells, low, count, Z)
        # gathered by cell, then by node
        at.fill_cell_blocks(count, here, Z)
        at.fill_line_blocks(count, here, Z)
        if i > 0:
            at.fill_near_blocks(count, here, Z)
            at.fill_gradient(gradient[0, i, first:last], gradient[1, i, first:last], Z)
            at.fill_own_blocks(count, here, before, Z)
        at.end_row(count, Z)


@inlined
def fill_row_of_edges(nodes, i, sides, Z):
    """Edges over their lengths: along i in row i of cells, along j in both of its rows of nodes.

    sides: (along_i, along_j, blend_i, blend_j) of a workspace.
    """
    along_i, along_j, blend_i, blend_j = sides
    x, y = nodes[0], nodes[1]
    nj = x.shape[1] - 1
    length = along_i[LENGTH, i]
    change = along_i[LENGTH_CHANGE, i]
    for j in range(nj + 1):
        inverse = 1.0 / (length + blend_j[j] * change)
        Z[LINE_EDGE_X, j] = inverse * (x[i + 1, j] - x[i, j])
        Z[LINE_EDGE_Y, j] = inverse * (y[i + 1, j] - y[i, j])
    for row in range(2):
        blend = blend_i[i + row]
        for j in range(nj):
            inverse = 1.0 / (along_j[LENGTH, j] + blend * along_j[LENGTH_CHANGE, j])
            Z[NEAR_EDGE_X + 2 * row, j] = inverse * (x[i + row, j + 1] - x[i + row, j])
            Z[NEAR_EDGE_Y + 2 * row, j] = inverse * (y[i + row, j + 1] - y[i + row, j])


@kernel(allocates=False)
def fill_variational_energy(nodes, sides, cells, energy, least, Z):
    """J and the least active D, one a row of cells, into energy (ni) and least (ni).

    sides, cells: as above.  Z is scratch (6, nj + 1).  Where a node is not a number J says so, the
    least D may not.
    """
    volume, active, smoothness, orthogonality = cells
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for i in range(ni):
        fill_row_of_edges(nodes, i, sides, Z)
        # terms of the four corners of each cell (R12.2)
        total = 0.0
        smallest = NO_LIMIT
        for corner in range(4):
            shift = 1 if corner == 1 or corner == 2 else 0
            side = FAR_EDGE_X if corner >= 2 else NEAR_EDGE_X
            for j in range(nj):
                ax, ay = Z[LINE_EDGE_X, j + shift], Z[LINE_EDGE_Y, j + shift]
                bx, by = Z[side, j], Z[side + 1, j]
                kept = active[corner, i, j]
                d = kept * (ax * by - ay * bx) + (1.0 - kept)
                dot = ax * bx + ay * by
                smooth_term = smoothness * (ax * ax + ay * ay + bx * bx + by * by) / d
                total += kept * (smooth_term + volume[i, j] * d * d + orthogonality * dot * dot)
                active_area = d if kept > 0.0 else NO_LIMIT
                smallest = smallest if smallest < active_area else active_area
        energy[i] = total
        least[i] = smallest


START_CORNER_RATIO = 0.25  # the moved grid is begun from where it keeps this much of every corner


@dataclass(frozen=True)
class ValidStart:
    """A grid (2, ni+1, nj+1) that is convex but for corner triangles left out of the functional.

    `excluded` (4, ni, nj): those, with the four of the block, which are constants; `collapsed`:
    whether there are others, on a side with nodes in one point.
    """

    nodes: np.ndarray
    report: RegridReport
    excluded: np.ndarray
    collapsed: bool


def find_valid_start(
    previous: np.ndarray,
    boundary: np.ndarray,
    barrier: BarrierRegridder,
    ratio: float = START_CORNER_RATIO,
) -> ValidStart:
    """A grid on the sides of `boundary` near `previous`: moved along, or found by `barrier`.

    The old grid plus the interpolated displacement of its sides, if that keeps more than `ratio`
    of every corner's area.  Raises RegridFailure where no valid grid is found.
    """
    # the grid moved with its sides
    old_areas = compute_corner_areas(previous)
    sign = 1.0 if old_areas.sum() >= 0.0 else -1.0
    nodes = displaced_grid(previous, boundary)
    new_areas = compute_corner_areas(nodes)
    excluded = np.zeros(new_areas.shape, dtype=bool)
    # corners that sides make flat, and the block's own, do not count
    if not ((sign * old_areas > 0.0).all() and (sign * new_areas > 0.0).all()):
        excluded = find_excluded_corners(boundary)
    collapsed = is_collapsed(excluded)
    count = int(excluded.sum())
    for corner in BLOCK_CORNERS:
        excluded[corner] = True
    old_areas[excluded] = new_areas[excluded] = sign
    # it is taken where every corner keeps enough
    valid = (sign * old_areas > 0.0).all() and (sign * new_areas > ratio * sign * old_areas).all()
    if valid and sign * compute_area(boundary) > 0.0:
        least = float((new_areas / old_areas).min())
        report = RegridReport(0, 0, 0, 0, least, 0.0, "displacement", count)
        return ValidStart(nodes, report, excluded, collapsed)
    if collapsed:
        bad_cells = np.argwhere(~(sign * new_areas > 0.0).all(axis=0))
        here = f"; here cells {name_cells(bad_cells)} do" if len(bad_cells) else ""
        raise RegridFailure(
            "a side has nodes in one point; such a block can be moved only so far at once "
            f"as no cell folds{here}"
        )
    result = barrier.regrid(previous, boundary)
    excluded = find_excluded_corners(boundary)
    for corner in BLOCK_CORNERS:
        excluded[corner] = True
    return ValidStart(result.nodes, result.report, excluded, False)


def measure_least_ratio(old: np.ndarray, new: np.ndarray, excluded: np.ndarray) -> float:
    """Least corner area of the grid `new` over that of `old`, but for corners `excluded`.

    Where all are excluded, as in a block of one cell, all count.
    """
    before = compute_corner_areas(old)
    after = compute_corner_areas(new)
    counted = ~excluded if not excluded.all() else excluded
    return float((after[counted] / before[counted]).min())


STEP_RATIO = 0.25  # a step keeps this much of every corner, node by node
FORCING_RESIDUAL = 0.05  # each linear solve goes on to this part of its first residual
MOST_SOLVES = 40  # its iterations
MOST_STEP_HALVINGS = 16
ROUND_OFF_FUNCTIONAL = 1e-13  # of the functional: the last steps change it by less
SLOW_STEP_RATIO = 0.9  # of a step to the one before, from which steps are damped more
LEAST_DAMPING = 0.1  # factor of a step


class VariationalRegridder(WeightedRegridder):
    """Grid of least `smoothness` I_s + `volume` I_v + `orthogonality` I_o on moving sides.

    `weight` (see `regrid.equidistribution.weights`; `smoothing` of what depends on fields) is that
    of I_v; `boundary`: see `regrid.equidistribution.weights`.  `steps` and `tolerance` (way
    of the fastest node in a Newton step, in cells) end the iteration.
    """

    name = "brackbill-saltzman"
    fraction = 1.0  # of a Newton step that is taken

    def __init__(
        self,
        smoothness: float = 1.0,
        volume: float = 5.0,
        orthogonality: float = 1.0,
        weight="sides",
        edge_lengths: str = "conditional",
        boundary: str = "given",
        smoothing: int = 4,
        steps: int = 5,
        tolerance: float = 1e-2,
        threads: int = 1,
    ):
        super().__init__(weight, boundary, smoothing)
        if not smoothness > 0.0 or volume < 0.0 or orthogonality < 0.0:
            raise BadInput(
                f"{self.name}: smoothness {smoothness} must be positive, volume {volume} and "
                f"orthogonality {orthogonality} must not be negative"
            )
        if edge_lengths not in ("conditional", "unit"):
            raise BadInput(
                f"{self.name}: edge_lengths '{edge_lengths}' is neither 'conditional' nor 'unit'"
            )
        self.smoothness = float(smoothness)
        self.volume = float(volume)
        self.orthogonality = float(orthogonality)
        self.conditional = edge_lengths == "conditional"
        self.steps = int(steps)
        self.tolerance = float(tolerance)
        self.barrier = BarrierRegridder(threads=threads)
        self._workspaces: dict[tuple[int, int], Workspace] = {}

    @property
    def threads(self) -> int:
        """Threads of this regridder, and of the barrier that may have to find a start."""
        return self.barrier.threads

    @threads.setter
    def threads(self, count: int) -> None:
        self.barrier.threads = int(count)

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """The grid inside `boundary` (2, ni+1, nj+1; only its sides are read), near `previous`.

        Raises RegridFailure, naming side and nodes, when no valid grid is found.
        """
        previous, boundary = check_grids(previous, boundary)
        # sides and a valid start
        given_boundary = boundary
        boundary = self.distribute_sides(previous, boundary)
        start = find_valid_start(previous, boundary, self.barrier)
        # turned so that areas are positive, then minimised
        ni, nj = previous.shape[1] - 1, previous.shape[2] - 1
        work = self._workspace(ni, nj)
        mirrored = compute_area(boundary) < 0.0
        flip = slice(None, None, -1) if mirrored else slice(None)
        work.base[:] = start.nodes[flip]
        copy_sides(boundary[flip], work.sides)
        weigh = self.weight.on(previous, given_boundary)
        iterations = 0
        residual = 0.0
        limited = 0
        if min(ni, nj) > 1:
            iterations, residual, limited = self._minimise(work, weigh, start)
        # turned back
        nodes = np.array(work.base[flip])
        report = replace(
            start.report,
            iterations=start.report.iterations + iterations,
            node_iterations=start.report.node_iterations + iterations * (ni - 1) * (nj - 1),
            least_corner_ratio=measure_least_ratio(previous, nodes, start.excluded),
            residual=residual,
            limited_nodes=limited,
            triangles=0,
            strayed=None,
        )
        return RegridResult(nodes, report)

    def _workspace(self, ni: int, nj: int) -> Workspace:
        if (ni, nj) not in self._workspaces:
            threads = self.threads if ni * nj >= SERIAL_NODES else 1
            self._workspaces[ni, nj] = Workspace(ni, nj, threads)
        return self._workspaces[ni, nj]

    def _minimise(self, work: Workspace, weigh, start: ValidStart) -> tuple[int, float, int]:
        """Newton steps from the valid `work.base`.

        Returns linear iterations, the last step in cells, and how often a node was limited.
        """
        flip = slice(None, None, -1) if compute_area(start.nodes) < 0.0 else slice(None)
        work.begin(self.conditional, 0.0, 0.0, Tuning(epsilon=1.0, area_weight=0.0))
        functional = VariationalFunctional(self, work, start)
        iterations = 0
        step = np.inf
        damping = 1.0
        cell_weight = None
        for _ in range(self.steps):
            if cell_weight is None or not self.weight.is_frozen:
                cell_weight = weigh(np.ascontiguousarray(work.base[flip]))
            functional.set_weight(cell_weight)
            iterations += functional.solve()
            last = step
            step = _measure_steps(work.base, work.change)
            if step <= self.tolerance:
                functional.descend(self.fraction)
                break
            if not self.weight.is_frozen and step > SLOW_STEP_RATIO * last:
                damping = max(0.5 * damping, LEAST_DAMPING)  # the weight moves with the grid
            if not functional.descend(damping * self.fraction):
                break
        return iterations, step, functional.limited


class IvanenkoCharakhchyanRegridder(VariationalRegridder):
    """The barrier alone: smoothness with equal edge lengths ([IvanenkoCharakhchyan1988])."""

    name = "ivanenko-charakhchyan"

    def __init__(self, steps: int = 5, tolerance: float = 1e-2, threads: int = 1):
        super().__init__(
            volume=0.0,
            orthogonality=0.0,
            edge_lengths="unit",
            steps=steps,
            tolerance=tolerance,
            threads=threads,
        )


class VariationalFunctional:
    """The functional on a workspace's grids, for one weight at a time."""

    def __init__(self, options: VariationalRegridder, work: Workspace, start: ValidStart):
        self.work = work
        self.collapsed = start.collapsed
        self.active = np.where(start.excluded, 0.0, 1.0)
        quarter = 0.25 * work.sigma
        mean = work.area_target
        self.numbers = quarter * options.smoothness, quarter * options.orthogonality / mean**2
        self.volume = quarter * options.volume / mean**2
        self.areas = np.ones((work.ni, work.nj))
        if options.conditional:
            self.areas = 1.0 / compute_side_density(work.sides)
            self.areas /= self.areas.mean()
        self.limited = 0
        self.rows = np.empty((2, work.ni))
        self.scratch = np.empty((6, work.nj + 1))

    @property
    def sides(self) -> tuple[np.ndarray, ...]:
        """What the workspace knows of the sides."""
        work = self.work
        return work.along_i, work.along_j, work.blend_i, work.blend_j

    def set_weight(self, weight: np.ndarray) -> None:
        """Take the weight (ni, nj) of the cells: w times their area is to be constant.

        D is a corner's area over that implied by the sides, hence `w (s D)²`, s the latter.
        """
        wanted = weight * self.areas
        volume = self.volume * (wanted / wanted.mean()) * self.areas
        self.cells = volume, self.active, *self.numbers

    def solve(self) -> int:
        """Fill the workspace's `change` with the Newton step from `base`; linear iterations."""
        work = self.work
        for c in range(work.columns.size - 1):
            assemble_variational(
                work.base, self.sides, self.cells, work.columns[c], work.columns[c + 1], work.H[c],
                work.gradient, work.scratch[c],
            )  # fmt: skip
        return work.solve(FORCING_RESIDUAL, 0.0, MOST_SOLVES)[0]

    def measure(self, nodes) -> float:
        """The functional's value, infinite where an active corner is not positive."""
        rows = self.rows
        fill_variational_energy(nodes, self.sides, self.cells, rows[0], rows[1], self.scratch)
        energy = float(rows[0].sum())
        return energy if np.isfinite(energy) and rows[1].min() > 0.0 else np.inf

    def descend(self, fraction: float) -> bool:
        """Take `fraction` of the step, less where corners or the energy require it."""
        work = self.work
        before = self.measure(self.work.base)
        for _ in range(MOST_STEP_HALVINGS):
            np.multiply(work.change, fraction, out=work.trial)
            work.trial += work.base
            # Corners of no area cannot be compared: there the energy alone keeps cells convex.
            kept = self.collapsed or work.compare_corners(work.trial, work.base) > STEP_RATIO
            shortened = 0
            if not kept:
                wanted = work.trial.copy()
                shorten_steps(work.base, work.trial, work.base, STEP_RATIO, work.shortening)
                shortened = int((work.trial != wanted).any(axis=0).sum())
            if self.measure(work.trial) <= before * (1.0 + ROUND_OFF_FUNCTIONAL):
                work.base[:] = work.trial
                self.limited += shortened
                return True
            fraction *= 0.5
        return False


def _measure_steps(nodes: np.ndarray, change: np.ndarray) -> float:
    """The longest way of an inner node over the shortest of its four edges."""
    squares_i = (np.diff(nodes, axis=1) ** 2).sum(axis=0)[:, 1:-1]
    squares_j = (np.diff(nodes, axis=2) ** 2).sum(axis=0)[1:-1]
    edges = np.minimum(
        np.minimum(squares_i[1:], squares_i[:-1]), np.minimum(squares_j[:, 1:], squares_j[:, :-1])
    )
    motion_squares = (change[:, 1:-1, 1:-1] ** 2).sum(axis=0)
    return float(np.sqrt((motion_squares / edges).max()))


class NodeSpeedRegridder(VariationalRegridder):
    """Nodes moved along with the sides and towards w times area constant, in about `tau` steps.

    `weight`: see `regrid.equidistribution.weights` ("sides": the density of nodes that the sides
    ask for); `smoothing`: passes over what depends on fields; `boundary`: see
    `regrid.equidistribution.weights`; `volume`: the weight of w times area against
    smoothness and orthogonality, 1 each.
    """

    name = "node-speed"
    sees_flow = True  # its steps at least

    def __init__(
        self,
        weight="sides",
        tau: float = 3.0,
        volume: float = 10.0,
        boundary: str = "given",
        smoothing: int = 4,
        threads: int = 1,
    ):
        super().__init__(
            volume=volume,
            weight=weight,
            boundary=boundary,
            smoothing=smoothing,
            steps=1,
            tolerance=0.0,
            threads=threads,
        )
        if not tau > 0.0:
            raise BadInput(f"node-speed: tau is {tau}; it must be a positive number of steps")
        self.tau = float(tau)

    @property
    def fraction(self) -> float:
        """Part of the way d that the nodes go in the step to come."""
        return float(-np.expm1(-(self.step_fraction or 1.0) / self.tau))
