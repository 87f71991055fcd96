"""Do the three formulas of an equation of state belong to one material?

The flow goes from p to e and back in every step, and its waves run with c: formulas that disagree
lose energy without a word.  Measured here are how far p(rho, e(rho, p)) is off p, and the slopes of
the isentrope beside a state, between which c² has to lie.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hydro.eos.base import EquationOfState
from hydro.eos.torn_material import make_least_pressure
from regrid.errors import BadInput

SAMPLES = 64  # cells of a block that are looked at, besides its extremes
STEP = 1e-5  # of the density, along the isentrope
MOST_MISS = 1e-9  # of rho c²: from p to e and back
MOST_SLOPE = 0.01  # of c²
PUSH = 0.01  # of rho c²: a pressure beside that of a state
TORN = 0.4  # of the strength left, under tension: from half of it on c² is that of separate pieces


def measure_inverse(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> np.ndarray:
    """p(rho, e(rho, p)) - p [Pa]."""
    return eos.pressure(rho, eos.energy(rho, p)) - p


def measure_slopes(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> list[np.ndarray]:
    """dp/drho [m²/s²] along de = p/rho² drho: over a step down, over a step up in density.

    The midpoint rule; NaN where the material has no such states.
    """
    slopes = []
    for step in (-STEP * rho, STEP * rho):
        half = 0.5 * step
        try:
            e = eos.energy(rho, p)
            middle = eos.pressure(rho + half, e + p / rho**2 * half)
            there = eos.pressure(rho + step, e + middle / (rho + half) ** 2 * step)
        except BadInput:  # beyond a table
            there = np.full(rho.shape, np.nan)
        slopes.append((there - p) / step)
    return slopes


def say_inverse(rho: float, p: float, miss: float) -> str:
    """The sentence about a state whose energy has another pressure."""
    return (
        f"energy and pressure are not inverse: at rho = {rho:g}, p = {p:g} the pressure of the "
        f"energy is {miss:.3g} Pa off (p has to depend on e)"
    )


def say_slope(rho: float, p: float, square: float, slope: float) -> str:
    """The sentence about a state whose c² is another one."""
    return (
        f"the sound speed is not the slope of the isentrope: at rho = {rho:g}, p = {p:g} c² is "
        f"{square:.6g}, dp/drho {slope:.6g} m²/s²"
    )


def find_disagreement(eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> str | None:
    """The sentence about the worst of the states (n,), None where the formulas agree at all.

    Where a material has a kink, c² may be either slope or between them; at the edge of a table,
    where one of them is not known, it is not judged.
    """
    square = eos.sound_speed(rho, p) ** 2
    stiffness = rho * square
    for push in (0.0, PUSH):
        pushed = p + push * stiffness
        try:
            miss = np.abs(measure_inverse(eos, rho, pushed))
        except BadInput:  # beyond a table
            continue
        k = int(np.argmax(np.nan_to_num(miss / stiffness)))
        if miss[k] > MOST_MISS * stiffness[k]:
            return say_inverse(rho[k], pushed[k], miss[k])
    down, up = measure_slopes(eos, rho, p)
    eos_class: Any = type(eos)
    whole = p >= TORN * make_least_pressure(eos_class)(rho, eos.parameters)
    low, high = np.minimum(down, up), np.maximum(down, up)
    off = np.maximum(low - square, square - high) / square
    off = np.where(whole & np.isfinite(off), off, 0.0)
    k = int(off.argmax())
    if off[k] > MOST_SLOPE:
        return say_slope(rho[k], p[k], square[k], low[k] if square[k] < low[k] else high[k])
    return None


def check_formulas(block: str, eos: EquationOfState, rho: np.ndarray, p: np.ndarray) -> None:
    """Raise BadInput where the formulas disagree at states of a block's first (ni, nj)."""
    spread = np.linspace(0, rho.size - 1, min(SAMPLES, rho.size)).astype(np.int64)
    extremes = [field.argmin() for field in (rho, p)] + [field.argmax() for field in (rho, p)]
    at = np.unravel_index(np.unique(np.concatenate([spread, extremes])), rho.shape)
    with np.errstate(all="ignore"):
        found = find_disagreement(eos, rho[at], p[at])
    if found is not None:
        raise BadInput(f"block {block!r}: equation of state {eos.kind}: {found}")
