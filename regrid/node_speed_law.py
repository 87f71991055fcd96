"""Nodes that follow a law of speed: the residual of equidistribution, relaxed in `tau` steps.

    dr/dt = d/tau,   (C + theta L1) C^-1 (C + theta L2) d = theta R                METHOD §5.5

R is the residual of ED2 (`regrid.equidistribution2d`), L its three-point operators: d is one
stabilising correction, with the inverse eigenvalue of the block's slowest wave for theta.  Waves of
a few cells are slower than that one; hurried too, they feed the waves that ED2 does not see (tried:
corners of half the sine).  The grid is carried by its sides and
then moves by the law, for the part `1 - exp(-pace/tau)` of d; in a flow `pace` is the step over the
stable step, so that a run cut into short steps has the same law.

Relaxed like this, ED2 goes on where its iteration stalls: the grid follows the sides sooner than
the degenerate waves grow.  The trap: like any grid that integrates a speed it depends on its way,
and around thin tongues it would fold.  It is stopped at the corners that would become sharp, node
by node, which is counted.

Source: Anderson, Tannehill & Pletcher §10.4; Khakimzyanov & Shokina §2.
"""

from __future__ import annotations

import numpy as np

from regrid.barrier import BarrierRegridder
from regrid.carrying import SIDES, carry_grid, check_grids, measure_least_ratio, stop_at_corners
from regrid.equidistribution2d import Ed2Operator, choose_taus
from regrid.errors import BadInput
from regrid.report import RegridReport, RegridResult
from regrid.weighted import WeightedRegridder


def compute_law(
    nodes: np.ndarray, weight: np.ndarray, operator: Ed2Operator | None = None
) -> tuple[np.ndarray, float]:
    """The way d (2, ni-1, nj-1) that inner nodes would go in `tau`, and the residual of ED2.

    nodes (2, ni+1, nj+1), weight (ni, nj); the residual is relative to the fluxes.
    """
    operator = operator or Ed2Operator(weight.shape)
    moved = nodes.copy()
    residual = operator.evaluate(moved, weight)
    operator.correct(moved, float(choose_taus(operator)[0]))
    return (moved - nodes)[:, 1:-1, 1:-1], residual


class NodeSpeedRegridder(WeightedRegridder):
    """Nodes carried by the sides and moved towards w times area constant, in about `tau` steps.

    `weight`: see `regrid.weights` ("sides": the density of nodes that the sides ask for);
    `smoothing`: passes over what depends on fields; `boundary`: see `regrid.weighted`.
    """

    name = "node-speed"
    sees_flow = True  # the pace at least

    def __init__(
        self,
        weight="sides",
        tau: float = 3.0,
        boundary: str = "given",
        smoothing: int = 4,
        threads: int = 1,
    ):
        super().__init__(weight, boundary, smoothing)
        if not tau > 0.0:
            raise BadInput(f"node-speed: tau is {tau}; it must be a positive number of steps")
        self.tau = float(tau)
        self.barrier = BarrierRegridder(threads=threads)
        self.threads = int(threads)

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """The grid inside `boundary` (2, ni+1, nj+1; only its sides are read), near `previous`.

        Raises RegridFailure, naming side and nodes, when no valid grid is found.
        """
        previous, boundary = check_grids(previous, boundary)
        given, boundary = boundary, self.place_sides(previous, boundary)
        carried = carry_grid(previous, boundary, self.barrier)
        nodes, residual, stopped = carried.nodes, 0.0, 0
        if min(nodes.shape[1:]) > 2:
            weight = self.weight.on(previous, given)(nodes)
            nodes, residual, stopped = self._move(carried, weight)
        for side in SIDES:
            nodes[side] = boundary[side]
        report, inner = carried.report, (nodes.shape[1] - 2) * (nodes.shape[2] - 2)
        return RegridResult(
            nodes=nodes,
            report=RegridReport(
                iterations=report.iterations + 1,
                node_iterations=report.node_iterations + inner,
                sub_moves=report.sub_moves,
                rescues=report.rescues,
                least_corner_ratio=measure_least_ratio(previous, nodes, carried.excluded),
                residual=residual,
                start=report.start,
                exempt_corners=report.exempt_corners,
                limited_nodes=stopped,
            ),
        )

    def _move(self, carried, weight) -> tuple[np.ndarray, float, int]:
        """Nodes moved by the law, stopped where corners would sharpen; residual, nodes stopped."""
        nodes = carried.nodes
        way, residual = compute_law(nodes, weight)
        trial = nodes.copy()
        trial[:, 1:-1, 1:-1] -= np.expm1(-(self.pace or 1.0) / self.tau) * way
        return trial, residual, stop_at_corners(nodes, trial, carried.excluded)
