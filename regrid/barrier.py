"""The barrier regridder: one Newton step a time step, on a functional with a barrier.

`regrid(previous, boundary)` carries a valid grid to new boundary nodes (METHOD §1.6):

    1 laws, lengths, family weights from the new boundary   4 corner areas against the old ones
    2 boundary displacement carried inside                   5 shorten, untangle, or halve the move
    3 gradient, Hessian, one linear solve

The promise: every grid handed back is convex, or RegridFailure names side and nodes.  The trap:
the result may depend on `previous` and `boundary` only, never on earlier calls.
"""

from __future__ import annotations

import numpy as np

from regrid.boundary_check import explain_failure
from regrid.corner_steps import shorten_steps
from regrid.errors import BadInput, RegridFailure
from regrid.families import compute_area, fill_family_weights
from regrid.report import RegridReport, RegridResult
from regrid.transfinite import fill_displacement
from regrid.untangle import untangle
from regrid.workspace import Workspace

LEAST_RATIO = 0.1  # a corner area may not fall below this part of its old value in one step
START_RATIO = 0.3  # the moved grid is where the step begins when no corner shrank below this
MOST_HALVINGS = 6  # the boundary's motion is cut into no more than 2**6 parts
SERIAL_NODES = 6400  # smaller blocks stay on one thread


class BarrierRegridder:
    """Straight lines where they fit, a barrier against folding everywhere.

    `epsilon` weighs the barrier; `method` is "newton" or "sweeps" (the paper's own iteration);
    `edge_lengths` "conditional" or "unit"; `family` "auto", "i" (lines j = const straight), "j",
    or the two weights; `area_weight` is lam of METHOD §1.6; `tolerance`, `floor` and
    `max_iterations` end the linear solve; `newton_steps` is the number of Newton steps a call.
    """

    def __init__(
        self,
        epsilon: float = 1e-3,
        method: str = "newton",
        edge_lengths: str = "conditional",
        family="auto",
        area_weight: float = 2.0,
        tolerance: float = 0.05,
        floor: float = 1e-3,
        max_iterations: int = 16,
        newton_steps: int = 1,
        threads: int = 1,
    ):
        if method not in ("newton", "sweeps"):
            raise BadInput(f"barrier regridder: method '{method}' is neither 'newton' nor 'sweeps'")
        if edge_lengths not in ("conditional", "unit"):
            raise BadInput(
                f"barrier regridder: edge_lengths '{edge_lengths}' is neither 'conditional' "
                "nor 'unit'"
            )
        if not epsilon > 0.0:
            raise BadInput(f"barrier regridder: epsilon {epsilon} must be positive")
        self.epsilon, self.area_weight = float(epsilon), float(area_weight)
        self.conditional = edge_lengths == "conditional"
        self.family = _family_weights(family)
        self.tolerance, self.floor = float(tolerance), float(floor)
        self.max_iterations, self.newton_steps = int(max_iterations), int(newton_steps)
        self.threads = int(threads)
        self._workspaces: dict[tuple[int, int], Workspace] = {}
        self._sweeps = None
        if method == "sweeps":
            from regrid.sweeps import Sweeps

            self._sweeps = Sweeps(epsilon=epsilon, edge_lengths=edge_lengths, family=family)

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """The grid inside `boundary` (2, ni+1, nj+1; only its sides are read), near `previous`.

        Raises RegridFailure, naming side and nodes, when there is no valid grid or none is found.
        """
        if self._sweeps is not None:
            return self._sweeps.regrid(previous, boundary)
        _check_shapes(previous, boundary)
        weights = np.empty(2)
        if self.family is None:
            fill_family_weights(boundary, weights)
        else:
            weights[:] = self.family
        transposed = weights[1] > weights[0]
        ki, kj = (weights[1], weights[0]) if transposed else (weights[0], weights[1])
        mirrored = (compute_area(previous) < 0.0) != transposed
        work = self._workspace(previous.shape, transposed)
        _load(previous, work.old, transposed, mirrored, inside=True)
        _load(boundary, work.sides, transposed, mirrored, inside=False)
        if not all(np.isfinite(side).all() for side in _sides(work.sides)):
            raise RegridFailure(explain_failure(boundary))
        if not np.isfinite(work.old).all():
            raise BadInput("regrid: the previous grid has nodes that are not finite numbers")
        move = _Move(self, work, float(ki), float(kj))
        if not (compute_area(work.sides) > 0.0 and move.run()):
            raise RegridFailure(explain_failure(boundary, work.trial, transposed))
        nodes = np.empty(previous.shape)
        source = work.trial[::-1] if mirrored else work.trial
        nodes[:] = source.transpose(0, 2, 1) if transposed else source
        return RegridResult(nodes, move.report())

    def _workspace(self, shape, transposed) -> Workspace:
        ni, nj = shape[1] - 1, shape[2] - 1
        key = (nj, ni) if transposed else (ni, nj)
        if key not in self._workspaces:
            threads = self.threads if ni * nj >= SERIAL_NODES else 1
            self._workspaces[key] = Workspace(*key, threads)
        return self._workspaces[key]


class _Move:
    """One regrid in the workspace's frame: from `work.old` to `work.sides`, into `work.trial`."""

    def __init__(self, options: BarrierRegridder, work: Workspace, ki: float, kj: float):
        self.options, self.work, self.ki, self.kj = options, work, ki, kj
        self.iterations = self.rescues = self.sub_moves = 0
        self.residual = 0.0
        self.ratio = np.inf
        self.start = "displacement"
        sides = work.sides
        self.exempt = sum(
            _corner_area(sides, i, j) <= 0.0 for i in (0, work.ni) for j in (0, work.nj)
        )

    def report(self) -> RegridReport:
        inner = (self.work.ni - 1) * (self.work.nj - 1)
        return RegridReport(
            iterations=self.iterations,
            node_iterations=self.iterations * inner,
            sub_moves=self.sub_moves,
            rescues=self.rescues,
            least_corner_ratio=self.ratio,
            residual=self.residual,
            start=self.start,
            exempt_corners=self.exempt,
        )

    def run(self) -> bool:
        """Go the whole way, in halves if need be; True when `work.trial` is valid."""
        work = self.work
        if self._advance():
            return True
        begin, end = work.old.copy(), work.sides.copy()
        for halving in range(1, MOST_HALVINGS + 1):
            parts = 2**halving
            work.old[:] = begin
            self.ratio = np.inf
            for part in range(1, parts + 1):
                t = part / parts
                for now, then, there in zip(
                    _sides(work.sides), _sides(begin), _sides(end), strict=True
                ):
                    now[:] = there if part == parts else then + t * (there - then)
                if not self._advance():
                    break
                work.old[:] = work.trial
            else:
                self.sub_moves = parts - 1
                self.start = "halved"
                return True
        return False

    def _advance(self) -> bool:
        """One part of the motion, from `work.old` to `work.sides`; True when `work.trial` is valid."""
        work, options = self.work, self.options
        work.begin(
            options.conditional, self.ki, self.kj, options.epsilon, options.area_weight
        )
        fill_displacement(work.old, work.sides, work.displacement)
        np.add(work.old, work.displacement, out=work.base)
        for moved, side in zip(_sides(work.base), _sides(work.sides), strict=True):
            moved[:] = side
        if work.ni == 1 or work.nj == 1:
            work.trial[:] = work.base
            return self._accept(work.compare_corners(work.trial, work.old), 0.0)
        moved_ratio, moved_area = work.compare_corners(work.base, work.old)
        if not moved_area > 0.0:
            moved_ratio = -1.0
        if moved_ratio > START_RATIO:
            for _ in range(options.newton_steps):
                self._newton(work.base)
                np.add(work.base, work.change, out=work.trial)
                if not self._hold(work.base, LEAST_RATIO):
                    return False
                work.base[:] = work.trial
            return True
        work.assemble(work.old)
        self._solve(work.displacement)
        np.add(work.old, work.change, out=work.trial)
        for moved, side in zip(_sides(work.trial), _sides(work.sides), strict=True):
            moved[:] = side
        if self._accept(work.compare_corners(work.trial, work.old), LEAST_RATIO):
            return True
        if moved_ratio > LEAST_RATIO:
            return self._hold(work.base, LEAST_RATIO)
        return self._rescue()

    def _newton(self, base) -> None:
        self.work.assemble(base)
        self._solve(None)

    def _solve(self, guess) -> None:
        work, options = self.work, self.options
        inner = (work.ni - 1) * (work.nj - 1)
        floor = options.floor**2 * work.sigma * inner
        done, first, _ = work.solve(options.tolerance, floor, options.max_iterations, guess)
        self.iterations += done
        self.residual = max(self.residual, float(np.sqrt(max(first, 0.0) / (work.sigma * inner))))

    def _accept(self, measured, least_ratio: float) -> bool:
        ratio, area = measured
        if ratio > least_ratio and area > 0.0:
            self.ratio = min(self.ratio, ratio)
            return True
        return False

    def _hold(self, base, least_ratio: float) -> bool:
        """Keep `work.trial` valid by shortening the steps from the valid `base` node by node."""
        work = self.work
        if self._accept(work.compare_corners(work.trial, work.old), least_ratio):
            return True
        shorten_steps(base, work.trial, work.old, least_ratio, work.z)
        work.z[:] = 0.0
        return self._accept(work.compare_corners(work.trial, work.old), least_ratio)

    def _rescue(self) -> bool:
        """Untangle from the better of the moved grid and the trial, then take ordinary steps."""
        work = self.work
        self.rescues += 1
        self.start = "untangled"
        worst = work.compute_energy(work.trial, 1.0)[1]
        if work.compute_energy(work.base, 1.0)[1] < worst:
            work.base[:] = work.trial
        if not untangle(work, work.base):
            return False
        for _ in range(2):
            self._newton(work.base)
            np.add(work.base, work.change, out=work.trial)
            ratio, area = work.compare_corners(work.trial, work.base)
            if not (ratio > LEAST_RATIO and area > 0.0):
                shorten_steps(work.base, work.trial, work.base, LEAST_RATIO, work.z)
                work.z[:] = 0.0
            work.base[:] = work.trial
        return self._accept(work.compare_corners(work.trial, work.old), 0.0)


def _family_weights(family):
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


def _check_shapes(previous, boundary) -> None:
    for name, nodes in (("previous", previous), ("boundary", boundary)):
        if nodes.ndim != 3 or nodes.shape[0] != 2 or min(nodes.shape[1:]) < 2:
            raise BadInput(
                f"regrid: {name} has shape {nodes.shape}; it must be (2, ni+1, nj+1), ni, nj >= 1"
            )
        if nodes.dtype != np.float64 or not nodes.flags.c_contiguous:
            raise BadInput(f"regrid: {name} must be a C-contiguous array of float64")
    if previous.shape != boundary.shape:
        raise BadInput(
            f"regrid: previous has shape {previous.shape}, boundary {boundary.shape}; they must agree"
        )


def _sides(nodes):
    """Views of the four sides i_min, i_max, j_min, j_max."""
    return nodes[:, 0], nodes[:, -1], nodes[:, :, 0], nodes[:, :, -1]


def _load(nodes, out, transposed: bool, mirrored: bool, inside: bool) -> None:
    """Copy a grid, or only its sides, into the workspace's frame."""
    view = nodes.transpose(0, 2, 1) if transposed else nodes
    view = view[::-1] if mirrored else view
    if inside:
        out[:] = view
    else:
        for target, source in zip(_sides(out), _sides(view), strict=True):
            target[:] = source


def _corner_area(nodes, i: int, j: int) -> float:
    """Doubled area of the triangle at a block corner, positive when convex."""
    di, dj = (1 if i == 0 else -1), (1 if j == 0 else -1)
    a, b = nodes[:, i + di, j] - nodes[:, i, j], nodes[:, i, j + dj] - nodes[:, i, j]
    return float(di * dj * (a[0] * b[1] - a[1] * b[0]))
