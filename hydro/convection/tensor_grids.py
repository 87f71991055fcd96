"""Adaptive grids for convection: one-dimensional axes, and tensor grids of two of them.

An axis is an increasing array of nodes.  `make_axis` returns an initial one; `correct_axis` moves
its nodes once, from the solution on it, and converges when repeated to equal weight times spacing
everywhere.  The kinds differ in the weight:

- uniform: none, the axis stays unchanged.
- clustered: nodes concentrated at one wall or both by a formula; stays unchanged.
- polevikov: the mean speed in the cell, so that all cells have the same grid Reynolds number.  Each
  correction is exactly theory R11.2; in two dimensions it uses the averages of theory R11.3.
- monitor: 1 + strength |gradient| / (mean |gradient|), theory R11.4.  If the field varies in one
  layer only, that layer receives the fraction strength / (1 + strength) of the nodes.
- combined: the mean of the node densities of polevikov and monitor, so that each of the two keeps
  its share of the nodes.

Polevikov's weight vanishes at a no-slip wall, where the thermal boundary layer is: the spacing
there is the largest in the layer, and falls only as N^-1/2.  The other kinds avoid this.

Stagnant fluid: a speed below the fraction `floor` of the largest counts as that fraction, so
spacings there are equal, finite, and at most about 1/floor times the shortest.

Note: without a bound on neighbours (`ratio` inf), corrections by a speed that is zero in half the
box oscillate for ever, because long old cells do not resolve what lies inside them.  With the bound
they converge, for smooth speeds in 10 to 40 corrections, fastest with a `relaxation` of .7.  Where
the bound starts to act, nodes jump by a fraction of a cell, because spacings then grow at a
constant ratio.

Sources: [Polevikov1983]; [KhakimzyanovShokina1998] §1; the bound on neighbours after the padding
of a weight by [KautskyNichols1980].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.spacings import correct_polevikov, solve_ed1, solve_polevikov

KINDS = ("uniform", "clustered", "polevikov", "monitor", "combined")
WALLS = ("both", "low", "high")
LEAST_SPEED_FRACTION = 0.02  # of the largest speed: lower speeds count as this
# Default bounds on the ratio of neighbouring spacings: Polevikov's grid has 1/(sqrt(2) - 1) = 2.414
# beside a wall; for very thin layers 1.5 was best with the other kinds.
RATIOS = {"polevikov": 2.5, "monitor": 1.5, "combined": 1.5}
THINNEST_SPACING = 1e-9  # of the axis: smaller spacings at a wall are lost to round-off
POINTS_PER_OLD_CELL = 8  # points per old cell in the computation of a bounded spacing

Function = Callable[[np.ndarray], np.ndarray]


def make_axis(
    kind: str,
    n: int,
    low: float = 0.0,
    high: float = 1.0,
    *,
    profile: Function | None = None,
    walls: str = "both",
    clustering: float = 2.0,
    floor: float = LEAST_SPEED_FRACTION,
) -> np.ndarray:
    """Nodes (n + 1,) [m] of an axis of `n` cells from `low` to `high`.

    clustered: `x = low + (high - low) tanh(b q) / tanh(b)` and its mirror images with b =
    `clustering` (2: the spacing at the wall is a quarter of the uniform one; 3: 3 %), clustered at
    `walls` (both, low, high).  The adaptive kinds start uniform, as Polevikov's do, unless
    `profile` is a known function: for polevikov the speed x -> |v| [m/s], for monitor the positive
    weight x -> w itself; then the axis is the converged one.  Raises BadInput.
    """
    check_kind(kind)
    if n != int(n) or n < 3:
        raise BadInput(
            f"an axis of {n} cells cannot carry a flow between two walls; take 3 or more"
        )
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise BadInput(f"an axis from {low} to {high} has no length; its ends must increase")
    if kind == "clustered":
        return make_clustered_axis(int(n), low, high, walls, clustering)
    if profile is None or kind in ("uniform", "combined"):
        return np.linspace(low, high, int(n) + 1)
    if kind == "polevikov":
        check_floor(floor)
        return solve_polevikov(profile, int(n) + 1, low, high, floor)
    return solve_ed1(profile, int(n) + 1, low, high)


def make_clustered_axis(
    n: int, low: float, high: float, walls: str = "both", clustering: float = 2.0
) -> np.ndarray:
    """Nodes (n + 1,) clustered at one or both walls by the hyperbolic tangent; see `make_axis`."""
    if walls not in WALLS:
        raise BadInput(f"walls = {walls!r}: nodes are drawn to 'both', 'low' or 'high'")
    if not 0.0 < clustering <= 20.0:
        raise BadInput(f"clustering = {clustering}: the strength must lie between 0 and 20")
    if walls == "both":
        q = np.linspace(-1.0, 1.0, n + 1)
        spacing = 0.5 * (1.0 + np.tanh(clustering * q) / np.tanh(clustering))
    else:
        q = np.linspace(0.0, 1.0, n + 1)
        spacing = np.tanh(clustering * q) / np.tanh(clustering)  # clustered at the high end
        spacing = 1.0 - spacing[::-1] if walls == "low" else spacing
    if np.diff(spacing).min() < THINNEST_SPACING:
        raise BadInput(
            f"clustering = {clustering:g} makes a step of {np.diff(spacing).min():.0e} of the axis "
            f"at the wall with {n} cells, lost in round-off; take a smaller one (2 is usual)"
        )
    x = low + (high - low) * spacing
    x[0] = low
    x[-1] = high
    return x


def correct_axis(
    kind: str,
    x: np.ndarray,
    profile: np.ndarray | tuple[np.ndarray, np.ndarray],
    *,
    floor: float = LEAST_SPEED_FRACTION,
    ratio: float | None = None,
    strength: float = 1.0,
    share: float = 0.5,
    relaxation: float = 1.0,
) -> np.ndarray:
    """Nodes (n + 1,) after one correction of the axis `x` (n + 1,) [m]; the ends are fixed.

    profile: for polevikov the speed [m/s] at the nodes (n + 1,); for monitor a field at the nodes
    (n + 1,) or the size of its gradient in the cells (n,); for combined both, (speed, field).
    Other kinds ignore it and return a copy of `x`.

    floor: lower bound on speeds, as a fraction of the largest.  ratio: bound on the ratio of
    neighbouring spacings (default: RATIOS of the kind; inf: no bound).  strength: of the gradient
    in the monitor; share: of polevikov's density in combined.  relaxation: fraction of the
    correction applied, in (0, 1].  Raises BadInput.
    """
    check_kind(kind)
    x = np.asarray(x, dtype=float)
    if x.ndim != 1 or x.size < 4 or not (np.diff(x) > 0.0).all():
        raise BadInput("an axis to correct must be 4 or more nodes that increase")
    if not 0.0 < relaxation <= 1.0:
        raise BadInput(f"relaxation = {relaxation}: the part of a correction lies in (0, 1]")
    if ratio is not None and not ratio > 1.0:  # also refuses nan
        raise BadInput(f"ratio = {ratio}: neighbouring steps may differ by a factor above 1 only")
    check_floor(floor)
    if kind in ("uniform", "clustered"):
        return x.copy()
    ratio = RATIOS[kind] if ratio is None else ratio
    if kind == "polevikov":
        placed = correct_polevikov(x, check_profile(profile, x), floor)
        if compute_neighbour_ratio(placed) > ratio:
            placed = place_nodes(x, weigh_speed(x, profile, floor), ratio)
    else:
        if not strength >= 0.0:
            raise BadInput(f"strength = {strength}: a gradient's strength cannot be negative")
        if kind == "monitor":
            weight = weigh_gradient(x, profile, strength)
        else:
            if not isinstance(profile, tuple) or len(profile) != 2:
                raise BadInput("a combined axis is corrected by two things, (speed, field)")
            if not 0.0 <= share <= 1.0:
                raise BadInput(f"share = {share}: the part of polevikov's density is in [0, 1]")
            weight = share * weigh_speed(x, profile[0], floor)
            weight += (1.0 - share) * weigh_gradient(x, profile[1], strength)
        placed = place_nodes(x, weight, ratio)
    if relaxation < 1.0:
        # The mean of two axes that satisfy the bound on neighbours satisfies it, too.
        placed = x + relaxation * (placed - x)
        placed[0] = x[0]
        placed[-1] = x[-1]
    return placed


def correct_tensor_grid(
    kind: str,
    x: np.ndarray,
    y: np.ndarray,
    u: np.ndarray,
    v: np.ndarray,
    field: np.ndarray | None = None,
    **options,
) -> tuple[np.ndarray, np.ndarray]:
    """Both axes after one correction (theory R11.2, or its equivalent for `kind`).

    x (ni + 1,), y (nj + 1,) [m]; u, v [m/s] and `field` (for monitor and combined, e.g. the
    temperature) at the nodes, shape (ni + 1, nj + 1).  options: those of `correct_axis`.
    """
    check_kind(kind)
    axes = (x, y)
    if kind in ("monitor", "combined") and field is None:
        raise BadInput(f"a {kind} grid follows the gradient of a field, and none was given")
    speeds = compute_speed_averages(x, y, u, v) if kind != "monitor" else (None, None)
    steep = compute_gradient_averages(x, y, field) if field is not None else (None, None)
    profiles = {"monitor": steep, "combined": tuple(zip(speeds, steep, strict=True))}
    chosen = profiles.get(kind, speeds)
    return tuple(correct_axis(kind, axes[k], chosen[k], **options) for k in (0, 1))


def compute_speed_averages(
    x: np.ndarray, y: np.ndarray, u: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square speeds ubar (ni + 1,) of x and vbar (nj + 1,) of y [m/s], theory R11.3.

    u, v: (ni + 1, nj + 1) at the nodes; integrals by the trapezoidal rule on the grid itself.
    """
    square = check_field(x, y, u, "u") ** 2 + check_field(x, y, v, "v") ** 2
    ubar = np.trapezoid(square, y, axis=1) / (y[-1] - y[0])
    vbar = np.trapezoid(square, x, axis=0) / (x[-1] - x[0])
    return np.sqrt(ubar), np.sqrt(vbar)


def compute_gradient_averages(
    x: np.ndarray, y: np.ndarray, field: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Root mean squares of ∂f/∂x in the cells of x (ni,) and of ∂f/∂y in those of y (nj,).

    field: (ni + 1, nj + 1) at the nodes; the mean is along the other axis, as in theory R11.3.
    """
    field = check_field(x, y, field, "field")
    by_x = (np.diff(field, axis=0) / np.diff(x)[:, None]) ** 2
    by_y = (np.diff(field, axis=1) / np.diff(y)[None, :]) ** 2
    by_x = np.trapezoid(by_x, y, axis=1) / (y[-1] - y[0])
    by_y = np.trapezoid(by_y, x, axis=0) / (x[-1] - x[0])
    return np.sqrt(by_x), np.sqrt(by_y)


def compute_grid_reynolds(x: np.ndarray, speed: np.ndarray, viscosity: float = 1.0) -> np.ndarray:
    """Grid Reynolds numbers (n,) of the cells, `(x[i] - x[i-1]) (|v[i-1]| + |v[i]|) / (2 nu)`."""
    size = np.abs(speed)
    return 0.5 * np.diff(x) * (size[1:] + size[:-1]) / viscosity


def compute_neighbour_ratio(x: np.ndarray) -> float:
    """The largest ratio of neighbouring spacings, at least 1."""
    steps = np.abs(np.diff(x))
    quotient = steps[1:] / steps[:-1]
    return float(np.maximum(quotient, 1.0 / quotient).max(initial=1.0))


def weigh_speed(x: np.ndarray, speed: np.ndarray, floor: float) -> np.ndarray:
    """Polevikov's weight in the cells (n,) with mean 1 over the axis; 1 if nothing moves."""
    size = np.abs(check_profile(speed, x))
    sums = size[1:] + size[:-1]
    if not sums.max() > 0.0:
        return np.ones(sums.size)
    weight = np.maximum(sums, floor * sums.max())
    return weight / (weight @ np.diff(x)) * (x[-1] - x[0])


def weigh_gradient(x: np.ndarray, field: np.ndarray, strength: float) -> np.ndarray:
    """The monitor in the cells (n,) with mean 1 over the axis; 1 if the field is constant.

    field: at the nodes (n + 1,), or the size of its gradient in the cells (n,).
    """
    gradient = np.asarray(field, dtype=float)
    if gradient.shape != (x.size - 1,):
        gradient = np.diff(check_profile(field, x)) / np.diff(x)
    elif not np.isfinite(gradient).all():
        raise BadInput("a grid cannot follow a gradient that is not finite")
    size = np.abs(gradient)
    mean = (size @ np.diff(x)) / (x[-1] - x[0])
    if not mean > 0.0:
        return np.ones(size.size)
    return (1.0 + strength * size / mean) / (1.0 + strength)


def place_nodes(x: np.ndarray, weight: np.ndarray, ratio: float) -> np.ndarray:
    """Nodes (n + 1,) with equal integrals of `weight` (n,), given in the cells of `x` (n + 1,).

    Where neighbours would differ by more than `ratio`, the wanted spacings h = C / weight are cut
    to the minimum of `h(x') + ln(ratio) |x - x'|` over all x', the growth of spacings with that
    ratio of neighbours; C is chosen so that n of them fit.  `bound_steps` enforces the bound on
    what remains.
    """
    n = weight.size
    free = invert_integral(x, weight, n)
    if compute_neighbour_ratio(free) <= ratio:
        return free
    fractions = np.arange(1, POINTS_PER_OLD_CELL + 1) / POINTS_PER_OLD_CELL
    fine = np.append(x[0], (x[:-1, None] + np.diff(x)[:, None] * fractions).ravel())
    widths = np.diff(fine)
    wanted = 1.0 / np.repeat(weight, POINTS_PER_OLD_CELL)
    reach = np.log(ratio) * 0.5 * (fine[1:] + fine[:-1])

    def cut(constant: float) -> np.ndarray:
        # lower envelope of cones over all cells, from the left and from the right
        steps = np.minimum.accumulate(constant * wanted - reach) + reach
        return np.minimum.accumulate((steps + reach)[::-1])[::-1] - reach

    def excess(logarithm: float) -> float:
        return float((widths / cut(np.exp(logarithm))).sum()) - n

    # Without the cut n cells fit exactly; the cut needs more, so C has to grow.
    lowest = highest = float(np.log((widths / wanted).sum() / n))
    while excess(highest) > 0.0 and highest < lowest + 60.0:
        highest += 1.0
    constant = (
        np.exp(brentq(excess, lowest, highest, xtol=1e-14)) if highest > lowest else np.exp(lowest)
    )
    return bound_steps(invert_integral(fine, 1.0 / cut(constant), n), ratio)


def invert_integral(x: np.ndarray, weight: np.ndarray, n: int) -> np.ndarray:
    """Nodes (n + 1,) at equal fractions of the integral of `weight`, monotone between old nodes."""
    integral = np.append(0.0, np.cumsum(weight * np.diff(x)))
    placed = PchipInterpolator(integral, x)(np.linspace(0.0, integral[-1], n + 1))
    placed[0] = x[0]
    placed[-1] = x[-1]
    return placed


def bound_steps(x: np.ndarray, ratio: float) -> np.ndarray:
    """Nodes whose spacings are at most `ratio` times their neighbours; larger ones are cut."""
    steps = np.diff(x)
    for order in (range(1, steps.size), range(steps.size - 2, -1, -1)):
        towards = -1 if order.step > 0 else 1
        for k in order:
            steps[k] = min(steps[k], ratio * steps[k + towards])
    spacing = np.append(0.0, np.cumsum(steps))
    placed = x[0] + (x[-1] - x[0]) * (spacing / spacing[-1])
    placed[-1] = x[-1]
    return placed


def check_kind(kind: str) -> None:
    """Raise BadInput unless `kind` is one of KINDS."""
    if kind not in KINDS:
        raise BadInput(f"there is no kind of grid {kind!r}{suggest(kind, KINDS)}")


def check_floor(floor: float) -> None:
    """Raise BadInput unless `floor` is a valid fraction of the largest speed."""
    if not 0.0 < floor < 1.0:
        raise BadInput(
            f"floor = {floor}: the least speed is a part of the largest, above 0 below 1"
        )


def check_profile(profile: np.ndarray, x: np.ndarray) -> np.ndarray:
    """`profile` as floats; BadInput unless it has one finite value per node."""
    values = np.asarray(profile, dtype=float)
    if values.shape != x.shape or not np.isfinite(values).all():
        raise BadInput(
            f"a grid of {x.size} nodes follows {x.size} finite values, got the shape {values.shape}"
            + ("" if np.isfinite(values).all() else " with values that are not finite")
        )
    return values


def check_field(x: np.ndarray, y: np.ndarray, field: np.ndarray, name: str) -> np.ndarray:
    """`field` as floats; BadInput unless its shape is that of the nodes of the tensor grid."""
    values = np.asarray(field, dtype=float)
    if values.shape != (np.size(x), np.size(y)):
        raise BadInput(
            f"{name} has the shape {values.shape}, the grid's nodes {(np.size(x), np.size(y))}"
        )
    return values
