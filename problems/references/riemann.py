"""Exact solution of the Riemann problem between two materials with two equations of state.

On each side of the contact a shock or a rarefaction leads from the given state to the common
pressure p* [Toro, chapter 4, with the general isentropes and Hugoniots of this package].  The
function `u(p)` falls on the left and rises on the right, so p* is found by bracketing.
Note: where the materials pull apart there may be no p*; gases then leave a vacuum, condensed
materials go into tension unless a cavitation pressure is given, at which they part.
"""

import math
from dataclasses import dataclass

import numpy as np

from shockgrid.problems.references.hugoniot import (
    RELATIVE_ROUND_OFF,
    make_isentrope,
    shock_to_pressure,
)
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.roots import find_root

GAUSS_POINTS = 8
MOST_HALVINGS = 60  # of the higher given pressure, to find one below the common pressure


@dataclass(frozen=True)
class Wave:
    """A side of the solution: `head` and `tail` are speeds x/t (equal for a shock)."""

    kind: str
    head: float
    tail: float


class _Side:
    """One given state and the curves through it; `sign` is -1 on the left, +1 on the right."""

    def __init__(self, eos, state, sign: int):
        self.eos = eos
        self.sign = sign
        self.rho, self.u, self.p = (float(value) for value in state)
        where = "left" if sign < 0 else "right"
        if not self.rho > 0.0:
            raise BadInput(f"riemann problem: the {where} density is {self.rho:g}; give one > 0")
        self.isentrope = make_isentrope(eos, self.rho, self.p)
        if not math.isfinite(self.isentrope.c) or self.isentrope.c <= 0.0:
            raise BadInput(
                f"riemann problem: the {where} "
                f"state rho = {self.rho:g}, p = {self.p:g} has no sound speed"
                " in its equation of state"
            )

    def velocity(self, p: float) -> float:
        """Velocity behind the wave that leads to pressure p."""
        if p > self.p:
            gain = shock_to_pressure(self.eos, self.rho, self.p, p).particle_speed
        else:
            gain = -float(self.isentrope.velocity_gain(p))
        return self.u + self.sign * gain

    def reach(self, p: float) -> tuple[float, Wave]:
        """Density behind the wave that leads to pressure p, and the wave."""
        if p > self.p:
            shock = shock_to_pressure(self.eos, self.rho, self.p, p)
            front = self.u + self.sign * shock.shock_speed
            return shock.rho, Wave("shock", front, front)
        tail = self.velocity(p) + self.sign * float(self.isentrope.sound_speed(p))
        head = self.u + self.sign * self.isentrope.c
        return float(self.isentrope.density(p)), Wave("rarefaction", head, tail)


@dataclass(frozen=True)
class RiemannSolution:
    """Star states and wave speeds of a Riemann problem.

    `rho_left`, `rho_right` are the star densities beside the contact.  With a gap (vacuum or
    cavitation) `p` is the pressure in it and `u_left` < `u_right` its edges, else they are equal.
    """

    p: float
    u_left: float
    u_right: float
    rho_left: float
    rho_right: float
    left_wave: Wave
    right_wave: Wave
    gap: bool
    _sides: tuple

    @property
    def u(self) -> float:
        """Speed of the contact (the mean of the edges of a gap)."""
        return 0.5 * (self.u_left + self.u_right)

    def get_speeds(self) -> np.ndarray:
        """Speeds x/t where the profile has a jump or a kink, ascending."""
        left, right = self.left_wave, self.right_wave
        speeds = [left.head, left.tail, self.u_left, self.u_right, right.tail, right.head]
        return np.unique(np.array(speeds))

    def sample(self, x_over_t):
        """rho, u, p at the similarity coordinates `x_over_t` (any shape), each of that shape.

        In a gap rho is 0, u is x/t and p the pressure there.
        """
        position = np.asarray(x_over_t, dtype=float)
        rho, u, p = (np.empty(position.shape) for _ in range(3))
        gap = (position >= self.u_left) & (position <= self.u_right)
        rho[gap] = 0.0
        u[gap] = position[gap]
        p[gap] = self.p
        stars = ((self.rho_left, self.u_left), (self.rho_right, self.u_right))
        waves = (self.left_wave, self.right_wave)
        for side, wave, (rho_star, u_star) in zip(self._sides, waves, stars, strict=True):
            sign = side.sign
            outward = sign * position
            inside = outward > sign * u_star if self.gap else sign * (position - self.u) >= 0.0
            if not self.gap and sign < 0:
                inside = position < self.u
            given = inside & (outward >= sign * wave.head)
            star = inside & (outward <= sign * wave.tail) & ~given
            fan = inside & ~given & ~star
            rho[given] = side.rho
            u[given] = side.u
            p[given] = side.p
            rho[star] = rho_star
            u[star] = u_star
            p[star] = self.p
            if fan.any():
                isentrope = side.isentrope
                p_fan = isentrope.pressure_in_fan(outward[fan] - sign * side.u, self.p)
                rho[fan] = isentrope.density(p_fan)
                p[fan] = p_fan
                u[fan] = side.u - sign * isentrope.velocity_gain(p_fan)
        return rho, u, p


def solve_riemann(eos_left, left, eos_right, right, cavitation_pressure: float | None = None):
    """Exact solution between `left` = (rho, u, p) and `right`, each with its own EOS.

    Without `cavitation_pressure` the common pressure may be anything that both equations of state
    allow (ideal gases leave a vacuum at p = 0, stiffened ones at -p_inf); with it, materials that
    would need less pressure part and a gap at that pressure opens between them.  Raises BadInput
    for an impossible state, or where no pressure can join the states and no gap is allowed.
    """
    sides = _Side(eos_left, left, -1), _Side(eos_right, right, +1)
    least = max(side.isentrope.least_pressure for side in sides)
    if cavitation_pressure is not None:
        least = max(least, float(cavitation_pressure))

    def closing(p):
        return sides[0].velocity(p) - sides[1].velocity(p)

    try:
        if math.isfinite(least):
            if closing(least) <= 0.0:
                return _join(sides, least, True)
            low = least
        else:
            low = _search_low(sides, closing)
    except BadInput:  # an isentrope that does not reach so low; maybe it need not
        low = _search_near(sides, closing, least)
    rise = max(abs(side.p - low) + side.rho * side.isentrope.c**2 * 1e-3 for side in sides)
    high = low + rise
    while closing(high) > 0.0:
        low = high
        rise = 2.0 * rise
        high = low + rise
    p = (
        low
        if closing(low) == 0.0
        else find_root(closing, low, high, xtol=1e-300, rtol=RELATIVE_ROUND_OFF)
    )
    return _join(sides, p, False)


def _join(sides, p: float, gap: bool) -> RiemannSolution:
    """The solution with the pressure p between the two sides."""
    speeds = [side.velocity(p) for side in sides]
    if not gap:
        speeds = [0.5 * (speeds[0] + speeds[1])] * 2
    densities, waves = zip(*(side.reach(p) for side in sides), strict=True)
    return RiemannSolution(p, *speeds, *densities, *waves, gap, sides)


def _search_low(sides, closing) -> float:
    """A pressure at which the two sides still close on each other, searched downward."""
    low = min(side.p for side in sides)
    drop = 1e-2 * max(side.rho * side.isentrope.c**2 for side in sides)
    for _ in range(30):
        if closing(low) > 0.0:
            return low
        try:
            closing(low - drop)
        except BadInput:
            drop *= 0.5
        else:
            low -= drop
    raise BadInput(
        f"riemann problem: the states pull apart and have no common pressure above p = {low:g}; "
        "give a cavitation pressure at which they may part"
    )


def _search_near(sides, closing, least: float) -> float:
    """A pressure at which the two sides close on each other, searched from the higher given one
    down: no lower than need be.  Products of an explosive, as dense as this, expand into a gas a
    thousandfold before they have its pressure.
    """
    floor = least if math.isfinite(least) else 0.0
    high = max(side.p for side in sides)
    for halvings in range(1, MOST_HALVINGS):
        low = floor + (high - floor) * 0.5**halvings
        if closing(low) > 0.0:
            return low
    raise BadInput(
        f"riemann problem: the states pull apart and have no common pressure above p = {low:g}; "
        "give a cavitation pressure at which they may part"
    )


def compute_cell_averages(
    solution: RiemannSolution, x_edges: np.ndarray, t: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Averages of rho, rho u and p over the cells between `x_edges` (n + 1,), each (n,).

    The profile that starts at x = 0 is integrated at time t > 0 by Gauss quadrature between
    its kinks, so that no jump is smeared by the quadrature.
    """
    edges = np.asarray(x_edges, dtype=float) / t
    speeds = solution.get_speeds()
    inner = speeds[(speeds > edges[0]) & (speeds < edges[-1])]
    cuts = np.unique(np.concatenate([edges, inner]))
    points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    half = 0.5 * np.diff(cuts)
    middle = 0.5 * (cuts[1:] + cuts[:-1])
    rho, u, p = solution.sample(middle[:, None] + half[:, None] * points)
    cell = np.clip(np.searchsorted(edges, middle, side="right") - 1, 0, edges.size - 2)
    averages = []
    for field in (rho, rho * u, p):
        total = np.zeros(edges.size - 1)
        np.add.at(total, cell, (field @ weights) * half)
        averages.append(total / np.diff(edges))
    return tuple(averages)
