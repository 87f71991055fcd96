"""Every chosen number of the barrier regridder, in one place.

Each field names the formula it belongs to (docs/theory/regridding.md).  Guards against
round-off are not tuning parameters and are defined where they are used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class Tuning:
    """Weights, tolerances and limits of a barrier regridder; immutable."""

    # the functional
    epsilon: float = 1e-3  # R4.1: weight of the barrier
    area_weight: float = 2.0  # R4.1: lam, weight of the area term
    least_sine: float = 0.3  # R4.3: cells with a sharper corner have a stronger barrier, linearly
    strengthening: float = 30.0  # R4.3: up to this many times
    corner_weight: float = 1.0  # R4.3: of sharp corners against the first line's place
    cost_weight: float = 0.15  # R4.10: mu, weight of cells that limit the time step
    cost_margin: float = 1.05  # R4.11: of the rate implied by the sides themselves
    open_side: float = 0.5  # R4.16: chord over arc from which a side's shape counts in full,
    closed_side: float = 0.25  # R4.16: and up to which it has no effect
    curved_barrier: float = 0.1  # R4.17: epsilon where both pairs of sides bend alike,
    half_barrier: float = 0.15  # R4.17: and the ratio of their bends at which it is halved
    stiffness: float = 2.0  # R4.18: of sharp cells' corners in the matrix
    fast_sides: float = 1e-2  # R4.18: cells per step from which sides count as moving
    # the linear solve
    tolerance: float = 0.05  # R4.8: of the first residual
    floor: float = 7e-4  # R4.8: residual in cells that is accepted
    given_floor: float = 1e-4  # R4.20: the same where a spacing is given
    idle: float = 2.5  # R4.8, step 1: accepted estimate of a displaced grid, in floors
    max_iterations: int = 16  # R4.8
    exact_tolerance: float = 0.02  # R4.8, step 2, R4.14, R5.4: of solves treated as exact
    predict_iterations: int = 30  # R4.8, step 2
    # the move
    start_ratio: float = 0.5  # R4.8, step 1: of every corner that a displaced grid must keep
    step_ratio: float = 0.25  # R4.8, steps 2, 3: of every corner that a step must keep
    most_parts: int = 8  # R4.8, step 2: in which a prediction that folds is followed
    lost: float = 0.5  # R4.8, step 1: residual at the sides from which straight lines are tried
    newton_steps: int = 1  # R4.8: at least
    more_steps: int = 6  # R4.8, step 3: at most, after the first
    most_polish: int = 15  # R4.8, step 3: at most, after untangling,
    settled: float = 5e-3  # R4.8, step 3: until the residual in cells is below this
    most_settling: int = 60  # R5.4: Newton steps of a grid that no motion leads to, at most
    most_halvings: int = 6  # R4.8, step 4: of the sides' motion
    # untangling
    untangle_tolerance: float = 0.2  # R5.2: of a step's solve
    untangle_steps: int = 60  # R5.2: at most
    untangle_barrier: float = 30.0  # R5.1: times epsilon in every cell
    last_spreads: tuple[float, ...] = (0.2, 0.1, 0.05, 0.02)  # R5.2: over c, once nothing is folded
    free_steps: int = 160  # R5.4: from one start at most
    # smooth errors of large blocks
    coarse_from: float = 9000  # R4.13: cells
    coarse_lines: int = 8  # R4.13: lines i = const in a coarse cell at most, half of it at least,
    coarse_stretches: int = 16  # R4.13: with about this many coarse cells along i
    coarse_apart: tuple[int, ...] = (8, 2)  # R4.14: coarse lines j = const, level by level
    coarse_part: float = 0.6  # R4.14: fraction of the solution that is applied
    smooth_floor: float = 0.03  # R4.14: error in cells that is accepted
    smooth_part: float = 0.25  # R4.14: largest correction, over the motion of the fastest node

    def get_weights(self, epsilon: float, stiffness: float, cost: bool) -> Weights:
        """Those of the numbers that kernels of the functional take, as they are in a block.

        There the barrier may be stronger than here, and the matrix softer; without speeds of sound
        the cost has no weight.
        """
        return Weights(
            epsilon, float(self.area_weight), float(self.corner_weight * self.least_sine),
            float(self.corner_weight * self.strengthening),
            float(self.cost_weight) if cost else 0.0, stiffness,
        )  # fmt: skip


class Weights(NamedTuple):
    """The numbers of the functional, as kernels take them; each is a field of `Tuning`."""

    epsilon: float
    area_weight: float
    least_sine: float
    strengthening: float
    cost_weight: float
    stiffness: float


DEFAULT = Tuning()
# the fields that are options of the regridder by themselves, in decks too
OPTIONS = (
    "epsilon", "area_weight", "strengthening", "corner_weight", "tolerance", "floor",
    "max_iterations", "newton_steps", "cost_weight", "coarse_from",
)  # fmt: skip
