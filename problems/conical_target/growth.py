"""Growth of the ripple on the cone's side, wave by wave, beside theory: closing screen and picture.

Each wave has its own clock, which starts when the shock along the side is at its middle.  Theory
is that of ripples of small slope behind shocks that cross a line, `refracted_shock`; the speed of
the shocks along the line is the one that was seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from problems.references.refracted_shock import CrossedLine

AGES = (0.5e-6, 1.2e-6)  # after the passage: between them the rate of growth is told [s]
COMPARABLE = 10.6  # cells a wave, 48 to the shell: growth of shorter ones is damped too much
SHOWN = 6  # times whose lines are drawn
MM, GPA, US = 1e3, 1e-9, 1e6


@dataclass(frozen=True)
class WaveGrowth:
    """One wave: its middle along the side at first [m], passage [s], ages [s], amplitudes [m]."""

    position: float
    passed: float
    age: np.ndarray
    amplitude: np.ndarray

    def get_amplitude(self, age: float) -> float:
        """Amplitude [m] so long after the passage; NaN beyond the run or the line."""
        known = np.isfinite(self.amplitude)
        if known.sum() < 2 or not self.age[known][0] <= age <= self.age[known][-1]:
            return math.nan
        return float(np.interp(age, self.age[known], self.amplitude[known]))

    def measure_rate(self) -> float:
        """Mean of d(ln a)/dt [1/s] between AGES, when the kink of the shock has left the wave."""
        first, last = (self.get_amplitude(age) for age in AGES)
        return math.log(last / first) / (AGES[1] - AGES[0])


def measure_side_shock(problem, history) -> tuple[float, float] | None:
    """Speed [m/s] of the shock along the side, from its base on, and when it was at the base [s].

    The straight line of least squares through the places that the history has, None if too few.
    """
    t = np.asarray(history["t"], dtype=float)
    x = np.asarray(history["shock_x_side"], dtype=float)
    frame = problem.ripple.frame
    position = (x - problem.deck.front) / frame.along[0]
    waves = problem.ripple.waves
    known = np.isfinite(position) & (position > waves[0]) & (position < waves[-1] + 1e-3)
    if known.sum() < 4:
        return None
    speed, start = np.polyfit(t[known], position[known], 1)
    return float(speed), float(-start / speed)


def measure_waves(problem, history) -> tuple[CrossedLine | None, list[WaveGrowth]]:
    """Theory for the shock that was seen, and the growth of every wave; (None, []) too early."""
    seen = measure_side_shock(problem, history)
    if seen is None:
        return None, []
    speed, begin = seen
    t = np.asarray(history["t"], dtype=float)
    waves = []
    for number, position in enumerate(problem.ripple.waves):
        passed = begin + position / speed
        amplitude = np.asarray(history[f"ripple_{number}"], dtype=float)
        waves.append(WaveGrowth(float(position), float(passed), t - passed, amplitude))
    return problem.ripple.cross(speed), waves


def make_ripple_lines(problem, history) -> list[str]:
    """The growth of the ripple beside theory, as lines of the closing screen."""
    ripple = problem.ripple
    lines = [
        f"  ripple of {ripple.amplitude * MM:.3g} mm on waves of {ripple.wavelength * MM:.3g} mm "
        f"on its side, k a = {ripple.wavenumber * ripple.amplitude:.3g}"
    ]
    if ripple.cells_a_wave < COMPARABLE:
        wanted = math.ceil(problem.deck.cells * COMPARABLE / ripple.cells_a_wave)
        lines.append(
            f"    {ripple.cells_a_wave:.3g} cells a wave are too few to compare growth with "
            f"theory: the thickness of the interface holds it back; cells={wanted} or more would do"
        )
    crossed, waves = measure_waves(problem, history)
    if crossed is not None:
        rates = crossed.compute_rates(ripple.wavenumber)
        lines += [
            f"    shocks cross the side at {crossed.speed / 1e3:.3g} km/s; polars: "
            f"{crossed.p * GPA:.3g} GPa behind, the line turned by "
            f"{math.degrees(crossed.deflection):.3g} degrees and moved across itself at "
            f"{crossed.normal_speed:.3g} m/s",
            f"    slip {crossed.slip:.3g} m/s, Atwood number {crossed.atwood:.3g}; rates of the "
            f"impulse {rates[0] / US:.3g} and of the slip {rates[1] / US:.3g} a us",
        ]
    for number, wave in enumerate(waves):
        told = f"    wave {number + 1}, passed at {wave.passed * US:.2f} us"
        rate = wave.measure_rate()
        if math.isfinite(rate):
            told += f", grows by {rate / US:.3g} a us"
            if crossed is not None:
                told += f" (theory of small slopes {find_rate(ripple, crossed) / US:.3g})"
            grown = wave.get_amplitude(AGES[1]) / wave.amplitude[0]
            told += f" to {grown:.3g} times at {AGES[1] * US:.2g} us"
        if np.isfinite(wave.amplitude).any():
            top = int(np.nanargmax(wave.amplitude))
            told += (
                f"; at most {wave.amplitude[top] * MM:.3g} mm, k a = "
                f"{ripple.wavenumber * wave.amplitude[top]:.2g}, at {history['t'][top] * US:.2f} us"
            )
        lines.append(told)
    return lines


def find_rate(ripple, crossed: CrossedLine) -> float:
    """Theory of `WaveGrowth.measure_rate` [1/s]."""
    first, last = crossed.compute_growth(ripple.wavenumber, np.array(AGES))
    return float(np.log(last / first)) / (AGES[1] - AGES[0])


def draw_ripple(problem, figure, run_data) -> None:
    """The rippled side at several times; amplitude over time and growth over age, with theory."""
    figure.set_size_inches(11.0, 7.2)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.25, 1.0))
    shape = figure.add_subplot(grid[0, :])
    amplitude, growth = (figure.add_subplot(grid[1, column]) for column in (0, 1))
    dumps, ripple = run_data.dumps, problem.ripple
    chosen = np.unique(np.linspace(0, len(dumps) - 1, SHOWN).round().astype(int))
    shades = _get_shades(len(chosen))
    for shade, number in zip(shades, chosen, strict=True):
        line = next(b for b in dumps[number].blocks if b.name == "cone").nodes[:, :, -1]
        shape.plot(*(MM * line), color=shade, lw=1.4, label=f"{US * dumps[number].t:.2g} us")
    shape.set_aspect("equal")
    shape.set_xlabel("x, mm")
    shape.set_ylabel("r, mm")
    shape.set_title("line between graphite and lead", fontsize="medium")
    shape.legend(fontsize="small", frameon=False, loc="upper right")
    history = run_data.history
    crossed, waves = measure_waves(problem, history)
    t = np.asarray(history["t"], dtype=float)
    for number, wave in enumerate(waves):
        colour = f"C{number}"
        amplitude.plot(US * t, MM * wave.amplitude, color=colour, label=f"wave {number + 1}")
        grown = wave.age > 0.0
        growth.plot(
            US * wave.age[grown], wave.amplitude[grown] / wave.amplitude[0], color=colour,
            label=f"wave {number + 1}",
        )  # fmt: skip
        if crossed is not None:
            theory = wave.amplitude[0] * crossed.compute_growth(ripple.wavenumber, wave.age)
            steep = MM * theory < 1.5 * np.nanmax(MM * _stack(waves))
            amplitude.plot(US * t[steep], MM * theory[steep], "--", color=colour, lw=0.9)
    amplitude.axhline(MM / ripple.wavenumber, color="0.6", lw=0.7)
    amplitude.text(
        0.05, MM / ripple.wavenumber, "k a = 1", color="0.4", fontsize="small", va="bottom"
    )
    if crossed is not None:
        _draw_theory(growth, crossed, ripple.wavenumber, waves)
    amplitude.set_xlabel("t, us")
    amplitude.set_ylabel("amplitude, mm")
    amplitude.legend(fontsize="small", frameon=False)
    amplitude.set_title("dashed: theory of small slopes", fontsize="medium")
    growth.set_xlabel("time since the shock was at the wave, us")
    growth.set_ylabel("a / a0")
    growth.legend(fontsize="small", frameon=False, ncols=2)
    figure.set_layout_engine("constrained")


def _draw_theory(axis, crossed: CrossedLine, wavenumber: float, waves) -> None:
    """Impulse and slip together, and each alone, over the age."""
    age = np.linspace(0.0, max(wave.age[-1] for wave in waves), 200)
    impulse, shear = crossed.compute_rates(wavenumber)
    plus = crossed.compression
    axis.plot(US * age, crossed.compute_growth(wavenumber, age), "k--", lw=1.0, label="theory")
    axis.plot(
        US * age, plus * (1.0 + impulse * age), "-.", color="0.5", lw=0.8, label="impulse alone"
    )
    axis.plot(US * age, plus * np.cosh(shear * age), ":", color="0.5", lw=1.0, label="slip alone")
    axis.set_yscale("log")
    ticks = (0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0)
    axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.set_yticks([], minor=True)
    axis.set_ylim(0.75, 2.0 * np.nanmax(_stack(waves)) / _first(waves))


def _stack(waves) -> np.ndarray:
    return np.concatenate([wave.amplitude for wave in waves])


def _first(waves) -> float:
    return float(np.nanmean([wave.amplitude[0] for wave in waves]))


def _get_shades(count: int) -> np.ndarray:
    from matplotlib import colormaps

    return colormaps["viridis"](np.linspace(0.0, 0.9, count))
