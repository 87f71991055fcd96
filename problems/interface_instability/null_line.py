"""A wavy line in one gas: a shock that passes leaves its waves flatter, and no others.

Where the same gas is on both sides the line is no more than a row of marked particles.  Each is
carried along at u from the moment when the shock, of speed D, reaches it:

    x(y, t) = u t + (1 - u/D) x(y, 0)

so that every mode is 1 - u/D of its first size (.20 for gamma 1.4 at Mach 5), for ever, and modes
that were not there are not there afterwards.  What else comes out is the scheme's own.  The trap:
a run that ends before the shock has passed the line shows nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import msgspec
import numpy as np

from problems.interface_instability.deck import InterfaceDeck
from problems.interface_instability.modes import Mode, measure_mode
from problems.interface_instability.problem import InterfaceInstability
from problems.interface_instability.theories import get_kct

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
            start="incident",
            second=deck.first,
            modes=[Mode(ka0=ka0)],
            kct_end=times[-1],
            second_shock=None,
        )
    )
    flow, found = problem.build(), []
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
