"""Growth of a shocked interface: linear compressible theory, impulsive and non-linear models.

Linear compressible growth of a sinusoidal interface after a shock, [Richtmyer1960], [Yang1994]: a
plane shock runs through the first material towards larger x and meets the interface
`x = a0 cos(ky)` to the second.  The base flow is that of the plane interface: a transmitted
shock, and a reflected shock or rarefaction, from the exact Riemann solver.  The perturbation
(p, u) cos ky, v sin ky obeys the linearised Euler equations in the moving layers between
interface and shocks; behind each shock the linearised jump conditions hold, the slopes of the
Hugoniot taken from the equation of state.  Everything is linear in a0 and k enters through `k t`
only, so that one solution gives `(da/dt)/(k a0)` for all of them.

The perturbation is taken at fixed `x - a0 cos ky` and `t - a0 cos(ky)/Ws`, the place and time
since the incident shock met this part of the interface: then p and u start from zero everywhere,
inside a reflected rarefaction too, and only the transverse velocity sees the tilted base flow.

Each layer is scaled by its width, which grows like t (coordinate x/t), with Chebyshev collocation
across and Runge-Kutta steps in log t (`perturbed_layers`).  Points are added until two ways to cut
the layers agree.  A reflected wave weaker than 0.4 % of the sound speed lets
sound out unchanged; the rate is right to 0.1 % then.  Note: the rate oscillates, so that a
mean needs a smooth window, and the impulsive formulas are 2-40 % off that mean.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shockgrid.problems.references.hugoniot import Shock, shock_to_pressure
from shockgrid.problems.references.perturbed_layers import (
    Cut,
    Layers,
    March,
    interpolate_zones,
    march_layers,
    move_states,
)
from shockgrid.problems.references.riemann import RiemannSolution, solve_riemann
from shockgrid.regrid.compilation.kept_files import remember
from shockgrid.regrid.errors import BadInput, RunFailure


def compute_atwood_number(rho_first: float, rho_second: float) -> float:
    """`A = (rho2 - rho1)/(rho2 + rho1)`, positive when the second material is denser."""
    return (rho_second - rho_first) / (rho_second + rho_first)


@dataclass(frozen=True)
class PadeModel:
    """Non-linear growth of the half height of bubble and spike [ZhangSohn1997]:
    with `amplitude` a0 [m] and the linear `rate` v0 > 0 [m/s] just after the shock,

        v = v0/(1 + v0 a0 k² t + max(0, c) v0² k² t²),   c = a0² k² - A² + 1/2.
    """

    wavenumber: float
    amplitude: float
    rate: float
    atwood: float

    @property
    def square(self) -> float:
        """The c of the formula."""
        return (self.amplitude * self.wavenumber) ** 2 - self.atwood**2 + 0.5

    @property
    def reach(self) -> float:
        """Time after the shock up to which the model can be right; inf without such an end.

        The growth of one mode slows down like 1/t and no faster [Sadot1998].  The model's goes over
        to 1/t² where c (k v0 t)² = 1: from there on it is no approximation.
        """
        growth = math.sqrt(max(self.square, 0.0)) * self.wavenumber * self.rate
        return 1.0 / growth if growth else math.inf

    def compute_rate(self, t):
        """da/dt at the times `t` (any shape)."""
        reduced = self.rate * np.asarray(t, dtype=float)
        slow = 1.0 + reduced * self.amplitude * self.wavenumber**2
        return self.rate / (slow + max(0.0, self.square) * (self.wavenumber * reduced) ** 2)

    def compute_amplitude(self, t):
        """Amplitude at the times `t` >= 0 (n,), by Gauss's rule.

        Over s = log(1 + q t), q being the rate of the growth's slowing down: a rule over t itself
        misses the first growth of a long time.
        """
        points, weights = np.polynomial.legendre.leggauss(40)
        slowing = self.amplitude * self.wavenumber + math.sqrt(max(0.0, self.square))
        slowing = max(slowing * self.wavenumber * self.rate, np.finfo(float).tiny)
        half = 0.5 * np.log1p(slowing * np.asarray(t, dtype=float))
        s = half[:, None] * (1.0 + points)
        rate = self.compute_rate(np.expm1(s) / slowing) * np.exp(s) / slowing
        return self.amplitude + half * (rate @ weights)


WEAK_WAVE = 0.004  # of the sound speed: a weaker reflected wave lets sound pass
CUTS = (Cut(40), Cut(12, 2.0), Cut(16, 2.0), Cut(20, 2.0))
# far from the interface there are waves as short as near it, which it never feels
FIELD_CUTS = (Cut(40), Cut(12, 3.0, 1.0), Cut(16, 3.0, 1.0), Cut(20, 3.0, 1.0), Cut(28, 3.0, 1.0))
TRUSTED_ERROR = 1e-3  # difference of two cuts up to which the coarser one is taken
LEAST_RATE_PART = 0.02  # of the interface's speed: growth at a smaller rate is no scale of errors


@dataclass(frozen=True)
class PerturbedLayer:
    """The perturbation on one side of the interface, for k a0 = 1, all in the caller's units.

    It is (rho, p, u) cos ky and v sin ky at points (n,) that are `speed` times the time away from
    the interface, u being the velocity outwards; from the last one on there is none.  It is what
    comes to the plane flow of a row of its own, shifted by x = a0 cos ky and t = a0 cos(ky)/Ws.
    `front` is the amplitude over a0 of the shock that bounds the side, NaN where none does.
    """

    speed: np.ndarray
    rho: np.ndarray
    u: np.ndarray
    v: np.ndarray
    p: np.ndarray
    front: float

    def interpolate(self, speed: np.ndarray) -> np.ndarray:
        """rho, u, v, p (4, m) at the speeds (m,), those of the ends beyond them.

        Each zone has its own polynomial.
        """
        values = np.array([self.rho, self.u, self.v, self.p])
        return interpolate_zones(self.speed, values, speed)


@dataclass(frozen=True)
class PerturbedFlow:
    """Both sides at one time, and the amplitude of the interface over a0."""

    amplitude: float
    first: PerturbedLayer
    second: PerturbedLayer


@dataclass(frozen=True)
class LinearGrowth:
    """Linear growth after a shock, all in the caller's units.

    `kt` (n,) is wavenumber times time since the shock met the mean interface, up to `kt_end`
    [1/velocity], `rate` (n,) is (da/dt)/(k a0) [velocity], a0 being the amplitude before the shock;
    both, and the shocks' shapes, are computed when one is first asked for.
    `layers` are what the perturbation lives in, `compute_fields` gives it.
    `compression` is a+/a0 just after it.  `impulsive` is the rate, in the units of `rate`, of the
    model that `impulse` names: Richtmyer's [Richtmyer1960], k a+ u A with the contact's velocity u
    and the Atwood number A just after the shock, where a shock is reflected, and Meyer and
    Blewett's [MeyerBlewett1972], with the mean of a+ and a0, where a rarefaction is.
    `sound_speed` is that of the shocked second material: times are given as k c t with this c.
    `reflected` is "shock" or "rarefaction"; `base` is the flow of
    the plane interface, `incident` the shock that makes it.
    """

    kt_end: float
    layers: Layers
    compression: float
    impulsive: float
    impulse: str
    sound_speed: float
    reflected: str
    incident: Shock
    base: RiemannSolution

    @property
    def atwood(self) -> float:
        """Atwood number after the shock."""
        return compute_atwood_number(self.base.rho_left, self.base.rho_right)

    @functools.cached_property
    def _curve(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """`kt`, `rate`, amplitudes (2, n) of the shocks over a0, and the error of the growth."""
        key = self.layers.make_sides(CUTS[0], self.kt_end), self.kt_end
        return remember("growth", key, self._march)

    def _march(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        march, error = self._march_layers(self.kt_end, CUTS, self._compare_growth)
        shapes = zip(march.sides, march.ends[:, 1], (-1.0, 1.0), strict=True)
        fronts = np.array([sign * v / (side.jump or math.nan) for side, v, sign in shapes])
        return (
            np.concatenate([[0.0], march.times]),
            np.concatenate([[0.0], march.velocities]),
            np.concatenate([fronts[:, :1], fronts], axis=1),
            error,
        )

    def _march_layers(self, kt: float, cuts: Sequence[Cut], compare) -> tuple[March, float]:
        """The march to `kt` of the first of `cuts` that the next one confirms, and its error.

        compare: relative difference of two marches.  Where none is confirmed it is the last one.
        """
        march = None
        error = math.inf
        for cut in cuts:
            try:
                finer = march_layers(self.layers, cut, kt)
            except RunFailure:
                if cut is cuts[-1]:
                    raise
                continue
            error = compare(march, finer) if march else math.inf
            if error <= TRUSTED_ERROR:
                break
            march = finer
        return march, error

    def _compare_growth(self, march: March, finer: March) -> float:
        """Greatest difference of the growth, over the greatest growth of the finer march."""
        growth = finer.growth
        least = LEAST_RATE_PART * abs(self.base.u) * march.times[-1]
        scale = max(float(np.abs(growth).max()), least)
        return float(
            np.abs(np.interp(march.times, finer.times, growth) - march.growth).max() / scale
        )

    def _compare_fields(self, march: March, finer: March) -> float:
        """The greater of that and of the differences of p, u and v over the greatest of each."""
        error = self._compare_growth(march, finer)
        pairs = zip(
            march.sides, march.split_states(), finer.sides, finer.split_states(), strict=True
        )
        differences = []
        sizes = []
        for side, states, finer_side, finer_states in pairs:
            moved = move_states(side, finer_side, finer_states)
            known = np.concatenate(states, axis=1)
            differences.append(np.abs(np.concatenate(moved, axis=1) - known).max(axis=1))
            sizes.append(np.abs(known).max(axis=1))
        scale = np.maximum(np.max(sizes, axis=0), np.finfo(float).tiny)
        return max(error, float((np.max(differences, axis=0) / scale).max()))

    @property
    def error(self) -> float:
        """Error of the growth up to `kt_end`, over the greatest: the difference of two ways to cut
        the layers into zones."""
        return self._curve[3]

    @property
    def kt(self) -> np.ndarray:
        """Wavenumber times time (n,) [1/velocity]."""
        return self._curve[0]

    @property
    def rate(self) -> np.ndarray:
        """(da/dt)/(k a0) at `kt` (n,) [velocity]."""
        return self._curve[1]

    def compute_fields(self, kt: float) -> PerturbedFlow:
        """The perturbed flow at wavenumber times time `kt` > 0 [1/velocity].

        In a layer behind a shock particles rest beside the interface, each with the entropy that
        the shock gave it when it passed: at a distance x it passed at t = x/width,

            rho'(x, t) = p'(x, t)/c^2 + (d rho/d p of the Hugoniot - 1/c^2) p'_shock(x/width)

        elsewhere no shock changes its entropy.
        """
        key = self.layers.make_sides(CUTS[0], kt), self.compression, kt
        return remember("flow", key, lambda: self._find_fields(kt))

    def _find_fields(self, kt: float) -> PerturbedFlow:
        march, _ = self._march_layers(kt, FIELD_CUTS, self._compare_fields)
        growth = 0.5 * np.sum(np.diff(march.times) * (march.velocities[1:] + march.velocities[:-1]))
        layers = []
        pairs = zip(march.sides, march.split_states(), march.ends, (-1.0, 1.0), strict=True)
        for side, states, ends, sign in pairs:
            p, u, v = np.concatenate(states, axis=1)
            speed = np.concatenate([zone.speed for zone in side.zones])
            slope = np.concatenate([zone.slope for zone in side.zones])
            rho = slope * p
            front = math.nan
            if side.jump:
                passed = np.interp(kt * speed / speed[-1], march.times, ends[0])
                rho += (side.hugoniot - slope) * passed
                front = sign * float(v[-1]) / side.jump
            layers.append(PerturbedLayer(speed, rho, u, v, p, front))
        return PerturbedFlow(self.compression + float(growth), *layers)

    def get_amplitude(self, wavenumber: float, t) -> np.ndarray:
        """a(t)/a0 at the times `t` (any shape) after the shock, none beyond the solution's end."""
        steps = 0.5 * np.diff(self.kt) * (self.rate[1:] + self.rate[:-1])
        growth = np.concatenate([[0.0], np.cumsum(steps)])
        return self.compression + np.interp(wavenumber * np.asarray(t), self.kt, growth)

    def get_front(self, side: int, wavenumber: float, t) -> np.ndarray:
        """Amplitude over a0 of the reflected (0) or transmitted (1) shock at the times `t` (any
        shape), the last one known beyond them; NaN where there is no shock."""
        return np.interp(wavenumber * np.asarray(t), self.kt, self._curve[2][side])

    def get_rate(self, wavenumber: float, t) -> np.ndarray:
        """(da/dt)/(k a0) at the times `t` (any shape) after the shock."""
        return np.interp(wavenumber * np.asarray(t), self.kt, self.rate)

    def get_mean_rate(self, first: float = 6.0, last: float = 30.0) -> float:
        """Plain mean of `rate` over first < k c t < last; what a computed growth compares with."""
        self._check_window(last)
        ends = np.array([first, last]) / self.sound_speed
        grown = self.get_amplitude(1.0, ends)
        return float((grown[1] - grown[0]) / (ends[1] - ends[0]))

    def get_asymptotic_rate(self) -> float:
        """The rate about which `rate` oscillates: its mean with weight sin² over 6 < k c t < 30."""
        self._check_window(30.0)
        phase = (np.arange(8192) + 0.5) / 8192
        rate = self.get_rate(1.0, (6.0 + 24.0 * phase) / self.sound_speed)
        return float(2.0 * np.mean(np.sin(math.pi * phase) ** 2 * rate))

    def _check_window(self, last: float) -> None:
        reach = self.kt[-1] * self.sound_speed
        if last > reach * (1.0 + 1e-9):
            raise BadInput(
                f"linear growth: a mean up to k c t = {last:g} "
                f"needs a solution beyond {reach:g}; ask for a longer one"
            )


def compute_linear_growth(
    eos_first,
    rho_first: float,
    eos_second,
    rho_second: float,
    p: float,
    p_behind: float,
    kct_end: float = 30.0,
) -> LinearGrowth:
    """Linear compressible growth after a shock from pressure `p` to `p_behind`.

    Both materials are at rest at pressure `p` with densities `rho_first` (where the shock comes
    from) and `rho_second`.  Any consistent units.  Raises BadInput for impossible states; the
    curve, when it is asked for, RunFailure if the march in time fails.
    """
    incident = shock_to_pressure(eos_first, rho_first, p, p_behind)
    u = incident.particle_speed
    ahead = incident.rho, u, p_behind
    base = solve_riemann(eos_first, ahead, eos_second, (rho_second, 0.0, p))
    transmitted = shock_to_pressure(eos_second, rho_second, p, base.p)
    wave = base.left_wave
    is_weak = abs(base.u - u) < WEAK_WAVE * (u - wave.head)
    reflected = None
    if wave.kind == "shock" and not is_weak:
        reflected = shock_to_pressure(eos_first, incident.rho, p_behind, base.p)
    layers = Layers(
        eos_first, eos_second, ahead, base, incident.shock_speed, transmitted, reflected, is_weak
    )
    c = float(eos_second.sound_speed(base.rho_right, base.p))
    compression = 1.0 - base.u / incident.shock_speed
    amplitude = compression
    impulse = "Richtmyer"
    if wave.kind == "rarefaction":
        amplitude = 0.5 * (1.0 + compression)
        impulse = "Meyer, Blewett"
    impulsive = amplitude * base.u * compute_atwood_number(base.rho_left, base.rho_right)
    return LinearGrowth(
        kct_end / c, layers, compression, impulsive, impulse, c, wave.kind, incident, base
    )
