"""Spacings: where the nodes of a line are along it, as parts of its length.

A spacing is an increasing sequence from 0 to 1.  Equidistribution (ED1, theory R10.1) makes weight
times interval equal on all intervals.  Note: a weight that is known only at the old nodes must be
integrated first, and the integral interpolated monotonically and inverted; if the weight itself is
interpolated, nodes can cross.

Sources: [KhakimzyanovShokina1998] §1 (ED1), [Polevikov1983] (grids that follow a speed).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shockgrid.regrid.errors import BadInput, RegridFailure
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.roots import find_root

SETTLED_PRODUCT_SPREAD = 1e-9  # relative spread of products that passes for equal
REFINED_STEP_RATIO = 1.15  # of neighbouring steps where a line is refined towards one end
# nodes of a line over those within which steps grow by e towards the far ones
NODES_OF_E_FOLD = 5.0
EVEN_LOG_RATIO = 1e-12  # logarithm of the ratio of steps up to which they are equal
ROUND_OFF_STEP_EXCESS = 1e-9  # by which a step must exceed the least one to be larger
DIFFERENCE_PART = 1e-6  # of a step: displacement for a difference quotient
UNCHANGED_PART = 1e-16  # of the interval: a Newton step that changes nothing


def uniform_spacing(count: int) -> np.ndarray:
    """`count` equidistant values from 0 to 1."""
    return np.linspace(0.0, 1.0, count)


def arc_spacing(line: np.ndarray) -> np.ndarray:
    """The present spacing of the nodes of a polyline (2, n), by arc length."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=1)))])
    if not arc[-1] > 0.0:
        return uniform_spacing(arc.size)
    spacing = arc / arc[-1]
    spacing[-1] = 1.0
    return spacing


def geometric_spacing(count: int, ratio: float) -> np.ndarray:
    """Spacing of `count` nodes whose steps grow by the factor `ratio` from one to the next."""
    if not ratio > 0.0:
        raise BadInput(f"spacing: the growth ratio of steps must be positive, got {ratio}")
    # Powers of the larger end are kept below 1, so that no spacing overflows.
    powers = np.arange(count - 1) - (count - 2 if ratio > 1.0 else 0)
    steps = np.exp(powers * np.log(ratio))
    spacing = np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])
    spacing[-1] = 1.0
    return spacing


def clustered_spacing(count: int, first: float, at_end: bool = False) -> np.ndarray:
    """Geometric spacing whose first step (last, if `at_end`) is `first` of the line."""
    steps = count - 1
    if not 0.0 < first < 1.0 or steps < 2:
        raise BadInput(
            f"spacing: the first step must be a fraction between 0 and 1 of a line with at least "
            f"2 steps, got {first} of {steps} steps"
        )

    def excess(log_ratio: float) -> float:
        # First step of the spacing, as a logarithm: monotone in the ratio, and exact near 1.
        if abs(log_ratio) < EVEN_LOG_RATIO:
            return -np.log(steps) - np.log(first)
        growth = np.log(np.expm1(abs(log_ratio)) / -np.expm1(-steps * abs(log_ratio)))
        log_step = growth - abs(log_ratio)
        return (growth - steps * abs(log_ratio) if log_ratio > 0.0 else log_step) - np.log(first)

    bound = 1.0
    while excess(bound) > 0.0 or excess(-bound) < 0.0:
        bound *= 2.0
    ratio = find_root(excess, -bound, bound, xtol=1e-15)
    spacing = geometric_spacing(count, float(np.exp(ratio)))
    return (1.0 - spacing)[::-1] if at_end else spacing


@kernel
def fill_grown_spacing(least, length, at_end, spacing):
    """Spacing (n,) of a line whose steps grow from `least` at one end, as in `meeting_laws`."""
    steps = spacing.shape[0] - 1
    step = length / steps
    decay = max(0.0, 1.0 - NODES_OF_E_FOLD / steps)
    sum_of_powers = 0.0
    power = 1.0
    for _ in range(steps):
        sum_of_powers += power
        power *= decay
    farthest_step = (length - least * sum_of_powers) / (steps - sum_of_powers)
    must_grow = step > least * (1.0 + ROUND_OFF_STEP_EXCESS)
    power = 1.0
    position = 0.0
    spacing[steps if at_end else 0] = 1.0 if at_end else 0.0
    for k in range(1, steps):
        position += farthest_step - (farthest_step - least) * power if must_grow else step
        power *= decay
        if at_end:
            spacing[steps - k] = 1.0 - position / length
        else:
            spacing[k] = position / length
    spacing[0 if at_end else steps] = 0.0 if at_end else 1.0


@kernel
def fill_refined_spacing(least, length, at_end, spacing):
    """Spacing (n,) of a line whose steps grow from `least` at one end, then are even.

    Each growing step is REFINED_STEP_RATIO times as long as the one before.
    Falls back on `fill_grown_spacing` where even steps would be shorter, or growing ones too few.
    """
    steps = spacing.shape[0] - 1
    # length of the growing steps, the next one of them, and what would be left for even ones
    grown_length = 0.0
    growing_step = least
    even_step = 0.0
    for k in range(steps):
        even_step = (length - grown_length) / (steps - k)
        if even_step <= growing_step:
            break
        grown_length += growing_step
        growing_step *= REFINED_STEP_RATIO
    if even_step > growing_step or even_step < least:
        fill_grown_spacing(least, length, at_end, spacing)
        return
    position = 0.0
    step = least
    spacing[steps if at_end else 0] = 1.0 if at_end else 0.0
    for k in range(1, steps):
        position += min(step, even_step)
        step *= REFINED_STEP_RATIO
        if at_end:
            spacing[steps - k] = 1.0 - position / length
        else:
            spacing[k] = position / length
    spacing[0 if at_end else steps] = 0.0 if at_end else 1.0


def meeting_laws(
    counts: tuple[int, int], lengths: tuple[float, float], refinement: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Spacings of two lines end to end whose steps are the same where they meet.

    The line that would have the shorter steps is uniform.  On the other the step k from the
    meeting point is h (1 - (1 - h0/h) q^k): within about a fifth of its nodes the steps grow from
    the shorter line's h0 to h, and stay uniform from there.  counts: nodes of the two lines (at
    least 3); lengths: theirs.  `refinement` makes h0 so many times shorter: above 1 the steps of
    both lines grow, by the factor REFINED_STEP_RATIO from one to the next.
    """
    least = min(lengths[0] / (counts[0] - 1), lengths[1] / (counts[1] - 1)) / refinement
    spacings = np.empty(counts[0]), np.empty(counts[1])
    for end in (0, 1):
        if refinement > 1.0:
            fill_refined_spacing(least, lengths[end], end == 0, spacings[end])
        else:
            fill_grown_spacing(least, lengths[end], end == 0, spacings[end])
    return spacings


def equidistribute(nodes: np.ndarray, weight: np.ndarray, count: int | None = None) -> np.ndarray:
    """New nodes between the ends of `nodes` (n,) with equal integrals of `weight` on their steps.

    `weight` is positive and given at the n nodes, or on the n - 1 steps between them (then the
    integral is inverted exactly).  The integral is interpolated monotonically.
    """
    nodes = np.asarray(nodes, dtype=float)
    weight = np.asarray(weight, dtype=float)
    if weight.size not in (nodes.size, nodes.size - 1) or not (weight > 0.0).all():
        raise BadInput("spacing: a weight must be positive, one value a node or one a step")
    on_steps = weight if weight.size < nodes.size else 0.5 * (weight[1:] + weight[:-1])
    integral = np.concatenate([[0.0], np.cumsum(on_steps * np.abs(np.diff(nodes)))])
    levels = integral[-1] * uniform_spacing(count or nodes.size)
    if weight.size < nodes.size:
        new_nodes = np.interp(levels, integral, nodes)
    else:
        from scipy.interpolate import PchipInterpolator  # slow to load

        new_nodes = PchipInterpolator(integral, nodes)(levels)
    new_nodes[0] = nodes[0]
    new_nodes[-1] = nodes[-1]
    return new_nodes


def solve_ed1(
    weight: Callable[[np.ndarray], np.ndarray],
    count: int,
    start: float = 0.0,
    end: float = 1.0,
    iterations: int = 200,
    tolerance: float = 1e-14,
) -> np.ndarray:
    """Nodes x with `w[j+1/2] (x[j+1] - x[j])` equal on all steps, w taken at the steps' middles.

    [KhakimzyanovShokina1998] (1.6), theory R10.1.  Raises RegridFailure where no such nodes are
    found (a weight that jumps).
    """
    fine = np.linspace(start, end, 20 * count)
    return equalise_products(
        lambda left, right: weight(0.5 * (left + right)),
        equidistribute(fine, weight(fine), count),
        iterations,
        tolerance,
    )


def correct_polevikov(nodes: np.ndarray, speed: np.ndarray, floor: float = 1e-6) -> np.ndarray:
    """One correction (theory R11.2): steps in proportion to `1 / (|v[i-1]| + |v[i]|)`, ends fixed.

    `speed` is v at the n `nodes`; a convection solver finds it again on the new ones.  A sum below
    the part `floor` of the largest counts as that part, so that stagnant fluid has equal steps.
    """
    nodes = np.asarray(nodes, dtype=float)
    size = np.abs(np.asarray(speed, dtype=float))
    if size.shape != nodes.shape or not np.isfinite(size).all():
        raise BadInput("spacing: a speed must be finite, one value a node")
    sums = size[1:] + size[:-1]
    if not sums.max() > 0.0:
        return np.linspace(nodes[0], nodes[-1], nodes.size)
    spacing = np.concatenate([[0.0], np.cumsum(1.0 / np.maximum(sums, floor * sums.max()))])
    new_nodes = nodes[0] + (nodes[-1] - nodes[0]) * (spacing / spacing[-1])
    new_nodes[-1] = nodes[-1]
    return new_nodes


def solve_polevikov(
    speed: Callable[[np.ndarray], np.ndarray],
    count: int,
    start: float = 0.0,
    end: float = 1.0,
    floor: float = 1e-6,
) -> np.ndarray:
    """Nodes with `(|v[i-1]| + |v[i]|) (x[i] - x[i-1])` equal on all steps (theory R11.1).

    The limit of `correct_polevikov` for a speed known everywhere, found by Newton's method; sums
    below the part `floor` of twice the largest speed count as that part.
    """
    fine = np.linspace(start, end, 20 * count)
    size = np.abs(speed(fine))
    if not size.max() > 0.0:
        return np.linspace(start, end, count)
    least_speed = floor * size.max()
    return equalise_products(
        lambda left, right: np.maximum(
            np.abs(speed(left)) + np.abs(speed(right)), 2.0 * least_speed
        ),
        equidistribute(fine, np.maximum(size, least_speed), count),
    )


def equalise_products(
    weigh: Callable[[np.ndarray, np.ndarray], np.ndarray],
    nodes: np.ndarray,
    iterations: int = 200,
    tolerance: float = 1e-14,
) -> np.ndarray:
    """Nodes between the ends of `nodes` with `weigh(x[j], x[j+1]) (x[j+1] - x[j])` equal.

    Newton's method on the products, begun from the monotone `nodes`; a step is halved while it
    would let nodes cross or the spread grow.  Raises RegridFailure where it ends above
    SETTLED_PRODUCT_SPREAD.
    """
    x = np.array(nodes, dtype=float)
    if x.size < 3:
        return x
    count = x.size
    width = x[-1] - x[0]
    # Unknown are the inner nodes and the common product: the last column of the matrix.
    matrix = np.zeros((count - 1, count - 1))
    rows = np.arange(count - 2)

    def products(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        return weigh(left, right) * (right - left)

    product = products(x[:-1], x[1:])
    for _ in range(iterations):
        mean = product.mean()
        spread = np.abs(product - mean).max()
        if spread <= tolerance * abs(mean):
            break
        left, right = x[:-1], x[1:]
        small = DIFFERENCE_PART * (right - left)
        by_left = (products(left + small, right) - products(left - small, right)) / (2.0 * small)
        by_right = (products(left, right + small) - products(left, right - small)) / (2.0 * small)
        matrix[:] = 0.0
        matrix[rows, rows] = by_right[:-1]
        matrix[rows + 1, rows] = by_left[1:]
        matrix[:, -1] = -1.0
        change = np.linalg.solve(matrix, mean - product)[:-1]
        for _ in range(40):
            trial = x.copy()
            trial[1:-1] += change
            trial_product = products(trial[:-1], trial[1:])
            ordered = (np.diff(trial) * width > 0.0).all()
            if ordered and np.abs(trial_product - trial_product.mean()).max() < spread:
                break
            change *= 0.5
        else:
            break
        if np.abs(change).max() < UNCHANGED_PART * abs(width):
            break
        x = trial
        product = trial_product
    spread = np.abs(product - product.mean()).max() / abs(product.mean())
    if not spread <= SETTLED_PRODUCT_SPREAD:
        worst = int(np.abs(product - product.mean()).argmax())
        raise RegridFailure(
            f"spacing: equidistribution stalled with products {spread:.1e} apart, worst on the "
            f"step from node {worst}; a smoother weight or more nodes would let it settle"
        )
    return x
