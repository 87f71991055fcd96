"""A flat line between two materials, hit by a shock that begins a part of a cell farther away.

All runs end at one time.  Exactly the line moves at u from the moment (gap + s)/D on, with the
shock's speed D and the line's u behind it, so that its last place is linear in s:

    x(t) = u (t - (gap + s)/D),    dx/ds = -u/D

and its speed is u whatever s is.  What is not linear depends on where in a cell and in a time step
the shock meets the line; a bent line meets it everywhere in both, and gets that as waves of a few
cells.  Note: all cells have to be equal, and no echo may come back, or s does matter.

A wavy line in one gas: a shock that passes leaves its waves flatter, and no others.

Where the same gas is on both sides the line is no more than a row of marked particles.  Each is
carried along at u from the moment when the shock, of speed D, reaches it:

    x(y, t) = u t + (1 - u/D) x(y, 0)

so that every mode is 1 - u/D of its first size (.20 for gamma 1.4 at Mach 5), for ever, and modes
that were not there are not there afterwards.  What else comes out is the scheme's own.  Note:
a run that ends before the shock has passed the line shows nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import msgspec
import numpy as np

from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.line import Mode, measure_mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.interface_instability.theories import get_kct

GAP = 0.25  # nearest first distance of the shock, in waves
AWAY = 0.25  # how far the shock is beyond the line at the end, in waves
LATE = 0.25  # last part of the time since it met the line over which the speed is taken
ROWS = 2  # cells across: nothing varies there


@dataclass(frozen=True)
class FlatLine:
    """What the runs gave, each array by `s` (n) [cells].

    `place` [cells]: last place of the line; `exact_slope`: -u/D; `late_speed`: its speed less the
    exact one, over D.
    """

    s: np.ndarray
    place: np.ndarray
    late_speed: np.ndarray
    exact_slope: float

    @property
    def unevenness(self) -> float:
        """Root mean square [cells] of the places about the straight line that fits them best."""
        return float(np.sqrt(np.mean((self.place - self._fit()) ** 2)))

    @property
    def slope_error(self) -> float:
        """Largest relative error of dx/ds between neighbours."""
        return float(np.abs(np.diff(self.place) / np.diff(self.s) / self.exact_slope - 1.0).max())

    @property
    def speed_scatter(self) -> float:
        """Largest departure of the late speed from its mean, over the shock's."""
        return float(np.abs(self.late_speed - self.late_speed.mean()).max())

    def _fit(self) -> np.ndarray:
        return np.polyval(np.polyfit(self.s, self.place, 1), self.s)


# the shock on its way, and cells of one size before and behind it
EVEN = {"start": "incident", "passage_refinement": 1.0, "reach": 0.25}


def sweep_flat_line(deck: InterfaceDeck, parts: int = 10) -> FlatLine:
    """One run for each s = 0, 1/parts ... 1 cell; the deck's materials, shock, cells and scheme."""
    size = 1.0 / deck.cells
    deck = msgspec.structs.replace(
        deck,
        modes=[Mode(ka0=0.0)],
        width=ROWS * size,
        sides="periodic",
        **EVEN,
        lengths=None,
        gap=GAP + size,
        second_shock=None,
    )
    farthest = InterfaceInstability(deck)
    base = farthest.linear_growth.base
    shock = farthest.shock
    since = AWAY * deck.wavelength / (base.right_wave.head - base.u)
    t_end = farthest.arrival + since
    run = msgspec.structs.replace(deck.run, t_end=t_end)
    lengths = InterfaceInstability(msgspec.structs.replace(deck, run=run)).choose_lengths()
    width = size * deck.wavelength
    even = tuple(float(width * np.ceil(length / width)) for length in lengths)
    deck = msgspec.structs.replace(deck, run=run, lengths=even, uniform=max(even) / deck.wavelength)
    s = np.linspace(0.0, 1.0, parts + 1)
    places = []
    speeds = []
    for part in s:
        t, x = _follow_line(msgspec.structs.replace(deck, gap=GAP + part * size))
        late = t > t_end - LATE * since
        places.append(x[-1] / width)
        speeds.append((np.polyfit(t[late], x[late], 1)[0] - base.u) / shock.shock_speed)
    return FlatLine(s, np.array(places), np.array(speeds), -base.u / shock.shock_speed)


def _follow_line(deck: InterfaceDeck) -> tuple[np.ndarray, np.ndarray]:
    """Times and places of the line in one run."""
    flow = InterfaceInstability(deck).build()
    way = []
    while flow.finished is None:
        flow.advance()
        way.append((flow.t, flow.blocks[0].nodes[0, -1, 0]))
    t, x = np.array(way).T
    return t, x


HIGHEST = 15  # mode looked at


@dataclass(frozen=True)
class NullLine:
    """Modes 1 to HIGHEST of the line at one k c t after the shock, over its first mode 1.

    `exact`: 1 - u/D, what the first mode is to be.
    """

    kct: float
    exact: float
    modes: np.ndarray

    @property
    def error(self) -> float:
        """First mode less the exact one."""
        return float(self.modes[0] - self.exact)

    @property
    def others(self) -> float:
        """Largest of the modes that ought not to be there."""
        return float(np.abs(self.modes[1:]).max())


def measure_null_line(
    deck: InterfaceDeck, ka0: float, times: Iterable[float] = (1.0, 4.0, 8.0)
) -> list[NullLine]:
    """The deck with its first material on both sides and one mode, at these k c t."""
    times = sorted(times)
    problem = InterfaceInstability(
        msgspec.structs.replace(
            deck,
            **EVEN,
            second=deck.first,
            modes=[Mode(ka0=ka0)],
            kct_end=times[-1],
            second_shock=None,
        )
    )
    flow = problem.build()
    found = []
    begun = _measure_modes(problem, flow)[0]
    exact = 1.0 - problem.shock.particle_speed / problem.shock.shock_speed
    for kct in times:
        while flow.finished is None and get_kct(problem, flow.t) < kct:
            flow.advance()
        found.append(NullLine(kct, exact, _measure_modes(problem, flow) / begun))
    return found


def _measure_modes(problem: InterfaceInstability, flow) -> np.ndarray:
    line = flow.blocks[0].nodes[:, -1, :]
    return np.array([measure_mode(line, problem.k, n, 0.0) for n in range(1, HIGHEST + 1)])
