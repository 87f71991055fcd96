"""Isentropes: density and velocity along a rarefaction, for any equation of state.

With the pressure as parameter, `d rho/d p = 1/c^2` and `d u/d p = 1/(rho c)` [Toro, section 3.1].
Ideal and stiffened gases have these in closed form; any other equation of state is integrated
(Dormand-Prince 8(5,3), relative tolerance 1e-12).  The trap: a condensed material goes on below
zero pressure, down to a least pressure that only the equation of state knows, where c = 0.
"""

from __future__ import annotations

import math

import numpy as np

from hydro.eos import IdealGas, StiffenedGas
from regrid.errors import BadInput

TOLERANCE = 1e-12


def get_stiffened_parameters(eos) -> tuple[float, float] | None:
    """(gamma, p_inf) of an ideal or stiffened gas, None for any other equation of state."""
    if isinstance(eos, StiffenedGas):
        return float(eos.gamma), float(eos.p_inf)
    return (float(eos.gamma), 0.0) if isinstance(eos, IdealGas) else None


def make_isentrope(eos, rho: float, p: float):
    """The isentrope through (rho, p): an object with the methods of `StiffenedIsentrope`."""
    if get_stiffened_parameters(eos) is not None:
        return StiffenedIsentrope(eos, rho, p)
    return GeneralIsentrope(eos, rho, p)


class StiffenedIsentrope:
    """Isentrope of an ideal or stiffened gas in closed form ([Toro1997] §4.2, [Ivings1998]).

    `(p + p_inf)/rho^gamma` is constant and `u +- 2c/(gamma - 1)` are the Riemann invariants.
    """

    def __init__(self, eos, rho: float, p: float):
        self.gamma, self.p_inf = get_stiffened_parameters(eos)
        self.rho, self.p = float(rho), float(p)
        stiffness = self.gamma * (self.p + self.p_inf)
        self.c = math.sqrt(stiffness / self.rho) if stiffness > 0.0 else math.nan
        self.least_pressure = 0.0 - self.p_inf

    def density(self, p):
        """Density at the pressures `p` (any shape)."""
        return self.rho * ((p + self.p_inf) / (self.p + self.p_inf)) ** (1.0 / self.gamma)

    def velocity_gain(self, p):
        """Integral of dp/(rho c) from `p` (any shape) up to the pressure of the first state.

        Positive where `p` is lower: the speed that a release to `p` adds.
        """
        power = (self.gamma - 1.0) / (2.0 * self.gamma)
        ratio = ((p + self.p_inf) / (self.p + self.p_inf)) ** power
        return 2.0 * self.c / (self.gamma - 1.0) * (1.0 - ratio)

    def sound_speed(self, p):
        """Sound speed at the pressures `p` (any shape)."""
        power = (self.gamma - 1.0) / (2.0 * self.gamma)
        return self.c * ((p + self.p_inf) / (self.p + self.p_inf)) ** power

    def pressure_in_fan(self, speed, p_low: float | None = None):
        """Pressure where `c - velocity_gain` has the values `speed` (any shape).

        In a centred wave that runs to the left into gas at rest, `speed` is -x/t.  `p_low` is
        not used here.
        """
        ratio = (2.0 + (self.gamma - 1.0) * speed / self.c) / (self.gamma + 1.0)
        power = 2.0 * self.gamma / (self.gamma - 1.0)
        return (self.p + self.p_inf) * np.maximum(ratio, 0.0) ** power - self.p_inf


class GeneralIsentrope:
    """Isentrope of any equation of state, integrated on demand; methods of `StiffenedIsentrope`."""

    def __init__(self, eos, rho: float, p: float):
        self.eos = eos
        self.rho, self.p = float(rho), float(p)
        with np.errstate(invalid="ignore"):
            self.c = float(eos.sound_speed(self.rho, self.p))
        self.least_pressure = -math.inf
        self._pieces = {}

    def _extend(self, p_end: float):
        """Interpolant of (rho, velocity gain) between the first state and `p_end` or beyond."""
        down = p_end < self.p
        piece = self._pieces.get(down)
        if piece is not None and (piece.reach <= p_end if down else piece.reach >= p_end):
            return piece
        piece = _Piece(self, p_end)
        self._pieces[down] = piece
        return piece

    def _evaluate(self, p, row: int):
        p = np.asarray(p, dtype=float)
        result = np.empty(p.shape)
        for down in (True, False):
            chosen = p < self.p if down else p >= self.p
            if chosen.any():
                far = p[chosen].min() if down else p[chosen].max()
                result[chosen] = self._extend(float(far))(p[chosen])[row]
        return result if result.ndim else float(result)

    def density(self, p):
        """Density at the pressures `p` (any shape)."""
        return self._evaluate(p, 0)

    def velocity_gain(self, p):
        """Integral of dp/(rho c) from `p` (any shape) up to the pressure of the first state."""
        return self._evaluate(p, 1)

    def sound_speed(self, p):
        """Sound speed at the pressures `p` (any shape)."""
        return self.eos.sound_speed(self.density(p), np.asarray(p, dtype=float))

    def pressure_in_fan(self, speed, p_low: float):
        """Pressure where `c - velocity_gain` has the values `speed` (any shape), by bisection.

        `p_low` is a pressure on the isentrope at or below the least one asked for.
        """
        speed = np.asarray(speed, dtype=float)
        low = np.full(speed.shape, p_low)
        high = np.full(speed.shape, self.p)
        for _ in range(60):
            middle = 0.5 * (low + high)
            above = self.sound_speed(middle) - self.velocity_gain(middle) > speed
            high = np.where(above, middle, high)
            low = np.where(above, low, middle)
        return 0.5 * (low + high)


class _Piece:
    """Interpolant of (rho, velocity gain) over the pressures from a first state to `reach`."""

    def __init__(self, isentrope: GeneralIsentrope, p_end: float):
        eos, rho, p = isentrope.eos, isentrope.rho, isentrope.p
        scale = rho * isentrope.c**2
        self.start, self.reach = p, p_end
        self.first = np.array([rho, 0.0])
        self.solution = None
        if p_end == p:
            return

        def slope(pressure, state):
            c = float(eos.sound_speed(state[0], pressure))
            if not (state[0] > 1e-3 * rho and c > 1e-3 * isentrope.c):
                raise _unreachable(rho, p, p_end)
            return [1.0 / c**2, -1.0 / (state[0] * c)]

        from scipy.integrate import solve_ivp  # slow to load

        absolute = [TOLERANCE * rho, TOLERANCE * isentrope.c]
        first_step = min(abs(p_end - p), 1e-3 * scale)
        with np.errstate(all="ignore"):
            run = solve_ivp(
                slope,
                (p, p_end),
                self.first,
                method="DOP853",
                rtol=TOLERANCE,
                atol=absolute,
                dense_output=True,
                first_step=first_step,
            )
        if not run.success or not np.all(np.isfinite(run.y)) or run.y[0, -1] <= 0.0:
            raise _unreachable(rho, p, p_end)
        self.solution = run.sol

    def __call__(self, p):
        if self.solution is None:
            return np.broadcast_to(self.first[:, None], (2, p.size)).reshape(2, *p.shape)
        return self.solution(p.ravel()).reshape(2, *p.shape)


def _unreachable(rho: float, p: float, p_end: float) -> BadInput:
    return BadInput(
        f"the isentrope from rho = {rho:g}, p = {p:g} does not reach p = {p_end:g}: the "
        "equation of state has no sound speed there; ask for a higher pressure"
    )


def release(eos, rho: float, p: float, p_end: float = 0.0) -> tuple[float, float]:
    """Density after an isentropic release from (rho, p) to `p_end`, and the speed gained.

    The speed is the integral of dp/(rho c), positive for p_end < p.
    """
    isentrope = make_isentrope(eos, rho, p)
    if p_end < isentrope.least_pressure:
        raise BadInput(
            f"a release to p = {p_end:g} asks for less than the least pressure of the material, "
            f"{isentrope.least_pressure:g}"
        )
    return float(isentrope.density(p_end)), float(isentrope.velocity_gain(p_end))


def compute_free_surface_speed(
    eos, rho: float, p: float, particle_speed: float, p_end: float = 0.0
) -> float:
    """Speed of a free surface when a shock state (rho, p, particle_speed) arrives at it.

    `u_fs = up + integral of dp/(rho c)` from `p_end` to p; acoustically twice the particle speed.
    """
    return particle_speed + release(eos, rho, p, p_end)[1]
