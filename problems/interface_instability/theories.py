"""What the growth of a shocked interface is compared with, and how far each theory goes.

Linear compressible theory [Yang1994] applies to one mode while the next term of perturbation theory
takes less than LOSS off its rate.  A mode that grows from next to nothing in incompressible flow is
k a = s - (4 A² + 1) s³/24 with s = k v0 t (A: Atwood number), so that is while
(4 A² + 1) (k a)²/8 <= LOSS, and k a <= 0.3 where A is small; a mean over the window then loses less
than 1 %.  For several modes the sum of
their k a is to be <= 0.1: waves that two of them make are k a times as large as they [Haan1991].
The Padé model [ZhangSohn1997] is one for a single mode and a reflected shock, with k a+ < 1, growth
slower than 0.3 of the sound speed (its flow is incompressible) and as long as its growth falls no
faster than 1/t (`find_pade_range`).  The impulsive models are nowhere exact: they are shown without
a difference.

k is the mode's own wavenumber, n times the deck's, and so are its times k c t; c is the sound speed
of the shocked second material, t counts from the shock's arrival at the mean interface.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from problems.interface_instability.modes import Harmonic
from problems.references.growth_models import (
    compute_atwood_number,
    compute_pade_amplitude,
    find_pade_range,
)
from problems.references.linear_growth import LinearGrowth

WINDOW = (6.0, 30.0)  # k c t over which a growth rate is averaged
LEAST_WINDOW = 1.0
LINEAR = 0.3  # largest k a of one mode for linear theory, whatever its next term
LOSS = 0.015  # of the rate, by that term, at the end of the window
COUPLED = 0.1  # largest sum of the k a of several
INCOMPRESSIBLE = 0.3  # largest growth rate over the sound speed for the Padé model
STILL = 0.02  # of the interface's speed: a smaller theoretical rate is no scale for an error


@dataclass(frozen=True)
class Window:
    """Where a mode's growth rate is averaged: k c t, k the mode's; `linear`: does theory apply?"""

    first: float
    last: float
    linear: bool


def get_kct(problem, t):
    """k c t since the shock met the mean interface, k being 2 pi / wavelength."""
    return (np.asarray(t) - problem.arrival) * problem.k * problem.theory.sound_speed


def predict_growth(problem) -> dict[str, float]:
    """Theory of the first mode by name, SI units: none for two shocks, for which there is none.

    growth_rate is (da/dt)/(k a0) [m/s] of linear compressible theory, averaged over the part of
    WINDOW that the run reaches, and left out where it reaches none.
    """
    if problem.deck.second_shock is not None:
        return {}
    theory = problem.theory
    found = {
        "interface_speed": theory.base.u,
        "atwood_number": compute_atwood_number(theory.base.rho_left, theory.base.rho_right),
    }
    if not problem.harmonics:
        return found
    last = min(WINDOW[1], float(get_kct(problem, problem.t_end)))
    if last > WINDOW[0] + LEAST_WINDOW:
        found["growth_rate"] = theory.get_mean_rate(WINDOW[0], last)
    found["impulsive_rate"] = theory.impulsive
    return {name: float(value) for name, value in found.items()}


def predict_amplitude(theory: LinearGrowth, kct):
    """a/a0 of any mode at its own `kct` (any shape) by linear theory.

    Beyond the solution's end it goes on with the asymptotic rate.
    """
    kt = np.asarray(kct, dtype=float) / theory.sound_speed
    inside = np.minimum(kt, theory.kt[-1])
    return theory.get_amplitude(1.0, inside) + (kt - inside) * theory.get_asymptotic_rate()


def is_still(theory: LinearGrowth, rate: float) -> bool:
    """Is a theoretical (da/dt)/(k a0) so small that a difference is no part of it?

    A wave does not grow where both materials are as one.  Its scale is the speed that the shock
    gives to the interface: what it would grow with at an Atwood number of 1.
    """
    return abs(rate) < STILL * abs(theory.base.u)


class Growth:
    """Theories for one `InterfaceInstability`: which apply, how far."""

    def __init__(self, problem):
        self.problem = problem
        self.theory = problem.theory

    @property
    def first_slope(self) -> float:
        """Sum of the k a of all modes of the first line, each with its own k."""
        modes, wavenumber = self.problem.harmonics, self.problem.k
        return sum(abs(mode.number * wavenumber * mode.amplitude) for mode in modes)

    @property
    def limit(self) -> float:
        """Largest sum of the modes' k a to which linear theory applies."""
        if len(self.problem.harmonics) > 1:
            return COUPLED
        base = self.theory.base
        atwood = compute_atwood_number(base.rho_left, base.rho_right)
        return min(LINEAR, math.sqrt(8.0 * LOSS / (4.0 * atwood**2 + 1.0)))

    @functools.cached_property
    def linear_reach(self) -> float:
        """k c t (k of the wavelength) up to which linear theory applies; 0 where nowhere."""
        modes, theory, limit = self.problem.harmonics, self.theory, self.limit
        end = float(max(WINDOW[1], get_kct(self.problem, self.problem.t_end)))
        kct = np.linspace(0.0, end, 1201)
        slopes = np.zeros_like(kct)
        for mode in modes:
            slope = abs(mode.number * self.problem.k * mode.amplitude)
            slopes += slope * np.abs(predict_amplitude(theory, mode.number * kct))
        steep = np.flatnonzero(slopes > limit)
        if self.first_slope > limit:
            return 0.0
        return float(kct[steep[0]]) if steep.size else math.inf

    def find_window(self, mode: Harmonic, kct_end: float) -> Window | None:
        """The window of a mode for a run up to `kct_end` (k of the wavelength); None: too short."""
        first = max(WINDOW[0], mode.number * float(get_kct(self.problem, 0.0)))
        last = min(WINDOW[1], mode.number * kct_end)
        linear = min(last, mode.number * self.linear_reach)
        if linear > first + LEAST_WINDOW:
            return Window(first, linear, True)
        return Window(first, last, False) if last > first + LEAST_WINDOW else None

    def measure_rate(self, history: Mapping, mode: Harmonic, first: float, last: float) -> float:
        """Computed mean (da/dt)/(k a0) of a mode over a window of its own k c t.

        NaN when the history does not reach so far.
        """
        problem = self.problem
        kct = mode.number * get_kct(problem, history["t"])
        if kct[-1] < last - 1e-6:
            return float("nan")
        grown = np.interp((first, last), kct, history[mode.column])
        wavenumber = mode.number * problem.k
        duration = (last - first) / (wavenumber * self.theory.sound_speed)
        return float((grown[1] - grown[0]) / duration / (wavenumber * mode.amplitude))

    def scale_roughness(self, history: Mapping) -> np.ndarray:
        """Roughness of the line over its largest mode, now or just after the shock, at each time.

        A mode that changes its sign is nothing for a moment: that makes no line rough.
        """
        modes = [mode for mode in self.problem.harmonics if mode.column in history]
        now = np.max(np.abs([history[mode.column] for mode in modes]), axis=0)
        first = max(abs(mode.amplitude * self.theory.compression) for mode in modes)
        return np.asarray(history["roughness"]) / np.maximum(now, first)

    @property
    def model_fails(self) -> str:
        """Why the Padé model does not apply at all; "" where it does."""
        theory, modes = self.theory, self.problem.harmonics
        if len(modes) != 1:
            return "the Padé model is one of a single mode"
        if is_still(theory, theory.get_asymptotic_rate()):
            return "theory has next to no growth"
        if theory.reflected != "shock" or theory.compression <= 0.0:
            return "the Padé model is one for reflected shocks"
        wavenumber, start, rate, _ = self._model_terms()
        if wavenumber * start >= 1.0:
            return f"the Padé model ends at k a+ = 1, here {wavenumber * start:.2g}"
        speed = rate / theory.sound_speed
        if speed > INCOMPRESSIBLE:
            return f"the Padé model is incompressible, growth is at {speed:.2g} of the sound speed"
        return ""

    def _model_terms(self) -> tuple[float, float, float, float]:
        """Wavenumber, amplitude and rate just after the shock, Atwood number of the one mode."""
        theory = self.theory
        mode = self.problem.harmonics[0]
        wavenumber = mode.number * self.problem.k
        start = abs(mode.amplitude)
        rate = abs(theory.get_asymptotic_rate()) * wavenumber * start
        atwood = compute_atwood_number(theory.base.rho_left, theory.base.rho_right)
        return wavenumber, start * theory.compression, rate, atwood

    @property
    def model_reach(self) -> float:
        """k c t (k of the wavelength) up to which the Padé model can be right; 0 where nowhere."""
        if self.model_fails:
            return 0.0
        problem = self.problem
        return find_pade_range(*self._model_terms()) * problem.k * self.theory.sound_speed

    def compute_model(self, t: np.ndarray) -> np.ndarray:
        """Non-linear amplitude (Padé from the linear asymptotic rate) at ascending times t."""
        wavenumber, start, rate, atwood = self._model_terms()
        after = np.maximum(np.asarray(t) - self.problem.arrival, 0.0)
        times = np.concatenate([[0.0], after])
        return compute_pade_amplitude(wavenumber, start, rate, atwood, times)[1:]
