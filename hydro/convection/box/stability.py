"""Growth of small disturbances of a steady state, and the Rayleigh number at which it begins.

With the Jacobian J of `Equations` and the matrices in front of the time derivatives, growth rates
are the eigenvalues sigma of -J z = sigma diag(M, A) z.  Those nearest to a given number come from
shift-and-invert with the sparse LU that Newton's iteration uses.

The trap: the disturbance of a growth rate is not unique.  A periodic layer has two for each rate,
a roll and the same roll a quarter of a wavelength on, and any mixture of the two; a simple one has
a free sign.  Which of them an eigenvalue solver returns depends on the rounding of the machine's
linear algebra.  `filter_disturbance` therefore makes the disturbance from a fixed function.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from hydro.convection.box.equations import Equations
from hydro.convection.box.factors import Factors
from hydro.convection.box.fluid import Fluid
from regrid.errors import BadInput, RunFailure
from regrid.root_finding import find_root

WANTED = 4  # eigenvalues, of which the fastest is taken
DETUNING = 1e-3  # distance of the filter's shift from the growth rate, over the rate of free fall
REPEATS = 20  # of the filter


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

    Of the eigenvalues nearest to `near` [1/s] the one with the largest real part, and the real
    part of its disturbance, scaled to a temperature of at most 1; of several such disturbances
    that of `filter_disturbance`.  Without `near` it is the rate at which a fluid without friction
    would fall, sqrt(|b| dT / height): nothing grows faster, so the nearest real eigenvalue is the
    largest.  Raises RunFailure where the iteration finds none.
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
            operator, k=WANTED, M=mass, sigma=near, OPinv=inverse, v0=start, which="LM"
        )
    except ArpackError as error:
        words = f"convection: no growth rate was found near {near:g}: {error}"
        raise RunFailure(words, cause="no-growth-rate") from error
    # a drift between free walls has no temperature and neither grows nor decays
    sizes = [np.abs(part).max(axis=0) for part in np.split(vectors, [equations.sizes[0]])]
    warm = sizes[1] * fluid.diffusivity > 1e-6 * sizes[0] * float(np.ptp(temperature))
    best = int(np.argmax(np.where(warm, values.real, -np.inf)))
    vector = filter_disturbance(equations, operator, mass, values[best], DETUNING * scale)
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

    From rest with that temperature, REPEATS times over, with B `operator`, N `mass`,

        z <- (shift - rate) (shift N - B)^-1 N z,      shift = rate + detuning

    leaves as it is what belongs to `rate` and multiplies what belongs to another rate s by
    (shift - rate)/(shift - s).  The limit is the projection on the space of `rate` along all
    others.  It depends on no choice of vectors in that space, and rates much nearer to each other
    than `detuning` [1/s] count as one.  The function has a part of every roll, whatever its
    symmetry.  Of an oscillating disturbance it is the real part.
    """
    rate = rate if rate.imag else rate.real
    factors = Factors((operator - (rate + detuning) * mass).tocsc(), "filter of disturbances")
    x, y = (axis.centres / axis.length for axis in equations.axes)
    vector = np.concatenate([np.zeros(equations.sizes[0]), np.exp(np.add.outer(x, y)).ravel()])
    for _ in range(REPEATS):
        vector = -detuning * factors.solve(mass @ vector)
    return vector.real


def find_onset(
    equations: Equations, fluid: Fluid, low: float, high: float, tolerance: float = 1e-6
) -> float:
    """Ra at which the fluid at rest becomes unstable, bracketed between `low` and `high`.

    In the scales in which `fluid` has L = dT = 1; `tolerance` is relative to `low`.
    Raises BadInput where the growth rate has one sign at both ends.
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
    return float(find_root(growth, low, high, xtol=tolerance * low, rtol=1e-12))
