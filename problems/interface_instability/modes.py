"""The harmonics of the interface: those of its first shape, and how large each is in a run.

A mode is `a cos(n k y + phase)` with k = 2 pi / wavelength and n its number.  Modes of one number
are one mode.  The trap: `Mode.ka0` of a deck is the amplitude times k of the *wavelength*, whatever
the number; the slope of mode n is n times that.
"""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from problems.deck import MOST_CELLS, DeckTable

ROUGH = 5  # harmonics from this one on are none of a gentle wave's own
NOTHING = 1e-12  # of the largest mode: what round-off leaves of modes that cancel


class Mode(DeckTable, kw_only=True):
    """One harmonic of the interface's first shape: x = (ka0 / k) cos(number k y + phase)."""

    number: Annotated[int, Meta(ge=1, le=MOST_CELLS, description="waves in one wavelength")] = 1
    ka0: Annotated[
        float, Meta(ge=-10, le=10, description="amplitude times k = 2 pi / wavelength")
    ] = 0.02
    phase: Annotated[float, Meta(description="phase [rad]; 0 or pi between walls")] = 0.0


@dataclass(frozen=True)
class Harmonic:
    """One mode of the first shape: `amplitude` [m], signed, along cos(number k y + phase)."""

    number: int
    amplitude: float
    phase: float

    @property
    def column(self) -> str:
        """The history's column of this mode."""
        return f"amplitude_mode_{self.number}"


def find_harmonics(modes: Iterable[Mode], wavenumber: float) -> list[Harmonic]:
    """The modes of a deck, those of one number added up, by number; none that is nothing.

    Phases 0 and pi are both phase 0, with the amplitude's sign.
    """
    sums: dict[int, complex] = {}
    for mode in modes:
        part = cmath.rect(mode.ka0, mode.phase) / wavenumber
        sums[mode.number] = sums.get(mode.number, 0.0) + part
    most = max((abs(whole) for whole in sums.values()), default=0.0)
    return [_make_harmonic(n, whole) for n, whole in sorted(sums.items()) if _is_there(whole, most)]


def _is_there(whole: complex, most: float) -> bool:
    return abs(whole) > NOTHING * most


def _make_harmonic(number: int, whole: complex) -> Harmonic:
    if abs(whole.imag) <= NOTHING * abs(whole):
        return Harmonic(number, whole.real, 0.0)
    return Harmonic(number, abs(whole), cmath.phase(whole))


def _weigh_nodes(y: np.ndarray) -> np.ndarray:
    """Lengths (n,) that nodes stand for in the trapezoidal rule."""
    steps = y[1:] - y[:-1]
    weight = np.zeros(len(y))
    weight[:-1] = steps
    weight[1:] += steps
    weight *= 0.5
    return weight


def measure_mode(line: np.ndarray, wavenumber: float, number: int, phase: float) -> float:
    """Amplitude of cos(number k y + phase) in the line x(y), `line` being its nodes (2, n) [m].

    Its Fourier coefficient by the trapezoidal rule along y, exact for evenly spaced nodes on whole
    halves of the mode's wavelength.  Where the line has rolled over, x counts backwards there.
    """
    x, y = line
    weight = _weigh_nodes(y)
    mean = (x * weight).sum() / weight.sum()
    wave = np.cos(number * wavenumber * y + phase)
    return float(((x - mean) * wave * weight).sum() / (wave * wave * weight).sum())


@functools.lru_cache(maxsize=8)
def _list_numbers(highest: int, left_out: tuple[int, ...]) -> np.ndarray:
    return np.array([number for number in range(ROUGH, highest) if number not in left_out])


def measure_roughness(
    line: np.ndarray, wavenumber: float, left_out: Iterable[int] = (), even: bool = True
) -> float:
    """Root of the sum of squares of the line's harmonics from ROUGH on [m], `left_out` not counted.

    Those that the nodes can show: below half a wave between two.  Of an `even` line (between walls)
    cosines alone, else harmonics of any phase.
    """
    x, y = line
    weight = _weigh_nodes(y) / (y[-1] - y[0])
    highest = math.ceil((len(y) - 1) * math.pi / (wavenumber * (y[-1] - y[0])) - NOTHING)
    numbers = _list_numbers(highest, tuple(left_out))
    phases = wavenumber * (numbers[:, None] * y)
    away = (x - (x * weight).sum()) * weight
    parts = np.cos(phases, out=phases if even else None) @ away
    if not even:
        parts = np.hypot(parts, np.sin(phases) @ away)
    return float(2.0 * np.sqrt((parts**2).sum()))
