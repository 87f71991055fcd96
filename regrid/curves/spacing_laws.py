"""Spacing laws: increasing sequences from 0 to 1 that say where the nodes of a line lie.

Equidistribution (ED1, theory R10.1) makes weight times step equal on all steps.  The trap: a
weight known at the old nodes only must be integrated before it is inverted, with a monotone
interpolation of the integral; interpolating the weight itself lets nodes cross.

Sources: [KhakimzyanovShokina1998] §1 (ED1), [Polevikov1983] (grids that follow a speed),
[CharakhchyanND] §1 (laws of the boundary lines).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regrid.errors import BadInput, RegridFailure
from regrid.jit import kernel
from regrid.root_finding import find_root

SETTLED = 1e-9  # relative spread of products that passes for equal
RATIO = 1.15  # of neighbouring steps where a line is refined towards one end
GROWING = 5.0  # nodes of a line over those within which steps grow by e towards the far ones


def uniform_law(count: int) -> np.ndarray:
    """`count` equidistant values from 0 to 1."""
    return np.linspace(0.0, 1.0, count)


def arc_law(line: np.ndarray) -> np.ndarray:
    """The law that the nodes of a polyline (2, n) have now, by arc length."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=1)))])
    if not arc[-1] > 0.0:
        return uniform_law(arc.size)
    law = arc / arc[-1]
    law[-1] = 1.0
    return law


def geometric_law(count: int, ratio: float) -> np.ndarray:
    """Law of `count` nodes whose steps grow by the factor `ratio` from one to the next."""
    if not ratio > 0.0:
        raise BadInput(f"spacing: the growth ratio of steps must be positive, got {ratio}")
    # Powers of the larger end are kept below 1, so that no law overflows.
    powers = np.arange(count - 1) - (count - 2 if ratio > 1.0 else 0)
    steps = np.exp(powers * np.log(ratio))
    law = np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])
    law[-1] = 1.0
    return law


def clustered_law(count: int, first: float, at_end: bool = False) -> np.ndarray:
    """Geometric law whose first step (last, if `at_end`) is the fraction `first` of the line."""
    steps = count - 1
    if not 0.0 < first < 1.0 or steps < 2:
        raise BadInput(
            f"spacing: the first step must be a fraction between 0 and 1 of a line with at least "
            f"2 steps, got {first} of {steps} steps"
        )

    def excess(log_ratio: float) -> float:
        # First step of the law, as a logarithm: monotone in the ratio, and exact near 1.
        if abs(log_ratio) < 1e-12:
            return -np.log(steps) - np.log(first)
        growth = np.log(np.expm1(abs(log_ratio)) / -np.expm1(-steps * abs(log_ratio)))
        last = growth - abs(log_ratio)
        return (growth - steps * abs(log_ratio) if log_ratio > 0.0 else last) - np.log(first)

    bound = 1.0
    while excess(bound) > 0.0 or excess(-bound) < 0.0:
        bound *= 2.0
    law = geometric_law(count, float(np.exp(find_root(excess, -bound, bound, xtol=1e-15))))
    return (1.0 - law)[::-1] if at_end else law


@kernel
def fill_grown_law(least, length, at_end, law):
    """Law (n,) of a line whose steps grow from `least` at one end, as `meeting_laws` says."""
    number = law.shape[0] - 1
    step = length / number
    q = max(0.0, 1.0 - GROWING / number)
    total = 0.0
    power = 1.0
    for _ in range(number):
        total += power
        power *= q
    far = (length - least * total) / (number - total)
    grows = step > least * (1.0 + 1e-9)
    power = 1.0
    position = 0.0
    law[number if at_end else 0] = 1.0 if at_end else 0.0
    for k in range(1, number):
        position += far - (far - least) * power if grows else step
        power *= q
        if at_end:
            law[number - k] = 1.0 - position / length
        else:
            law[k] = position / length
    law[0 if at_end else number] = 0.0 if at_end else 1.0


@kernel
def fill_refined_law(least, length, at_end, law):
    """Law (n,) of a line whose steps grow from `least` at one end by RATIO each, then are even.

    Falls back on `fill_grown_law` where even steps would be shorter, or growing ones too few.
    """
    number = law.shape[0] - 1
    total, last, even = 0.0, least, 0.0  # of the growing steps; the step that comes next
    for k in range(number):
        even = (length - total) / (number - k)
        if even <= last:
            break
        total += last
        last *= RATIO
    if even > last or even < least:
        fill_grown_law(least, length, at_end, law)
        return
    position, step = 0.0, least
    law[number if at_end else 0] = 1.0 if at_end else 0.0
    for k in range(1, number):
        position += min(step, even)
        step *= RATIO
        if at_end:
            law[number - k] = 1.0 - position / length
        else:
            law[k] = position / length
    law[0 if at_end else number] = 0.0 if at_end else 1.0


def meeting_laws(
    counts: tuple[int, int], lengths: tuple[float, float], refinement: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Laws of two lines end to end whose steps are the same where they meet.

    The line that would have the shorter steps is uniform.  On the other the step k from the
    meeting point is h (1 - (1 - h0/h) q^k): within about a fifth of its nodes the steps grow from
    the shorter line's h0 to h, and stay uniform from there.  counts: nodes of the two lines (at
    least 3); lengths: theirs.  `refinement` makes h0 so many times shorter: above 1 the steps of
    both lines grow, by the factor RATIO from one to the next.
    """
    least = min(lengths[0] / (counts[0] - 1), lengths[1] / (counts[1] - 1)) / refinement
    laws = np.empty(counts[0]), np.empty(counts[1])
    for end in (0, 1):
        if refinement > 1.0:
            fill_refined_law(least, lengths[end], end == 0, laws[end])
        else:
            fill_grown_law(least, lengths[end], end == 0, laws[end])
    return laws


def equidistribute(nodes: np.ndarray, weight: np.ndarray, count: int | None = None) -> np.ndarray:
    """New nodes between the ends of `nodes` (n,) with equal integrals of `weight` on their steps.

    `weight` is positive and given at the n nodes, or on the n - 1 steps between them (then the
    integral is inverted exactly).  The integral is interpolated monotonically.
    """
    nodes, weight = np.asarray(nodes, dtype=float), np.asarray(weight, dtype=float)
    if weight.size not in (nodes.size, nodes.size - 1) or not (weight > 0.0).all():
        raise BadInput("spacing: a weight must be positive, one value a node or one a step")
    on_steps = weight if weight.size < nodes.size else 0.5 * (weight[1:] + weight[:-1])
    integral = np.concatenate([[0.0], np.cumsum(on_steps * np.abs(np.diff(nodes)))])
    levels = integral[-1] * uniform_law(count or nodes.size)
    if weight.size < nodes.size:
        found = np.interp(levels, integral, nodes)
    else:
        from scipy.interpolate import PchipInterpolator  # slow to load

        found = PchipInterpolator(integral, nodes)(levels)
    found[0], found[-1] = nodes[0], nodes[-1]
    return found


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
    law = np.concatenate([[0.0], np.cumsum(1.0 / np.maximum(sums, floor * sums.max()))])
    found = nodes[0] + (nodes[-1] - nodes[0]) * (law / law[-1])
    found[-1] = nodes[-1]
    return found


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
    least = floor * size.max()
    return equalise_products(
        lambda left, right: np.maximum(np.abs(speed(left)) + np.abs(speed(right)), 2.0 * least),
        equidistribute(fine, np.maximum(size, least), count),
    )


def equalise_products(
    weigh: Callable[[np.ndarray, np.ndarray], np.ndarray],
    nodes: np.ndarray,
    iterations: int = 200,
    tolerance: float = 1e-14,
) -> np.ndarray:
    """Nodes between the ends of `nodes` with `weigh(x[j], x[j+1]) (x[j+1] - x[j])` equal.

    Newton's method on the products, begun from the monotone `nodes`; a step is halved while it
    would let nodes cross or the spread grow.  Raises RegridFailure where it ends above SETTLED.
    """
    x = np.array(nodes, dtype=float)
    if x.size < 3:
        return x
    count, width = x.size, x[-1] - x[0]
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
        small = 1e-6 * (right - left)
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
        if np.abs(change).max() < 1e-16 * abs(width):
            break
        x, product = trial, trial_product
    spread = np.abs(product - product.mean()).max() / abs(product.mean())
    if not spread <= SETTLED:
        worst = int(np.abs(product - product.mean()).argmax())
        raise RegridFailure(
            f"spacing: equidistribution stalled with products {spread:.1e} apart, worst on the "
            f"step from node {worst}; a smoother weight or more nodes would let it settle"
        )
    return x
