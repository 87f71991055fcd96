"""Measurements of a convecting box: Nusselt numbers, greatest speeds, growth of disturbances.

Values between grid points come from cubic splines through the discrete solution and the wall
values.  Splines are fourth order, so they add little to the error of the solution in the positions
and values of extrema.

With the Jacobian J of `Equations` and the matrices in front of the time derivatives, growth rates
are the eigenvalues sigma of -J z = sigma diag(M, A) z.  Those nearest to a given number come from
shift-and-invert with the sparse LU that Newton's iteration uses.  Note: the disturbance of a growth
rate is not unique.  A periodic layer has two for each rate, a roll and the same roll shifted by a
quarter of a wavelength, and any linear combination of them; a simple one has an arbitrary sign.
Which of them an eigenvalue solver returns depends on the round-off of the linear algebra, so
`filter_disturbance` makes the disturbance from a fixed function.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from shockgrid.hydro.convection.box import PAIRS, Fluid, adiabatic
from shockgrid.hydro.convection.equations import Equations, Factors
from shockgrid.hydro.convection.steady import slip
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.regrid.sides import SIDE_NAMES

WANTED_EIGENVALUES = 4  # eigenvalues, of which the fastest is taken
# distance of the filter's shift from the growth rate, over the free-fall rate
FILTER_DETUNING = 1e-3
FILTER_REPEATS = 20  # of the filter
REFLECTED_POINTS = 3  # points beyond an insulated end that its mirror image adds


def compute_local_nusselt(
    equations: Equations,
    fluid: Fluid,
    temperature: np.ndarray,
    side: str,
    scale: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """(coordinates, Nusselt numbers) (cells,) along a wall: heat flux into the fluid over kappa
    times `scale` (temperature difference over distance of the walls)."""
    k = SIDE_NAMES.index(side) // 2
    cross = equations.axes[1 - k]
    heat = equations.compute_wall_heat(fluid, temperature, side)
    return cross.centres, heat / cross.widths / (fluid.diffusivity * scale)


def compute_mean_nusselt(
    equations: Equations,
    fluid: Fluid,
    temperature: np.ndarray,
    side: str,
    scale: float = 1.0,
) -> float:
    """Mean of the local Nusselt number over a wall."""
    length = equations.axes[1 - SIDE_NAMES.index(side) // 2].length
    heat = equations.compute_wall_heat(fluid, temperature, side)
    return float(heat.sum() / (fluid.diffusivity * scale * length))


def find_maximum(places: np.ndarray, values: np.ndarray, within=None) -> tuple[float, float]:
    """(value, position) of the maximum of the cubic spline through points, ends included.

    within: ((low, high), ends), the interval of inner maxima and the two points also compared.
    """
    (low, high), ends = within or ((-np.inf, np.inf), places[[0, -1]])
    spline = CubicSpline(places, values)
    roots = spline.derivative().roots(discontinuity=False, extrapolate=False)
    roots = roots[np.isfinite(roots) & (roots >= low) & (roots <= high)]
    candidates = np.concatenate([roots, ends])
    spline_values = spline(candidates)
    best = int(np.argmax(spline_values))
    return float(spline_values[best]), float(candidates[best])


def find_nusselt_maximum(
    equations: Equations,
    fluid: Fluid,
    temperature: np.ndarray,
    side: str,
    scale: float = 1.0,
) -> tuple[float, float]:
    """(value, position) of the greatest local Nusselt number on a wall.

    At an adiabatic wall the flux has zero slope along the wall: it is continued by reflection, so
    that a maximum near the corner is not cut off.
    """
    k = SIDE_NAMES.index(side) // 2
    positions, nusselt = compute_local_nusselt(equations, fluid, temperature, side, scale)
    ends = equations.axes[1 - k].nodes[[0, -1]]
    # beyond insulated ends: mirror images of the points
    insulated = (adiabatic(), adiabatic("free"))
    padding_low, padding_high = (
        REFLECTED_POINTS if equations.walls[neighbour] in insulated else 0
        for neighbour in PAIRS[1 - k]
    )
    padding = padding_low, padding_high
    padded_positions = np.pad(positions, padding, "symmetric")
    padded_nusselt = np.pad(nusselt, padding, "symmetric")
    first_beyond = padded_positions.size - padding_high
    padded_positions[:padding_low] = 2 * ends[0] - padded_positions[:padding_low]
    padded_positions[first_beyond:] = 2 * ends[1] - padded_positions[first_beyond:]
    return find_maximum(padded_positions, padded_nusselt, (ends, positions[[0, -1]]))


def extract_middle(
    equations: Equations, psi: np.ndarray, component: int
) -> tuple[np.ndarray, np.ndarray]:
    """(positions, velocities) of `component` (0: u, 1: v) along the middle line across it.

    u along x = middle, v along y = middle; at a no-slip wall the zero is among the points.
    """
    values = equations.compute_velocities(psi)[component]
    axis = equations.axes[component]
    cross = equations.axes[1 - component]
    values = values if component == 0 else values.T
    middle = 0.5 * (axis.nodes[0] + axis.nodes[-1])
    nodes = axis.nodes[: axis.node_count]
    line = CubicSpline(nodes, values, axis=0)(middle)
    places = cross.centres
    for end, side in ((0, PAIRS[1 - component][0]), (-1, PAIRS[1 - component][1])):
        if not cross.periodic and slip(equations, side) == 0.0:
            place = 0 if end == 0 else places.size
            places = np.insert(places, place, cross.nodes[end])
            line = np.insert(line, place, 0.0)
    return places, line


def find_greatest_speed(
    equations: Equations, psi: np.ndarray, component: int
) -> tuple[float, float]:
    """(value, position) of the greatest u on x = middle (0) or v on y = middle (1)."""
    return find_maximum(*extract_middle(equations, psi, component))


def measure_energy(equations: Equations, psi: np.ndarray) -> float:
    """Kinetic energy over density, integral of |u|²/2 [m4/s2]."""
    momentum = equations.momentum
    velocity = (momentum.curl @ psi) / momentum.lengths
    return float(0.5 * (velocity**2 * momentum.lengths * momentum.reaches).sum())


def solve_rest(equations: Equations, fluid: Fluid) -> tuple[np.ndarray, np.ndarray]:
    """(psi, temperature) of the fluid at rest: pure conduction."""
    still, temperature = (np.zeros(size) for size in equations.sizes)
    residual = equations.compute_residual(fluid, still, temperature)[1]
    conduction = Factors(-fluid.diffusivity * equations.heat.conduction, "matrix of conduction")
    return still, -conduction.solve(residual)


def compute_growth(
    equations: Equations,
    fluid: Fluid,
    psi: np.ndarray,
    temperature: np.ndarray,
    near: float | None = None,
) -> tuple[float, np.ndarray, np.ndarray]:
    """(growth rate [1/s], psi, temperature) of the fastest disturbance of a steady state.

    It is the eigenvalue with the largest real part among those nearest to `near` [1/s], with the
    real part of its disturbance, scaled to a maximum temperature of 1; if the disturbance is not
    unique, that of `filter_disturbance`.  The default of `near` is the free-fall rate without
    friction, sqrt(|b| dT / height): nothing grows faster, so the nearest real eigenvalue is the
    largest.  Raises RunFailure if the iteration finds none.
    """
    height = equations.axes[1].length
    fall = math.hypot(*fluid.buoyancy) * float(np.ptp(temperature)) / height
    scale = max(math.sqrt(fall), fluid.diffusivity / height**2)
    if near is None:
        near = scale
    mass = sparse.block_diag([equations.momentum.mass, sparse.diags(equations.areas)], "csc")
    operator = -equations.compute_jacobian(fluid, psi, temperature)
    factors = Factors((operator - near * mass).tocsc(), "shifted Jacobian")
    inverse = LinearOperator(operator.shape, matvec=factors.solve, dtype=np.float64)
    start = np.random.default_rng(1).standard_normal(operator.shape[0])
    try:
        values, vectors = eigs(
            operator, k=WANTED_EIGENVALUES, M=mass, sigma=near, OPinv=inverse, v0=start, which="LM"
        )
    except ArpackError as error:
        raise RunFailure(
            f"convection: no growth rate was found near {near:g}: {error}", cause="no-growth-rate"
        ) from error
    # a drift between free walls has no temperature and neither grows nor decays
    sizes = [
        np.abs(disturbances).max(axis=0) for disturbances in np.split(vectors, [equations.sizes[0]])
    ]
    warm = sizes[1] * fluid.diffusivity > 1e-6 * sizes[0] * float(np.ptp(temperature))
    best = int(np.argmax(np.where(warm, values.real, -np.inf)))
    vector = filter_disturbance(equations, operator, mass, values[best], FILTER_DETUNING * scale)
    flow, heat = np.split(vector, [equations.sizes[0]])
    size = np.abs(heat).max()
    return float(values[best].real), flow / size, heat / size


def filter_disturbance(
    equations: Equations,
    operator: sparse.spmatrix,
    mass: sparse.spmatrix,
    rate: complex,
    detuning: float,
) -> np.ndarray:
    """The disturbance (n,) of growth rate `rate` [1/s] in the temperature exp(x/width + y/height).

    From rest with that temperature, repeated FILTER_REPEATS times, with B `operator` and N `mass`,

        z <- (shift - rate) (shift N - B)^-1 N z,      shift = rate + detuning

    leaves the component of `rate` unchanged and multiplies that of another rate s by (shift -
    rate)/(shift - s).  The limit is the projection on the eigenspace of `rate` along all others.
    It does not depend on a basis of that space, and rates much closer than `detuning` [1/s] count
    as one.  The function has a component in every roll, whatever its symmetry.  For an oscillating
    disturbance the result is the real part.
    """
    rate = rate if rate.imag else rate.real
    factors = Factors((operator - (rate + detuning) * mass).tocsc(), "filter of disturbances")
    x, y = (axis.centres / axis.length for axis in equations.axes)
    vector = np.concatenate([np.zeros(equations.sizes[0]), np.exp(np.add.outer(x, y)).ravel()])
    for _ in range(FILTER_REPEATS):
        vector = -detuning * factors.solve(mass @ vector)
    return vector.real


def find_onset(
    equations: Equations, fluid: Fluid, low: float, high: float, tolerance: float = 1e-6
) -> float:
    """Ra at which the fluid at rest becomes unstable, bracketed between `low` and `high`.

    In the scales in which `fluid` has L = dT = 1; `tolerance` is relative to `low`.  Raises
    BadInput if the growth rate has the same sign at both ends.
    """
    still, conducted = solve_rest(equations, fluid)

    def growth(rayleigh: float) -> float:
        return compute_growth(equations, fluid.at_rayleigh(rayleigh), still, conducted)[0]

    ends = growth(low), growth(high)
    if not ends[0] < 0.0 < ends[1]:
        raise BadInput(
            f"the growth rate is {ends[0]:.3g} at Ra = {low:g} and {ends[1]:.3g} at {high:g}; "
            "a bracket needs a negative and a positive one"
        )
    return float(brentq(growth, low, high, xtol=tolerance * low, rtol=1e-12))
