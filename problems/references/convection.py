"""References of convection: cavities, layers heated from below, vertical plates, Burgers' fronts.

STATES: the square cavity with isothermal sides and adiabatic floor and ceiling, Pr = 0.71, in the
scales L, kappa/L, dT [DeVahlDavis1983]: computed independently by a spectral method at two
resolutions, to the digits given.  (The table of 1983 has Nu max at Ra = 1e6 2.2 % too high and
ends there; at 1e7 the spectral benchmark of [LeQuere1991] has Nu = 16.523.)  Onsets: the Rayleigh
numbers at which a fluid heated from below begins to move, all walls no-slip.
"""

from dataclasses import dataclass
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext

import numpy as np

AIR_PRANDTL = 0.71


@dataclass(frozen=True)
class CavityState:
    """Steady state of the square cavity; places in units of its side."""

    nusselt: float  # mean over a side wall
    u_max: float  # greatest u on x = 1/2
    u_max_y: float
    v_max: float  # greatest v on y = 1/2
    v_max_x: float
    nusselt_max: float  # greatest local one on the hot wall
    nusselt_max_y: float


STATES: dict[float, CavityState] = {
    1e3: CavityState(1.117790, 3.649448, 0.81323, 3.697438, 0.17833, 1.506307, 0.08842),
    1e4: CavityState(2.244816, 16.18334, 0.82323, 19.62822, 0.11886, 3.531066, 0.14420),
    1e5: CavityState(4.521635, 34.74067, 0.85461, 68.63536, 0.065858, 7.72012, 0.08208),
    1e6: CavityState(8.825202, 64.8344, 0.84992, 220.5651, 0.037756, 17.5360, 0.03921),
    1e7: CavityState(16.52309, 148.5855, 0.87932, 699.330, 0.021300, 39.3947, 0.01796),
}
LAYER_ONSET = 1707.7618
LAYER_WAVENUMBER = 3.11632  # of the height
FREE_LAYER_ONSET = 657.51136  # 27 pi^4 / 4
FREE_LAYER_WAVENUMBER = 2.22144147  # pi / sqrt(2)
BOX_ONSETS = {"adiabatic": 2585.019, "conducting": 5011.71}  # square, by its sides
COLLOCATION_POINTS = 40  # of collocation; 32 give the same ten digits


def compute_layer_growth(
    rayleigh: float, prandtl: float, wavenumber: float, free: bool = False
) -> float:
    """Largest growth rate sigma [kappa/height²] of rolls of `wavenumber` [1/height].

    A disturbance w(y), theta(y) times exp(i k x + sigma t) of the fluid at rest between isothermal
    walls at y = 0 and 1, in the scales height, kappa/height, dT ([Chandrasekhar1961] II):

        sigma (D² - k²) w = Pr (D² - k²)² w - Ra Pr k² theta,       D = d/dy
        sigma theta = (D² - k²) theta + w

    with w = 0, theta = 0 and w' = 0 (no-slip) or w'' = 0 (free) on both walls.
    """
    from scipy.linalg import eig  # slow to load

    from shockgrid.problems.references.perturbed_layers import make_chebyshev  # slow to load

    n = COLLOCATION_POINTS
    _, d, _ = make_chebyshev(n + 1)
    unit = np.eye(n + 1)
    k2 = wavenumber**2
    laplacian = d @ d - k2 * unit
    none = np.zeros_like(unit)
    left = np.block(
        [[prandtl * laplacian @ laplacian, -rayleigh * prandtl * k2 * unit], [unit, laplacian]]
    )
    right = np.block([[laplacian, none], [none, unit]])
    slope = d @ d if free else d
    conditions = {0: unit[0], n: unit[n], 1: slope[0], n - 1: slope[n]}
    for row, condition in conditions.items():
        left[row], right[row] = np.concatenate([condition, np.zeros(n + 1)]), 0.0
    for row in (n + 1, 2 * n + 1):
        left[row], right[row] = np.zeros(2 * n + 2), 0.0
        left[row, row] = 1.0
    values = eig(left, right, right=False)
    values = values[np.isfinite(values) & (np.abs(values) < 1e8)]
    return float(values.real.max())


# e^Re leaves the usual range of exponents at Re = 2e6
DIGITS = Context(prec=100, Emin=MIN_EMIN, Emax=MAX_EMAX)
BESIDE = Decimal("1e-20")


@dataclass(frozen=True)
class VerticalPlates:
    """Steady flow between vertical plates; `peclet` is positive from the hot wall to the cold one.

    In the scales L, kappa/L, dT, with P the Péclet number of the through-flow and Re = P/Pr:

        T  = 1/2 - (e^(P x) - 1)/(e^P - 1)
        v'' - Re v' = -Ra (T - T0),   v(0) = v(1) = 0,   ∫ v dx = mean
        v = C1 + C2 e^(Re x) + Ra (A - T0) x/Re - Ra B e^(P x)/(P^2 - Re P),   T = A + B e^(P x)

    Without through-flow it is the cubic v = Ra/12 x (1 - x)(1 - 2 x) + 6 mean x (1 - x).  The
    formula cancels to nothing for small P and for Pr = 1, and overflows for large P.  Numbers of
    100 decimal digits do neither: P = 0 and Pr = 1 are taken 1e-20 beside.
    """

    rayleigh: float
    prandtl: float = 0.71
    peclet: float = 0.0
    mean_speed: float = 0.0

    def _constants(self) -> tuple[Decimal, ...]:
        """P, Re, A, B, C1, C2 and the factors of x and e^(P x) in v, in the current context."""
        p = Decimal(self.peclet)
        prandtl = Decimal(self.prandtl)
        ra = Decimal(self.rayleigh)
        mean = Decimal(self.mean_speed)
        if abs(p) < BESIDE:
            p = BESIDE
        if abs(prandtl - 1) < BESIDE:
            prandtl = 1 + BESIDE
        re = p / prandtl
        b = -1 / (p.exp() - 1)
        a = Decimal("0.5") - b
        shape = -ra * b / (p * p - re * p)
        grown = p.exp() - 1
        fast = re.exp() - 1
        # C1 = -C2 - shape; C2 from v(1) = 0, linear in k = Ra (A - T0): C2 = c0 + c1 k
        c0 = -shape * grown / fast
        c1 = -1 / (re * fast)
        # the mean of v is m0 + m1 k
        m0 = c0 * (fast / re - 1) + shape * (grown / p - 1)
        m1 = c1 * (fast / re - 1) + 1 / (2 * re)
        k = (mean - m0) / m1
        c2 = c0 + c1 * k
        return p, re, a, b, -c2 - shape, c2, k / re, shape

    def sample(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Temperature and velocity at `x` (any shape, from 0 to 1), as floats."""
        with localcontext(DIGITS):
            p, re, a, b, c1, c2, slope, shape = self._constants()
            pairs = []
            for position in np.ravel(x):
                here = Decimal(float(position))
                layer = (p * here).exp()
                velocity = c1 + c2 * (re * here).exp() + (slope * here + shape * layer)
                pairs.append((float(a + b * layer), float(velocity)))
        both = np.array(pairs).T.reshape(2, *np.shape(x))
        return both[0], both[1]

    def compute_nusselt(self) -> float:
        """Total flux of heat through the slot over kappa dT/L: conduction and through-flow."""
        with localcontext(DIGITS):
            p, _, a, *_ = self._constants()
            return float(p * a)


@dataclass(frozen=True)
class BurgersFronts:
    """Fronts of Burgers' equation that run and merge, exactly, by Cole and Hopf.

        phi = Σ exp(-(u_m x - b_m)/(2 nu) + u_m² t/(4 nu)),      u = -2 nu (ln phi)_x

    Between falling `levels` u_m [m/s] there are fronts of the speed (u_m + u_(m+1))/2 and a
    thickness of about 8 nu/(u_m - u_(m+1)); a faster one behind overtakes a slower one, and the two
    become one.  The b_m put the fronts at `positions` [m] at t = 0.
    """

    viscosity: float
    levels: tuple[float, ...] = (1.0, 0.0)
    positions: tuple[float, ...] = (0.2,)

    def _exponents(self, x: np.ndarray, t: float) -> np.ndarray:
        """Exponents of the terms of phi, (levels, points)."""
        levels = np.array(self.levels)
        shifts = np.append(0.0, np.cumsum(np.diff(levels) * np.array(self.positions)))
        scale = 2.0 * self.viscosity
        return (-np.outer(levels, x) + shifts[:, None] + 0.5 * t * (levels**2)[:, None]) / scale

    def compute_values(self, x: np.ndarray, t: float) -> np.ndarray:
        """u at the points x (n,)."""
        exponents = self._exponents(x, t)
        parts = np.exp(exponents - exponents.max(axis=0))
        return (np.array(self.levels)[:, None] * parts).sum(axis=0) / parts.sum(axis=0)

    def compute_cell_averages(self, nodes: np.ndarray, t: float) -> np.ndarray:
        """Means (n,) of u over the cells between `nodes` (n + 1,)."""
        exponents = self._exponents(nodes, t)
        largest = exponents.max(axis=0)
        logarithm = largest + np.log(np.exp(exponents - largest).sum(axis=0))
        return -2.0 * self.viscosity * np.diff(logarithm) / np.diff(nodes)
